! @run 0.3
! @line open
! @line closed by UNDO
! @line long jump arrived
MODULE Undoing
    CONST errnum ERR_ABORT := 80;
    PROC main()
        outer;
        Stop;
    ERROR (ERR_ABORT)
        TPWrite "long jump arrived";
        TRYNEXT;
    ENDPROC
    PROC outer()
        guarded;
    ENDPROC
    PROC guarded()
        TPWrite "open";
        deepest;
        TPWrite "never";
    UNDO
        TPWrite "closed by UNDO";
    ENDPROC
    PROC deepest()
        RAISE ERR_ABORT;
    ERROR (ERR_ABORT)
        RAISE ERR_ABORT;
    ENDPROC
ENDMODULE
