! @signal diReady=0
! @at 1.0 diReady=1
! @run 2.0
! @line timeout 1
! @line timeout 2
! @line ready
MODULE Timeouts
    VAR num timeouts := 0;
    PROC main()
        waitReady;
        TPWrite "ready";
        Stop;
    ENDPROC
    PROC waitReady()
        WaitDI diReady, 1 \MaxTime:=0.4;
    ERROR
        IF ERRNO = ERR_WAIT_MAXTIME THEN
            Incr timeouts;
            TPWrite "timeout " \Num:=timeouts;
            RETRY;
        ENDIF
    ENDPROC
ENDMODULE
