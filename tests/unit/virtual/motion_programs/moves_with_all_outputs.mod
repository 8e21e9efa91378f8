!@ robot irb120
!@ through 350 -40 300
!@ through 350 40 300
!@ through 390 0 300
!@ value ticks 3
!@ value searched TRUE
!@ touch 6.0
MODULE AllOutputs
    CONST robtarget at:=[[350,-40,300],[0,0,1,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    PERS num ticks:=0;
    PERS bool searched:=FALSE;

    PROC main()
        VAR robtarget found;
        VAR triggdata empty;
        ticks:=0;
        searched:=FALSE;
        ConfL\Off;
        ConfJ\Off;
        MoveJDO at,v300,fine,tool0,custom_DO_0,1;
        IF DOutput(custom_DO_0)=1 Incr ticks;
        MoveCDO Offs(at,40,40,0),Offs(at,0,80,0),v100,fine,tool0,custom_DO_0,0;
        IF DOutput(custom_DO_0)=0 Incr ticks;
        MoveJSync Offs(at,0,80,20),v100,fine,tool0,"tick";
        TriggIO empty,5\DOp:=custom_DO_1,1;
        TriggDataReset empty;
        IF TriggDataValid(empty) Incr ticks;
        SearchC\Stop,custom_DI_0,found,Offs(at,60,40,20),Offs(at,0,0,20),v10,tool0;
        searched:=TRUE;
        WaitTime 0.1;
    ERROR
        IF ERRNO=ERR_WHLSEARCH TRYNEXT;
    ENDPROC

    PROC tick()
        Incr ticks;
    ENDPROC
ENDMODULE
