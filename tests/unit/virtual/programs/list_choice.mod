MODULE ListChoice
    !> wait 0.05
    !> answer Service/OK
    !> wait 0.05
    !> screen 2 Service, button 1
    CONST listitem programs{3} := [[stEmpty, "Production"], [stEmpty, "Service"], ["calib.gif", "Calibration"]];

    PROC main()
        VAR num item;
        VAR btnres button;
        item := UIListView(\Result:=button\Header:="Programs", programs\Buttons:=btnOKCancel\Icon:=iconInfo\DefaultIndex:=1);
        IF button = resOK TPWrite ValToStr(item) + " " + programs{item}.text + ", button " + ValToStr(button);
        WaitTime 100;
    ENDPROC
ENDMODULE