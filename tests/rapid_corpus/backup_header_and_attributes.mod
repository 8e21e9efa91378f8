%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
! @run 0.3
! @line Grüße
! @value total 6
MODULE UserSystem(SYSMODULE, NOSTEPIN, VIEWONLY)
    !*****************************************************
    !* Module: UserSystem                         [äöüß] *
    !*****************************************************
    TASK PERS num total := 0;
    LOCAL CONST num STEPS{3} := [1, 2, 3];
    PROC Main()
        total := 0;
        FOR i FROM 1 TO 3 DO total := total + STEPS{i}; ENDFOR
        TPWrite "Grüße";
        STOP;
    ENDPROC
ENDMODULE
