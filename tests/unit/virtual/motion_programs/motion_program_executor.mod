!@ robot irb120
!@ through 350 0 300
!@ through 350 80 300
!@ through 310 40 300
!@ value done 4
MODULE motion_program_exec
    RECORD motion_step
        num command;
        robtarget target;
        robtarget via;
        num speed;
    ENDRECORD
    VAR motion_step steps{4};
    PERS num done:=0;

    PROC main()
        VAR speeddata how;
        done:=0;
        ConfL\Off;
        ConfJ\Off;
        FillSteps;
        FOR i FROM 1 TO Dim(steps,1) DO
            how:=[steps{i}.speed,500,5000,1000];
            TEST steps{i}.command
            CASE 1:
                MoveJ steps{i}.target,how,fine,tool0;
            CASE 2:
                MoveL steps{i}.target,how,fine,tool0;
            CASE 3:
                MoveC steps{i}.via,steps{i}.target,how,fine,tool0;
            DEFAULT:
                ErrWrite "motion program","unknown command";
            ENDTEST
            Incr done;
        ENDFOR
    ENDPROC

    PROC FillSteps()
        VAR robtarget at:=[[350,0,300],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
        steps{1}:=[1,at,at,300];
        steps{2}:=[2,Offs(at,0,80,0),at,200];
        steps{3}:=[3,at,Offs(at,-40,40,0),40];
        steps{4}:=[2,Offs(at,0,0,50),at,100];
    ENDPROC
ENDMODULE
