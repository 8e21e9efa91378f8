MODULE Menu
    !> wait 0.05
    !> answer Count
    !> wait 0.05
    !> answer count
    !> wait 0.05
    !> answer 5
    !> wait 0.05
    !> screen counted 2
    VAR num key;
    VAR num counter := 0;

    PROC main()
        TPErase;
        WHILE key <> 5 DO
            TPReadFK key, "Choose", "Count", "Reset", stEmpty, stEmpty, "End";
            IF key = 1 Incr counter;
            IF key = 2 counter := 0;
        ENDWHILE
        TPWrite "counted "\Num:=counter;
        WaitTime 100;
    ENDPROC
ENDMODULE