! @signal doLock=1 doUnlock=0 diLocked=1 diUnlocked=0 diTool1=1 diTool2=1
! @at 0.2 diLocked=0
! @at 0.25 diUnlocked=1
! @at 0.5 diTool1=0
! @run 3.0
! @line tool 1 dropped
! @line ERR: tool 2 is not in its stand
! @ends doUnlock=1
! @ends doLock=0
MODULE ToolChanger
    PERS num current := 1;
    VAR errnum ERR_NO_TOOL := -1;
    PROC main()
        BookErrNo ERR_NO_TOOL;
        drop;
        pick 2;
        Stop;
    ERROR
        IF ERRNO = ERR_NO_TOOL THEN
            TPWrite "ERR: tool 2 is not in its stand";
            TRYNEXT;
        ENDIF
    ENDPROC
    PROC drop()
        VAR bool timedOut;
        Reset doLock;
        Set doUnlock;
        WaitUntil diLocked = 0 AND diUnlocked = 1 \MaxTime:=2 \TimeFlag:=timedOut;
        IF timedOut Stop;
        TPWrite "tool " + ValToStr(current) + " dropped";
        current := 0;
    ENDPROC
    PROC pick(num tool)
        WaitTime 0.4;
        IF tool = 2 AND DInput(diTool1) = 0 RAISE ERR_NO_TOOL;
        current := tool;
    ENDPROC
ENDMODULE
