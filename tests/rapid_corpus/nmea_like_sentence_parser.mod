! @run 0.5
! @line POS 3 fields, x 412.5 y -17.25
! @line bad checksum: 5A
! @line STATE open
! @line no sentence: hello
MODULE Sentences
    ! $KIND,field,field*HH with the exclusive or of all between $ and *
    VAR string stFields{8};
    VAR num nFields;
    PROC main()
        Handle "$POS,412.5,-17.25,R*"+CheckOf("POS,412.5,-17.25,R");
        Handle "$POS,1,2,R*5A";
        Handle "$STATE,open*"+CheckOf("STATE,open");
        Handle "hello";
        Stop;
    ENDPROC
    PROC Handle(string line)
        VAR num star;
        VAR string body;
        VAR num x;
        VAR num y;
        VAR bool ok;
        star:=StrFind(line,1,"*");
        IF StrPart(line,1,1)<>"$" OR star>StrLen(line) THEN
            TPWrite "no sentence: "+line;
            RETURN;
        ENDIF
        body:=StrPart(line,2,star-2);
        IF StrPart(line,star+1,2)<>CheckOf(body) THEN
            TPWrite "bad checksum: "+StrPart(line,star+1,2);
            RETURN;
        ENDIF
        Split body;
        TEST stFields{1}
        CASE "POS":
            ok:=StrToVal(stFields{2},x) AND StrToVal(stFields{3},y);
            TPWrite "POS "+ValToStr(nFields-1)+" fields, x "+ValToStr(x)+" y "+ValToStr(y);
        CASE "STATE","MODE":
            TPWrite stFields{1}+" "+stFields{2};
        DEFAULT:
            TPWrite "unknown";
        ENDTEST
    ENDPROC
    PROC Split(string body)
        VAR num begin:=1;
        VAR num comma;
        nFields:=0;
        WHILE begin<=StrLen(body) DO
            comma:=StrFind(body,begin,",");
            nFields:=nFields+1;
            stFields{nFields}:=StrPart(body,begin,comma-begin);
            begin:=comma+1;
        ENDWHILE
    ENDPROC
    FUNC string CheckOf(string text)
        VAR byte sum:=0;
        FOR i FROM 1 TO StrLen(text) DO
            sum:=BitXOr(sum,StrToByte(StrPart(text,i,1)\Char));
        ENDFOR
        RETURN ByteToStr(sum\Hex);
    ENDFUNC
ENDMODULE
