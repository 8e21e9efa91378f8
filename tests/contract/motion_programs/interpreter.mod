MODULE Interpreter
    ! Runs the files of abb-motion-program-exec, of one arm or of both: numbers of four bytes, texts of a length and 32 characters.
    CONST num formatNumber := 10011;

    LOCAL VAR iodev source;
    LOCAL VAR rawbytes bytes;
    LOCAL VAR num next;
    LOCAL VAR bool isAtEnd;

    TASK PERS tooldata usedTool := [TRUE, [[0,0,0],[1,0,0,0]], [0.001,[0,0,0.001],[1,0,0,0],0,0,0]];
    TASK PERS wobjdata usedFrame := [FALSE, TRUE, "", [[0,0,0],[1,0,0,0]], [[0,0,0],[1,0,0,0]]];
    TASK PERS loaddata usedLoad := [0.001,[0,0,0.001],[1,0,0,0],0,0,0];
    LOCAL VAR string started;
    LOCAL VAR bool leads;
    LOCAL VAR num taken;
    LOCAL VAR num read;
    LOCAL VAR triggdata mark;
    LOCAL VAR rmqslot recorder;

    PERS tasks bothArms{2} := [["T_ROB1"], ["T_ROB2"]];
    VAR syncident together;
    VAR syncident apart;
    VAR errnum ERR_FORMAT := -1;
    LOCAL VAR egmident egm;
    LOCAL VAR egm_minmax window;

    PROC run_file()
        BookErrNo ERR_FORMAT;
        leads := GetTaskName() = "T_ROB1";
        taken := 0;
        read := 0;
        RMQFindSlot recorder, "RMQ_recorder";
        IF leads THEN
            SetAO motion_program_preempt, 0;
            SetAO motion_program_preempt_current, 0;
            SetAO motion_program_current_cmd_num, 0;
            SetAO motion_program_queued_cmd_num, 0;
        ENDIF
        openFile fileName();
        IF leads RMQSendMessage recorder, started;
        WHILE NOT isAtEnd DO
            switchFile;
            IF NOT isAtEnd command;
        ENDWHILE
        WaitRob \ZeroSpeed;
        finish;
    ERROR
        ErrWrite \W, "Motion program failed", "Motion program failed at command " + NumToStr(read, 0)
            \RL2:="with error " + NumToStr(ERRNO, 0) \RL3:="in " + GetTaskName() \RL4:=started;
        finish;
        RETURN;
    ENDPROC

    PROC finish()
        VAR string nothing := "";
        Close source;
        IF leads RMQSendMessage recorder, nothing;
    ENDPROC

    FUNC string fileName()
        VAR string name := "motion_program";
        IF NOT leads name := name + "2";
        IF taken > 0 name := StrFormat("{1}_p{2}" \Arg1:=name \Arg2:=NumToStr(taken, 0));
        RETURN name + ".bin";
    ENDFUNC

    PROC openFile(string name)
        VAR num sequence;
        Open "RAMDISK:" \File:=name, source \Read \Bin;
        ClearRawBytes bytes;
        refill;
        IF number() <> formatNumber RAISE ERR_FORMAT;
        usedTool := readTool();
        usedFrame := readFrame();
        usedLoad := readLoad();
        started := text();
        sequence := number();
        GripLoad usedLoad;
        TEST number()
        CASE 0:
        CASE 1:
            startEgm;
        DEFAULT:
            RAISE ERR_FORMAT;
        ENDTEST
    ENDPROC

    PROC switchFile()
        IF motion_program_preempt <= taken OR read < motion_program_preempt_cmd_num RETURN;
        IF read > motion_program_preempt_cmd_num RAISE ERR_FORMAT;
        taken := motion_program_preempt;
        IF leads SetAO motion_program_preempt_current, taken;
        Close source;
        openFile fileName();
    ENDPROC

    PROC command()
        VAR num index;
        VAR num code;
        index := number();
        code := number();
        read := index;
        IF leads SetAO motion_program_queued_cmd_num, index;
        TriggIO mark, 0 \Start \AOp:=motion_program_current_cmd_num, index;
        TEST code
        CASE 1, 2, 3, 4:
            IF IsSyncMoveOn() THEN
                move code \id:=index;
            ELSE
                move code;
            ENDIF
        CASE 5:
            WaitRob \ZeroSpeed;
            IF leads SetAO motion_program_current_cmd_num, index;
            WaitTime number();
        CASE 6:
            circleMode number();
        CASE 7:
            SyncMoveOn together, bothArms;
        CASE 8:
            SyncMoveOff apart;
        CASE 50001:
            runEgm number(), number(), number();
        DEFAULT:
            RAISE ERR_FORMAT;
        ENDTEST
    ENDPROC

    PROC move(num code \num id)
        VAR jointtarget joints;
        VAR robtarget middle;
        VAR robtarget target;
        VAR speeddata speed;
        VAR zonedata zone;
        IF code = 1 joints := readJoints();
        IF code = 4 middle := readTarget();
        IF code > 1 target := readTarget();
        speed := readSpeed();
        zone := readZone();
        IF leads THEN
            TEST code
            CASE 1:
                TriggAbsJ joints \ID?id, speed, mark, zone, usedTool \WObj:=usedFrame;
            CASE 2:
                TriggJ target \ID?id, speed, mark, zone, usedTool \WObj:=usedFrame;
            CASE 3:
                TriggL target \ID?id, speed, mark, zone, usedTool \WObj:=usedFrame;
            CASE 4:
                TriggC middle, target \ID?id, speed, mark, zone, usedTool \WObj:=usedFrame;
            ENDTEST
            RETURN;
        ENDIF
        TEST code
        CASE 1:
            MoveAbsJ joints \ID?id, speed, zone, usedTool \WObj:=usedFrame;
        CASE 2:
            MoveJ target \ID?id, speed, zone, usedTool \WObj:=usedFrame;
        CASE 3:
            MoveL target \ID?id, speed, zone, usedTool \WObj:=usedFrame;
        CASE 4:
            MoveC middle, target \ID?id, speed, zone, usedTool \WObj:=usedFrame;
        ENDTEST
    ENDPROC

    PROC circleMode(num mode)
        TEST mode
        CASE 1:
            CirPathMode \PathFrame;
        CASE 2:
            CirPathMode \ObjectFrame;
        CASE 3:
            CirPathMode \CirPointOri;
        CASE 4:
            CirPathMode \Wrist45;
        CASE 5:
            CirPathMode \Wrist46;
        DEFAULT:
            CirPathMode \Wrist56;
        ENDTEST
    ENDPROC

    ! EGM with joints; one window of convergence is used for all of them

    PROC startEgm()
        VAR num unused;
        VAR num largestDeviation;
        VAR num largestSpeed;
        window.min := number();
        window.max := number();
        FOR i FROM 1 TO 10 DO
            unused := number();
        ENDFOR
        largestDeviation := number();
        largestSpeed := number();
        MoveAbsJ CJointT(), v100, fine, usedTool \WObj:=usedFrame;
        EGMReset egm;
        EGMGetId egm;
        EGMSetupUC ROB_R, egm, "default", "UCdevice" \Joint \CommTimeout:=60;
        EGMActJoint egm \Tool:=usedTool \WObj:=usedFrame \J1:=window \J2:=window \J3:=window \J4:=window \J5:=window
            \J6:=window \J7:=window \MaxPosDeviation:=largestDeviation \MaxSpeedDeviation:=largestSpeed;
    ENDPROC

    PROC runEgm(num condition, num rampIn, num rampOut)
        SetDO motion_program_stop_egm, 0;
        EGMRunJoint egm, EGM_STOP_HOLD \NoWaitCond \J1 \J2 \J3 \J4 \J5 \J6 \J7 \CondTime:=condition \RampInTime:=rampIn;
        WaitDO motion_program_stop_egm, 1;
        EGMStop egm, EGM_STOP_HOLD \RampOutTime:=rampOut;
    ENDPROC

    ! What the file holds

    PROC refill()
        ClearRawBytes bytes;
        next := 1;
        isAtEnd := FALSE;
        ReadRawBytes source, bytes;
        isAtEnd := RawBytesLen(bytes) = 0;
    ERROR
        IF ERRNO = ERR_RANYBIN_EOF THEN
            isAtEnd := RawBytesLen(bytes) = 0;
            RETURN;
        ENDIF
    ENDPROC

    PROC advance()
        next := next + 4;
        IF next > RawBytesLen(bytes) refill;
    ENDPROC

    FUNC num number()
        VAR num value;
        UnpackRawBytes bytes, next, value \Float4;
        advance;
        RETURN value;
    ENDFUNC

    FUNC string text()
        VAR string whole := "";
        VAR string part;
        VAR num length;
        length := number();
        FOR i FROM 1 TO 8 DO
            UnpackRawBytes bytes, next, part \ASCII:=4;
            whole := whole + part;
            advance;
        ENDFOR
        RETURN StrPart(whole, 1, length);
    ENDFUNC

    FUNC pose readPose()
        VAR pose value;
        value.trans := [number(), number(), number()];
        value.rot := [number(), number(), number(), number()];
        RETURN value;
    ENDFUNC

    FUNC extjoint readAxes()
        RETURN [number(), number(), number(), number(), number(), number()];
    ENDFUNC

    FUNC loaddata readLoad()
        VAR loaddata value;
        value.mass := number();
        value.cog := [number(), number(), number()];
        value.aom := [number(), number(), number(), number()];
        value.ix := number();
        value.iy := number();
        value.iz := number();
        RETURN value;
    ENDFUNC

    FUNC tooldata readTool()
        VAR tooldata value;
        value.robhold := number() <> 0;
        value.tframe := readPose();
        value.tload := readLoad();
        RETURN value;
    ENDFUNC

    FUNC wobjdata readFrame()
        VAR wobjdata value;
        value.robhold := number() <> 0;
        value.ufprog := number() <> 0;
        value.ufmec := text();
        value.uframe := readPose();
        value.oframe := readPose();
        RETURN value;
    ENDFUNC

    FUNC jointtarget readJoints()
        VAR jointtarget value;
        value.robax := [number(), number(), number(), number(), number(), number()];
        value.extax := readAxes();
        RETURN value;
    ENDFUNC

    FUNC robtarget readTarget()
        VAR robtarget value;
        VAR pose place;
        place := readPose();
        value.trans := place.trans;
        value.rot := place.rot;
        value.robconf := [number(), number(), number(), number()];
        value.extax := readAxes();
        RETURN value;
    ENDFUNC

    FUNC speeddata readSpeed()
        RETURN [number(), number(), number(), number()];
    ENDFUNC

    FUNC zonedata readZone()
        RETURN [number() <> 0, number(), number(), number(), number(), number(), number()];
    ENDFUNC
ENDMODULE
