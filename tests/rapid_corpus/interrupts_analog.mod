! @signal aiPressure=1
! @at 0.1 aiPressure=4
! @at 0.2 aiPressure=6
! @at 0.3 aiPressure=6.1
! @at 0.4 aiPressure=9
! @run 0.6
! @line high 6
! @line high 9
MODULE Analog
    VAR intnum pressure;
    PROC main()
        CONNECT pressure WITH onPressure;
        ISignalAI aiPressure, AIO_ABOVE_HIGH, 5, 2, 0.5, pressure;
        WaitTime 10;
    ENDPROC
    TRAP onPressure
        TPWrite "high " \Num:=AInput(aiPressure);
    ENDTRAP
ENDMODULE
