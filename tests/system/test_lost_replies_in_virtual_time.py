"""Replies lost on their way to a robot that goes on reporting: it is never told to set out faster than it can."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import accumulate
from math import radians

import pytest

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ZERO_JOINTS, Joints, Side, joints
from controller_arms import CASES, Case
from trajectories import planned
from virtual_irc5.mechanics.arm_motion import ArmModel
from yumi.control.controller import Controller
from yumi.control.controllers.cartesian import CartesianController
from yumi.control.controllers.joint_goal import JointGoal, JointGoalController
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.goals import MemoryBuffer, write_goal, write_speeds
from yumi.control.limiter import Limiter
from yumi.control.loop_events import ReferencesIgnored
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.trajectory_commands import FollowTrajectory
from yumi_evaluation.virtual_time import FULL_SPEED, VirtualArmRig

NAME = "controller"
LIMITS = YUMI_LIMITS.slowed_to(radians(180.0))
FROM: Joints = (0.3, -1.9, -1.2, 0.0, 0.0, 0.0, 0.0)
TO: Joints = (1.9, -0.5, 0.6, 1.0, 2.5, 1.5, 2.5)
MISSED = 5
"""Commands that the robot may have missed when it gets one again: their way is what reaches it at once."""

Drive = Callable[[VirtualArmRig], None]


class Arm:
    """An arm that stands and is about to move as fast as it may.

    Args:
        controller: which moves it.
        drive: commands it to move, in every cycle.
    """

    def __init__(self, controller: Controller, drive: Drive) -> None:
        model = ArmModel(supervises_load=True)
        self.rig = VirtualArmRig(
            {NAME: controller}, side=Side.RIGHT, limiter=Limiter(LIMITS), model=model, position=FROM
        )
        self.rig.start()
        self.rig.switch_to(NAME)
        self.rig.run(0.1)
        self.speeds: list[Joints] = []
        self.reported: int | None = None  # the cycle in which it was reported that the robot ignores its references
        self._drive = drive

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / CYCLE)):
            self._drive(self.rig)
            self.rig.cycle()
            self.speeds.append(self.rig.robot.arm.velocity)
            if self.reported is None and any(isinstance(event, ReferencesIgnored) for event in self.rig.events):
                self.reported = len(self.speeds)

    def lose(self, seconds: float) -> None:
        """Let its replies be lost for a time."""
        hears, self.rig.to_robot = self.rig.to_robot, lambda datagram: ()
        self.run(seconds)
        self.rig.to_robot = hears

    def worst_change(self, lost: int, heard: int) -> float:
        """By how much its planned speed changed in a cycle, as a share of what is allowed.

        Args:
            lost: the cycle in which the first reply was lost.
            heard: and the first one that was heard again.
        """
        sent = [cycle.sent.position for cycle in self.rig.cycles[-len(self.speeds) :]]
        worst = 0.0
        for joint, strongest in enumerate(LIMITS.acceleration):
            travels = [abs(new[joint] - old[joint]) for old, new in zip(sent, sent[MISSED:], strict=False)]
            travels = list(accumulate(travels[max(0, lost - MISSED) :], max))  # of the commands since before the loss
            for cycle in range(heard, len(self.speeds) - 1):
                change = abs(self.speeds[cycle + 1][joint] - self.speeds[cycle][joint])
                travel = travels[min(cycle - lost, len(travels) - 1)]
                worst = max(worst, change / (EGM_GAIN * travel + strongest * CYCLE))
        return worst


def of_case(case: Case) -> Callable[[], Arm]:
    def make() -> Arm:
        box = MemoryBuffer()

        def drive(rig: VirtualArmRig) -> None:
            state = rig.cycles[-1].state
            if "velocity" in case.name:
                speeds = [2.5 if goal > now + 0.3 else 0.0 for goal, now in zip(TO, state.position, strict=True)]
                write_speeds(box, state.session, joints(speeds), state.time)
            else:
                write_goal(box, state.session, TO, time=state.time)

        arm = Arm(case.make(box), drive)
        arm.rig.manager.set_parameters(NAME, case.values)
        return arm

    return make


def once(message: Callable[[VirtualArmRig], object]) -> Drive:
    """Command it with the first cycle."""
    given: list[object] = []

    def drive(rig: VirtualArmRig) -> None:
        if not given:
            given.append(message(rig))
            rig.manager.receive(NAME, given[0], rig.line.state)

    return drive


def joint_goal() -> Arm:
    goal = JointGoal(TO, speed_scale=1.0, acceleration_scale=1.0)
    return Arm(JointGoalController(MemoryBuffer(), limits=LIMITS), once(lambda rig: goal))


def _trajectory(rig: VirtualArmRig) -> FollowTrajectory:
    points = [TrajectoryPoint(1.2, TO, ZERO_JOINTS), TrajectoryPoint(2.4, FROM, ZERO_JOINTS)]
    return FollowTrajectory(planned(points, Side.RIGHT, rig.line.state.time), goal=1)


def joint_trajectory() -> Arm:
    return Arm(JointTrajectoryController(Side.RIGHT, MemoryBuffer()), once(_trajectory))


def cartesian() -> Arm:
    return Arm(CartesianController(Side.RIGHT, MemoryBuffer(), MemoryBuffer()), once(_trajectory))


ARMS: dict[str, Callable[[], Arm]] = {
    **{case.name: of_case(case) for case in CASES},
    "joint goal": joint_goal,
    "joint trajectory": joint_trajectory,
    "Cartesian": cartesian,
}
LOST = (0.06, 0.4)  # [s]; test_lost_replies.py has two hundred others
AT_REST, AT_SPEED = (0.0, 0.04), (0.2, 0.45)
"""After how much of a motion the replies are lost [s]."""


@pytest.mark.parametrize("seconds", LOST)
@pytest.mark.parametrize("name", ARMS)
@pytest.mark.parametrize("begins", [AT_REST, AT_SPEED], ids=["from rest", "at speed"])
def test_robot_that_follows_again_changes_its_speed_by_no_more_than_five_commands_explain(
    begins: tuple[float, ...], name: str, seconds: float
) -> None:
    for begin in begins:
        arm = ARMS[name]()
        arm.run(begin)
        lost = len(arm.speeds)
        arm.lose(seconds)
        heard = len(arm.speeds) - 1
        arm.run(0.4)
        assert arm.worst_change(lost, heard) <= 1.0
        assert arm.rig.robot.arm.overload is None
        assert arm.rig.snapshot.is_running


@pytest.mark.parametrize("name", ARMS)
def test_motion_goes_on_after_60_ms_of_lost_replies(name: str) -> None:
    arm = ARMS[name]()
    arm.run(0.3)
    arm.lose(0.06)
    before = arm.rig.robot.arm.planned
    arm.run(0.5)
    assert all(now > old + radians(5.0) for now, old in zip(arm.rig.robot.arm.planned[:3], before, strict=False))
    assert arm.rig.snapshot.is_commanded
    arm.run(2.2)
    goal = FROM if name in ("joint trajectory", "Cartesian") else TO
    near = 0.4 if "velocity" in name else radians(0.5)  # a person who commands speeds lets go somewhat before
    assert arm.rig.robot.arm.planned == pytest.approx(goal, abs=near)


@pytest.mark.parametrize("name", ARMS)
def test_robot_that_gets_no_reply_any_more_is_reported_once_it_stands(name: str) -> None:
    arm = ARMS[name]()
    arm.run(0.3)
    arm.lose(2.0)
    events = [event for event in arm.rig.events if isinstance(event, ReferencesIgnored)]
    assert [event.deactivated for event in events] == [(NAME,)]
    stood = next(index for index, speed in enumerate(arm.speeds) if index > 100 and max(map(abs, speed)) < 1e-3)
    assert not arm.rig.snapshot.is_commanded
    assert arm.reported is not None
    assert arm.reported <= stood + round(0.5 / CYCLE)


@pytest.mark.parametrize("bandwidth", [5.0, 10.0, 20.0, 50.0])
def test_command_does_not_wait_where_the_robot_filters_its_speed_and_nothing_is_lost(bandwidth: float) -> None:
    limiter = Limiter(LIMITS, bandwidth=bandwidth)
    controller = JointGoalController(MemoryBuffer(), limits=LIMITS)
    rig = VirtualArmRig({NAME: controller}, side=Side.RIGHT, limiter=limiter, position=FROM)
    rig.start(replace(FULL_SPEED, lp_filter=bandwidth))
    rig.switch_to(NAME)
    rig.run(0.1)
    rig.manager.receive(NAME, JointGoal(TO, speed_scale=0.8, acceleration_scale=1.0), rig.line.state)
    furthest = list(FROM)
    for _ in range(round(2.5 / CYCLE)):
        rig.cycle()
        assert not limiter.is_waiting
        furthest = [max(far, now) for far, now in zip(furthest, rig.robot.arm.position, strict=True)]
    assert rig.robot.arm.position == pytest.approx(TO, abs=radians(0.1))
    assert furthest == pytest.approx(TO, abs=radians(4.0))
