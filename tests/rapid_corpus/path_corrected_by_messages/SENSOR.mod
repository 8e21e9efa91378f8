MODULE SensorServer
    PERS bool started:=FALSE;
    PERS tasks both{2}:=[["SENSOR"],["T_ROB_L"]];
    VAR syncident begin_move;

    PROC main()
        VAR rmqslot slot;
        VAR robtarget here;
        RMQFindSlot slot,"RMQ_T_ROB_L";
        WaitSyncTask begin_move,both;
        WaitTime 0.3;
        RMQSendMessage slot,"4.0 1.0";
        WaitTime 0.3;
        here:=CRobT(\TaskRef:=T_ROB_LId\Tool:=tool0\WObj:=wobj0);
        TPWrite "message sent";
        Stop;
    ENDPROC
ENDMODULE
