! @run 0.3
! @line a
! @line b
! @line c
! @line empty
! @line full
MODULE Fifo
    CONST num SIZE := 3;
    LOCAL VAR string items{SIZE};
    LOCAL VAR num first := 0;
    LOCAL VAR num stored := 0;
    VAR bool done;
    PROC main()
        VAR string item;
        done := push("a");
        done := push("b");
        WHILE pop(item) DO
            TPWrite item;
            IF item = "a" done := push("c");
        ENDWHILE
        TPWrite "empty";
        FOR i FROM 1 TO SIZE + 1 DO
            IF NOT push("x") TPWrite "full";
        ENDFOR
        Stop;
    ENDPROC
    FUNC bool push(string item)
        IF stored = SIZE RETURN FALSE;
        items{(first + stored) MOD SIZE + 1} := item;
        Incr stored;
        RETURN TRUE;
    ENDFUNC
    FUNC bool pop(INOUT string item)
        IF stored = 0 RETURN FALSE;
        item := items{first + 1};
        first := (first + 1) MOD SIZE;
        Decr stored;
        RETURN TRUE;
    ENDFUNC
ENDMODULE
