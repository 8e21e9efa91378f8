"""What the limiter withheld from an arm is given up by who leads it no further; else it would follow later."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import count
from math import inf, nan
from typing import Any

import numpy as np
import pytest

from abb_protocols.robot.description import SERVO_GRIPPERS
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ZERO_JOINTS, ArmCommand, Pose, Side, home, joints
from abb_protocols.robot.kinematics import tool0_to_body
from cartesian_bench import shares
from controller_states import configured, state
from yumi.control.chunk_commands import FollowChunk
from yumi.control.collisions import CollisionLimiter
from yumi.control.controller import Controller
from yumi.control.controllers.cartesian import CartesianController
from yumi.control.controllers.dual_arm_trajectory import DualArmTrajectoryController
from yumi.control.controllers.forward_command import JointGroupVelocityController
from yumi.control.controllers.joint_goal import JointGoal, JointGoalController, StopMotion
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.controllers.joint_velocity import JointVelocityController
from yumi.control.goals import MemoryBuffer, SessionGoal, write_goal, write_speeds
from yumi.control.limiter import Limiter
from yumi.control.loop_events import ControllerReport
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.motion.standstill import STANDSTILL_TOLERANCE
from yumi.control.shared_state import TrajectoryFeedback
from yumi.control.tool_goal import ToolGoal, pose_goal, twist_goal
from yumi.control.trajectory_commands import (
    ArmPlan,
    CancelTrajectory,
    FollowTrajectory,
    ScaleSpeed,
    TrajectoryEnded,
    TrajectoryOutcome,
)
from yumi.core.collision import CollisionModel
from yumi.planning.chunk_plan import plan_chunk
from yumi.planning.smoothing import smooth_spline_through
from yumi_evaluation.virtual_time import VirtualArmRig

UPWARDS = (0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0)  # [m/s]; from home, the wrist meets the body
UP = joints([-0.27, 0.33, -0.14, 0.32, 0.08, 0.09, -0.03])  # [rad/s] about the same


def limited() -> Limiter:
    both = CollisionLimiter(CollisionModel(SERVO_GRIPPERS), YUMI_LIMITS, EGM_GAIN)
    return Limiter(YUMI_LIMITS, collisions=both.arm(Side.RIGHT))


def rests_where_it_is(rig: VirtualArmRig) -> bool:
    last = rig.cycles[-1]
    assert last.desired is not None
    assert not any(last.desired.velocity)
    return last.beyond < STANDSTILL_TOLERANCE and not rig.snapshot.limited_part


@pytest.mark.parametrize("is_cancelled", [False, True])
def test_tool_that_was_jogged_into_the_limit_stays_there_when_it_is_let_go(is_cancelled: bool) -> None:
    goals = MemoryBuffer[ToolGoal]()
    controller = CartesianController(Side.RIGHT, goals, MemoryBuffer[TrajectoryFeedback]())
    rig = VirtualArmRig({"jog": controller}, side=Side.RIGHT, limiter=limited(), position=home(Side.RIGHT))
    rig.start()
    rig.switch_to("jog")
    rig.run(0.1)
    for _ in range(200):
        goals.write(twist_goal(rig.snapshot.session, UPWARDS, time=rig.clock.now()))
        rig.cycle()
    assert rig.snapshot.limited_part == "right wrist"
    assert rig.cycles[-1].beyond > STANDSTILL_TOLERANCE
    if is_cancelled:
        rig.manager.receive("jog", CancelTrajectory(), rig.line.state)
    rig.run(2.5)
    assert rests_where_it_is(rig)


@pytest.mark.parametrize("speed", [nan, inf, 1.7e308])
def test_tool_stands_after_velocities_that_cannot_be_calculated_with(speed: float) -> None:
    """What is sent to it has passed no check here; it moved with its highest speed, wherever to."""
    goals = MemoryBuffer[ToolGoal]()
    controller = CartesianController(Side.RIGHT, goals, MemoryBuffer[TrajectoryFeedback]())
    rig = VirtualArmRig({"jog": controller}, side=Side.RIGHT, position=home(Side.RIGHT))
    rig.start()
    rig.switch_to("jog")
    rig.run(0.1)
    for _ in range(100):
        twist = (speed, speed, 0.0, 0.0, 0.0, 0.0, 0.0)
        goals.write(twist_goal(rig.snapshot.session, twist, is_in_tool=True, time=rig.clock.now()))
        rig.cycle()
    assert rig.snapshot.position == pytest.approx(home(Side.RIGHT), abs=1e-3)


@pytest.mark.parametrize("controller_type", [JointVelocityController, JointGroupVelocityController])
def test_joints_that_were_jogged_into_the_limit_stay_there_when_they_are_let_go(controller_type: type) -> None:
    speeds = MemoryBuffer[SessionGoal]()
    if controller_type is JointVelocityController:
        controller: Controller = JointVelocityController(speeds)
    else:
        controller = JointGroupVelocityController(MemoryBuffer[SessionGoal](), speeds)
    rig = VirtualArmRig({"jog": controller}, side=Side.RIGHT, limiter=limited(), position=home(Side.RIGHT))
    rig.start()
    rig.switch_to("jog")
    rig.run(0.1)
    for _ in range(600):
        write_speeds(speeds, rig.snapshot.session, UP, rig.clock.now())
        rig.cycle()
    assert rig.snapshot.limited_part
    assert rig.cycles[-1].beyond > STANDSTILL_TOLERANCE
    for _ in range(500):
        write_speeds(speeds, rig.snapshot.session, ZERO_JOINTS, rig.clock.now())
        rig.cycle()
    assert rests_where_it_is(rig)


def test_joint_goal_that_is_stopped_in_front_of_the_limit_is_given_up_at_once() -> None:
    controller = JointGoalController(MemoryBuffer[SessionGoal]())
    rig = VirtualArmRig({"go": controller}, side=Side.RIGHT, limiter=limited(), position=home(Side.RIGHT))
    rig.start()
    rig.switch_to("go")
    rig.run(0.5)
    far = joints([now + 1.5 * up for now, up in zip(home(Side.RIGHT), UP, strict=True)])
    rig.manager.receive("go", JointGoal(far), rig.line.state)
    rig.run_until(lambda: bool(rig.snapshot.limited_part) and rig.cycles[-1].beyond > 0.1, limit=10.0)
    rig.manager.receive("go", StopMotion(), rig.line.state)
    rig.run(1.5)  # along the limit to where its stop leads, as far as that goes
    assert rests_where_it_is(rig)


def test_trajectory_that_is_cancelled_in_front_of_the_limit_is_given_up_at_once() -> None:
    controller = JointTrajectoryController(Side.RIGHT, MemoryBuffer[TrajectoryFeedback]())
    rig = VirtualArmRig({"go": controller}, side=Side.RIGHT, limiter=limited(), position=home(Side.RIGHT))
    rig.start()
    rig.switch_to("go")
    rig.run(0.5)
    far = joints([now + 1.5 * up for now, up in zip(home(Side.RIGHT), UP, strict=True)])
    points = [
        TrajectoryPoint(0.0, home(Side.RIGHT), ZERO_JOINTS, ZERO_JOINTS),
        TrajectoryPoint(4.0, far, ZERO_JOINTS, ZERO_JOINTS),
    ]
    plan = ArmPlan(Side.RIGHT, points[0], smooth_spline_through(points), None)
    rig.manager.receive("go", FollowTrajectory(plan, 1), rig.line.state)
    rig.run_until(lambda: rig.cycles[-1].beyond > 0.1, limit=10.0)
    rig.manager.receive("go", CancelTrajectory(), rig.line.state)
    rig.run(0.1)
    assert rig.cycles[-1].beyond < 0.05  # the other arm may leave at any time
    rig.run(1.0)
    assert rests_where_it_is(rig)
    ended = [each.report for each in rig.events if isinstance(each, ControllerReport)]
    assert [each.outcome for each in ended if isinstance(each, TrajectoryEnded)] == [TrajectoryOutcome.CANCELED]


START = home(Side.RIGHT)
FAR = joints([now + up for now, up in zip(START, UP, strict=True)])
NEAR = joints([now - 0.3 * up for now, up in zip(START, UP, strict=True)])
POINTS = [TrajectoryPoint(0.0, START, ZERO_JOINTS, ZERO_JOINTS), TrajectoryPoint(2.0, FAR, ZERO_JOINTS, ZERO_JOINTS)]


@pytest.mark.parametrize(
    ("make", "command", "end"),
    [
        (
            lambda: configured(JointTrajectoryController(Side.RIGHT, MemoryBuffer[TrajectoryFeedback]())),
            FollowTrajectory(ArmPlan(Side.RIGHT, POINTS[0], smooth_spline_through(POINTS), None), 1),
            CancelTrajectory(),
        ),
        (
            lambda: configured(JointGoalController(MemoryBuffer[SessionGoal]()), path_tolerance=0.0),
            JointGoal(FAR),
            StopMotion(),
        ),
    ],
    ids=["trajectory", "goal"],
)
def test_motion_of_an_arm_that_slides_far_behind_it_ends_where_the_arm_is_when_it_is_cancelled(
    make: Callable[[], Controller], command: object, end: object
) -> None:
    """An arm that is led along something moves all the time: where it is led to must not stay where it was."""
    controller, times = make(), (10.0 + CYCLE * number for number in count())
    controller.activate(state(START, time=next(times)))
    for _ in range(20):
        controller.update(state(START, time=next(times)))
    controller.receive(command, state(START, time=next(times)))
    for _ in range(600):
        behind = state(START, time=next(times))
        last = controller.update(behind)
    assert last is not None
    assert last.position[0] == pytest.approx(FAR[0])
    controller.receive(end, behind)
    assert controller.update(state(START, time=next(times))) is None  # the limiter brings it to rest
    for _ in range(20):
        last = controller.update(state(START, time=next(times)))
    assert last == ArmCommand(START)


class Led:
    """An arm that is led at the body, beyond the limit, by one kind of command.

    Attributes:
        rig: the arm.
    """

    def __init__(self) -> None:
        self.goals = MemoryBuffer[ToolGoal]()
        self.speeds, self.positions = MemoryBuffer[SessionGoal](), MemoryBuffer[SessionGoal]()
        self.points = MemoryBuffer[SessionGoal]()
        feedback = MemoryBuffer[TrajectoryFeedback]()
        controllers: dict[str, Controller] = {
            "tool": CartesianController(Side.RIGHT, self.goals, feedback),
            "path": JointTrajectoryController(Side.RIGHT, feedback),
            "goal": JointGoalController(self.points),
            "speeds": JointVelocityController(self.speeds),
            "group": JointGroupVelocityController(MemoryBuffer[SessionGoal](), self.speeds),
            "stream": JointPositionController(self.positions),
        }
        self.rig = VirtualArmRig(controllers, side=Side.RIGHT, limiter=limited(), position=START)
        self.rig.manager.set_parameters("group", {"timeout": 0.1})

    def begin(self, name: str) -> None:
        self.rig.start()
        self.rig.switch_to(name)
        self.rig.run(0.1)
        self._name, self._begun = name, self.rig.clock.now()

    def send(self, command: object) -> None:
        self.rig.manager.receive(self._name, command, self.rig.line.state)

    def end_streams(self) -> None:
        """As the control loop does where who streams falls silent."""
        assert self.rig.line.state is not None
        self.rig.manager.end_streams(self.rig.line.state)

    def move_tool(self) -> None:
        self.goals.write(twist_goal(self.rig.snapshot.session, UPWARDS, time=self.rig.clock.now()))

    def stream_poses(self) -> None:
        """Of a tool that goes upwards."""
        now, start = self.rig.clock.now(), tool0_to_body(Side.RIGHT, START)
        x, y, z = start.position
        higher = Pose((x, y, z + UPWARDS[2] * (now - self._begun)), start.orientation)
        self.goals.write(pose_goal(self.rig.snapshot.session, higher, time=now))

    def ask_for_pose(self) -> None:
        """Once, of 10 cm below."""
        here = tool0_to_body(Side.RIGHT, self.rig.snapshot.sent)
        x, y, z = here.position
        self.goals.write(pose_goal(self.rig.snapshot.session, Pose((x, y, z - 0.1), here.orientation)))

    def ask_for_velocity(self) -> None:
        """Once, downwards, and at no known time."""
        self.goals.write(twist_goal(self.rig.snapshot.session, joints([-speed for speed in UPWARDS])))

    def move_joints(self) -> None:
        write_speeds(self.speeds, self.rig.snapshot.session, UP, self.rig.clock.now())

    def stop_joints(self) -> None:
        for _ in range(4):
            write_speeds(self.speeds, self.rig.snapshot.session, ZERO_JOINTS, self.rig.clock.now())
            self.rig.cycle()

    def stream(self) -> None:
        now = self.rig.clock.now()
        position = joints([at + up * (now - self._begun) for at, up in zip(START, UP, strict=True)])
        write_goal(self.positions, self.rig.snapshot.session, position, time=now, delay=0.05)

    def ask_for_position(self) -> None:
        write_goal(self.positions, self.rig.snapshot.session, NEAR)

    def ask_for_goal(self) -> None:
        write_goal(self.points, self.rig.snapshot.session, NEAR)

    def follow_chunk(self) -> None:
        times = 0.05 * np.arange(31)
        spline = plan_chunk(Side.RIGHT, times.tolist(), np.array(START) + np.outer(times, UP), YUMI_LIMITS)
        self.send(FollowChunk(1, self.rig.clock.now() + 0.1, spline))


def nothing(*_: object) -> None:
    """Nothing is sent."""


PATH = FollowTrajectory(ArmPlan(Side.RIGHT, POINTS[0], smooth_spline_through(POINTS), None), 1)
LET_GO: dict[str, tuple[str, Callable[[Led], object], Callable[[Led], object], Callable[[Led], object]]] = {
    # by which controller, what it is sent first, what in each cycle, and what when it is let go
    "tool cancelled": ("tool", nothing, Led.move_tool, lambda led: led.send(CancelTrajectory())),
    "tool's stream ended": ("tool", nothing, Led.move_tool, Led.end_streams),
    "tool silent": ("tool", nothing, Led.move_tool, nothing),
    "poses silent": ("tool", nothing, Led.stream_poses, nothing),
    "joints' stream ended": ("speeds", nothing, Led.move_joints, Led.end_streams),
    "joints silent": ("speeds", nothing, Led.move_joints, nothing),
    "joints stopped": ("speeds", nothing, Led.move_joints, Led.stop_joints),
    "group silent": ("group", nothing, Led.move_joints, nothing),
    "positions silent": ("stream", nothing, Led.stream, nothing),
    "trajectory cancelled": ("path", lambda led: led.send(PATH), nothing, lambda led: led.send(CancelTrajectory())),
    "chunks cancelled": ("path", Led.follow_chunk, nothing, lambda led: led.send(CancelTrajectory())),
    "goal stopped": ("goal", lambda led: led.send(JointGoal(FAR)), nothing, lambda led: led.send(StopMotion())),
}


@pytest.mark.parametrize("withheld", [0.002, 0.01, 0.03])
@pytest.mark.parametrize("how", LET_GO)
def test_arm_that_is_let_go_while_it_is_held_back_goes_nowhere_by_what_was_withheld(how: str, withheld: float) -> None:
    name, begin, lead, let_go = LET_GO[how]
    led = Led()
    rig = led.rig
    led.begin(name)
    begin(led)

    def is_held_back() -> bool:
        lead(led)
        desired = rig.cycles[-1].desired
        speed = max(map(abs, desired.velocity)) if desired is not None else 0.0
        # Positions are sent later than the speeds that go with them.
        return bool(rig.snapshot.limited_part) and rig.cycles[-1].beyond > withheld + 0.03 * speed

    rig.run_until(is_held_back, limit=4.0)
    let_go(led)
    first = len(rig.cycles)
    rig.run(2.0 if let_go is nothing else 1.0)  # silence ends what is led only after a while
    after = rig.cycles[first:]
    if let_go is not nothing:
        assert after[0].desired is None  # the limiter brings it to rest from what it was sent
    else:
        rig.manager.check_take_over("path", rig.line.state, rig.clock.now())  # it is idle
    assert max(each.beyond for each in after[75:]) < STANDSTILL_TOLERANCE
    for each in after[150:]:
        assert each.sent.position == pytest.approx(after[150].sent.position, abs=1e-5)


def test_arm_that_is_held_back_while_its_chunks_are_exhausted_is_given_up_where_it_is_sent() -> None:
    led = Led()
    rig = led.rig
    led.begin("path")
    led.follow_chunk()
    rig.run_until(lambda: any(isinstance(each, ControllerReport) for each in rig.events), limit=4.0)
    assert rig.cycles[-2].beyond > 0.01
    assert rig.cycles[-1].desired is None
    rig.run(1.0)
    assert rests_where_it_is(rig)


@pytest.mark.parametrize("ask", [Led.ask_for_pose, Led.ask_for_velocity], ids=["pose", "velocity"])
def test_tool_that_is_let_go_again_before_it_stands_does_not_go_where_it_was_asked_for_meanwhile(
    ask: Callable[[Led], object],
) -> None:
    led = Led()
    rig = led.rig
    led.begin("tool")

    def is_held_back() -> bool:
        led.move_tool()
        return bool(rig.snapshot.limited_part) and rig.cycles[-1].beyond > 0.01

    rig.run_until(is_held_back, limit=4.0)
    led.send(CancelTrajectory())
    rig.cycle()
    assert rig.cycles[-1].desired is None
    ask(led)
    rig.cycle()
    led.send(CancelTrajectory())
    rig.run_until(lambda: rig.cycles[-1].desired is not None, limit=1.0)
    still = rig.cycles[-1].sent.position
    rig.run(1.0)
    assert rig.cycles[-1].sent.position == pytest.approx(still, abs=1e-5)


STOPPED: dict[str, tuple[str, Callable[[Led], object], Callable[[Led], object]]] = {
    # by which controller, what it is sent, and what stops it before its next cycle
    "pose cancelled": ("tool", Led.ask_for_pose, lambda led: led.send(CancelTrajectory())),
    "pose's stream ended": ("tool", Led.ask_for_pose, Led.end_streams),
    "velocity cancelled": ("tool", Led.ask_for_velocity, lambda led: led.send(CancelTrajectory())),
    "speeds' stream ended": ("speeds", Led.move_joints, Led.end_streams),
    "group's stream ended": ("group", Led.move_joints, Led.end_streams),
    "position's stream ended": ("stream", Led.ask_for_position, Led.end_streams),
    "goal's stream ended": ("goal", Led.ask_for_goal, Led.end_streams),
    "goal stopped": ("goal", Led.ask_for_goal, lambda led: led.send(StopMotion())),
    "trajectory cancelled": ("path", lambda led: led.send(PATH), lambda led: led.send(CancelTrajectory())),
    "chunks cancelled": ("path", Led.follow_chunk, lambda led: led.send(CancelTrajectory())),
}


@pytest.mark.parametrize("how", STOPPED)
def test_what_is_sent_just_before_a_stop_does_not_begin_after_it(how: str) -> None:
    name, ask, stop = STOPPED[how]
    led = Led()
    rig = led.rig
    led.begin(name)
    still, first = rig.cycles[-1].sent.position, len(rig.cycles)
    ask(led)
    stop(led)
    rig.run(1.0)
    for each in rig.cycles[first:]:
        assert each.sent.position == pytest.approx(still, abs=1e-5)


class LedBoth:
    """Both arms, which one call moves, each by its own controller.

    Attributes:
        rigs: of each arm.
    """

    def __init__(self) -> None:
        path, both = dict[Side, Any](), dict[Side, Any]()
        self.rigs = {
            side: VirtualArmRig(
                {
                    "path": JointTrajectoryController(side, MemoryBuffer[TrajectoryFeedback](), halves=path),
                    "both": DualArmTrajectoryController(side, MemoryBuffer[TrajectoryFeedback](), both),
                    "goal": JointGoalController(MemoryBuffer[SessionGoal]()),
                    "speeds": JointVelocityController(MemoryBuffer[SessionGoal]()),
                },
                side=side,
                position=home(side),
            )
            for side in Side
        }

    def begin(self, name: str) -> None:
        for rig in self.rigs.values():
            rig.start()
            rig.switch_to(name)
        self._name = name
        self.run(0.1)

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / CYCLE)):
            for rig in self.rigs.values():
                rig.cycle()

    def send(self, commands: Mapping[Side, object]) -> None:
        for side, command in commands.items():
            self.rigs[side].manager.check(self._name, command, self.rigs[side].line.state)
        for side, command in commands.items():
            self.rigs[side].manager.receive(self._name, command, self.rigs[side].line.state)

    def cancel(self, *sides: Side) -> None:
        self.send(dict.fromkeys(sides, CancelTrajectory()))

    def end_streams(self) -> None:
        """Of the right arm, as the control loop does where who streams falls silent."""
        rig = self.rigs[Side.RIGHT]
        assert rig.line.state is not None
        rig.manager.end_streams(rig.line.state)

    def take_over(self, name: str) -> None:
        """Have another controller lead the right arm, which nothing is sent yet."""
        self.rigs[Side.RIGHT].switch_to(name)

    def lose(self) -> None:
        """The right arm's datagrams."""
        self.rigs[Side.RIGHT].to_us = lambda datagram: ()

    def stop(self) -> None:
        """As a stop of one arm does."""
        rig = self.rigs[Side.RIGHT]
        rig.switch_to("goal")
        rig.manager.receive("goal", StopMotion(), rig.line.state)

    def follow(self) -> None:
        """Both arms swing for 2 s."""
        ways = {side: swung(side, np.linspace(0.0, 2.0, 3)) for side in Side}
        plans = {
            side: ArmPlan(side, way[0], smooth_spline_through([way[0], way[-1]]), None) for side, way in ways.items()
        }
        self.send({side: FollowTrajectory(plan, 1) for side, plan in plans.items()})

    def follow_on(self) -> None:
        """Both arms go on along a trajectory of 2 s, from how they move now."""
        commands = {}
        for side in Side:
            first, last = swung(side, np.array([1.0, 1.5]))
            points = [first, last._replace(time=2.0)]
            commands[side] = FollowTrajectory(ArmPlan(side, first, smooth_spline_through(points), None), 2)
        self.send(commands)

    def scale_speed(self, factor: float) -> None:
        self.send(dict.fromkeys(Side, ScaleSpeed(factor)))

    def follow_chunk(self, right: int = 41) -> None:
        """The same as the points of a policy, for both arms, so many for the right one; 0 is no chunk for it."""
        start, chunks = self.rigs[Side.RIGHT].clock.now() + 0.1, {}
        for side, points in ((Side.RIGHT, right), (Side.LEFT, 41)):
            if not points:
                continue
            times = 0.05 * np.arange(points)
            rows = np.array([point.position for point in swung(side, times)])
            chunks[side] = FollowChunk(1, start, plan_chunk(side, times.tolist(), rows, YUMI_LIMITS), is_of_both=True)
        self.send(chunks)

    def desired(self, side: Side) -> np.ndarray:
        """Of the last joint in each cycle since the arm was led [rad]."""
        desired = [cycle.desired for cycle in self.rigs[side].cycles]
        return np.array([each.position[6] for each in desired if each is not None])

    def sent(self, side: Side) -> np.ndarray:
        return np.array([cycle.sent.position for cycle in self.rigs[side].cycles])


