MODULE Form
    !> wait 0.05
    !> answer 250
    !> wait 0.05
    !> answer blue
    !> wait 0.05
    !> answer Yes
    !> wait 0.05
    !> screen 250 x blue
    PROC main()
        VAR num n;
        VAR string colour;
        n := UINumEntry(\Header:="Order"\Message:="How many?"\Icon:=iconInfo\InitValue:=1\MinValue:=1\MaxValue:=500\AsInteger);
        colour := UIAlphaEntry(\Header:="Order"\Message:="Which colour?"\InitString:="red");
        IF UIMessageBox(\Header:="Order"\Message:="Begin?"\Buttons:=btnYesNo\Icon:=iconWarning) = resYes THEN
            TPWrite ValToStr(n) + " x " + colour;
        ENDIF
        WaitTime 100;
    ENDPROC
ENDMODULE