MODULE CfgReader
    !> wait 0.1
    !> screen custom_DO_0 on D652_10 is a DO
    !> screen no custom_DO_99
    PROC Show(string signal)
        VAR string device;
        VAR string kind;
        ReadCfgData "/EIO/EIO_SIGNAL/" + signal, "Device", device;
        ReadCfgData "/EIO/EIO_SIGNAL/" + signal, "SignalType", kind;
        TPWrite signal + " on " + device + " is a " + kind;
    ERROR
        IF ERRNO = ERR_CFG_NOTFND THEN
            TPWrite "no " + signal;
            RETURN;
        ENDIF
    ENDPROC

    PROC main()
        Show "custom_DO_0";
        Show "custom_DO_99";
        WaitTime 100;
    ENDPROC
ENDMODULE