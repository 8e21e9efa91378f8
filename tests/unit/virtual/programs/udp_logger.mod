MODULE UdpLogger
    !> udp a
    !> send a START
    !> receive a sample 1
    !> wait 0.1
    !> receive a sample 2
    !> send a STOP
    !> wait 0.3
    !> screen stopped after 2
    VAR socketdev udp;
    VAR string command;
    VAR string host;
    VAR num port;
    VAR num n := 0;
    VAR bool running := TRUE;

    PROC main()
        SocketCreate udp\UDP;
        SocketBind udp, "192.168.125.1", 5000;
        SocketReceiveFrom udp\Str:=command, host, port;
        WHILE running DO
            Incr n;
            SocketSendTo udp, host, port\Str:="sample " + ValToStr(n);
            Poll;
        ENDWHILE
        TPWrite "stopped after "\Num:=n;
        WaitTime 100;
    ENDPROC

    PROC Poll()
        SocketReceiveFrom udp\Str:=command, host, port\Time:=0.1;
        running := command <> "STOP";
    ERROR
        IF ERRNO = ERR_SOCK_TIMEOUT RETURN;
    ENDPROC
ENDMODULE