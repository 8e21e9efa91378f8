MODULE Recorder
    PERS bool moved:=FALSE;
    CONST string arms{2}:=["T_ROB_L","T_ROB_R"];
    PERS tasks all_of_them{3}:=[["LOGGER"],["T_ROB_L"],["T_ROB_R"]];
    VAR syncident beginning;

    PROC main()
        VAR jointtarget joints;
        VAR robtarget left;
        VAR robtarget right;
        VAR num number;
        VAR num torque;
        VAR num turned{2};
        TestSignDefine 1,4000,ROB_L,1,0;
        TestSignDefine 2,4000,ROB_R,1,0;
        WaitSyncTask beginning,all_of_them;
        WaitUntil moved;
        joints:=CJointT(\TaskName:=arms{1});
        TPWrite "left axis 1 "\Num:=Round(joints.robax.rax_1-TestSignRead(1));
        joints:=CJointT(\TaskRef:=T_ROB_RId);
        TPWrite "right axis 1 "\Num:=Round(joints.robax.rax_1-TestSignRead(2));
        left:=CRobT(\TaskRef:=T_ROB_LId\Tool:=tool0\WObj:=wobj0);
        right:=CRobT(\TaskName:="T_ROB_R"\Tool:=tool0\WObj:=wobj0);
        TPWrite "apart "+ValToStr(left.trans.y>right.trans.y+50);
        GetJointData\MechUnit:=ROB_L,2\Position:=turned{1};
        GetJointData\MechUnit:=ROB_R,2\Position:=turned{2};
        joints:=CJointT(\TaskRef:=T_ROB_LId);
        TPWrite "axes 2 "+ValToStr(Round(turned{1}-joints.robax.rax_2))+ValToStr(Abs(turned{1}-turned{2})>2);
        torque:=GetMotorTorque(\MecUnit:=ROB_L,2)-GetMotorTorque(\MecUnit:=ROB_R,2);
        TPWrite "torques differ "+ValToStr(Abs(torque)>0.05);
        TPWrite GetTaskName(\TaskNo:=number)+ValToStr(number)+" moves "+ValToStr(TaskRunMec());
        joints:=CJointT(\TaskName:="T_ROB9");
        joints:=CJointT(\TaskName:="LOGGER2"); ! the same again
        Stop;
    ERROR
        IF ERRNO=ERR_TASKNAME THEN
            TPWrite "no such task";
            TRYNEXT;
        ENDIF
    ENDPROC
ENDMODULE
