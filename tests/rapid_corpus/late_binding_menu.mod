! @run 0.3
! @line job 1
! @line job 2 with 5
! @line no job 9
! @line job 1
MODULE Menu
    VAR string called;
    PROC main()
        %"Job1"%;
        %"Menu:job" + ValToStr(2)% 5;
        called := "Job9";
        %called%;
        CallByVar "job", 1;
        Stop;
    ERROR
        IF ERRNO = ERR_REFUNKPRC THEN
            TPWrite "no job 9";
            TRYNEXT;
        ENDIF
    ENDPROC
    PROC job1()
        TPWrite "job 1";
    ENDPROC
    LOCAL PROC job2(num x)
        TPWrite "job 2 with " \Num:=x;
    ENDPROC
ENDMODULE
