! @signal diAbort=0
! @at 0.2 diAbort=1
! @run 0.6
! @line working
! @line aborted, cleaning up
! @line ready again
MODULE Abort
    CONST errnum ERR_ABORTED := 70;
    VAR intnum abort;
    PROC main()
        IDelete abort;
        CONNECT abort WITH onAbort;
        ISignalDI diAbort, high, abort;
        work;
        TPWrite "ready again";
        Stop;
    ENDPROC
    PROC work()
        TPWrite "working";
        WHILE TRUE DO
            WaitTime 0.05;
        ENDWHILE
    ERROR (ERR_ABORTED)
        TPWrite "aborted, cleaning up";
        RETURN;
    ENDPROC
    TRAP onAbort
        RAISE ERR_ABORTED;
    ERROR (ERR_ABORTED)
        RAISE ERR_ABORTED;
    ENDTRAP
ENDMODULE
