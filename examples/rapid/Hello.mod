MODULE Hello
    ! Turns the hand of an arm aside and back, a little further each time, and writes that.
    VAR num waves:=0;

    PROC main()
        VAR jointtarget middle;
        middle:=CJointT();
        FOR i FROM 1 TO 3 DO
            wave middle, 10*i;
            TPWrite "Waves: "\Num:=waves;
        ENDFOR
    ENDPROC

    PROC wave(jointtarget middle, num angle)
        VAR jointtarget aside;
        aside:=middle;
        aside.robax.rax_6:=aside.robax.rax_6+angle;
        MoveAbsJ aside, v200, fine, tool0;
        MoveAbsJ middle, v200, fine, tool0;
        waves:=waves+1;
    ENDPROC
ENDMODULE
