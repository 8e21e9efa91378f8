MODULE MessageQueue
    !> wait 0.2
    !> screen order 7 of 3 bolts from RMQ_T_ROB_R
    !> screen queue empty
    RECORD order
        num id;
        num count;
        string part;
    ENDRECORD

    PROC main()
        VAR rmqslot slot;
        VAR rmqslot sender;
        VAR rmqmessage message;
        VAR order mine := [7, 3, "bolts"];
        VAR order got;
        RMQEmptyQueue;
        RMQFindSlot slot, "RMQ_" + GetTaskName();
        RMQSendMessage slot, mine\UserDef:=1;
        RMQGetMessage message;
        RMQGetMsgHeader message\SenderId:=sender;
        RMQGetMsgData message, got;
        TPWrite "order " + ValToStr(got.id) + " of " + ValToStr(got.count) + " " + got.part + " from " + RMQGetSlotName(sender);
        RMQGetMessage message;
    ERROR
        IF ERRNO = ERR_RMQ_NOMSG THEN
            TPWrite "queue empty";
            WaitTime 100;
        ENDIF
    ENDPROC
ENDMODULE