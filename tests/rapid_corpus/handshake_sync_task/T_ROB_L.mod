! @run 2
! @line T_ROB_R waiting
! @line T_ROB_L here
! @line T_ROB_R together
! @line T_ROB_L nobody came
MODULE MeetL
    PERS tasks all{2} := [["T_ROB_L"], ["T_ROB_R"]];
    VAR syncident first;
    VAR syncident alone;
    PROC main()
        WaitTime 0.4;
        TPWrite "here";
        WaitSyncTask first, all;
        WaitTime 0.1;
        WaitSyncTask alone, all \TimeOut:=0.2;
        Stop;
    ERROR
        IF ERRNO = ERR_WAITSYNCTASK TPWrite "nobody came";
        TRYNEXT;
    ENDPROC
ENDMODULE
