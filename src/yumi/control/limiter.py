"""The last station before the wire: no command leaves that a robot must never see.

It refuses what is not a number, keeps positions inside the joint limits, and lets the command move only as fast, and
change its motion only as quickly, as the joints may, measured from the command admitted before. Hold means: come to
rest, then repeat the last admitted command, not the measured position, which creeps under load.

It does not trust the session. Whatever a datagram says, as long as the robot may be following earlier commands the next
one goes on from the last. A position that no arm can have reached is not believed, and where the robot does not follow
at all, its own plan shows it (docs/explanation/decisions/0014-feedback-is-doubted.md).

Shapes the way to a wanted position so that no joint exceeds its speed, acceleration and jerk.

What is smooth enough passes unchanged; what is not is approached as fast as the limits allow, by the online trajectory
generator Ruckig. A joint never gets so fast that it could not stop before the end of its range.

Most positions are smooth by far. An outlook, made after the reply, tells so by three distances before the next one;
only what it does not vouch for is looked at joint by joint.

Where a joint comes to that brakes as hard as its acceleration and its jerk allow.

How a wanted position moves, told from its last steps, as far as a joint that is behind can make use of it.

The factor on the speed of whatever moves an arm, as its control loop uses it: ``speed_scale``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import copysign, dist, hypot, inf, isfinite, sqrt
from typing import NamedTuple

from ruckig import ControlInterface, InputParameter, OutputParameter, Ruckig, Synchronization

from yumi.control.commands import Buffer
from yumi.control.motion import EGM_GAIN, FeedForward, ramped, slower, take_step
from yumi.control.shared_state import Factor, Problem
from yumi.robot.joints import CYCLE, JOINT_COUNT, YUMI_LIMITS, ZERO, ArmCommand, ArmState, JointLimits, Joints, joints


class Reach(NamedTuple):
    """How far a joint still goes until it stands, to either side of where it is [rad]; ``lowest`` ≤ 0 ≤ ``highest``."""

    lowest: float
    highest: float


def speed_to_come(acceleration: float, jerk: float) -> float:
    """By how much a joint's speed still changes while its acceleration is taken back to zero [rad/s], at least 0."""
    return acceleration * acceleration / (2.0 * jerk)


def braking_reach(velocity: float, acceleration: float, top: float, jerk: float) -> Reach:
    """The way to standstill from ``velocity`` [rad/s] and ``acceleration`` [rad/s²].

    Args:
        velocity: now.
        acceleration: now, at most ``top``.
        top: the joint's highest acceleration, > 0.
        jerk: its highest jerk [rad/s³], > 0.
    """
    left = speed_to_come(acceleration, jerk)
    if velocity + (left if acceleration > 0.0 else -left) < 0.0:
        lowest, highest = _reach_forwards(-velocity, -acceleration, top, jerk)
        return Reach(-highest, -lowest)
    return _reach_forwards(velocity, acceleration, top, jerk)


def _reach_forwards(velocity: float, acceleration: float, top: float, jerk: float) -> Reach:
    """The same for a joint that goes forwards when its acceleration is taken back.

    The way is that of a joint without acceleration, seen from the moment in which it has, or would have had, none.
    """
    speed, time = velocity + speed_to_come(acceleration, jerk), abs(acceleration) / jerk
    pause = sqrt(speed / jerk) if jerk * speed <= top * top else 0.5 * (speed / top + top / jerk)
    if acceleration >= 0.0:
        ahead = time * (velocity + time * (acceleration / 2.0 - time * jerk / 6.0))
    else:
        ahead = -time * (speed - time * time * jerk / 6.0)
    back = _way_to_turn(velocity, acceleration, jerk) if velocity < 0.0 else 0.0
    return Reach(back, speed * pause + ahead)


def _way_to_turn(velocity: float, acceleration: float, jerk: float) -> float:
    """How far a joint still goes backwards whose acceleration turns it around while it is taken back, < 0."""
    time = (acceleration - sqrt(max(acceleration * acceleration + 2.0 * jerk * velocity, 0.0))) / jerk
    return time * (velocity + time * (acceleration / 2.0 - time * jerk / 6.0))


_PACE = 0.9  # a goal that moves nearly as fast as the joint, or is nearly as strong, cannot be caught up with


class Goal(NamedTuple):
    """A joint's wanted position [rad], its velocity [rad/s] and acceleration [rad/s²] at the end of a step."""

    position: float
    velocity: float
    acceleration: float