def swung(side: Side, times: np.ndarray) -> list[TrajectoryPoint]:
    """Where the last joint turns to and back [rad], and the others stand."""
    turns = 0.4 * (1.0 - np.cos(0.5 * np.pi * times))
    return [
        TrajectoryPoint(float(time), joints([*home(side)[:6], home(side)[6] + float(turn)]), ZERO_JOINTS, ZERO_JOINTS)
        for time, turn in zip(times, turns, strict=True)
    ]


BOTH_LED: dict[str, tuple[str, Callable[[LedBoth], object]]] = {
    # by which controller, and the call that moves both
    "trajectory": ("both", LedBoth.follow),
    "chunks": ("path", LedBoth.follow_chunk),
    "chunks of the dual-arm controller": ("both", LedBoth.follow_chunk),
}
BOTH_STOPPED: dict[str, Callable[[LedBoth], object]] = {
    "both cancelled": lambda led: led.cancel(*Side),
    "right cancelled": lambda led: led.cancel(Side.RIGHT),
    "left cancelled": lambda led: led.cancel(Side.LEFT),
    "right stopped": LedBoth.stop,
    "right taken over by a jog": lambda led: led.take_over("speeds"),
    "right taken over by goals": lambda led: led.take_over("goal"),
    "right's stream ended": LedBoth.end_streams,
    "right let go": lambda led: led.rigs[Side.RIGHT].manager.deactivate_commanding(),
    "right lost": LedBoth.lose,
}


