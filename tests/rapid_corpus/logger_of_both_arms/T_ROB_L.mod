! @run 4
! @line LOGGER left axis 1 0
! @line LOGGER right axis 1 0
! @line LOGGER apart TRUE
! @line LOGGER axes 2 0TRUE
! @line LOGGER torques differ TRUE
! @line LOGGER LOGGER3 moves FALSE
! @line LOGGER no such task
! @line LOGGER no such task
! @line T_ROB_L own TRUE TRUE
MODULE LeftArm
    PERS bool moved:=FALSE;
    PERS tasks all_of_them{3}:=[["LOGGER"],["T_ROB_L"],["T_ROB_R"]];
    VAR syncident beginning;

    PROC main()
        VAR jointtarget target;
        moved:=FALSE;
        TestSignDefine 1,4000,ROB_L,2,0;
        WaitSyncTask beginning,all_of_them;
        target:=CJointT();
        target.robax.rax_2:=target.robax.rax_2+5;
        MoveAbsJ target,v200,fine,tool0;
        target:=CJointT(\TaskRef:=T_ROB_LId);
        TPWrite "own "+ValToStr(Round(TestSignRead(1)-target.robax.rax_2)=0)+" "+ValToStr(TaskRunMec());
        moved:=TRUE;
        Stop;
    ENDPROC
ENDMODULE
