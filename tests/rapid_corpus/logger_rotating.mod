! @run 0.5
! @file HOME:/log0.txt 1;start\n2;run\n
! @file HOME:/log1.txt 3;stop\n
MODULE LoggerModule
    ! Writes events into files of two lines each.
    CONST num LINES_A_FILE := 2;
    VAR iodev logFile;
    VAR num written := 0;
    VAR num fileNumber := 0;
    VAR bool isOpen := FALSE;

    PROC main()
        logEvent "start";
        logEvent "run";
        logEvent "stop";
        closeLog;
        Stop;
    ENDPROC

    PROC logEvent(string text)
        IF written > 0 AND written MOD LINES_A_FILE = 0 THEN
            closeLog;
            Incr fileNumber;
        ENDIF
        IF NOT isOpen THEN
            Open "HOME:" \File:="log" + ValToStr(fileNumber) + ".txt", logFile \Write;
            isOpen := TRUE;
        ENDIF
        Incr written;
        Write logFile, NumToStr(written, 0) + ";" + text;
    ENDPROC

    PROC closeLog()
        IF isOpen Close logFile;
        isOpen := FALSE;
    ENDPROC
ENDMODULE
