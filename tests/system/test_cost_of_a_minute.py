"""What a minute of both arms, moved by RAPID and then by EGM, costs the virtual controller in processor time."""

from __future__ import annotations

from math import sin
from pathlib import Path
from time import process_time

import pytest

from abb_protocols.egm.codec import SensorCodec, SensorMessage
from abb_protocols.robot.joints import Side
from soak import tell
from virtual_irc5.controller.installed_system import delivered_system, with_programs
from virtual_irc5.world import World, WorldSettings

PROGRAM = r"""MODULE Minute
    VAR egmident egm;
    VAR robtarget here;
    VAR clock watch;
    PROC main()
        VAR jointtarget begin;
        begin:=CJointT();
        here:=CRobT();
        ClkStart watch;
        WHILE ClkRead(watch)<%(half)g DO
            MoveL Offs(here,0,%(out)d,0),v200,z5,tool0;
            MoveL Offs(here,0,%(out)d,20),v200,z5,tool0;
            MoveJ Offs(here,0,0,20),v300,z5,tool0;
            MoveL here,v200,fine,tool0;
        ENDWHILE
        MoveAbsJ begin,v100,fine,tool0;
        EGMGetId egm;
        EGMSetupUC ROB_ID,egm,GetMecUnitName(ROB_ID),GetMecUnitName(ROB_ID)\Joint\CommTimeout:=1;
        EGMActJoint egm\MaxSpeedDeviation:=100;
        EGMRunJoint egm,EGM_STOP_HOLD\NoWaitCond\J1\J2\J3\J4\J5\J6\J7\CondTime:=1000;
        WHILE TRUE DO
            WaitTime 0.1;
        ENDWHILE
    ENDPROC
ENDMODULE
"""


@pytest.mark.parametrize("seconds", [6.0, pytest.param(60.0, marks=pytest.mark.soak)])
def test_both_arms_under_rapid_and_egm_keep_pace_with_a_clock(tmp_path: Path, seconds: float) -> None:
    programs = {}
    for side, out in ((Side.RIGHT, -30), (Side.LEFT, 30)):
        path = tmp_path / f"{side.task}.mod"
        path.write_text(PROGRAM % {"half": seconds / 2.0, "out": out}, encoding="ascii")
        programs[side.task] = [path]
    world = World(WorldSettings(system=with_programs(delivered_system(), programs)))
    world.controller.set_motors(on=True)
    world.controller.start_rapid("once")
    codec, first, inboxes = SensorCodec(axes=7), dict[Side, tuple[float, ...]](), dict[Side, list[bytes]]()
    cost, datagrams = 0.0, 0
    while world.controller.time < seconds:
        begun = process_time()
        sent = world.cycle(inboxes)
        cost += process_time() - begun
        inboxes.clear()
        for side, datagram in sent.items():  # the driver's part, which is not counted
            message = codec.decode(datagram)
            swing = 0.05 * sin(world.controller.time)
            goal = [value + swing for value in first.setdefault(side, message.planned)]
            inboxes[side] = [codec.encode(SensorMessage(seqno=message.seqno, position=tuple(goal)))]
            datagrams += 1
    tell(f"{cost / seconds * 60.0:.2f} s of processor time a minute of both arms (asked: 3 s), {datagrams} datagrams")
    assert datagrams > 0.6 * seconds / world.cycle_time
    assert cost < seconds
