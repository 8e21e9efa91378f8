! @run 2
! @line T_ROB_R took 1
! @line T_ROB_R took 2
! @line T_ROB_R took 3
! @line T_ROB_L all taken
MODULE Producer
    PERS num part := 0;
    PERS bool isFull := FALSE;
    PROC main()
        isFull := FALSE;
        FOR i FROM 1 TO 3 DO
            WaitUntil NOT isFull;
            part := i;
            isFull := TRUE;
        ENDFOR
        WaitUntil NOT isFull;
        TPWrite "all taken";
        Stop;
    ENDPROC
ENDMODULE