class GoalMotion:
    """The motion of the wanted position of one arm.

    Args:
        limits: what the joints may do.
    """

    def __init__(self, limits: JointLimits) -> None:
        self._limits = limits
        self.rest_at(ZERO)

    def limit(self, limits: JointLimits) -> None:
        """Take other limits from the next step on."""
        self._limits = limits

    def rest_at(self, position: Joints) -> None:
        """Begin again, at rest."""
        self.note(position, ZERO, ZERO)

    def note(self, position: Joints, velocity: Joints, acceleration: Joints) -> None:
        """The wanted position was reached, with these differences of the joints' own."""
        self._position, self._velocity, self._acceleration = position, velocity, acceleration

    def move(self, position: Joints, dt: float, elapsed: float) -> list[Goal]:
        """The goals of the joints, of which ``position`` is wanted now.

        Args:
            position: what is wanted at the end of the step [rad], (7,).
            dt: how long the step is [s].
            elapsed: since the last position [s]; longer than ``dt`` after a gap.
        """
        before, last = self._acceleration, self._position
        velocity = joints([(new - old) / elapsed for old, new in zip(last, position, strict=True)])
        acceleration = joints([(new - old) / elapsed for old, new in zip(self._velocity, velocity, strict=True)])
        self.note(position, velocity, acceleration)
        return [
            self._goal(index, last[index], abs(acceleration[index] - before[index]) / elapsed, dt)
            for index in range(JOINT_COUNT)
        ]

    def _goal(self, index: int, last: float, change: float, dt: float) -> Goal:
        """At rest where it cannot be followed; without acceleration where two steps tell none that a joint has."""
        limits, position = self._limits, self._position[index]
        velocity, acceleration = self._velocity[index], self._acceleration[index]
        if not self._can_be_followed(index, last, velocity, dt):
            return Goal(position, 0.0, 0.0)
        if abs(acceleration) > _PACE * limits.acceleration[index] or change > limits.jerk[index]:
            return Goal(position, velocity, 0.0)  # noise, a stream with uneven steps, or a jump
        top = _PACE * limits.velocity[index]
        return Goal(position, max(-top, min(top, velocity + 0.5 * acceleration * dt)), acceleration)

    def _can_be_followed(self, index: int, last: float, velocity: float, dt: float) -> bool:
        """A jump is no motion; and towards the end of its range a joint must still be able to brake after its goal.

        Its jerk and the length of a step are taken into account.
        """
        limits, speed = self._limits, abs(velocity)
        top, jerk = limits.acceleration[index], limits.jerk[index]
        if speed > _PACE * limits.velocity[index]:
            return False
        end = limits.upper[index] if velocity > 0.0 else limits.lower[index]
        room = (end - last) * copysign(1.0, velocity)
        return speed * (speed / top + 2.0 * top / jerk + 2.0 * dt) < room


_ROUNDING = 1.0 + 1e-6  # a command that uses a limit fully is not refused for its last digit
_CAUTION = 0.99  # an outlook is for one period, a robot's clock tells another by its last digits
_NOWHERE = -1.0  # [rad] a distance that no step keeps
_CLOSE = 1e-9  # [rad] a joint may come to rest at the end of its range
_SAME_PERIOD = 1e-8  # [s] by so much; at full speed the command moves less by it than the caution allows


class _Outlook(NamedTuple):
    """Where the next position is smooth beyond doubt: near three points. Distances are over all joints together.

    Attributes:
        period: the time until then [s].
        free: distance from the last position at which no joint is too fast, or cannot stop in its range [rad].
        coasting: the position at constant speed [rad].
        accelerated: distance from it at which no joint accelerates too much [rad].
        steady: the position at constant acceleration [rad].
        jerked: distance from it at which no joint jerks too much [rad].
    """

    period: float
    free: float
    coasting: Joints
    accelerated: float
    steady: Joints
    jerked: float


class _Step(NamedTuple):
    """Where a joint is at the end of a step, and how it moves then; in [rad] and [s]."""

    position: float
    velocity: float
    acceleration: float


_Motion = tuple[float, float]
"""Velocity [rad/s] and acceleration [rad/s²] of a joint."""


