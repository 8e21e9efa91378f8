%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%
MODULE Syntax (NOSTEPIN,
               READONLY)
    !> screen one
    !> screen two
    !> screen three
    !> screen b1 TRUE
    !> screen minus one
    !> screen hex 280.501
    !> screen [2,2,0]
    !> screen [4,-4,0]
    !> screen TRUE
    !> screen opt 1
    !> screen opt 2 1
    !> screen opt sw 2 x1
    !> screen opt 5 3
    !> screen opt 3
    !> screen loc 20
    !> screen x
    !> screen y
    !> screen none
    !> screen tp 2
    !> screen ak[7,0,1]
    !> screen TRUEFALSE
    !> screen f1
    !> screen f2
    !> screen f3
    !> screen cnt 6
    !> screen lab2
    !> screen lab1
    !> screen 120 6
    !> screen n 7
    !> screen a 8
    !> screen TRUETRUEFALSETRUE
    !> screen 12
    !> screen xyz
    !> screen caught 1057
    !> screen 77
!***********************************************************
! Geraet: Pruefstand
!***********************************************************
LOCAL RECORD t_item
  num id; string nm; pos p;
  bool flags;
ENDRECORD
TASK VAR num tv:=0;
TASK PERS num tp:=1;
LOCAL CONST num c1:=3;
CONST dnum cd:=0xFF;
CONST num hx:=0xFF; CONST num bn:=0b101; CONST num oc:=0o17; CONST num fl:=.5; CONST num fl2:=5.; CONST num ex:=1E-3;
CONST num dims:=2;
VAR num mat{dims,c1}:=[[1,2,3],[4,5,6]];
PERS t_item items{2}:=[[1,"a",[0,0,1],TRUE],[2,"b",[0,0,2],FALSE]];
VAR bool b1; VAR num i:=99; VAR pos pp; VAR orient oo; VAR string s; VAR num n;
VAR intnum ii; VAR num cnt:=0; VAR signaldo sd; VAR num buf{5};
Proc MAIN ( )
  VAR num i:=0;
  var bool done:=false;
  CONST string K:="k";
  VAR num loc{3}:=[1,2,3];
  VAR string nullstr;
  WHILE NOT (done AND TRUE) DO
    i := i+1 ;
    IF i = 1 THEN ! first
      TPWrite "one";
    ELSEIF i=2 THEN
      TPWrite "two";
    ELSE IF i=3 THEN
        TPWrite "three";
      ENDIF
      done:=i>=3;
    ENDIF
  ENDWHILE
  b1 := i = 3;
  TPWrite "b1 "\Bool:=b1;
  TEST i-4
  CASE -1, 1+1: TPWrite "minus one";
  CASE 5:
  DEFAULT:
  ENDTEST
  TPWrite "hex " \Num:=hx+bn+oc+fl+fl2+ex;
  pp := -items{2}.p + [2,2,2];
  TPWrite ValToStr(pp);
  pp:=2*pp; pp:=pp*[0,0,1];
  TPWrite ValToStr(pp);
  oo := OrientZYX(90,0,0)*OrientZYX(-90,0,0);
  TPWrite ValToStr(oo.q1>0.9999);
  opt 1;
  opt 1\b:=2;
  opt \sw,1\b:=2\c:="x";
  outer\b:=5;
  outer;
  arr loc; TPWrite "loc "\Num:=loc{2};
  arr buf;
  alt\x:=1; alt\y:="s"; alt;
  persarg tp; TPWrite "tp "\Num:=tp;
  items{1}.nm:=items{1}.nm+K+nullstr; items{1}.p.x:=7;
  TPWrite items{1}.nm+ValToStr(items{1}.p);
  items{2}:=items{1};
  TPWrite ValToStr(items{2}=items{1})+ValToStr(items{1}<>items{2});
  FOR i FROM 1 TO 3 DO TPWrite "f"\Num:=i; ENDFOR
  FOR k FROM 3 TO 1 DO cnt:=cnt+k; ENDFOR
  TPWrite "cnt "\Num:=cnt;
  GOTO lab2;
  lab1: TPWrite "lab1"; GOTO lab3;
  lab2:
  TPWrite "lab2";
  GOTO lab1;
  lab3:
  TPWrite NumToStr(Fact(5),0)+" "+ValToStr(gcd(48,18));
  IF i=3 n:=7; TPWrite "n "\Num:=n;
  mods;
  Stop\NoRegain;
ENDPROC
PROC mods()
  VAR num a;
  a:=5 DIV 2*3+7 MOD 4-1;
  TPWrite "a "\Num:=a;
  TPWrite ValToStr(TRUE OR FALSE AND FALSE)+ValToStr(NOT TRUE OR TRUE)+ValToStr(TRUE XOR TRUE)+ValToStr(1<2 AND 2<=2);
  TPWrite ValToStr(2+3*4-6/3);
  TPWrite "" + "x" + ("y" + "z");
  errs;
ERROR (77)
  TPWrite "77";
  TRYNEXT;
UNDO
  TPWrite "undo?";
ENDPROC
PROC errs()
  nested;
  TPWrite "after nested";
ERROR ( ERR_DIVZERO,
        LONG_JMP_ALL_ERR )
  TPWrite "caught "\Num:=ERRNO;
  IF ERRNO=ERR_DIVZERO RAISE 77;
ENDPROC
PROC nested()
  n:=1/(n-n);
ENDPROC
PROC opt(\switch sw, num a \num b \string c)
  VAR string r:="opt ";
  IF Present(sw) r:=r+"sw ";
  IF Present(b) r:=r+NumToStr(b,0)+" ";
  IF Present(c) r:=r+c;
  TPWrite r+NumToStr(a,0);
ENDPROC
PROC outer(\num b)
  opt 3\b?b;
ENDPROC
PROC arr(INOUT num a{*})
  FOR q FROM 1 TO Dim(a,1) DO
    a{q}:=a{q}*10;
  ENDFOR
ENDPROC
PROC alt(\num x | string y)
  IF Present(x) THEN TPWrite "x"; ELSEIF Present(y) THEN TPWrite "y"; ELSE TPWrite "none"; ENDIF
ENDPROC
PROC persarg(PERS num p)
  p:=p+1;
ENDPROC
FUNC num Fact(num k)
  IF k<=1 THEN
    RETURN 1;
  ENDIF
  RETURN (k*Fact(k-1));
ENDFUNC
LOCAL FUNC num gcd(num a,num b)
  VAR num t;
  WHILE b<>0 DO
    t:=b; b:=a MOD b; a:=t;
  ENDWHILE
  RETURN a;
ENDFUNC
ENDMODULE
