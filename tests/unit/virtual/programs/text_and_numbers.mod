MODULE Parser
    !> screen to 10.5,-3.0 #
    !> screen [22,-4,3] TRUETRUE
    !> screen t1 [1,2,3] -1
    !> screen HELLO WORLD
    !> screen 3141.5
    !> screen 42TRUE
    !> screen TRUE
    !> screen 4294967295 3.33333E-01
    !> screen FF A 00010000
    !> screen 255154
    !> screen len 9
    !> screen f 3.5
    !> screen greater
    !> screen odd 7
    !> screen odd 1
    !> screen ten
    !> screen mine
    !> screen too long
    !> screen after
    !> screen -0 2 10000000000 12345.68
    !> screen 1E+10 0.1 0.333333 -5
    !> screen -2.50 2.570
    !> screen q"uote \ back |
    VAR string cmd{5};
    VAR num pos_chr0:=1;
    VAR num pos_chr1;
    VAR byte data{10};
    VAR rawbytes raw;
    VAR bool ok;
    VAR num px; VAR num py;
    VAR pose p1:=[[1,2,3],[1,0,0,0]];
    VAR robtarget t1;
    VAR dnum big;
    VAR errnum my_err:=-1;

    PROC main()
        VAR string msg:="MoveTo 10.5 -3 #";
        BookErrNo my_err;
        split msg;
        %cmd{1}%;
        ok:=StrToVal("[[1,2,3],[1,0,0,0],[0,0,-1,1],[9E9,9E9,9E9,9E9,9E9,9E9]]",t1);
        TPWrite "t1 "+ValToStr(t1.trans)+" "+ValToStr(t1.robconf.cf6);
        TPWrite StrMap("hello world",STR_LOWER,STR_UPPER);
        TPWrite StrPart(NumToStr(pi*1000,3),1,6);
        TPWrite ValToStr(StrMatch("abcabc",2,"abc"))+ValToStr(StrFind("a1b2",1,STR_DIGIT))+ValToStr(StrMemb("abc",2,"xyzb"));
        TPWrite ValToStr(StrOrder("a","b",STR_UPPER+STR_LOWER));
        big:=4294967295;
        TPWrite DnumToStr(big,0)+" "+DnumToStr(1/3,5\Exp);
        TPWrite ByteToStr(255\Hex)+" "+ByteToStr(65\Char)+" "+ByteToStr(BitLSh(1,4)\Bin);
        data{1}:=StrToByte("FF"\Hex);
        TPWrite NumToStr(data{1},0)+NumToStr(BitAnd(data{1},15),0)+NumToStr(BitXOr(5,1),0);
        PackRawBytes 3.5,raw,RawBytesLen(raw)+1\Float4;
        PackRawBytes "abc",raw,RawBytesLen(raw)+1\ASCII;
        PackRawBytes 258,raw,RawBytesLen(raw)+1\IntX:=INT;
        TPWrite "len "\Num:=RawBytesLen(raw);
        UnpackRawBytes raw\Network,1,px\Float4;
        UnpackRawBytes raw,1,px\Float4;
        TPWrite "f "\Num:=px;
        TPWrite StrDigCmpTxt("1234","234");
        FOR i FROM 10 TO 1 STEP -3 DO
            IF i MOD 2=0 GOTO next_one;
            TPWrite "odd "\Num:=i;
            next_one:
        ENDFOR
        TEST cmd{2}
        CASE "10.5","11":
            TPWrite "ten";
        DEFAULT:
            TPWrite "?";
        ENDTEST
        fail 1;
        fail 2;
        TPWrite NumToStr(-0.4,0)+" "+NumToStr(2.5,0)+" "+NumToStr(1E10,0)+" "+NumToStr(12345.678,2);
        TPWrite ValToStr(1E10)+" "+ValToStr(0.1)+" "+ValToStr(1/3)+" "+ValToStr(-5);
        TPWrite NumToStr(Trunc(-2.567\Dec:=1),2)+" "+NumToStr(Round(2.567\Dec:=2),3);
        TPWrite "q""uote"+" \\ back |";
        Stop;
    ENDPROC
    FUNC string StrDigCmpTxt(string a,string b)
        IF StrDigCmp(a,GT,b) RETURN "greater";
        RETURN "not";
    ENDFUNC
    PROC fail(num kind)
        IF kind=1 RAISE my_err;
        px:=cmdNumber("x1");
        TPWrite "after";
        ERROR
            TEST ERRNO
            CASE my_err:
                TPWrite "mine";
                RETURN;
            CASE ERR_STRTOOLNG, ERR_ARGVALERR:
                TPWrite "too long";
                TRYNEXT;
            DEFAULT:
                RAISE;
            ENDTEST
    ENDPROC
    FUNC num cmdNumber(string s)
        VAR num v;
        IF NOT StrToVal(s,v) RAISE ERR_ARGVALERR;
        RETURN v;
    ERROR
        RAISE;
    ENDFUNC
    PROC split(string text)
        VAR num i:=1;
        pos_chr1:=StrFind(text,1," ");
        WHILE pos_chr1<=StrLen(text) DO
            cmd{i}:=StrPart(text,pos_chr0,(pos_chr1-pos_chr0));
            pos_chr0:=pos_chr1+1;
            i:=i+1;
            pos_chr1:=StrFind(text,pos_chr0," ");
        ENDWHILE
        cmd{i}:=StrPart(text,pos_chr0,pos_chr1-pos_chr0);
    ENDPROC
    PROC MoveTo()
        ok:=StrToVal(cmd{2},px) AND StrToVal(cmd{3},py);
        TPWrite "to "+NumToStr(px,1)+","+NumToStr(py,1)+" "+cmd{4};
        p1.trans:=p1.trans+[px,py,0]+[px,py,0];
        TPWrite ValToStr(p1.trans)+" "+ValToStr(VectMagn(p1.trans)>0)+ValToStr(p1=[[22,-4,3],[1,0,0,0]]);
    ENDPROC
ENDMODULE
