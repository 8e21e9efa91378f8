!@ robot irb120
!@ through 300 0 200
!@ through 350 0 200
!@ through 300 50 200
!@ value found [[300,0,200],[1,0,0,0]]
MODULE Calibration
    CONST robtarget touch:=[[300,0,200],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    PERS pose found:=[[0,0,0],[1,0,0,0]];
    VAR pos points{3};

    PROC main()
        VAR pose measured;
        ConfL\Off;
        ConfJ\Off;
        MoveTo touch,1;
        MoveTo Offs(touch,50,0,0),2;
        MoveTo Offs(touch,0,50,0),3;
        measured:=DefFrame(points{1},points{2},points{3});
        found.trans:=[Round(measured.trans.x),Round(measured.trans.y),Round(measured.trans.z)];
        found.rot.q1:=Round(measured.rot.q1\Dec:=2);
        found.rot.q2:=Round(measured.rot.q2\Dec:=2);
        found.rot.q3:=Round(measured.rot.q3\Dec:=2);
        found.rot.q4:=Round(measured.rot.q4\Dec:=2);
    ENDPROC

    PROC MoveTo(robtarget target,num index)
        MoveJ target,v300,fine,tool0;
        WaitTime\InPos,0.1;
        points{index}:=CPos(\Tool:=tool0\WObj:=wobj0);
    ENDPROC
ENDMODULE
