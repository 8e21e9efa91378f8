"""Which of our references a robot follows, if any; often a firewall drops our outgoing datagrams.

The robot's plan shows that, whatever the protocol claims (docs/explanation/decisions/0014-feedback-is-doubted.md,
docs/explanation/decisions/0049-lost-commands-wait.md).
"""

from __future__ import annotations

from math import dist, expm1, hypot, pi

from yumi.control.feedback import LONGEST
from yumi.control.motion import SERVO_CYCLES
from yumi.robot.joints import CYCLE, ZERO, ArmCommand, ArmState, Joints, change_rate, joints

IGNORED_AFTER = 0.12
"""A robot whose plan stands still for so long although references lead it ignores them [s]. A motion that begins within
such a time is judged by the next one."""

_MOTION = 1e-4  # [rad] over all joints: a plan that moves
_DUE = 5e-3  # [rad] of motion that should have been; an arm at rest is led by less, whatever its noise
_FOLLOWED = 0.002  # of it that a robot has moved at least which follows: at the begin of a slow ramp-in it is little

LOST_AFTER = 3
"""After so many cycles in which one command moves the robot the later ones are lost: they are four by then. More are
needed on a network on which replies usually show later."""

_EXPLAINED, _EXPLAINED_SHARE = 0.05, 0.02  # [rad/s] over all joints, and of the speed: near enough to a command's speed
_LATEST, _FORGETTING = 25, 0.02  # of the commands that are usually on their way: the most; by how much fewer a cycle
_NEXT = 2  # commands further a robot goes in a cycle if none is lost, at most
_REMEMBERED = 40  # commands: the first of them, and the newest
_SAME_SPEED = 2e-3  # [rad/s] over all joints: what two commands make of the plan is the same


class ReferenceMonitor:
    """Which of our references the robot follows, if any.

    The robot's planned position is the integral of speeds that its references make (reference/egm.md §6.1): how it has
    moved shows which command moved it, and whether it moves at all although it is led.

    Args:
        gain: of the robot's position loop [1/s].
        fastest: speeds that the robot's joints do not exceed under EGM [rad/s], (7,).
        period: time between two states of the arm [s].
        bandwidth: of the robot's low-pass filter on the speed [Hz]; 0 is none.

    Attributes:
        are_ignored: whether the plan stood still although references led it, and has not moved since.
    """

    def __init__(self, gain: float, fastest: Joints, period: float = CYCLE, bandwidth: float = 0.0) -> None:
        self.are_ignored = False
        self._gain = gain
        self._fastest = fastest
        self._period = period
        self._bandwidth = bandwidth
        self._moved: Joints = ZERO  # how the plan moved before the newest state [rad/s]
        self._sent = ArmCommand(ZERO)  # what the robot's plan can show by now
        self._commands = [self._sent]  # the one that its plan has shown, then those that it has not shown yet
        self._furthest = 0  # which of them is the newest that the plan has shown
        self._repeated = 0  # for so many cycles in a row it has shown no newer one, although there are
        self._latency = 1.0  # how many newer ones there are usually
        self._seen: ArmState | None = None  # the state before this one
        self._last: ArmState | None = None  # what was replied to last
        self._acting = (self._sent, self._sent)  # what moves the robot from there to its next states, before the last
        self._plan: Joints = ZERO  # where the robot planned to be some time ago
        self._due: Joints = ZERO  # how far it has been led since [rad]
        self._due_for = 0.0  # how long ago that was [s]

    @property
    def followed(self) -> ArmCommand:
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
            if state is not None and last is not None and state.dt > 0.0:
                self._moved = change_rate(state.planned, last.planned, state.dt)
            return
        moved = self._unfiltered(change_rate(state.planned, last.planned, state.dt), state.dt)
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
        begin, end = (1, len(commands) - 1) if len(alike) == len(commands) else (0, alike[0])
        del commands[begin:end]
        self._furthest = max(0, self._furthest - (end - begin))

    def _unfiltered(self, moved: Joints, dt: float) -> Joints:
        """The speed that the robot's filter made ``moved`` of [rad/s], (7,)."""
        before, self._moved = self._moved, moved
        if self._bandwidth <= 0.0:
            return moved
        new = -expm1(-2.0 * pi * self._bandwidth * dt)
        return joints([old + (now - old) / new for old, now in zip(before, moved, strict=True)])

    @property
    def is_repeating(self) -> bool:
        """Whether the robot goes on by one command although it was sent others since."""
        return self._repeated >= LOST_AFTER - 1 + self._latency

    def are_lost(self, changes: Joints) -> bool:
        """Whether the robot misses commands that change a joint's speed by more than ``changes`` [rad/s], (7,)."""
        if not self.is_repeating:
            return False
        followed, newest = self._commands[0], self._commands[-1]
        rows = zip(followed.position, newest.position, followed.velocity, newest.velocity, changes, strict=True)
        return any(abs(self._gain * (q - p) + w - v) > most for p, q, v, w, most in rows)

    def observe(self, state: ArmState, sent: ArmCommand, *, is_valid: bool, is_at_rest: bool, is_waiting: bool) -> None:
        """After each reply.

        Args:
            state: what was replied to.
            sent: the reply; the robot's plan does not show it yet, but the one before.
            is_valid: whether the state says anything: the robot follows, and the state is plausible.
            is_at_rest: whether the command leads nowhere.
            is_waiting: whether the command waits, since newer ones than that which moves the robot were lost.
        """
        before, self._sent = self._sent, sent
        self._last, self._acting = state, (self._acting[1], before)
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

    def expected(self, state: ArmState) -> ArmState | None:
        """``state`` with the positions of a robot that followed what it was sent until then; None before a reply.

        The replies before the last one move the robot at first.
        """
        last = self._last
        if last is None:
            return None
        planned, position = last.planned, last.position
        left = min(state.time - last.time, LONGEST)
        commands = iter(self._acting)
        while left > 1e-9:
            dt = min(left, self._period)
            left -= dt
            speeds = self.speeds(last._replace(position=position), next(commands, self._sent))
            share = dt / (SERVO_CYCLES * CYCLE)
            position = joints([now + share * (plan - now) for now, plan in zip(position, planned, strict=True)])
            planned = joints([now + speed * dt for now, speed in zip(planned, speeds, strict=True)])
        return state._replace(planned=planned, position=position)

    def speeds(self, state: ArmState, sent: ArmCommand) -> list[float]:
        """How fast a robot moves that follows ``sent`` [rad/s]."""
        rows = zip(sent.position, state.position, sent.velocity, strict=True)
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
