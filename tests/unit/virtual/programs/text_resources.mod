MODULE TextResources
    !> put HOME:/texts.xml <Resource Name="cell_texts" Language="en"><Text Name="1"><Value>Door open</Value></Text><Text Name="2"><Value>Part missing</Value></Text></Resource>
    !> wait 0.2
    !> screen Part missing
    !> screen no text 9
    PROC main()
        VAR num table;
        IF TextTabFreeToUse("cell_texts") TextTabInstall "HOME:/texts.xml";
        table := TextTabGet("cell_texts");
        TPWrite TextGet(table, 2);
        TPWrite TextGet(table, 9);
    ERROR
        IF ERRNO = ERR_TXTNOEXIST THEN
            TPWrite "no text 9";
            WaitTime 100;
        ENDIF
    ENDPROC
ENDMODULE