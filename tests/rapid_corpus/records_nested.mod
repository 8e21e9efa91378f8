! @run 0.3
! @line [[1,2,3],[1,0,0,0]] TRUE
! @value station [["a",[[5,0,0],[1,0,0,0]]],2]
! @value copied [["a",[[1,2,3],[1,0,0,0]]],1]
MODULE Nested
    RECORD place
        string name;
        pose frame;
    ENDRECORD
    RECORD stationdata
        place where;
        num level;
    ENDRECORD
    ALIAS num levelnum;
    VAR stationdata station := [["a", [[1, 2, 3], [1, 0, 0, 0]]], 1];
    VAR stationdata copied;
    VAR levelnum level;
    PROC main()
        copied := station;
        TPWrite ValToStr(copied.where.frame) + " " + ValToStr(copied = station);
        station.where.frame.trans := [5, 0, 0];
        level := station.level;
        Incr level;
        station.level := level;
        Stop;
    ENDPROC
ENDMODULE
