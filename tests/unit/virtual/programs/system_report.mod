MODULE SystemReport
    !> wait 0.1
    !> screen YuMi ROBOTWARE_6.13 TRUE auto
    PROC main()
        VAR string mode;
        TEST OpMode()
        CASE OP_AUTO:
            mode := "auto";
        DEFAULT:
            mode := "manual";
        ENDTEST
        TPWrite GetSysInfo(\SystemName) + " " + StrPart(GetSysInfo(\SWVersion), 1, 14) + " " + ValToStr(RunMode() = RUN_CONT_CYCLE) + " " + mode;
        WaitTime 100;
    ENDPROC
ENDMODULE