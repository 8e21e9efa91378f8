MODULE TRobEGM
    ! Externally Guided Motion of one YuMi arm. An edge starts or stops an action on both arms at once; write
    ! allow_egm_motions FALSE into the settings of the arm that shall stand still.

    LOCAL RECORD EGMSetupUCSettings
        bool use_filtering;
        num comm_timeout;
    ENDRECORD

    LOCAL RECORD EGMActivateSettings
        tooldata tool;
        wobjdata wobj;
        pose correction_frame;
        pose sensor_frame;
        num cond_min_max;
        num lp_filter;
        num sample_rate;
        num max_speed_deviation;
    ENDRECORD

    LOCAL RECORD EGMRunSettings
        num cond_time;
        num ramp_in_time;
        pose offset;
        num pos_corr_gain;
    ENDRECORD

    LOCAL RECORD EGMStopSettings
        num ramp_out_time;
    ENDRECORD

    LOCAL RECORD EGMSettings
        bool allow_egm_motions;
        bool use_presync;
        EGMSetupUCSettings setup_uc;
        EGMActivateSettings activate;
        EGMRunSettings run;
        EGMStopSettings stop;
    ENDRECORD

    LOCAL CONST num ACTION_NONE:=0;
    LOCAL CONST num ACTION_RUN_JOINT:=1;
    LOCAL CONST num ACTION_RUN_POSE:=2;
    LOCAL CONST num ACTION_STOP:=3;
    LOCAL CONST num ACTION_START_STREAM:=4;
    LOCAL CONST num ACTION_STOP_STREAM:=5;

    ! How long one arm waits for the other when use_presync is TRUE [s].
    LOCAL CONST num PRESYNC_TIMEOUT:=10;

    LOCAL VAR EGMSettings settings;
    LOCAL VAR num current_action:=ACTION_NONE;

    LOCAL VAR egmident egm_id;
    LOCAL VAR egm_minmax convergence;

    LOCAL VAR intnum intno_start_joint;
    LOCAL VAR intnum intno_start_pose;
    LOCAL VAR intnum intno_start_stream;
    LOCAL VAR intnum intno_stop;
    LOCAL VAR intnum intno_stop_stream;

    ! EGM takes persistent tool and work object data only, so the settings are copied here before use.
    TASK PERS tooldata egm_tool:=[TRUE,[[0,0,0],[1,0,0,0]],[0.001,[0,0,0.001],[1,0,0,0],0,0,0]];
    TASK PERS wobjdata egm_wobj:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];

    ! Known to both arms under the same name: a synchronisation point is a name.
    VAR syncident egm_presync;
    PERS tasks egm_presync_tasks{2}:=[["T_ROB_R"],["T_ROB_L"]];

    PROC initializeEGMModule()
        current_action:=ACTION_NONE;
        EGMReset egm_id;
        EGMGetId egm_id;
        setDefaultSettings;
        connectInterrupts;
    ENDPROC

    ! Called by the main loop in STATE_RUN_EGM_ROUTINE; returns when the action is over.
    PROC runEGMRoutine()
        parseSettings;
        TEST current_action
        CASE ACTION_RUN_JOINT:
            runJointMotion;
        CASE ACTION_RUN_POSE:
            runPoseMotion;
        CASE ACTION_STOP:
            stopMotion;
        CASE ACTION_START_STREAM:
            startStream;
        CASE ACTION_STOP_STREAM:
            stopStream;
        ENDTEST
        current_state:=STATE_IDLE;
    ERROR
        ! TRYNEXT goes on after the call of the action, so the arm is idle again in both cases.
        IF ERRNO=ERR_UDPUC_COMM THEN
            TPWrite MSG_EGM+"Communication timed out";
            current_action:=ACTION_NONE;
            TRYNEXT;
        ELSEIF ERRNO=ERR_WAITSYNCTASK THEN
            TPWrite MSG_EGM+"Pre-synchronization timed out";
            current_action:=ACTION_NONE;
            TRYNEXT;
        ELSE
            RAISE;
        ENDIF
    ENDPROC

    ! Slow on purpose: who has not chosen a speed gets one degree per second.
    LOCAL PROC setDefaultSettings()
        settings.allow_egm_motions:=TRUE;
        settings.use_presync:=FALSE;
        settings.setup_uc:=[TRUE,1];
        settings.activate.tool:=tool0;
        settings.activate.wobj:=base_wobj;
        settings.activate.correction_frame:=[[0,0,0],[1,0,0,0]];
        settings.activate.sensor_frame:=[[0,0,0],[1,0,0,0]];
        settings.activate.cond_min_max:=0.5;
        settings.activate.lp_filter:=20;
        settings.activate.sample_rate:=4;
        settings.activate.max_speed_deviation:=1;
        settings.run:=[60,1,[[0,0,0],[1,0,0,0]],1];
        settings.stop:=[1];
    ENDPROC

    LOCAL PROC connectInterrupts()
        IDelete intno_start_joint;
        CONNECT intno_start_joint WITH handleStartJoint;
        ISignalDI EGM_START_JOINT,HIGH,intno_start_joint;
        IDelete intno_start_pose;
        CONNECT intno_start_pose WITH handleStartPose;
        ISignalDI EGM_START_POSE,HIGH,intno_start_pose;
        IDelete intno_start_stream;
        CONNECT intno_start_stream WITH handleStartStream;
        ISignalDI EGM_START_STREAM,HIGH,intno_start_stream;
        IDelete intno_stop;
        CONNECT intno_stop WITH handleStop;
        ISignalDI EGM_STOP,HIGH,intno_stop;
        IDelete intno_stop_stream;
        CONNECT intno_stop_stream WITH handleStopStream;
        ISignalDI EGM_STOP_STREAM,HIGH,intno_stop_stream;
    ENDPROC

    ! A trap leaves its level by a long jump only: the error goes through the trap's own handler, which raises it again.
    LOCAL TRAP handleStartJoint
        IF isMotionAllowed() THEN
            requestAction ACTION_RUN_JOINT;
            RAISE CHANGE_STATE;
        ENDIF
    ERROR(CHANGE_STATE)
        RAISE CHANGE_STATE;
    ENDTRAP

    LOCAL TRAP handleStartPose
        IF isMotionAllowed() THEN
            requestAction ACTION_RUN_POSE;
            RAISE CHANGE_STATE;
        ENDIF
    ERROR(CHANGE_STATE)
        RAISE CHANGE_STATE;
    ENDTRAP

    LOCAL TRAP handleStartStream
        IF isFree() THEN
            requestAction ACTION_START_STREAM;
            RAISE CHANGE_STATE;
        ENDIF
    ERROR(CHANGE_STATE)
        RAISE CHANGE_STATE;
    ENDTRAP

    LOCAL TRAP handleStop
        IF isMoving() THEN
            requestAction ACTION_STOP;
            RAISE CHANGE_STATE;
        ENDIF
    ERROR(CHANGE_STATE)
        RAISE CHANGE_STATE;
    ENDTRAP

    LOCAL TRAP handleStopStream
        IF current_state=STATE_IDLE AND current_action=ACTION_START_STREAM THEN
            requestAction ACTION_STOP_STREAM;
            RAISE CHANGE_STATE;
        ENDIF
    ERROR(CHANGE_STATE)
        RAISE CHANGE_STATE;
    ENDTRAP

    LOCAL FUNC bool isFree()
        RETURN current_state=STATE_IDLE AND current_action=ACTION_NONE;
    ENDFUNC

    LOCAL FUNC bool isMotionAllowed()
        RETURN isFree() AND settings.allow_egm_motions;
    ENDFUNC

    LOCAL FUNC bool isMoving()
        RETURN current_state=STATE_RUN_EGM_ROUTINE
            AND (current_action=ACTION_RUN_JOINT OR current_action=ACTION_RUN_POSE);
    ENDFUNC

    ! State and action change here, in the trap, so that whoever raised the signal reads them at once.
    LOCAL PROC requestAction(num action)
        current_action:=action;
        current_state:=STATE_RUN_EGM_ROUTINE;
    ENDPROC

    ! Brings the settings into range and writes them back, so that a client reads what was really used.
    LOCAL PROC parseSettings()
        settings.activate.sample_rate:=Round(settings.activate.sample_rate);
        IF settings.activate.sample_rate>4 THEN
            settings.activate.sample_rate:=4*Trunc(settings.activate.sample_rate/4);
        ELSE
            settings.activate.sample_rate:=4;
        ENDIF
        IF settings.run.pos_corr_gain<0 settings.run.pos_corr_gain:=0;
        IF settings.run.pos_corr_gain>1 settings.run.pos_corr_gain:=1;
        settings.stop.ramp_out_time:=Abs(settings.stop.ramp_out_time);
        convergence.max:=Abs(settings.activate.cond_min_max);
        convergence.min:=-convergence.max;
        egm_tool:=settings.activate.tool;
        egm_wobj:=settings.activate.wobj;
    ENDPROC

    LOCAL PROC runJointMotion()
        presynchronize;
        prepareMotion;
        activateJoints;
        TPWrite MSG_EGM+"Starting joint motion";
        IF EGMGetState(egm_id)=EGM_STATE_CONNECTED THEN
            EGMRunJoint egm_id,EGM_STOP_HOLD\J1\J2\J3\J4\J5\J6\J7\CondTime:=settings.run.cond_time
                \RampInTime:=settings.run.ramp_in_time\PosCorrGain:=settings.run.pos_corr_gain;
        ENDIF
        current_action:=ACTION_NONE;
    ENDPROC

    ! RobotWare 6 guides seven-axis arms by their joints only.
    LOCAL PROC runPoseMotion()
        TPWrite MSG_EGM+"Pose motion is not available for IRB 14000";
        current_action:=ACTION_NONE;
    ENDPROC

    LOCAL PROC stopMotion()
        TPWrite MSG_EGM+"Stopping motion...";
        IF EGMGetState(egm_id)=EGM_STATE_RUNNING THEN
            EGMStop egm_id,EGM_STOP_HOLD\RampOutTime:=settings.stop.ramp_out_time;
        ENDIF
        current_action:=ACTION_NONE;
    ENDPROC

    ! The stream goes on in the background: the arm is idle, with action START_STREAM, until the stream is stopped.
    LOCAL PROC startStream()
        waitForFinePoint;
        EGMSetupUC ROB_ID,egm_id,extConfigName(),general_info.mech_unit_name\Joint;
        TPWrite MSG_EGM+"Starting stream";
        IF EGMGetState(egm_id)=EGM_STATE_CONNECTED THEN
            EGMStreamStart egm_id\SampleRate:=settings.activate.sample_rate;
        ELSE
            current_action:=ACTION_NONE;
        ENDIF
    ENDPROC

    LOCAL PROC stopStream()
        TPWrite MSG_EGM+"Stopping stream...";
        IF EGMGetState(egm_id)=EGM_STATE_RUNNING THEN
            EGMStreamStop egm_id;
        ENDIF
        current_action:=ACTION_NONE;
    ENDPROC

    LOCAL PROC presynchronize()
        IF settings.use_presync THEN
            WaitSyncTask\InPos,egm_presync,egm_presync_tasks\TimeOut:=PRESYNC_TIMEOUT;
        ENDIF
    ENDPROC

    ! EGM refuses to be the first motion after a controller start, so the arm "moves" to where it is.
    LOCAL PROC prepareMotion()
        waitForFinePoint;
        MoveAbsJ CJointT()\NoEOffs,v100,fine,egm_tool;
        EGMSetupUC ROB_ID,egm_id,extConfigName(),general_info.mech_unit_name\Joint
            \CommTimeout:=settings.setup_uc.comm_timeout;
    ENDPROC

    LOCAL PROC waitForFinePoint()
        TPWrite MSG_EGM+"Waiting for fine point...";
        WaitRob\InPos;
    ENDPROC

    ! With modal payload the controller knows the load from GripLoad and refuses TLoad.
    LOCAL PROC activateJoints()
        IF general_info.using_modal_payload THEN
            EGMActJoint egm_id\Tool:=egm_tool\WObj:=egm_wobj
                \J1:=convergence\J2:=convergence\J3:=convergence\J4:=convergence
                \J5:=convergence\J6:=convergence\J7:=convergence
                \LpFilter:=settings.activate.lp_filter\SampleRate:=settings.activate.sample_rate
                \MaxSpeedDeviation:=settings.activate.max_speed_deviation;
        ELSE
            EGMActJoint egm_id\Tool:=egm_tool\WObj:=egm_wobj\TLoad:=egm_tool.tload
                \J1:=convergence\J2:=convergence\J3:=convergence\J4:=convergence
                \J5:=convergence\J6:=convergence\J7:=convergence
                \LpFilter:=settings.activate.lp_filter\SampleRate:=settings.activate.sample_rate
                \MaxSpeedDeviation:=settings.activate.max_speed_deviation;
        ENDIF
    ENDPROC

    ! The arm's own External Motion Interface Data, or the unfiltered one beside it.
    LOCAL FUNC string extConfigName()
        IF settings.setup_uc.use_filtering THEN
            RETURN general_info.mech_unit_name;
        ENDIF
        RETURN general_info.mech_unit_name+"_RAW";
    ENDFUNC
ENDMODULE
