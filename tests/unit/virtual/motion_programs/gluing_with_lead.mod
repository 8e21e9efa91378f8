!@ robot irb120
!@ through 340 -70 220
!@ through 340 70 220
!@ rises custom_DO_1 340 -60 220 2
!@ falls custom_DO_1 340 60 220 2
MODULE Gluing
    CONST robtarget from_here:=[[340,-70,220],[0,0,1,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    VAR triggdata gun_on;
    VAR triggdata gun_off;

    PROC main()
        ConfL\Off;
        ConfJ\Off;
        TriggIO gun_on,10\Start\DOp:=custom_DO_1,1;
        TriggEquip gun_off,10,0\DOp:=custom_DO_1,0;
        MoveJ from_here,v500,fine,tool0;
        TriggL Offs(from_here,0,140,0),v100,gun_on\T2:=gun_off,fine,tool0;
    ENDPROC
ENDMODULE
