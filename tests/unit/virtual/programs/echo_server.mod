MODULE EchoServer
    !> connect a
    !> send a hello
    !> receive a hello
    !> close a
    !> connect a
    !> send a again
    !> receive a again
    VAR socketdev serverSocket;
    VAR socketdev clientSocket;
    VAR string request;

    PROC main()
        SocketCreate serverSocket;
        SocketBind serverSocket, "192.168.125.1", 5000;
        SocketListen serverSocket;
        SocketAccept serverSocket, clientSocket\Time:=WAIT_MAX;
        WHILE TRUE DO
            SocketReceive clientSocket\Str:=request\Time:=WAIT_MAX;
            SocketSend clientSocket\Str:=request;
        ENDWHILE
    ERROR
        IF ERRNO = ERR_SOCK_CLOSED THEN
            SocketClose clientSocket;
            SocketAccept serverSocket, clientSocket\Time:=WAIT_MAX;
            RETRY;
        ENDIF
    ENDPROC
ENDMODULE