class MotionShaper:
    """The motion of the commands admitted so far: position, velocity and acceleration of each joint.

    Velocity and acceleration are differences of positions, as whoever looks at the commands sees them.

    Args:
        limits: what the joints may do.
    """

    def __init__(self, limits: JointLimits) -> None:
        self.position: Joints = ZERO
        self._velocity: Joints = ZERO
        self._acceleration: Joints = ZERO
        self._goal = GoalMotion(limits)
        self._outlook: _Outlook | None = None
        self._glided: tuple[Joints, float] | None = None  # from where and for how long, not yet in the speeds
        self._planned: dict[int, _Motion] = {}  # of joints whose last step was planned: how they move at its end
        self._chasing: frozenset[int] = frozenset()  # those of them that do not yet move as their goal does
        self.limit(limits)
        self._generator = Ruckig(JOINT_COUNT, 0.004)
        self._input = InputParameter(JOINT_COUNT)
        self._output = OutputParameter(JOINT_COUNT)
        self._input.max_jerk = list(limits.jerk)
        self._input.target_position = [0.0] * JOINT_COUNT
        self._input.synchronization = Synchronization.No  # a joint that must wait does not make others wait
        self._brake = InputParameter(JOINT_COUNT)
        self._brake.control_interface = ControlInterface.Velocity
        self._brake.max_acceleration, self._brake.max_jerk = list(limits.acceleration), list(limits.jerk)
        self._brake.synchronization = Synchronization.No

    def limit(self, limits: JointLimits) -> None:
        """Take other limits from the next step on; accelerations and jerks stay what they were."""
        self._limits = limits
        self._bounds = (limits.lower, limits.upper, limits.velocity, limits.acceleration, limits.jerk)
        self._least = tuple(_CAUTION * min(each) for each in (limits.velocity, limits.acceleration, limits.jerk))
        self._goal.limit(limits)
        self._outlook = None

    def rest_at(self, position: Joints) -> None:
        """Begin again, at rest."""
        self.position = position
        self._velocity = self._acceleration = ZERO
        self._goal.rest_at(position)
        self._outlook = self._glided = None
        self._planned, self._chasing = {}, frozenset()

    def glides(self, wanted: Joints, dt: float) -> bool:
        """Go to ``wanted`` within ``dt`` [s] if that is smooth by far; tells whether it was. Needs an outlook."""
        view = self._outlook
        if (
            view is None
            or not -_SAME_PERIOD < dt - view.period < _SAME_PERIOD
            or not dist(wanted, self.position) <= view.free
            or not dist(wanted, view.coasting) <= view.accelerated
            or not dist(wanted, view.steady) <= view.jerked
        ):
            return False
        self._outlook, self._glided = None, (self.position, dt)
        self.position = wanted
        return True

    def look_ahead(self, dt: float) -> None:
        """Make the outlook on the position that comes ``dt`` [s] after the last; when there is time for it."""
        self._settle()
        if self._chasing:
            return
        slowest, weakest, gentlest = self._least
        coasting, steady, rooms = [], [], []
        rows = zip(self.position, self._velocity, self._acceleration, *self._bounds, strict=True)
        for p, v, a, low, high, speed, top, jerk in rows:
            coasting.append(p + v * dt)
            steady.append(p + v * dt + a * dt * dt)
            strongest = abs(a) + gentlest * dt
            fastest = abs(v) + strongest * dt + strongest * strongest / (2.0 * jerk)
            rooms.append(min(p - low, high - p) - _way_to_stop(fastest, top, jerk) if fastest < speed else _NOWHERE)
        self._outlook = _Outlook(
            period=dt,
            free=min(slowest * dt, *rooms),
            coasting=joints(coasting),
            accelerated=weakest * dt * dt,
            steady=joints(steady),
            jerked=gentlest * dt * dt * dt,
        )

    def passes(self, wanted: Joints, dt: float) -> bool:
        """Go to ``wanted`` within ``dt`` [s] if that is smooth enough; tells whether it was."""
        self._settle()
        velocity, acceleration = self._rates(wanted, dt)
        if not all(self._is_smooth(*each, dt) for each in self._rows(wanted, velocity, acceleration)):
            return False
        self.position, self._velocity, self._acceleration = wanted, velocity, acceleration
        self._goal.note(wanted, velocity, acceleration)
        self._outlook, self._planned = None, {}
        return True

    def approach(self, wanted: Joints, dt: float, elapsed: float) -> Joints:
        """Go towards ``wanted`` for ``dt`` [s] as fast as the limits allow; the position reached.

        Each joint for itself: one whose own way is smooth enough goes there at once. A wanted position that moves is
        caught up with: the way is planned as seen by someone who moves with it.

        Args:
            wanted: the position [rad], (7,).
            dt: how long the joints may move [s].
            elapsed: since the position that was wanted before [s]; longer than ``dt`` after a gap.
        """
        self._settle()
        velocity, acceleration = self._rates(wanted, dt)
        is_late = [not self._is_smooth(*each, dt) for each in self._rows(wanted, velocity, acceleration)]
        goals = self._goal.move(wanted, dt, elapsed)
        self._outlook = None
        motion = [self._planned.get(index) or self._estimate(index, dt) for index in range(JOINT_COUNT)]
        steps = self._steps_to(goals, motion, dt, is_late)
        must_brake = [late and not self._is_safe(index, *steps[index]) for index, late in enumerate(is_late)]
        if any(must_brake):
            brakes = self._steps_to_rest(motion, dt, must_brake)
            rows = zip(steps, brakes, must_brake, strict=True)
            steps = [brake if is_braking else step for step, brake, is_braking in rows]
        self._take(steps, goals, dt, is_late)
        return self.position

    def place_to_stop(self) -> Joints:
        """Where the motion so far comes to rest that brakes as hard as it may [rad], (7,), within the range."""
        self._settle()
        places = []
        rows = zip(self.position, self._velocity, self._acceleration, *self._bounds, strict=True)
        for now, velocity, acceleration, low, high, _, top, jerk in rows:
            lowest, highest = braking_reach(velocity, acceleration, top, jerk)
            places.append(max(min(low, now), min(max(high, now), now + (highest if velocity > 0.0 else lowest))))
        return joints(places)

    def _rates(self, position: Joints, dt: float) -> tuple[Joints, Joints]:
        """Velocity and acceleration of the step from the last position to this one, as differences."""
        velocity = joints([(new - old) / dt for old, new in zip(self.position, position, strict=True)])
        return velocity, joints([(new - old) / dt for old, new in zip(self._velocity, velocity, strict=True)])

    def _rows(
        self, position: Joints, velocity: Joints, acceleration: Joints
    ) -> Iterator[tuple[int, float, float, float]]:
        return zip(range(JOINT_COUNT), position, velocity, acceleration, strict=True)

    def _take(self, steps: list[_Step], goals: list[Goal], dt: float, is_late: list[bool]) -> None:
        """Take the steps; a joint on a planned way stays on it until it moves as its goal does."""
        position = self._kept_in_range(joints([step.position for step in steps]))
        self._velocity, self._acceleration = self._rates(position, dt)
        self._planned = {
            index: (step.velocity, step.acceleration) for index, step in enumerate(steps) if is_late[index]
        }
        self._chasing = frozenset(
            index for index in self._planned if not self._has_arrived(index, steps[index], goals[index], dt)
        )
        self.position = position

    def _has_arrived(self, index: int, step: _Step, goal: Goal, dt: float) -> bool:
        """Whether a joint moves as its goal does: what is left of the way is less than half a step may change."""
        change = 0.5 * self._limits.jerk[index] * dt
        return (
            abs(step.position - goal.position) < change * dt * dt
            and abs(step.velocity - goal.velocity) < change * dt
            and abs(step.acceleration - goal.acceleration) < change
        )

    def _settle(self) -> None:
        """Take the last glide into the speeds."""
        if self._glided is None:
            return
        before, dt = self._glided
        self._glided = None
        velocity = joints([(new - old) / dt for old, new in zip(before, self.position, strict=True)])
        steps = zip(self._velocity, velocity, strict=True)
        self._acceleration = joints([(new - old) / dt for old, new in steps])
        self._velocity = velocity
        self._goal.note(self.position, velocity, self._acceleration)
        self._planned = {}

    def _steps_to(self, goals: list[Goal], motion: list[_Motion], dt: float, is_late: list[bool]) -> list[_Step]:
        """A step of each joint on its quickest way to its goal, planned as seen from there at the end of the step.

        Joints that are not late go to their goals; if there is no way, those that are late brake.
        """
        given, output, limits = self._input, self._output, self._limits
        given.enabled = is_late
        given.current_position = [
            old - (goal.position - dt * (goal.velocity - 0.5 * dt * goal.acceleration))
            for old, goal in zip(self.position, goals, strict=True)
        ]
        rows = list(zip(motion, goals, strict=True))
        given.current_velocity = [now - (goal.velocity - dt * goal.acceleration) for (now, _), goal in rows]
        given.current_acceleration = [now - goal.acceleration for (_, now), goal in rows]
        given.max_velocity = [top - goal.velocity for top, goal in zip(limits.velocity, goals, strict=True)]
        given.min_velocity = [-top - goal.velocity for top, goal in zip(limits.velocity, goals, strict=True)]
        given.max_acceleration = [top - goal.acceleration for top, goal in zip(limits.acceleration, goals, strict=True)]
        given.min_acceleration = [
            -top - goal.acceleration for top, goal in zip(limits.acceleration, goals, strict=True)
        ]
        if not take_step(self._generator, given, output, dt):
            return self._steps_to_rest(motion, dt, is_late)
        ways = zip(goals, output.new_position, output.new_velocity, output.new_acceleration, is_late, strict=True)
        return [
            _Step(goal.position + p, goal.velocity + v, goal.acceleration + a) if late else _Step(*goal)
            for goal, p, v, a, late in ways
        ]

    def _steps_to_rest(self, motion: list[_Motion], dt: float, is_braking: list[bool]) -> list[_Step]:
        """A step of each joint that brakes as hard as it may: what is possible from any state that is safe."""
        given, output = self._brake, self._output
        given.enabled = is_braking
        given.current_position = list(self.position)
        given.current_velocity = [velocity for velocity, _ in motion]
        given.current_acceleration = [acceleration for _, acceleration in motion]
        if not take_step(self._generator, given, output, dt):
            return [self._slower(index, velocity, dt) for index, (velocity, _) in enumerate(motion)]
        ways = zip(output.new_position, output.new_velocity, output.new_acceleration, strict=True)
        return [_Step(*each) for each in ways]

    def _slower(self, index: int, velocity: float, dt: float) -> _Step:
        """The same without a generator, at the highest acceleration."""
        slower = copysign(max(0.0, abs(velocity) - self._limits.acceleration[index] * dt), velocity)
        return _Step(self.position[index] + 0.5 * (velocity + slower) * dt, slower, 0.0)

    def _estimate(self, index: int, dt: float) -> _Motion:
        """Velocity and acceleration at the end of the last step, where only differences are known."""
        acceleration = self._acceleration[index]
        return self._velocity[index] + 0.5 * acceleration * dt, acceleration

    def _is_smooth(self, index: int, position: float, velocity: float, acceleration: float, dt: float) -> bool:
        """Whether a joint may take this step, and go on from there."""
        limits = self._limits
        return (
            index not in self._chasing
            and abs(velocity) <= limits.velocity[index] * _ROUNDING
            and abs(acceleration) <= limits.acceleration[index] * _ROUNDING
            and abs(acceleration - self._acceleration[index]) <= limits.jerk[index] * dt * _ROUNDING
            and self._is_safe(index, position, velocity + 0.5 * acceleration * dt, acceleration)
        )

    def _is_safe(self, index: int, position: float, velocity: float, acceleration: float) -> bool:
        """Whether a joint that moves like this can still keep its speed, and brake before the end of its range."""
        limits = self._limits
        top, jerk = limits.acceleration[index], limits.jerk[index]
        more = speed_to_come(acceleration, jerk) if velocity * acceleration > 0.0 else 0.0
        if abs(velocity) + more > limits.velocity[index] * _ROUNDING:
            return False
        lowest, highest = braking_reach(velocity, acceleration, top, jerk)
        low, high = limits.lower[index] - _CLOSE, limits.upper[index] + _CLOSE
        return (lowest == 0.0 or position + lowest >= low) and (highest == 0.0 or position + highest <= high)

    def _kept_in_range(self, position: Joints) -> Joints:
        """The last resort, should the way to a target lead past the end of the range, or further away from it."""
        if self._limits.outside(position) is None:
            return position
        rows = zip(self._limits.lower, self._limits.upper, self.position, position, strict=True)
        return joints([max(min(low, old), min(max(high, old), new)) for low, high, old, new in rows])


