"""What an arm's feedback is worth: whether it can be true, and whether the robot takes our references.

Both are decided by physics, not by the protocol, which proves neither
(docs/explanation/decisions/0014-feedback-is-doubted.md).
"""

from __future__ import annotations

from collections.abc import Callable
from math import dist, expm1, hypot, inf

from yumi.robot.joints import CYCLE, YUMI_LIMITS, ZERO, ArmCommand, ArmState, JointLimits, Joints, change_rate, joints

DOUBTED = 5
"""An implausible position counts as a datagram that did not come; after so many in a row the arm holds."""

LOST = 20
"""After so many in a row the feedback is lost, as after 80 ms without a datagram."""

OUTSIDE = 0.01
"""How far outside of its range a joint may stand [rad]: its first command is the end of the range, so near that the
robot does not jump there. An arm further out gets no reply."""

LONGEST = 0.1
"""Longest motion that may explain a position while others are implausible [s]."""

FOLLOWED = 2.0 * CYCLE
"""The same of a robot that follows: it is on the way to what was sent [s]."""

EXCHANGED = 0.5
"""An implausible position as near to the other arm's as this is the other arm's [rad, over all joints]."""

_MARGIN = 0.02  # [rad] a measured position may differ by from what a joint's speed explains
_AGREEING = 3  # so many datagrams that agree with each other outweigh as many of the session before them
_FEW = 25  # a session that was plausible for longer is not outweighed
_SPEEDS = YUMI_LIMITS.velocity  # of the arm itself, whatever our limits are: RAPID may have moved it
_SLOWEST = min(_SPEEDS)


