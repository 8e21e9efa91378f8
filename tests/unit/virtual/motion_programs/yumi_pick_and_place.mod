!@ robot yumi
!@ tool 0 0 114.2
!@ value lifted TRUE
!@ offset 0 0 -60
MODULE YumiPick
    TASK PERS tooldata Servo:=[TRUE,[[0,0,114.2],[1,0,0,0]],[0.24,[8.2,12.5,48.1],[1,0,0,0],0,0,0]];
    PERS bool lifted:=FALSE;

    PROC main()
        VAR robtarget above;
        ConfL\Off;
        ConfJ\Off;
        MoveAbsJ [[20,-100,20,0,60,0],[-110,9E9,9E9,9E9,9E9,9E9]]\NoEOffs,v1000,fine,Servo;
        WaitRob\InPos;
        above:=CRobT(\Tool:=Servo\WObj:=wobj0);
        MoveL Offs(above,0,0,-60),v100,fine,Servo\WObj:=wobj0;
        MoveL above,v100,fine,Servo\WObj:=wobj0;
        lifted:=Distance(above.trans,CPos(\Tool:=Servo\WObj:=wobj0))<0.1;
    ENDPROC
ENDMODULE
