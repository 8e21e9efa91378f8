MODULE TRobWatchdog
    ! Stops the program when whoever guides the arm falls silent, or asks for it. A client writes TRUE into active and
    ! check_external_status, then sets WD_EXTERNAL_STATUS to 1 again and again; it is taken back here, so that each 1 is
    ! an edge. WD_STOP_REQUEST stops both arms and the program at once. Neither replaces an emergency stop.

    VAR bool active:=FALSE;
    VAR bool check_external_status:=FALSE;
    ! How long the client may be silent [s].
    VAR num external_timeout:=5;

    LOCAL CONST num PERIOD:=0.1;
    ! A tick that comes so late waited for another trap, as the client's edges did [s].
    LOCAL CONST num LATE:=0.5;

    LOCAL VAR clock silence;
    LOCAL VAR clock since_tick;
    LOCAL VAR intnum intno_tick;
    LOCAL VAR intnum intno_external_status;
    LOCAL VAR intnum intno_stop_request;

    PROC initializeWatchdogModule()
        active:=FALSE;
        check_external_status:=FALSE;
        external_timeout:=5;
        restartClock silence;
        restartClock since_tick;
        IDelete intno_tick;
        CONNECT intno_tick WITH handleTick;
        ITimer PERIOD,intno_tick;
        IDelete intno_external_status;
        CONNECT intno_external_status WITH handleExternalStatus;
        ISignalDO WD_EXTERNAL_STATUS,HIGH,intno_external_status;
        IDelete intno_stop_request;
        CONNECT intno_stop_request WITH handleStopRequest;
        ISignalDI WD_STOP_REQUEST,HIGH,intno_stop_request;
    ENDPROC

    LOCAL TRAP handleTick
        VAR bool was_held;

        ! A 1 that came while the program stood raised no interrupt, and hides the edges of those that follow.
        IF DOutput(WD_EXTERNAL_STATUS)=1 Reset WD_EXTERNAL_STATUS;
        was_held:=ClkRead(since_tick)>LATE;
        restartClock since_tick;
        IF was_held OR NOT (active AND check_external_status) THEN
            restartClock silence;
        ELSEIF ClkRead(silence)>external_timeout THEN
            restartClock silence;
            stopProgram "No sign of life for "+NumToStr(external_timeout,1)+" s";
        ENDIF
    ENDTRAP

    ! Both arms see the edge, whichever of them takes the signal back first.
    LOCAL TRAP handleExternalStatus
        restartClock silence;
        Reset WD_EXTERNAL_STATUS;
    ENDTRAP

    LOCAL TRAP handleStopRequest
        IF active stopProgram "Stop requested by WD_STOP_REQUEST";
    ENDTRAP

    LOCAL PROC stopProgram(string reason)
        TPWrite MSG_WATCHDOG+reason;
        ErrWrite "Stopped by the watchdog",reason\RL2:=GetTaskName();
        ! Stop would wait for the end of the movement, which one that EGM guides does not have.
        SystemStopAction\Stop;
    ENDPROC

    LOCAL PROC restartClock(VAR clock watch)
        ClkStop watch;
        ClkReset watch;
        ClkStart watch;
    ENDPROC
ENDMODULE