def _way_to_stop(speed: float, acceleration: float, jerk: float) -> float:
    """How far a joint goes on that brakes at ``speed`` [rad/s], at most [rad]."""
    return 0.5 * speed * (speed / acceleration + 3.0 * acceleration / jerk)


FEEDBACK_DELAY = 0.050
"""By how much the measured speed may be behind the robot's own, at most [s]."""

_NO_LEAD = 1e-4  # [rad] less than the joints' resolution
_NO_TIME = 0.1  # of a period: nothing follows from how far something moved meanwhile
FOLLOWING = 5.0
"""Time constants of the robot's position loop after which it stands where it was told to be, heard or not: what is left
is less than a hundredth of the lead. Until then a new session does not mean that the last command is of no effect."""

DOUBTED = 5
"""A position that is not believed counts as a datagram that did not come; after so many in a row the arm holds."""

LOST = 20
"""After so many in a row the feedback is lost, as after 80 ms of silence."""

NOT_FOLLOWING = 0.12
"""A robot whose plan stands still for so long, while it is told to move, does not get what we say [s]. Where the motion
begins in the middle of such a time, the next one shows it."""

OUTSIDE = 0.01
"""How far outside of its range a joint may stand [rad]: its first command is the end of the range, so near that the
robot does not jump there. An arm further out is not answered."""

