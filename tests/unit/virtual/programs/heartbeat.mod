MODULE Heartbeat
    !> connect a
    !> wait 0.3
    !> receivepart a beat 1
    !> send a quit
    !> wait 0.4
    !> screen client said quit
    VAR socketdev s;
    VAR socketdev c;
    VAR num n := 0;

    PROC main()
        VAR string text;
        VAR bool done := FALSE;
        SocketCreate s;
        SocketBind s, "127.0.0.1", 5000;
        SocketListen s;
        SocketAccept s, c;
        WHILE NOT done DO
            text := "";
            SocketReceive c\Str:=text\Time:=0.25;
            done := text <> "";
        ENDWHILE
        TPWrite "client said " + text;
        WaitTime 100;
    ERROR
        IF ERRNO = ERR_SOCK_TIMEOUT THEN
            n := n + 1;
            SocketSend c\Str:="beat " + ValToStr(n);
            TRYNEXT;
        ENDIF
    ENDPROC
ENDMODULE