!@ robot irb120
!@ through 350 0 300
!@ value reachable 1
MODULE ReachAsked
    CONST robtarget candidates{3}:=[[[350,0,300],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],
        [[900,0,300],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[[0,0,2000],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]]];
    PERS num reachable:=0;

    PROC main()
        reachable:=0;
        FOR i FROM 1 TO 3 DO
            IF IsReachable(candidates{i}) THEN
                reachable:=reachable+1;
                MoveJ candidates{i},v500,fine,tool0;
            ENDIF
        ENDFOR
    ENDPROC

    FUNC bool IsReachable(robtarget target)
        VAR jointtarget joints;
        joints:=CalcJointT(target,tool0);
        RETURN TRUE;
    ERROR
        RETURN FALSE;
    ENDFUNC
ENDMODULE
