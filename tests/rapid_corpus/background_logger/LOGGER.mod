MODULE Logger
    PERS string message := "";
    VAR intnum written;
    VAR num count := 0;
    PROC main()
        IDelete written;
        CONNECT written WITH onMessage;
        IPers message, written;
        WHILE TRUE DO
            WaitTime 1;
        ENDWHILE
    ENDPROC
    TRAP onMessage
        Incr count;
        TPWrite ValToStr(count) + ": " + message;
    ENDTRAP
ENDMODULE
