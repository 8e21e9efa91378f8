!@ robot irb120
!@ tool 0 0 80
!@ through 320 -40 150
!@ through 400 -40 150
!@ through 360 40 150
!@ plane 150 320 -40 400 40
!@ speed 100
MODULE Drawing
    PERS tooldata pen:=[TRUE,[[0,0,80],[1,0,0,0]],[0.1,[0,0,40],[1,0,0,0],0,0,0]];
    PERS wobjdata paper:=[FALSE,TRUE,"",[[320,-40,150],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
    CONST robtarget origin:=[[0,0,0],[0,0,1,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST speeddata slow:=[100,500,5000,1000];

    PROC main()
        ConfL\Off;
        ConfJ\Off;
        MoveJ Offs(origin,0,0,30),slow,fine,pen\WObj:=paper;
        MoveL origin,slow,fine,pen\WObj:=paper;
        MoveL Offs(origin,80,0,0),slow,fine,pen\WObj:=paper;
        MoveL Offs(origin,40,80,0),slow,fine,pen\WObj:=paper;
        MoveL origin,slow,fine,pen\WObj:=paper;
        MoveL Offs(origin,0,0,30),slow,fine,pen\WObj:=paper;
    ENDPROC
ENDMODULE
