MODULE Monitor
    RECORD armstate
        string name;
        num phase;
    ENDRECORD
    PERS armstate left;
    VAR num shown := -1;
    PROC watch()
        IF left.phase <> shown THEN
            shown := left.phase;
            TPWrite left.name + " step " \Num:=shown;
        ENDIF
        IF shown = 3 RAISE 9;
        WaitTime 0.05;
    ENDPROC
ENDMODULE
