MODULE LateBoundCommands
    !> connect a
    !> send a open 3
    !> receive a opened 3
    !> send a shut 4
    !> receive a shut 4
    !> send a dance 1
    !> receive a cannot dance
    VAR socketdev s;
    VAR socketdev c;
    VAR string answer;

    PROC do_open(num n)
        answer := "opened " + ValToStr(n);
    ENDPROC

    PROC do_shut(num n)
        answer := "shut " + ValToStr(n);
    ENDPROC

    PROC Execute(string name, num n)
        %"do_" + name% n;
    ERROR
        IF ERRNO = ERR_REFUNKPRC THEN
            answer := "cannot " + name;
            RETURN;
        ENDIF
    ENDPROC

    PROC main()
        VAR string text;
        VAR num blank;
        VAR num n;
        VAR bool ok;
        SocketCreate s;
        SocketBind s, "127.0.0.1", 5000;
        SocketListen s;
        SocketAccept s, c;
        WHILE TRUE DO
            SocketReceive c\Str:=text;
            blank := StrFind(text, 1, " ");
            ok := StrToVal(StrPart(text, blank+1, StrLen(text)-blank), n);
            Execute StrPart(text, 1, blank-1), n;
            SocketSend c\Str:=answer;
        ENDWHILE
    ENDPROC
ENDMODULE