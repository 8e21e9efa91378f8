! @run 1
! @line LOGGER 1: first
! @line LOGGER 2: second
MODULE Talker
    PERS string message;
    PROC main()
        WaitTime 0.05;
        message := "first";
        WaitTime 0.1;
        message := "second";
        Stop;
    ENDPROC
ENDMODULE
