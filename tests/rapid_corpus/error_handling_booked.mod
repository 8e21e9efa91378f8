! @run 0.3
! @line pump: dry
! @line valve: stuck
! @line unknown error passed on
! @stop ERR_ARGVALERR
MODULE Booked
    VAR errnum ERR_DRY := -1;
    VAR errnum ERR_STUCK := -1;
    PROC main()
        BookErrNo ERR_DRY;
        BookErrNo ERR_STUCK;
        work ERR_DRY;
        work ERR_STUCK;
        work ERR_ARGVALERR;
    ENDPROC
    PROC work(errnum which)
        inner which;
    ERROR
        TEST ERRNO
        CASE ERR_DRY:
            TPWrite "pump: dry";
            TRYNEXT;
        CASE ERR_STUCK:
            TPWrite "valve: stuck";
            RETURN;
        DEFAULT:
            TPWrite "unknown error passed on";
            RAISE;
        ENDTEST
    ENDPROC
    PROC inner(errnum which)
        RAISE which;
    ENDPROC
ENDMODULE
