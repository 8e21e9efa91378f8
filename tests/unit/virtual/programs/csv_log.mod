MODULE CsvLog
    !> wait 0.5
    !> file HOME:/log/run.csv n;value;ok\n1;1.5;TRUE\n2;3;FALSE\n3;4.5;TRUE\n
    VAR iodev log;

    PROC Line(num n, num value, bool ok)
        Open "HOME:/log" \File:="run.csv", log \Append;
        Write log, ""\Num:=n\NoNewLine;
        Write log, ";"\Num:=value\NoNewLine;
        Write log, ";"\Bool:=ok;
        Close log;
    ENDPROC

    PROC main()
        IF NOT IsFile("HOME:/log"\Directory) MakeDir "HOME:/log";
        Open "HOME:/log/run.csv", log\Write;
        Write log, "n;value;ok";
        Close log;
        FOR i FROM 1 TO 3 DO
            Line i, 1.5*i, i <> 2;
        ENDFOR
        WaitTime 100;
    ENDPROC
ENDMODULE