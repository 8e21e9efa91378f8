"""The joint trajectory controllers: follow splines through given points, in step with the arm's own delay.

The arm is commanded to be somewhere ``lookahead`` before it is due there, and its speed beside its position, so that
the robot's own loop has no error left to make speed of (reference/egm.md §6.1). What is desired of the arm is therefore
the trajectory a ``lookahead`` ago; the measured position is judged by that. Parameters, result codes and tolerances
are upstream's (reference/ros2_control.md §3.2).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto
from itertools import pairwise
from math import inf, isnan
from typing import Protocol

from yumi.catalogue import Message, message
from yumi.control.controller import Buffer, Controller, check_joints
from yumi.control.motion import (
    DELAY,
    STANDING,
    PointMotion,
    Setpoint,
    StandstillDetector,
    is_held_back,
    stop,
)
from yumi.control.shared_state import Skew, TrajectoryFeedback
from yumi.control.speed_scale import SpeedScale
from yumi.control.trajectory import (
    ArmPlan,
    ResultCode,
    Segments,
    Spline,
    SplineSampler,
    TrajectoryPoint,
    blend,
    refused,
)
from yumi.errors import CommandRefused
from yumi.robot.joints import YUMI_LIMITS, ZERO, ArmCommand, ArmState, JointLimits, Joints, Side, joint_names, joints
from yumi.settings import Parameter, Values, flag, number, texts

DEFAULT = 0.0
"""A tolerance that takes the controller's own value."""

UNLIMITED = -1.0
"""A tolerance that tolerates everything."""


@dataclass(frozen=True, slots=True)
class Tolerances:
    """How far an arm may be from its trajectory; :data:`DEFAULT` and :data:`UNLIMITED` in place of any value.

    Attributes:
        path: on the way [rad], (7,).
        path_velocity: on the way [rad/s], (7,).
        goal: at the end [rad], (7,).
        goal_velocity: at the end [rad/s], (7,).
        goal_time: how much later than planned the goal may be reached [s].
    """

    path: Joints = ZERO
    path_velocity: Joints = ZERO
    goal: Joints = ZERO
    goal_velocity: Joints = ZERO
    goal_time: float = DEFAULT

    @property
    def values(self) -> tuple[float, ...]:
        """All of them."""
        return (*self.path, *self.path_velocity, *self.goal, *self.goal_velocity, self.goal_time)


@dataclass(frozen=True, slots=True)
class FollowTrajectory:
    """A command: follow a trajectory, in place of whatever the arm does now.

    Attributes:
        plan: the arm's part of it.
        goal: number by which its end is reported; each command has its own.
        tolerances: what ends it.
    """

    plan: ArmPlan
    goal: int
    tolerances: Tolerances = Tolerances()


@dataclass(frozen=True, slots=True)
class CancelTrajectory:
    """A command: come to rest within the limits.

    Attributes:
        goal: which motion; another one goes on. None ends any.
    """

    goal: int | None = None


@dataclass(frozen=True, slots=True)
class ScaleSpeed:
    """A command: let time on the trajectory go by slower or faster than outside.

    Attributes:
        factor: of the speed, 0 to 1.
    """

    factor: float


OTHER_ARM_TIMEOUT = 0.250
"""An arm that has not followed the common trajectory for so long does not follow it any more [s]. What ends its motion
ends the other's at once; what remains is a robot whose datagrams do not come, which may be late by tens of ms."""


class Phase(Enum):
    """How far an arm is with a trajectory."""

    RUNNING = auto()
    REACHED = auto()
    CANCELED = auto()


class Outcome(Enum):
    """How a motion ended: the terminal states of a ROS action."""

    SUCCEEDED = "succeeded"
    ABORTED = "aborted"
    CANCELED = "canceled"


@dataclass(frozen=True, slots=True)
class TrajectoryEnded:
    """A report: a motion has ended.

    Attributes:
        goal: the number of its command.
        outcome: how.
        code: the result code that says so.
        said: the same for a person.
        skew: of the arms that followed it together; None for one arm.
    """

    goal: int
    outcome: Outcome
    code: ResultCode
    said: Message
    skew: Skew | None = None

    def __str__(self) -> str:
        return str(message("trajectory_ended", outcome=self.outcome.value, reason=self.said))

    @property
    def sentence(self) -> str:
        """Why, as a sentence."""
        return str(self.said)


