! @run 4
! @line T_ROB_L synchronized: 2 tasks
! @line T_ROB_L independent again
! @line T_ROB_R needs an ID
MODULE Left
    PERS tasks both{2} := [["T_ROB_L"], ["T_ROB_R"]];
    VAR syncident meet;
    VAR syncident part;
    CONST jointtarget home := [[0, -130, 30, 0, 40, 0], [135, 9E9, 9E9, 9E9, 9E9, 9E9]];
    CONST jointtarget up := [[5, -130, 30, 0, 40, 0], [135, 9E9, 9E9, 9E9, 9E9, 9E9]];
    VAR tasks found{2};
    PROC main()
        WaitTime 0.5;
        SyncMoveOn meet, both;
        TPWrite "synchronized: " + ValToStr(TasksInSync(found)) + " tasks";
        startedLeft := 0;
        MoveAbsJ up \ID:=10, v100, fine, tool0;
        MoveAbsJ home \ID:=20, v100, fine, tool0;
        SyncMoveOff part;
        IF NOT IsSyncMoveOn() TPWrite "independent again";
        Stop \AllMoveTasks;
    ENDPROC
    PERS num startedLeft := 1;
ENDMODULE
