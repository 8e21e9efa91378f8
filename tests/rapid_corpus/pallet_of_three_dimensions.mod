! @run 0.5
! @line layer 1: 10,20,30 | 110,20,30
! @line layer 1: 10,80,30 | 110,80,30
! @line layer 2: 10,20,75 | 110,20,75
! @line layer 2: 10,80,75 | 110,80,75
! @line full after 8, next is none
! @value nPlaced 8
! @value bOccupied [[[TRUE,TRUE],[TRUE,TRUE]],[[TRUE,TRUE],[TRUE,TRUE]]]
MODULE PalletData
    ! ------------------------------------------------------------
    ! Pallet pattern in an array of layers, rows and columns
    ! ------------------------------------------------------------
    CONST num NO_OF_LAYERS:=2;
    CONST num NO_OF_ROWS:=2;
    CONST num NO_OF_COLS:=2;
    RECORD box
        num length;
        num width;
        num height;
    ENDRECORD
    CONST box bxCarton:=[100,60,45];
    CONST pos psCorner:=[10,20,30];
    VAR pos psPlace{NO_OF_LAYERS,NO_OF_ROWS,NO_OF_COLS};
    PERS bool bOccupied{2,2,2}:=[[[FALSE,FALSE],[FALSE,FALSE]],[[FALSE,FALSE],[FALSE,FALSE]]];
    PERS num nPlaced:=0;

    PROC main()
        VAR num l;
        VAR num r;
        VAR num c;
        CalcPattern psPlace,bxCarton;
        WHILE NextFree(l,r,c) DO
            bOccupied{l,r,c}:=TRUE;
            Incr nPlaced;
            IF c=NO_OF_COLS TPWrite "layer "+ValToStr(l)+": "+Xyz(psPlace{l,r,1})+" | "+Xyz(psPlace{l,r,c});
        ENDWHILE
        TPWrite "full after "+ValToStr(nPlaced)+", next is none";
        Stop;
    ENDPROC

    PROC CalcPattern(INOUT pos places{*,*,*},box size)
        FOR l FROM 1 TO Dim(places,1) DO
            FOR r FROM 1 TO Dim(places,2) DO
                FOR c FROM 1 TO Dim(places,3) DO
                    places{l,r,c}:=psCorner+[(c-1)*size.length,(r-1)*size.width,(l-1)*size.height];
                ENDFOR
            ENDFOR
        ENDFOR
    ENDPROC

    FUNC bool NextFree(INOUT num layer,INOUT num row,INOUT num col)
        FOR l FROM 1 TO NO_OF_LAYERS DO
            FOR r FROM 1 TO NO_OF_ROWS DO
                FOR c FROM 1 TO NO_OF_COLS DO
                    IF NOT bOccupied{l,r,c} THEN
                        layer:=l;
                        row:=r;
                        col:=c;
                        RETURN TRUE;
                    ENDIF
                ENDFOR
            ENDFOR
        ENDFOR
        RETURN FALSE;
    ENDFUNC

    FUNC string Xyz(pos p)
        RETURN NumToStr(p.x,0)+","+NumToStr(p.y,0)+","+NumToStr(p.z,0);
    ENDFUNC
ENDMODULE
