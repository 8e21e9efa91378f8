!@ robot irb14050
!@ value same_place TRUE
!@ value turned TRUE
MODULE ArmAngle
    PERS bool same_place:=FALSE;
    PERS bool turned:=FALSE;

    PROC main()
        VAR robtarget begin;
        VAR robtarget swung;
        ConfL\Off;
        ConfJ\Off;
        MoveAbsJ [[10,-90,25,0,60,0],[120,9E9,9E9,9E9,9E9,9E9]]\NoEOffs,v1000,fine,tool0;
        begin:=CRobT();
        swung:=begin;
        swung.extax.eax_a:=begin.extax.eax_a+8;
        MoveL swung,v100,fine,tool0;
        same_place:=Distance(begin.trans,CPos())<0.1;
        swung:=CRobT();
        turned:=Abs(swung.extax.eax_a-begin.extax.eax_a-8)<0.05;
    ENDPROC
ENDMODULE
