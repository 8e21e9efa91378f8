MODULE DataSearch
    !> wait 0.2
    !> screen pick_1 [1,1,1]
    !> screen pick_2 [2,2,2]
    !> screen 2 found
    !> screen pick_2 is [2,2,9] now
    CONST pos place_1 := [9, 9, 9];
    PERS pos pick_1 := [1, 1, 1];
    PERS pos pick_2 := [2, 2, 2];

    PROC main()
        VAR datapos block;
        VAR string name;
        VAR pos value;
        VAR num found := 0;
        SetDataSearch "pos"\Object:="pick_.*"\PersSym;
        WHILE GetNextSym(name, block) DO
            GetDataVal name\Block:=block, value;
            TPWrite name + " " + ValToStr(value);
            Incr found;
        ENDWHILE
        TPWrite ValToStr(found) + " found";
        value.z := 9;
        value.x := 2;
        value.y := 2;
        SetDataVal "pick_" + ValToStr(found), value;
        TPWrite "pick_2 is " + ValToStr(pick_2) + " now";
        WaitTime 100;
    ENDPROC
ENDMODULE