"""The last step before the network: no command leaves that a robot must never get.

The limiter refuses what is not a number, keeps positions inside the joint limits, and lets the command move only as
fast, and change its motion only as quickly, as the joints may, measured from the command sent before. To hold means to
come to rest, then to repeat the last command, not the measured position, which creeps under load.

It does not trust the session. Whatever a datagram says, as long as the robot may be following earlier commands the next
one goes on from the last. What the feedback is worth is decided in :mod:`yumi.control.feedback`, which commands the
robot follows in :mod:`yumi.control.references` (docs/explanation/decisions/0014-feedback-is-doubted.md).

Three parts, each for what it limits: :class:`PositionLimiter`, :class:`FeedForwardLimiter`, and :class:`SpeedScale` for
the factor ``speed_scale`` on the speed of whatever moves an arm.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import copysign, dist, hypot, inf, isfinite
from operator import sub

from yumi.control.collisions import ArmCollisionLimiter
from yumi.control.controller import Buffer
from yumi.control.feedback import DOUBTED, FeedbackCheck
from yumi.control.motion import (
    EGM_GAIN,
    SERVO_CYCLES,
    Setpoint,
    braking_path,
    fixed,
    largest_difference,
    ramp_speed,
    slower,
    speed_to_come,
    speed_to_stop,
    step_to_rest,
    step_towards,
)
from yumi.control.position_delay import PositionDelay
from yumi.control.references import ReferenceMonitor
from yumi.control.shared_state import Factor, Limited, Problem
from yumi.robot.joints import (
    CYCLE,
    JOINT_COUNT,
    ZERO,
    ArmCommand,
    ArmState,
    JointLimits,
    Joints,
    change_rate,
    joints,
    moved,
)

_ROUNDING = 1.0 + 1e-6  # a command that uses a limit fully is not refused for its last digit
_STANDS = 1e-6  # [rad] a command that moves less in a cycle stands
_CLOSE = 1e-9  # [rad] a joint may come to rest at the end of its range
_HOP = 1e-3  # [rad] beside something an arm goes by so much at once
_HOPS = 0.1  # [rad/s] while it is slower than this
_FOLLOWABLE = 0.96  # a goal nearly as fast as the joint, or nearly as strong, cannot be caught up with


class PositionLimiter:
    """The positions sent so far, and the next one: no joint exceeds its speed, acceleration or jerk.

    What is smooth enough passes unchanged; what is not is approached as fast as the limits allow. A joint never gets so
    fast that it could not stop before the end of its range. Velocity and acceleration are differences of positions,
    which is what the robot can make of them.

    Args:
        limits: of the joints.
    """

    def __init__(self, limits: JointLimits) -> None:
        self.limit(limits)
        self.rest_at(ZERO)

    @property
    def position(self) -> Joints:
        """The position sent last [rad], (7,)."""
        return self._sent.position

    def limit(self, limits: JointLimits) -> None:
        """Apply other limits from the next step on."""
        self._limits = limits
        # What the weakest joint may do, and how long the slowest one needs to build up its acceleration [s].
        self._weakest = min(limits.velocity), min(limits.acceleration), min(limits.jerk)
        self._longest_ramp = max(top / jerk for top, jerk in zip(limits.acceleration, limits.jerk, strict=True))

    def rest_at(self, position: Joints) -> None:
        """Begin again, at rest."""
        self._sent = Setpoint(position)
        self._goal = Setpoint(position)  # the desired position, with differences of its own
        # Of joints whose last step was planned: velocity and acceleration at its end, which the plan goes on from.
        self._planned: dict[int, tuple[float, float]] = {}
        self._chasing: frozenset[int] = frozenset()  # those of them that do not yet move as their goal does
        self._step_time = 0.0  # [s] of the last step
        self._motion: Setpoint | None = None  # see motion

    def next(self, desired: Joints, dt: float, elapsed: float) -> Joints:
        """``desired`` itself if a step there is smooth enough, else the next position towards it, within the limits.

        Each joint for itself: one whose own step is smooth enough takes it. A goal that moves is caught up with.

        Args:
            desired: the position [rad], (7,).
            dt: how long the joints may move [s].
            elapsed: since the position that was desired before [s]; longer than ``dt`` after a gap.
        """
        step, self._step_time, self._motion = self._step_to(desired, dt), dt, None
        is_late = () if self._is_gentle(step, dt) else [not self._is_smooth(i, step, dt) for i in range(JOINT_COUNT)]
        if not any(is_late):
            self._sent = self._goal = step
            self._planned = {}
            return desired
        goal = self._motion_of_goal(desired, dt, elapsed)
        # How the joints move now. Where only differences are known, the last one is half a step old.
        motion = [
            self._planned.get(index) or (velocity + 0.5 * acceleration * dt, acceleration)
            for index, (velocity, acceleration) in enumerate(zip(*self._sent[1:], strict=True))
        ]
        velocity, acceleration = map(fixed, zip(*motion, strict=True))
        now = Setpoint(self.position, velocity, acceleration)
        found = step_towards(now, goal, self._limits, dt, is_late)
        way = found or goal
        must_brake = [
            late and (found is None or not self._is_safe(index, *(values[index] for values in way)))
            for index, late in enumerate(is_late)
        ]
        # A joint that is not late takes its step; braking is possible from any state that is safe.
        brake = step_to_rest(now, self._limits, dt, must_brake) if any(must_brake) else way
        sources = [brake if brakes else way if late else goal for late, brakes in zip(is_late, must_brake, strict=True)]
        taken = Setpoint(*(fixed([each[field][i] for i, each in enumerate(sources)]) for field in range(3)))
        # The last resort, should the way to a target lead past the end of the range, or further away from it.
        self._sent = self._step_to(inside(taken.position, self._limits, self.position), dt)
        self._planned = {
            index: (taken.velocity[index], taken.acceleration[index]) for index, late in enumerate(is_late) if late
        }
        # A joint has arrived when what is left of the way is less than half a step may change.
        changes = [0.5 * jerk * dt for jerk in self._limits.jerk]
        self._chasing = frozenset(
            index
            for index in self._planned
            if abs(taken.position[index] - goal.position[index]) >= changes[index] * dt * dt
            or abs(taken.velocity[index] - goal.velocity[index]) >= changes[index] * dt
            or abs(taken.acceleration[index] - goal.acceleration[index]) >= changes[index]
        )
        return self.position

    def place_to_stop(self) -> Joints:
        """Where the motion so far comes to rest that brakes as hard as it may [rad], (7,), within the range."""
        limits = self._limits
        rows = zip(*self._sent, limits.acceleration, limits.jerk, strict=True)
        ends = joints([p + braking_path(v, a, top, jerk).end for p, v, a, top, jerk in rows])
        return inside(ends, limits, self.position)

    @property
    def motion(self) -> Setpoint:
        """The position sent last, and how it moves at the end of its step."""
        if self._motion is not None:  # asked for twice in a cycle
            return self._motion
        position, rates = self._sent.position, self._sent.acceleration
        speeds = moved(self._sent.velocity, rates, 0.5 * self._step_time)
        if self._planned:
            own = [self._planned.get(index, each) for index, each in enumerate(zip(speeds, rates, strict=True))]
            speeds, rates = map(fixed, zip(*own, strict=True))
        self._motion = Setpoint(position, speeds, rates) if any(speeds) or any(rates) else Setpoint(position)
        return self._motion

    def brake(self, dt: float) -> Joints:
        """The next position of joints that all brake as hard as they may, for ``dt`` [s]."""
        rest = step_to_rest(self.motion, self._limits, dt, [True] * JOINT_COUNT)
        self._sent = self._goal = self._step_to(inside(rest.position, self._limits, self.position), dt)
        self._planned = dict(enumerate(zip(rest.velocity, rest.acceleration, strict=True)))
        self._chasing = frozenset()
        self._step_time, self._motion = dt, None
        return self.position

    def stands(self, dt: float) -> bool:
        """Whether no joint has moved with the last step of ``dt`` [s], nor with the one before it.

        One step alone may be short because a joint turns round: to stop there would be a jerk.
        """
        _, velocity, acceleration = self._sent
        return hypot(*velocity) * dt < _STANDS and hypot(*acceleration) * dt * dt < _STANDS

    def _step_to(self, position: Joints, dt: float) -> Setpoint:
        """The step from the last position to this one: velocity and acceleration as differences."""
        last, before, _ = self._sent
        velocity = change_rate(position, last, dt)
        return Setpoint(position, velocity, change_rate(velocity, before, dt))

    def _is_gentle(self, step: Setpoint, dt: float) -> bool:
        """Whether no joint asks for more than the weakest one may do: nearly always so, and seen quickly."""
        (speed, top, jerk), limits = self._weakest, self._limits
        acceleration = hypot(*step.acceleration)
        fastest = max(map(abs, step.velocity)) + 0.5 * acceleration * dt + speed_to_come(acceleration, jerk)
        way = 0.5 * fastest * (fastest / top + 3.0 * self._longest_ramp)  # see speed_to_stop
        return (
            not self._chasing
            and fastest <= speed
            and acceleration <= top
            and dist(step.acceleration, self._sent.acceleration) <= jerk * dt
            and way < min(map(sub, step.position, limits.lower))
            and way < min(map(sub, limits.upper, step.position))
        )

    def _is_smooth(self, index: int, step: Setpoint, dt: float) -> bool:
        """Whether a joint may take this step, and go on from there."""
        limits, acceleration = self._limits, step.acceleration[index]
        return (
            index not in self._chasing
            and abs(step.velocity[index]) <= limits.velocity[index] * _ROUNDING
            and abs(acceleration) <= limits.acceleration[index] * _ROUNDING
            and abs(acceleration - self._sent.acceleration[index]) <= limits.jerk[index] * dt * _ROUNDING
            and self._is_safe(index, step.position[index], step.velocity[index] + 0.5 * acceleration * dt, acceleration)
        )

    def _is_safe(self, index: int, position: float, velocity: float, acceleration: float) -> bool:
        """Whether a joint that moves like this can still keep its speed, and brake before the end of its range."""
        limits = self._limits
        top, jerk = limits.acceleration[index], limits.jerk[index]
        speed, change = abs(velocity), speed_to_come(acceleration, jerk)
        if speed + (change if velocity * acceleration > 0.0 else 0.0) > limits.velocity[index] * _ROUNDING:
            return False
        # Nearly always it has more room than it could need, whatever its acceleration: see speed_to_stop.
        low, high, fastest = limits.lower[index] - _CLOSE, limits.upper[index] + _CLOSE, speed + change
        if 0.5 * fastest * (fastest / top + 3.0 * top / jerk) < min(position - low, high - position):
            return True
        lowest, highest, _ = braking_path(velocity, acceleration, top, jerk)
        return (lowest == 0.0 or position + lowest >= low) and (highest == 0.0 or position + highest <= high)

    def _motion_of_goal(self, desired: Joints, dt: float, elapsed: float) -> Setpoint:
        """The goals at the end of the step, with that of their motion which a joint can make use of.

        A goal that cannot be followed counts as resting; one whose last two steps contradict each other has no
        acceleration: that is noise, a stream with uneven steps, or a jump.
        """
        limits, last, before = self._limits, self._goal, self._goal.acceleration
        velocity = change_rate(desired, last.position, elapsed)
        acceleration = change_rate(velocity, last.velocity, elapsed)
        self._goal = Setpoint(desired, velocity, acceleration)
        speeds, rates = [0.0] * JOINT_COUNT, [0.0] * JOINT_COUNT
        for index, (speed, rate) in enumerate(zip(velocity, acceleration, strict=True)):
            fastest, top, jerk = limits.velocity[index], limits.acceleration[index], limits.jerk[index]
            # A jump is no motion. Towards the end of its range a joint must still be able to brake after its goal,
            # as its jerk and the length of a step allow.
            end = limits.upper[index] if speed > 0.0 else limits.lower[index]
            room = (end - last.position[index]) * copysign(1.0, speed)
            way = abs(speed) * (abs(speed) / top + 2.0 * top / jerk + 2.0 * dt)
            if abs(speed) > _FOLLOWABLE * fastest or way >= room:
                continue
            speeds[index] = speed
            if abs(rate) <= _FOLLOWABLE * top and abs(rate - before[index]) <= jerk * elapsed:
                speeds[index] = max(-_FOLLOWABLE * fastest, min(_FOLLOWABLE * fastest, speed + 0.5 * rate * dt))
                rates[index] = rate
        return Setpoint(desired, fixed(speeds), fixed(rates))


def inside(position: Joints, limits: JointLimits, last: Joints) -> Joints:
    """``position`` cut at the range; joints that were outside ``last`` may come back but not go further [rad], (7,)."""
    if limits.outside(position) is None:
        return position
    rows = zip(limits.lower, limits.upper, last, position, strict=True)
    return joints([max(min(low, old), min(max(high, old), new)) for low, high, old, new in rows])


_CORRECTED = 1.5  # times a joint's acceleration
_EXACT = 0.995  # of an acceleration: where the robot will report to be is not predicted better
_UNEXPECTED = 0.02  # [rad] a plan further from where it was led to than the robot's own cap on speeds explains
_REST = 1e-6  # [rad/s] slower than this, in two cycles one after the other, is no motion


def _reported(state: ArmState, later: float) -> list[float]:
    """Where a robot will report to be ``later`` [s] from now [rad], (7,): it is on the way to its plan."""
    share = min(1.0, later / (SERVO_CYCLES * CYCLE))
    return [now + share * (plan - now) for now, plan in zip(state.position, state.planned, strict=True)]


class FeedForwardLimiter:
    """The speeds fed forward to one arm so far, and the speeds the arm has by now.

    A robot in EGM plans to move at ``k · (position reference - reported position) + speed reference``, and uses a
    command a cycle after it was taken (reference/egm.md §6.1). Each of the two may be
    within the limits and their sum not: a position that runs ahead already asks for a speed. So the sum is what is kept
    within the joints' velocity, acceleration and jerk, and able to stop before the end of their ranges; a sum that is
    smooth passes unchanged.

    Args:
        limits: of the joints.
        gain: of the robot's position loop [1/s]; 0 where it follows speeds only.
        period: time between two states of the arm [s].

    Attributes:
        velocity: the speed sent last [rad/s], (7,).
        is_bounded: whether it is less than was desired.
    """

    def __init__(self, limits: JointLimits, gain: float = EGM_GAIN, period: float = CYCLE) -> None:
        self.velocity: Joints = ZERO
        self.is_bounded = False
        self._gain = gain
        self._used_after = (
            period + CYCLE
        )  # from a state to the use of its reply [s]: a period, and a cycle in the robot
        self._limits = limits
        self._is_feeding = False
        self._speeds = [0.0] * JOINT_COUNT
        self._rates = [0.0] * JOINT_COUNT
        self._places: list[float] = []
        self._state: ArmState | None = None
        self._position: Joints = ZERO
        self._position_before: Joints = ZERO

    @property
    def motion(self) -> Setpoint | None:
        """How the robot will move when it takes the last command; None where no speed is fed forward."""
        if not self._is_feeding or not self._places:
            return None
        return Setpoint(fixed(self._places), fixed(self._speeds), fixed(self._rates))

    def limit(self, limits: JointLimits) -> None:
        """Apply other limits from the next command on."""
        self._limits = limits

    def end(self) -> None:
        """Forget; no speed is fed forward from now on."""
        self.velocity, self._is_feeding, self._state = ZERO, False, None

    def resume(self, state: ArmState, position: Joints) -> None:
        """Go on from the motion of a robot that repeated the last command for a while.

        Args:
            state: of the robot by now.
            position: the position reference it got last [rad], (7,).
        """
        if self._is_feeding:
            speeds = zip(self._led(position, _reported(state, CYCLE)), self.velocity, strict=True)
            self._speeds, self._rates = [led + fed for led, fed in speeds], [0.0] * JOINT_COUNT
        elif self._state is not None:
            # A speed that sets in now must not take the way since the last known state for the motion of one cycle.
            self._state, self._position, self._position_before = state, position, position

    def follow(self, speeds: list[float], dt: float) -> None:
        """Come to the motion of a robot that does not follow the last commands: ``speeds`` [rad/s] of its joints.

        Within some cycles, as it may follow them all the same, and its reports be late.
        """
        if self._is_feeding:
            rows = zip(speeds, self._speeds, self._limits.acceleration, strict=True)
            steps = [(speed, old, _CORRECTED * top * dt) for speed, old, top in rows]
            self._speeds = [max(old - most, min(old + most, speed)) for speed, old, most in steps]
            self._rates = [0.0] * JOINT_COUNT

    def observe(self, state: ArmState, position: Joints) -> None:
        """The robot's state and the position reference it got then [rad], (7,), after each reply.

        What it makes of them is the motion that a speed sets in upon.
        """
        self._position_before = position if self._state is None else self._position
        self._state, self._position = state, position

    def next(self, state: ArmState, position: Joints, desired: Joints, dt: float) -> Joints:
        """The speed that may be fed forward [rad/s], (7,), next to ``desired``.

        Args:
            state: of the robot; the last commands are not in it yet.
            position: the position reference that goes with it [rad], (7,), limited already.
            desired: the speed [rad/s], (7,).
            dt: time since the last command [s] > 0.
        """
        self.is_bounded = False
        if desired is ZERO and not self._is_feeding:
            return ZERO
        if not self._is_feeding:
            self._begin(state, dt)
        predicted = self._used_after
        if self._state is not None:
            rows = zip(self._state.planned, state.planned, self._speeds, strict=True)
            if max(abs(now - last - speed * dt) for last, now, speed in rows) > _UNEXPECTED:
                predicted = 0.0
                self.resume(state, self._position)
        limits, fed = self._limits, []
        # New lists: for a command that is not sent, the ones before are taken back.
        self._speeds, self._rates, self._places = self._speeds.copy(), self._rates.copy(), []
        reported = _reported(state, self._used_after)
        values = zip(state.planned, reported, position, desired, self._speeds, strict=True)
        for index, (now, then, ahead, speed, last) in enumerate(values):
            place = now + last * predicted  # where the robot will plan to be by then
            self._places.append(place)
            most, top, jerk = limits.velocity[index], limits.acceleration[index], limits.jerk[index]
            lead = self._gain * (ahead - then)
            goal = lead + max(-most, min(most, speed))
            room = limits.upper[index] - place if goal > 0.0 else place - limits.lower[index]
            total, self._rates[index] = ramp_speed(
                goal, last, self._rates[index], min(most, speed_to_stop(room, top, jerk)), _EXACT * top, jerk, dt
            )
            self._speeds[index] = total
            self.is_bounded = self.is_bounded or total != goal
            fed.append(total - lead)
        is_over = desired is ZERO and not self.is_bounded and max(map(abs, (*fed, *self.velocity))) < _REST
        self.velocity, self._is_feeding = (ZERO, False) if is_over else (joints(fed), True)
        return self.velocity

    def _begin(self, state: ArmState, dt: float) -> None:
        """Set in upon the motion that the position references before made."""
        if self._state is None:
            self._speeds, self._rates = [0.0] * JOINT_COUNT, [0.0] * JOINT_COUNT
            return
        self._speeds = self._led(self._position, state.position)
        before = self._led(self._position_before, self._state.position)
        rates = zip(self._speeds, before, self._limits.acceleration, strict=True)
        self._rates = [max(-top, min(top, (new - old) / dt)) for new, old, top in rates]

    def against(self, state: ArmState, position: Joints) -> Joints:
        """The speed that keeps the robot from following a position reference [rad/s], (7,)."""
        return joints([-speed for speed in self._led(position, _reported(state, self._used_after))])

    def _led(self, position: Joints, reported: Sequence[float]) -> list[float]:
        """How fast a robot that reports to be there sets out towards a position reference [rad/s]."""
        return [self._gain * (ahead - now) for ahead, now in zip(position, reported, strict=True)]


FEEDBACK_DELAY = 0.050
"""By how much the measured speed may be behind the robot's own, at most [s]."""

