MODULE TRobSG
    ! Commands to the Smart Gripper of one arm: write command_input (and target_position_input), then raise
    ! RUN_SG_ROUTINE. Both arms see the edge; an arm with COMMAND_NONE does nothing. The trap does the work itself, so
    ! the gripper obeys in any state, also while EGM moves the arm.

    LOCAL RECORD SGSettings
        num max_speed;
        num hold_force;
        num physical_limit;
    ENDRECORD

    LOCAL CONST num COMMAND_NONE:=0;
    LOCAL CONST num COMMAND_INITIALIZE:=1;
    LOCAL CONST num COMMAND_CALIBRATE:=2;
    LOCAL CONST num COMMAND_MOVE_TO:=3;
    LOCAL CONST num COMMAND_GRIP_IN:=4;
    LOCAL CONST num COMMAND_GRIP_OUT:=5;
    LOCAL CONST num COMMAND_BLOW_ON_1:=6;
    LOCAL CONST num COMMAND_BLOW_ON_2:=7;
    LOCAL CONST num COMMAND_BLOW_OFF_1:=8;
    LOCAL CONST num COMMAND_BLOW_OFF_2:=9;
    LOCAL CONST num COMMAND_VACUUM_ON_1:=10;
    LOCAL CONST num COMMAND_VACUUM_ON_2:=11;
    LOCAL CONST num COMMAND_VACUUM_OFF_1:=12;
    LOCAL CONST num COMMAND_VACUUM_OFF_2:=13;

    ! mm/s, N and mm per finger, as the gripper's manual gives them.
    LOCAL CONST num MAX_SPEED:=25;
    LOCAL CONST num MAX_FORCE:=20;
    LOCAL CONST num MAX_PHYSICAL_LIMIT:=25;

    LOCAL CONST string COMMAND_TEXTS{14}:=["No command","Initialize gripper","Calibrate gripper","Move gripper to",
        "Grip inwards","Grip outwards","Turn on blow 1","Turn on blow 2","Turn off blow 1","Turn off blow 2",
        "Turn on vacuum 1","Turn on vacuum 2","Turn off vacuum 1","Turn off vacuum 2"];

    VAR num command_input:=COMMAND_NONE;
    VAR num target_position_input:=0;
    LOCAL VAR SGSettings settings;
    LOCAL VAR intnum intno_run_sg_routine;

    PROC initializeSGModule()
        command_input:=COMMAND_NONE;
        target_position_input:=0;
        settings:=[MAX_SPEED,MAX_FORCE/2,MAX_PHYSICAL_LIMIT];

        IDelete intno_run_sg_routine;
        CONNECT intno_run_sg_routine WITH handleRunSGRoutine;
        ISignalDI RUN_SG_ROUTINE,HIGH,intno_run_sg_routine;
    ENDPROC

    LOCAL TRAP handleRunSGRoutine
        IF command_input<>COMMAND_NONE THEN
            parseInputs;
            TPWrite MSG_SG+"Received command "+ValToStr(command_input)+" ("+commandText()+")";
            IF RobOS() THEN
                runCommand;
            ELSE
                TPWrite MSG_SG+"Virtual controller (gripper is not simulated)";
            ENDIF
            command_input:=COMMAND_NONE;
        ENDIF
    ENDTRAP

    ! What is out of range is moved to the nearest bound and written back, where the client can read it.
    LOCAL PROC parseInputs()
        command_input:=limited(Round(command_input),COMMAND_VACUUM_OFF_2);
        settings.max_speed:=limited(settings.max_speed,MAX_SPEED);
        settings.hold_force:=limited(settings.hold_force,MAX_FORCE);
        settings.physical_limit:=limited(settings.physical_limit,MAX_PHYSICAL_LIMIT);
        target_position_input:=limited(target_position_input,settings.physical_limit);
    ENDPROC

    LOCAL FUNC num limited(num value,num highest)
        IF value<0 RETURN 0;
        IF value>highest RETURN highest;
        RETURN value;
    ENDFUNC

    LOCAL FUNC string commandText()
        IF command_input=COMMAND_MOVE_TO THEN
            RETURN COMMAND_TEXTS{command_input+1}+" "+ValToStr(target_position_input);
        ENDIF
        RETURN COMMAND_TEXTS{command_input+1};
    ENDFUNC

    ! A gripper that fails must not stop the arm: the driver has logged why, the command counts as done.
    LOCAL PROC runCommand()
        IF command_input=COMMAND_INITIALIZE THEN
            g_Init\maxSpd:=settings.max_speed\holdForce:=settings.hold_force\phyLimit:=settings.physical_limit;
        ELSEIF command_input=COMMAND_CALIBRATE THEN
            g_Calibrate\Jog;
        ELSEIF g_IsCalibrated() THEN
            runCalibratedCommand;
        ELSE
            TPWrite MSG_SG+"Gripper is not calibrated";
        ENDIF
    ERROR
        TPWrite MSG_SG+"Command failed, error number "\Num:=ERRNO;
        TRYNEXT;
    ENDPROC

    ! Fingers start to move and the trap ends: a trap that waits would hold back EGM_STOP.
    LOCAL PROC runCalibratedCommand()
        TEST command_input
        CASE COMMAND_MOVE_TO:
            g_MoveTo target_position_input\NoWait;
        CASE COMMAND_GRIP_IN:
            g_GripIn\holdForce:=settings.hold_force\NoWait;
        CASE COMMAND_GRIP_OUT:
            g_GripOut\holdForce:=settings.hold_force\NoWait;
        CASE COMMAND_BLOW_ON_1:
            g_BlowOn1;
        CASE COMMAND_BLOW_ON_2:
            g_BlowOn2;
        CASE COMMAND_BLOW_OFF_1:
            g_BlowOff1;
        CASE COMMAND_BLOW_OFF_2:
            g_BlowOff2;
        CASE COMMAND_VACUUM_ON_1:
            g_VacuumOn1;
        CASE COMMAND_VACUUM_ON_2:
            g_VacuumOn2;
        CASE COMMAND_VACUUM_OFF_1:
            g_VacuumOff1;
        CASE COMMAND_VACUUM_OFF_2:
            g_VacuumOff2;
        ENDTEST
    ENDPROC
ENDMODULE
