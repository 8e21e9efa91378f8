MODULE QuestionWithTimeout
    !> wait 0.6
    !> screen nobody answered, going on
    PROC main()
        VAR btnres answer;
        VAR errnum why;
        answer := UIMessageBox(\Message:="Clamp the part"\Buttons:=btnOKCancel\MaxTime:=0.5\BreakFlag:=why);
        IF why = ERR_TP_MAXTIME TPWrite "nobody answered, going on";
        WaitTime 100;
    ENDPROC
ENDMODULE