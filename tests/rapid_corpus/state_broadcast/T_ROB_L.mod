! @run 2
! @line MONITOR left step 1
! @line MONITOR left step 2
! @line MONITOR left step 3
! @value left ["left",3]
MODULE Arm
    RECORD armstate
        string name;
        num phase;
    ENDRECORD
    PERS armstate left := ["left", 0];
    PROC main()
        Incr left.phase;
        WaitTime 0.2;
    ENDPROC
ENDMODULE
