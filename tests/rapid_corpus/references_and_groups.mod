! @signal giMode=0 goCode=0
! @at 0.1 giMode=2
! @run 0.8
! @line unresolved names
! @line no event routine
! @line mode 2
! @line code 5
! @line retries: 6
MODULE References
    VAR intnum mode;
    VAR intnum code;
    VAR num attempts := 0;
    PROC main()
        check;
        IF EventType() = EVENT_NONE TPWrite "no event routine";
        CONNECT mode WITH onMode;
        ISignalGI giMode, mode;
        CONNECT code WITH onCode;
        ISignalGO \Single, goCode, code;
        WaitTime 0.2;
        SetGO goCode, 5;
        WaitTime 0.05;
        SetGO goCode, 6;
        persist;
        Stop;
    ENDPROC
    PROC check()
        CheckProgRef;
    ERROR
        IF ERRNO = ERR_LINKREF TPWrite "unresolved names";
        TRYNEXT;
    ENDPROC
    PROC persist()
        attempt;
        TPWrite "retries: " \Num:=attempts;
    ERROR
        IF RemainingRetries() < 2 ResetRetryCount;
        RETRY;
    ENDPROC
    PROC attempt()
        Incr attempts;
        IF attempts < 6 RAISE 3;
    ENDPROC
    PROC ofAnotherCell()
        OpenGate gate1;
    ENDPROC
    TRAP onMode
        TPWrite "mode " \Num:=GInput(giMode);
    ENDTRAP
    TRAP onCode
        TPWrite "code " \Num:=GOutput(goCode);
    ENDTRAP
ENDMODULE
