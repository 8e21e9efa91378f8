! @run 0.3
! @line 1 2 3 4
! @value byValue 1
! @value byVar 20
! @value byInout 30
! @value byPers 40
MODULE Modes
    VAR num byValue := 1;
    VAR num byVar := 2;
    VAR num byInout := 3;
    PERS num byPers := 4;
    PROC main()
        TPWrite ValToStr(byValue) + " " + ValToStr(byVar) + " " + ValToStr(byInout) + " " + ValToStr(byPers);
        change byValue, byVar, byInout, byPers;
        Stop;
    ENDPROC
    PROC change(num a, VAR num b, INOUT num c, PERS num d)
        a := 10 * a;
        b := 10 * b;
        c := 10 * c;
        d := 10 * d;
    ENDPROC
ENDMODULE
