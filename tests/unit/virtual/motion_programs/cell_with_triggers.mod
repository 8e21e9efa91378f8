!@ robot irb120
!@ tool 0 0 120
!@ through 400 -150 250
!@ through 450 -100 250
!@ screen ready TRUE
!@ screen stopped
!@ screen placed 1
!@ screen stopped
!@ screen placed 2
!@ screen stopped
!@ screen placed 3
!@ screen stopped
!@ screen placed 4
!@ screen ticks > 5: TRUE
!@ screen time > 3: TRUE
!@ screen rax5 30
!@ screen limit
!@ screen z 594
!@ screen x 332
!@ screen dist 30
!@ screen rz 180
MODULE Cell
    PERS tooldata tGrip:=[TRUE,[[0,0,120],[1,0,0,0]],[0.5,[0,0,50],[1,0,0,0],0,0,0]];
    PERS wobjdata wTable:=[FALSE,TRUE,"",[[400,0,200],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
    CONST robtarget pHome:=[[302,0,558],[0.707107,0,0.707107,0],[0,0,0,0],[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];
    CONST jointtarget jHome:=[[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST robtarget pPick:=[[0,50,50],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST speeddata vApp:=[100,50,5000,1000];
    VAR intnum intStop; VAR intnum intTick; VAR intnum intReady;
    VAR triggdata tgOpen; VAR triggdata HookAct; VAR triggdata tgInt;
    VAR clock ck;
    PERS num nCount:=0;
    PERS bool bReady:=FALSE;
    VAR num nTicks:=0;
    VAR num nLayer; VAR num nRow;
    VAR robtarget pHere;
    VAR jointtarget jHere;
    VAR pos off{4}:=[[0,0,0],[50,0,0],[50,50,0],[0,50,0]];

    PROC main()
        InitAll;
        WHILE nCount<4 DO
            Pick;
            Place nCount;
            Incr nCount;
        ENDWHILE
        ClkStop ck;
        TPWrite "ticks > 5: "\Bool:=nTicks>5;
        TPWrite "time > 3: "\Bool:=ClkRead(ck)>3;
        IDelete intTick;
        ISleep intReady;
        MoveAbsJ jHome\NoEOffs,v200,fine,tool0;
        WaitRob\InPos;
        jHere:=CJointT();
        TPWrite "rax5 "\Num:=Round(jHere.robax.rax_5);
        jHere:=CalcJointT(Offs(pHome,0,0,-50),tool0);
        pHere:=CalcRobT(jHere,tool0\WObj:=wobj0);
        TPWrite "z "\Num:=Round(pHere.trans.z);
        pHere:=RelTool(pHome,0,0,30\Rz:=45);
        TPWrite "x "\Num:=Round(pHere.trans.x);
        TPWrite "dist "\Num:=Round(Distance(pHome.trans,pHere.trans));
        TPWrite "rz "\Num:=Round(EulerZYX(\X,pHome.rot));
        nCount:=0;
        Stop;
    ERROR
        IF ERRNO=ERR_ROBLIMIT THEN
            TPWrite "limit";
            TRYNEXT;
        ENDIF
    ENDPROC
    PROC InitAll()
        ConfL\Off; ConfJ\Off;
        SingArea\Wrist;
        AccSet 100,100;
        VelSet 100,5000;
        nCount:=0;
        Reset custom_DO_0;
        SetDO custom_DO_1,high;
        IDelete intStop;
        CONNECT intStop WITH tStop;
        ISignalDI custom_DI_1,1,intStop;
        CONNECT intTick WITH tTick;
        ITimer 0.5,intTick;
        IDelete intReady;
        CONNECT intReady WITH tPers;
        IPers bReady,intReady;
        TriggIO tgOpen,10\Start\DOp:=custom_DO_0,1;
        TriggEquip HookAct,20,0.05\DOp:=custom_DO_1,0;
        TriggInt tgInt,0,intStop;
        ClkReset ck;
        ClkStart ck;
        MoveJ pHome,v1000,z50,tool0;
        bReady:=NOT bReady;
    ENDPROC
    PROC Pick()
        MoveJ Offs(pPick,0,0,100),v500,z10,tGrip\WObj:=wTable;
        TriggL pPick,vApp,tgOpen\T2:=HookAct\T3:=tgInt,fine,tGrip\WObj:=wTable;
        GripLoad [0.2,[0,0,10],[1,0,0,0],0,0,0];
        WaitDO custom_DO_0,1\MaxTime:=2;
        MoveL Offs(pPick,0,0,100),v500\T:=0.3,z10,tGrip\WObj:=wTable;
    ENDPROC
    PROC Place(num n)
        VAR num k;
        k:=(n MOD 4)+1;
        MoveL Offs(Offs(pPick,0,-200,100),off{k}.x,off{k}.y,0),v500,z10,tGrip\WObj:=wTable;
        MoveLDO Offs(Offs(pPick,0,-200,0),off{k}.x,off{k}.y,0),v200,fine,tGrip\WObj:=wTable,custom_DO_0,0;
        GripLoad load0;
        PulseDO\PLength:=0.2,custom_DO_2;
        MoveL RelTool(CRobT(\Tool:=tGrip\WObj:=wTable),0,0,-100),v500,z10,tGrip\WObj:=wTable;
        TPWrite "placed "+ValToStr(k);
    ENDPROC
    TRAP tStop
        StopMove;
        TPWrite "stopped";
        StartMove;
    ENDTRAP
    TRAP tTick
        Incr nTicks;
    ENDTRAP
    TRAP tPers
        TPWrite "ready "\Bool:=bReady;
    ENDTRAP
ENDMODULE
