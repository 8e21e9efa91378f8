MODULE TimerLog
    !> wait 0.75
    !> file HOME:/ticks.txt tick 1\ntick 2\ntick 3\n
    VAR intnum timer;
    VAR num n := 0;
    VAR iodev f;

    TRAP Tick
        Incr n;
        Open "HOME:/ticks.txt", f\Append;
        Write f, "tick "\Num:=n;
        Close f;
        IF n = 3 IDelete timer;
    ENDTRAP

    PROC main()
        IF IsFile("HOME:/ticks.txt") RemoveFile "HOME:/ticks.txt";
        IDelete timer;
        CONNECT timer WITH Tick;
        ITimer 0.2, timer;
        WaitTime 100;
    ENDPROC
ENDMODULE