ONE_LED: dict[str, tuple[str, Callable[[LedBoth], object]]] = {
    # by which controller, and what a policy of both arms sends: points of the left arm, which the right one has no more
    "chunks that are exhausted": ("path", lambda led: led.follow_chunk(right=11)),
    "no chunk": ("path", lambda led: led.follow_chunk(right=0)),
    "no chunk of the dual-arm controller": ("both", lambda led: led.follow_chunk(right=0)),
}


@pytest.mark.parametrize("call", [*BOTH_LED, *ONE_LED])
@pytest.mark.parametrize("how", [each for each in BOTH_STOPPED if each != "right lost"])
def test_call_for_both_arms_that_is_ended_on_one_before_it_begins_moves_neither(call: str, how: str) -> None:
    name, ask = (BOTH_LED | ONE_LED)[call]
    led = LedBoth()
    led.begin(name)
    ask(led)
    BOTH_STOPPED[how](led)
    led.run(0.4)
    for side in Side:
        assert np.abs(led.sent(side) - home(side)).max() < 1e-5


@pytest.mark.parametrize("call", BOTH_LED)
@pytest.mark.parametrize("how", BOTH_STOPPED)
def test_arms_that_one_call_moves_both_come_to_rest_and_stay_when_one_of_them_is_ended(call: str, how: str) -> None:
    name, ask = BOTH_LED[call]
    led = LedBoth()
    led.begin(name)
    ask(led)
    led.run(0.8)
    fast = {side: np.abs(np.diff(led.sent(side)[-2:], axis=0)).max() / CYCLE for side in Side}
    assert min(fast.values()) > 0.3
    first = {side: len(led.rigs[side].cycles) for side in Side}
    BOTH_STOPPED[how](led)
    led.run(0.9)
    for side in Side:
        sent = led.sent(side)[first[side] - 4 :]
        assert max(shares(sent)) < 1.01  # no step
        standing = sent[round(0.6 / CYCLE) :]  # none of an arm that is not heard
        assert np.abs(np.diff(standing, axis=0)).max(initial=0.0) < 1e-6
        assert np.abs(sent[-1] - sent[0]).max() < 0.3 * fast[side]


