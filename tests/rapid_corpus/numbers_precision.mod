! @run 0.3
! @line 16777216
! @line 4503599627370497
! @line 0.333333
! @line 0.333333333333333
! @line 7 1 -7 -1
! @line 255 10 8
MODULE Precision
    VAR num single := 16777216;
    VAR dnum double := 4503599627370496;
    VAR num third;
    VAR dnum dthird;
    PROC main()
        single := single + 1;
        TPWrite NumToStr(single, 0);
        double := double - 1;
        double := double + 2;
        TPWrite DnumToStr(double, 0);
        third := 1 / 3;
        TPWrite ValToStr(third);
        dthird := 1 / 3;
        TPWrite ValToStr(dthird);
        TPWrite ValToStr(22 DIV 3) + " " + ValToStr(22 MOD 3) + " " + ValToStr(-22 DIV 3) + " " + ValToStr(-22 MOD 3);
        TPWrite ValToStr(0xFF) + " " + ValToStr(0b1010) + " " + ValToStr(0o10);
        Stop;
    ENDPROC
ENDMODULE
