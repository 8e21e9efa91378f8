!@ robot irb120
!@ through 350 0 300
!@ event 50050
!@ value recovered TRUE
MODULE Recovery
    CONST robtarget near:=[[350,0,300],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    PERS bool recovered:=FALSE;

    PROC main()
        recovered:=FALSE;
        ConfL\Off;
        ConfJ\Off;
        MoveJ Offs(near,800,0,0),v500,fine,tool0;
        MoveJ near,v500,fine,tool0;
    ERROR
        IF ERRNO=ERR_OUTSIDE_REACH OR ERRNO=ERR_ROBLIMIT THEN
            recovered:=TRUE;
            TRYNEXT;
        ENDIF
    ENDPROC
ENDMODULE
