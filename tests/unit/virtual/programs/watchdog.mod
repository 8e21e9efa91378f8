MODULE Watchdog
    !> wait 0.4
    !> screen late TRUE
    !> set custom_DI_1 1
    !> wait 0.1
    !> screen in time FALSE
    VAR bool late;

    PROC main()
        WaitDI custom_DI_1, 1\MaxTime:=0.3\TimeFlag:=late;
        TPWrite "late "\Bool:=late;
        WaitUntil custom_DI_1 = 1\MaxTime:=5\TimeFlag:=late;
        TPWrite "in time "\Bool:=late;
        WaitTime 100;
    ENDPROC
ENDMODULE