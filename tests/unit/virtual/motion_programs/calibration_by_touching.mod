!@ robot irb120
!@ tool 10 -5 150
!@ through 374 0 300
!@ screen tcp ok TRUE
!@ screen frame [300,0,300]
!@ screen d TRUE
!@ screen circle r 50.00 c 0.00
!@ screen x 0.80 1.40
!@ screen rx 90
!@ screen dot 5000
!@ screen cross [0,0,5000]
!@ screen sum 10
!@ screen el 11
!@ screen [[1,1,0],[0.707107,0,0,0.707107]]
!@ screen ok TRUE
!@ screen data 4
!@ screen set 7
!@ screen tCal 150
!@ screen tTrue 150
!@ screen tCal := [0,0,0] done
!@ screen t: [1,0,0,0]
!@ screen n: 123456789012
!@ screen saved TRUE
MODULE Calib
    ! calibration of TCP and work object by touching, results to file
    CONST num nPts:=4;
    PERS tooldata tCal:=[TRUE,[[0,0,0],[1,0,0,0]],[0.5,[0,0,20],[1,0,0,0],0,0,0]];
    PERS tooldata tTrue:=[TRUE,[[10,-5,150],[1,0,0,0]],[0.5,[0,0,20],[1,0,0,0],0,0,0]];
    PERS wobjdata wCal:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
    VAR jointtarget jPts{4}; VAR num maxErr; VAR num meanErr; VAR robtarget base; VAR robtarget p{3};
    VAR pos a; VAR pos b; VAR num dist; VAR num flat{2,2}:=[[1,2],[3,4]]; VAR dnum A1{2,2}:=[[2,1],[1,3]]; VAR dnum B1{2}:=[3,5]; VAR dnum X1{2};
    VAR pose pf; VAR num ang{3}; VAR orient o; VAR bool ok; VAR string s{4};
    CONST pos corner{3}:=[[300,0,300],[400,0,300],[350,50,300]];
    VAR pos cc; VAR num rr; VAR pos nn; VAR clock ck; VAR loaddata ld;
    VAR num table{2,3,2}:=[[[1,2],[3,4],[5,6]],[[7,8],[9,10],[11,12]]];
    PROC main()
        ConfJ\Off; ConfL\Off;
        base:=[[374,0,300],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
        MoveJ base,v500,fine,tTrue;
        jPts{1}:=CJointT();
        MoveJ RelTool(base,0,0,0\Rx:=20),v500,fine,tTrue; jPts{2}:=CJointT();
        MoveJ RelTool(base,0,0,0\Rx:=-15\Ry:=15),v500,fine,tTrue; jPts{3}:=CJointT();
        MoveJ RelTool(base,0,0,0\Ry:=-20\Rz:=30),v500,fine,tTrue; jPts{4}:=CJointT();
        MToolTCPCalib jPts{1},jPts{2},jPts{3},jPts{4},tCal,maxErr,meanErr;
        TPWrite "tcp ok "\Bool:=Distance(tCal.tframe.trans,tTrue.tframe.trans)<0.5 AND maxErr<0.1;
        FOR i FROM 1 TO 3 DO
            p{i}:=base; p{i}.trans:=corner{i};
        ENDFOR
        wCal.uframe:=DefFrame(p{1}.trans,p{2}.trans,p{3}.trans);
        TPWrite "frame "+ValToStr(wCal.uframe.trans);
        pf:=DefDFrame(corner{1},corner{2},corner{3},corner{2},corner{3},corner{1});
        TPWrite "d "\Bool:=Abs(pf.rot.q1)<=1;
        FitCircle corner\NumPoints:=3,cc,rr,nn;
        TPWrite "circle r "+NumToStr(rr,2)+" c "+NumToStr(cc.y,2);
        MatrixSolve A1,B1,X1;
        TPWrite "x "+DnumToStr(X1{1},2)+" "+DnumToStr(X1{2},2);
        o:=NOrient([1,1,0,0]);
        ang{1}:=EulerZYX(\X,o);
        TPWrite "rx "\Num:=Round(ang{1});
        a:=corner{2}-corner{1}; b:=corner{3}-corner{1};
        TPWrite "dot "\Num:=DotProd(a,b);
        TPWrite "cross "+ValToStr(a*b);
        TPWrite "sum "\Num:=sum3(flat);
        TPWrite "el "\Num:=table{2,3,1};
        TPWrite ValToStr(PoseMult([[1,0,0],OrientZYX(90,0,0)],[[1,0,0],[1,0,0,0]]));
        ok:=StrToVal(ValToStr(wCal),wCal);
        TPWrite "ok "\Bool:=ok;
        MoveL Offs([[0,0,20],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],0,0,0),v500,fine,tTrue\WObj:=wCal;
        GetDataVal "nPts",dist; TPWrite "data "\Num:=dist;
        SetDataVal "maxErr",7; TPWrite "set "\Num:=maxErr;
        dumpAll;
        WriteVars;
        Stop;
    ENDPROC
    FUNC num sum3(num m{*,*})
        VAR num t:=0;
        FOR i FROM 1 TO Dim(m,1) DO
            FOR j FROM 1 TO Dim(m,2) DO
                Add t,m{i,j};
            ENDFOR
        ENDFOR
        RETURN t;
    ENDFUNC
    PROC dumpAll()
        VAR datapos block; VAR string name; VAR robjoint rj; VAR tooldata t; VAR num k:=0;
        SetDataSearch "tooldata"\PersSym\InMod:="Calib";
        WHILE GetNextSym(name,block) DO
            GetDataVal name\Block:=block,t;
            TPWrite name+" "+NumToStr(t.tframe.trans.z,0);
        ENDWHILE
        SetAllDataVal "tooldata"\TypeMod:="Calib"\Object:="tCal"\Hidden,tool0;
    ENDPROC
    PROC WriteVars()
        VAR iodev f; VAR string line;
        Open "HOME:"\File:="cal.txt",f\Write;
        Write f,"tCal := "+ValToStr(tCal.tframe.trans)+" done";
        Write f,"t: "\Orient:=tCal.tframe.rot;
        Write f,"n: "\Dnum:=123456789012;
        Close f;
        Open "HOME:/cal.txt",f\Read;
        FOR i FROM 1 TO 3 DO
            line:=ReadStr(f);
            TPWrite line;
        ENDFOR
        Close f;
        Save\TaskRef:=T_ROB1Id,"Calib"\FilePath:="HOME:/Calib_saved.mod";
        TPWrite "saved "\Bool:=IsFile("HOME:/Calib_saved.mod");
    ENDPROC
ENDMODULE
