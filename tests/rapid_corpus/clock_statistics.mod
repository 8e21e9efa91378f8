! @run 1.0
! @line mean 0.10 max 0.10
! @value n 3
MODULE Statistics
    VAR clock stopwatch;
    VAR num times{3};
    VAR num n := 0;
    PROC main()
        FOR i FROM 1 TO 3 DO
            ClkReset stopwatch;
            ClkStart stopwatch;
            WaitTime 0.1;
            ClkStop stopwatch;
            Incr n;
            times{n} := ClkRead(stopwatch);
        ENDFOR
        TPWrite "mean " + NumToStr(mean(times, n), 2) + " max " + NumToStr(Max(times{1}, times{2}), 2);
        Stop;
    ENDPROC
    FUNC num mean(num values{*}, num count)
        VAR num sum := 0;
        FOR i FROM 1 TO count DO
            sum := sum + values{i};
        ENDFOR
        RETURN sum / count;
    ENDFUNC
ENDMODULE
