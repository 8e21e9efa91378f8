MODULE Consumer
    PERS num part;
    PERS bool isFull;
    PROC main()
        WaitUntil isFull \PollRate:=0.01;
        WaitTime 0.1;
        TPWrite "took " \Num:=part;
        isFull := FALSE;
    ENDPROC
ENDMODULE
