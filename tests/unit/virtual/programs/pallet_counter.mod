MODULE PalletCounter
    !> wait 0.2
    !> screen layer 1: 4 parts
    !> screen layer 2: 4 parts
    !> file HOME:/pallet.txt 8 parts, last at [110,60,40]\n
    RECORD cell
        num column;
        num row;
        num layer;
    ENDRECORD
    CONST pos origin := [10, 10, 0];
    CONST num pitch{3} := [100, 50, 40];
    PERS num placed := 0;

    FUNC pos Where(cell c)
        VAR pos p;
        p := origin;
        p.x := p.x + c.column*pitch{1};
        p.y := p.y + c.row*pitch{2};
        p.z := p.z + c.layer*pitch{3};
        RETURN p;
    ENDFUNC

    PROC main()
        VAR iodev f;
        VAR pos last;
        VAR cell c;
        placed := 0;
        FOR layer FROM 0 TO 1 DO
            FOR row FROM 0 TO 1 DO
                FOR column FROM 0 TO 1 DO
                    c := [column, row, layer];
                    last := Where(c);
                    Incr placed;
                ENDFOR
            ENDFOR
            TPWrite "layer " + ValToStr(layer+1) + ": " + ValToStr(placed/(layer+1)) + " parts";
        ENDFOR
        Open "HOME:/pallet.txt", f\Write;
        Write f, NumToStr(placed, 0) + " parts, last at "\Pos:=last;
        Close f;
        WaitTime 100;
    ENDPROC
ENDMODULE