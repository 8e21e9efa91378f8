"""The joint trajectory controller: follows splines through given points, in step with the arm's own delay.

The arm is told where to be ``lookahead`` earlier than it shall be there, and its speed beside its position, so that the
robot's own loop has no error left to make speed of (reference/egm.md §6.1). What is desired of the arm is therefore
the trajectory a ``lookahead`` ago; it is what the measured position is judged by. Result codes and tolerances are
upstream's (reference/ros2_control.md §3.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf, isnan
from typing import Protocol, cast

from yumi.control.calming import STANDING, Calming
from yumi.control.controller import Controller
from yumi.control.joining import join
from yumi.control.mailbox import Mailbox
from yumi.control.parameter import Parameter, Values
from yumi.control.point_motion import PointMotion, Setpoint, stop
from yumi.control.speed_scale import SpeedScale
from yumi.control.spline import Pieces, Spline, TrajectoryPoint, Walk
from yumi.control.trajectory import ResultCode, refused
from yumi.control.trajectory_feedback import Skew, TrajectoryFeedback, put_feedback
from yumi.control.trajectory_partner import Nobody, Partner, PartnerReport, Phase
from yumi.controllers.trajectory_goal import TrajectoryGoal
from yumi.controllers.trajectory_orders import (
    CancelTrajectory,
    FollowTrajectory,
    Outcome,
    ScaleSpeed,
    TrajectoryEnded,
)
from yumi.controllers.trajectory_parameters import TrajectorySettings, trajectory_parameters
from yumi.errors import CommandRefused
from yumi.robot.joints import Joints, Side, joint_names, joints
from yumi.robot.limits import YUMI_LIMITS, JointLimits
from yumi.robot.values import ZERO, ArmCommand, ArmState

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
    """Follows one trajectory at a time; a new one replaces it, from whatever the arm is told then.

    Orders come by :meth:`receive`; each motion's end is a notice.

    Args:
        side: its arm.
        feedback: where others see how it follows.
        limits: what the joints may do.
        partner: the arm that follows the other part of its trajectories.
        speed: the factor on the arm's speed; time on a trajectory goes by slower by it.
    """

    kind = "joint_trajectory_controller/JointTrajectoryController"

    def __init__(
        self,
        side: Side,
        feedback: Mailbox,
        limits: JointLimits = YUMI_LIMITS,
        partner: Partner | None = None,
        speed: SpeedScale | None = None,
    ) -> None:
        self._side = side
        self._names = joint_names(side)
        self._limits = limits
        self._feedback = feedback
        self._partner = partner or Nobody()
        self._speed = speed or SpeedScale()
        defaults = {each.name: each.default for each in self.parameters(self._names)}
        self._settings = TrajectorySettings.of(defaults, self._names, limits.acceleration)
        self._scale = self._rate = self._settings.scale
        self._notices: list[TrajectoryEnded] = []
        self._goal: TrajectoryGoal | None = None
        self._state: ArmState | None = None
        self._checked: tuple[FollowTrajectory, ArmState, Spline, float] | None = None
        self._feedback_due = -inf
        self._calming: Calming | None = None
        self._is_judged = True
        self._judged_pace, self._paced_at = 1.0, -inf
        self._source: _Source = _resting(ZERO)
        self._time = 0.0
        self._position = ZERO

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        return trajectory_parameters(joint_names)

    def configure(self, values: Values) -> None:
        self._settings = TrajectorySettings.of(values, self._names, self._limits.acceleration)

    def command_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(f"{name}/{kind}" for name in joint_names for kind in ("position", "velocity"))

    def activate(self, state: ArmState) -> None:
        """An arm that moves comes to rest first: it was led by another law, whose command is no place to go on from."""
        self._goal, self._state, self._feedback_due = None, state, -inf
        self._rate = self._scale = self._settings.scale
        self._rest_at(state.planned)
        self._calming = Calming(state)

    def deactivate(self) -> None:
        self._end(Outcome.ABORTED, ResultCode.INVALID_GOAL, "The controller was deactivated; the arm holds.")
        self._rest_at(self._position)

    def check(self, message: object, state: ArmState | None) -> None:
        if isinstance(message, FollowTrajectory):
            self._prepared(message, state)
        elif isinstance(message, ScaleSpeed):
            if not 0.0 <= message.factor <= 1.0:
                raise CommandRefused(f"Speed scaling refused: the factor is {message.factor}; allowed is 0 to 1.")
        elif not isinstance(message, CancelTrajectory):
            raise CommandRefused(f"A controller of type {self.kind} takes no {type(message).__name__}.")

    def receive(self, message: object, state: ArmState | None) -> None:
        self.check(message, state)
        if isinstance(message, FollowTrajectory):
            self._follow(message, *self._prepared(message, state))
        elif isinstance(message, ScaleSpeed):
            self._scale = message.factor
        elif isinstance(message, CancelTrajectory):
            self._cancel(message)

    def update(self, state: ArmState) -> ArmCommand | None:
        self._state = state
        if self._calming is not None and not self._has_come_to_rest(self._calming, state):
            return None
        self._advance(state.dt)
        self._position, velocity = self._source.motion(self._time)
        self._is_judged = False
        return ArmCommand(self._position, velocity if velocity is ZERO else self._fed(velocity))

    def take_notices(self) -> Sequence[object]:
        """Judges the newest cycle, too: its reply has left, and what comes of it is for the next one."""
        state = self._state
        if state is not None and not self._is_judged:
            self._is_judged = True
            if self._goal is not None:
                self._watch(self._goal, state)
            if self._goal is not None and self._partner.is_there:
                self._meet_partner(self._goal, state)
            if state.time >= self._feedback_due:
                self._give_feedback(state)
        if not self._notices:
            return ()
        notices, self._notices = self._notices, []
        return notices

    @property
    def reference(self) -> Joints | None:
        return self._position

    def _has_come_to_rest(self, calming: Calming, state: ArmState) -> bool:
        self._rest_at(state.planned)
        is_over = calming.is_over(state)
        if is_over:
            self._calming = None
        return is_over

    @property
    def _pace(self) -> float:
        """How fast time goes by on a trajectory."""
        return self._rate * self._speed.value

    def _advance(self, dt: float) -> None:
        """Time goes by for what is followed; braking and waiting, for the begin or at the goal, take their time."""
        if self._goal is None or self._goal.is_cancelled:
            self._time += dt
            return
        if self._rate != self._scale:
            change = _SCALING_RATE * dt
            self._rate += max(-change, min(change, self._scale - self._rate))
        self._time += dt * self._pace if self._goal.begin <= self._time < self._goal.end else dt

    def _fed(self, velocity: Joints) -> Joints:
        share = self._settings.feedforward
        if self._goal is not None and not self._goal.is_cancelled:
            share *= self._pace
        return velocity if share == 1.0 else _scaled(velocity, share)

    def _prepared(self, order: FollowTrajectory, state: ArmState | None) -> tuple[Spline, float]:
        """The whole way, and the time on it that the newest command belongs to."""
        if state is None:
            raise refused(f"the {self._side.word} arm cannot be heard; start EGM first.")
        if self._calming is not None and max(map(abs, state.velocity)) > STANDING:
            raise refused("the arm still moves from before this controller was activated; wait until it stands.")
        if self._checked is not None and self._checked[0] is order and self._checked[1] is state:
            return self._checked[2:]
        plan, settings = order.plan, self._settings
        if plan.side is not self._side:
            raise refused(
                f"it is planned for the {plan.side.word} arm; this controller moves the {self._side.word} one."
            )
        if any(isnan(value) for value in order.tolerances.values):
            raise refused("a tolerance is nan; give a number, 0 for the controller's own, -1 for none.")
        now = 0.0 if plan.start is None else state.time - plan.start + settings.lookahead
        late = now - settings.lookahead - plan.spline.end
        if late > 0.0:
            raise refused(
                f"it ended {late:.3f} s ago; send it before its end, or with the stamp 0 to start at once.",
                ResultCode.OLD_HEADER_TIMESTAMP,
            )
        setpoint = self._source.setpoint(self._time)
        if self._is_braking:  # in the trajectory's time from here on
            setpoint = setpoint.unscaled(self._speed.value)
        if now > 0.0:
            now *= self._speed.value
        spline = join(plan, setpoint, now, self._limits, settings.start_tolerance)
        self._checked = (order, state, spline, now)
        return spline, now

    def _follow(self, order: FollowTrajectory, spline: Spline, now: float) -> None:
        assert self._state is not None
        self._end(Outcome.ABORTED, ResultCode.INVALID_GOAL, "A newer trajectory has replaced this one.", tells=False)
        if isinstance(self._source, _Brake):
            self._rate = 1.0 if self._is_braking else self._scale
        begin = self._state.time if order.plan.start is None else max(self._state.time, order.plan.start)
        self._goal = TrajectoryGoal(
            order.goal, self._names, spline, self._settings.bounds_with(order.tolerances), begin
        )
        self._source, self._time, self._checked, self._calming = Walk(spline), now, None, None

    def _cancel(self, order: CancelTrajectory) -> None:
        goal = self._goal
        if goal is None or goal.is_cancelled or order.goal not in (None, goal.number):
            return
        goal.phase = Phase.CANCELED
        self._brake()

    def _watch(self, goal: TrajectoryGoal, state: ArmState) -> None:
        if goal.is_cancelled:
            if isinstance(self._source, _Brake) and self._time >= self._source.duration:
                self._end(Outcome.CANCELED, ResultCode.SUCCESSFUL, "The motion was cancelled; the arm is at rest.")
            return
        if not goal.first and self._time > goal.begin:
            goal.first = state.time
        time = self._time - self._settings.lookahead * self._pace
        if self._pace != self._judged_pace:
            self._judged_pace, self._paced_at = self._pace, state.time
        is_steady = state.time - self._paced_at > _SETTLING
        violation = goal.judge(time, state, self._pace if is_steady else None)
        if violation is not None:
            self._abort(*violation)
        elif goal.phase is Phase.REACHED and not self._partner.is_there:
            self._succeed()

    def _meet_partner(self, goal: TrajectoryGoal, state: ArmState) -> None:
        ours = self._report(goal, state)
        self._partner.tell(ours)
        theirs = self._partner.hear()
        problem = goal.compare(ours, theirs, self._pace)
        if problem is not None:
            self._abort(*problem)
        elif theirs is not None and theirs.goal == goal.number:
            if theirs.phase is Phase.CANCELED:
                self._cancel(CancelTrajectory(goal.number))
            elif goal.phase is Phase.REACHED and theirs.phase in (Phase.REACHED, Phase.SUCCEEDED):
                self._succeed()

    def _report(self, goal: TrajectoryGoal, state: ArmState, code: int = 0) -> PartnerReport:
        return PartnerReport(goal.number, goal.phase, state.time, goal.first, self._time, code)

    def _succeed(self) -> None:
        self._end(Outcome.SUCCEEDED, ResultCode.SUCCESSFUL, "The goal is reached.")
        self._rest_at(self._position)

    def _abort(self, code: ResultCode, sentence: str) -> None:
        self._brake()
        self._end(Outcome.ABORTED, code, sentence)

    def _end(self, outcome: Outcome, code: ResultCode, sentence: str, *, tells: bool = True) -> None:
        """The motion is over for whoever waits for it; a partner that goes over to the same new one is not told."""
        goal, self._goal = self._goal, None
        if goal is None:
            return
        goal.phase = Phase[outcome.name]
        skew = goal.skew.skew if self._partner.is_there else None
        self._notices.append(TrajectoryEnded(goal.number, outcome, code, sentence, skew))
        if tells and self._state is not None:
            self._partner.tell(self._report(goal, self._state, code))

    def _brake(self) -> None:
        """From what the arm is told now, at the speed time goes by."""
        setpoint = self._source.setpoint(self._time)
        if self._goal is not None and not isinstance(self._source, _Brake):
            setpoint = setpoint.scaled(self._pace)
        self._brake_from(setpoint)

    @property
    def _is_braking(self) -> bool:
        return isinstance(self._source, _Brake) and self._time < self._source.duration

    def _brake_from(self, setpoint: Setpoint) -> None:
        softer = joints([_BRAKE_SHARE * each for each in self._limits.jerk])
        strength = joints([_BRAKE_SHARE * each for each in self._settings.deceleration])
        self._source = _Brake(stop(setpoint, replace(self._limits, acceleration=strength, jerk=softer)))
        self._time, self._position = 0.0, setpoint.position

    def _rest_at(self, position: Joints) -> None:
        self._source = _resting(position)
        self._time, self._position = 0.0, position

    def _give_feedback(self, state: ArmState) -> None:
        goal, source = self._goal, self._source
        if state.time - self._feedback_due > self._settings.feedback_period:
            self._feedback_due = state.time
        self._feedback_due += self._settings.feedback_period
        time = self._time - self._settings.lookahead * self._pace if goal is not None else self._time
        desired, velocity = source.motion(time)
        if goal is not None and not goal.is_cancelled and self._pace != 1.0:
            velocity = _scaled(velocity, self._pace)
        number, skew = (goal.number, goal.skew.skew) if goal is not None else (0, Skew())
        put_feedback(
            self._feedback,
            TrajectoryFeedback(
                number, state.time, time, self._pace, skew, desired, velocity, state.position, state.velocity
            ),
        )


def _resting(position: Joints) -> Walk:
    return Walk(Spline(Pieces(), TrajectoryPoint(0.0, position)))


def _scaled(values: Joints, factor: float) -> Joints:
    return cast("Joints", tuple([value * factor for value in values]))
