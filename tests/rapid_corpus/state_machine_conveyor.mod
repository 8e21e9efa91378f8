! @signal diPart=0 diClear=0 doMotor=0 doBusy=0
! @at 0.2 diPart=1
! @at 0.6 diPart=0
! @at 0.7 diClear=1
! @run 1.2
! @line IDLE -> FEED
! @line FEED -> WORK
! @line WORK -> IDLE
! @value parts 1
! @ends doMotor=0
! @ends doBusy=0
MODULE Conveyor
    CONST num ST_IDLE := 0;
    CONST num ST_FEED := 1;
    CONST num ST_WORK := 2;
    CONST string NAMES{3} := ["IDLE", "FEED", "WORK"];
    VAR num state := ST_IDLE;
    PERS num parts := 0;
    PROC main()
        WHILE TRUE DO
            TEST state
            CASE ST_IDLE:
                IF diPart = 1 change ST_FEED;
            CASE ST_FEED:
                SetDO doMotor, 1;
                WaitDI diPart, 0;
                SetDO doMotor, 0;
                change ST_WORK;
            CASE ST_WORK:
                PulseDO \PLength:=0.1, doBusy;
                WaitUntil diClear = 1 \MaxTime:=5;
                Incr parts;
                change ST_IDLE;
            DEFAULT:
                Stop;
            ENDTEST
            WaitTime 0.05;
        ENDWHILE
    ENDPROC
    LOCAL PROC change(num new)
        TPWrite NAMES{state + 1} + " -> " + NAMES{new + 1};
        state := new;
    ENDPROC
ENDMODULE
