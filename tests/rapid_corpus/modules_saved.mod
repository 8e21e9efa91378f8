! @module HOME:/data.mod MODULE Data\n    PERS num counter := 1;\n    PERS string note := "a; b";\n    CONST num LIMIT := 3;\nENDMODULE\n
! @run 0.3
! @file HOME:/saved.mod MODULE Data\n    PERS num counter := 8;\n    PERS string note := "c ""d""";\n    CONST num LIMIT := 3;\nENDMODULE\n
MODULE Saver
    PROC main()
        Load "HOME:/data.mod";
        counter := counter + 7;
        note := "c ""d""";
        Save "Data" \FilePath:="HOME:" \File:="saved.mod";
        Stop;
    ENDPROC
ENDMODULE
