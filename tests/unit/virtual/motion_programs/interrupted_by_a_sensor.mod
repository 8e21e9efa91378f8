!@ robot irb120
!@ touch 1.2
!@ through 350 -80 300
!@ through 350 80 300
!@ value stops 1
MODULE Interrupted
    CONST robtarget begin:=[[350,-80,300],[0,0,1,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    VAR intnum on_touch;
    PERS num stops:=0;

    PROC main()
        stops:=0;
        ConfL\Off;
        ConfJ\Off;
        IDelete on_touch;
        CONNECT on_touch WITH pause;
        ISignalDI\Single,custom_DI_0,1,on_touch;
        MoveJ begin,v500,fine,tool0;
        MoveL Offs(begin,0,160,0),v50,fine,tool0;
    ENDPROC

    TRAP pause
        StopMove\Quick;
        stops:=stops+1;
        WaitTime 0.3;
        StartMove;
    ENDTRAP
ENDMODULE
