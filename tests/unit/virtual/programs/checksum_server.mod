MODULE ChecksumServer
    !> connect a
    !> send a 123456789
    !> receive a 29B1
    VAR socketdev s;
    VAR socketdev c;

    FUNC string Crc16(string text)
        VAR num crc := 65535;
        VAR byte b;
        VAR dnum d;
        FOR i FROM 1 TO StrLen(text) DO
            b := StrToByte(StrPart(text, i, 1)\Char);
            d := BitXOrDnum(NumToDnum(crc), BitLShDnum(NumToDnum(b), 8));
            FOR k FROM 1 TO 8 DO
                IF BitCheckDnum(d, 16) THEN
                    d := BitXOrDnum(BitAndDnum(BitLShDnum(d, 1), 65535), 4129);
                ELSE
                    d := BitLShDnum(d, 1);
                ENDIF
            ENDFOR
            crc := DnumToNum(d);
        ENDFOR
        RETURN DecToHex(NumToStr(crc, 0));
    ENDFUNC

    PROC main()
        VAR string text;
        SocketCreate s;
        SocketBind s, "127.0.0.1", 5000;
        SocketListen s;
        SocketAccept s, c;
        SocketReceive c\Str:=text;
        SocketSend c\Str:=Crc16(text);
        WaitTime 100;
    ENDPROC
ENDMODULE