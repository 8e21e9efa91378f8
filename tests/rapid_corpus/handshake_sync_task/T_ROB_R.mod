MODULE MeetR
    PERS tasks all{2};
    VAR syncident first;
    PROC main()
        TPWrite "waiting";
        WaitSyncTask first, all;
        TPWrite "together";
        Stop;
    ENDPROC
ENDMODULE