_MARGIN = 0.02  # [rad] a measured position may differ by from what a joint's speed explains
_LONGEST = 0.1  # [s] of motion that explains a position while others are not believed
_AGREEING = 3  # so many datagrams that agree with each other outweigh as many of the session before them
_FEW = 25  # a session that was believed for longer is not outweighed
_MOTION = 1e-4  # [rad] over all joints: a plan that moves
_DUE = 5e-3  # [rad] of motion that should have been; an arm at rest is told less, whatever its noise
_FOLLOWED = 0.002  # of it that a robot has moved at least which follows: at the begin of a slow ramp-in it is little
_SLIGHT = 0.01  # [rad] a lead that a robot may follow at once
_PROBE = 1e-3  # [rad] the lead that shows whether the robot follows again
_SETTLING = 1.0  # [s] after which a command that is back settles no further
_CREEPS = 2e-5  # [rad] a command that follows the noise of an arm that stands moves less in a cycle
_STANDS = 1e-6  # [rad] a command that moves less in a cycle stands
_SPEEDS = YUMI_LIMITS.velocity  # of the arm itself, whatever it is told: RAPID may have moved it
_SLOWEST = min(_SPEEDS)

LATE_CYCLE = 1.25
"""A gap in the feedback gives no more room to move than a cycle late by a quarter: the robot takes it at once."""


@dataclass(slots=True)
class GuardCounters:
    """What the guard changed, in cycles.

    Attributes:
        refused: commands with a value that is no finite number; the arm held instead.
        position_limited: commands cut at a joint's range.
        slowed: commands that would have exceeded a joint's speed, acceleration or jerk.
        implausible: measured or planned positions that no arm can have reached.
    """

    refused: int = 0
    position_limited: int = 0
    slowed: int = 0
    implausible: int = 0


