! @run 0.5
! @line temperature 25
! @line temperature 30
! @line once only: 1
MODULE PersInterrupts
    PERS num temperature := 20;
    PERS pos place := [0, 0, 0];
    VAR intnum changed;
    VAR intnum moved;
    VAR num movedCount := 0;
    PROC main()
        CONNECT changed WITH onChange;
        IPers temperature, changed;
        CONNECT moved WITH onMove;
        IPers \Single, place, moved;
        temperature := 25;
        WaitTime 0.05;
        temperature := 25;
        WaitTime 0.05;
        ISleep changed;
        temperature := 27;
        IWatch changed;
        temperature := 30;
        WaitTime 0.05;
        IDelete changed;
        temperature := 31;
        place.x := 1;
        WaitTime 0.05;
        place.x := 2;
        WaitTime 0.05;
        TPWrite "once only: " \Num:=movedCount;
        Stop;
    ENDPROC
    TRAP onChange
        TPWrite "temperature " \Num:=temperature;
    ENDTRAP
    TRAP onMove
        Incr movedCount;
    ENDTRAP
ENDMODULE
