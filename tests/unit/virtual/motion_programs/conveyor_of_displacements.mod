!@ robot irb120
!@ through 330 -60 250
!@ through 330 0 250
!@ through 330 60 250
MODULE Displaced
    CONST robtarget spot:=[[330,0,250],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];

    PROC main()
        ConfL\Off;
        ConfJ\Off;
        FOR lane FROM -1 TO 1 DO
            PDispSet [[0,lane*60,0],[1,0,0,0]];
            MoveJ Offs(spot,0,0,40),v500,z10,tool0;
            MoveL spot,v200,fine,tool0;
            MoveL Offs(spot,0,0,40),v200,z10,tool0;
            PDispOff;
        ENDFOR
    ENDPROC
ENDMODULE
