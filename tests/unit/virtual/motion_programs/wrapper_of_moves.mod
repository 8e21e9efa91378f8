!@ robot irb120
!@ tool 0 0 0
!@ through 374 0 580
!@ value moves 3
!@ value named "tool0"
MODULE Wrapper
    PERS num moves:=0;
    PERS string named:="";

    PROC main()
        VAR robtarget here;
        go [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],tool0,wobj0;
        here:=CRobT(\Tool:=tool0\WObj:=wobj0);
        here.trans:=[374,0,580];
        here.rot:=[0.5,0,0.8660254,0];
        goLine here,tool0\WObj:=wobj0;
        goLine here,tool0;
        GripLoad load0;
    ENDPROC

    PROC go(jointtarget target,PERS tooldata tool,PERS wobjdata wobj)
        MoveAbsJ target,v1000,fine,tool\WObj:=wobj;
        moves:=moves+1;
    ENDPROC

    PROC goLine(robtarget target,PERS tooldata tool\PERS wobjdata WObj)
        MoveL target,v200,fine,tool\WObj?WObj;
        named:=ArgName(tool);
        moves:=moves+1;
    ENDPROC
ENDMODULE
