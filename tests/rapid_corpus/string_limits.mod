! @run 0.3
! @line 80 characters fit
! @line 81 do not
! @value text ""
MODULE Limits
    VAR string forty := "0123456789012345678901234567890123456789";
    VAR string text := "";
    VAR string eighty;
    PROC main()
        eighty := forty + forty;
        TPWrite ValToStr(StrLen(eighty)) + " characters fit";
        text := eighty + "x";
        Stop;
    ERROR
        IF ERRNO = ERR_STRTOOLNG THEN
            TPWrite "81 do not";
            TRYNEXT;
        ENDIF
    ENDPROC
ENDMODULE
