MODULE CircleCalibration
    !> put HOME:/points.txt [11,5,7]\n[5,11,7]\n[-1,5,7]\n
    !> wait 0.2
    !> screen center [5,5,7] radius 6.00
    PROC main()
        VAR iodev f;
        VAR string line;
        VAR pos points{10};
        VAR num n := 0;
        VAR pos center;
        VAR pos normal;
        VAR num radius;
        VAR bool ok := TRUE;
        Open "HOME:/points.txt", f\Read;
        line := ReadStr(f);
        WHILE line <> EOF AND ok DO
            Incr n;
            ok := StrToVal(line, points{n});
            line := ReadStr(f);
        ENDWHILE
        Close f;
        FitCircle points\NumPoints:=n, center, radius, normal;
        center := [Round(center.x\Dec:=2), Round(center.y\Dec:=2), Round(center.z\Dec:=2)];
        TPWrite "center " + ValToStr(center) + " radius " + NumToStr(radius, 2);
        WaitTime 100;
    ENDPROC
ENDMODULE