MODULE RegisterServer
    !> connect a
    !> sendhex a 0001 0000 0006 01 03 0002 0002
    !> receivehex a 0001 0000 0007 01 03 04 002a 012c
    ! Reads of holding registers, in the manner of Modbus TCP.
    VAR socketdev s;
    VAR socketdev c;
    PERS num registers{8} := [1, 2, 42, 300, 5, 6, 7, 8];

    PROC main()
        VAR rawbytes query;
        VAR rawbytes reply;
        VAR num address;
        VAR num count;
        VAR num fc;
        SocketCreate s;
        SocketBind s, "127.0.0.1", 5000;
        SocketListen s;
        SocketAccept s, c;
        SocketReceive c\RawData:=query\ReadNoOfBytes:=12;
        UnpackRawBytes query, 8, fc\Hex1;
        UnpackRawBytes query\Network, 9, address\IntX:=UINT;
        UnpackRawBytes query\Network, 11, count\IntX:=UINT;
        CopyRawBytes query, 1, reply, 1\NoOfBytes:=4;
        PackRawBytes 3 + 2*count, reply\Network, 5\IntX:=UINT;
        CopyRawBytes query, 7, reply, 7\NoOfBytes:=2;
        PackRawBytes 2*count, reply, 9\IntX:=USINT;
        FOR i FROM 1 TO count DO
            PackRawBytes registers{address + i}, reply\Network, RawBytesLen(reply)+1\IntX:=UINT;
        ENDFOR
        SocketSend c\RawData:=reply;
        WaitTime 100;
    ENDPROC
ENDMODULE