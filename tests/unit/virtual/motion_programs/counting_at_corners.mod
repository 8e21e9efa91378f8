!@ robot irb120
!@ value count 3
!@ through 350 0 330
MODULE CornerCount
    CONST robtarget start_point:=[[350,0,330],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    PERS num count:=0;

    PROC main()
        count:=0;
        ConfL\Off;
        ConfJ\Off;
        MoveJ start_point,v500,fine,tool0;
        MoveLSync Offs(start_point,0,60,0),v200,z10,tool0,"tick";
        MoveLSync Offs(start_point,0,60,-60),v200,z10,tool0,"tick";
        MoveLSync Offs(start_point,0,0,-60),v200,fine,tool0,"tick";
        WaitTime 0.1;
    ENDPROC

    PROC tick()
        count:=count+1;
    ENDPROC
ENDMODULE
