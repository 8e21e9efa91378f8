! @run 1
! @line T_ROB_L 1 2 3 4 5 6 9E+09
! @line T_ROB_L unit ROB_L
! @line T_ROB_L stop points 3 kinds
! @line T_ROB_L modes differ
! @line T_ROB_L frames differ
! @line T_ROB_L pressure 2.5 group 3
! @line T_ROB_L [0,0,0] 1
! @line T_ROB_L length 5
! @line T_ROB_L own frame wobj0
MODULE Predefined
    ! Data of predefined types, declared as programs do.
    VAR robjoint joints := [1, 2, 3, 4, 5, 6];
    VAR extjoint external := [9E9, 9E9, 9E9, 9E9, 9E9, 9E9];
    VAR confdata conf := [0, 0, 0, 0];
    VAR identno id := 10;
    VAR mecunit unit;
    VAR stoppointdata waited := inpos50;
    VAR dionum level := high;
    VAR egmframetype frameType := EGM_FRAME_WOBJ;
    VAR egmstopmode stopMode := EGM_STOP_RAMP_DOWN;
    VAR motionprocessmode mode := ACCURACY_MODE;
    VAR tunetype tuning := TUNE_KV;
    VAR intnum change;
    PROC main()
        VAR string text := "";
        TPWrite ValToStr(joints.rax_1) + " " + ValToStr(joints.rax_2) + " " + ValToStr(joints.rax_3) + " "
            + ValToStr(joints.rax_4) + " " + ValToStr(joints.rax_5) + " " + ValToStr(joints.rax_6) + " "
            + ValToStr(external.eax_a);
        unit := ROB_ID;
        TPWrite "unit " + GetMecUnitName(unit);
        IF stoptime0_5 <> stoptime1_0 AND stoptime1_0 <> stoptime1_5 AND inpos20 <> inpos50 AND inpos50 <> inpos100
            AND fllwtime0_5 <> fllwtime1_0 AND fllwtime1_0 <> fllwtime1_5 AND waited = inpos50
            AND waited.type = inpos AND stoptime0_5.type = stoptime AND fllwtime0_5.type = fllwtime
            AND inpos <> stoptime AND stoptime <> fllwtime TPWrite "stop points 3 kinds";
        IF mode <> OPTIMAL_CYCLE_TIME_MODE AND mode <> LOW_SPEED_STIFF_MODE AND MPM_USER_MODE_1 <> MPM_USER_MODE_2
            AND MPM_USER_MODE_3 <> MPM_USER_MODE_4 AND tuning <> TUNE_TI AND TUNE_DF <> TUNE_DG AND TUNE_DH <> TUNE_DI
            AND TUNE_DK <> TUNE_DL AND TUNE_FRIC_LEV <> TUNE_FRIC_RAMP TPWrite "modes differ";
        IF frameType <> EGM_FRAME_TOOL AND EGM_FRAME_WORLD <> EGM_FRAME_JOINT AND stopMode <> EGM_STOP_HOLD
            AND EGM_STATE_DISCONNECTED <> EGM_STATE_CONNECTED AND EGM_STATE_RUNNING <> EGM_STATE_CONNECTED
            TPWrite "frames differ";
        SetAO aoPressure, 2.5;
        SetGO goMask, 3;
        show aoPressure, goMask;
        TPWrite ValToStr(zero()) + " " + ValToStr(Round(Vectmagn([1, 0, 0])));
        TPWrite "length " + ValToStr(Vectmagn([3, 4, 0]));
        IF CWObj() = wobj0 TPWrite "own frame wobj0";
        Stop;
    ENDPROC
    PROC show(VAR signalao pressure, VAR signalgo mask)
        TPWrite "pressure " + ValToStr(AOutput(pressure)) + " group " + ValToStr(GOutput(mask));
    ENDPROC
    FUNC pos zero()
        VAR pos now;
        VAR orient turned;
        VAR robtarget here;
        now := CPos(\Tool:=tool0 \WObj:=wobj0);
        here := ORobT(CRobT(\Tool:=tool0 \WObj:=wobj0));
        turned := NOrient(here.rot);
        IF Distance(now, [0, 0, 0]) > 100 AND Abs(turned.q1) <= 1 RETURN [0, 0, 0];
        RETURN now;
    ENDFUNC
ENDMODULE
