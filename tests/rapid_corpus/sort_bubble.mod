! @run 0.3
! @value list [1,3,5,7,9]
! @value names ["a","b","c"]
MODULE Sorting
    VAR num list{5} := [7, 3, 9, 1, 5];
    VAR string names{3} := ["c", "a", "b"];
    PROC main()
        bubble list;
        bubbleText names;
        Stop;
    ENDPROC
    PROC bubble(VAR num a{*})
        VAR num t;
        VAR bool swapped := TRUE;
        WHILE swapped DO
            swapped := FALSE;
            FOR i FROM 1 TO Dim(a, 1) - 1 DO
                IF a{i} > a{i + 1} THEN
                    t := a{i};
                    a{i} := a{i + 1};
                    a{i + 1} := t;
                    swapped := TRUE;
                ENDIF
            ENDFOR
        ENDWHILE
    ENDPROC
    PROC bubbleText(VAR string a{*})
        VAR string t;
        FOR i FROM 1 TO Dim(a, 1) - 1 DO
            FOR j FROM i + 1 TO Dim(a, 1) DO
                IF NOT StrOrder(a{i}, a{j}, STR_UPPER + STR_LOWER) THEN
                    t := a{i};
                    a{i} := a{j};
                    a{j} := t;
                ENDIF
            ENDFOR
        ENDFOR
    ENDPROC
ENDMODULE
