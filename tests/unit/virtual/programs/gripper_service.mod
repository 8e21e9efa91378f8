MODULE GripperService
    !> connect a
    !> send a INIT;
    !> wait 1.5
    !> receive a OK;
    !> send a OPEN;
    !> wait 1
    !> receive a OK;
    !> send a POS?;
    !> receive a 25.0;
    !> send a CLOSE;
    !> wait 1.5
    !> receive a OK;
    !> send a POS?;
    !> receive a 0.0;
    !> send a SQUEEZE;
    !> receive a ?SQUEEZE;
    ! A driver of the hand behind a text protocol, with the older names of its instructions
    VAR socketdev server;
    VAR socketdev client;
    VAR string request;

    PROC main()
        SocketCreate server;
        SocketBind server,"127.0.0.1",5000;
        SocketListen server;
        SocketAccept server,client;
        WHILE TRUE DO
            SocketReceive client\Str:=request\Time:=WAIT_MAX;
            Serve StrPart(request,1,StrFind(request,1,";")-1);
        ENDWHILE
    ENDPROC

    PROC Serve(string word)
        TEST word
        CASE "INIT":
            Hand_Initialize\maxSpd:=20\holdForce:=10\Calibrate;
        CASE "OPEN":
            Hand_MoveTo 25;
        CASE "CLOSE":
            Hand_MoveTo 0;
        CASE "POS?":
            SocketSend client\Str:=NumToStr(Hand_GetActualPos(),1)+";";
            RETURN;
        DEFAULT:
            SocketSend client\Str:="?"+word+";";
            RETURN;
        ENDTEST
        SocketSend client\Str:="OK;";
    ENDPROC
ENDMODULE
