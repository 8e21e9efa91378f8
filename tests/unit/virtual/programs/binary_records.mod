MODULE BinaryRecords
    !> wait 0.2
    !> screen 3 records, mean 2.5
    !> filehex TEMP:/rec.bin 01 3f800000 02 40200000 03 40800000
    PROC main()
        VAR iodev f;
        VAR rawbytes r;
        VAR num id;
        VAR num value;
        VAR num n;
        VAR num total;
        VAR num values{3} := [1, 2.5, 4];
        Open "TEMP:/rec.bin", f\Write\Bin;
        FOR i FROM 1 TO 3 DO
            ClearRawBytes r;
            PackRawBytes i, r, 1\IntX:=USINT;
            PackRawBytes values{i}, r\Network, 2\Float4;
            WriteRawBytes f, r;
        ENDFOR
        Close f;
        Open "TEMP:/rec.bin", f\Read\Bin;
        WHILE TRUE DO
            ReadRawBytes f, r\NoOfBytes:=5;
            UnpackRawBytes r\Network, 2, value\Float4;
            n := n + 1;
            total := total + value;
        ENDWHILE
        WaitTime 100;
    ERROR
        IF ERRNO = ERR_RANYBIN_EOF THEN
            Close f;
            TPWrite ValToStr(n) + " records, mean " + ValToStr(total/n);
            WaitTime 100;
        ENDIF
    ENDPROC
ENDMODULE