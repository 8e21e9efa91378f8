MODULE FaultRecorder
    !> wait 0.05
    !> set custom_DI_0 1
    !> wait 0.05
    !> screen fault 1: air pressure
    !> event Air pressure
    !> set custom_DI_0 0
    !> wait 0.02
    !> set custom_DI_0 1
    !> wait 0.05
    !> screen fault 2: air pressure
    !> file HOME:/faults.csv no;domain;id\n1;User;77\n2;User;77\n
    ! Events of the log start a trap that reads them and writes a file
    VAR intnum irLog;
    VAR intnum irAir;
    VAR num nFaults;
    VAR iodev file;

    PROC main()
        Open "HOME:/faults.csv",file\Write;
        Write file,"no;domain;id";
        Close file;
        IDelete irLog;
        CONNECT irLog WITH Logged;
        IError USER_DEF_ERR,TYPE_ERR,irLog;
        IDelete irAir;
        CONNECT irAir WITH AirLost;
        ISignalDI custom_DI_0,high,irAir;
        WHILE TRUE DO
            WaitTime 1;
        ENDWHILE
    ENDPROC

    TRAP AirLost
        ErrLog 77,"Air pressure","below 5 bar","","","","","";
    ENDTRAP

    TRAP Logged
        VAR trapdata data;
        VAR errdomain domain;
        VAR num number;
        VAR errtype kind;
        VAR string title;
        GetTrapData data;
        ReadErrData data,domain,number,kind\Title:=title;
        Incr nFaults;
        TPWrite "fault "+NumToStr(nFaults,0)+": "+StrMap(title,STR_UPPER,STR_LOWER);
        Open "HOME:/faults.csv",file\Append;
        IF domain=USER_DEF_ERR Write file,NumToStr(nFaults,0)+";User;"+NumToStr(number,0);
        Close file;
    ENDTRAP
ENDMODULE
