!@ robot irb120
!@ through 380 0 250
!@ through 350 30 250
!@ through 320 0 250
!@ through 350 -30 250
!@ speed 80
MODULE Circles
    CONST robtarget centre:=[[350,0,250],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];

    PROC main()
        CONST num r:=30;
        CONST speeddata v80s:=[80,500,5000,1000];
        ConfL\Off;
        ConfJ\Off;
        MoveJ Offs(centre,r,0,0),v80s,fine,tool0;
        MoveC Offs(centre,0,r,0),Offs(centre,-r,0,0),v80s,z5,tool0;
        MoveC Offs(centre,0,-r,0),Offs(centre,r,0,0),v80s,fine,tool0;
    ENDPROC
ENDMODULE
