!@ robot irb120
!@ speed 150
!@ through 340 60 300
MODULE Speeds
    CONST robtarget at:=[[340,-60,300],[0,0,1,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];

    PROC main()
        ConfL\Off;
        ConfJ\Off;
        AccSet 50,50;
        VelSet 50,150;
        MoveJ at,vmax,fine,tool0;
        MoveL Offs(at,0,120,0),v1000,fine,tool0;
        VelSet 100,5000;
        AccSet 100,100;
    ENDPROC
ENDMODULE
