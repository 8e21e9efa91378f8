!@ robot irb120
!@ value still TRUE
MODULE StationaryTool
    PERS tooldata grinder:=[FALSE,[[450,0,300],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];
    PERS wobjdata part:=[TRUE,TRUE,"",[[0,0,60],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
    PERS bool still:=FALSE;

    PROC main()
        VAR robtarget begin;
        VAR robtarget finish;
        ConfL\Off;
        ConfJ\Off;
        MoveAbsJ [[0,10,10,0,40,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,fine,tool0;
        begin:=CRobT(\Tool:=grinder\WObj:=part);
        MoveL Offs(begin,20,0,0),v100,fine,grinder\WObj:=part;
        finish:=CRobT(\Tool:=grinder\WObj:=part);
        still:=Abs(finish.trans.x-begin.trans.x-20)<0.05 AND Abs(finish.trans.y-begin.trans.y)<0.05;
    ENDPROC
ENDMODULE
