MODULE StringTools
    !> wait 0.1
    !> screen [Robot]
    !> screen ABB IRB
    !> screen 3: a,bb,
    FUNC string Trim(string s)
        VAR num first;
        VAR num last;
        first := StrFind(s, 1, STR_WHITE\NotInSet);
        last := StrLen(s);
        WHILE last > first AND StrMemb(s, last, STR_WHITE) DO
            Decr last;
        ENDWHILE
        RETURN StrPart(s, first, last - first + 1);
    ENDFUNC

    FUNC string Upper(string s)
        RETURN StrMap(s, STR_LOWER, STR_UPPER);
    ENDFUNC

    FUNC num Split(string s, string delimiter, INOUT string parts{*})
        VAR num n := 0;
        VAR num from_ := 1;
        VAR num at;
        WHILE from_ <= StrLen(s) + 1 DO
            at := StrMatch(s, from_, delimiter);
            Incr n;
            parts{n} := "";
            IF at > from_ parts{n} := StrPart(s, from_, at - from_);
            from_ := at + StrLen(delimiter);
        ENDWHILE
        RETURN n;
    ENDFUNC

    PROC main()
        VAR string parts{5};
        VAR num n;
        TPWrite "[" + Trim("  Robot \09") + "]";
        TPWrite Upper("abb irb");
        n := Split("a;bb;", ";", parts);
        TPWrite ValToStr(n) + ": " + parts{1} + "," + parts{2} + "," + parts{3};
        WaitTime 100;
    ENDPROC
ENDMODULE