class FeedbackCheck:
    """Whether an arm can be where a datagram says, by the joints' highest speeds.

    Args:
        limits: of the joints.
        other_arm: where the robot's other arm was measured last [rad], (7,); None where that is not known.

    Attributes:
        implausible: states that no arm can have reached.
        in_a_row: those since the last plausible one.
        position: the implausible position that came last [rad], (7,).
        is_other_arm: whether that is where the other arm is, and not this one: their datagrams were exchanged.
    """

    def __init__(self, limits: JointLimits, other_arm: Callable[[], Joints | None]) -> None:
        self.implausible = self.in_a_row = 0
        self.position: Joints = ZERO
        self.is_other_arm = False
        self._limits = limits
        self._other_arm = other_arm
        self._last: ArmState | None = None  # the last plausible state
        self._support = 0  # plausible states since the session began
        self._doubt: ArmState | None = None  # the last implausible state since then
        self._agreeing = 0  # implausible states that agree with each other

    def begin(self) -> None:
        """A session begins with the next accepted state."""
        self._support = 0

    @property
    def is_lost(self) -> bool:
        """Whether so many states in a row were implausible that the arm is not known to be anywhere."""
        return self.in_a_row >= LOST

    def is_start(self, state: ArmState, sent: Joints) -> bool:
        """Whether an arm can be there that got no command since it was sent to the position ``sent`` [rad], (7,)."""
        rows = zip(self._limits.lower, self._limits.upper, state.position, strict=True)
        is_near_range = all(low - OUTSIDE <= now <= high + OUTSIDE for low, high, now in rows)
        return is_near_range and _is_near_plan(state) and (self._last is None or self._can_follow(state, sent, inf))

    def is_plausible(self, state: ArmState, sent: Joints) -> bool:
        """Whether the arm can be where ``state`` says, and plan to be where it says, after the last plausible state.

        While the robot may follow, it may have gone to the position ``sent`` last.
        """
        last = self._last
        if last is None:
            return self.is_start(state, sent)
        if not self.in_a_row:  # nearly always all joints together have moved less than one may
            reach = _SLOWEST * state.dt + _MARGIN
            if dist(state.position, last.position) <= reach and dist(state.planned, last.planned) <= reach:
                return True
        follows = state.is_running and last.is_running  # so nothing but what is sent has moved it
        return self._can_follow(state, sent, inf if not self.in_a_row else FOLLOWED if follows else LONGEST)

    def accept(self, state: ArmState) -> ArmState:
        """``state`` is plausible; its velocity is corrected where it was that from or to a false position."""
        if self.in_a_row and self._last is not None:
            passed = max(state.dt, state.time - self._last.time)
            velocity = change_rate(state.position, self._last.position, passed) if passed > 0.0 else ZERO
            state = state._replace(velocity=velocity)
        self.in_a_row, self._doubt = 0, None
        self._support += 1
        self._last = state
        return state

    def reject(self, state: ArmState) -> None:
        """``state`` is implausible."""
        self.implausible += 1
        self.in_a_row += 1
        self._doubt, self.position = state, state.position
        other = self._other_arm()
        own = dist(state.position, self._last.position) if self._last else inf
        self.is_other_arm = other is not None and dist(state.position, other) < min(EXCHANGED, own)

    def replace(self, state: ArmState) -> tuple[ArmState, bool]:
        """What to use in place of an implausible ``state``, which is counted, and whether it is the state itself.

        It is the last plausible position; or this one, at rest, if enough others agree with it and it is not the other
        arm's: as many of those agree with each other as datagrams are exchanged.
        """
        before = self._doubt
        self.reject(state)
        agrees = False
        if before is not None and _is_near_plan(state):  # an arm can be in both states, one after the other
            time = max(state.dt, state.time - before.time)
            rows = zip(before.position, state.position, _SPEEDS, strict=True)
            agrees = all(abs(new - old) <= speed * time + _MARGIN for old, new, speed in rows)
        self._agreeing = self._agreeing + 1 if agrees else 1
        is_outweighed = self._agreeing >= max(_AGREEING, self._support) and self._support < _FEW
        is_elsewhere = not state.is_running and self._agreeing >= _FEW  # motors off: it may have been moved by hand
        is_possible = not self.is_other_arm and self._limits.outside(state.position) is None
        if self._last is None or ((is_outweighed or is_elsewhere) and is_possible):
            self._last = state._replace(velocity=ZERO)
            return self.accept(state), True
        return self._last._replace(time=state.time, dt=state.dt, session=state.session), False

    def _can_follow(self, state: ArmState, sent: Joints, longest: float) -> bool:
        """Whether the joints' speeds explain the way from the last plausible state, or from there to ``sent``.

        The robot's clock and ours may differ by what a network delays.
        """
        last = self._last
        assert last is not None
        time = min(max(state.dt, state.time - last.time), longest)
        for before, after in ((last.position, state.position), (last.planned, state.planned)):
            for old, new, goal, speed in zip(before, after, sent, _SPEEDS, strict=True):
                room = speed * time + _MARGIN
                if not min(old, goal) - room <= new <= max(old, goal) + room:
                    return False
        return True


def _is_near_plan(state: ArmState) -> bool:
    """Whether the measured position is one that a servo has on the way to the planned one."""
    rows = zip(state.position, state.planned, _SPEEDS, strict=True)
    return all(abs(plan - now) <= speed * LONGEST + _MARGIN for now, plan, speed in rows)


IGNORED_AFTER = 0.12
"""A robot whose plan stands still for so long although references lead it ignores them [s]. A motion that begins within
such a time is judged by the next one."""

_MOTION = 1e-4  # [rad] over all joints: a plan that moves
_DUE = 5e-3  # [rad] of motion that should have been; an arm at rest is led by less, whatever its noise
_FOLLOWED = 0.002  # of it that a robot has moved at least which follows: at the begin of a slow ramp-in it is little

UNHEARD_CYCLES = 3
"""After so many cycles in which one command moves the robot the later ones are not heard: they are four by then. More
are needed on a network on which replies usually show later."""

TAKEN_AT_ONCE = 0.75
"""Share of what a joint's speed may change in a cycle by which it may change when a command is heard again."""

_EXPLAINED, _EXPLAINED_SHARE = 0.05, 0.02  # [rad/s] over all joints, and of the speed: near enough to a command's speed
_LATEST, _FORGETTING = 25, 0.02  # of the commands that are usually on their way: the most; by how much fewer a cycle
_NEXT = 2  # commands further a robot goes in a cycle that hears all of them, at most
_REMEMBERED = 40  # commands: the first of them, and the newest
_SAME_SPEED = 2e-3  # [rad/s] over all joints: what two commands make of the plan is the same