@pytest.mark.parametrize("call", ONE_LED)
@pytest.mark.parametrize("how", BOTH_STOPPED)
def test_arm_of_a_policy_brakes_when_the_other_one_is_ended_that_has_no_points(call: str, how: str) -> None:
    name, ask = ONE_LED[call]
    led = LedBoth()
    led.begin(name)
    ask(led)
    led.run(1.0)
    assert np.abs(np.diff(led.sent(Side.RIGHT)[-2:], axis=0)).max() < 1e-9
    assert np.abs(np.diff(led.sent(Side.LEFT)[-2:], axis=0)).max() / CYCLE > 0.3
    BOTH_STOPPED[how](led)
    first = len(led.sent(Side.LEFT))
    led.run(0.6)
    assert np.abs(led.sent(Side.LEFT)[-1] - led.sent(Side.LEFT)[first]).max() < 0.2
    still = led.sent(Side.LEFT)[-1]
    led.run(0.4)
    assert led.sent(Side.LEFT)[-1] == pytest.approx(still, abs=1e-6)


@pytest.mark.parametrize("name", ["path", "both"])
@pytest.mark.parametrize("factor", [0.5, 1.0])
def test_arms_go_on_in_step_from_chunks_to_a_trajectory_of_both(name: str, factor: float) -> None:
    led = LedBoth()
    led.begin(name)
    led.scale_speed(factor)
    led.follow_chunk()
    led.run(0.1 + 0.75 / factor)
    led.follow_on()
    led.run(0.1 + 2.5 / factor)
    turned = {side: led.desired(side) - home(side)[6] for side in Side}
    assert turned[Side.LEFT] == pytest.approx(turned[Side.RIGHT], abs=1e-6)
    speeds = np.diff(turned[Side.LEFT]) / CYCLE
    assert np.abs(np.diff(speeds)).max() / CYCLE < YUMI_LIMITS.acceleration[6]  # no step
    assert turned[Side.LEFT][-1] == pytest.approx(swung(Side.LEFT, np.array([1.5]))[0].position[6] - home(Side.LEFT)[6])


