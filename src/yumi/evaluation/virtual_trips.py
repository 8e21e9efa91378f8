"""Round trips in virtual time, where topics, processors and wires take none: what is left are the cycles."""

from __future__ import annotations

from yumi.control.goals import put_goal
from yumi.control.mailbox import MemoryMailbox
from yumi.controllers.joint_position import JointPositionController
from yumi.evaluation.guided_arm import GuidedArm
from yumi.evaluation.loop_trips import HeardState, LoopCycle, SentGoal, Trip, join_trips
from yumi.evaluation.streamed_reference import CONTROLLER
from yumi.evaluation.virtual_experiment import moved
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import Side

PERIOD = 0.005
"""Between two goals: not that of the cycles, so that they fall into them everywhere [s]."""

NUDGE = 1e-7
"""Between the positions of two goals; so that the arm need not move, and each is known again [rad]."""

_JOINT = 6


def nudge(number: int) -> float:
    """Where goal ``number``, from 0, is relative to where the joint stands [rad]; none is where it stands."""
    return (number + 1) * NUDGE


def virtual_trips(count: int) -> tuple[tuple[Trip, ...], int, int]:
    """``count`` round trips to the EGM loop, the datagrams meanwhile, and how many of them were lost."""
    goals = MemoryMailbox()
    arm = GuidedArm({CONTROLLER: JointPositionController(goals)}, side=Side.RIGHT)
    arm.start()
    arm.run(0.1)
    arm.switch_to(CONTROLLER)
    start, session, begin = arm.robot.arm.planned, arm.snapshot.session, arm.clock.now()
    sent: list[SentGoal] = []
    cycles: list[LoopCycle] = []
    while len(sent) < count + 3:
        while (due := begin + PERIOD * len(sent)) <= arm.clock.now() + CYCLE:
            position = moved(start, nudge(len(sent)), (_JOINT,))
            put_goal(goals, session, position, time=due)
            sent.append(SentGoal(position[_JOINT], due, due))
        arm.cycle()
        taken, now = arm.line.manager.reference, arm.cycles[-1].state.time
        cycles.append(LoopCycle(now, now, taken[_JOINT] if taken else start[_JOINT]))
    states = [HeardState(cycle.arrived, cycle.arrived) for cycle in cycles]
    snapshot = arm.snapshot
    return join_trips(sent, cycles, states)[:count], len(cycles), snapshot.lost + snapshot.missed
