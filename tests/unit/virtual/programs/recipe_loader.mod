MODULE RecipeLoader
    !> put HOME:/recipes/bolt.txt speed=v200\ncount=4\nat=[1,2,3]\nnonsense\n
    !> put HOME:/recipes/nut.txt count=9\n
    !> wait 0.2
    !> screen bolt.txt: count 4 at [1,2,3] speed (v200)
    !> screen nut.txt: count 9 at [0,0,0] speed ()
    RECORD recipe
        num count;
        pos at;
        string speed;
    ENDRECORD

    PROC ReadRecipe(string path, INOUT recipe r)
        VAR iodev f;
        VAR string line;
        VAR num sign;
        VAR bool ok;
        r := [0, [0, 0, 0], ""];
        Open path, f\Read;
        line := ReadStr(f);
        WHILE line <> EOF DO
            sign := StrFind(line, 1, "=");
            IF sign <= StrLen(line) THEN
                TEST StrPart(line, 1, sign-1)
                CASE "count":
                    ok := StrToVal(StrPart(line, sign+1, StrLen(line)-sign), r.count);
                CASE "at":
                    ok := StrToVal(StrPart(line, sign+1, StrLen(line)-sign), r.at);
                CASE "speed":
                    r.speed := StrPart(line, sign+1, StrLen(line)-sign);
                ENDTEST
            ENDIF
            line := ReadStr(f);
        ENDWHILE
        Close f;
    ENDPROC

    PROC main()
        VAR dir folder;
        VAR string name;
        VAR recipe r;
        OpenDir folder, "HOME:/recipes";
        WHILE ReadDir(folder, name) DO
            IF StrMatch(name, 1, ".txt") <= StrLen(name) THEN
                ReadRecipe "HOME:/recipes/" + name, r;
                TPWrite name + ": count " + ValToStr(r.count) + " at " + ValToStr(r.at) + " speed (" + r.speed + ")";
            ENDIF
        ENDWHILE
        CloseDir folder;
        WaitTime 100;
    ENDPROC
ENDMODULE