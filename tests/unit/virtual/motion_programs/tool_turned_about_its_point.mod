!@ robot irb120
!@ tool 30 0 90
!@ through 360 0 220
!@ stays 360 0 220 0.1
MODULE TurnedTool
    PERS tooldata probe:=[TRUE,[[30,0,90],[1,0,0,0]],[0.2,[0,0,50],[1,0,0,0],0,0,0]];
    CONST robtarget tip:=[[360,0,220],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];

    PROC main()
        ConfL\Off;
        ConfJ\Off;
        MoveJ tip,v500,fine,probe;
        WaitTime 0.1;
        MoveL RelTool(tip,0,0,0\Rz:=25),v200,fine,probe;
        MoveL RelTool(tip,0,0,0\Ry:=15),v200,fine,probe;
        MoveL tip,v200,fine,probe;
    ENDPROC
ENDMODULE
