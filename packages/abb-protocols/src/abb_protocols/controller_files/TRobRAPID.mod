MODULE TRobRAPID
    ! Runs RAPID routines by name: write the inputs and routine_name_input, then raise RUN_RAPID_ROUTINE.
    ! Both arms see the same edge; the arm whose name is empty does nothing.

    LOCAL VAR string routine_name_input:="";
    LOCAL VAR speeddata move_speed_input:=[100,10,100,10];
    LOCAL VAR robtarget move_robtarget_input;
    LOCAL VAR jointtarget move_jointtarget_input;
    LOCAL VAR string callbyvar_name_input:="";
    LOCAL VAR num callbyvar_num_input:=0;
    LOCAL VAR string module_file_path_input:="";

    ! Whether the routine asked for last was none.
    LOCAL VAR bool is_routine_unknown:=FALSE;

    LOCAL VAR intnum intno_run_routine;

    PROC initializeRAPIDModule()
        routine_name_input:="";
        move_speed_input:=[100,10,100,10];
        move_robtarget_input:=CRobT();
        move_jointtarget_input:=CJointT();
        callbyvar_name_input:="";
        callbyvar_num_input:=0;
        module_file_path_input:="";

        IDelete intno_run_routine;
        CONNECT intno_run_routine WITH handleRunRAPIDRoutine;
        ISignalDI RUN_RAPID_ROUTINE,HIGH,intno_run_routine;
    ENDPROC

    ! Everything that may take time; called by the main loop. What is none of the routines below is a procedure of the
    ! task, which the controller looks up only now.
    PROC runRAPIDRoutine()
        IF NOT attemptSystemRoutine(routine_name_input) THEN
            TEST routine_name_input
            CASE "runMoveToCalibrationPosition":
                runMoveToCalibrationPosition;
            CASE "runMoveJ":
                runMoveJ;
            CASE "runMoveAbsJ":
                runMoveAbsJ;
            CASE "runCallByVar":
                runCallByVar;
            CASE "runModuleLoad","runModuleUnload":
                ! They have already run in the trap: nothing is left to do.
            DEFAULT:
                %routine_name_input%;
            ENDTEST
        ENDIF
        routine_name_input:="";
        current_state:=STATE_IDLE;
    ERROR(ERR_REFUNKPRC,ERR_CALLPROC)
        ! Any other error stops the program where it happens.
        TPWrite MSG_RAPID+inQuotes(routine_name_input)+" is unknown!";
        is_routine_unknown:=TRUE;
        TRYNEXT;
    ENDPROC

    LOCAL TRAP handleRunRAPIDRoutine
        IF routine_name_input<>"" THEN
            TPWrite MSG_RAPID+"Attempting "+inQuotes(routine_name_input);
            attemptInTrap;
            IF routine_name_input<>"" AND current_state=STATE_IDLE THEN
                is_routine_unknown:=FALSE;
                current_state:=STATE_RUN_RAPID_ROUTINE;
                RAISE CHANGE_STATE;
            ENDIF
        ENDIF
    ERROR(CHANGE_STATE)
        ! The long jump out of the trap, see TRobEGM.
        RAISE CHANGE_STATE;
    ENDTRAP

    ! The module routines keep their name, so an idle arm passes through STATE_RUN_RAPID_ROUTINE once: that is
    ! what clears the name, and what clients that wait for "busy, then idle" look for.
    LOCAL PROC attemptInTrap()
        IF attemptNonBlockingSystemRoutine(routine_name_input) THEN
            routine_name_input:="";
        ELSEIF routine_name_input="runModuleLoad" THEN
            runModuleLoad;
        ELSEIF routine_name_input="runModuleUnload" THEN
            runModuleUnload;
        ENDIF
    ENDPROC

    LOCAL PROC runMoveToCalibrationPosition()
        current_tool:=CTool();
        MoveAbsJ getCalibrationTarget()\NoEOffs,v100,fine,current_tool\WObj:=base_wobj;
    ERROR
        TPWrite MSG_RAPID+"'runMoveToCalibrationPosition' failed!";
        TRYNEXT;
    ENDPROC

    LOCAL PROC runMoveJ()
        current_tool:=CTool();
        MoveJ move_robtarget_input,move_speed_input,fine,current_tool\WObj:=base_wobj;
    ERROR
        TPWrite MSG_RAPID+"'runMoveJ' failed!";
        TRYNEXT;
    ENDPROC

    LOCAL PROC runMoveAbsJ()
        current_tool:=CTool();
        MoveAbsJ move_jointtarget_input\NoEOffs,move_speed_input,fine,current_tool\WObj:=base_wobj;
    ERROR
        TPWrite MSG_RAPID+"'runMoveAbsJ' failed!";
        TRYNEXT;
    ENDPROC

    ! Calls the procedure whose name is the text followed by the number, e.g. "custom_routine" and 0.
    LOCAL PROC runCallByVar()
        CallByVar callbyvar_name_input,callbyvar_num_input;
    ERROR
        TPWrite MSG_RAPID+"'runCallByVar' failed!";
        TRYNEXT;
    ENDPROC

    LOCAL PROC runModuleLoad()
        Load\Dynamic,module_file_path_input;
    ERROR
        ! A module that is already there is what was wanted.
        IF ERRNO<>ERR_LOADED THEN
            TPWrite MSG_RAPID+"'runModuleLoad' failed!";
        ENDIF
        TRYNEXT;
    ENDPROC

    LOCAL PROC runModuleUnload()
        UnLoad module_file_path_input;
    ERROR
        TPWrite MSG_RAPID+"'runModuleUnload' failed!";
        TRYNEXT;
    ENDPROC
ENDMODULE
