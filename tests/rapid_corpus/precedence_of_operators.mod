! @run 0.3
! @line 14 20 -4 1
! @line TRUE FALSE TRUE
! @line TRUE
MODULE Precedence
    PROC main()
        VAR bool a := TRUE;
        VAR bool b := FALSE;
        TPWrite ValToStr(2 + 3 * 4) + " " + ValToStr((2 + 3) * 4) + " " + ValToStr(-2 * 2) + " " + ValToStr(7 MOD 4 DIV 2);
        TPWrite ValToStr(a OR b AND b) + " " + ValToStr(NOT a OR b) + " " + ValToStr(1 + 1 = 2 AND 3 > 2);
        TPWrite ValToStr(a XOR b);
        Stop;
    ENDPROC
ENDMODULE
