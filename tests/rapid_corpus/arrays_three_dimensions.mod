! @run 0.3
! @value total 36
! @value grid [[[1,2],[3,4]],[[5,6],[7,8]]]
! @line out of bounds
! @line 2 2 2
MODULE Arrays
    VAR num grid{2, 2, 2};
    VAR num total := 0;
    PROC main()
        VAR num n := 0;
        FOR i FROM 1 TO Dim(grid, 1) DO
            FOR j FROM 1 TO Dim(grid, 2) DO
                FOR k FROM 1 TO Dim(grid, 3) DO
                    Incr n;
                    grid{i, j, k} := n;
                ENDFOR
            ENDFOR
        ENDFOR
        total := sum(grid);
        grid{1, 3, 1} := 0;
        TPWrite ValToStr(Dim(grid, 1)) + " " + ValToStr(Dim(grid, 2)) + " " + ValToStr(Dim(grid, 3));
        Stop;
    ERROR
        IF ERRNO = ERR_OUTOFBND THEN
            TPWrite "out of bounds";
            TRYNEXT;
        ENDIF
    ENDPROC
    FUNC num sum(num a{*, *, *})
        VAR num s := 0;
        FOR i FROM Dim(a, 1) TO 1 STEP -1 DO
            FOR j FROM 1 TO Dim(a, 2) DO
                FOR k FROM 1 TO Dim(a, 3) DO
                    s := s + a{i, j, k};
                ENDFOR
            ENDFOR
        ENDFOR
        RETURN s;
    ENDFUNC
ENDMODULE
