! @run 0.4
! @line cleaned
! @line cycle 1 left
! @value inits 1
MODULE Cycles
    VAR num cycles := 0;
    PERS num inits := 0;
    PROC main()
        IF cycles = 1 THEN
            TPWrite "cycle 1 left";
            Stop;
        ENDIF
        Incr inits;
        deep;
        TPWrite "never";
    ENDPROC
    PROC deep()
        Incr cycles;
        ExitCycle;
    UNDO
        TPWrite "cleaned";
    ENDPROC
ENDMODULE