_RAD, _RATE = "rad", "rad/s"
_TIMES = 64  # cycles: more than the longest lookahead


def trajectory_parameters(joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
    """What can be set on a trajectory controller of these joints; names and defaults are upstream's.

    Where upstream has no default the first value that it allows is the one.
    """
    both = ("position", "velocity")
    common = (
        Parameter("joints", joint_names, description="The arm's joints, in any order.", read_only=True),
        Parameter(
            "command_interfaces",
            both,
            choices=both,
            description="What is claimed: position, or position and velocity.",
            read_only=True,
        ),
        Parameter(
            "state_interfaces",
            both,
            choices=both,
            description="What is read: position, or position and velocity.",
            read_only=True,
        ),
        Parameter(
            "allow_partial_joints_goal",
            default=False,
            description="Whether a goal may leave out joints; they hold where they are commanded to be.",
        ),
        Parameter("interpolation_method", "splines", choices=("splines",), description="What is between two points."),
        Parameter(
            "positions_upsampling.enable",
            default=False,
            description="Whether points with positions alone are followed by a smooth spline, not on straight lines.",
        ),
        Parameter(
            "positions_upsampling.policy_frequency",
            30.0,
            0.1,
            1000.0,
            "Hz",
            "How many points a second such a trajectory has that gives no times.",
        ),
        Parameter("feedforward", 1.0, 0.0, 1.0, "", "Share of the planned speed that is sent beside the position."),
        Parameter(
            "lookahead",
            DELAY,
            0.0,
            0.2,
            "s",
            "How much earlier than due the arm is commanded: the delay from a command to its effect.",
        ),
        Parameter("start_tolerance", 0.02, 1e-4, 0.5, _RAD, "A first point due at 0 s is at most so far from the arm."),
        Parameter("constraints.stopped_velocity_tolerance", 0.01, 0.0, 1.0, _RATE, "Speed at the goal; 0 is any."),
        Parameter("constraints.goal_time", 0.0, 0.0, 3600.0, "s", "The goal may be reached so late; 0 waits for ever."),
        Parameter(
            "speed_scaling.initial_scaling_factor", 1.0, 0.0, 1.0, "", "Share of the speed until commanded otherwise."
        ),
        Parameter("action_monitor_rate", 20.0, 1.0, 100.0, "Hz", "How often the action gives feedback."),
        Parameter("state_publish_rate", 50.0, 1.0, 100.0, "Hz", "How often controller_state is published."),
    )
    own = []
    for name in joint_names:
        constraints = f"constraints.{name}"
        own += [
            Parameter(f"{constraints}.trajectory", 0.0, 0.0, 6.3, _RAD, "Distance on the way that ends it; 0 is any."),
            Parameter(f"{constraints}.goal", 0.0, 0.0, 6.3, _RAD, "Distance at which the goal is reached; 0 is any."),
            Parameter(
                f"{constraints}.max_deceleration_on_cancel", 0.0, 0.0, 40.0, "rad/s²", "0 is the joint's own limit."
            ),
        ]
    return (*common, *own, *_FIXED, Parameter("command_joints", joint_names, fixed="commands go to the joints"))


_SCALED = "every trajectory follows the robot's speed_scale without an interface"
_CONTINUES = "a motion always continues from the last command"
_FIXED = (
    Parameter("gains", (), fixed="gains are for velocity or effort commands; this arm is commanded by position"),
    Parameter("interface_name", (), fixed="a trajectory controller has command_interfaces"),
    Parameter("open_loop_control", default=True, fixed=_CONTINUES),
    Parameter("interpolate_from_desired_state", default=True, fixed=_CONTINUES),
    Parameter(
        "set_last_command_interface_value_as_state_on_activation",
        default=True,
        fixed="after activation the arm holds where the robot plans to be",
    ),
    Parameter(
        "allow_integration_in_goal_trajectories",
        default=False,
        fixed="points without positions are refused; give positions",
    ),
    Parameter(
        "allow_nonzero_velocity_at_trajectory_end",
        default=False,
        fixed="a trajectory ends at rest; a last point with a velocity is refused",
    ),
    Parameter("cmd_timeout", 0.0, fixed="the arm holds at the end of every trajectory"),
    Parameter(
        "constraints.decelerate_on_cancel", default=True, fixed="a cancelled arm always brakes within its limits"
    ),
    Parameter("speed_scaling.state_interface", "", fixed=_SCALED),
    Parameter("speed_scaling.command_interface", "", fixed=_SCALED),
    Parameter("speed_scaling_interface_name", "", fixed=_SCALED),
)
"""Upstream's parameters, and those of drivers that build on it, which change nothing here."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """Tolerances as they are applied: infinity where there is none.

    Attributes:
        path: on the way [rad], (7,).
        path_velocity: on the way [rad/s], (7,).
        goal: at the end [rad], (7,).
        goal_velocity: at the end [rad/s], (7,).
        goal_time: how much later than planned the goal may be reached [s].
    """

    path: Joints
    path_velocity: Joints
    goal: Joints
    goal_velocity: Joints
    goal_time: float


@dataclass(frozen=True, slots=True)
class TrajectorySettings:
    """The parameters' values as the controller uses them.

    Attributes:
        feedforward: share of the planned speed that is sent beside the position.
        lookahead: how much earlier than due the arm is commanded [s].
        start_tolerance: how far from the arm a trajectory may begin without time to go there [rad].
        scale: share of the speed until commanded otherwise.
        feedback_period: time between two messages of the controller's state [s].
        monitor_period: time between two feedbacks of the action [s].
        is_partial_allowed: whether a goal may leave out joints.
        claimed: ``position``, and ``velocity`` where it is claimed, too.
        read: the same of what is measured.
        bounds: tolerances where a command names none.
        deceleration: what a cancelled motion brakes with [rad/s²], (7,).
    """

    feedforward: float
    lookahead: float
    start_tolerance: float
    scale: float
    feedback_period: float
    monitor_period: float
    is_partial_allowed: bool
    claimed: tuple[str, ...]
    read: tuple[str, ...]
    bounds: Bounds
    deceleration: Joints

    @staticmethod
    def of(values: Values, joint_names: Sequence[str], strongest: Joints) -> TrajectorySettings:
        """From complete parameter ``values``; ``strongest`` decelerations are the joints' own [rad/s²], (7,).

        Raises:
            CommandRefused: the joints are not the arm's, or interfaces do not go together.
        """
        check_joints(values, joint_names, in_order=False)
        for name in ("command_interfaces", "state_interfaces"):
            given = texts(values, name)
            if given not in (("position",), ("position", "velocity")):
                raise CommandRefused(message("parameter_interfaces_unknown", parameter=name, given=", ".join(given)))
        stopped = _or_any(number(values, "constraints.stopped_velocity_tolerance"))
        own = [number(values, f"constraints.{name}.max_deceleration_on_cancel") for name in joint_names]
        return TrajectorySettings(
            feedforward=number(values, "feedforward"),
            lookahead=number(values, "lookahead"),
            start_tolerance=number(values, "start_tolerance"),
            scale=number(values, "speed_scaling.initial_scaling_factor"),
            feedback_period=1.0 / number(values, "state_publish_rate"),
            monitor_period=1.0 / number(values, "action_monitor_rate"),
            is_partial_allowed=flag(values, "allow_partial_joints_goal"),
            claimed=texts(values, "command_interfaces"),
            read=texts(values, "state_interfaces"),
            bounds=Bounds(
                path=joints([_or_any(number(values, f"constraints.{name}.trajectory")) for name in joint_names]),
                path_velocity=joints([inf] * len(joint_names)),
                goal=joints([_or_any(number(values, f"constraints.{name}.goal")) for name in joint_names]),
                goal_velocity=joints([stopped] * len(joint_names)),
                goal_time=_or_any(number(values, "constraints.goal_time")),
            ),
            deceleration=joints([min(mine or most, most) for mine, most in zip(own, strongest, strict=True)]),
        )

    def bounds_with(self, wanted: Tolerances) -> Bounds:
        """The tolerances of a command, and the controller's own for the others."""
        own = self.bounds
        return Bounds(
            path=_chosen(wanted.path, own.path),
            path_velocity=_chosen(wanted.path_velocity, own.path_velocity),
            goal=_chosen(wanted.goal, own.goal),
            goal_velocity=_chosen(wanted.goal_velocity, own.goal_velocity),
            goal_time=_choice(wanted.goal_time, own.goal_time),
        )


def _or_any(tolerance: float) -> float:
    return tolerance or inf


def _chosen(wanted: Joints, own: Joints) -> Joints:
    return joints([_choice(*pair) for pair in zip(wanted, own, strict=True)])


def _choice(wanted: float, own: float) -> float:
    if wanted == DEFAULT:
        return own
    return inf if wanted == UNLIMITED else wanted


Violation = tuple[ResultCode, Message]
"""Why a motion must end: the result code, and the same for a person."""


class TrajectoryGoal:
    """A motion along one trajectory.

    Args:
        number: of its command.
        names: of the joints, for sentences.
        spline: the whole way.
        bounds: what ends it.

    Attributes:
        number: as above.
        begin: when the way begins, on its own clock [s].
        end: when it ends, on the same clock [s].
        phase: how far it is.
        first: when the first cycle came in which the arm was commanded to move [s]; 0 before.
    """

    def __init__(self, number: int, names: Sequence[str], spline: Spline, bounds: Bounds) -> None:
        self.number = number
        self.begin = spline.begin
        self.phase = Phase.RUNNING
        self.first = 0.0
        self._names = names
        self._walk = SplineSampler(spline)
        self.end = spline.end
        self._bounds = bounds
        self._watches_velocity = min(bounds.path_velocity) < inf

    @property
    def is_cancelled(self) -> bool:
        """Whether the arm comes to rest because it was cancelled."""
        return self.phase is Phase.CANCELED

    def judge(self, time: float, state: ArmState, pace: float | None = 1.0) -> Violation | None:
        """What is wrong with an arm that should be where the trajectory was at ``time`` [s]; notes its arrival.

        ``pace`` is how fast time goes by on the trajectory; None while that changes, which leaves speeds unjudged.
        """
        if time < self.begin:
            return None
        if time < self.end:
            return self._judge_way(time, state, pace)
        if self.phase is Phase.RUNNING and self._has_arrived(state):
            self.phase = Phase.REACHED
        if self.phase is Phase.RUNNING and time - self.end > self._bounds.goal_time:
            return ResultCode.GOAL_TOLERANCE_VIOLATED, self._missed_goal(time, state)
        return None

    def _judge_way(self, time: float, state: ArmState, pace: float | None) -> Violation | None:
        bounds, desired = self._bounds, self._walk.position(time)
        for index, (wanted, actual, bound) in enumerate(zip(desired, state.position, bounds.path, strict=True)):
            if not -bound <= actual - wanted <= bound:
                return ResultCode.PATH_TOLERANCE_VIOLATED, message(
                    "joint_off_trajectory",
                    joint=self._names[index],
                    distance=actual - wanted,
                    time=time,
                    tolerance=bound,
                )
        if pace is None or not self._watches_velocity:
            return None
        speeds = [pace * speed for speed in self._walk.motion(time)[1]]
        for index, (wanted, actual, bound) in enumerate(zip(speeds, state.velocity, bounds.path_velocity, strict=True)):
            if not -bound <= actual - wanted <= bound:
                return ResultCode.PATH_TOLERANCE_VIOLATED, message(
                    "joint_off_speed",
                    joint=self._names[index],
                    difference=actual - wanted,
                    time=time,
                    tolerance=bound,
                )
        return None

    def _has_arrived(self, state: ArmState) -> bool:
        goal, bounds = self._walk.position(self.end), self._bounds
        return all(
            abs(actual - wanted) <= (_ELSEWHERE if bound == inf else bound)
            for wanted, actual, bound in zip(goal, state.position, bounds.goal, strict=True)
        ) and all(-bound <= speed <= bound for speed, bound in zip(state.velocity, bounds.goal_velocity, strict=True))

    def _missed_goal(self, time: float, state: ArmState) -> Message:
        goal, late = self._walk.position(self.end), time - self.end
        for index, (wanted, actual, any_bound) in enumerate(zip(goal, state.position, self._bounds.goal, strict=True)):
            bound = _ELSEWHERE if any_bound == inf else any_bound
            if not -bound <= actual - wanted <= bound:
                return message(
                    "joint_off_goal", joint=self._names[index], distance=actual - wanted, late=late, tolerance=bound
                )
        return message("arm_moved_after_trajectory", late=late)


_ELSEWHERE = 0.05  # [rad] an arm that is so far from its goal has not reached it, where any distance is tolerated
_SCALING_RATE = 4.0  # [1/s] a scale goes from 0 to 1 in a quarter of a second: no joint brakes too hard by it
_BRAKE_SHARE = 0.9  # of the limits: with what the robot's own loop adds, a command at the limits is beyond them


_SETTLING = 0.1  # [s] after a change of pace the measured speeds are those of the pace before


class _Source(Protocol):
    """Where the commanded motion comes from."""

    def motion(self, time: float) -> tuple[Joints, Joints]: ...

    def setpoint(self, time: float) -> Setpoint: ...


class _Brake:
    """Coming to rest."""

    def __init__(self, motion: PointMotion) -> None:
        self.duration = motion.duration
        self.setpoint = motion.at

    def motion(self, time: float) -> tuple[Joints, Joints]:
        position, velocity, _ = self.setpoint(time)
        return position, velocity


class JointTrajectoryController(Controller):
    """Follows one trajectory at a time; a new one replaces it, from whatever the arm is commanded then.

    Commands come by :meth:`receive`; each motion's end is a report.

    Args:
        side: its arm.
        feedback: where others see how it follows.
        limits: what the joints may do.
        speed: the factor on the arm's speed; time on a trajectory goes by slower by it.
    """

    kind = "joint_trajectory_controller/JointTrajectoryController"

    def __init__(
        self,
        side: Side,
        feedback: Buffer[TrajectoryFeedback],
        limits: JointLimits = YUMI_LIMITS,
        speed: SpeedScale | None = None,
    ) -> None:
        self._side = side
        self._names = joint_names(side)
        self._limits = limits
        self._feedback = feedback
        self._speed = speed or SpeedScale()
        defaults = {each.name: each.default for each in self.parameters(self._names)}
        self._settings = TrajectorySettings.of(defaults, self._names, limits.acceleration)
        self._scale = self._rate = self._settings.scale
        self._reports: list[TrajectoryEnded] = []
        self._goal: TrajectoryGoal | None = None
        self._state: ArmState | None = None
        self._checked: tuple[FollowTrajectory, ArmState, Spline, float] | None = None
        self._feedback_due = -inf
        self._standstill: StandstillDetector | None = None
        self._is_judged = True
        self._judged_pace, self._paced_at = 1.0, -inf
        self._source: _Source = _resting(ZERO)
        self._time = 0.0
        self._times: deque[tuple[float, float]] = deque(maxlen=_TIMES)  # of the last cycles, and on the trajectory [s]
        self._position = self._velocity = ZERO

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        return trajectory_parameters(joint_names)

    def configure(self, values: Values) -> None:
        self._settings = TrajectorySettings.of(values, self._names, self._limits.acceleration)

    def command_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        """Speeds are sent beside the positions where no other controller claims them, see :class:`MergedCommand`."""
        return tuple(f"{name}/{kind}" for name in joint_names for kind in self._settings.claimed)

    def state_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(f"{name}/{kind}" for name in joint_names for kind in self._settings.read)

    def activate(self, state: ArmState) -> None:
        """An arm that moves comes to rest first: it was led by another law, whose command is no place to go on from."""
        self._goal, self._state, self._feedback_due = None, state, -inf
        self._rate = self._scale = self._settings.scale
        self._rest_at(state.position)
        self._standstill = StandstillDetector(state)

    def deactivate(self) -> None:
        self._end(Outcome.ABORTED, ResultCode.INVALID_GOAL, message("controller_deactivated"))
        self._rest_at(self._position)

    def check(self, command: object, state: ArmState | None) -> None:
        if isinstance(command, FollowTrajectory):
            self._prepared(command, state)
        elif isinstance(command, ScaleSpeed):
            if not 0.0 <= command.factor <= 1.0:
                raise CommandRefused(message("speed_scaling_factor_out_of_range", factor=command.factor))
        elif not isinstance(command, CancelTrajectory):
            raise CommandRefused(
                message(
                    "command_of_other_controller",
                    type=self.kind,
                    allowed=(FollowTrajectory.__name__, ScaleSpeed.__name__, CancelTrajectory.__name__),
                    command=type(command).__name__,
                )
            )

    def receive(self, command: object, state: ArmState | None) -> None:
        self.check(command, state)
        if isinstance(command, FollowTrajectory):
            self._follow(command, *self._prepared(command, state))
        elif isinstance(command, ScaleSpeed):
            self._scale = command.factor
        elif isinstance(command, CancelTrajectory):
            self._cancel(command)

    def update(self, state: ArmState) -> ArmCommand | None:
        self._state = state
        if self._standstill is not None:
            self._rest_at(state.position)
            if not self._standstill.is_over(state):
                return None
            self._standstill = None
        goal, dt, share = self._goal, state.dt, self._settings.feedforward
        if goal is None or goal.is_cancelled:
            self._time += dt
        else:
            # Time goes by for what is followed; waiting, for the begin or at the goal, takes its time.
            if self._rate != self._scale:
                change = _SCALING_RATE * dt
                self._rate += max(-change, min(change, self._scale - self._rate))
            self._time += dt * self._pace if goal.begin <= self._time < goal.end else dt
            share *= self._pace
        self._times.append((state.time, self._time))
        self._position, velocity = self._source.motion(self._time)
        self._is_judged = False
        if share == 0.0:
            velocity = ZERO
        self._velocity = velocity if velocity is ZERO or share == 1.0 else _scaled(velocity, share)
        return ArmCommand(self._position, self._velocity)

    def note_withheld(self, position: Joints) -> None:
        if self._goal is None and not self._is_braking:
            self._rest_at(position)

    def take_reports(self) -> Sequence[object]:
        """Judges the newest cycle, too: its reply has left, and what comes of it is for the next one."""
        state = self._state
        if state is not None and not self._is_judged:
            self._is_judged = True
            if self._goal is not None:
                self._watch(self._goal, state)
            if self._goal is not None:
                self._compare_arms(self._goal, state)
            if state.time >= self._feedback_due:
                self._give_feedback(state)
        if not self._reports:
            return ()
        reports, self._reports = self._reports, []
        return reports

    def is_idle(self, now: float) -> bool:
        return self._goal is None and self._standstill is None and not self._is_braking

    @property
    def reference(self) -> Joints | None:
        return self._position

    @property
    def _pace(self) -> float:
        """How fast time goes by on a trajectory."""
        return self._rate * self._speed.value

    def _prepared(self, command: FollowTrajectory, state: ArmState | None) -> tuple[Spline, float]:
        """The whole way, and the time on it that the newest command belongs to."""
        if state is None:
            raise refused(message("arm_without_egm", arm=self._side.word))
        if self._standstill is not None and max(map(abs, state.velocity)) > STANDING:
            raise refused(message("trajectory_while_arm_moves"))
        if self._checked is not None and self._checked[0] is command and self._checked[1] is state:
            return self._checked[2:]
        plan, settings = command.plan, self._settings
        if plan.side is not self._side:
            raise refused(message("trajectory_of_other_arm", arm=plan.side.word, own_arm=self._side.word))
        if plan.left_out and not settings.is_partial_allowed:
            raise refused(message("trajectory_is_partial", missing=plan.left_out), ResultCode.INVALID_JOINTS)
        if any(isnan(value) for value in command.tolerances.values):
            raise refused(message("tolerance_not_a_number"))
        now = self._time_at_once(state) if plan.start is None else state.time - plan.start + settings.lookahead
        late = now - settings.lookahead - plan.spline.end
        if late > 0.0:
            raise refused(message("trajectory_is_over", late=late), ResultCode.OLD_HEADER_TIMESTAMP)
        setpoint = self._source.setpoint(self._time)
        if self._is_braking:  # in the trajectory's time from here on
            setpoint = setpoint.unscaled(self._speed.value)
        if now > 0.0:
            now *= self._speed.value
        spline = blend(plan, setpoint, now, self._limits, settings.start_tolerance)
        self._checked = (command, state, spline, now)
        return spline, now

    def _follow(self, command: FollowTrajectory, spline: Spline, now: float) -> None:
        assert self._state is not None
        self._end(Outcome.ABORTED, ResultCode.INVALID_GOAL, message("trajectory_replaced"), is_replaced=True)
        if isinstance(self._source, _Brake):
            self._rate = 1.0 if self._is_braking else self._scale
        self._goal = TrajectoryGoal(command.goal, self._names, spline, self._settings.bounds_with(command.tolerances))
        self._source, self._time, self._checked, self._standstill = SplineSampler(spline), now, None, None
        self._times.clear()

    def _cancel(self, command: CancelTrajectory) -> None:
        goal = self._goal
        if goal is None or goal.is_cancelled or command.goal not in (None, goal.number):
            return
        goal.phase = Phase.CANCELED
        self._brake()

    def _watch(self, goal: TrajectoryGoal, state: ArmState) -> None:
        if goal.is_cancelled:
            if self._standstill is None and not self._is_braking:
                self._end(Outcome.CANCELED, ResultCode.SUCCESSFUL, message("motion_cancelled"))
            return
        if not goal.first and self._time > goal.begin:
            goal.first = state.time
        time = self._measured_time(state)
        if self._pace != self._judged_pace:
            self._judged_pace, self._paced_at = self._pace, state.time
        is_steady = state.time - self._paced_at > _SETTLING
        violation = goal.judge(time, state, self._pace if is_steady else None)
        if violation is not None:
            self._abort(*violation)
        elif goal.phase is Phase.REACHED and self._may_succeed(goal):
            self._succeed()

    def _measured_time(self, state: ArmState) -> float:
        """The time on the trajectory that the measured position belongs to [s]: that of a ``lookahead`` ago."""
        ago, times = state.time - self._settings.lookahead, self._times
        for (newer_time, newer), (older_time, older) in pairwise(reversed(times)):
            if older_time <= ago:
                passed = newer_time - older_time
                return older + (newer - older) * (ago - older_time) / passed if passed > 0.0 else older
        return self._time - self._settings.lookahead * self._pace

    def _time_at_once(self, state: ArmState) -> float:
        """The time on a trajectory that starts at once that the newest command belongs to [s]."""
        return 0.0

    def _compare_arms(self, goal: TrajectoryGoal, state: ArmState) -> None:
        """What follows from the other arm, where two follow one trajectory."""

    def _may_succeed(self, goal: TrajectoryGoal) -> bool:
        return True

    @property
    def _skew(self) -> Skew | None:
        return None

    def _succeed(self) -> None:
        self._end(Outcome.SUCCEEDED, ResultCode.SUCCESSFUL, message("goal_reached"))
        self._rest_at(self._position)

    def _abort(self, code: ResultCode, said: Message) -> None:
        self._brake()
        self._end(Outcome.ABORTED, code, said)

    def _end(self, outcome: Outcome, code: ResultCode, said: Message, *, is_replaced: bool = False) -> None:
        """The motion is over for what waits for it; ``is_replaced``: the arm goes on with a newer one.

        Feedback with goal 0 is written before the report: a client may ask for its next motion at once.
        """
        goal, self._goal = self._goal, None
        if goal is not None:
            if self._state is not None and not is_replaced:
                self._feedback.write(self._feedback_of(self._state))
            self._reports.append(TrajectoryEnded(goal.number, outcome, code, said, self._skew))

    def _brake(self) -> None:
        """From what the arm is commanded now, at the speed time goes by; from where it is, if it is held back."""
        state = self._state
        if state is not None and is_held_back(self._position, self._velocity, state.planned):
            # What the limiter withheld from the arm would be made up for as soon as its way is free.
            self._rest_at(state.position)
            self._standstill = StandstillDetector(state)
            return
        setpoint = self._source.setpoint(self._time)
        if self._goal is not None and not isinstance(self._source, _Brake):
            setpoint = setpoint.scaled(self._pace)
        softer = joints([_BRAKE_SHARE * each for each in self._limits.jerk])
        strength = joints([_BRAKE_SHARE * each for each in self._settings.deceleration])
        self._source = _Brake(stop(setpoint, replace(self._limits, acceleration=strength, jerk=softer)))
        self._time, self._position = 0.0, setpoint.position
        self._times.clear()

    @property
    def _is_braking(self) -> bool:
        return isinstance(self._source, _Brake) and self._time < self._source.duration

    def _rest_at(self, position: Joints) -> None:
        self._source = _resting(position)
        self._time, self._position, self._velocity = 0.0, position, ZERO
        self._times.clear()

    def _give_feedback(self, state: ArmState) -> None:
        if state.time - self._feedback_due > self._settings.feedback_period:
            self._feedback_due = state.time
        self._feedback_due += self._settings.feedback_period
        self._feedback.write(self._feedback_of(state))

    def _feedback_of(self, state: ArmState) -> TrajectoryFeedback:
        goal, source = self._goal, self._source
        time = self._measured_time(state) if goal is not None else self._time
        desired, velocity = source.motion(time)
        if goal is not None and not goal.is_cancelled and self._pace != 1.0:
            velocity = _scaled(velocity, self._pace)
        number, skew = (goal.number, self._skew or Skew()) if goal is not None else (0, Skew())
        return TrajectoryFeedback(
            number,
            state.time,
            time,
            self._pace,
            *skew,
            desired,
            velocity,
            state.position,
            state.velocity,
            self._position,
            self._velocity,
            self._settings.monitor_period,
        )


def _resting(position: Joints) -> SplineSampler:
    return SplineSampler(Spline(Segments(), TrajectoryPoint(0.0, position)))


def _scaled(values: Joints, factor: float) -> Joints:
    return tuple([value * factor for value in values])


class DualArmTrajectoryController(JointTrajectoryController):
    """One arm's half of a motion of both arms; an end of one arm's motion ends the other's.

    Args:
        side: its arm.
        feedback: where others see how it follows.
        halves: of this controller that are active, by arm; shared by both.
        limits: what the joints may do.
        speed: the factor on the arm's speed.
    """

    kind = "yumi_controllers/DualArmTrajectoryController"

    def __init__(
        self,
        side: Side,
        feedback: Buffer[TrajectoryFeedback],
        halves: dict[Side, DualArmTrajectoryController],
        limits: JointLimits = YUMI_LIMITS,
        speed: SpeedScale | None = None,
    ) -> None:
        super().__init__(side, feedback, limits, speed)
        self._halves = halves
        self._worst_skew = self._start_skew = 0.0
        self._followed_together = -inf

    def activate(self, state: ArmState) -> None:
        super().activate(state)
        self._halves[self._side] = self

    def deactivate(self) -> None:
        super().deactivate()
        self._halves.pop(self._side, None)

    def _time_at_once(self, state: ArmState) -> float:
        """Arms at rest take the newer of their datagrams as the start, so that they are in step from the first cycle.

        One that moves goes on from its own newest command.
        """
        other = self._halves.get(self._side.other)
        if other is None or other._state is None or self._source.setpoint(self._time).velocity is not ZERO:
            return 0.0
        return min(0.0, state.time - other._state.time)

    def _follow(self, command: FollowTrajectory, spline: Spline, now: float) -> None:
        super()._follow(command, spline, now)
        assert self._state is not None
        self._worst_skew = self._start_skew = 0.0
        self._followed_together = max(self._state.time, command.plan.start or -inf)

    def _cancel(self, command: CancelTrajectory) -> None:
        goal = self._goal
        super()._cancel(command)
        other = goal and self._other(goal)
        if goal is not None and other and goal.is_cancelled and not other._is_cancelled:
            other._cancel(CancelTrajectory(goal.number))

    def _compare_arms(self, goal: TrajectoryGoal, state: ArmState) -> None:
        other = self._other(goal)
        if other is not None and other._goal is not None and other._state is not None:
            theirs = other._goal
            self._followed_together = max(self._followed_together, other._state.time)
            is_under_way = self._pace == 1.0 or max(self._time, other._time) < goal.end  # waiting is not slowed down
            if is_under_way and not goal.is_cancelled and goal.first and theirs.first:
                self._start_skew = goal.first - theirs.first
                if self._pace > 0.0:
                    difference = (self._time - other._time) / self._pace - (state.time - other._state.time)
                    self._worst_skew = max(self._worst_skew, abs(difference))
        silence = state.time - self._followed_together
        if silence > OTHER_ARM_TIMEOUT and not goal.is_cancelled:
            self._abort(ResultCode.INVALID_GOAL, message("other_arm_not_following", silence=silence))

    def _may_succeed(self, goal: TrajectoryGoal) -> bool:
        other = self._other(goal)
        return other is not None and other._goal is not None and other._goal.phase is Phase.REACHED

    def _end(self, outcome: Outcome, code: ResultCode, said: Message, *, is_replaced: bool = False) -> None:
        goal = self._goal
        super()._end(outcome, code, said, is_replaced=is_replaced)
        other = goal and self._other(goal)
        if not other:
            return
        if outcome is Outcome.SUCCEEDED:
            other._succeed()
        elif outcome is Outcome.ABORTED and not is_replaced:
            other._abort(code, message("other_arm_aborted"))

    @property
    def _skew(self) -> Skew:
        return Skew(self._start_skew, self._worst_skew)

    @property
    def _is_cancelled(self) -> bool:
        return self._goal is not None and self._goal.is_cancelled

    def _other(self, goal: TrajectoryGoal) -> DualArmTrajectoryController | None:
        """The other half, while it follows the same trajectory."""
        other = self._halves.get(self._side.other)
        return other if other and other._goal is not None and other._goal.number == goal.number else None
