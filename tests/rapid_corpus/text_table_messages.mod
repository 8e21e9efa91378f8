! @run 0.4
! @line table free
! @line Teil fehlt
! @line Greifer auf: Band 3
! @line no text 7
MODULE Messages
    ! texts in a file of the user, called by numbers
    CONST string TEXTS:="HOME:/cell_texts.xml";
    VAR num table;
    PROC main()
        WriteTable;
        IF TextTabFreeToUse("cell_texts") THEN
            TPWrite "table free";
            TextTabInstall TEXTS;
        ENDIF
        table:=TextTabGet("cell_texts");
        Show 1,-1;
        Show 2,3;
        Show 7,-1;
        Stop;
    ENDPROC
    PROC Show(num index,num belt)
        VAR string text;
        text:=TextGet(table,index);
        IF belt>=0 text:=text+": Band "+NumToStr(belt,0);
        TPWrite text;
    ERROR
        IF ERRNO=ERR_TXTNOEXIST THEN
            TPWrite "no text "+ValToStr(index);
            RETURN;
        ENDIF
    ENDPROC
    PROC WriteTable()
        VAR iodev file;
        Open TEXTS,file\Write;
        Write file,"<?xml version=""1.0"" encoding=""iso-8859-1""?>";
        Write file,"<Resource Name=""cell_texts"" Language=""de"">";
        Write file,"<Text Name=""1""><Value>Teil fehlt</Value></Text>";
        Write file,"<Text Name=""2""><Value>Greifer auf</Value></Text>";
        Write file,"</Resource>";
        Close file;
    ENDPROC
ENDMODULE
