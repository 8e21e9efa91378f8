! @run 0.3
! @line 2 glue: 1.5 mm, 120 C
! @line no recipe 7
! @value best 3
MODULE Recipes
    RECORD recipe
        num number;
        string name;
        num width;
        num temperature;
    ENDRECORD
    CONST recipe TABLE{3} := [[1, "thin", 0.5, 100], [2, "glue", 1.5, 120], [3, "thick", 2.5, 140]];
    VAR num best;
    PROC main()
        show 2;
        show 7;
        best := widest(TABLE);
        Stop;
    ENDPROC
    PROC show(num number)
        FOR i FROM 1 TO Dim(TABLE, 1) DO
            IF TABLE{i}.number = number THEN
                TPWrite ValToStr(number) + " " + TABLE{i}.name + ": " + ValToStr(TABLE{i}.width) + " mm, "
                    + ValToStr(TABLE{i}.temperature) + " C";
                RETURN;
            ENDIF
        ENDFOR
        TPWrite "no recipe " + ValToStr(number);
    ENDPROC
    FUNC num widest(recipe all{*})
        VAR num found := 1;
        FOR i FROM 2 TO Dim(all, 1) DO
            IF all{i}.width > all{found}.width found := i;
        ENDFOR
        RETURN all{found}.number;
    ENDFUNC
ENDMODULE
