! @run 0.3
! @line step 10
! @line step 20
! @line step 20
! @line step 30
MODULE Sequence
    VAR num repeats := 0;
    PROC main()
        TPWrite "step 10";
        GOTO step_20;
        TPWrite "skipped";
    step_20:
        TPWrite "step 20";
        Incr repeats;
        IF repeats < 2 GOTO step_20;
        GOTO finish;
    finish:
        TPWrite "step 30";
        Stop;
    ENDPROC
ENDMODULE
