! @run 0.3
! @line shift 1: 3 good, 1 bad
! @line shift 2: 1 good, 1 bad
MODULE Batch
    CONST bool RESULTS{6} := [TRUE, TRUE, FALSE, TRUE, FALSE, TRUE];
    CONST num SHIFT_END{2} := [4, 6];
    PROC main()
        VAR num start := 1;
        VAR num good;
        VAR num bad;
        FOR shift FROM 1 TO 2 DO
            count start, SHIFT_END{shift}, good, bad;
            TPWrite "shift " + ValToStr(shift) + ": " + ValToStr(good) + " good, " + ValToStr(bad) + " bad";
            start := SHIFT_END{shift} + 1;
        ENDFOR
        Stop;
    ENDPROC
    PROC count(num first, num last, VAR num good, VAR num bad)
        good := 0;
        bad := 0;
        FOR i FROM first TO last DO
            IF RESULTS{i} THEN Incr good; ELSE Incr bad; ENDIF
        ENDFOR
    ENDPROC
ENDMODULE
