MODULE TwoClients
    !> connect a
    !> connect b
    !> wait 0.1
    !> send b second
    !> wait 0.2
    !> receive b 2:second
    !> send a first
    !> wait 0.2
    !> receive a 1:first
    VAR socketdev s;
    VAR socketdev clients{2};

    PROC main()
        SocketCreate s;
        SocketBind s, "127.0.0.1", 5000;
        SocketListen s;
        FOR i FROM 1 TO 2 DO
            SocketAccept s, clients{i};
        ENDFOR
        WHILE TRUE DO
            FOR i FROM 1 TO 2 DO
                IF SocketPeek(clients{i}) > 0 Serve i;
            ENDFOR
            WaitTime 0.02;
        ENDWHILE
    ENDPROC

    PROC Serve(num i)
        VAR string text;
        SocketReceive clients{i}\Str:=text;
        SocketSend clients{i}\Str:=ValToStr(i) + ":" + text;
    ENDPROC
ENDMODULE