FOLLOWING = 5.0
"""Time constants of the robot's position loop after which it stands where its references lead it: what is left is less
than a hundredth of the lead. Until then a new session does not mean that the last command is of no effect."""

_TAKEN_AT_ONCE = 0.75  # of what a joint's speed may change in a cycle
_LATE = 1.25  # periods: the robot has repeated the last command meanwhile
_NO_TIME = 0.1  # of a period: nothing follows from how far something moved meanwhile
_NO_LEAD = 1e-4  # [rad] less than the joints' resolution
_SLIGHT_LEAD = 0.01  # [rad] a lead that a robot may follow at once
_PROBE = 1e-3  # [rad] the lead that shows whether a robot that ignored its references follows again
_SETTLING = 1.0  # [s] after which a command that is back settles no further
_NEAR = 0.02  # [rad] as near as a measured position is known
_CREEPS = 2e-5  # [rad] a command that follows the noise of an arm that stands moves less in a cycle


def _is_finite(command: ArmCommand) -> bool:
    return isfinite(sum(command.position) + sum(command.velocity))


@dataclass
class LimiterCounters:
    """Cycles in which the limiter changed something.

    Attributes:
        refused: commands with a value that is no finite number; the arm held instead.
        position_limited: commands cut at a joint's range.
        slowed: commands that would have exceeded a joint's speed, acceleration or jerk.
        implausible: measured or planned positions that no arm can have reached.
        kept_apart: commands that would have led an arm too near to something.
        feedforward_withheld: speeds not fed forward, since the robot would have coasted too near to something.
    """

    refused: int = 0
    position_limited: int = 0
    slowed: int = 0
    implausible: int = 0
    kept_apart: int = 0
    feedforward_withheld: int = 0


