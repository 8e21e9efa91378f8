MODULE Right
    PERS tasks both{2} := [["T_ROB_L"], ["T_ROB_R"]];
    PERS num startedLeft;
    VAR syncident meet;
    VAR syncident part;
    CONST jointtarget home := [[0, -130, 30, 0, 40, 0], [-135, 9E9, 9E9, 9E9, 9E9, 9E9]];
    PROC main()
        SyncMoveOn meet, both;
        noId;
        WaitTime 0.5;
        MoveAbsJ home \ID:=10, v100, fine, tool0;
        MoveAbsJ home \ID:=20, v100, fine, tool0;
        SyncMoveOff part;
        WaitTime 10;
    ENDPROC
    PROC noId()
        MoveAbsJ home, v100, fine, tool0;
    ERROR
        IF ERRNO = ERR_ARGVALERR TPWrite "needs an ID";
        TRYNEXT;
    ENDPROC
ENDMODULE
