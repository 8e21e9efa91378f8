!@ robot irb120
!@ event 80001
!@ value crossed FALSE
!@ through 350 -60 300
MODULE Forbidden
    CONST robtarget begin:=[[350,-60,300],[0,0,1,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    VAR wzstationary fence;
    PERS bool crossed:=FALSE;

    PROC main()
        VAR shapedata volume;
        crossed:=FALSE;
        ConfL\Off;
        ConfJ\Off;
        MoveJ begin,v500,fine,tool0;
        WZBoxDef\Inside,volume,[300,0,250],[400,50,350];
        WZLimSup\Stat,fence,volume;
        MoveL Offs(begin,0,120,0),v100,fine,tool0;
        crossed:=TRUE;
    ENDPROC
ENDMODULE
