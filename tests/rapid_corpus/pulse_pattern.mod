! @signal doHorn=0
! @run 1.0
! @value edges 6
! @ends doHorn=0
MODULE Horn
    VAR intnum edge;
    VAR num edges := 0;
    PROC main()
        CONNECT edge WITH onEdge;
        ISignalDO doHorn, 2, edge;
        FOR i FROM 1 TO 3 DO
            PulseDO \PLength:=0.1, doHorn;
            WaitTime 0.2;
        ENDFOR
        Stop;
    ENDPROC
    TRAP onEdge
        Incr edges;
    ENDTRAP
ENDMODULE
