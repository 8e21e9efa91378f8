! @signal di1=0 di2=0
! @at 0.10 di1=1
! @at 0.20 di2=1
! @at 0.30 di1=0
! @run 0.5
! @line waiting
! @line cell ready
! @line cell stopped
! @ends do1=0
! @value bReady FALSE
MODULE CellConditions
    ! door closed (di1) and part present (di2), followed without a task of its own
    PERS bool bReady:=FALSE;
    VAR intnum irChange;
    VAR num nChanges;
    PROC main()
        SetupCyclicBool bReady,di1=1 AND di2=1;
        IDelete irChange;
        CONNECT irChange WITH Changed;
        IPers bReady,irChange;
        TPWrite "waiting";
        WaitUntil nChanges=2;
        RemoveCyclicBool bReady;
        IF IsCyclicBool(bReady) TPWrite "still followed";
        Stop;
    ENDPROC
    TRAP Changed
        Incr nChanges;
        IF bReady THEN
            SetDO do1,1;
            TPWrite "cell ready";
        ELSE
            SetDO do1,0;
            TPWrite "cell stopped";
        ENDIF
    ENDTRAP
ENDMODULE
