! @run 0.3
! @line 1: [0,0,0] R0
! @line 2: [250,0,0] R0
! @line 3: [0,150,0] R0
! @line 4: [250,150,0] R0
! @line 5: [0,0,90] R90
! @value count 5
MODULE Pallet
    RECORD layout
        num columns;
        num rows;
        pos pitch;
        bool turns;
    ENDRECORD
    CONST layout EURO := [2, 2, [250, 150, 90], TRUE];
    PERS num count := 0;
    PROC main()
        VAR pos place;
        VAR num angle;
        FOR i FROM 0 TO 4 DO
            place := placeOf(i, EURO \angle:=angle);
            Incr count;
            TPWrite ValToStr(count) + ": " + ValToStr(place) + " R" + ValToStr(angle);
        ENDFOR
        Stop;
    ENDPROC
    FUNC pos placeOf(num index, layout l \INOUT num angle)
        VAR num layer;
        VAR num rest;
        layer := index DIV (l.columns * l.rows);
        rest := index MOD (l.columns * l.rows);
        IF Present(angle) THEN
            angle := 0;
            IF l.turns AND layer MOD 2 = 1 angle := 90;
        ENDIF
        RETURN [(rest MOD l.columns) * l.pitch.x, (rest DIV l.columns) * l.pitch.y, layer * l.pitch.z];
    ENDFUNC
ENDMODULE
