"""A virtual controller in real time whose two tasks each serve ten connections while their arms are under EGM.

python tests/system/rapid_servers.py LEFT_EGM_PORT RIGHT_EGM_PORT LEFT_PORT RIGHT_PORT
"""

from __future__ import annotations

import sys
import time
from threading import Event

import click

from abb_protocols.robot.joints import Side
from virtual_irc5.server import VirtualController
from virtual_irc5.world import WorldSettings

CONNECTIONS = 10
"""Of each task."""

SERVER = r"""MODULE Server
    VAR egmident egm;
    VAR socketdev listener;
    VAR socketdev clients{%(count)d};
    VAR rawbytes frame;
    VAR num number;

    PROC main()
        SocketCreate listener;
        SocketBind listener, "192.168.125.1", %(port)d;
        SocketListen listener;
        FOR i FROM 1 TO %(count)d DO
            SocketAccept listener, clients{i}\Time:=WAIT_MAX;
        ENDFOR
        MoveAbsJ CJointT(), v100, fine, tool0;
        WaitRob\InPos;
        EGMGetId egm;
        EGMSetupUC ROB_ID, egm, GetMecUnitName(ROB_ID), GetMecUnitName(ROB_ID)\Joint\CommTimeout:=1;
        EGMActJoint egm\StreamStart\MaxSpeedDeviation:=10;
        EGMRunJoint egm, EGM_STOP_HOLD\NoWaitCond\J1\J2\J3\J4\J5\J6\J7\CondTime:=10000;
        WHILE TRUE DO
            FOR i FROM 1 TO %(count)d DO
                IF SocketPeek(clients{i}) >= 4 Serve clients{i};
            ENDFOR
            WaitTime 0;
        ENDWHILE
    ENDPROC

    PROC Serve(VAR socketdev client)
        SocketReceive client\RawData:=frame\ReadNoOfBytes:=4;
        UnpackRawBytes frame\Network, 1, number\IntX:=UDINT;
        PackRawBytes number + 1, frame\Network, 1\IntX:=UDINT;
        SocketSend client\RawData:=frame;
    ENDPROC
ENDMODULE
"""


def main(left_egm: int, right_egm: int, left_port: int, right_port: int) -> None:
    settings = WorldSettings(
        robot_name="servers", egm_ports={Side.LEFT: left_egm, Side.RIGHT: right_egm}, start_time=time.time()
    )
    virtual = VirtualController(settings, rws_port=0, user="user", password="password", host="127.0.0.1")
    controller = virtual.world.controller
    for name, port in (("T_ROB_L", left_port), ("T_ROB_R", right_port)):
        task = controller.tasks[name]
        task.lose_pp()
        for module in task.modules:
            task.unload(module.name)
        task.load(SERVER % {"count": CONNECTIONS, "port": port}, "server.mod")
    controller.execution.move_pp_to_main()
    controller.set_motors(True)
    controller.start_rapid()
    virtual.run(Event(), lambda port: click.echo("ready"))


if __name__ == "__main__":
    main(*(int(argument) for argument in sys.argv[1:5]))
