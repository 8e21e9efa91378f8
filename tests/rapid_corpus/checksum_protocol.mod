! @run 0.3
! @line $ROB,42*75 ok
! @line $ROB,43*75 bad
MODULE Checksum
    PROC main()
        check "$ROB,42*75";
        check "$ROB,43*75";
        Stop;
    ENDPROC
    PROC check(string sentence)
        VAR num star;
        VAR byte sum := 0;
        VAR string wanted;
        star := StrFind(sentence, 1, "*");
        FOR i FROM 2 TO star - 1 DO
            sum := BitXOr(sum, StrToByte(StrPart(sentence, i, 1) \Char));
        ENDFOR
        wanted := StrPart(sentence, star + 1, 2);
        IF StrMap(ByteToStr(sum \Hex), STR_LOWER, STR_UPPER) = wanted THEN
            TPWrite sentence + " ok";
        ELSE
            TPWrite sentence + " bad";
        ENDIF
    ENDPROC
ENDMODULE
