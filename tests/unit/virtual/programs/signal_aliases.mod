MODULE SignalAliases
    !> wait 0.1
    !> signal custom_DO_2 1
    !> screen valve is custom_DO_2
    !> screen unknown no_such_signal
    VAR signaldo valve;
    VAR signaldi part;

    PROC Attach(string name)
        AliasIO name, valve;
    ERROR
        IF ERRNO = ERR_ALIASIO_DEF THEN
            TPWrite "unknown " + name;
            RETURN;
        ENDIF
    ENDPROC

    PROC main()
        VAR string name;
        Attach "custom_DO_2";
        SetDO valve, 1;
        IF GetSignalOrigin(valve, name) = SIGORIG_ALIAS TPWrite "valve is " + name;
        Attach "no_such_signal";
        WaitTime 100;
    ENDPROC
ENDMODULE