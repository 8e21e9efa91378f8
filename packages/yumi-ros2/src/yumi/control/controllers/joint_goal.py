"""The joint goal controller: takes an arm to single points, on ways it plans and may replan at any moment.

The way keeps the joints' speeds, accelerations and jerks (:mod:`yumi.control.motion.point_motion`). Its speed is fed
forward beside its position, so that the robot's own loop has no error left to make speed of and follows without lag
(reference/egm.md §6.1).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import (
    CHAIN_AXES,
    CYCLE,
    JOINT_COUNT,
    YUMI_LIMITS,
    ZERO_JOINTS,
    ArmCommand,
    ArmState,
    JointLimits,
    Joints,
)
from abb_runtime.parameters import Parameter, Values, number
from yumi.control.controller import Controller, foreign_command
from yumi.control.goals import GoalBuffer, GoalInbox, check_position
from yumi.control.motion.point_motion import PointMotion, point_stop, point_travel
from yumi.control.motion.robot_response import STANDING
from yumi.control.motion.setpoint import Setpoint, largest_difference
from yumi.control.motion.standstill import StandstillDetector
from yumi.control.place import Place
from yumi.control.speed_scale import SpeedScale

_PARAMETERS = (
    Parameter("speed_scale", 0.5, 0.01, 1.0, "", "Share of the joints' speeds."),
    Parameter("acceleration_scale", 0.5, 0.01, 1.0, "", "Share of the joints' accelerations and jerks."),
    Parameter("top_speed", 3.14159, 0.01, 7.0, "rad/s", "EGM's MaxSpeedDeviation: the robot moves no faster."),
    Parameter("goal_tolerance", 0.002, 1e-4, 0.1, "rad", "Joints this near to the goal have reached it."),
    Parameter("goal_time", 2.0, 0.05, 60.0, "s", "So much later than planned the goal may be reached."),
    Parameter("path_tolerance", 0.5, 0.0, 3.0, "rad", "A joint this far from the way ends it; 0 is off."),
)
_ROOM = 0.9  # of the limits: the limiter counts what the position adds to the speed fed forward
_DEFAULTS = {item.name: number({item.name: item.default}, item.name) for item in _PARAMETERS}


class GoalOutcome(Enum):
    """How a command ended."""

    REACHED = "reached"
    REPLACED = "replaced"
    STOPPED = "stopped"
    ABORTED = "aborted"


@dataclass(frozen=True, slots=True)
class JointGoal:
    """A command: go there and stay.

    Attributes:
        position: where to, chain order [rad], (7,).
        identity: its number in :class:`GoalEnded`.
        speed_scale: factor on the joints' speeds, above 0 up to 1; None takes the parameter's.
        acceleration_scale: the same for accelerations and jerks.
    """

    position: Joints
    identity: int = 0
    speed_scale: float | None = None
    acceleration_scale: float | None = None


@dataclass(frozen=True, slots=True)
class StopMotion:
    """A command: come to rest as fast as the joints may, and stay.

    Attributes:
        identity: its number in :class:`GoalEnded`.
    """

    identity: int = 0


@dataclass(frozen=True, slots=True)
class GoalEnded:
    """An event: a command has ended.

    Attributes:
        identity: the command's number.
        outcome: how.
        said: why.
    """

    identity: int
    outcome: GoalOutcome
    said: Message

    def __str__(self) -> str:
        return str(message("motion_ended", number=self.identity, reason=self.said))


class JointGoalController(Controller):
    """Takes an arm to one goal at a time; a new one replaces it, from whatever the joints do then.

    Commands come by :meth:`receive`, goals also by a buffer; each command's end is an event. An arm that moves when
    the controller is activated is held until it stands, and then sent to its goal
    (:class:`yumi.control.motion.standstill.StandstillDetector`).

    Args:
        goals: where goals arrive without an identity, see :mod:`yumi.control.goals`.
        limits: of the joints.
        period: time between two states of the arm [s]; a late one finds the arm no further on its way than that allows.
        speed: the factor on the arm's speed; time on its way to a goal goes by slower by it.
    """

    kind = "yumi_controllers/JointGoalController"

    def __init__(
        self,
        goals: GoalBuffer,
        limits: JointLimits = YUMI_LIMITS,
        period: float = CYCLE,
        speed: SpeedScale | None = None,
    ) -> None:
        self._speed = speed or SpeedScale()
        self._period = period
        self._inbox = GoalInbox(goals)
        self._limits = limits
        self._values: Mapping[str, float] = _DEFAULTS
        self._reports: list[GoalEnded] = []
        self._command: JointGoal | StopMotion | None = None
        self._standstill: StandstillDetector | None = None
        self._rest_at(ZERO_JOINTS)

    @classmethod
    def make(cls, place: Place) -> JointGoalController:
        return cls(place.buffers.point_goals, place.limits, place.period, place.speed)

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        return _PARAMETERS

    def configure(self, values: Values) -> None:
        self._values = {item.name: number(values, item.name) for item in _PARAMETERS}

    def command_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(f"{name}/{kind}" for name in joint_names for kind in ("position", "velocity"))

    def activate(self, state: ArmState) -> None:
        self._command = None
        self._inbox.forget()
        self._hold(state)

    def deactivate(self) -> None:
        self._end(GoalOutcome.ABORTED, message("controller_deactivated"))

    def check(self, command: object, state: ArmState | None) -> None:
        self._planned(command)

    def receive(self, command: object, state: ArmState | None) -> None:
        accepted, motion = self._planned(command)
        is_stop = isinstance(accepted, StopMotion)
        if is_stop:
            self._inbox.forget()  # a goal that was not taken yet would begin after the stop
        self._end(
            GoalOutcome.STOPPED if is_stop else GoalOutcome.REPLACED,
            message("motion_stopped" if is_stop else "goal_replaced"),
        )
        self._command = accepted
        if is_stop and state is not None and self._is_held_back(state):
            self._hold(state)  # what is withheld would be made up for as soon as the way is free
        else:
            self._start(motion)

    def update(self, state: ArmState) -> ArmCommand | None:
        goal = self._inbox.take(state.session, state.time)
        if goal is not None:
            try:
                self.receive(JointGoal(goal.position), state)
            except CommandRefused as error:
                self._reports.append(GoalEnded(0, GoalOutcome.ABORTED, error.said))
        is_braking = isinstance(self._command, StopMotion) and self._time < self._motion.duration
        if is_braking and self._is_held_back(state):
            self._hold(state)
        if self._standstill is not None:
            # The command that came meanwhile begins from where the arm is sent then.
            self._rest_at(self.sent.position or state.position)
            if not self._standstill.is_over(state):
                return None
            self._standstill = None
            if self._command is not None:
                self._start(self._planned(self._command)[1])
        scale = self._scale
        self._time += min(state.dt, self._period) * (scale if self._time < self._motion.duration else 1.0)
        self._setpoint = self._motion.setpoint(self._time)
        if self._command is not None:
            self._check_progress(state)
        return ArmCommand(*self._setpoint.scaled(scale)[:2])

    def note_withheld(self, position: Joints) -> None:
        is_over = self._time >= self._motion.duration and not isinstance(self._command, JointGoal)
        if is_over and self._standstill is None:
            self._rest_at(position)

    def note_waiting(self, position: Joints) -> None:
        if isinstance(self._command, JointGoal) and self._standstill is None and self._time < self._motion.duration:
            self._setpoint = Setpoint(position)
            self._start(self._way_to(self._command))

    def take_reports(self) -> Sequence[object]:
        reports, self._reports = self._reports, []
        return reports

    def is_idle(self, now: float) -> bool:
        return self._command is None and self._standstill is None

    @property
    def reference(self) -> Joints | None:
        return self._motion.end

    @property
    def _scale(self) -> float:
        """How fast time goes by on the way to a goal; coming to rest is not slowed down."""
        return 1.0 if isinstance(self._command, StopMotion) else self._speed.value

    def _planned(self, command: object) -> tuple[JointGoal | StopMotion, PointMotion]:
        if isinstance(command, StopMotion):
            return command, point_stop(self._setpoint.scaled(self._scale), self._limits.slower(1.0, _ROOM))
        if not isinstance(command, JointGoal):
            raise foreign_command(self, command, JointGoal, StopMotion)
        _check_goal(command.position)
        return command, self._way_to(command)

    def _way_to(self, goal: JointGoal) -> PointMotion:
        speed = self._factor("speed_scale", goal.speed_scale)
        acceleration = self._factor("acceleration_scale", goal.acceleration_scale)
        top = self._values["top_speed"]
        start = self._setpoint.unscaled(self._speed.value / self._scale)  # in the time of the new way
        try:
            return point_travel(start, goal.position, self._limits.slower(speed, _ROOM * acceleration, top))
        except CommandRefused:
            if acceleration == 1.0:
                raise
        return point_travel(start, goal.position, self._limits.slower(speed, 1.0, top))  # brakes harder

    def _factor(self, name: str, value: float | None) -> float:
        if value is None:
            return self._values[name]
        if not 0.0 < value <= 1.0:
            raise CommandRefused(message("goal_scale_out_of_range", name=name, value=value))
        return value

    def _is_held_back(self, state: ArmState) -> bool:
        return self.sent.is_held_back(self._setpoint.position, self._setpoint.velocity, state.planned)

    def _hold(self, state: ArmState) -> None:
        self._standstill = StandstillDetector(state, self.sent)
        self._rest_at(self.sent.position or state.position)

    def _rest_at(self, position: Joints) -> None:
        self._setpoint = Setpoint(position)
        self._start(PointMotion(None, position))

    def _start(self, motion: PointMotion) -> None:
        self._motion = motion
        self._time = 0.0

    def _check_progress(self, state: ArmState) -> None:
        values, wanted = self._values, self._setpoint.position
        worst = largest_difference(state.position, wanted)
        if self._time < self._motion.duration:
            if 0.0 < values["path_tolerance"] < worst:
                self._end(GoalOutcome.ABORTED, message("axis_off_path", **self._worst(state)))
                self._hold(state)
        elif worst <= values["goal_tolerance"] and max(map(abs, state.velocity)) < STANDING:
            self._end(GoalOutcome.REACHED, message("goal_reached"))
        elif self._time > self._motion.duration + values["goal_time"]:
            self._end(GoalOutcome.ABORTED, message("axis_off_goal", **self._worst(state)))
            self._hold(state)

    def _worst(self, state: ArmState) -> dict[str, int | float]:
        errors = [abs(is_at - wanted) for is_at, wanted in zip(state.position, self._setpoint.position, strict=True)]
        index = errors.index(max(errors))
        return {"axis": CHAIN_AXES[index], "distance": errors[index]}

    def _end(self, outcome: GoalOutcome, said: Message) -> None:
        if self._command is not None:
            self._reports.append(GoalEnded(self._command.identity, outcome, said))
            self._command = None


def _check_goal(position: Joints) -> None:
    """Refuse what is not a position of an arm.

    Raises:
        CommandRefused: not seven numbers, or one of them is impossible.
    """
    if len(position) != JOINT_COUNT:
        raise CommandRefused(message("goal_joint_count", count=len(position), joints=JOINT_COUNT))
    for index, value in enumerate(position):
        check_position(f"axis {CHAIN_AXES[index]}", index, value)
