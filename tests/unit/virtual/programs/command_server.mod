MODULE CommandServer
    !> connect a
    !> send a 1 #
    !> receive a 1 1 OK
    !> send a 7 10 20.5 -3 #
    !> receive a 7 1 27.500
    !> send a 99 #
    !> receive a 99 0 unknown
    VAR socketdev listener;
    VAR socketdev peer;
    VAR num instruction;
    VAR num params{10};
    VAR num nParams;

    LOCAL PROC Parse(string msg)
        VAR num start := 1;
        VAR num next;
        VAR bool ok;
        next := StrMatch(msg, start, " ");
        ok := StrToVal(StrPart(msg, start, next - start), instruction);
        nParams := 0;
        start := next + 1;
        WHILE start <= StrLen(msg) AND StrPart(msg, start, 1) <> "#" DO
            next := StrMatch(msg, start, " ");
            nParams := nParams + 1;
            ok := StrToVal(StrPart(msg, start, next - start), params{nParams});
            start := next + 1;
        ENDWHILE
    ENDPROC

    PROC main()
        VAR string msg;
        VAR string reply;
        VAR num total;
        SocketCreate listener;
        SocketBind listener, GetSysInfo(\LanIp), 5000;
        SocketListen listener;
        SocketAccept listener, peer;
        WHILE TRUE DO
            SocketReceive peer\Str:=msg;
            Parse msg;
            TEST instruction
            CASE 1:
                reply := "1 OK";
            CASE 7:
                total := 0;
                FOR i FROM 1 TO nParams DO
                    total := total + params{i};
                ENDFOR
                reply := "1 " + NumToStr(total, 3);
            DEFAULT:
                reply := "0 unknown";
            ENDTEST
            SocketSend peer\Str:=NumToStr(instruction, 0) + " " + reply;
        ENDWHILE
    ENDPROC
ENDMODULE