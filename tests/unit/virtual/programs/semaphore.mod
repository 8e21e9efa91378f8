MODULE Semaphore
    !> wait 0.5
    !> screen mine
    !> screen given back FALSE
    PERS bool zone_taken := FALSE;
    VAR intnum release;

    TRAP GiveBack
        zone_taken := FALSE;
    ENDTRAP

    PROC main()
        zone_taken := TRUE;
        CONNECT release WITH GiveBack;
        ITimer\Single, 0.3, release;
        WaitTestAndSet zone_taken;
        TPWrite "mine";
        zone_taken := FALSE;
        TPWrite "given back "\Bool:=zone_taken;
        WaitTime 100;
    ENDPROC
ENDMODULE