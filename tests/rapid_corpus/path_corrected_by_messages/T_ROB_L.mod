! @run 6
! @line SENSOR message sent
! @line T_ROB_L offset 4 ratio 1
! @line T_ROB_L sum [0,0,4]
! @line T_ROB_L beside the path by 4
! @line T_ROB_L back on it 0
! @line T_ROB_L nothing is connected
MODULE CorrectedPath
    PERS tasks both{2}:=[["SENSOR"],["T_ROB_L"]];
    VAR syncident begin_move;
    VAR corrdescr z_id;
    VAR intnum rmqint;
    VAR string msg1;
    CONST speeddata MySpeed:=[40,500,5000,1000];

    TRAP routine
        VAR rmqmessage message;
        VAR rmqheader header;
        VAR num offset;
        VAR num ratio;
        VAR num ind;
        VAR pos write_offset;
        RMQGetMessage message;
        RMQGetMsgHeader message\Header:=header;
        IF header.datatype="string" AND header.ndim=0 THEN
            RMQGetMsgData message,msg1;
            ind:=StrMatch(msg1,1," ");
            IF StrToVal(StrPart(msg1,1,ind-1),offset) AND StrToVal(StrPart(msg1,ind+1,StrLen(msg1)-ind),ratio) THEN
                TPWrite "offset "+ValToStr(offset)+" ratio "+ValToStr(ratio);
                VelSet 100*ratio,MySpeed.v_tcp;
                write_offset.z:=offset;
                CorrWrite z_id,write_offset;
            ENDIF
        ENDIF
        RMQEmptyQueue;
    ENDTRAP

    PROC main()
        VAR robtarget start;
        VAR robtarget here;
        CorrCon z_id;
        CONNECT rmqint WITH routine;
        IRMQMessage msg1,rmqint;
        RMQEmptyQueue;
        ConfJ\Off;
        ConfL\Off;
        start:=CRobT(\Tool:=tool0\WObj:=wobj0);
        WaitSyncTask begin_move,both;
        MoveL Offs(start,0,0,20),MySpeed,z1,tool0\WObj:=wobj0\Corr;
        MoveL Offs(start,0,0,40),MySpeed,z1,tool0\WObj:=wobj0\Corr;
        MoveL Offs(start,0,0,60),MySpeed,fine,tool0\WObj:=wobj0\Corr;
        here:=CRobT(\Tool:=tool0\WObj:=wobj0);
        TPWrite "sum "+ValToStr(CorrRead());
        start:=Offs(start,0,0,60);
        TPWrite "beside the path by "+ValToStr(Round(Distance(here.trans,start.trans)\Dec:=1));
        IDelete rmqint;
        MoveL start,MySpeed,fine,tool0\WObj:=wobj0;
        here:=CRobT(\Tool:=tool0\WObj:=wobj0);
        TPWrite "back on it "+ValToStr(Round(Distance(here.trans,start.trans)\Dec:=1));
        CorrClear;
        CorrDiscon z_id;
        Stop;
    ERROR
        IF ERRNO=CORR_NOTCONN THEN
            TPWrite "nothing is connected";
            TRYNEXT;
        ENDIF
    ENDPROC
ENDMODULE
