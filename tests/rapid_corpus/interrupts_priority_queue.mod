! @signal diA=0 diB=0
! @at 0.1 diA=1
! @at 0.1 diB=1
! @run 0.6
! @line A
! @line B
! @line queued while disabled: 1
MODULE Queue
    VAR intnum a;
    VAR intnum b;
    VAR intnum timer;
    VAR num late := 0;
    PROC main()
        CONNECT a WITH trapA;
        CONNECT b WITH trapB;
        ISignalDI diA, high, a;
        ISignalDI \Single, diB, high, b;
        WaitTime 0.3;
        CONNECT timer WITH trapTimer;
        IDisable;
        ITimer \Single, 0.05, timer;
        WaitTime 0.1;
        IF late <> 0 TPWrite "not queued";
        IEnable;
        WaitTime 0.05;
        TPWrite "queued while disabled: " \Num:=late;
        Stop;
    ENDPROC
    TRAP trapA
        TPWrite "A";
        WaitTime 0.02;
    ENDTRAP
    TRAP trapB
        TPWrite "B";
    ENDTRAP
    TRAP trapTimer
        Incr late;
    ENDTRAP
ENDMODULE
