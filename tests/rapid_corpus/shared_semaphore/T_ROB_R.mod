MODULE SemaphoreR
    PERS bool zone := FALSE;
    PERS num inside := 0;
    PERS num overlaps := 0;
    PERS num entries := 0;
    PROC main()
        FOR i FROM 1 TO 3 DO
            WaitTestAndSet zone;
            Incr inside;
            Incr entries;
            WaitTime 0.05;
            IF inside <> 1 Incr overlaps;
            Decr inside;
            zone := FALSE;
            WaitTime 0.02;
        ENDFOR
        TPWrite "done";
        Stop;
    ENDPROC
ENDMODULE
