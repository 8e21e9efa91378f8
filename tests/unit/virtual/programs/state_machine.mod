MODULE StateMachine
    !> wait 0.05
    !> set custom_DI_0 1
    !> wait 0.1
    !> signal custom_DO_0 1
    !> set custom_DI_0 0
    !> wait 0.1
    !> signal custom_DO_0 0
    !> screen IDLE -> WORK
    !> screen WORK -> IDLE
    CONST num IDLE := 0;
    CONST num WORK := 1;
    CONST string names{2} := ["IDLE", "WORK"];
    VAR num state := 0;

    PROC Enter(num next)
        TPWrite names{state+1} + " -> " + names{next+1};
        state := next;
    ENDPROC

    PROC main()
        WHILE TRUE DO
            TEST state
            CASE IDLE:
                Reset custom_DO_0;
                WaitDI custom_DI_0, 1;
                Enter WORK;
            CASE WORK:
                Set custom_DO_0;
                WaitDI custom_DI_0, 0\MaxTime:=60;
                Enter IDLE;
            ENDTEST
        ENDWHILE
    ENDPROC
ENDMODULE