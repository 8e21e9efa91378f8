!@ robot irb120
!@ tool 0 0 120
!@ through 330 -50 160
!@ through 330 50 160
!@ value arc_was_on TRUE
!@ value seam_time_ok TRUE
MODULE WeldingSeam
    PERS tooldata torch:=[TRUE,[[0,0,120],[1,0,0,0]],[0.5,[0,0,60],[1,0,0,0],0,0,0]];
    CONST robtarget seam_start:=[[330,-50,160],[0,0,1,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST robtarget seam_end:=[[330,50,160],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    PERS bool arc_was_on:=FALSE;
    PERS bool seam_time_ok:=FALSE;

    PROC main()
        VAR clock timer;
        VAR triggdata arc_on;
        ConfL\Off;
        ConfJ\Off;
        Reset custom_DO_0;
        MoveJ Offs(seam_start,0,0,50),v300,z10,torch;
        TriggIO arc_on,0\DOp:=custom_DO_0,1;
        TriggL seam_start,v100,arc_on,fine,torch;
        arc_was_on:=DOutput(custom_DO_0)=1;
        ClkReset timer;
        ClkStart timer;
        MoveL seam_end,v50,fine,torch;
        ClkStop timer;
        Reset custom_DO_0;
        seam_time_ok:=ClkRead(timer)>2.0 AND ClkRead(timer)<2.4;
        MoveL Offs(seam_end,0,0,50),v300,fine,torch;
    ENDPROC
ENDMODULE
