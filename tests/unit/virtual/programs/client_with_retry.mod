MODULE ClientWithRetry
    !> wait 0.3
    !> listen a
    !> wait 0.6
    !> receive a ready
    !> send a go
    !> wait 0.05
    !> screen attempts>1 TRUE
    !> screen got go
    VAR socketdev camera;
    VAR num attempts := 0;

    PROC main()
        VAR string answer;
        Reach;
        SocketSend camera\Str:="ready";
        SocketReceive camera\Str:=answer;
        TPWrite "attempts>1 "\Bool:=attempts > 1;
        TPWrite "got " + answer;
        SocketClose camera;
        WaitTime 100;
    ENDPROC

    PROC Reach()
        SocketClose camera;
        SocketCreate camera;
        SocketConnect camera, "192.168.125.40", 5000\Time:=1;
    ERROR
        IF ERRNO = ERR_SOCK_CLOSED OR ERRNO = ERR_SOCK_TIMEOUT THEN
            attempts := attempts + 1;
            WaitTime 0.1;
            RETRY;
        ENDIF
    ENDPROC
ENDMODULE