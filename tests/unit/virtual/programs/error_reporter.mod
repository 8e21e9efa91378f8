MODULE ErrorReporter
    !> wait 0.2
    !> event Vacuum lost
    !> event Pump too hot
    !> screen Vacuum lost: no pressure at cup : 3
    !> screen handled in main: 5001
    VAR errnum ERR_PUMP := -1;

    PROC Pick(num cup)
        ErrWrite\W, "Vacuum lost", "no pressure at cup "\RL2:="" + ValToStr(cup);
        RAISE ERR_PUMP;
    ENDPROC

    PROC main()
        BookErrNo ERR_PUMP;
        ErrLog 4900\W, "Pump too hot", "check the filter", "pump", "1", "", "", "";
        Pick 3;
    ERROR
        IF ERRNO = ERR_PUMP THEN
            TPWrite "handled in main: "\Num:=ERRNO;
            WaitTime 100;
        ENDIF
    ENDPROC
ENDMODULE