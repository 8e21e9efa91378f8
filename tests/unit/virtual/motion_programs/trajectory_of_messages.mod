!@ robot irb120
!@ joint 0 1.01
!@ joint 5 6.1
!@ screen point 1 1
!@ screen point 2 2
!@ screen bytes 20
!@ screen [1,2,3,4,5,6]-1
!@ screen type 11
!@ screen there
!@ screen ROS_like: done: size = 2
MODULE ROS_main
    RECORD ROS_msg_header
        num msg_type;
        num comm_type;
        num reply_code;
    ENDRECORD
    RECORD ROS_msg
        ROS_msg_header header;
        rawbytes data;
    ENDRECORD
    RECORD ROS_joint_trajectory_pt
        robjoint joint_pos;
        num duration;
    ENDRECORD
    RECORD ROS_msg_joint
        ROS_msg_header header;
        num sequence_id;
        robjoint joints;
        num velocity;
    ENDRECORD
    CONST num MAX_TRAJ_LENGTH:=2;
    PERS bool ROS_lock:=false;
    PERS ROS_joint_trajectory_pt ROS_trajectory{2}:=[[[0,0,0,0,30,0],1],[[1,2,3,4,5,6],2]];
    PERS num ROS_trajectory_size:=2;
    PERS bool ROS_new_trajectory:=TRUE;

    LOCAL VAR ROS_joint_trajectory_pt trajectory{MAX_TRAJ_LENGTH};
    LOCAL VAR num trajectory_size:=0;
    LOCAL VAR intnum intr_new_trajectory;
    CONST zonedata DEFAULT_CORNER_DIST:=z10;
    PROC main()
        VAR num current_index;
        VAR jointtarget target;
        VAR speeddata move_speed:=v10;
        VAR zonedata stop_mode;
        VAR bool skip_move;
        VAR ROS_msg raw;
        VAR ROS_msg_joint message;
        SetUp;
        copy_traj;
        FOR current_index FROM 1 TO trajectory_size DO
            target.robax:=trajectory{current_index}.joint_pos;
            target.extax:=[9E9,9E9,9E9,9E9,9E9,9E9];
            skip_move:=(current_index=1) AND is_near(target.robax,0.1);
            stop_mode:=DEFAULT_CORNER_DIST;
            IF current_index=trajectory_size stop_mode:=fine;
            IF NOT skip_move MoveAbsJ target\NoEOffs,v1000\T:=trajectory{current_index}.duration,stop_mode,tool0;
        ENDFOR
        message.header.msg_type:=11;
        message.sequence_id:=-1;
        message.joints:=target.robax;
        pack message,raw;
        TPWrite "bytes "\Num:=RawBytesLen(raw.data);
        message.joints.rax_1:=0;
        unpack raw,message;
        TPWrite ValToStr(message.joints)+ValToStr(message.sequence_id);
        TPWrite "type "\Num:=raw.header.msg_type;
        WaitUntil is_near([1,2,3,4,5,6],1)\MaxTime:=3;
        TPWrite "there";
        ErrWrite\W,"ROS_like","done"\RL2:="size = "+ValToStr(trajectory_size);
        Stop;
    ENDPROC
    LOCAL PROC SetUp()
        trajectory_size:=0;
        IDelete intr_new_trajectory;
        CONNECT intr_new_trajectory WITH new_trajectory_handler;
        IPers ROS_new_trajectory,intr_new_trajectory;
        WaitTestAndSet ROS_lock;
        ROS_lock:=FALSE;
    ENDPROC
    LOCAL PROC copy_traj()
        WaitTestAndSet ROS_lock;
        trajectory:=ROS_trajectory;
        trajectory_size:=ROS_trajectory_size;
        ROS_new_trajectory:=FALSE;
        ROS_lock:=FALSE;
        FOR i FROM 1 TO trajectory_size DO
            TPWrite "point "+ValToStr(i)+" "+ValToStr(trajectory{i}.duration);
        ENDFOR
    ENDPROC
    LOCAL FUNC bool is_near(robjoint target,num tol)
        VAR jointtarget curr_jnt;
        curr_jnt:=CJointT();
        RETURN (ABS(curr_jnt.robax.rax_1-target.rax_1)<tol)
           AND (ABS(curr_jnt.robax.rax_2-target.rax_2)<tol)
           AND (ABS(curr_jnt.robax.rax_6-target.rax_6)<tol);
    ENDFUNC
    LOCAL PROC pack(ROS_msg_joint m,VAR ROS_msg out)
        out.header:=m.header;
        ClearRawBytes out.data;
        PackRawBytes m.sequence_id,out.data,(RawBytesLen(out.data)+1)\IntX:=DINT;
        PackRawBytes m.joints.rax_1,out.data,(RawBytesLen(out.data)+1)\Float4;
        PackRawBytes m.joints.rax_2,out.data,(RawBytesLen(out.data)+1)\Float4;
        PackRawBytes deg2rad(180),out.data,(RawBytesLen(out.data)+1)\Float4;
        CopyRawBytes out.data,1,out.data,RawBytesLen(out.data)+1\NoOfBytes:=4;
    ENDPROC
    LOCAL PROC unpack(ROS_msg raw,INOUT ROS_msg_joint m)
        UnpackRawBytes raw.data,1,m.sequence_id\IntX:=DINT;
        UnpackRawBytes raw.data,5,m.joints.rax_1\Float4;
    ENDPROC
    LOCAL FUNC num deg2rad(num deg)
        RETURN deg*pi/180;
    ENDFUNC
    LOCAL TRAP new_trajectory_handler
        IF (NOT ROS_new_trajectory) RETURN;
        StopMove; ClearPath; StartMove;
    ENDTRAP
ENDMODULE
