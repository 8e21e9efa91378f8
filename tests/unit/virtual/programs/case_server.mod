MODULE SERVER
    !> screen 7 500.250
    !> screen pos 500.0 1.00
    !> screen id TRUE
    !> screen y 100.0
    !> screen v [100,1,0]
    !> screen speed 200
    !> screen [[0,0,12.5],[1,0,0,0]]
    !> screen one
    !> screen SERVER: waiting
    !> wait 0.6
    !> screen timeout
    !> connect a
    !> wait 0.6
    !> screen SERVER: Connected to IP 127.0.0.1
    !> screen ended
    !//Robot configuration
    PERS tooldata currentTool:=[TRUE,[[0,0,0],[1,0,0,0]],[0.001,[0,0,0.001],[1,0,0,0],0,0,0]];
    PERS wobjdata currentWobj:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
    PERS speeddata currentSpeed:=[100,50,0,0];
    PERS zonedata currentZone:=[FALSE,0.3,0.3,0.3,0.03,0.3,0.03];
    VAR socketdev clientSocket;
    VAR socketdev serverSocket;
    VAR num instructionCode;
    VAR num params{10};
    VAR num nParams;
    PERS string ipController:="127.0.0.1";
    PERS num serverPort:=5000;
    VAR robtarget cartesianTarget;
    VAR jointtarget jointsTarget;
    VAR bool moveCompleted;
    CONST num MAX_BUFFER:=512;
    VAR num BUFFER_POS:=0;
    VAR robtarget bufferTargets{MAX_BUFFER};
    VAR speeddata bufferSpeeds{MAX_BUFFER};
    VAR extjoint externalAxis;
    CONST num SERVER_BAD_MSG:=0;
    CONST num SERVER_OK:=1;

    PROC ParseMsg(string msg)
        LOCAL_PARSE msg;
    ENDPROC
    PROC LOCAL_PARSE(string msg)
        VAR bool auxOk;
        VAR num ind:=1;
        VAR num newInd;
        VAR num length;
        VAR num indParam:=1;
        VAR string subString;
        VAR bool end:=FALSE;
        length:=StrMatch(msg,1,"#");
        IF length>StrLen(msg) THEN
            nParams:=-1;
        ELSE
            newInd:=StrMatch(msg,ind," ")+1;
            subString:=StrPart(msg,ind,newInd-ind-1);
            auxOk:=StrToVal(subString,instructionCode);
            IF auxOk=FALSE THEN
                nParams:=-1;
            ELSE
                ind:=newInd;
                WHILE end=FALSE DO
                    newInd:=StrMatch(msg,ind," ")+1;
                    IF newInd>length THEN
                        end:=TRUE;
                    ELSE
                        subString:=StrPart(msg,ind,newInd-ind-1);
                        auxOk:=StrToVal(subString,params{indParam});
                        indParam:=indParam+1;
                        ind:=newInd;
                    ENDIF
                ENDWHILE
                nParams:=indParam-1;
            ENDIF
        ENDIF
    ENDPROC
    PROC Initialize()
        currentTool:=[TRUE,[[0,0,0],[1,0,0,0]],[0.001,[0,0,0.001],[1,0,0,0],0,0,0]];
        currentWobj:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
        currentSpeed:=[100,50,0,0];
        currentZone:=[FALSE,0.3,0.3,0.3,0.03,0.3,0.03];
        jointsTarget:=CJointT();
        externalAxis:=jointsTarget.extax;
    ENDPROC
    PROC ServerCreateAndConnect(string ip,num port)
        VAR string clientIP;
        SocketCreate serverSocket;
        SocketBind serverSocket,ip,port;
        SocketListen serverSocket;
        TPWrite "SERVER: waiting";
        WHILE SocketGetStatus(clientSocket)<>SOCKET_CONNECTED DO
            SocketAccept serverSocket,clientSocket\ClientAddress:=clientIP\Time:=0.5;
            IF SocketGetStatus(clientSocket)<>SOCKET_CONNECTED TPWrite "SERVER: Problem serving an incoming connection.";
            WaitTime 0.5;
        ENDWHILE
        TPWrite "SERVER: Connected to IP "+clientIP;
    ERROR
        IF ERRNO=ERR_SOCK_TIMEOUT THEN
            TPWrite "timeout";
            Incr nParams;
            IF nParams>99 RAISE;
            RETRY;
        ENDIF
    ENDPROC
    FUNC string FormateRes(string clientMessage)
        VAR string message;
        message:=NumToStr(instructionCode,0);
        message:=message+" "+ByteToStr(13\Char);
        RETURN message;
    ENDFUNC
    PROC main()
        VAR string receivedString;
        VAR string sendString;
        VAR bool connected;
        VAR num quat{4};
        VAR orient rot;
        VAR pose frame1; VAR pose frame2;
        Initialize;
        ParseMsg "1 500 0 500.25 0 0 1 0 #";
        TPWrite NumToStr(nParams,0)+" "+NumToStr(params{3},3);
        IF nParams=7 THEN
            cartesianTarget:=[[params{1},params{2},params{3}],
                              [params{4},params{5},params{6},params{7}],
                              [0,0,0,0],
                              externalAxis];
            TPWrite "pos "+NumToStr(cartesianTarget.trans.x,1)+" "+NumToStr(cartesianTarget.rot.q3,2);
        ENDIF
        rot:=OrientZYX(90,0,0);
        frame1.trans:=[100,0,0]; frame1.rot:=rot;
        frame2:=PoseMult(frame1,PoseInv(frame1));
        TPWrite "id "+ValToStr(frame2.rot.q1>0.999);
        frame2:=PoseInv(frame1);
        TPWrite "y "+NumToStr(frame2.trans.y,1);
        TPWrite "v "+ValToStr(PoseVect(frame1,[1,0,0]));
        bufferTargets{BUFFER_POS+1}:=cartesianTarget;
        bufferSpeeds{1}:=currentSpeed;
        bufferSpeeds{1}.v_tcp:=bufferSpeeds{1}.v_tcp*2;
        TPWrite "speed "\Num:=bufferSpeeds{1}.v_tcp;
        currentZone.finep:=NOT currentZone.finep;
        currentTool.tframe.trans.z:=currentTool.tframe.trans.z+12.5;
        TPWrite ValToStr(currentTool.tframe);
        TEST instructionCode
            CASE 0:
                TPWrite "zero";
            CASE 1,2,
                 3:
                TPWrite "one";
            CASE 4:
        ENDTEST
        ServerCreateAndConnect ipController,serverPort;
        TPWrite "ended";
        WaitTime 1000;
    ERROR
        TEST ERRNO
            CASE ERR_SOCK_TIMEOUT:
                TPWrite "gave up";
                SocketClose serverSocket;
                TRYNEXT;
        ENDTEST
    ENDPROC
ENDMODULE
