!@ robot irb120
!@ through 360 -50 240
!@ rises custom_DO_2 360 -50 240 1
!@ falls custom_DO_2 360 50 240 1
MODULE Spraying
    CONST robtarget left_edge:=[[360,-50,240],[0,0,1,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];

    PROC main()
        ConfL\Off;
        ConfJ\Off;
        MoveJ Offs(left_edge,0,0,30),v500,z5,tool0;
        MoveLDO left_edge,v200,fine,tool0,custom_DO_2,1;
        MoveLDO Offs(left_edge,0,100,0),v200,fine,tool0,custom_DO_2,0;
        MoveL Offs(left_edge,0,100,30),v200,fine,tool0;
    ENDPROC
ENDMODULE
