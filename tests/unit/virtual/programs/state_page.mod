MODULE StatePage
    !> connect a
    !> send a GET /state HTTP/1.1
    !> receivepart a {"task":"T_ROB_R","parts":3,"busy":false}
    VAR socketdev s;
    VAR socketdev c;
    PERS num parts := 3;
    PERS bool busy := FALSE;

    FUNC string Json(string key, string value)
        RETURN StrPart("""", 1, 1) + key + """:" + value;
    ENDFUNC

    PROC main()
        VAR string request;
        VAR string body;
        SocketCreate s;
        SocketBind s, "127.0.0.1", 5000;
        SocketListen s;
        SocketAccept s, c;
        SocketReceive c\Str:=request;
        IF StrMatch(request, 1, "GET /state") = 1 THEN
            body := "{" + Json("task", """" + GetTaskName() + """") + ",";
            body := body + Json("parts", ValToStr(parts)) + ",";
            body := body + Json("busy", StrMap(ValToStr(busy), STR_UPPER, STR_LOWER)) + "}";
            SocketSend c\Str:="HTTP/1.1 200 OK\0D\0A\0D\0A";
            SocketSend c\Str:=body;
        ENDIF
        SocketClose c;
        WaitTime 100;
    ENDPROC
ENDMODULE