class ReferenceMonitor:
    """Which of our references the robot follows, if any; often a firewall drops our outgoing datagrams.

    The robot's planned position is the integral of its references (reference/egm.md §6.1): how it has moved shows which
    command moved it, and whether it moves at all although it is led.

    Args:
        gain: of the robot's position loop [1/s].
        fastest: speeds that the robot's joints do not exceed under EGM [rad/s], (7,).

    Attributes:
        are_ignored: whether the plan stood still although references led it, and has not moved since.
    """

    def __init__(self, gain: float, fastest: Joints) -> None:
        self.are_ignored = False
        self._gain = gain
        self._fastest = fastest
        self._sent = ArmCommand(ZERO)  # what the robot's plan can show by now
        self._commands = [self._sent]  # the one that its plan has shown, then those that it has not shown yet
        self._furthest = 0  # which of them is the newest that the plan has shown
        self._repeated = 0  # for so many cycles in a row it has shown no newer one, although there are
        self._latency = 1.0  # how many newer ones there are usually
        self._seen: ArmState | None = None  # the state before this one
        self._last: ArmState | None = None  # what was replied to last
        self._acting = self._sent  # what moves the robot from there to its next state
        self._plan: Joints = ZERO  # where the robot planned to be some time ago
        self._due: Joints = ZERO  # how far it has been led since [rad]
        self._due_for = 0.0  # how long ago that was [s]

    @property
    def heard(self) -> ArmCommand:
        """The command that moves the robot, as its plan shows; the oldest of those that are alike."""
        return self._commands[0]

    def begin(self, state: ArmState, sent: ArmCommand | None = None) -> None:
        """Compare from here on, as nothing is known; ``sent`` where a session begins with this command."""
        self.are_ignored = False
        self._compare_from(state)
        self._sent = sent or self._sent
        self._commands, self._furthest, self._repeated = [self._sent], 0, 0

    def compare(self, state: ArmState | None) -> None:
        """With each state, before its reply: which of the commands so far has moved the plan to where it is now.

        Args:
            state: what the robot reports; None where that is not plausible, or it does not follow.
        """
        last, self._seen = self._seen, state
        commands = self._commands
        if state is None or last is None or len(commands) == 1 or last.session != state.session or state.dt <= 0.0:
            self._doubt()
            return
        fading = self._gain * state.dt  # the robot's loop closes the lead meanwhile
        share = -expm1(-fading) / fading if fading > 0.0 else 1.0
        moved = change_rate(state.planned, last.planned, state.dt * share)
        oldest = self.speeds(last, commands[0])
        if self._bounded(oldest) is not oldest:  # as slowed as all that follow: they look alike
            return
        differences = [dist(self._bounded(self.speeds(last, command)), moved) for command in commands]
        closest = min(differences)
        if closest > _EXPLAINED + _EXPLAINED_SHARE * hypot(*moved):  # false feedback, or a robot that moves otherwise
            self._doubt()
            return
        alike = [index for index, each in enumerate(differences) if each <= closest + _SAME_SPEED]
        further = alike[-1] - self._furthest
        if further > 0:
            if further <= _NEXT and not self.is_repeating:  # the robot goes on along the commands, however late
                late = min(len(commands) - 1 - alike[-1], _LATEST)
                self._latency = max(late, self._latency - _FORGETTING, 1.0)
            self._furthest, self._repeated = alike[-1], 0
        else:  # also where the plan looks again as an older command made it
            self._repeated = self._repeated + 1 if self._furthest < len(commands) - 1 else 0
        # Where a motion turns round, commands before and after are alike; where all are, it is slow or at rest.
        first, last = (1, len(commands) - 1) if len(alike) == len(commands) else (0, alike[0])
        del commands[first:last]
        self._furthest = max(0, self._furthest - (last - first))

    @property
    def is_repeating(self) -> bool:
        """Whether the robot goes on by one command although it was sent others since."""
        return self._repeated >= UNHEARD_CYCLES - 1 + self._latency

    def are_unheard(self, limits: JointLimits, period: float) -> bool:
        """Whether it has not heard commands that would change its speed by more than it may in a cycle.

        Args:
            limits: of the joints.
            period: of the robot's cycle [s].
        """
        if not self.is_repeating:
            return False
        heard, newest = self._commands[0], self._commands[-1]
        rows = zip(heard.position, newest.position, heard.velocity, newest.velocity, limits.acceleration, strict=True)
        most = TAKEN_AT_ONCE * period
        return any(abs(self._gain * (q - p) + w - v) > top * most for p, q, v, w, top in rows)

    def observe(
        self, state: ArmState, sent: ArmCommand, *, is_valid: bool, is_at_rest: bool, is_waiting: bool = False
    ) -> None:
        """After each reply.

        Args:
            state: what was replied to.
            sent: the reply; the robot's plan does not show it yet, but the one before.
            is_valid: whether the state says anything: the robot follows, and the state is plausible.
            is_at_rest: whether the command leads nowhere.
            is_waiting: whether the command waits, since newer ones than that which moves the robot were lost.
        """
        before, self._sent = self._sent, sent
        self._last, self._acting = state, before
        if sent != self._commands[-1]:
            self._commands.append(sent)
            if len(self._commands) > _REMEMBERED:
                del self._commands[1]
                self._furthest = max(0, self._furthest - 1)
        if not is_valid or (is_at_rest and not self.are_ignored):
            self._compare_from(state)
            return
        if self.are_ignored:
            if dist(state.planned, self._plan) > _MOTION:
                self.begin(state)
            return
        dt = min(state.dt, LONGEST)
        rows = zip(self._due, self.speeds(state, before), strict=True)
        self._due = joints([due + speed * dt for due, speed in rows])
        self._due_for += dt
        if self._due_for >= IGNORED_AFTER:
            due, moved = hypot(*self._due), dist(state.planned, self._plan)
            # A command that waits may lead nowhere; then a plan that stands shows it.
            stands = is_waiting and self._repeated * dt >= IGNORED_AFTER and moved < _MOTION
            self.are_ignored = stands or (due >= _DUE and moved < _FOLLOWED * due)
            if not self.are_ignored:
                self._compare_from(state)

    def plan_at(self, time: float) -> Joints | None:
        """Where a robot that follows plans to be at ``time`` by our clock [s], (7,) [rad]; None before a reply.

        It gets a reply after the state that the reply is to, so until its next state the reply before moves it.
        """
        state = self._last
        if state is None:
            return None
        left = min(time - state.time, LONGEST)
        for command, most in ((self._acting, CYCLE), (self._sent, LONGEST)):
            passed = min(left, most)
            left -= passed
            # The speed fades with the lead, as the robot's loop closes it.
            factor = -expm1(-self._gain * passed) / self._gain if self._gain > 0.0 else passed
            moved = zip(state.planned, self.speeds(state, command), strict=True)
            state = state._replace(planned=joints([now + speed * factor for now, speed in moved]))
        return state.planned

    def speeds(self, state: ArmState, sent: ArmCommand) -> list[float]:
        """How fast a robot moves that follows ``sent`` [rad/s]."""
        rows = zip(sent.position, state.planned, sent.velocity, strict=True)
        return [self._gain * (ahead - now) + speed for ahead, now, speed in rows]

    def _doubt(self) -> None:
        """A state shows nothing: what was not shown before begins anew, and what was shown stays."""
        if not self.is_repeating:
            self._repeated = 0

    def _bounded(self, speeds: list[float]) -> list[float]:
        """The speeds of joints that are slowed together where one asks for more than its highest speed [rad/s]."""
        most = max(abs(speed) / top for speed, top in zip(speeds, self._fastest, strict=True))
        return speeds if most <= 1.0 else [speed / most for speed in speeds]

    def _compare_from(self, state: ArmState) -> None:
        self._plan, self._due, self._due_for = state.planned, ZERO, 0.0
