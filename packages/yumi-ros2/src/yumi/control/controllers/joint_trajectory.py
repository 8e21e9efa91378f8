"""The joint trajectory controller: follows splines in step with the arm's own delay.

The arm is commanded to be somewhere ``lookahead`` before it is due there, and its speed beside its position, so that
the robot's own loop has no error left to make speed of (reference/egm.md §6.1). What is desired of the arm is therefore
the trajectory a ``lookahead`` ago; the measured position is judged by that.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import inf, isnan
from typing import Protocol

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused, TrajectoryRefused
from abb_protocols.robot.joints import (
    YUMI_LIMITS,
    ZERO_JOINTS,
    ArmCommand,
    ArmState,
    JointLimits,
    Joints,
    Side,
    joint_names,
    joints,
)
from abb_runtime.parameters import Parameter, Values
from yumi.control.chunk_commands import ChunksExhausted, ChunkTaken, FollowChunk
from yumi.control.controller import Controller, foreign_command
from yumi.control.controllers.trajectory_goal import TrajectoryGoal, TrajectoryPhase
from yumi.control.controllers.trajectory_parameters import TrajectorySettings, trajectory_parameters
from yumi.control.goals import Buffer
from yumi.control.motion.blending import blend
from yumi.control.motion.chunk_motion import ChunkMotion, join_chunk
from yumi.control.motion.point_motion import PointMotion, point_stop
from yumi.control.motion.robot_response import STANDING
from yumi.control.motion.setpoint import Setpoint
from yumi.control.motion.spline import Segment, Segments, Spline, SplineSampler, TrajectoryPoint
from yumi.control.motion.spline_limits import check_motion
from yumi.control.motion.standstill import StandstillDetector
from yumi.control.place import Place
from yumi.control.shared_state import Skew, TrajectoryFeedback
from yumi.control.speed_scale import SpeedScale
from yumi.control.trajectory_commands import (
    CancelTrajectory,
    FollowTrajectory,
    ResultCode,
    ScaleSpeed,
    TrajectoryEnded,
    TrajectoryOutcome,
    trajectory_refused,
)

_TIMES = 64  # cycles: more than the longest lookahead

_SCALING_RATE = 4.0  # [1/s] a scale goes from 0 to 1 in a quarter of a second: no joint brakes too hard by it
_BRAKE_SHARE = 0.9  # of the limits: with what the robot's own loop adds, a command at the limits is beyond them

_SETTLING = 0.1  # [s] after a change of pace the measured speeds are those of the pace before


class _Source(Protocol):
    """Where the commanded motion comes from: a spline, chunks, a tool stream, or a motion to rest."""

    def motion(self, time: float) -> tuple[Joints, Joints]: ...

    def setpoint(self, time: float) -> Setpoint: ...


class JointTrajectoryController(Controller):
    """Follows one trajectory at a time; a new one replaces it, from whatever the arm is commanded then.

    Or it follows chunks, each of which replaces what has not been executed yet of those before; where their points are
    exhausted the arm brakes from the same cycle on, and holds.

    Commands come by :meth:`receive`; each motion's end is a report.

    Args:
        side: its arm.
        feedback: where others see how it follows.
        limits: what the joints may do.
        speed: the factor on the arm's speed; time on a trajectory goes by slower by it.
        halves: controllers of this name that are active, by arm; shared by both.
    """

    kind = "joint_trajectory_controller/JointTrajectoryController"

    def __init__(
        self,
        side: Side,
        feedback: Buffer[TrajectoryFeedback],
        limits: JointLimits = YUMI_LIMITS,
        speed: SpeedScale | None = None,
        halves: dict[Side, object] | None = None,
    ) -> None:
        self._side = side
        self._halves = {} if halves is None else halves
        self._names = joint_names(side)
        self._limits = limits
        self._feedback = feedback
        self._speed = speed or SpeedScale()
        defaults = {each.name: each.default for each in self.parameters(self._names)}
        self._settings = TrajectorySettings.of(defaults, self._names, limits.acceleration)
        self._scale = self._rate = self._settings.scale
        self._reports: list[object] = []
        self._goal: TrajectoryGoal | None = None
        self._state: ArmState | None = None
        self._checked: tuple[FollowTrajectory, ArmState, _Source, Spline, float] | None = None
        self._is_of_both = False  # the last chunk, whose sender leads the arm still
        self._must_brake = False  # in the next cycle, if it is on chunks then
        self._checked_chunk: tuple[FollowChunk, ArmState, _Source, ChunkMotion, float, float] | None = None
        self._feedback_due = -inf
        self._standstill: StandstillDetector | None = None
        self._is_judged = True
        self._judged_pace, self._paced_at = 1.0, -inf
        self._judged_segment: Segment | None = None
        self._source: _Source = _resting(ZERO_JOINTS)
        self._time = 0.0
        self._times: deque[tuple[float, float]] = deque(maxlen=_TIMES)  # of the last cycles, and on the trajectory [s]
        self._position = self._velocity = ZERO_JOINTS

    @classmethod
    def make(cls, place: Place) -> JointTrajectoryController:
        return cls(place.side, place.buffers.trajectory, place.limits, place.speed, place.halves)

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
        self._hold(state)
        self._is_of_both = False
        self._halves[self._side] = self

    def deactivate(self) -> None:
        self._leave_chunks()
        self._end(TrajectoryOutcome.ABORTED, ResultCode.INVALID_GOAL, message("controller_deactivated"))
        self._rest_at(self._position)
        self._halves.pop(self._side, None)

    def check(self, command: object, state: ArmState | None) -> None:
        if isinstance(command, FollowTrajectory):
            self._check_plan(command, state)
        elif isinstance(command, FollowChunk):
            self._check_chunk(command, state)
        elif isinstance(command, ScaleSpeed):
            if not 0.0 <= command.factor <= 1.0:
                raise CommandRefused(message("speed_scaling_factor_out_of_range", factor=command.factor))
        elif not isinstance(command, CancelTrajectory):
            raise foreign_command(self, command, FollowTrajectory, FollowChunk, ScaleSpeed, CancelTrajectory)

    def receive(self, command: object, state: ArmState | None) -> ChunkTaken | None:
        self.check(command, state)
        if isinstance(command, FollowTrajectory):
            self._follow(command)
        elif isinstance(command, FollowChunk):
            return self._follow_chunk()
        elif isinstance(command, ScaleSpeed):
            self._scale = command.factor
        elif isinstance(command, CancelTrajectory):
            self._cancel(command)
        return None

    def update(self, state: ArmState) -> ArmCommand | None:
        self._state = state
        if self._must_brake:
            self._must_brake = False
            self._brake_on_chunks()
        if self._is_braking and self._is_held_back(state):
            self._hold(state)
        if self._standstill is not None:
            self._rest_at(self.sent.position or state.position)
            if not self._standstill.is_over(state):
                return None
            self._standstill = None
        goal, dt, share = self._goal, state.dt, self._settings.feedforward
        is_followed = goal is not None and not goal.is_cancelled
        if not is_followed and not isinstance(self._source, ChunkMotion):
            self._time += dt
        else:
            # Time goes by for what is followed; waiting, for the begin or at the goal, takes its time.
            if self._rate != self._scale:
                change = _SCALING_RATE * dt
                self._rate += max(-change, min(change, self._scale - self._rate))
            self._time += dt * self._pace if goal is None or goal.begin <= self._time < goal.end else dt
            if not isinstance(self._source, ChunkMotion) or not self._brake_at_end(self._source, state):
                share *= self._pace
            elif self._standstill is not None:
                return None
        self._times.append((state.time, self._time))
        self._position, velocity = self._source.motion(self._time)
        self._is_judged = False
        if share == 0.0:
            velocity = ZERO_JOINTS
        self._velocity = (
            velocity if velocity is ZERO_JOINTS or share == 1.0 else tuple([share * each for each in velocity])
        )
        return ArmCommand(self._position, self._velocity)

    def note_withheld(self, position: Joints) -> None:
        if self._goal is None and not self._is_braking and not isinstance(self._source, ChunkMotion):
            self._rest_at(position)

    def take_reports(self) -> Sequence[object]:
        """Judges the newest cycle, too: its reply has left, and what comes of it is for the next one."""
        state = self._state
        if state is not None and not self._is_judged:
            self._is_judged = True
            if self._goal is not None:
                self._watch(self._goal, state)
            if self._goal is not None:
                self._judge_segment()
            if self._goal is not None:
                self._compare_arms(self._goal, state)
            if state.time >= self._feedback_due:
                self._give_feedback(state)
        reports, self._reports = self._reports, []
        return reports

    def is_idle(self, now: float) -> bool:
        is_at_rest = self._standstill is None and not self._is_braking and not isinstance(self._source, ChunkMotion)
        return self._goal is None and is_at_rest

    @property
    def reference(self) -> Joints | None:
        return self._position

    @property
    def _pace(self) -> float:
        """How fast time goes by on a trajectory."""
        return self._rate * self._speed.value

    def _check_plan(self, command: FollowTrajectory, state: ArmState | None) -> None:
        """Judge a plan, and keep the whole way with the time on it that the newest command belongs to.

        What is left is what only this process can judge: the driver has checked the plan itself.
        """
        state, known = self._checked_state(state), self._checked
        if known is not None and known[0] is command and known[1] is state and known[2] is self._source:
            return
        plan, settings = command.plan, self._settings
        if plan.side is not self._side:
            raise trajectory_refused(message("trajectory_of_other_arm", arm=plan.side.word, own_arm=self._side.word))
        if plan.left_out and not settings.is_partial_allowed:
            raise trajectory_refused(message("trajectory_is_partial", missing=plan.left_out), ResultCode.INVALID_JOINTS)
        if any(isnan(value) for value in command.tolerances.values):
            raise trajectory_refused(message("tolerance_not_a_number"))
        now = self._time_at_once(state) if plan.start is None else state.time - plan.start + settings.lookahead
        late = now - settings.lookahead - plan.spline.end
        if late > 0.0:
            raise trajectory_refused(message("trajectory_is_over", late=late), ResultCode.OLD_HEADER_TIMESTAMP)
        setpoint = self._source.setpoint(self._time)
        if self._is_braking:  # in the trajectory's time from here on
            setpoint = setpoint.unscaled(self._speed.value)
        if now > 0.0:
            now *= self._speed.value
        spline = blend(plan, setpoint, now, self._limits, settings.start_tolerance)
        self._checked = (command, state, self._source, spline, now)

    def _checked_state(self, state: ArmState | None) -> ArmState:
        """The state of an arm that may follow what is new; raises TrajectoryRefused for another one."""
        if state is None:
            raise trajectory_refused(message("arm_without_egm", arm=self._side.word))
        if self._standstill is not None and max(map(abs, state.velocity)) > STANDING:
            raise trajectory_refused(message("trajectory_while_arm_moves"))
        return state

    def _check_chunk(self, command: FollowChunk, state: ArmState | None) -> None:
        """Judge a chunk, and keep the motion that goes on along it, with the time on it and its pace."""
        state, known = self._checked_state(state), self._checked_chunk
        if command.is_of_both and self._side.other not in self._halves:
            raise trajectory_refused(message("chunks_taken_over", arm=self._side.other.word))
        if known is not None and known[0] is command and known[1] is state and known[2] is self._source:
            return
        before: ChunkMotion | Setpoint
        if isinstance(self._source, ChunkMotion):
            pace, time, before = self._pace, self._time, self._source
        else:
            pace, time, before = self._pace, 0.0, self._source.setpoint(self._time)
            if self._is_braking:  # in the chunk's time from here on
                pace = self._speed.value
                before = before.scaled(1.0 / pace)
        shift = time + (command.start - state.time - self._settings.lookahead) * pace
        motion = join_chunk(command, shift, before, time, self._names, self._limits)
        self._checked_chunk = (command, state, self._source, motion, time, pace)

    def _follow_chunk(self) -> ChunkTaken:
        assert self._checked_chunk is not None
        command, state, _, motion, time, pace = self._checked_chunk
        if not command.is_of_both:
            self._leave_chunks()
        self._is_of_both, self._must_brake = command.is_of_both, False
        self._end(TrajectoryOutcome.ABORTED, ResultCode.INVALID_GOAL, message("trajectory_replaced"), is_replaced=True)
        if not isinstance(self._source, ChunkMotion):
            if self._is_braking:
                self._rate = 1.0
            self._times.clear()
        self._source, self._time, self._checked_chunk, self._standstill = motion, time, None, None
        due = state.time + self._settings.lookahead

        def when(time: float) -> float:
            return due + (time - self._time) / pace if pace > 0.0 else inf

        return ChunkTaken(
            late=motion.late,
            replaced=motion.replaced,
            seam=when(motion.seam),
            joined=when(motion.joined),
            until=when(motion.end),
        )

    def _brake_at_end(self, source: ChunkMotion, state: ArmState) -> bool:
        """Brake in the cycle in which the points of all chunks are exhausted; whether it does."""
        if self._time < source.end:
            return False
        late, pace = self._time - source.end, self._pace
        self._reports.append(ChunksExhausted(source.number, state.time + self._settings.lookahead - late / pace))
        self._brake(source.at_end.scaled(pace))
        self._time = late / pace
        return True

    def _follow(self, command: FollowTrajectory) -> None:
        assert self._checked is not None
        spline, now = self._checked[3:]
        self._leave_chunks()
        self._end(TrajectoryOutcome.ABORTED, ResultCode.INVALID_GOAL, message("trajectory_replaced"), is_replaced=True)
        if isinstance(self._source, PointMotion):
            self._rate = 1.0 if self._is_braking else self._scale
        self._goal = TrajectoryGoal(
            command.goal, self._names, spline, command.tolerances.applied(self._settings.tolerances)
        )
        self._source, self._time, self._checked, self._standstill = SplineSampler(spline), now, None, None
        self._times.clear()

    def _cancel(self, command: CancelTrajectory) -> None:
        goal = self._goal
        number = self._source.number if isinstance(self._source, ChunkMotion) else None
        if command.goal in (None, number):
            self._leave_chunks()
            self._brake_on_chunks()
        if goal is None or goal.is_cancelled or command.goal not in (None, goal.number):
            return
        goal.phase = TrajectoryPhase.CANCELED
        self._brake()

    def _leave_chunks(self) -> None:
        """Who sends chunks leads the arm no further, had it any or not; the other arm, led by those of both, brakes.

        It does in its next cycle: a command of the same call was checked for how it moves now.
        """
        other = self._halves.get(self._side.other)
        self._is_of_both = False
        if isinstance(other, JointTrajectoryController) and other._is_of_both:
            other._is_of_both, other._must_brake = False, True

    def _brake_on_chunks(self) -> None:
        if isinstance(self._source, ChunkMotion):
            self._brake(self._source.setpoint(self._time).scaled(self._pace))

    def _watch(self, goal: TrajectoryGoal, state: ArmState) -> None:
        if goal.is_cancelled:
            if self._standstill is None and not self._is_braking:
                self._end(TrajectoryOutcome.CANCELED, ResultCode.SUCCESSFUL, message("motion_cancelled"))
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
        elif goal.phase is TrajectoryPhase.REACHED and self._may_succeed(goal):
            self._succeed()

    def _judge_segment(self) -> None:
        """The driver has checked the plan, and may err: a segment that was entered must keep the limits."""
        source = self._source
        if not isinstance(source, SplineSampler) or source.segment is self._judged_segment:
            return
        self._judged_segment = source.segment
        try:
            check_motion((source.segment,) if source.segment.rows else (), self._names, self._limits)
        except TrajectoryRefused as error:
            self._abort(ResultCode.INVALID_GOAL, error.said)

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
        self._end(TrajectoryOutcome.SUCCEEDED, ResultCode.SUCCESSFUL, message("goal_reached"))
        self._rest_at(self._position)

    def _abort(self, code: ResultCode, said: Message) -> None:
        self._brake()
        self._end(TrajectoryOutcome.ABORTED, code, said)

    def _end(self, outcome: TrajectoryOutcome, code: ResultCode, said: Message, *, is_replaced: bool = False) -> None:
        """The motion is over for what waits for it; ``is_replaced``: the arm goes on with a newer one.

        Feedback with goal 0 is written before the report: a client may ask for its next motion at once.
        """
        goal, self._goal = self._goal, None
        if goal is not None:
            if self._state is not None and not is_replaced:
                self._feedback.write(self._feedback_of(self._state))
            self._reports.append(TrajectoryEnded(goal.number, outcome, code, said, self._skew))

    def _brake(self, setpoint: Setpoint | None = None) -> None:
        """From what the arm is commanded now, at the speed time goes by; held back, from what it is sent, by holding.

        Args:
            setpoint: how the arm is commanded, where that is not read from what it follows now.
        """
        state = self._state
        if state is not None and self._is_held_back(state):
            self._hold(state)  # what is withheld from the arm would be made up for as soon as its way is free
            return
        if setpoint is None:
            setpoint = self._source.setpoint(self._time)
            if self._goal is not None and not isinstance(self._source, PointMotion):
                setpoint = setpoint.scaled(self._pace)
        softer = joints([_BRAKE_SHARE * each for each in self._limits.jerk])
        strength = joints([_BRAKE_SHARE * each for each in self._settings.deceleration])
        self._source = point_stop(setpoint, replace(self._limits, acceleration=strength, jerk=softer))
        self._time, self._position = 0.0, setpoint.position
        self._times.clear()

    @property
    def _is_braking(self) -> bool:
        return isinstance(self._source, PointMotion) and self._time < self._source.duration

    def _is_held_back(self, state: ArmState) -> bool:
        return self.sent.is_held_back(self._position, self._velocity, state.planned)

    def _hold(self, state: ArmState) -> None:
        """Have the limiter bring the arm to rest, and rest there."""
        self._rest_at(self.sent.position or state.position)
        self._standstill = StandstillDetector(state, self.sent)

    def _rest_at(self, position: Joints) -> None:
        self._source = _resting(position)
        self._time, self._position, self._velocity = 0.0, position, ZERO_JOINTS
        self._times.clear()

    def _give_feedback(self, state: ArmState) -> None:
        if state.time - self._feedback_due > self._settings.feedback_period:
            self._feedback_due = state.time
        self._feedback_due += self._settings.feedback_period
        self._feedback.write(self._feedback_of(state))

    def _feedback_of(self, state: ArmState) -> TrajectoryFeedback:
        goal, source = self._goal, self._source
        is_on_chunks = isinstance(source, ChunkMotion)
        time = self._measured_time(state) if goal is not None or is_on_chunks else self._time
        desired, velocity = source.motion(time)
        if ((goal is not None and not goal.is_cancelled) or is_on_chunks) and self._pace != 1.0:
            velocity = tuple([self._pace * each for each in velocity])
        number, skew = (goal.number, self._skew or Skew()) if goal is not None else (0, Skew())
        if isinstance(source, ChunkMotion):
            number = source.number
        return TrajectoryFeedback(
            number,
            state.time,
            time,
            self._pace,
            skew,
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