@pytest.mark.parametrize("name", ["path", "both"])
def test_both_arms_go_on_from_chunks_to_a_trajectory_while_the_left_one_is_held_back(name: str) -> None:
    led = LedBoth()
    led.begin(name)
    led.follow_chunk()
    led.run(0.8)
    wire, led.rigs[Side.LEFT].to_robot = led.rigs[Side.LEFT].to_robot, lambda datagram: ()
    led.run(0.12)
    led.rigs[Side.LEFT].to_robot = wire
    led.follow_on()
    led.run(3.0)
    for side in Side:
        assert led.sent(side)[-1] == pytest.approx(swung(side, np.array([1.5]))[0].position, abs=1e-3)


def test_chunks_that_come_between_the_same_two_cycles_as_a_stop_move_both_arms() -> None:
    led = LedBoth()
    led.begin("path")
    led.follow_chunk()
    led.cancel(Side.RIGHT)
    led.follow_chunk()
    led.run(2.0)
    for side in Side:
        assert led.sent(side)[-1][6] - home(side)[6] > 0.7


def test_plan_that_was_checked_before_a_stop_begins_with_how_the_arm_brakes() -> None:
    led = LedBoth()
    led.begin("path")
    led.scale_speed(0.5)
    led.follow_chunk()
    led.run(1.6)
    rig = led.rigs[Side.RIGHT]
    first, last = swung(Side.RIGHT, np.array([1.0, 1.5]))
    plan = ArmPlan(Side.RIGHT, first, smooth_spline_through([first, last._replace(time=2.0)]), None)
    command = FollowTrajectory(plan, 2)
    rig.manager.check("path", command, rig.line.state)
    rig.manager.receive("path", CancelTrajectory(), rig.line.state)
    rig.manager.receive("path", command, rig.line.state)
    led.run(0.5)
    speeds = np.diff(led.desired(Side.RIGHT)) / CYCLE
    assert np.abs(np.diff(speeds)).max() / CYCLE < YUMI_LIMITS.acceleration[6]  # no step