class Guard:
    """Admits commands of one arm.

    Attributes:
        counters: what it changed so far.
        longest_step: no command moves further than the joints may within this time [s].
        is_at_rest: whether the robot is told to stand, and no command leads it any more.
        problem: why the arm holds whatever is wanted.
        doubted: the position that was not believed last [rad], (7,).

    Args:
        limits: what the joints may do; speeds, accelerations and jerks bound how the admitted position moves, and how
            the robot moves where a speed is fed forward too.
        period: time between two states of the arm [s].
        gain: of the robot's position loop [1/s].
    """

    def __init__(self, limits: JointLimits, period: float = CYCLE, gain: float = EGM_GAIN) -> None:
        self.counters = GuardCounters()
        self.longest_step = LATE_CYCLE * period
        self._shortest_step = _NO_TIME * period
        self._limits = limits
        self._session = 0
        self._shaper = MotionShaper(limits)
        self._feed_forward = FeedForward(limits, gain)
        self.is_at_rest = True
        self.problem = Problem.NONE
        self.doubted: Joints = ZERO
        self._gain = gain
        self._following = FOLLOWING / gain if gain > 0.0 else FOLLOWING / EGM_GAIN
        self._sent_at = -inf
        self._state: ArmState | None = None  # what was made of the newest state
        self._believed: ArmState | None = None
        self._support = 0  # states believed since the session began
        self._doubts = 0  # states in a row that were not
        self._doubt: ArmState | None = None  # the last of them
        self._agreeing = 0  # those of them that agree with each other
        self._stop_at: Joints | None = None  # where the arm holds while its feedback is not believed
        self._entering: ArmState | None = None  # of a new session that was not answered yet
        self._is_new = False  # whether the robot does not follow yet, and the next command is the first of its session
        self._is_settling = False  # whether the arm is held, and its command not back where the arm is
        self._settling_for = 0.0  # [s]
        self._told = ArmCommand(ZERO)  # the command before the last
        self._plan: Joints = ZERO  # where the robot planned to be some time ago
        self._due: Joints = ZERO  # how far it should have come since [rad]
        self._due_for = 0.0  # how long ago that was [s]

    def believe(self, state: ArmState) -> ArmState | None:
        """What of ``state`` can be relied on; to be called before :meth:`admit`, which takes what it returns.

        A position that no arm can have reached is replaced by the last one that was believed.

        Returns:
            None where no answer is safe: it is open whether the robot still follows, or where it is.
        """
        if state.session != self._session:
            self._state = self._enter(state)
        elif self._is_plausible(state):
            self._state = self._trust(state)
        else:
            self._state = self._distrust(state)
        return self._state

    def admit(self, state: ArmState, wanted: ArmCommand | None) -> ArmCommand:
        """The command that may leave, next to ``wanted``; None holds.

        The first command of a session in which the robot does not follow yet equals the measured position: a robot that
        begins to follow finds no step. So do the commands while the robot does not follow, once they have come there.
        """
        if state is not self._state:
            believed = self.believe(state)
            if believed is None:
                return self._repeat(state)
            state = believed
        self._sent_at = state.time
        if wanted is not None and self._passes_at_once(state, wanted):
            return wanted
        if self._is_new:
            return self._begin(state.position)
        return self._go_on(state, wanted, min(state.dt, self.longest_step))

    def _go_on(self, state: ArmState, wanted: ArmCommand | None, dt: float) -> ArmCommand:
        """The next command after the last one."""
        if state.dt <= 0.0:
            self._shaper.rest_at(self._shaper.position)  # in a silence the command has stood still
        if not 0.0 < state.dt <= self.longest_step:
            self._feed_forward.resume(state.planned, self._shaper.position)
        if dt < self._shortest_step:
            return ArmCommand(self._shaper.position, self._feed_forward.velocity)
        if self._doubts >= DOUBTED or not state.is_running:
            return self._come_to(state, dt)
        if wanted is None or self._is_settling or self.problem is not Problem.NONE:
            command = self._hold(state, dt)
            self._settling_for += state.dt
            is_near = dist(command.position, state.planned) < _SLIGHT
            # The arm stands sooner than the command is back; what keeps shaking does so for its noise.
            self._is_settling = not (self.is_at_rest or (is_near and self._settling_for >= _SETTLING))
            return command
        self._settling_for = 0.0
        if not self._may_go_on(state, wanted):
            return self._hold(state, dt)
        self.is_at_rest = False
        position = self._shape(self._inside(wanted.position), dt, state.dt)
        velocity = self._feed_forward.admit(state.planned, position, wanted.velocity, dt)
        if self._feed_forward.is_bounded and position == wanted.position:  # else it is counted already
            self.counters.slowed += 1
        return ArmCommand(position, velocity)

    def scale_speed(self, scale: float) -> None:
        """Lead no joint faster than ``scale`` times its limit, from the next command on."""
        limits = slower(self._limits, scale)
        self._shaper.limit(limits)
        self._feed_forward.limit(limits)

    def settle(self, state: ArmState) -> None:
        """After the reply to ``state``: prepare what makes the next one fast."""
        self._feed_forward.note(state.planned, self._shaper.position)
        self._watch_plan(state)
        if not self.is_at_rest and state.dt > 0.0 and self._is_near(state, 0.8):
            self._shaper.look_ahead(min(state.dt, self.longest_step))

    def _passes_at_once(self, state: ArmState, wanted: ArmCommand) -> bool:
        """Whether there is nothing to do about ``wanted``: what most commands are."""
        return (
            not self.is_at_rest
            and not self._doubts
            and not self._is_new
            and not self._is_settling
            and self.problem is Problem.NONE
            and state.is_running
            and wanted.velocity is ZERO
            and self._feed_forward.velocity is ZERO
            and self._shaper.glides(wanted.position, state.dt)
        )

    def _enter(self, state: ArmState) -> ArmState | None:
        """A session begins: whether the robot, which may still follow the last command, has to go on from there."""
        if state.time - self._sent_at >= self._following:
            if not self._is_start(state):
                self._note_doubt(state)
                return None
            self._is_new = True
            return self._accept_session(state)
        if not self._is_plausible(state):
            self._note_doubt(state)
            return None
        before, self._entering = self._entering, state
        position, velocity = self._shaper.position, self._feed_forward.velocity
        self._is_new = False
        if velocity is ZERO and dist(position, state.planned) < _SLIGHT:
            return self._accept_session(state)
        if before is None or before.session != state.session or state.dt <= 0.0:
            return None  # the next state tells
        led = hypot(*self._led(state, position, velocity))
        self._is_new = dist(before.planned, state.planned) <= 0.1 * led * state.dt
        self._feed_forward.resume(state.planned, position)
        return self._accept_session(state)

    def _accept_session(self, state: ArmState) -> ArmState:
        self._session, self._support, self._entering = state.session, 0, None
        self._watch_from(state)
        self.problem = Problem.NONE
        return self._trust(state)

    def _led(self, state: ArmState, position: Joints, velocity: Joints) -> list[float]:
        """How fast a robot moves that follows these references [rad/s]."""
        rows = zip(position, state.planned, velocity, strict=True)
        return [self._gain * (ahead - now) + speed for ahead, now, speed in rows]

    def _is_start(self, state: ArmState) -> bool:
        """Whether an arm that has not been told anything for a while can be there."""
        lower, upper = self._limits.lower, self._limits.upper
        rows = zip(lower, upper, state.position, state.planned, _SPEEDS, strict=True)
        return all(
            low - OUTSIDE <= now <= high + OUTSIDE and abs(plan - now) <= speed * _LONGEST + _MARGIN
            for low, high, now, plan, speed in rows
        ) and (self._believed is None or self._could_reach(self._believed, state, inf))

    def _is_plausible(self, state: ArmState) -> bool:
        """Whether the arm can be where ``state`` says, and plan to be where it says, since it was believed last."""
        believed = self._believed
        if believed is None:
            return self._is_start(state)
        if not self._doubts:
            reach = _SLOWEST * state.dt + _MARGIN
            if dist(state.position, believed.position) <= reach and dist(state.planned, believed.planned) <= reach:
                return True
        return self._could_reach(believed, state, _LONGEST if self._doubts else inf)

    def _could_reach(self, before: ArmState, state: ArmState, longest: float) -> bool:
        """Whether the joints' speeds explain the way; while the robot may follow, it may have gone to the last command.

        The robot's clock and ours may differ by what a network delays.
        """
        time = min(max(state.dt, state.time - before.time), longest)
        for old, new, sent, speed in zip(before.position, state.position, self._shaper.position, _SPEEDS, strict=True):
            room = speed * time + _MARGIN
            if not min(old, sent) - room <= new <= max(old, sent) + room:
                return False
        for old, new, sent, speed in zip(before.planned, state.planned, self._shaper.position, _SPEEDS, strict=True):
            room = speed * time + _MARGIN
            if not min(old, sent) - room <= new <= max(old, sent) + room:
                return False
        return True

    def _trust(self, state: ArmState) -> ArmState:
        if self._doubts and self._believed is not None:
            state = _since(self._believed, state)  # its speed was that from or to a false position
            self._feed_forward.resume(state.planned, self._shaper.position)
        self._doubts, self._doubt, self._stop_at = 0, None, None
        if self.problem is Problem.IMPLAUSIBLE:
            self.problem = Problem.NONE
        self._support += 1
        self._believed = state
        return state

    def _distrust(self, state: ArmState) -> ArmState:
        """The state with the last position that was believed, or this one if enough others agree with it."""
        before = self._doubt
        self._note_doubt(state)
        believed = self._believed
        agrees = before is not None and _agree(before, state) and _is_near_plan(state)
        self._agreeing = self._agreeing + 1 if agrees else 1
        is_outweighed = self._agreeing >= max(_AGREEING, self._support) and self._support < _FEW
        is_elsewhere = not state.is_running and self._agreeing >= _FEW  # motors off: it may have been moved by hand
        if believed is None or ((is_outweighed or is_elsewhere) and self._limits.outside(state.position) is None):
            self._believed = state._replace(velocity=ZERO)
            self.is_at_rest = False  # the command is not where the robot is
            return self._trust(state)
        return believed._replace(time=state.time, dt=state.dt, session=state.session)

    def _note_doubt(self, state: ArmState) -> None:
        self.counters.implausible += 1
        self._doubts += 1
        self._doubt, self.doubted = state, state.position
        if self._doubts >= LOST:
            self.problem = Problem.IMPLAUSIBLE

    def _repeat(self, state: ArmState) -> ArmCommand:
        """What was admitted last; to a robot that was never told anything, where it is."""
        if self._sent_at == -inf:
            return self._begin(state.position)
        return ArmCommand(self._shaper.position, self._feed_forward.velocity)

    def _watch_plan(self, state: ArmState) -> None:
        """Notice that the robot plans to stand although it is told to move: it does not hear us."""
        told, self._told = self._told, ArmCommand(self._shaper.position, self._feed_forward.velocity)
        if not state.is_running or self._doubts:
            self._watch_from(state)
            return
        if self.problem is Problem.NOT_FOLLOWING:
            if dist(state.planned, self._plan) > _MOTION:
                self.problem = Problem.NONE
                self._watch_from(state)
            return
        if self.is_at_rest:
            self._watch_from(state)
            return
        dt = min(state.dt, _LONGEST)
        speeds = self._led(state, told.position, told.velocity)
        self._due = joints([due + speed * dt for due, speed in zip(self._due, speeds, strict=True)])
        self._due_for += dt
        if self._due_for < NOT_FOLLOWING:
            return
        due = hypot(*self._due)
        if due >= _DUE and dist(state.planned, self._plan) < _FOLLOWED * due:
            self.problem = Problem.NOT_FOLLOWING
        else:
            self._watch_from(state)

    def _watch_from(self, state: ArmState) -> None:
        self._plan, self._due, self._due_for = state.planned, ZERO, 0.0

    def _begin(self, position: Joints) -> ArmCommand:
        if self._limits.outside(position) is not None:
            ranges = zip(self._limits.lower, position, self._limits.upper, strict=True)
            position = joints([max(low, min(high, now)) for low, now, high in ranges])
        self._shaper.rest_at(position)
        self._feed_forward.end()
        self.is_at_rest = True
        self._is_new = self._is_settling = False
        self._told = ArmCommand(position)
        return ArmCommand(position)

    def _hold(self, state: ArmState, dt: float) -> ArmCommand:
        """Come to rest, then repeat the last admitted command.

        A command runs ahead of the robot by its speed over the loop gain. It goes back to the robot within its limits,
        which takes longer than the robot needs to stop; what is left of the lead meanwhile, a speed against it cancels,
        as quickly as the robot may brake. So it comes to rest on its way, not where the lead points.
        """
        position, planned = self._shaper.position, state.planned
        if self.is_at_rest:
            return ArmCommand(position, self._feed_forward.admit(planned, position, ZERO, dt))
        # A command that chased the noise of the plan would never rest; a lead of some size shows whether it is heard.
        kept = _PROBE if self.problem is Problem.NOT_FOLLOWING else _NO_LEAD
        goal = joints([now + max(-kept, min(kept, ahead - now)) for ahead, now in zip(position, planned, strict=True)])
        last, position = position, self._go_to(goal, state, dt)
        leads = joints([ahead - end for ahead, end in zip(position, goal, strict=True)])
        is_led = max(map(abs, leads)) >= _NO_LEAD
        against = joints([-self._gain * lead for lead in leads]) if is_led else ZERO
        velocity = self._feed_forward.admit(planned, position, against, dt)
        self.is_at_rest = not is_led and velocity is ZERO and dist(last, position) < _STANDS
        return ArmCommand(position, velocity)

    def _come_to(self, state: ArmState, dt: float) -> ArmCommand:
        """Go to where an arm is that does not follow: were it to follow after all, it would not feel a step.

        Where it says it is cannot be believed, come to rest where the command itself does.
        """
        goal = state.position
        if self._doubts:
            self._stop_at = goal = self._stop_at or self._shaper.place_to_stop()
        last, position = self._shaper.position, self._go_to(goal, state, dt)
        self.is_at_rest = dist(position, goal) < _MARGIN and dist(last, position) < _CREEPS
        return ArmCommand(position, self._feed_forward.admit(state.planned, position, ZERO, dt))

    def _go_to(self, goal: Joints, state: ArmState, dt: float) -> Joints:
        """Nearer to ``goal`` within the limits; never out of the range, or further out."""
        ranges = zip(self._limits.lower, self._limits.upper, self._shaper.position, goal, strict=True)
        inside = joints([max(min(low, now), min(max(high, now), value)) for low, high, now, value in ranges])
        return inside if self._shaper.passes(inside, dt) else self._shaper.approach(inside, dt, state.dt)

    def _shape(self, position: Joints, dt: float, elapsed: float) -> Joints:
        if self._shaper.passes(position, dt):
            return position
        self.counters.slowed += 1
        return self._shaper.approach(position, dt, elapsed)

    def _may_go_on(self, state: ArmState, wanted: ArmCommand) -> bool:
        if not isfinite(sum(wanted.position) + sum(wanted.velocity)):
            self.counters.refused += 1
            return False
        if not self._is_near(state, 1.0):
            self.counters.slowed += 1
            return False
        return True

    def _is_near(self, state: ArmState, share: float) -> bool:
        """Whether the robot's speed, and a ``share`` of what its acceleration can add, explain how far we are ahead.

        Else the robot does not get what we say, and all that piles up would reach it as one blow. A robot that follows
        speeds only makes nothing of a lead.
        """
        if self._gain == 0.0:
            return True
        leads = zip(self._shaper.position, state.planned, state.velocity, self._limits.acceleration, strict=True)
        return all(abs(last - now) < share * _useful_lead(speed, gain) for last, now, speed, gain in leads)

    def _inside(self, position: Joints) -> Joints:
        """Cut at the range; an arm that stands outside of it may come back but not go further."""
        lower, upper, last = self._limits.lower, self._limits.upper, self._shaper.position
        if self._limits.outside(position) is None:
            return position
        self.counters.position_limited += 1
        ranges = zip(lower, upper, last, position, strict=True)
        return joints([max(min(low, now), min(max(high, now), value)) for low, high, now, value in ranges])


