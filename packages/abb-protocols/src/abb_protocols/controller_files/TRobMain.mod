MODULE TRobMain
    ! The state machine of one arm. Requests arrive as rising edges of I/O signals; the traps that receive them set
    ! the new state and raise CHANGE_STATE, a long jump that abandons whatever the loop below was waiting in.

    CONST num VERSION:=1.1;

    CONST num STATE_IDLE:=0;
    CONST num STATE_INITIALIZE:=1;
    CONST num STATE_RUN_RAPID_ROUTINE:=2;
    CONST num STATE_RUN_EGM_ROUTINE:=3;

    VAR num current_state:=STATE_INITIALIZE;
    VAR errnum CHANGE_STATE:=-1;
    VAR num idle_counter:=0;

    PROC main()
        TPErase;
        initializeSubmodules;
        TPWrite MSG_MAIN+"Starting StateMachine loop";
        WHILE TRUE DO
            TEST current_state
            CASE STATE_RUN_RAPID_ROUTINE:
                runRAPIDRoutine;
            CASE STATE_RUN_EGM_ROUTINE:
                runEGMRoutine;
            DEFAULT:
                runIdle;
            ENDTEST
            WaitTime 0.01;
        ENDWHILE
    ERROR(CHANGE_STATE)
        idle_counter:=0;
        TRYNEXT;
    ENDPROC

    ! Interrupts that are connected here wait until all of it is done: a trap must not meet half a module.
    LOCAL PROC initializeSubmodules()
        IDisable;
        current_state:=STATE_INITIALIZE;
        BookErrNo CHANGE_STATE;
        initializeUtilityModule;
        initializeRAPIDModule;
        initializeEGMModule;
        initializeGripper;
        initializeWatchdog;
        initializeSystemModule;
        idle_counter:=0;
        current_state:=STATE_IDLE;
        IEnable;
    ENDPROC

    ! Called by name, which the controller looks up only now: a robot without Smart Grippers has no TRobSG.
    LOCAL PROC initializeGripper()
        %"initializeSGModule"%;
    ERROR
        IF ERRNO=ERR_REFUNKPRC THEN
            TPWrite MSG_MAIN+"No TRobSG, RUN_SG_ROUTINE does nothing";
            TRYNEXT;
        ENDIF
        RAISE;
    ENDPROC

    ! The same for a robot whose SYS.cfg does not load TRobWatchdog.
    LOCAL PROC initializeWatchdog()
        %"initializeWatchdogModule"%;
    ERROR
        IF ERRNO=ERR_REFUNKPRC THEN
            TPWrite MSG_MAIN+"No TRobWatchdog, the driver is not watched";
            TRYNEXT;
        ENDIF
        RAISE;
    ENDPROC

    ! One message on entry, then one about every ten seconds.
    LOCAL PROC runIdle()
        IF idle_counter MOD 1000=0 THEN
            idle_counter:=0;
            TPWrite MSG_MAIN+"Idling...";
        ENDIF
        idle_counter:=idle_counter+1;
    ENDPROC
ENDMODULE
