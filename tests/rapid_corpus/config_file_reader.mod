! @module HOME:/jobs/extra.mod MODULE Extra CONST num FACTOR := 3; PROC extra() TPWrite "extra"; ENDPROC ENDMODULE
! @run 0.3
! @line speed=250
! @line name=cell 4
! @line 2 settings
MODULE Config
    VAR iodev f;
    VAR num settings := 0;
    PROC main()
        writeFile;
        readFile;
        TPWrite ValToStr(settings) + " settings";
        Stop;
    ENDPROC
    PROC writeFile()
        Open "HOME:/cell.ini", f \Write;
        Write f, "# settings";
        Write f, "speed = 250";
        Write f, "";
        Write f, "name = cell 4";
        Close f;
    ENDPROC
    PROC readFile()
        VAR string line;
        VAR num equals;
        Open "HOME:/cell.ini", f \Read;
        line := ReadStr(f \RemoveCR);
        WHILE line <> EOF DO
            equals := StrFind(line, 1, "=");
            IF line <> "" AND StrPart(line, 1, 1) <> "#" THEN
                Incr settings;
                TPWrite StrPart(line, 1, equals - 2) + "=" + StrPart(line, equals + 2, StrLen(line) - equals - 1);
            ENDIF
            line := ReadStr(f \RemoveCR);
        ENDWHILE
        Close f;
    ENDPROC
ENDMODULE