def _useful_lead(speed: float, acceleration: float) -> float:
    """The lead [rad] at which a robot seen at ``speed`` [rad/s] may have come to move; more does not move it faster."""
    return (abs(speed) + acceleration * FEEDBACK_DELAY) / EGM_GAIN


def _since(before: ArmState, state: ArmState) -> ArmState:
    """``state`` with the speed since ``before``."""
    passed = max(state.dt, state.time - before.time)
    if passed <= 0.0:
        return state._replace(velocity=ZERO)
    rows = zip(before.position, state.position, strict=True)
    return state._replace(velocity=joints([(new - old) / passed for old, new in rows]))


def _agree(before: ArmState, state: ArmState) -> bool:
    """Whether an arm can be in both states, one after the other."""
    time = max(state.dt, state.time - before.time)
    rows = zip(before.position, state.position, _SPEEDS, strict=True)
    return all(abs(new - old) <= speed * time + _MARGIN for old, new, speed in rows)


def _is_near_plan(state: ArmState) -> bool:
    """Whether the measured position is one that a servo has on the way to the planned one."""
    rows = zip(state.position, state.planned, _SPEEDS, strict=True)
    return all(abs(plan - now) <= speed * _LONGEST + _MARGIN for now, plan, speed in rows)


FULL = 1.0