class Limiter:
    """Limits the commands of one arm.

    In each cycle: :meth:`check` the state, :meth:`limit` the command, and :meth:`observe` after the reply.

    Attributes:
        counters: what it changed so far.
        is_at_rest: whether the command stands, and does not lead the robot any more.
        is_waiting: whether the command waits since the robot follows an older one.

    Args:
        limits: of the joints; speeds, accelerations and jerks bound how the position sent moves, and how the robot
            moves where a speed is fed forward too.
        period: time between two states of the arm [s]. No command moves further than the joints may within this time,
            in which the robot takes a command, however long ago the one before was.
        gain: of the robot's position loop [1/s].
        other_arm: where the robot's other arm was measured last [rad], (7,); None where that is not known.
        collisions: what keeps the arm apart from the other one and from all else; None where nothing does.
        bandwidth: of the robot's low-pass filter on the speed [Hz]; 0 is none.
    """

    def __init__(
        self,
        limits: JointLimits,
        period: float = CYCLE,
        gain: float = EGM_GAIN,
        other_arm: Callable[[], Joints | None] = lambda: None,
        collisions: ArmCollisionLimiter | None = None,
        bandwidth: float = 0.0,
    ) -> None:
        self.counters = LimiterCounters()
        self.is_at_rest = True
        self.is_waiting = False
        self._period = period
        most = [_TAKEN_AT_ONCE * top * period for top in limits.acceleration]
        self._taken_at_once = joints(most)  # [rad/s] a joint may change its speed by when it follows again
        self._limits = limits
        self._near = min(limits.acceleration) * FEEDBACK_DELAY / EGM_GAIN  # a lead that any robot may have
        self._gain = gain
        self._following = FOLLOWING / (gain if gain > 0.0 else EGM_GAIN)
        self._positions = PositionLimiter(limits)
        self._speeds = FeedForwardLimiter(limits, gain, period)
        self._feedback = FeedbackCheck(limits, other_arm)
        self._references = ReferenceMonitor(gain, limits.velocity, period, bandwidth)
        self._collisions = collisions
        self._was_refused = False  # whether nothing but braking was accepted, and no command beside a boundary since
        self._session = 0
        self._sent_at = -inf
        self._state: ArmState | None = None  # what was made of the newest state
        self._is_new = False  # whether the robot does not follow yet, and the next command is the first of its session
        self._is_settling = False  # whether the arm is held, and its command not back where the arm is
        self._settling_for = 0.0  # [s]
        self._delay = PositionDelay()
        self._scale = self._scaled = FULL  # of speeds, and of positions
        self._scales = deque([FULL] * (SERVO_CYCLES + 2), SERVO_CYCLES + 2)  # of the last cycles
        self._stop_at: Joints | None = None  # where the arm holds while its feedback is implausible
        self._stop_within: tuple[Joints, Joints] | None = None  # where it may come to rest otherwise

    @property
    def problem(self) -> Problem:
        """Why the arm holds whatever is desired."""
        if self._feedback.is_lost:
            return Problem.IMPLAUSIBLE
        return Problem.REFERENCES_IGNORED if self._references.are_ignored else Problem.NONE

    @property
    def implausible_position(self) -> Joints:
        """The newest measured position that was not used [rad], (7,)."""
        return self._feedback.position

    @property
    def is_other_arm(self) -> bool:
        """Whether that is where the other arm is."""
        return self._feedback.is_other_arm

    @property
    def limited(self) -> Limited | None:
        """The parts that must not come nearer to each other, where that limits the arm in this cycle."""
        return self._collisions.limited if self._collisions else None

    def note_silence(self) -> None:
        """The arm's datagrams do not arrive any more: the other arm keeps clear of where this one may go."""
        if self._collisions is not None:
            self._collisions.connection_lost()

    def note_position(self, position: Joints) -> None:
        """The arm, whose datagrams do not arrive, was read from the controller to be at ``position`` [rad], (7,)."""
        if self._collisions is not None:
            self._collisions.note_measured(position)

    def scale_speed(self, scale: float) -> None:
        """Move no joint faster than ``scale`` times its limit: speeds from the next command on, positions later."""
        self._scale = scale
        self._speeds.limit(slower(self._limits, scale))

    def _scale_positions(self) -> None:
        """Positions are sent later than the speeds that go with them, so their limits come down later, too."""
        self._scales.append(self._scale)
        if self._scaled != self._scale:
            self._scaled = max(self._scales)
            self._positions.limit(slower(self._limits, self._scaled))

    def check(self, state: ArmState) -> ArmState | None:
        """What of ``state`` is plausible; to be called before :meth:`limit`, which takes what this returns.

        A position that no arm can have reached is replaced by the last plausible one, and the plan by where the
        references lead it, as long as it is in doubt.

        Returns:
            None where no reply is safe: it is open whether the robot still follows, or where it is.
        """
        if state.session != self._session:
            self._state = self._enter(state)
        elif self._feedback.is_plausible(state, self._positions.position):
            self._state = self._accept(state)
        else:
            # A plan that seemed to stand would hide that the lead becomes less as the robot goes on.
            last = self._feedback.reject(state)
            self._state = self._references.expected(last) or last
        self.counters.implausible = self._feedback.implausible
        is_back = state.session == self._session and state.dt <= 0.0 and not state.is_running
        if self._state is not None and is_back and dist(self._positions.position, state.planned) >= _SLIGHT_LEAD:
            # After a silence, of a robot that does not follow: were it to begin by now, it would take the lead at once.
            self._positions.rest_at(self._positions.position)
            self._state = None
        is_followed = state.is_running and not self._feedback.in_a_row  # else the plan may be the expected one
        self._references.compare(self._state if is_followed else None)
        return self._state

    def limit(self, state: ArmState, desired: ArmCommand | None) -> ArmCommand:
        """The command to send, next to ``desired``; None holds.

        The first command of a session in which the robot does not follow yet equals the measured position: a robot that
        begins to follow finds no step. So do the commands while the robot does not follow, once they have come there.
        """
        if state is not self._state:
            checked = self.check(state)
            if checked is None:  # repeat the last command; before the first one, where the robot is
                return self._begin(state) if self._sent_at == -inf else self._last
            state = checked
        command = self._limit(state, desired)
        if self._collisions is not None:
            self._collisions.sent(state.planned, self._positions.motion, self._speeds.motion)
        return command

    def _limit(self, state: ArmState, desired: ArmCommand | None) -> ArmCommand:
        """The command for a state that was checked."""
        self._sent_at = state.time
        if self._is_new:
            return self._begin(state)
        if state.dt <= 0.0:
            self._positions.rest_at(self._positions.position)  # without datagrams the command has stood still
        if not 0.0 < state.dt <= _LATE * self._period:
            self._speeds.resume(state, self._positions.position)
        dt = min(state.dt, self._period)
        if dt < _NO_TIME * self._period:
            return self._last
        if self._feedback.in_a_row >= DOUBTED or not state.is_running:
            self.is_waiting = False
            self._delay.clear()
            return self._come_to(state, dt)
        if desired is None or self._gain == 0.0 or not _is_finite(desired):
            self._delay.clear()
        else:
            desired = self._delay.next(desired, state.dt, self._positions.position)
        if self._has_to_wait():
            desired = self._place_to_wait()
            self._speeds.follow(self._references.speeds(state, self._references.followed), dt)
        if self._collisions is None:
            return self._next(state, desired, dt)
        return self._next_apart(self._collisions, state, desired, dt)

    def _has_to_wait(self) -> bool:
        """Whether the command waits in this cycle, for a robot that follows an older one."""
        references = self._references
        if self.is_waiting:  # until the robot follows a newer one, or the arm is held for following none
            self.is_waiting = references.is_repeating and self.problem is Problem.NONE
        elif self.problem is Problem.NONE and references.are_lost(self._taken_at_once):
            self.is_waiting = True
            self._positions.rest_at(self._positions.position)  # to brake would lead it on by what it does not follow
        return self.is_waiting

    def _place_to_wait(self) -> ArmCommand:
        """Where a command waits: as near to the one that the robot follows as it may set out to at once."""
        last, gain = self._positions.position, self._gain
        if gain == 0.0:
            return ArmCommand(last)
        rows = zip(self._references.followed.position, last, self._taken_at_once, strict=True)
        return ArmCommand(joints([p + max(-most / gain, min(most / gain, q - p)) for p, q, most in rows]))

    def _next_apart(
        self, collisions: ArmCollisionLimiter, state: ArmState, desired: ArmCommand | None, dt: float
    ) -> ArmCommand:
        """The same without coming too near to anything: what is not accepted is forgotten."""
        wanted = desired if desired is not None and _is_finite(desired) else None
        is_held = collisions.begin_cycle(wanted, state.position, dt)
        parts = vars(self._positions), vars(self._speeds), vars(self.counters)
        kept, settling_for = [part.copy() for part in parts], self._settling_for
        candidates = (desired,) if wanted is None else () if is_held else self._candidates(collisions, wanted)
        for index, candidate in enumerate(candidates):
            command = self._next(state, candidate, dt)
            feeds_forward = candidate is not None and candidate.velocity is not ZERO
            motions = self._positions.motion, self._speeds.motion
            if collisions.accepts(state.planned, *motions, feeds_forward=feeds_forward):
                if candidate is not None and wanted is not None:
                    # A robot that only follows later is not led elsewhere.
                    self.counters.kept_apart += candidate.position is not wanted.position
                    self.counters.feedforward_withheld += wanted.velocity is not ZERO and not feeds_forward
                self._was_refused = self._was_refused and index > 0
                return command
            for part, before in zip(parts, kept, strict=True):
                part.update(before)
            self._settling_for = settling_for
        self.counters.kept_apart += 1
        self.counters.refused += wanted is not desired
        self.is_at_rest, self._was_refused = False, not is_held
        last = self._positions.position
        position = last if self._positions.stands(dt) else self._positions.brake(dt)
        return ArmCommand(position, self._speeds.next(state, position, ZERO, dt))

    def _candidates(self, collisions: ArmCollisionLimiter, desired: ArmCommand) -> Iterator[ArmCommand]:
        """What may be sent in place of ``desired``, one after the other until one is accepted."""
        first = collisions.steered(desired)
        feeds_forward = first.velocity is not ZERO
        if not feeds_forward or collisions.may_feed_forward:
            yield first
        if feeds_forward and not collisions.may_feed_forward:
            yield ArmCommand(first.position)  # may go there, but the robot has to follow it late
        # What was compared has found the boundary; where that does not change the command, it is refused again.
        along = collisions.steered(desired)
        if along != first and not self._was_refused:
            yield along
        far = largest_difference(desired.position, self._positions.position)
        if far > _HOP and max(map(abs, self._positions.motion.velocity)) < _HOPS:
            # On its way to a far goal each joint is as quick as it may, which leads elsewhere than straight there.
            rows = zip(self._positions.position, desired.position, strict=True)
            yield ArmCommand(joints([now + (goal - now) * _HOP / far for now, goal in rows]))

    def _next(self, state: ArmState, desired: ArmCommand | None, dt: float) -> ArmCommand:
        """The command of a cycle in which the robot follows."""
        holds = desired is None or self._is_settling or self.problem is not Problem.NONE
        if desired is None or (holds and not self.is_waiting):
            command = self._hold(state, dt)
            self._settling_for += state.dt
            is_near = dist(command.position, state.position) < _SLIGHT_LEAD
            # The arm stands sooner than the command is back; what keeps shaking does so for its noise.
            self._is_settling = not (self.is_at_rest or (is_near and self._settling_for >= _SETTLING))
            return command
        self._settling_for = 0.0
        if not _is_finite(desired):
            self.counters.refused += 1
            return self._hold(state, dt)
        if not self._is_near(state) and not self.is_waiting:
            self.counters.slowed += 1
            return self._hold(state, dt)
        self.is_at_rest, self._stop_within = False, None
        goal = inside(desired.position, self._limits, self._positions.position)
        self.counters.position_limited += goal is not desired.position
        position = self._positions.next(goal, dt, state.dt)
        passes = position is goal
        velocity = self._speeds.next(state, position, desired.velocity, dt)
        # What is cut at the range and then passes is counted there already.
        self.counters.slowed += not passes or (self._speeds.is_bounded and goal is desired.position)
        return ArmCommand(position, velocity)

    def observe(self, state: ArmState) -> None:
        """After the reply to ``state``: what the next one depends on."""
        self._speeds.observe(state, self._positions.position)
        self._scale_positions()
        is_valid = state.is_running and not self._feedback.in_a_row
        self._references.observe(
            state, self._last, is_valid=is_valid, is_at_rest=self.is_at_rest, is_waiting=self.is_waiting
        )

    @property
    def _last(self) -> ArmCommand:
        return ArmCommand(self._positions.position, self._speeds.velocity)

    def _enter(self, state: ArmState) -> ArmState | None:
        """A session begins, where the robot is; as long as it may follow the last command, only from there on.

        Until then a command that leads it is not answered: a robot without a reply keeps its last reference.
        """
        last = self._last
        if not self._feedback.is_start(state, last.position):
            self._feedback.reject(state)
            return None
        may_follow = state.time - self._sent_at < self._following
        is_led = max(map(abs, self._references.speeds(state, last))) >= _SLIGHT_LEAD * EGM_GAIN
        if may_follow and (is_led or dist(last.position, state.planned) >= _SLIGHT_LEAD):
            self._accept(state)
            return None
        self._is_new = not may_follow
        return self._begin_session(state._replace(dt=0.0))  # nothing was sent since the last command

    def _begin_session(self, state: ArmState) -> ArmState:
        self._session, self._stop_within = state.session, None
        self.is_waiting = False
        self._delay.clear()
        self._references.begin(state)
        return self._accept(state)

    def _accept(self, state: ArmState) -> ArmState:
        if self._feedback.in_a_row:
            self._speeds.resume(state, self._positions.position)
            self._stop_at = self._stop_within = None
            if dist(self._positions.position, state.planned) >= _SLIGHT_LEAD:
                self.is_at_rest = False  # the command is not where the robot is
        return self._feedback.accept(state)

    def _begin(self, state: ArmState) -> ArmCommand:
        """The first command: where the robot is, at most at the end of its range."""
        position = inside(state.position, self._limits, self._limits.lower)
        self._positions.rest_at(position)
        self._speeds.end()
        self.is_at_rest, self._stop_within = True, None
        self._is_new = self._is_settling = False
        command = ArmCommand(position)
        self._references.begin(state, command)
        return command

    def _hold(self, state: ArmState, dt: float) -> ArmCommand:
        """Come to rest, then repeat the last command.

        A command runs ahead of the robot by its speed over the loop gain. It goes back to the robot within its limits,
        which takes longer than the robot needs to stop; what is left of the lead meanwhile, a speed against it cancels,
        as quickly as the robot may brake. So it comes to rest on its way, not where the lead points; and not beyond,
        since a command would run after a plan that is reported elsewhere than the robot's for as long as that follows.
        """
        last, resting = self._positions.position, self._place_to_rest(state)
        if self.is_at_rest and self._positions.stands(dt):  # it may creep after the noise of an arm that stood
            return ArmCommand(last, self._speeds.next(state, last, ZERO, dt))
        # A command that chased noise would never rest; a lead of some size shows whether it is taken.
        kept = _PROBE if self.problem is Problem.REFERENCES_IGNORED else _NO_LEAD
        self._stop_within = self._stop_within or self._places_to_stop(state)
        rows = zip(last, resting, *self._stop_within, strict=True)
        goal = joints([max(low, min(high, now + max(-kept, min(kept, ahead - now)))) for ahead, now, low, high in rows])
        position = self._go_to(goal, state, dt)
        is_led = largest_difference(position, goal) >= _NO_LEAD
        against = self._speeds.against(state, position) if is_led else ZERO
        velocity = self._speeds.next(state, position, against, dt)
        self.is_at_rest = not is_led and velocity is ZERO and self._positions.stands(dt)
        return ArmCommand(position, velocity)

    def _place_to_rest(self, state: ArmState) -> Joints:
        """The position that a robot goes on to report if it stops now [rad], (7,): nearer to its plan while it moves.

        Not that of its plan, which a load keeps elsewhere than what is reported: the robot's loop would go on.
        """
        rows = zip(state.position, state.velocity, state.planned, strict=True)
        ways = [(now, speed * SERVO_CYCLES * CYCLE, plan - now) for now, speed, plan in rows]
        return joints(
            [
                now + (min(way, left) if way > 0.0 < left else max(way, left) if way < 0.0 > left else 0.0)
                for now, way, left in ways
            ]
        )

    def _places_to_stop(self, state: ArmState) -> tuple[Joints, Joints]:
        """Between which positions a robot that is to stop comes to rest [rad], (7,).

        It brakes from where it plans to be, or follows the last command until that has stopped.
        """
        speeds, limits = self._references.speeds(state, self._last), self._limits
        rows = zip(state.planned, speeds, limits.velocity, limits.acceleration, limits.jerk, strict=True)
        ends = [now + braking_path(max(-most, min(most, speed)), 0.0, a, j).end for now, speed, most, a, j in rows]
        places = zip(state.planned, ends, self._positions.position, self._positions.place_to_stop(), strict=True)
        ranges = [(min(row) - _NEAR, max(row) + _NEAR) for row in places]
        return joints([low for low, _ in ranges]), joints([high for _, high in ranges])

    def _come_to(self, state: ArmState, dt: float) -> ArmCommand:
        """Go to where an arm is that does not follow: were it to follow after all, it would not feel a step.

        Where its position is implausible, come to rest where the command itself does.
        """
        goal, self._stop_within = state.position, None
        if self._feedback.in_a_row:
            self._stop_at = goal = self._stop_at or self._positions.place_to_stop()
        last, position = self._positions.position, self._go_to(goal, state, dt)
        self.is_at_rest = dist(position, goal) < _NEAR and dist(last, position) < _CREEPS
        return ArmCommand(position, self._speeds.next(state, position, ZERO, dt))

    def _go_to(self, goal: Joints, state: ArmState, dt: float) -> Joints:
        """Nearer to ``goal`` within the limits; never out of the range, or further out."""
        return self._positions.next(inside(goal, self._limits, self._positions.position), dt, state.dt)

    def _is_near(self, state: ArmState) -> bool:
        """Whether the robot's speed, and what its acceleration can add, explain how far the command is ahead.

        Else the robot does not get our commands, and all that piles up would reach it as one blow. A robot that follows
        speeds only makes nothing of a lead.
        """
        if self._gain == 0.0:
            return True
        last, planned = self._positions.position, state.planned
        if dist(last, planned) < self._near:
            return True
        rows = zip(last, planned, state.velocity, self._limits.acceleration, strict=True)
        # At a lead of speed over gain a robot seen at that speed has come to move so; more does not move it faster.
        return all(abs(last - now) < (abs(v) + top * FEEDBACK_DELAY) / EGM_GAIN for last, now, v, top in rows)


