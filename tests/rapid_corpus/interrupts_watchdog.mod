! @signal diLife=0 doAlarm=0
! @at 0.3 diLife=1
! @at 0.6 diLife=0
! @run 2.0
! @value beats 2
! @line no sign of life
! @ends doAlarm=1
MODULE Watchdog
    CONST num LIMIT := 0.5;
    VAR intnum life;
    VAR intnum tick;
    VAR num beats := 0;
    VAR clock since;
    VAR bool isLost := FALSE;
    PROC main()
        IDelete life;
        CONNECT life WITH onLife;
        ISignalDI diLife, edge, life;
        CONNECT tick WITH onTick;
        ITimer 0.1, tick;
        ClkReset since;
        ClkStart since;
        WaitUntil isLost;
        TPWrite "no sign of life";
        SetDO doAlarm, 1;
        IDelete tick;
        WaitTime 10;
    ENDPROC
    TRAP onLife
        Incr beats;
        ClkStop since;
        ClkReset since;
        ClkStart since;
    ENDTRAP
    TRAP onTick
        IF beats > 0 AND ClkRead(since) > LIMIT isLost := TRUE;
    ENDTRAP
ENDMODULE
