MODULE RightArm
    PERS tasks all_of_them{3}:=[["LOGGER"],["T_ROB_L"],["T_ROB_R"]];
    VAR syncident beginning;

    PROC main()
        WaitSyncTask beginning,all_of_them;
        Stop;
    ENDPROC
ENDMODULE
