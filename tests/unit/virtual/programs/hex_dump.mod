MODULE HexDump
    !> wait 0.2
    !> screen 4D 61 72 6B 0A | Mark.
    PROC main()
        VAR rawbytes r;
        VAR byte b;
        VAR string hex := "";
        VAR string text := "";
        PackRawBytes "Mark\0A", r, 1\ASCII;
        FOR i FROM 1 TO RawBytesLen(r) DO
            UnpackRawBytes r, i, b\Hex1;
            hex := hex + ByteToStr(b\Hex) + " ";
            IF b >= 32 AND b < 127 THEN
                text := text + ByteToStr(b\Char);
            ELSE
                text := text + ".";
            ENDIF
        ENDFOR
        TPWrite hex + "| " + text;
        WaitTime 100;
    ENDPROC
ENDMODULE