!@ robot yumi
!@ event 50050
!@ screen square ok TRUE
!@ screen target reached TRUE
!@ screen circle TRUE
!@ screen do 0
!@ screen can go back
!@ screen back 0
!@ screen angle moved 10
!@ screen same tcp TRUE
!@ screen calc 0
!@ screen err 1121
!@ screen here
!@ screen v 100
!@ screen end
MODULE YumiMoves
  CONST robtarget pA:=[[330,150,250],[0,0.7071,0.7071,0],[0,0,0,4],[-110,9E9,9E9,9E9,9E9,9E9]];
  TASK PERS tooldata Servo:=[TRUE,[[0,0,114.2],[1,0,0,0]],[0.23,[8.2,11.7,52],[1,0,0,0],0.00021,0.00024,0.00009]];
  VAR robtarget p; VAR robtarget q; VAR intnum it; VAR clock c; VAR num n:=0; VAR triggdata tr1; VAR triggdata tr2; VAR pathrecid id1; VAR robtarget c1; VAR robtarget c2; VAR jointtarget j; VAR num k; VAR bool trapped:=FALSE; VAR errnum en;
  VAR num t1; VAR stoppointdata sp:=[1,TRUE,[25,40,0.1,5],0,0,"",0,0];
  PROC main()
    ConfL\Off; ConfJ\Off;
    MoveAbsJ [[0,-130,30,0,40,0],[-110,9E9,9E9,9E9,9E9,9E9]]\NoEOffs,v1000,fine,Servo;
    p:=CRobT(\Tool:=Servo\WObj:=wobj0);
    ! square with zones, timed
    ClkReset c; ClkStart c;
    FOR i FROM 1 TO 3 DO
      MoveL Offs(p,50,0,20),v200,z10,Servo;
      MoveL Offs(p,50,40,20),v200,z10,Servo;
      MoveL Offs(p,0,40,20),v200,z10,Servo;
      MoveL Offs(p,0,0,20),v200,z10,Servo;
    ENDFOR
    MoveL p,v200,fine,Servo;
    ClkStop c; t1:=ClkRead(c);
    TPWrite "square ok "\Bool:=t1>2.2 AND t1<4.5;
    ! interrupt that moves away and returns
    CONNECT it WITH away;
    ITimer\Single,0.2,it;
    MoveL Offs(p,80,0,40),v100,fine,Servo;
    q:=CRobT(\Tool:=Servo);
    TPWrite "target reached "\Bool:=Distance(q.trans,p.trans)>89 AND trapped;
    ! circle
    MoveL p,v200,fine,Servo;
    c1:=Offs(p,30,30,30); c2:=Offs(p,60,0,30);
    MoveL Offs(p,0,0,30),v200,z5,Servo;
    MoveC c1,c2,v100,z5,Servo;
    MoveC Offs(p,30,-30,30),Offs(p,0,0,30),v100,fine,Servo;
    q:=CRobT(\Tool:=Servo);
    TPWrite "circle "\Bool:=Distance(q.trans,p.trans)<30.1;
    MoveL p,v100\Inpos:=inpos50,fine,Servo;
    MoveL Offs(p,10,0,0),v100,fine\Inpos:=sp,Servo;
    WaitRob\ZeroSpeed;
    TriggIO tr1,15\DOp:=custom_DO_0,1;
    TriggIO tr2,0.1\Time\DOp:=custom_DO_0,0;
    TriggL Offs(p,90,0,0),v50,tr1\T2:=tr2,z5,Servo;
    TriggJ Offs(p,0,0,20),v100,tr2,fine,Servo;
    TPWrite "do "\Num:=DOutput(custom_DO_0);
    PathRecStart id1;
    MoveL Offs(p,0,20,20),v100,z5,Servo;
    MoveL Offs(p,20,20,20),v100,fine,Servo;
    IF PathRecValidBwd(\ID:=id1) TPWrite "can go back";
    StorePath;
    PathRecMoveBwd\ID:=id1;
    q:=CRobT(\Tool:=Servo);
    TPWrite "back "\Num:=Round(q.trans.y-p.trans.y);
    PathRecMoveFwd;
    RestoPath;
    PathRecStop\Clear;
    ! arm angle alone
    p:=CRobT(\Tool:=Servo);
    q:=p; q.extax.eax_a:=q.extax.eax_a+10;
    MoveJ q,v100,fine,Servo;
    j:=CJointT();
    q:=CRobT(\Tool:=Servo);
    TPWrite "angle moved "\Num:=Round(q.extax.eax_a-p.extax.eax_a);
    TPWrite "same tcp "\Bool:=Distance(p.trans,q.trans)<0.05;
    j:=CalcJointT(q,Servo\ErrorNumber:=en);
    TPWrite "calc "\Num:=en;
    PDispOn\ExeP:=q,p,Servo;
    PDispOff;
    EOffsSet [5,0,0,0,0,0]; MoveJ p,v100,fine,Servo; EOffsOff;
    MoveJ p\ID:=10,v100,fine,Servo;
    FOR i FROM 1 TO 5 DO
      MoveL\Conc,Offs(p,0,0,i*2),v50,z1,Servo;
    ENDFOR
    n:=1;
    MoveL Offs(p,0,0,20),v50,fine,Servo;
    WaitTime\InPos,0;
    MoveL Offs(p,0,0,900),v100,fine,Servo;
    TPWrite "here";
    MoveAbsJ jFrom(p)\NoEOffs,v500,fine,Servo;
    SingArea\LockAxis4;
    SingArea\Off;
    TPWrite "v "\Num:=CSpeedOverride();
    TPWrite "end";
    Stop;
  ERROR
    TPWrite "err "\Num:=ERRNO;
    TRYNEXT;
  ENDPROC
  FUNC jointtarget jFrom(robtarget r)
    RETURN CalcJointT(r,Servo);
  ENDFUNC
  TRAP away
    VAR robtarget here;
    StopMove;
    StorePath;
    here:=CRobT(\Tool:=Servo\WObj:=wobj0);
    MoveL Offs(here,0,0,30),v200,fine,Servo;
    MoveL here,v200,fine,Servo;
    RestoPath;
    StartMove;
    trapped:=TRUE;
  ENDTRAP
ENDMODULE
