MODULE RawServer
    !> connect a
    !> sendhex a 00020003 3f800000 40000000 40400000
    !> receivehex a 0002 40c00000
    VAR socketdev s;
    VAR socketdev c;
    VAR rawbytes frame;
    VAR num id;
    VAR num count;
    VAR num value;
    VAR num sum;

    PROC main()
        SocketCreate s;
        SocketBind s, "0.0.0.0", 5000;
        SocketListen s;
        SocketAccept s, c;
        SocketReceive c\RawData:=frame\ReadNoOfBytes:=4;
        UnpackRawBytes frame\Network, 1, id\IntX:=UINT;
        UnpackRawBytes frame\Network, 3, count\IntX:=UINT;
        SocketReceive c\RawData:=frame\ReadNoOfBytes:=4*count;
        FOR i FROM 1 TO count DO
            UnpackRawBytes frame\Network, 4*i-3, value\Float4;
            sum := sum + value;
        ENDFOR
        ClearRawBytes frame;
        PackRawBytes id, frame\Network, RawBytesLen(frame)+1\IntX:=UINT;
        PackRawBytes sum, frame\Network, RawBytesLen(frame)+1\Float4;
        SocketSend c\RawData:=frame;
        WaitTime 10;
    ENDPROC
ENDMODULE