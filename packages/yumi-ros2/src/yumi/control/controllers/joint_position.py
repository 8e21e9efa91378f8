"""The joint position controller: follows a stream of joint positions.

It is the thesis's PID on the measured position. By default it commands
``measured + PID(goal - measured)``, with the parameters of ros2_control's ``control_toolbox``. With the robot's own
loop behind it the arm approaches the goal as a first-order lag of 1 / (5 s⁻¹ · P) (reference/egm.md §6.1).

With ``tracking.feed_forward`` it follows a stream of goals almost without lag. They are taken for samples of a motion:
where it will be when the robot gets there, ``tracking.delay`` from now, is predicted from the goals and their times,
followed within the joints' limits (:mod:`yumi.control.motion.tracking_filter`), and sent to the robot together with its
speed. The robot's own loop, whose lag the PID controller cannot remove, then has nothing left to close.

A goal with a delay is a point of a stream, which is followed in the same way and so late that nothing has to be
predicted: one period of the stream, in which its next point comes, and ``tracking.delay``. The arm is so far behind the
stamps of the points, whenever these arrive, and about as smooth as the source. With less delay the rest is predicted.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from math import copysign, inf, isnan

from abb_protocols.robot.joints import (
    CYCLE,
    JOINT_COUNT,
    YUMI_LIMITS,
    ZERO_JOINTS,
    ArmCommand,
    ArmState,
    JointLimits,
    Joints,
    joints,
)
from abb_runtime.parameters import Parameter, Values, flag_setting, number
from yumi.control.controller import CONTROLLER_IDLE_TIME, Controller
from yumi.control.goals import CONFIGURED_DELAY, LONGEST_DELAY, GoalBuffer, GoalInbox, GoalKind, SessionGoal
from yumi.control.motion.robot_response import RESPONSE_DELAY
from yumi.control.motion.setpoint import Setpoint
from yumi.control.motion.speed_motion import speeds_without_noise
from yumi.control.motion.target_predictor import LONGEST_STREAM_INTERVAL, TargetPredictor
from yumi.control.motion.tracking_filter import TrackingFilter
from yumi.control.place import Place
from yumi.control.sampled import Sampled
from yumi.control.speed_scale import SpeedScale
from yumi.control.stream_monitor import StreamMonitor

_NO_SPEED = 1e-6  # [rad/s] not worth feeding forward
_SHORTEST_PERIOD = 2.0 * CYCLE  # [s] a faster stream is followed with the delay of one of this period
_OTHER_PERIOD = 1.15  # a period that differs by less is still the same one
_WARP = 0.05  # by so much the time of a stream is stretched while its delay changes
_STANDS = 0.02  # [rad/s] a stream that is not faster when it ends has led to its last point

_PID = (
    Parameter("p", 1.2, 0.0, 2.0, "", "Proportional gain; oscillation begins near 2."),
    Parameter("i", 0.0, 0.0, 10.0, "1/s", "Integral gain."),
    Parameter("d", 0.0, 0.0, 0.5, "s", "Derivative gain, on the measured speed."),
    Parameter("i_clamp_max", 0.1, 0.0, 1.0, "rad", "Highest share of the integral in the command."),
    Parameter("i_clamp_min", -0.1, -1.0, 0.0, "rad", "Lowest share of the integral in the command."),
)
_TRACKING = (
    Parameter(
        "tracking.feed_forward",
        default=False,
        description="Follow a stream of goals with prediction and speed references instead of the PID controller.",
    ),
    Parameter(
        "tracking.delay", RESPONSE_DELAY, 0.0, 0.2, "s", "From a command to the motion it makes; how far to predict."
    ),
    Parameter("tracking.memory", 0.030, 0.005, 0.5, "s", "How long a goal counts; more against noise."),
    Parameter("tracking.stiffness", 40.0, 5.0, 100.0, "1/s", "How closely it is followed; less against noise."),
    Parameter("tracking.silence", 0.030, 0.010, 0.5, "s", "Without a goal for so long, the stream has ended."),
    Parameter(
        "stream.delay",
        CONFIGURED_DELAY,
        CONFIGURED_DELAY,
        LONGEST_DELAY,
        "s",
        "How late the arm follows the points of a stream; below 0: one period of the stream and tracking.delay.",
    ),
)


class JointPositionController(Controller):
    """Takes goals for all joints of an arm from a buffer.

    Args:
        goals: where goals arrive, see :mod:`yumi.control.goals`.
        limits: what the joints may do while they follow a stream.
        speed: the factor on their speeds.
    """

    kind = "yumi_controllers/JointPositionController"
    goal_kind = GoalKind.POSITION

    def __init__(self, goals: GoalBuffer, limits: JointLimits = YUMI_LIMITS, speed: SpeedScale | None = None) -> None:
        self._speed = speed or SpeedScale()
        self._inbox = GoalInbox(goals)
        self._joint_names: tuple[str, ...] = ()
        self._goal: Joints | None = None
        self._given_at = -inf
        self._p = self._i = self._d = ZERO_JOINTS
        self._i_clamp = (0.0, 0.0)
        self._is_proportional = True
        self._integrals = [0.0] * JOINT_COUNT
        self._predictor, self._filter = TargetPredictor(limits), TrackingFilter(limits)
        self._monitor, self._pending = StreamMonitor(limits), deque[SessionGoal]()
        self._delay = RESPONSE_DELAY
        self._stream_delay = self._asked_delay = CONFIGURED_DELAY
        self._period = self._late = 0.0  # of the stream, and how late it is followed now
        self._feeds_forward = self._is_tracking = self._is_stream = self._is_lost = self._is_held = False

    @classmethod
    def make(cls, place: Place) -> JointPositionController:
        return cls(place.buffers.goals, place.limits, place.speed)

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        self._joint_names = joint_names
        own = [
            Parameter(f"gains.{name}.{gain.name}", -1.0, -1.0, gain.highest, gain.unit, description)
            for name in joint_names
            for gain in _PID[:3]
            for description in (f"{gain.name} of this joint; -1 takes {gain.name} of all joints.",)
        ]
        return (*_PID, *own, *_TRACKING)

    def configure(self, values: Values) -> None:
        self._p, self._i, self._d = (self._gains_of(values, gain) for gain in "pid")
        self._i_clamp = (number(values, "i_clamp_min"), number(values, "i_clamp_max"))
        self._is_proportional = not any(self._i) and not any(self._d)
        if not any(self._i):
            self._integrals = [0.0] * JOINT_COUNT
        self._feeds_forward = flag_setting(values, "tracking.feed_forward")
        self._delay = number(values, "tracking.delay")
        self._predictor.memory = number(values, "tracking.memory")
        self._predictor.timeout = number(values, "tracking.silence")
        self._filter.stiffness = number(values, "tracking.stiffness")
        self._stream_delay = number(values, "stream.delay")

    def _gains_of(self, values: Values, gain: str) -> Joints:
        """One gain of all joints; a joint with one of its own has that."""
        own = [number(values, f"gains.{name}.{gain}") for name in self._joint_names]
        common = number(values, gain)
        return joints([common if value < 0.0 else value for value in own])

    def command_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(f"{name}/{kind}" for name in joint_names for kind in ("position", "velocity"))

    def activate(self, state: ArmState) -> None:
        self._goal, self._given_at = state.position, -inf
        self._inbox.forget()
        self._integrals = [0.0] * JOINT_COUNT
        self._is_tracking = self._is_stream = False

    def update(self, state: ArmState) -> ArmCommand | None:
        before = self._inbox.number
        goal = self._inbox.take(state.session, state.time)
        if goal is not None:
            self._goal, self._given_at = goal.position, state.time
            is_stream = not isnan(goal.delay)
            if is_stream is not self._is_stream:
                self._is_stream, self._is_tracking = is_stream, self._is_tracking and self._feeds_forward
                self._begin_stream()
            self._asked_delay = self._stream_delay if goal.delay < 0.0 else goal.delay
        if self._goal is None:
            return None
        if self._is_stream:
            return self._follow(state, goal, self._inbox.number - before)
        return self._track(state, goal) if self._feeds_forward else self._control(state, self._goal)

    @property
    def sampled(self) -> Sampled | None:
        is_simple = type(self) is JointPositionController and self._is_proportional
        is_simple = is_simple and not self._feeds_forward and not self._is_stream
        return self._inbox.sampled(self._goal, self._p) if is_simple and self._goal is not None else None

    def is_idle(self, now: float) -> bool:
        return now - self._given_at > CONTROLLER_IDLE_TIME

    @property
    def reference(self) -> Joints | None:
        return self._goal

    def take_reports(self) -> Sequence[object]:
        return self._monitor.take_reports()

    def _control(self, state: ArmState, goal: Joints) -> ArmCommand:
        """``p·e + ∫ i·e dt + d·de/dt``.

        The integral is kept after its gain, so that a change of the gain makes no step, and is bounded on both sides.
        The rate of the error is minus the measured speed, not differentiated: a goal that jumps gives no kick.
        """
        self._is_tracking = False
        if self._is_proportional:
            errors = zip(state.position, goal, self._p, strict=True)
            return ArmCommand(tuple([now + p * (to - now) for now, to, p in errors]))
        low, high = self._i_clamp
        rows = zip(self._integrals, self._i, goal, state.position, strict=True)
        self._integrals = [max(low, min(high, old + i * (to - now) * state.dt)) for old, i, to, now in rows]
        parts = zip(state.position, goal, state.velocity, self._p, self._integrals, self._d, strict=True)
        return ArmCommand(tuple([now + p * (to - now) + integral - d * v for now, to, v, p, integral, d in parts]))

    def _track(self, state: ArmState, goal: SessionGoal | None) -> ArmCommand | None:
        self._begin_tracking(state)
        if goal is not None:
            self._predictor.add(goal.position, goal.velocity, goal.time)
        if state.dt <= 0.0:
            return None
        return _sent(self._filter.step(self._predictor.at(state.time, self._delay), state.dt, self._speed.value))

    def _begin_tracking(self, state: ArmState) -> None:
        """From where the robot is, with the speed it has, to the goal there is; once."""
        if not self._is_tracking:
            self._is_tracking = True
            self._filter.begin(state.position, speeds_without_noise(state.velocity))
            self._predictor.rest_at(self._goal or state.position)

    def _begin_stream(self) -> None:
        self._pending.clear()
        self._monitor.begin()
        self._period, self._is_lost, self._is_held = 0.0, False, False

    def _follow(self, state: ArmState, goal: SessionGoal | None, points: int) -> ArmCommand | None:
        """The command for a stream, of which ``goal`` is the next point, and ``points`` have come since the last one.

        Its points wait until they are needed, which is one period before the arm has to be there.
        """
        monitor, now = self._monitor, state.time
        self._begin_tracking(state)
        before = monitor.newest
        is_next = goal is not None and goal.time > before
        if goal is not None and is_next:
            monitor.note_point(goal.position, goal.time, points, self._joint_names, now)
            self._pending.append(goal)
        self._set_lateness(state.dt)
        place = now + self._delay - self._late  # of the arm on the stream, by its stamps
        if is_next:
            # Who asks for less delay than a period has asked for a prediction beyond the newest point.
            is_enough = self._late >= self._delay + self._period
            is_connected = monitor.newest - before < LONGEST_STREAM_INTERVAL
            monitor.note_delay(self._late, place - before if is_enough and is_connected else 0.0, now)
        soon = place + max(self._period, _SHORTEST_PERIOD)
        while self._pending and self._pending[0].time <= soon:
            due = self._pending.popleft()
            self._predictor.add(due.position, due.velocity, due.time)
            self._is_lost = self._is_held = False
        if state.dt <= 0.0:
            return None
        if self._period and self._predictor.is_over(place) and not self._is_lost and self._predictor.speed > _STANDS:
            self._is_lost = True
            monitor.note_end(now)
        if self._is_lost:
            command = _sent(self._filter.brake(state.dt))
            # What the limiter withholds would be made up for as soon as the way is free.
            self._is_held = self._is_held or self.sent.is_held_back(*command, state.planned)
            if not self._is_held:
                return command
            self._is_tracking = False  # what comes begins from where the robot is then
            return None
        command = _sent(self._filter.step(self._predictor.at(place, 0.0), state.dt, self._speed.value))
        slow = self._filter.chasing
        monitor.note_limits(None if slow is None or not self._period else self._joint_names[slow], now)
        return command

    def _set_lateness(self, dt: float) -> None:
        """How late the stream is followed: at once as asked for at its begin, later gradually."""
        period, is_new = self._monitor.period, not self._period
        if not self._period / _OTHER_PERIOD <= period <= self._period * _OTHER_PERIOD:
            self._period = period
        wanted = self._asked_delay
        if wanted < 0.0:
            wanted = self._delay + max(self._period, _SHORTEST_PERIOD)
        change = wanted - self._late
        self._late = wanted if is_new else self._late + copysign(min(abs(change), _WARP * dt), change)


def _sent(motion: Setpoint) -> ArmCommand:
    position, velocity, _ = motion
    return ArmCommand(position, velocity if max(map(abs, velocity)) > _NO_SPEED else ZERO_JOINTS)
