! @run 0.5
! @line normal TRUE none TRUE
! @line trap TRUE
! @line handler TRUE retries 3
! @line renamed: original
MODULE Where
    VAR intnum timer;
    VAR num original := 5;
    VAR num failures := 0;
    PROC main()
        TPWrite "normal " + ValToStr(ExecLevel() = LEVEL_NORMAL) + " none " + ValToStr(ExecHandler() = HANDLER_NONE);
        CONNECT timer WITH onTimer;
        ITimer \Single, 0.05, timer;
        WaitTime 0.1;
        failing;
        named original;
        Stop;
    ENDPROC
    TRAP onTimer
        TPWrite "trap " + ValToStr(ExecLevel() = LEVEL_TRAP);
    ENDTRAP
    PROC failing()
        attempt;
    ERROR
        IF failures = 2 TPWrite "handler " + ValToStr(ExecHandler() = HANDLER_ERR) + " retries " + ValToStr(RemainingRetries());
        RETRY;
    ENDPROC
    PROC attempt()
        Incr failures;
        IF failures < 3 RAISE 5;
    ENDPROC
    PROC named(num parameter)
        TPWrite "renamed: " + ArgName(parameter);
    ENDPROC
ENDMODULE
