MODULE TRobUtility
    ! What the other modules share: who this arm is, where its base and its calibration marks are, and how
    ! messages begin. Loaded once per motion task, so every value here belongs to one arm.

    RECORD GeneralInfo
        bool mech_unit_data_found;
        string mech_unit_name;
        bool is_active;
        bool is_tcp_robot;
        bool is_irb14000;
        num number_of_axes;
        bool using_modal_payload;
        pose base_frame;
    ENDRECORD

    ! Angles as the configuration keeps them: radians.
    RECORD CalibrationValues
        bool has_joint_1;
        num joint_1;
        bool has_joint_2;
        num joint_2;
        bool has_joint_3;
        num joint_3;
        bool has_joint_4;
        num joint_4;
        bool has_joint_5;
        num joint_5;
        bool has_joint_6;
        num joint_6;
        bool has_joint_7;
        num joint_7;
    ENDRECORD

    CONST num MAX_NUMBER_OF_MOTION_TASKS:=4;
    CONST num M_TO_MM:=1000;
    CONST num MM_TO_M:=0.001;
    CONST num RAD_TO_DEG:=57.2957795;
    CONST num DEG_TO_RAD:=0.0174532925;

    CONST string MSG_MAIN:="[Main]: ";
    CONST string MSG_UTILITY:="[Utility]: ";
    CONST string MSG_WATCHDOG:="[Watchdog]: ";
    CONST string MSG_RAPID:="[RAPID]: ";
    CONST string MSG_SYSTEM:="[System]: ";
    CONST string MSG_EGM:="[EGM]: ";
    CONST string MSG_SG:="[SmartGripper]: ";

    ! Motion instructions take persistent tool and work object data only, hence PERS; TASK keeps the arms apart.
    TASK PERS wobjdata base_wobj:=[FALSE,TRUE,"",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
    TASK PERS tooldata current_tool:=[TRUE,[[0,0,0],[1,0,0,0]],[0.001,[0,0,0.001],[1,0,0,0],0,0,0]];

    VAR GeneralInfo general_info;
    VAR CalibrationValues calibration_values;

    PROC initializeUtilityModule()
        general_info.mech_unit_name:=GetMecUnitName(ROB_ID);
        general_info.is_irb14000:=general_info.mech_unit_name="ROB_L" OR general_info.mech_unit_name="ROB_R";
        general_info.using_modal_payload:=GetModalPayLoadMode()=1;
        readMechUnitData;
        readBaseFrame;
        readCalibrationValues;
        base_wobj.uframe:=general_info.base_frame;
        current_tool:=CTool();
    ENDPROC

    ! Where the arm stands when all calibration marks meet; joints without a mark stay where they are.
    FUNC jointtarget getCalibrationTarget()
        VAR jointtarget target;

        target:=CJointT();
        IF calibration_values.has_joint_1 target.robax.rax_1:=calibration_values.joint_1*RAD_TO_DEG;
        IF calibration_values.has_joint_2 target.robax.rax_2:=calibration_values.joint_2*RAD_TO_DEG;
        IF calibration_values.has_joint_3 target.robax.rax_3:=calibration_values.joint_3*RAD_TO_DEG;
        IF calibration_values.has_joint_4 target.robax.rax_4:=calibration_values.joint_4*RAD_TO_DEG;
        IF calibration_values.has_joint_5 target.robax.rax_5:=calibration_values.joint_5*RAD_TO_DEG;
        IF calibration_values.has_joint_6 target.robax.rax_6:=calibration_values.joint_6*RAD_TO_DEG;
        IF calibration_values.has_joint_7 target.extax.eax_a:=calibration_values.joint_7*RAD_TO_DEG;
        RETURN target;
    ENDFUNC

    ! A name between quotation marks. RAPID strings end at 80 characters, and a message needs room for its own words.
    FUNC string inQuotes(string name)
        IF StrLen(name)>32 THEN
            RETURN "'"+StrPart(name,1,32)+"...'";
        ENDIF
        RETURN "'"+name+"'";
    ENDFUNC

    LOCAL PROC readMechUnitData()
        VAR num list_number:=0;
        VAR string unit_name:="";
        VAR bool is_tcp_robot:=FALSE;
        VAR bool is_active:=FALSE;
        VAR num number_of_axes:=0;

        general_info.mech_unit_data_found:=FALSE;
        WHILE GetNextMechUnit(list_number,unit_name\TCPRob:=is_tcp_robot\NoOfAxes:=number_of_axes\Active:=is_active) DO
            IF unit_name=general_info.mech_unit_name THEN
                general_info.mech_unit_data_found:=TRUE;
                general_info.is_tcp_robot:=is_tcp_robot;
                general_info.is_active:=is_active;
                general_info.number_of_axes:=number_of_axes;
            ENDIF
        ENDWHILE
    ENDPROC

    ! The configuration measures the base in metres, RAPID in millimetres.
    LOCAL PROC readBaseFrame()
        VAR string robot_path;

        general_info.base_frame:=[[0,0,0],[1,0,0,0]];
        robot_path:="/MOC/ROBOT/"+general_info.mech_unit_name;
        ReadCfgData robot_path,"base_frame_pos_x",general_info.base_frame.trans.x;
        ReadCfgData robot_path,"base_frame_pos_y",general_info.base_frame.trans.y;
        ReadCfgData robot_path,"base_frame_pos_z",general_info.base_frame.trans.z;
        ReadCfgData robot_path,"base_frame_orient_u0",general_info.base_frame.rot.q1;
        ReadCfgData robot_path,"base_frame_orient_u1",general_info.base_frame.rot.q2;
        ReadCfgData robot_path,"base_frame_orient_u2",general_info.base_frame.rot.q3;
        ReadCfgData robot_path,"base_frame_orient_u3",general_info.base_frame.rot.q4;
        general_info.base_frame.trans:=general_info.base_frame.trans*M_TO_MM;
        general_info.base_frame.rot:=NOrient(general_info.base_frame.rot);
    ERROR
        TPWrite MSG_UTILITY+"Base frame not found, using the origin";
        general_info.base_frame:=[[0,0,0],[1,0,0,0]];
        RETURN;
    ENDPROC

    ! The seventh axis of a YuMi arm is a mechanical unit of its own, named after the arm.
    LOCAL PROC readCalibrationValues()
        VAR string robot_path;

        robot_path:="/MOC/ROBOT/"+general_info.mech_unit_name;
        readCalibration robot_path,"use_joint_0",calibration_values.has_joint_1,calibration_values.joint_1;
        readCalibration robot_path,"use_joint_1",calibration_values.has_joint_2,calibration_values.joint_2;
        readCalibration robot_path,"use_joint_2",calibration_values.has_joint_3,calibration_values.joint_3;
        readCalibration robot_path,"use_joint_3",calibration_values.has_joint_4,calibration_values.joint_4;
        readCalibration robot_path,"use_joint_4",calibration_values.has_joint_5,calibration_values.joint_5;
        readCalibration robot_path,"use_joint_5",calibration_values.has_joint_6,calibration_values.joint_6;
        calibration_values.has_joint_7:=FALSE;
        IF general_info.is_irb14000 THEN
            readCalibration "/MOC/SINGLE/"+general_info.mech_unit_name+"_7","use_joint",
                calibration_values.has_joint_7,calibration_values.joint_7;
        ENDIF
    ENDPROC

    LOCAL PROC readCalibration(string unit_path,string joint_attribute,INOUT bool is_found,INOUT num angle)
        VAR string joint_name:="";

        is_found:=FALSE;
        angle:=0;
        ReadCfgData unit_path,joint_attribute,joint_name;
        ReadCfgData "/MOC/ARM/"+joint_name,"cal_position",angle;
        is_found:=TRUE;
    ERROR
        RETURN;
    ENDPROC
ENDMODULE
