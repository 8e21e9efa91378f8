! @run 1.0
! @line attempt 1
! @line attempt 2
! @line attempt 3
! @line result 5
! @line gave up: 4 retries
MODULE Retrying
    VAR num attempts := 0;
    VAR num result;
    PROC main()
        result := risky(3);
        TPWrite "result " \Num:=result;
        hopeless;
        Stop;
    ERROR
        IF ERRNO = ERR_EXCRTYMAX THEN
            TPWrite "gave up: 4 retries";
            TRYNEXT;
        ENDIF
    ENDPROC
    FUNC num risky(num needed)
        attempt needed;
        RETURN 5;
    ERROR
        IF ERRNO = 17 THEN
            attempts := attempts;
            RETRY;
        ENDIF
    ENDFUNC
    PROC attempt(num needed)
        Incr attempts;
        TPWrite "attempt " \Num:=attempts;
        IF attempts < needed RAISE 17;
    ENDPROC
    PROC hopeless()
        VAR num x;
        x := 1 / 0;
    ERROR
        IF ERRNO = ERR_DIVZERO RETRY;
    ENDPROC
ENDMODULE
