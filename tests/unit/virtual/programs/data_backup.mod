MODULE DataBackup
    !> wait 0.2
    !> file HOME:/data.txt par_a=1\npar_b=2.5\n
    !> screen restored 1 2.5
    PERS num par_a := 1;
    PERS num par_b := 2.5;
    VAR iodev f;

    PROC main()
        VAR datapos block;
        VAR string name;
        VAR string line;
        VAR num value;
        VAR num at;
        VAR bool ok;
        Open "HOME:/data.txt", f\Write;
        SetDataSearch "num"\Object:="par_[a-z]";
        WHILE GetNextSym(name, block) DO
            GetDataVal name\Block:=block, value;
            Write f, name + "="\Num:=value;
        ENDWHILE
        Close f;
        SetAllDataVal "num"\Object:="par_.*", 0;
        Open "HOME:/data.txt", f\Read;
        line := ReadStr(f);
        WHILE line <> EOF DO
            at := StrFind(line, 1, "=");
            ok := StrToVal(StrPart(line, at+1, StrLen(line)-at), value);
            SetDataVal StrPart(line, 1, at-1), value;
            line := ReadStr(f);
        ENDWHILE
        Close f;
        TPWrite "restored " + ValToStr(par_a) + " " + ValToStr(par_b);
        WaitTime 100;
    ENDPROC
ENDMODULE