! @module HOME:/jobs/job7.mod MODULE Job7 LOCAL VAR num runs := 0; PROC job7() Incr runs; TPWrite "job 7 run " \Num:=runs; ENDPROC ENDMODULE
! @module HOME:/bad.mod MODULE Bad PROC x( ENDMODULE
! @run 0.5
! @line job 7 run 1
! @line job 7 run 1
! @line loaded twice
! @line not RAPID
! @line no file
! @line gone
MODULE Loader
    PROC main()
        Load \Dynamic, "HOME:/jobs" \File:="job7.mod";
        %"job7"%;
        UnLoad "HOME:/jobs/job7.mod";
        Load "HOME:/jobs/job7.mod";
        job7;
        try "HOME:/jobs/job7.mod";
        try "HOME:/bad.mod";
        try "HOME:/none.mod";
        UnLoad "HOME:/jobs" \File:="job7.mod";
        IF NOT ModExist("Job7") TPWrite "gone";
        Stop;
    ENDPROC
    PROC try(string path)
        Load \Dynamic, path;
    ERROR
        TEST ERRNO
        CASE ERR_LOADED:
            TPWrite "loaded twice";
        CASE ERR_SYNTAX:
            TPWrite "not RAPID";
        CASE ERR_FILNOTFND:
            TPWrite "no file";
        ENDTEST
        RETURN;
    ENDPROC
ENDMODULE
