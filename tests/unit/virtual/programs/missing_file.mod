MODULE MissingFile
    !> wait 0.2
    !> screen cannot open, using defaults
    !> screen limit 5
    VAR num limit := 5;

    PROC ReadLimit()
        VAR iodev f;
        Open "HOME:/no_such.txt", f\Read;
        limit := ReadNum(f);
        Close f;
    ERROR
        IF ERRNO = ERR_FILEOPEN THEN
            TPWrite "cannot open, using defaults";
            RETURN;
        ENDIF
    ENDPROC

    PROC main()
        ReadLimit;
        TPWrite "limit "\Num:=limit;
        WaitTime 100;
    ENDPROC
ENDMODULE