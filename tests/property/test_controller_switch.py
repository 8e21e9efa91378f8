"""Controllers are switched again and again in mid-motion, at random moments: the admitted command never jumps."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise
from random import Random

import pytest

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import YUMI_LIMITS, Joints, Side, joints
from abb_runtime.parameters import Values
from egm_loop import EgmLoop
from soak import long, short
from trajectories import planned
from yumi.control.controller import Controller, State
from yumi.control.controllers.forward_command import JointGroupPositionController, JointGroupVelocityController
from yumi.control.controllers.joint_goal import JointGoalController
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.controllers.joint_velocity import JointVelocityController
from yumi.control.goals import Buffer, MemoryBuffer, write_goal, write_speeds
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.trajectory_commands import FollowTrajectory

SWITCHES = 300
"""Ten times as many with ``make soak``."""

TRAJECTORY = "trajectory"
MAKERS: Mapping[str, tuple[Callable[[Buffer, Buffer], Controller], Values]] = {
    "gentle": (lambda goals, speeds: JointPositionController(goals), {"p": 0.6}),
    "strong": (lambda goals, speeds: JointPositionController(goals), {"p": 2.0}),
    "stream": (lambda goals, speeds: JointPositionController(goals), {"tracking.feed_forward": True}),
    "velocity": (lambda goals, speeds: JointVelocityController(speeds), {}),
    "forward_position": (JointGroupPositionController, {}),
    "forward_velocity": (JointGroupVelocityController, {}),
    "goal": (lambda goals, speeds: JointGoalController(goals), {"speed_scale": 1.0, "acceleration_scale": 1.0}),
    TRAJECTORY: (lambda goals, speeds: JointTrajectoryController(Side.LEFT, MemoryBuffer()), {}),
}
"""Every controller that may be switched to: how it is made, given where its goals arrive, and its parameters."""


class SwitchedLoop(EgmLoop):
    """A lone arm on which one of :data:`MAKERS` commands at a time, or nobody."""

    def __init__(self) -> None:
        super().__init__()
        self.goals, self.speeds = MemoryBuffer(), MemoryBuffer()
        self.active: str | None = None
        self.followed = 0
        for name, (make, values) in MAKERS.items():
            self.manager.load(name, make(self.goals, self.speeds))
            self.manager.set_parameters(name, values)
            self.manager.configure(name)

    def switch(self, name: str | None) -> None:
        leaving = (self.active,) if self.active else ()
        self.manager.switch((name,) if name else (), leaving, self.line.state)
        self.line.publish(self.clock.now())
        self.active = name

    def send_goal(self, random: Random) -> None:
        """Somewhere in the middle half of every joint's range, at any speed; however the active controller takes it."""
        ranges = zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True)
        goal = joints([low + (high - low) * random.uniform(0.25, 0.75) for low, high in ranges])
        write_goal(self.goals, self.snapshot.session, goal)
        write_speeds(
            self.speeds, self.snapshot.session, joints([random.uniform(-top, top) for top in YUMI_LIMITS.velocity])
        )
        if self.active == TRAJECTORY:
            self._follow(goal, random.uniform(0.5, 2.0))

    def _follow(self, goal: Joints, seconds: float) -> None:
        """On a line; refused while the arm comes to rest from what another controller had it do."""
        assert self.line.state is not None
        points = (TrajectoryPoint(0.0, self.line.state.planned), TrajectoryPoint(seconds, goal))
        try:
            self.manager.receive(TRAJECTORY, FollowTrajectory(planned(points), self.followed + 1), self.line.state)
        except CommandRefused:
            return
        self.followed += 1


def speeds_at_switches(loop: SwitchedLoop, random: Random, count: int) -> Iterator[float]:
    """Switch, let some cycles pass, give a new goal, let some cycles pass; the fastest joint's speed at each switch."""
    for _ in range(count):
        assert loop.line.state is not None
        yield max(map(abs, loop.line.state.velocity))
        loop.switch(random.choice([None, *MAKERS]))
        for _ in range(random.randint(0, 5)):
            loop.cycle()
        loop.send_goal(random)
        for _ in range(random.choice([5, 20, 60, 120])):
            loop.cycle()


def assert_within_limits(loop: SwitchedLoop) -> None:
    """Neither the admitted command nor what the robot makes of it and of the speeds beside it moves too fast."""
    for before, after in pairwise(loop.cycles):
        assert_step(before.sent.position, after.sent.position, after.state.dt)
        assert_step(before.state.planned, after.state.planned, after.state.dt)


def assert_step(before: Joints, after: Joints, dt: float) -> None:
    steps = zip(before, after, YUMI_LIMITS.velocity, strict=True)
    assert all(abs(new - old) <= speed * dt * 1.001 + 1e-9 for old, new, speed in steps)


@pytest.fixture(scope="module", params=[short(SWITCHES), long(10 * SWITCHES, 600.0)])
def loop(request: pytest.FixtureRequest) -> SwitchedLoop:
    """After many switches."""
    loop = SwitchedLoop()
    loop.begin()
    loop.deactivate()
    speeds = list(speeds_at_switches(loop, Random(4), request.param))
    assert sum(speed > 0.1 for speed in speeds) > request.param / 2  # in mid-motion
    assert loop.followed > 10
    return loop


def test_no_switch_makes_the_admitted_command_jump(loop: SwitchedLoop) -> None:
    assert_within_limits(loop)


def test_no_switch_overloads_the_robot(loop: SwitchedLoop) -> None:
    assert loop.robot.arm.overload is None
    assert loop.snapshot.is_running
    assert loop.snapshot.session == 1


def test_no_switch_makes_a_controller_fail(loop: SwitchedLoop) -> None:
    assert loop.manager.failures == []
    assert loop.snapshot.limiter.refused == 0


@pytest.mark.parametrize("state", [State.INACTIVE, State.UNCONFIGURED])
def test_hardware_that_leaves_in_mid_motion_brings_the_arm_to_rest_within_its_limits(state: State) -> None:
    loop = SwitchedLoop()
    loop.begin()
    loop.go(YUMI_LIMITS.upper)
    loop.run(0.3)
    loop.manager.set_hardware_state("arm", state)
    loop.run(0.7)
    assert_within_limits(loop)
    assert (loop.line.is_still, loop.snapshot.is_running, loop.snapshot.is_commanded) == (True, True, False)
    place = loop.snapshot.sent
    loop.manager.set_hardware_state("arm", State.ACTIVE)
    loop.run(0.1)
    assert loop.snapshot.sent == place
