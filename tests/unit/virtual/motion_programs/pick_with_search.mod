!@ robot irb120
!@ touch 3.0
!@ value found_height TRUE
MODULE PickWithSearch
    CONST robtarget above:=[[350,0,350],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    PERS bool found_height:=FALSE;

    PROC main()
        VAR robtarget contact;
        ConfL\Off;
        ConfJ\Off;
        found_height:=FALSE;
        MoveJ above,v300,fine,tool0;
        SearchL\Stop,custom_DI_0,contact,Offs(above,0,0,-150),v50,tool0;
        found_height:=contact.trans.z<345 AND contact.trans.z>201;
        MoveL above,v100,fine,tool0;
    ERROR
        IF ERRNO=ERR_WHLSEARCH THEN
            TPWrite "nothing found";
            TRYNEXT;
        ENDIF
    ENDPROC
ENDMODULE