_FASTEST = 4.0  # [1/s] at full speed a change takes two thirds of a joint's acceleration
_HARSHEST = 40.0  # [1/s²] and not half of its jerk


class SpeedScale:
    """One factor for all controllers and for the limiter of one arm.

    Planned motions let time go by slower by it, along the same path; whatever else is commanded is limited to that
    share of the joints' speeds. It changes gradually: no joint exceeds its acceleration or jerk, in the middle of a
    motion, too.

    Args:
        wanted: where others put what it shall be, above 0 up to 1; without one it stays at 1.

    Attributes:
        value: the factor in this cycle.
    """

    def __init__(self, wanted: Buffer[Factor] | None = None) -> None:
        self._wanted = wanted
        self._rate = 0.0
        letter = wanted.read() if wanted else None
        self.value = letter[1][0] if letter else FULL

    def advance(self, dt: float) -> bool:
        """Go on for ``dt`` [s]; to be called once between two cycles.

        Returns:
            Whether :attr:`value` has changed.
        """
        letter = self._wanted.read() if self._wanted else None
        if letter is None or (letter[1][0] == self.value and not self._rate) or dt <= 0.0:
            return False
        wanted, before = letter[1][0], self.value
        self.value, self._rate = ramped(wanted, before, self._rate, FULL, _FASTEST, _HARSHEST, dt)
        if min(before, wanted) > self.value or self.value > max(before, wanted):  # by the last digits of a ramp
            self.value, self._rate = wanted, 0.0
        return True
