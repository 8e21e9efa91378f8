MODULE CycleStatistics
    !> wait 1.0
    !> screen 3 cycles of 0.2 to 0.2 s
    VAR clock watch;
    VAR num times{3};

    PROC main()
        VAR num shortest := 1E6;
        VAR num longest := 0;
        FOR i FROM 1 TO 3 DO
            ClkReset watch;
            ClkStart watch;
            WaitTime 0.2;
            ClkStop watch;
            times{i} := ClkRead(watch\HighRes);
            shortest := Min(shortest, times{i});
            longest := Max(longest, times{i});
        ENDFOR
        TPWrite ValToStr(Dim(times, 1)) + " cycles of " + NumToStr(shortest, 1) + " to " + NumToStr(longest, 1) + " s";
        WaitTime 100;
    ENDPROC
ENDMODULE