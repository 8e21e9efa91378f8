%%%
  VERSION:1
  LANGUAGE:ENGLISH
%%%

MODULE MenuEdit
    !> wait 0.3
    !> screen Menu Back BACK
    !> screen back
    !> screen chosen 3
    !> screen tower on
    !> screen tower off TRUE
    !> screen done
    !> screen Speed=500.00
    !> screen a=10.00
    !> screen c=10.00
    !> screen sum = 22
    !> screen break TRUE
    !> screen arg speed_props
    !> screen 3.0 FALSE
    !> screen 1.0 FALSE
    !> screen 1.0 TRUE
    ! props of a number that an operator may change
    RECORD num_props
        string name;
        string header;
        num value;
        num min;
        num max;
        bool visible;
    ENDRECORD
    RECORD menu_selection
        num button_selection;
        num list_selection;
    ENDRECORD

    TASK PERS num_props speed_props:=["Speed","Speed of the belt",120,0,500,TRUE];
    PERS num_props all_props{3}:=[["a","A",1,0,10,TRUE],["b","B",2,0,10,FALSE],["c","C",3,0,10,TRUE]];
    CONST string cEmpty:="";
    CONST num nMAX:=3;
    LOCAL VAR num nTries;
    VAR btnres answer;
    VAR bool bTimeout:=FALSE;

    PROC main()
        VAR menu_selection selection;
        VAR string menu_items{3}:=["Value", "Adjust", "Back"];
        VAR string btn{5}:=["NOTES","","","","OK"];
        VAR num n;

        TPErase;
        selection:=menu_LIST("Menu", menu_items, ["SELECT", "BACK"], \previous_selection:=selection);
        if selection.button_selection = 2 TPWrite "back";
        TPWrite("chosen " + NumToStr(selection.list_selection, 0));
        tower\on;
        tower\off\Text:="done";
        edit speed_props;
        FOR i FROM 1 TO Dim(all_props,1) DO
            IF all_props{i}.visible edit all_props{i};
        ENDFOR
        TPWrite "sum = "\Num:=total();
        answer:=UIMessageBox(\Header:="LOOK"\MsgArray:=["a","b"]\BtnArray:=btn\Icon:=iconWarning\MaxTime:=0.1\BreakFlag:=n);
        TPWrite "break " + ValToStr(n = ERR_TP_MAXTIME);
        TPWrite ArgNames(speed_props.value);
        show 1\second:=2;
        show 1;
        show\third, 1;
        Stop;
    ENDPROC

    PROC tower(\switch on|switch off, \string Text)
        IF Present(on) THEN
            TPWrite "tower on";
        ELSEIF Present(off) THEN
            TPWrite "tower off "\Bool:=Present(Text);
        ENDIF
        IF Present(Text) TPWrite Text;
    ENDPROC

    PROC show(\switch third, num a \num second)
        VAR num x:=0;
        IF Present(second) x:=second;
        TPWrite NumToStr(a+x,1) + " " + ValToStr(Present(third));
    ENDPROC

    PROC edit(INOUT num_props p)
        p.value:=limit(p.value*10,p.min,p.max);
        TPWrite p.name+"="+NumToStr(p.value,2);
    ENDPROC

    FUNC num limit(num v,num low,num high)
        IF v<low THEN
            RETURN low;
        ELSEIF v>high THEN
            RETURN high;
        ENDIF
        RETURN v;
    ENDFUNC

    FUNC num total()
        VAR num s:=0;
        FOR i FROM nMAX TO 1 DO
            s:=s+all_props{i}.value;
        ENDFOR
        RETURN s;
    ENDFUNC

    FUNC string ArgNames(INOUT num x)
        RETURN "arg "+ArgName(x);
    ENDFUNC

    FUNC menu_selection menu_LIST(string title, string items{*}, string buttons{*} \INOUT menu_selection previous_selection)
        VAR menu_selection result;
        TPWrite title+" "+items{Dim(items,1)}+" "+buttons{2};
        IF Present(previous_selection) result:=previous_selection;
        result.button_selection:=2;
        result.list_selection:=result.list_selection+Dim(items,1);
        RETURN result;
    ENDFUNC
ENDMODULE
