! @run 0.3
! @line 5
! @line 90
! @line [10,20,30]
! @line [0,0,1]
MODULE Geometry
    CONST pos X_AXIS := [1, 0, 0];
    CONST pos Y_AXIS := [0, 1, 0];
    CONST pos CORNER := [5, 10, 15];
    CONST pos A := [3, 4, 0];
    PROC main()
        VAR pos middle;
        TPWrite ValToStr(Distance([0, 0, 0], A));
        TPWrite ValToStr(Round(ATan2(1, 0)));
        middle := (CORNER + [15, 30, 45]) * 0.5;
        TPWrite ValToStr(middle);
        TPWrite ValToStr(X_AXIS * Y_AXIS);
        Stop;
    ENDPROC
ENDMODULE
