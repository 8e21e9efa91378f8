!@ robot irb120
!@ through 300 -100 260
!@ through 340 -100 260
!@ through 300 -60 260
!@ through 340 -60 260
!@ through 380 100 200
!@ value placed 4
MODULE Palletising
    CONST robtarget pick:=[[380,100,200],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST robtarget first_place:=[[300,-100,260],[0,0,1,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST num pitch:=40;
    PERS num placed:=0;

    PROC main()
        placed:=0;
        ConfL\Off;
        ConfJ\Off;
        MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]]\NoEOffs,v1000,fine,tool0;
        FOR row FROM 0 TO 1 DO
            FOR column FROM 0 TO 1 DO
                GetPart;
                PutPart Offs(first_place,column*pitch,row*pitch,0);
            ENDFOR
        ENDFOR
    ENDPROC

    PROC GetPart()
        MoveJ Offs(pick,0,0,60),vmax,z20,tool0;
        MoveL pick,v500,fine,tool0;
        MoveL Offs(pick,0,0,60),v500,z20,tool0;
    ENDPROC

    PROC PutPart(robtarget place)
        MoveJ Offs(place,0,0,60),vmax,z20,tool0;
        MoveL place,v500,fine,tool0;
        placed:=placed+1;
        MoveL Offs(place,0,0,60),v500,z20,tool0;
    ENDPROC
ENDMODULE
