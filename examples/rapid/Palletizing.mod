MODULE Palletizing
    ! Counts boxes on a pallet of two layers and reports each one.

    CONST num COLUMNS := 3;
    CONST num ROWS := 2;
    CONST num LAYERS := 2;
    CONST num PITCH_MM := 60;
    PERS num boxes := 0;
    VAR num column;
    VAR num row;
    VAR num layer;

    PROC main()
        placeOf boxes, column, row, layer;
        TPWrite "box " + ValToStr(boxes + 1) + " at " + ValToStr(offsetOf(column, row, layer));
        Incr boxes;
        IF boxes = COLUMNS * ROWS * LAYERS THEN
            Set doPalletFull;
            TPWrite "pallet full";
            Stop;
            boxes := 0;
            Reset doPalletFull;
        ENDIF
        WaitTime 0.2;
    ENDPROC

    PROC placeOf(num number, INOUT num column, INOUT num row, INOUT num layer)
        column := number MOD COLUMNS;
        row := (number DIV COLUMNS) MOD ROWS;
        layer := number DIV (COLUMNS * ROWS);
    ENDPROC

    FUNC pos offsetOf(num column, num row, num layer)
        RETURN [column * PITCH_MM, row * PITCH_MM, layer * PITCH_MM];
    ENDFUNC
ENDMODULE
