"""A robot without a robot: it notes what it is asked, and its motions end when the test says so."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from types import SimpleNamespace
from typing import Any, NamedTuple

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import YUMI_LIMITS, Side, home
from abb_runtime.clock import ManualClock
from yumi.api.motion_executor import MotionExecutor
from yumi.api.motion_registry import MotionRegistry
from yumi.control.controller import State
from yumi.control.controller_info import ControllerInfo, ParameterInfo
from yumi.control.controllers.joint_goal import GoalEnded, GoalOutcome, JointGoalController, StopMotion
from yumi.control.counters import WireCounters
from yumi.control.goals import MemoryBuffer
from yumi.control.hand_over import HandOver
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.loop_events import ControllerReport
from yumi.control.shared_state import Snapshot
from yumi.driver.controller_names import (
    CARTESIAN_CONTROLLER,
    GOAL_CONTROLLER,
    JOG_CONTROLLER,
    STREAM_CONTROLLER,
    TRAJECTORY_CONTROLLER,
)

NAMES = (GOAL_CONTROLLER, STREAM_CONTROLLER, TRAJECTORY_CONTROLLER, JOG_CONTROLLER, CARTESIAN_CONTROLLER)


class Switch(NamedTuple):
    """A switch of controllers that was asked for."""

    side: Side
    activate: tuple[str, ...]
    deactivate: tuple[str, ...]


class FakeControl:
    """Both arms stand at home and follow."""

    def __init__(self) -> None:
        self.commands: list[ControllerCommand] = []
        self.switches: list[Switch] = []
        self.refuses = False
        self.buffers: dict[Side, Any] = {}
        self.on_command: Callable[[ControllerCommand], None] = lambda command: None
        self.snapshots = {
            side: Snapshot(
                wire=WireCounters(session=1),
                is_streaming=True,
                is_running=True,
                activation=1,
                position=home(side),
                sent=home(side),
            )
            for side in Side
        }
        self._active: dict[Side, str | None] = dict.fromkeys(Side, GOAL_CONTROLLER)
        self.hand_over = HandOver(monotonic)

    def snapshot(self, side: Side) -> Snapshot:
        return self.snapshots[side]

    def release(self, side: Side) -> None:
        """No controller commands the arm any more."""
        self._active[side] = None
        before = self.snapshots[side]
        self.snapshots[side] = before._replace(activation=before.activation + 1, activity=before.activity + 1)

    def call(self, command: Callable[..., Any], /, *args: Any) -> Any:
        with self.hand_over.passing(command, args, {}):
            return self._serve(command, *args)

    def _serve(self, command: Callable[..., Any], /, *args: Any) -> Any:
        if command is Commands.list_controllers:
            return tuple(self._info(name, *args) for name in NAMES)
        if command is Commands.list_parameters:
            return tuple(ParameterInfo(it, it.default) for it in JointGoalController(MemoryBuffer()).parameters(()))
        if command is Commands.switch_controllers:
            self._switch(*args)
        if command is Commands.send_commands:
            if self.refuses:
                raise CommandRefused("Not now.")
            self.commands += args
            for each in args:
                self.on_command(each)
        return None

    def _info(self, name: str, side: Side) -> ControllerInfo:
        is_active = self._active[side] == name
        claimed = ("joint/position",) if is_active else ()
        return ControllerInfo(name, "kind", State.ACTIVE if is_active else State.INACTIVE, ("joint/position",), claimed)

    def _switch(self, side: Side, activate: tuple[str, ...], deactivate: tuple[str, ...]) -> None:
        self.switches.append(Switch(side, activate, deactivate))
        (self._active[side],) = activate
        before = self.snapshots[side]
        self.snapshots[side] = before._replace(activation=before.activation + 1, activity=before.activity + 1)


class FakeRobot:
    """An executor with a fake control process below."""

    def __init__(self, arms: tuple[Side, ...] = tuple(Side)) -> None:
        self.control = FakeControl()
        self.goals = {side: MemoryBuffer() for side in Side}
        self.speeds = {side: MemoryBuffer() for side in Side}
        self.tool_goals = {side: MemoryBuffer() for side in Side}
        self.motions = MotionRegistry()
        self.feedback = {side: MemoryBuffer() for side in Side}
        self.dual_feedback = {side: MemoryBuffer() for side in Side}
        self.control.buffers = {
            side: SimpleNamespace(
                goals=self.goals[side],
                speeds=self.speeds[side],
                tool_goals=self.tool_goals[side],
                trajectory=self.feedback[side],
                dual_trajectory=self.dual_feedback[side],
                tool_path=MemoryBuffer(),
                deadline=MemoryBuffer(),
            )
            for side in Side
        }
        self.speed_scale = 1.0
        self.clock = ManualClock(100.0)
        begun = monotonic()  # clients wait in real time, and a test may hurry the robot's clock on
        self.control.hand_over = HandOver(lambda: self.clock.now() + monotonic() - begun)
        self.executor = MotionExecutor(
            self.control, self.motions, arms, YUMI_LIMITS, self.clock, lambda: self.speed_scale
        )

    def rest(self, command: ControllerCommand) -> None:
        """For ``on_command``: an arm that is told to stop does."""
        if isinstance(command.message, StopMotion):
            self.end(command)

    def end(self, command: ControllerCommand, outcome: GoalOutcome = GoalOutcome.REACHED, sentence: str = "so") -> None:
        """The control process reports how a motion has ended."""
        identity = command.message.identity  # type: ignore[attr-defined]
        self.motions.note(
            ControllerReport(
                command.side, command.controller, GoalEnded(identity, outcome, message("text", text=sentence))
            )
        )
