MODULE RosMotionServer
    !> connect a
    !> sendhex a 00000038 0000000b 00000002 00000000 00000000 3dcccccd 00000000 00000000 00000000 00000000 00000000 00000000 3f800000 00000000 00000000
    !> receivehex a 00000038 0000000b 00000003 00000001 00000000 00000000 00000000 00000000 00000000 00000000 00000000 00000000 00000000 00000000 00000000
    !> screen point 0: 5.7 deg, 7 joints
    !> sendhex a 0000000c 00000063 00000002 00000000
    !> receivehex a 0000000c 00000063 00000003 00000002
    !> screen unknown message 99
    ! Messages of a length, type, communication type, reply code and data: big-endian here, as networks have it
    VAR socketdev server;
    VAR socketdev client;
    VAR rawbytes raw;
    CONST num MSG_JOINT_TRAJ_PT:=11;
    CONST num COMM_REQUEST:=2;
    CONST num COMM_REPLY:=3;
    CONST num REPLY_SUCCESS:=1;
    CONST num REPLY_FAILURE:=2;
    RECORD header
        num length;
        num type;
        num comm;
        num reply;
    ENDRECORD

    PROC main()
        VAR header head;
        SocketCreate server;
        SocketBind server,"0.0.0.0",5000;
        SocketListen server;
        SocketAccept server,client\Time:=WAIT_MAX;
        WHILE TRUE DO
            Receive head;
            IF head.type=MSG_JOINT_TRAJ_PT THEN
                TrajectoryPoint;
                Answer head,REPLY_SUCCESS,10;
            ELSE
                TPWrite "unknown message "+NumToStr(head.type,0);
                Answer head,REPLY_FAILURE,0;
            ENDIF
        ENDWHILE
    ERROR
        IF ERRNO=ERR_SOCK_CLOSED OR ERRNO=ERR_SOCK_TIMEOUT TRYNEXT;
    ENDPROC

    PROC Receive(INOUT header head)
        ClearRawBytes raw;
        SocketReceive client\RawData:=raw\ReadNoOfBytes:=4\Time:=WAIT_MAX;
        UnpackRawBytes raw\Network,1,head.length\IntX:=UDINT;
        SocketReceive client\RawData:=raw\ReadNoOfBytes:=head.length;
        UnpackRawBytes raw\Network,1,head.type\IntX:=DINT;
        UnpackRawBytes raw\Network,5,head.comm\IntX:=DINT;
        UnpackRawBytes raw\Network,9,head.reply\IntX:=DINT;
    ENDPROC

    PROC TrajectoryPoint()
        VAR num sequence;
        VAR num joints{7};
        UnpackRawBytes raw\Network,13,sequence\IntX:=DINT;
        FOR i FROM 1 TO 7 DO
            UnpackRawBytes raw\Network,13+4*i,joints{i}\Float4;
        ENDFOR
        TPWrite "point "+NumToStr(sequence,0)+": "+NumToStr(joints{1}*180/pi,1)+" deg, "+NumToStr(Dim(joints,1),0)+" joints";
    ENDPROC

    PROC Answer(header head,num code,num words)
        VAR rawbytes reply;
        PackRawBytes head.length,reply\Network,1\IntX:=UDINT;
        PackRawBytes head.type,reply\Network,(RawBytesLen(reply)+1)\IntX:=DINT;
        PackRawBytes COMM_REPLY,reply\Network,(RawBytesLen(reply)+1)\IntX:=DINT;
        PackRawBytes code,reply\Network,(RawBytesLen(reply)+1)\IntX:=DINT;
        IF words>0 THEN
            FOR i FROM 1 TO words+1 DO
                PackRawBytes 0,reply\Network,(RawBytesLen(reply)+1)\IntX:=DINT;
            ENDFOR
        ENDIF
        SocketSend client\RawData:=reply;
    ENDPROC
ENDMODULE
