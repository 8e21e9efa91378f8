! @module HOME:/a.mod MODULE A PROC part() TPWrite "part A"; ENDPROC ENDMODULE
! @module HOME:/b.mod MODULE B PROC part() TPWrite "part B"; ENDPROC ENDMODULE
! @run 0.5
! @line part A
! @line part B
! @line not loading
! @line cancelled
! @line no B
MODULE BackgroundLoader
    VAR loadsession session;
    PROC main()
        StartLoad "HOME:/a.mod", session;
        WaitLoad session;
        part;
        StartLoad \Dynamic, "HOME:" \File:="b.mod", session;
        WaitLoad \UnloadPath:="HOME:/a.mod", session \CheckRef;
        part;
        waitAgain;
        EraseModule "B";
        StartLoad "HOME:/a.mod", session;
        CancelLoad session;
        TPWrite "cancelled";
        IF NOT ModExist("B") TPWrite "no B";
        Stop;
    ENDPROC
    PROC waitAgain()
        WaitLoad session;
    ERROR
        IF ERRNO = ERR_LOADNO_NOUSE TPWrite "not loading";
        TRYNEXT;
    ENDPROC
ENDMODULE
