!@ robot irb120
!@ value found [20,0,60]
MODULE ToolCalibration
    ! the four-point method at a fixed tip, taught by moves of the true tool
    CONST robtarget tip:=[[350,0,330],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    PERS tooldata true_tool:=[TRUE,[[20,0,60],[1,0,0,0]],[0.5,[0,0,30],[1,0,0,0],0,0,0]];
    PERS tooldata new_tool:=[TRUE,[[0,0,0],[1,0,0,0]],[0.5,[0,0,30],[1,0,0,0],0,0,0]];
    PERS pos found:=[0,0,0];
    VAR jointtarget taught{4};
    VAR num max_error;
    VAR num mean_error;

    PROC main()
        ConfL\Off;
        ConfJ\Off;
        FOR i FROM 1 TO 4 DO
            MoveJ RelTool(tip,0,0,0\Rx:=10*(i MOD 2)\Ry:=8*(i DIV 2)\Rz:=15*(i-1)),v500,fine,true_tool;
            taught{i}:=CJointT();
        ENDFOR
        MToolTCPCalib taught{1},taught{2},taught{3},taught{4},new_tool,max_error,mean_error;
        found:=[Round(new_tool.tframe.trans.x\Dec:=1),Round(new_tool.tframe.trans.y\Dec:=1),Round(new_tool.tframe.trans.z\Dec:=1)];
        IF max_error>0.1 found:=[0,0,0];
    ENDPROC
ENDMODULE
