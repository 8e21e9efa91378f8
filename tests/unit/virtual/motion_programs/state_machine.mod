!@ robot irb120
!@ through 300 0 300
!@ through 300 80 300
!@ value visited 3
MODULE StateMachine
    CONST num FINISHED:=3;
    PERS num visited:=0;
    CONST robtarget home_target:=[[300,0,300],[0,0,1,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];

    PROC main()
        VAR num state:=0;
        visited:=0;
        ConfL\Off;
        ConfJ\Off;
        WHILE state<>FINISHED DO
            %"enter_"+ValToStr(state)%;
            state:=state+1;
            visited:=visited+1;
        ENDWHILE
    ENDPROC

    PROC enter_0()
        MoveJ home_target,v500,fine,tool0;
    ENDPROC

    PROC enter_1()
        MoveL Offs(home_target,0,80,0),v200,fine,tool0;
    ENDPROC

    PROC enter_2()
        MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v500,fine,tool0;
    ENDPROC
ENDMODULE
