! @run 0.3
! @line got it
! @line taken
! @line got it again
MODULE Semaphore
    PERS bool tproutine_inuse := FALSE;
    PROC main()
        tproutine_inuse := FALSE;
        WaitUntil TestAndSet(tproutine_inuse);
        TPWrite "got it";
        IF NOT TestAndSet(tproutine_inuse) TPWrite "taken";
        tproutine_inuse := FALSE;
        WaitTestAndSet tproutine_inuse;
        TPWrite "got it again";
        Stop;
    ENDPROC
ENDMODULE
