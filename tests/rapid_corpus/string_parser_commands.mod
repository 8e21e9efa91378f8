! @run 0.3
! @line MOVE 3 args: 10.5 -2 300
! @line STOP 0 args:
! @line ? JUMP
MODULE Parser
    VAR string words{10};
    VAR num nWords;
    VAR num values{9};
    PROC main()
        execute "MOVE 10.5 -2 300";
        execute "STOP";
        execute "JUMP 1";
        Stop;
    ENDPROC
    PROC execute(string line)
        VAR string text;
        VAR bool ok;
        split line, " ", words, nWords;
        IF words{1} <> "MOVE" AND words{1} <> "STOP" THEN
            TPWrite "? " + words{1};
            RETURN;
        ENDIF
        text := words{1} + " " + ValToStr(nWords - 1) + " args:";
        IF nWords > 1 THEN
            FOR i FROM 2 TO nWords DO
                ok := StrToVal(words{i}, values{i - 1});
                IF ok text := text + " " + ValToStr(values{i - 1});
            ENDFOR
        ENDIF
        TPWrite text;
    ENDPROC
    PROC split(string line, string separator, INOUT string parts{*}, INOUT num count)
        VAR num begin := 1;
        VAR num found;
        count := 0;
        WHILE begin <= StrLen(line) AND count < Dim(parts, 1) DO
            found := StrFind(line, begin, separator);
            Incr count;
            parts{count} := StrPart(line, begin, found - begin);
            begin := found + 1;
        ENDWHILE
    ENDPROC
ENDMODULE
