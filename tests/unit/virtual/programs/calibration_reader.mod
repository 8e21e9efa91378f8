MODULE CalibrationReader
    !> put HOME:/cal.txt # calibration\r\n12.5\r\n-0.25\r\n300\r\nCAM_A\r\n
    !> wait 0.2
    !> screen frame [12.5,-0.25,300] of CAM_A, comment "# calibration"
    !> screen end of file
    PERS pos offset := [0, 0, 0];

    PROC main()
        VAR iodev f;
        VAR string comment;
        VAR string name;
        Open "HOME:/cal.txt", f\Read;
        comment := ReadStr(f\RemoveCR);
        offset.x := ReadNum(f);
        offset.y := ReadNum(f);
        offset.z := ReadNum(f);
        name := ReadStr(f\RemoveCR);
        TPWrite "frame " + ValToStr(offset) + " of " + name + ", comment """ + comment + """";
        IF ReadStr(f) = EOF TPWrite "end of file";
        Close f;
        WaitTime 100;
    ENDPROC
ENDMODULE