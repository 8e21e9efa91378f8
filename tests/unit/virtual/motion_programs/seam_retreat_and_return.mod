!@ robot irb120
!@ value passes 2
!@ through 350 60 330
MODULE SeamWithRetreat
    ! a fault in the middle of a seam: back along the path to its beginning, and the seam again
    CONST robtarget seam_start:=[[350,0,330],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    PERS num passes:=0;
    VAR pathrecid begin;
    VAR intnum arc_lost;
    VAR bool failed:=TRUE;

    PROC main()
        passes:=0;
        ConfL\Off;
        ConfJ\Off;
        MoveJ seam_start,v500,fine,tool0;
        PathRecStart begin;
        IDelete arc_lost;
        CONNECT arc_lost WITH lost;
        ITimer\Single,0.4,arc_lost;
        seam;
        PathRecStop\Clear;
        WaitTime 0.1;
    ENDPROC

    PROC seam()
        Incr passes;
        MoveL Offs(seam_start,0,30,0),v50,z1,tool0;
        MoveL Offs(seam_start,0,60,0),v50,fine,tool0;
    ERROR (ERR_PATH_STOP)
        IF PathRecValidBwd(\ID:=begin) THEN
            StorePath;
            PathRecMoveBwd\ID:=begin\Speed:=v200;
            RestoPath;
            ClearPath;
            StartMove;
            Incr passes;
            MoveL Offs(seam_start,0,60,0),v100,fine,tool0;
            RETURN;
        ENDIF
    ENDPROC

    TRAP lost
        IF failed THEN
            failed:=FALSE;
            ProcerrRecovery\SyncLastMoveInst;
        ENDIF
    ENDTRAP
ENDMODULE
