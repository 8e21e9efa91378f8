"""A perfect arm, and arms for the contract of controllers: each takes a case, a controller and how it is told where to
go."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from abb_protocols.robot.joints import (
    CYCLE,
    YUMI_LIMITS,
    ZERO_JOINTS,
    ArmCommand,
    ArmState,
    Joints,
    Side,
    home,
    joint_names,
    joints,
)
from abb_runtime.parameters import Values
from reported_limiter import ReportedLimiter
from trajectories import change_rate
from yumi.control.controller import Controller, Sampled
from yumi.control.controllers.forward_command import JointGroupPositionController, JointGroupVelocityController
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.controllers.joint_velocity import JointVelocityController
from yumi.control.counters import WireCounters
from yumi.control.cycle import Cycle, run_cycle
from yumi.control.goals import Buffer, MemoryBuffer, write_goal, write_speeds
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.stage_times import StageClock
from yumi_evaluation.virtual_time import VirtualArmRig

NAME = "controller"
SIDE = Side.RIGHT

_STEERING = 3.0  # [1/s] how hard an arm that takes speeds is steered to a goal
_FASTEST = 0.5  # [rad/s] at which it is steered

Order = Callable[[Buffer, ArmState, Joints], None]
"""Tells a controller where the arm shall go."""


def order_goal(box: Buffer, state: ArmState, goal: Joints) -> None:
    write_goal(box, state.session, goal, time=state.time)


def order_speeds(box: Buffer, state: ArmState, goal: Joints) -> None:
    """The speed with which a person would steer the arm to the goal."""
    ways = zip(goal, state.position, strict=True)
    speeds = [max(-_FASTEST, min(_FASTEST, _STEERING * (wanted - now))) for wanted, now in ways]
    write_speeds(box, state.session, joints(speeds), state.time)


class PerfectArm:
    """An arm without dynamics; every ``read`` is one cycle later.

    Attributes:
        is_running: whether it follows commands; set it to stop the robot.

    Args:
        position: where it begins, chain order [rad].
    """

    def __init__(self, position: Joints) -> None:
        self.is_running = True
        self._position = position
        self._velocity = ZERO_JOINTS
        self._dt = 0.0

    def read(self, now: float) -> ArmState | None:
        state = ArmState(now, self._dt, 1, self._position, self._velocity, self._position, self.is_running)
        self._dt = CYCLE
        return state

    def write(self, command: ArmCommand) -> None:
        if not self.is_running:
            return
        self._velocity = change_rate(command.position, self._position, CYCLE)
        self._position = command.position

    def silence(self, now: float) -> float:
        return 0.0

    def lost_after(self, now: float) -> float | None:
        return None

    def wire_counters(self) -> WireCounters:
        return WireCounters(session=1)


class ArmHardware(Protocol):
    """What a test has in the place of a robot behind its limiter."""

    def read(self, now: float) -> ArmState | None:
        """The newest state that has not been read yet, or None."""

    def write(self, command: ArmCommand) -> None:
        """Answer the state read last."""

    def silence(self, now: float) -> float:
        """Time since the newest state [s]."""

    def lost_after(self, now: float) -> float | None:
        """How long the robot has been silent [s], once, when it has become too long."""

    def wire_counters(self) -> WireCounters:
        """What the connection has seen so far."""


class LimitedArm:
    """An arm of the control loop that is made of states, without datagrams."""

    def __init__(self, hardware: ArmHardware, limiter: ReportedLimiter) -> None:
        self._hardware, self._limiter = hardware, limiter
        self._state: ArmState | None = None
        self.silence, self.lost_after = hardware.silence, hardware.lost_after
        self.wire_counters = hardware.wire_counters

    def receive(self, now: float) -> ArmState | None:
        reported = self._hardware.read(now)
        self._state = None if reported is None else self._limiter.check(reported)
        return self._state

    def reply(self, desired: ArmCommand | None) -> ArmCommand | None:
        assert self._state is not None
        sent = self._limiter.limit(self._state, desired)
        self._hardware.write(sent)
        return sent

    def settle(self, state: ArmState) -> None:
        self._limiter.observe(state)

    def prepare(self, sampled: Sampled | None, session: int) -> None:
        """It is asked for each state."""

    def take_braked(self) -> Sequence[Cycle]:
        return ()


@dataclass(frozen=True)
class Case:
    """A controller under test.

    Attributes:
        name: for the test's report.
        make: makes it with its mailbox.
        order: how it is told where to go.
        values: its parameters.
    """

    name: str
    make: Callable[[Buffer], Controller]
    order: Order = order_goal
    values: Values = field(default_factory=dict)


_SMALL_INTEGRAL: Values = {"i_clamp_max": 5e-4, "i_clamp_min": -5e-4}

CASES = (
    Case("P", JointPositionController, values={"p": 1.0}),
    Case(
        "PID",
        JointPositionController,
        values={"p": 1.0, "i": 0.5, "d": 0.02, "i_clamp_max": 5e-4, "i_clamp_min": -5e-4},
    ),
    Case("feed-forward", JointPositionController, values={"tracking.feed_forward": True}),
    Case("velocity", JointVelocityController, order_speeds),
    Case("forward position", lambda box: JointGroupPositionController(box, MemoryBuffer())),
    Case("forward velocity", lambda box: JointGroupVelocityController(MemoryBuffer(), box), order_speeds),
)


class ArmUnderTest(ABC):
    """An arm at home, the controller of a case active, nothing ordered yet."""

    def __init__(self, case: Case) -> None:
        self._order = case.order
        self._box = MemoryBuffer()
        self._goal: Joints | None = None
        self._controller = case.make(self._box)

    def go(self, goal: Joints, seconds: float) -> list[Joints]:
        """Order ``goal`` [rad] in every cycle for a time; returns the measured positions of all cycles."""
        self._goal = goal
        return self.run(seconds)

    def run(self, seconds: float) -> list[Joints]:
        """Let time pass; returns the measured positions of all cycles."""
        path = []
        for _ in range(round(seconds / CYCLE)):
            if self._goal is not None:
                self.order(self._goal)
            path.append(self.cycle())
        return path

    def order(self, goal: Joints) -> None:
        """Order ``goal`` [rad] once."""
        self._order(self._box, self.state, goal)

    def activate(self) -> None:
        self.manager.switch((NAME,), (), self.state)

    def deactivate(self) -> None:
        self.manager.switch((), (NAME,), self.state)

    @property
    @abstractmethod
    def manager(self) -> ControllerManager: ...

    @property
    @abstractmethod
    def state(self) -> ArmState:
        """The newest."""

    @abstractmethod
    def cycle(self) -> Joints:
        """One cycle; returns the measured positions [rad]."""


class PerfectArmUnderTest(ArmUnderTest):
    """The perfect arm in memory."""

    def __init__(self, case: Case) -> None:
        super().__init__(case)
        self._manager = ControllerManager(joint_names(SIDE))
        self._manager.load(NAME, self._controller)
        self._manager.set_parameters(NAME, case.values)
        self._manager.configure(NAME)
        self._arm, self._now = LimitedArm(PerfectArm(home(SIDE)), ReportedLimiter(YUMI_LIMITS)), 0.0
        self.cycle()
        self.activate()

    @property
    def manager(self) -> ControllerManager:
        return self._manager

    @property
    def state(self) -> ArmState:
        return self._state

    def cycle(self) -> Joints:
        self._now += CYCLE
        cycle = run_cycle(self._arm, self._manager, self._now, StageClock())
        assert cycle is not None
        self._state = cycle.state
        return cycle.state.position


class VirtualArmUnderTest(ArmUnderTest):
    """The virtual arm behind EGM's datagrams, with its dynamics."""

    def __init__(self, case: Case) -> None:
        super().__init__(case)
        self._arm = VirtualArmRig({NAME: self._controller}, side=SIDE)
        self._arm.manager.set_parameters(NAME, case.values)
        self._arm.start()
        self.activate()

    @property
    def manager(self) -> ControllerManager:
        return self._arm.manager

    @property
    def state(self) -> ArmState:
        return self._arm.cycles[-1].state

    def cycle(self) -> Joints:
        self._arm.cycle()
        return self.state.position
