MODULE GRIP(NOSTEPIN)
    !> wait 0.6
    !> set custom_DI_0 1
    !> wait 0.1
    !> set custom_DI_0 0
    !> wait 0.3
    !> screen grip failed, 4
    !> screen grip failed, 3
    !> screen grip failed, 2
    !> screen high
    !> screen flag FALSE
    !> screen low
    !> screen edges 2
    !> screen lamp 0
    !> screen undone
    !> screen 55 taken 0
    !> screen end
    VAR signaldo alias_do; VAR signaldi alias_di; VAR signaldo vac{3};
    VAR bool init:=FALSE;
    VAR intnum irHigh; VAR intnum irLow; VAR errnum ERR_GRIP:=-1;
    VAR num count; 
    PERS bool sharedFlag:=FALSE;
    VAR iodev x;
    PROC main()
        BookErrNo ERR_GRIP;
        AliasIO "custom_DO_0",alias_do;
        AliasIO custom_DI_0,alias_di;
        CONNECT irHigh WITH onEdge;
        CONNECT irLow WITH onEdge;
        ISignalDI alias_di,high,irHigh;
        ISignalDI\Single,alias_di,low,irLow;
        Grip;
        SetDO\SDelay:=0.1,custom_DO_1,1;
        WaitDI alias_di,1\MaxTime:=1\TimeFlag:=init;
        TPWrite "flag "\Bool:=init;
        WaitUntil\InPos,DOutput(custom_DO_1)=1 AND TestDI(custom_DI_0)\MaxTime:=1\PollRate:=0.05;
        SetDO\Sync,custom_DO_1,0;
        WaitTime 0.1;
        TPWrite "edges "\Num:=count;
        InvertDO alias_do;
        TPWrite "lamp "\Num:=DOutput(alias_do);
        release;
        TPWrite "end";
        Stop;
    ERROR
        IF ERRNO=ERR_GRIP THEN
            TPWrite "grip failed, "+NumToStr(RemainingRetries(),0);
            IF RemainingRetries()>2 THEN
                RETRY;
            ELSE
                TRYNEXT;
            ENDIF
        ENDIF
    ENDPROC
    PROC Grip()
        Set alias_do;
        WaitDI custom_DI_0,1\MaxTime:=0.1;
    ERROR
        IF ERRNO=ERR_WAIT_MAXTIME THEN
            RAISE ERR_GRIP;
        ENDIF
    ENDPROC
    PROC release()
        VAR num old;
        old:=count;
        PulseDO\High\PLength:=0.1,alias_do;
        undoable;
        TPWrite "never";
    ERROR(55)
        TPWrite "55 taken "\Num:=count-old;
    ENDPROC
    PROC undoable()
        Incr count;
        RAISE 55;
    UNDO
        TPWrite "undone";
        count:=count-1;
    ENDPROC
    TRAP onEdge
        Incr count;
        IF INTNO=irHigh TPWrite "high";
        IF INTNO=irLow THEN
            TPWrite "low";
        ENDIF
    ENDTRAP
ENDMODULE
