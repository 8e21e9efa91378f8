!@ robot yumi
!@ value waves 3
!@ joint 6 40
MODULE YumiWave
    CONST jointtarget ready:=[[20,-100,20,0,60,0],[-110,9E9,9E9,9E9,9E9,9E9]];
    PERS num waves:=0;

    PROC main()
        VAR jointtarget side;
        waves:=0;
        side:=ready;
        MoveAbsJ ready\NoEOffs,v1000,fine,tool0;
        FOR i FROM 1 TO 3 DO
            side.robax.rax_6:=40;
            MoveAbsJ side\NoEOffs,v1000,z50,tool0;
            side.robax.rax_6:=-40;
            MoveAbsJ side\NoEOffs,v1000,z50,tool0;
            waves:=waves+1;
        ENDFOR
        MoveAbsJ ready\NoEOffs,v1000,fine,tool0;
    ENDPROC
ENDMODULE
