MODULE Recorder
    ! Writes where both arms are while a program runs, into the file that the client reads afterwards.
    VAR intnum announced;
    VAR string stamp;
    VAR iodev log;
    VAR bool isOpen := FALSE;
    VAR clock watch;

    PROC watchArms()
        CONNECT announced WITH openOrClose;
        IRMQMessage stamp, announced;
        WHILE TRUE DO
            WaitTime 0.02;
            IDisable;
            IF isOpen AND arm_program_runs = 1 AND motion_program_log_motion = 1 row;
            IEnable;
        ENDWHILE
    ENDPROC

    TRAP openOrClose
        VAR rmqmessage message;
        RMQGetMessage message;
        RMQGetMsgData message, stamp;
        IF isOpen THEN
            Close log;
            isOpen := FALSE;
            ErrWrite \I, "Motion program log file closed", "The recording has ended.";
        ENDIF
        IF stamp <> "" header;
    ENDTRAP

    PROC header()
        VAR rawbytes bytes;
        VAR string name;
        name := "log-" + stamp + ".bin";
        Open "RAMDISK:" \File:=name, log \Write \Bin;
        addNumber bytes, 10011;
        addText bytes, stamp;
        addText bytes, "timestamp,cmdnum,J1,J2,J3,J4,J5,J6,J1_2,J2_2,J3_2,J4_2,J5_2,J6_2";
        WriteRawBytes log, bytes;
        ErrWrite \I, "Motion program log file opened", "Positions are recorded in " + name;
        ClkReset watch;
        ClkStart watch;
        isOpen := TRUE;
    ENDPROC

    PROC row()
        VAR rawbytes bytes;
        addNumber bytes, ClkRead(watch);
        addNumber bytes, motion_program_current_cmd_num;
        addJoints bytes, CJointT(\TaskRef:=T_ROB1Id);
        addJoints bytes, CJointT(\TaskName:="T_ROB2");
        WriteRawBytes log, bytes;
    ENDPROC

    PROC addJoints(VAR rawbytes bytes, jointtarget joints)
        addNumber bytes, joints.robax.rax_1;
        addNumber bytes, joints.robax.rax_2;
        addNumber bytes, joints.robax.rax_3;
        addNumber bytes, joints.robax.rax_4;
        addNumber bytes, joints.robax.rax_5;
        addNumber bytes, joints.robax.rax_6;
    ENDPROC

    PROC addText(VAR rawbytes bytes, string value)
        addNumber bytes, StrLen(value);
        PackRawBytes value, bytes, RawBytesLen(bytes) + 1 \ASCII;
    ENDPROC

    PROC addNumber(VAR rawbytes bytes, num value)
        PackRawBytes value, bytes, RawBytesLen(bytes) + 1 \Float4;
    ENDPROC
ENDMODULE
