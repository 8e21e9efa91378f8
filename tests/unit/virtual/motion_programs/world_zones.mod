!@ robot irb120
!@ enters custom_DO_0 350 -20 300 2
!@ leaves custom_DO_0 350 20 300 2
!@ value home_seen 1
!@ value sphere_seen 1
!@ value cylinder_seen 1
MODULE Zones
    CONST robtarget begin:=[[350,-60,300],[0,0,1,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST jointtarget home:=[[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]];
    CONST jointtarget near:=[[2,2,2,2,2,2],[9E9,9E9,9E9,9E9,9E9,9E9]];
    VAR wztemporary service;
    VAR wztemporary at_home;
    VAR wztemporary in_sphere;
    VAR wztemporary in_cylinder;
    PERS num home_seen:=0;
    PERS num sphere_seen:=0;
    PERS num cylinder_seen:=0;

    PROC main()
        VAR shapedata volume;
        VAR shapedata ball;
        VAR shapedata column;
        VAR shapedata joints;
        ConfL\Off;
        ConfJ\Off;
        MoveAbsJ home,v1000,fine,tool0;
        WZHomeJointDef\Inside,joints,home,near;
        WZDOSet\Temp,at_home\Inside,joints,custom_DO_1,1;
        WaitTime 0.05;
        home_seen:=DOutput(custom_DO_1);
        WZBoxDef\Inside,volume,[300,-20,250],[400,20,350];
        WZDOSet\Temp,service\Inside,volume,custom_DO_0,1;
        WZSphDef\Inside,ball,[350,60,300],15;
        WZDOSet\Temp,in_sphere\Inside,ball,custom_DO_2,1;
        WZCylDef\Inside,column,[350,60,290],20,30;
        WZDOSet\Temp,in_cylinder\Inside,column,custom_DO_3,1;
        MoveJ begin,v500,fine,tool0;
        MoveL Offs(begin,0,120,0),v200,fine,tool0;
        WaitTime 0.05;
        sphere_seen:=DOutput(custom_DO_2);
        cylinder_seen:=DOutput(custom_DO_3);
        WZDisable service;
        WZEnable service;
        WZFree service;
    ENDPROC
ENDMODULE