FULL = 1.0

_FASTEST = 4.0  # [1/s] at full speed a change takes two thirds of a joint's acceleration
_HARSHEST = 40.0  # [1/s²] and not half of its jerk


class SpeedScale:
    """One factor on speed for all controllers and for the limiter of one arm.

    Planned motions let time go by slower by it, along the same path; whatever else is commanded is limited to that
    factor of the joints' speeds. It changes gradually: no joint exceeds its acceleration or jerk, in the middle of a
    motion, too.

    Args:
        goal: where the factor to go to is set, above 0 up to 1; without one it stays at 1.

    Attributes:
        value: the factor in this cycle.
        highest: it is not above this, whatever is set.
    """

    def __init__(self, goal: Buffer[Factor] | None = None) -> None:
        self._goal = goal
        self._rate = 0.0
        self.highest = FULL
        self.value = self._set_value()

    def _set_value(self) -> float:
        newest = self._goal.read() if self._goal else None
        return min(newest[1].value if newest else FULL, self.highest)

    def jump(self) -> None:
        """Go to what is set at once, of an arm that does not move."""
        self.value, self._rate = self._set_value(), 0.0

    def advance(self, dt: float) -> bool:
        """Go on for ``dt`` [s]; to be called once between two cycles.

        Returns:
            Whether :attr:`value` has changed.
        """
        goal, before = self._set_value(), self.value
        if (goal == before and not self._rate) or dt <= 0.0:
            return False
        self.value, self._rate = ramp_speed(goal, before, self._rate, FULL, _FASTEST, _HARSHEST, dt)
        if min(before, goal) > self.value or self.value > max(before, goal):  # by the last digits of a ramp
            self.value, self._rate = goal, 0.0
        return True
