"""Whatever arrives from the network: what leaves for the robot keeps the limits, and never departs from where it is.

The real classes (session, arm, controllers, limiter) behind a wire that may do anything, and a virtual robot. After
accidents the robot itself is led within the limits, too; a sender with the robot's own address and port may deceive it
(docs/explanation/decisions/0055-threat-model.md).
``pytest -m soak tests/property/test_receive_path.py`` tries more of it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import count
from math import cos, dist, inf, radians, sin
from random import Random
from typing import Any, NamedTuple

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from abb_protocols.catalogue import message
from abb_protocols.egm.codec import MciState, MotorState, RapidState, RobotCodec, RobotMessage, SensorCodec
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import YUMI_LIMITS, ZERO_JOINTS, ArmState, Joints, Side, joints
from abb_runtime.clock import ManualClock
from egm_loop import CONTROLLER, CYCLE, FULL_SPEED, EgmLoop, VirtualArmEnd, Wire
from refusals import assert_says, refused
from reported_limiter import ReportedLimiter
from soak import RECEIVE_EXAMPLES
from virtual_irc5.mechanics.arm_motion import ArmModel
from yumi.control.controller import State
from yumi.control.controllers.joint_velocity import JointVelocityController
from yumi.control.goals import MemoryBuffer, write_speeds
from yumi.control.limiter import Limiter
from yumi.control.loop_events import ImplausibleFeedback, ProblemOver, ReferencesIgnored, SessionResumed
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.control.shared_state import ArmProblem
from yumi.driver.settings import EgmSettings
from yumi.egm.egm_session import ROBOT_SILENCE

VELOCITY_CONTROLLER = "joint_velocity_controller"
OTHER_ARM: Joints = (1.2, -2.2, -1.2, 0.4, 0.3, 0.7, -0.4)
RECENT = 1.0  # [s] for so long a robot may follow the last command


class Led(NamedTuple):
    """How fast the robot's references lead it, by its own law; nothing where they did not change.

    Attributes:
        is_excused: whether what we knew of the robot was false a moment ago.
        speed: ``gain · (position reference - reported position) + speed reference`` [rad/s], (7,).
        before: the same a cycle before [rad/s], (7,).
        is_unheard: whether the robot may not have heard the commands of the last five cycles.
    """

    is_excused: bool
    speed: Joints
    before: Joints
    is_unheard: bool


class Attacked(EgmLoop):
    """A loop with a wire on which anything may be done, in motion all the while.

    Args:
        feeds_speed: move by a controller that feeds speeds forward.
        knows_other_arm: the limiter knows where the other arm is, as in the process that holds both.
        silence: EGM has ended for our end after this time without a datagram [s].

    Attributes:
        extra: datagrams that arrive besides the next true one, before or after it.
        true: everything the robot has sent.
        changed: what becomes of each of the robot's messages before it is sent; None for nothing.
        begun: when the robot began its sessions, by our clock [s].
        led: what each reply made of the robot's motion.
        deceived_at: when replies were lost, or a datagram forged that may not be known as false, last [s].
        waits: the cycles in which the command began to wait for the robot to hear it.
        unheard_until: until when replies are lost, or late by more than some cycles [s].
    """

    def __init__(
        self, *, feeds_speed: bool = False, knows_other_arm: bool = True, silence: float = ROBOT_SILENCE
    ) -> None:
        self.limiter = Limiter(YUMI_LIMITS)
        if knows_other_arm:
            other, there = (
                ReportedLimiter(YUMI_LIMITS),
                ArmState(0.0, CYCLE, 1, OTHER_ARM, ZERO_JOINTS, OTHER_ARM, True),
            )
            other.limit(there, None)
            other.observe(there)
            self.limiter.pair(other)
        super().__init__(limiter=self.limiter, model=ArmModel(supervises_load=False), silence=silence)
        self._speeds = MemoryBuffer() if feeds_speed else None
        if self._speeds is not None:
            self.manager.load(VELOCITY_CONTROLLER, JointVelocityController(self._speeds))
            self.manager.configure(VELOCITY_CONTROLLER)
        self.true: list[bytes] = []
        self.before: list[bytes] = []
        self.after: list[bytes] = []
        self.is_silent = self.is_swapped = self.is_shuffled = False
        self.clock_offset = self.dither = 0.0
        self.changed: Callable[[RobotMessage], RobotMessage] | None = None
        self.begun: list[float] = []
        self.home = self.robot.arm.position
        self.led: list[Led] = []
        self._lead, self._used = ZERO_JOINTS, (ZERO_JOINTS, ZERO_JOINTS)
        self.deceived_at = -inf
        self.waits: list[int] = []
        self.unheard_until = -inf
        self.sent: list[Joints] = []
        self._codec, self._reader = RobotCodec(), SensorCodec(axes=7)
        self.to_us = self._arriving
        self.to_robot = self._leaving

    def forged(self, **changes: object) -> bytes:
        """The newest true datagram with some fields changed."""
        return self._codec.encode(replace(self.newest, **changes))  # type: ignore[arg-type]

    @property
    def newest(self) -> RobotMessage:
        return self._reader.decode(self.true[-1])

    def move(self, cycles: int) -> None:
        """Follow a sine, as far as anything is followed."""
        for _ in range(cycles):
            angle = 4.0 * self.clock.now()
            if self.line.state is None:
                pass
            elif self._speeds is not None:
                write_speeds(self._speeds, self.snapshot.session, joints([1.6 * cos(angle)] * 7))
            else:
                self.go(joints([value + 0.4 * sin(angle) for value in self.home]))
            self.cycle()

    def cycle(self) -> None:
        if self.is_silent:  # nothing is sent then that the robot could hear
            self.unheard_until += CYCLE
        motion, reported = self.robot.arm.egm, self.robot.arm.position
        used = (motion.reference, motion.reference_velocity) if motion else (ZERO_JOINTS, ZERO_JOINTS)
        was_waiting, sent = self.limiter.is_waiting, len(self.sent)
        super().cycle()
        if len(self.sent) > sent + 1:  # the robot takes the newest
            self.unheard_until = max(self.unheard_until, self.clock.now() + 1.5 * CYCLE)
        if self.limiter.is_waiting and not was_waiting:
            assert self.may_be_unheard
            self.waits.append(len(self.cycles) - 1)
        if motion is None or motion is not self.robot.arm.egm:
            self._lead = ZERO_JOINTS
            return
        lead = joints(
            [EGM_GAIN * (ahead - now) + speed for ahead, now, speed in zip(used[0], reported, used[1], strict=True)]
        )
        if used != self._used:
            is_excused = self.clock.now() - self.deceived_at < 7.5 * CYCLE
            self.led.append(Led(is_excused, lead, self._lead, self.may_be_unheard))
        self._lead, self._used = lead, used

    @property
    def may_be_unheard(self) -> bool:
        """Whether the robot may not have heard the last commands."""
        return self.clock.now() < self.unheard_until

    def activate(self) -> None:
        if self._speeds is None:
            super().activate()
        else:
            self.switch_to(VELOCITY_CONTROLLER)

    def restart(self) -> None:
        """The robot begins a session where it stands, as EGM does: from a fine point."""
        self.robot.arm.stop_egm()
        self.is_silent = True
        self.move(60)
        self.is_silent = False
        if self.robot.arm.motors_on:
            self.robot.start(FULL_SPEED)
            self.begun.append(self.clock.now())

    def _arriving(self, datagram: bytes) -> list[bytes]:
        if self.changed is not None:
            datagram = self._codec.encode(self.changed(self._reader.decode(datagram)))
        if self.clock_offset or self.dither:
            message = self._reader.decode(datagram)
            time = message.measured_time + self.clock_offset + self.dither * (message.seqno % 2)
            datagram = self._codec.encode(replace(message, measured_time=time))
        self.true.append(datagram)
        before, after, self.before, self.after = self.before, self.after, [], []
        arriving = [] if self.is_silent else [datagram]
        if self.is_swapped:
            arriving = [self.forged(measured=OTHER_ARM, planned=OTHER_ARM)]
        if self.is_shuffled:
            arriving = [*arriving, *self.true[-4:-1], datagram] if len(self.true) % 3 else []
        return [*before, *arriving, *after]

    def _leaving(self, datagram: bytes) -> list[bytes]:
        position = self._codec.decode(datagram).position
        assert position is not None
        self.sent.append(position)  # type: ignore[arg-type]
        return [datagram]


Action = Callable[[Attacked], None]


def old(behind: int, count: int) -> Action:
    """Datagrams that come again, late."""
    return lambda loop: loop.after.extend(loop.true[-behind:][:count])


def forged(joint: int, by: float, number: int, later: float) -> Action:
    def act(loop: Attacked) -> None:
        newest = loop.newest
        false = joints([value + by * (index == joint) for index, value in enumerate(newest.measured)])
        where = loop.before if number % 2 else loop.after
        loop.deceived_at = loop.clock.now() + (0.0 if number % 2 else CYCLE)  # after the true one it is a cycle later
        seqno, time = (newest.seqno + number) % 2**32, max(0.0, newest.measured_time + later)
        where.append(loop.forged(measured=false, planned=false, seqno=seqno, measured_time=time))

    return act


def not_running(cycles: int) -> Action:
    def act(loop: Attacked) -> None:
        for _ in range(cycles):
            newest = loop.newest
            number, time = newest.seqno + 1, newest.measured_time + 0.9 * CYCLE
            loop.before.append(loop.forged(motors=MotorState.OFF, seqno=number, measured_time=time))
            loop.move(1)

    return act


def truncated(seed: int) -> Action:
    return lambda loop: loop.after.append(loop.true[-1][: Random(seed).randrange(len(loop.true[-1]))])


def damaged(seed: int) -> Action:
    """As no network does: UDP has a checksum."""

    def act(loop: Attacked) -> None:
        chance, datagram = Random(seed), bytearray(loop.true[-1])
        for _ in range(chance.randrange(1, 6)):
            datagram[chance.randrange(len(datagram))] ^= 1 << chance.randrange(8)
        loop.after.append(bytes(datagram))

    return act


def for_a_while(name: str, cycles: int, value: float = True) -> Action:
    def act(loop: Attacked) -> None:
        setattr(loop, name, value)
        loop.move(cycles)
        setattr(loop, name, type(value)(0))

    return act


def deaf(cycles: int) -> Action:
    def act(loop: Attacked) -> None:
        to_robot, loop.to_robot = loop.to_robot, lambda datagram: (loop._leaving(datagram), ())[1]
        loop.unheard_until = inf
        loop.move(cycles)
        loop.to_robot, loop.deceived_at = to_robot, loop.clock.now()
        loop.unheard_until = loop.deceived_at + 6.5 * CYCLE

    return act


def set_clock(by: float) -> Action:
    def act(loop: Attacked) -> None:
        loop.clock_offset = max(-20_000.0, loop.clock_offset + by)

    return act


def take_over(loop: Attacked) -> None:
    """As recover does."""
    if (
        all(info.state is not State.ACTIVE for info in loop.manager.controllers())
        and loop.line.state is not None
        and loop.line.state.is_running
    ):
        loop.activate()


def restart(loop: Attacked) -> None:
    loop.restart()


DITHERS = (0.0039, -0.0039, CYCLE - 2e-6, 0.5 * CYCLE, -0.5 * CYCLE)
"""By how much each second time of the robot is false [s]: some then are 2 µs apart."""

ACCIDENTS = (
    st.builds(old, st.integers(2, 250), st.integers(1, 5)),
    st.builds(old, st.integers(50, 250), st.integers(50, 100)),
    st.builds(truncated, st.integers(0, 10_000)),
    st.builds(for_a_while, st.just("is_silent"), st.integers(1, 30) | st.integers(30, 120)),
    st.builds(for_a_while, st.just("is_swapped"), st.integers(1, 60)),
    st.builds(for_a_while, st.just("is_shuffled"), st.integers(2, 40)),
    st.builds(deaf, st.integers(1, 60)),
    st.builds(set_clock, st.sampled_from((-10_000.0, -0.5, 0.3, 100.0))),
    st.just(restart),
    st.just(take_over),
    st.just(take_over),
)

FORGERIES = (
    st.builds(
        forged,
        st.integers(0, 6),
        st.sampled_from((0.0, 0.03, -0.035, 0.09, -0.5, 3.0, -6.0, 100.0)),
        st.integers(-70, 70) | st.sampled_from((-300, 1, 1, 1, 2, 5, 1000)),
        st.sampled_from((CYCLE, 0.0, 2 * CYCLE, -0.5, 0.1, 10.0, 1e6)),
    ),
    st.builds(not_running, st.integers(1, 5)),
    st.builds(damaged, st.integers(0, 10_000)),
)
"""Of a sender with the robot's own address and port."""


def assert_within_limits(loop: Attacked) -> None:
    """Position range, speed and acceleration always; the jerk but for the exceptions named here.

    - A session in which the robot does not follow yet begins where it is measured: the path begins anew there.
    - A command that the robot does not hear stops at once: the path begins anew, at rest.
    - After a silence the command goes on from standstill, since it has stood still; the path begins anew, at rest.
    - Until four cycles in a row have the same length (datagrams were lost), the differences of speeds show no jerk.
    """
    limits, last = YUMI_LIMITS, loop.cycles[0]
    velocity, acceleration, was, even = [0.0] * 7, [0.0] * 7, 0.0, 0
    for number, cycle in enumerate(loop.cycles[1:], 1):
        state, path = cycle.state, cycle.sent.position
        dt = min(state.dt, CYCLE)
        assert limits.outside(path) is None
        is_start = path == state.position and state.session != last.state.session
        if is_start:
            is_long_ago = state.time - last.state.time >= RECENT
            has_begun = any(0.0 <= state.time - begun < RECENT for begun in loop.begun)
            assert is_long_ago or has_begun or path == last.sent.position
        if is_start or state.dt <= 0.0 or number in loop.waits:
            assert is_start or path == pytest.approx(last.sent.position, abs=1e-4)
            velocity, acceleration, was, even = [0.0] * 7, [0.0] * 7, 0.0, 0
        elif dt >= 0.1 * CYCLE:
            even = even + 1 if abs(dt - was) < 1e-5 else 0
            for joint, (old_position, new_position) in enumerate(zip(last.sent.position, path, strict=True)):
                speed = (new_position - old_position) / dt
                rate = (speed - velocity[joint]) / max(dt, 0.5 * (dt + was))  # speeds are means of their cycles
                jerk = (rate - acceleration[joint]) / dt
                assert abs(speed) <= 1.001 * limits.velocity[joint] + 1e-6
                assert abs(rate) <= 1.001 * limits.acceleration[joint] + 1e-3
                if even >= 3:
                    assert abs(jerk) <= 1.25 * limits.jerk[joint] + 1.0
                velocity[joint], acceleration[joint] = speed, rate
            was = dt
        last = cycle


def assert_led_within_limits(loop: Attacked) -> None:
    """What position and speed reference together make of the robot's motion: speed always, acceleration as a rule.

    - When the robot hears us again, what it has missed arrives at once: five cycles of the motion at most.
    - A planned position that is false by less than can be known is taken for the robot's lag.
    """
    for led in loop.led:
        rows = zip(led.speed, led.before, YUMI_LIMITS.velocity, YUMI_LIMITS.acceleration, strict=True)
        for speed, before, fastest, strongest in rows:
            assert abs(speed) <= 1.001 * fastest
            missed = EGM_GAIN * 5.0 * CYCLE * max(abs(speed), abs(before)) if led.is_unheard else 0.0
            assert led.is_excused or abs(speed - before) <= 1.001 * strongest * CYCLE + missed


Script = list[tuple[int, Action]]
"""What happens to datagrams of a motion, each action before a pause [cycles]."""


def check_what_leaves(script: Script, *, feeds_speed: bool) -> Attacked:
    loop = Attacked(feeds_speed=feeds_speed)
    loop.begin()
    loop.begun.append(loop.clock.now())
    loop.move(60)
    for pause, action in script:
        action(loop)
        loop.move(1 + pause)
    loop.move(40)
    assert_within_limits(loop)
    assert loop.sent == [pytest.approx(cycle.sent.position, abs=1e-6) for cycle in loop.cycles[: len(loop.sent)]]
    return loop


def scripts(*actions: st.SearchStrategy[Action]) -> st.SearchStrategy[Script]:
    return st.lists(st.tuples(st.integers(0, 25), st.one_of(*actions)), min_size=1, max_size=6)


@settings(suppress_health_check=list(HealthCheck))
@example(  # a command that turned round was taken for one that stands, and stopped at once
    script=[(18, for_a_while("is_silent", 7))], feeds_speed=True
)
@example(  # late datagrams of the session before were answered with its last command when the next had begun
    script=[(0, restart), (0, old(50, 50))], feeds_speed=False
)
@example(  # a late datagram with the number that was due next made the plan of a new session look as if it moved
    script=[(1, restart), (0, old(61, 1))], feeds_speed=False
)
@example(  # a command that waited when positions could not be believed waited on when they could
    script=[(0, deaf(43)), (14, for_a_while("is_swapped", 34)), (19, for_a_while("is_swapped", 34))], feeds_speed=True
)
@example(  # a late datagram of the session before, alone, was answered with its last command in the next session
    script=[(0, restart), (0, old(52, 50))], feeds_speed=False
)
@example(script=[(0, restart), (0, old(63, 61)), (0, old(50, 50))], feeds_speed=False)  # and so were two
@example(  # where a robot that brakes was expected to report, in place of a false position, was half a cycle behind it
    script=[
        (0, for_a_while("is_shuffled", 29)),
        (22, take_over),
        (15, for_a_while("is_swapped", 29)),
        (0, for_a_while("is_swapped", 1)),
    ],
    feeds_speed=False,
)
@example(  # a late datagram of the session before the last, with the number due next, hid that the last command leads
    script=[
        (0, restart),
        (0, for_a_while("is_swapped", 39)),
        (25, for_a_while("is_swapped", 60)),
        (0, restart),
        (0, old(189, 1)),
    ],
    feeds_speed=True,
)
@example(  # a clock that was set back: no reply for a second, then that of another session
    script=[(10, for_a_while("is_shuffled", 34)), (0, set_clock(-10000.0))], feeds_speed=True
)
@example(  # late datagrams of a second ago, when two of a robot whose clock was set back are believed
    script=[
        (25, set_clock(-10000.0)),
        (0, for_a_while("is_silent", 120)),
        (25, for_a_while("is_silent", 66)),
        (0, old(240, 50)),
        (3, old(240, 50)),
    ],
    feeds_speed=False,
)
@example(  # a session whose clock went back had the number and the clock of the one before, after a silence
    script=[(0, set_clock(-0.5)), (0, restart), (0, for_a_while("is_silent", 82))], feeds_speed=False
)
@given(scripts(*ACCIDENTS), st.booleans())
def test_what_leaves_and_how_the_robot_is_led_keep_the_limits_after_accidents(
    script: Script, feeds_speed: bool
) -> None:
    assert_led_within_limits(check_what_leaves(script, feeds_speed=feeds_speed))


@settings(suppress_health_check=list(HealthCheck))
@example(  # the plan that comes back after implausible ones was taken for the motion of one cycle
    script=[(18, damaged(0)), (18, damaged(0)), (22, old(2, 1)), (0, for_a_while("is_swapped", 32))], feeds_speed=False
)
@example(  # a copy of a datagram made a plan that moved look as if it stood, in a session that was none
    script=[(0, for_a_while("is_shuffled", 2)), (0, not_running(1))], feeds_speed=False
)
@example(  # after the clock was set a single old datagram replaced a session that others had agreed with
    script=[(0, not_running(1)), (6, damaged(0)), (9, set_clock(-10_000.0)), (2, old(13, 3)), (0, old(80, 3))],
    feeds_speed=True,
)
@example(  # three copies, then motors that seem off, while the arm moves
    script=[(0, old(3, 3)), (0, not_running(3))], feeds_speed=False
)
@example(  # a forged plan that comes after a true datagram is a cycle later
    script=[(15, not_running(4)), (0, forged(0, 0.0, 2, CYCLE))], feeds_speed=False
)
@example(  # a forged word that the motors are off came with a plan a cycle old, which was taken for a lead
    script=[(3, deaf(55)), (8, take_over), (3, not_running(1)), (0, not_running(1))], feeds_speed=True
)
@example(
    script=[
        (14, damaged(0)),
        (21, for_a_while("is_shuffled", 40)),
        (2, not_running(1)),
        (6, not_running(1)),
        (0, for_a_while("is_swapped", 15)),
    ],
    feeds_speed=True,
)
@example(  # a command waits to be heard for as many datagrams after a silence as before it
    script=[(0, deaf(7)), (0, for_a_while("is_silent", 4)), (0, for_a_while("is_swapped", 1))], feeds_speed=False
)
@given(scripts(*ACCIDENTS, *FORGERIES), st.booleans())
def test_what_leaves_keeps_the_limits_whatever_arrives(script: Script, feeds_speed: bool) -> None:
    check_what_leaves(script, feeds_speed=feeds_speed)


@pytest.mark.soak
@pytest.mark.timeout(7200)
@settings(max_examples=RECEIVE_EXAMPLES, suppress_health_check=list(HealthCheck))
@given(scripts(*ACCIDENTS), st.booleans())
def test_what_leaves_and_how_the_robot_is_led_keep_the_limits_after_accidents_for_long(
    script: Script, feeds_speed: bool
) -> None:
    assert_led_within_limits(check_what_leaves(script, feeds_speed=feeds_speed))


@pytest.mark.soak
@pytest.mark.timeout(7200)
@settings(max_examples=RECEIVE_EXAMPLES, suppress_health_check=list(HealthCheck))
@given(scripts(*ACCIDENTS, *FORGERIES), st.booleans())
def test_what_leaves_keeps_the_limits_whatever_arrives_for_long(script: Script, feeds_speed: bool) -> None:
    check_what_leaves(script, feeds_speed=feeds_speed)


ONE_DATAGRAM = {
    **{f"{behind} old": old(behind + 1, 1) for behind in (10, 20, 30, 60, 100, 200)},
    **{f"forged {by:g} rad": forged(2, by, 1, CYCLE) for by in (0.035, 0.09, 0.52, 10.0)},
    "burst of 100 old": old(220, 100),
    "duplicate": old(1, 1),
}


@pytest.mark.parametrize("name", ONE_DATAGRAM)
def test_motion_goes_on_whatever_false_datagram_arrives(name: str) -> None:
    loop = Attacked()
    loop.begin()
    loop.begun.append(loop.clock.now())
    loop.move(300)
    planned, before = loop.robot.arm.planned, len(loop.cycles)
    ONE_DATAGRAM[name](loop)
    loop.move(2)
    assert max(abs(new - old) for new, old in zip(loop.robot.arm.planned, planned, strict=True)) < 0.05
    loop.move(60)
    assert_within_limits(loop)
    assert loop.snapshot.session == 1
    assert len(loop.cycles) - before >= 61  # this end looks once a cycle, and may find the false one
    assert loop.snapshot.is_commanded


@pytest.mark.parametrize("feeds_speed", [False, True])
@pytest.mark.parametrize("dither", DITHERS)
def test_motion_goes_on_within_the_limits_while_the_robots_clock_dithers(dither: float, feeds_speed: bool) -> None:
    loop = Attacked(feeds_speed=feeds_speed)
    loop.begin()
    loop.begun.append(loop.clock.now())
    loop.move(100)
    for_a_while("dither", 60 if feeds_speed else 200, dither)(loop)  # with speeds not as far as the end of its range
    loop.move(60)
    assert_within_limits(loop)
    assert_led_within_limits(loop)
    assert loop.snapshot.session == 1
    assert loop.snapshot.is_commanded


@pytest.mark.parametrize("by_deg", [2.0, 5.0, 30.0, 350.0])
@pytest.mark.parametrize("is_commanded", [False, True])
def test_arm_at_rest_does_not_believe_a_forged_datagram(by_deg: float, is_commanded: bool) -> None:
    loop = Attacked()
    loop.start(FULL_SPEED)
    loop.run(0.5)
    if is_commanded:
        loop.activate()
    loop.run(0.5)
    assert len(set(loop.sent[-50:])) == 1
    stood_at, before = loop.sent[-1], len(loop.sent)
    forged(0, radians(by_deg), 1, CYCLE)(loop)
    for _ in range(3):
        loop.cycle()
    assert loop.snapshot.limiter.implausible == 1
    assert loop.snapshot.is_commanded == is_commanded
    assert loop.snapshot.session == 1
    assert len(loop.sent) - before >= 3  # the true ones that follow are answered
    assert set(loop.sent[before:]) == {stood_at}
    loop.run(0.5)
    assert set(loop.sent[before:]) == {stood_at}


@pytest.mark.parametrize("cycles", [20, 30, 120, 2500])
def test_lead_is_taken_back_within_the_limits_after_a_silence(cycles: int) -> None:
    loop = Attacked()
    loop.begin()
    loop.begun.append(loop.clock.now())
    loop.go(YUMI_LIMITS.upper)
    for _ in range(60):
        loop.cycle()
    loop.is_silent = True
    for _ in range(cycles):
        loop.cycle()
    loop.is_silent = False
    for _ in range(300):
        loop.cycle()
    assert_within_limits(loop)
    assert loop.line.is_still
    assert [event for event in loop.events if isinstance(event, SessionResumed)]


Delay = Callable[[int], float]
"""How late a datagram arrives [s], by its number on the wire; infinite when it is lost."""


def late(delay: Delay) -> Wire:
    """A wire on which datagrams wait, and those that are due in one cycle arrive together."""
    waiting: list[tuple[float, bytes]] = []
    cycles = count()

    def arriving(datagram: bytes) -> list[bytes]:
        cycle = next(cycles)
        waiting.append((cycle + delay(cycle) / CYCLE, datagram))
        waiting.sort(key=lambda each: each[0])
        due = [datagram for time, datagram in waiting if time <= cycle]
        del waiting[: len(due)]
        return due

    return arriving


LATE: dict[str, Callable[[Random], Delay]] = {
    "4 at once": lambda _: lambda number: -number % 4 * CYCLE,
    "12 at once": lambda _: lambda number: -number % 12 * CYCLE,
    "50 ms late": lambda _: lambda _: 0.05,
    "0 to 30 ms late": lambda random: lambda _: random.uniform(0.0, 0.03),
    "overtaken within 3": lambda random: lambda _: random.randint(0, 3) * CYCLE,
    "half of them lost": lambda random: lambda _: random.choice((0.0, inf)),
}


@pytest.mark.parametrize("feeds_speed", [False, True])
@pytest.mark.parametrize("name", LATE)
def test_motion_goes_on_within_the_limits_when_datagrams_come_late_at_once_or_not_at_all(
    name: str, feeds_speed: bool
) -> None:
    loop = Attacked(feeds_speed=feeds_speed, silence=EgmSettings().silence)
    loop.begin()
    loop.begun.append(loop.clock.now())
    loop.move(100)
    arriving, wire = loop.to_us, late(LATE[name](Random(1)))
    loop.to_us = lambda datagram: [each for sent in arriving(datagram) for each in wire(sent)]
    if name in ("50 ms late", "0 to 30 ms late"):  # so late that no reply can show
        loop.unheard_until = inf
    loop.move(60 if feeds_speed else 200)
    before, loop.to_us = len(loop.cycles), arriving
    loop.move(60)
    assert_within_limits(loop)
    assert_led_within_limits(loop)
    assert len(loop.cycles) - before >= 59  # this end looks once a cycle, and may find the last late one
    assert loop.snapshot.session == 1
    assert loop.snapshot.is_commanded


@pytest.mark.parametrize("feeds_speed", [False, True])
@pytest.mark.parametrize("cycles", [4, 12, 18])
def test_motion_goes_on_within_the_limits_after_a_short_silence(cycles: int, feeds_speed: bool) -> None:
    loop = Attacked(feeds_speed=feeds_speed, silence=EgmSettings().silence)
    loop.begin()
    loop.begun.append(loop.clock.now())
    loop.move(300)
    for_a_while("is_silent", cycles)(loop)
    loop.move(60)
    assert_within_limits(loop)
    assert_led_within_limits(loop)
    assert loop.snapshot.session == 1
    assert loop.snapshot.is_commanded


@pytest.mark.parametrize("cycles", [3, 10, 25, 250, 1250])
def test_speed_that_was_fed_forward_is_not_resumed_at_once_after_a_silence(cycles: int) -> None:
    loop = Attacked(feeds_speed=True)
    loop.begin()
    loop.move(390)
    assert abs(loop.cycles[-1].sent.velocity[0]) > 0.8
    loop.is_silent = True
    loop.run(cycles * CYCLE)
    loop.is_silent = False
    stood_at = loop.robot.arm.planned
    loop.move(60)
    assert_led_within_limits(loop)
    if cycles > 25:  # its controllers were deactivated
        assert loop.robot.arm.planned == pytest.approx(stood_at, abs=1e-3)


def test_arm_that_is_fed_speeds_brakes_no_harder_than_its_limits_while_its_feedback_is_false() -> None:
    loop = Attacked(feeds_speed=True)
    loop.begin()
    loop.move(320)
    assert abs(loop.led[-1].speed[0]) > 1.5
    before = len(loop.led)
    loop.is_swapped = True
    for _ in range(60):
        loop.move(1)
        assert dist(loop.cycles[-1].state.planned, loop.newest.planned) < 2e-3  # as the commands lead the robot
    assert loop.snapshot.limiter.implausible == 60
    for led in loop.led[before:]:
        rows = zip(led.speed, led.before, YUMI_LIMITS.acceleration, strict=True)
        assert all(abs(speed - old) <= 1.001 * strongest * CYCLE for speed, old, strongest in rows)


@pytest.mark.parametrize("swapped", [3, 4, 8, 24])
def test_other_arms_positions_that_a_young_session_believes_lead_within_the_limits(swapped: int) -> None:
    loop = Attacked(knows_other_arm=False)
    loop.begin()
    loop.move(60)
    loop.restart()
    stood_at = loop.robot.arm.planned
    loop.move(4)
    for_a_while("is_swapped", swapped)(loop)
    loop.move(40)
    assert_led_within_limits(loop)
    assert loop.robot.arm.planned == pytest.approx(stood_at, abs=0.2)


@pytest.mark.parametrize("swapped", [3, 8, 24, 60])
def test_other_arms_positions_are_never_believed_by_a_young_session_that_knows_the_other_arm(swapped: int) -> None:
    loop = Attacked()
    loop.begin()
    loop.move(60)
    loop.restart()
    while loop.snapshot.session == 1:
        loop.move(1)
    loop.move(4)
    begun = len(loop.cycles)
    for_a_while("is_swapped", swapped)(loop)
    loop.move(40)
    assert_within_limits(loop)
    assert_led_within_limits(loop)
    assert all(dist(cycle.state.position, OTHER_ARM) > 1.0 for cycle in loop.cycles[begun:])
    doubts = [event for event in loop.events if isinstance(event, ImplausibleFeedback)]
    assert doubts
    assert all(event.is_other_arm for event in doubts)
    assert loop.snapshot.problem is ArmProblem.NONE


def test_session_that_begins_anew_does_not_feed_the_old_speed_to_a_standing_arm() -> None:
    loop = Attacked(feeds_speed=True)
    loop.begin()
    loop.move(390)
    loop.restart()
    stood_at = loop.robot.arm.planned
    loop.run(0.2)
    assert_led_within_limits(loop)
    assert loop.robot.arm.planned == pytest.approx(stood_at, abs=1e-3)


def test_robot_that_hears_nothing_is_reported_within_300_ms_and_goals_are_refused_until_it_does() -> None:
    loop = Attacked()
    loop.begin()
    loop.begun.append(loop.clock.now())
    loop.run(0.5)
    hears, loop.to_robot, loop.unheard_until = loop.to_robot, lambda datagram: (), inf
    loop.go(joints([value + 0.3 for value in loop.home]))
    loop.run(0.3)
    (event,) = (event for event in loop.events if isinstance(event, ReferencesIgnored))
    assert event.deactivated == (CONTROLLER,)
    assert_says(event.said, "arm_holds_ignored", problem=message("references_ignored", arm="left"))
    assert loop.snapshot.problem is ArmProblem.REFERENCES_IGNORED
    with refused(CommandRefused, "goal_refused", reason=message("references_ignored", arm="left")):
        loop.line.check_follows()
    loop.run(1.0)
    loop.to_robot = hears
    loop.run(0.3)
    assert loop.snapshot.problem is ArmProblem.NONE
    assert loop.events[-1] == ProblemOver(Side.LEFT, ArmProblem.REFERENCES_IGNORED)
    loop.line.check_follows()
    assert dist(loop.robot.arm.planned, loop.home) < 0.01


def test_robot_that_hears_nothing_from_the_begin_is_reported_within_300_ms_of_the_first_goal() -> None:
    loop = Attacked()
    loop.to_robot, loop.unheard_until = lambda datagram: (), inf
    loop.begin()
    loop.run(0.5)
    begun = len(loop.events)
    assert loop.snapshot.is_commanded
    loop.go(joints([value + 0.3 for value in loop.home]))
    loop.run(0.3)
    (event,) = loop.events[begun:]
    assert isinstance(event, ReferencesIgnored)
    assert event.deactivated == (CONTROLLER,)
    assert loop.snapshot.problem is ArmProblem.REFERENCES_IGNORED


def test_exchanged_arms_are_reported_and_the_arm_holds() -> None:
    loop = Attacked()
    loop.begin()
    loop.begun.append(loop.clock.now())
    loop.move(300)
    for_a_while("is_swapped", 200)(loop)
    assert_within_limits(loop)
    lost = [event for event in loop.events if isinstance(event, ImplausibleFeedback) and event.is_lost]
    assert [event.deactivated for event in lost] == [(CONTROLLER,)]
    assert loop.snapshot.problem is ArmProblem.IMPLAUSIBLE
    assert loop.snapshot.limiter.implausible == 200
    assert dist(loop.robot.arm.position, loop.home) < 0.4 * 7**0.5 + 0.3
    assert loop.line.state is not None
    assert dist(lost[0].position, OTHER_ARM) < 1e-5
    assert lost[0].is_other_arm
    assert lost[0].said.values["cause"].code == "positions_of_other_arm"


def in_motion(changed: Callable[[RobotMessage], RobotMessage] | None = None) -> Attacked:
    """A loop that follows a sine; its robot's messages are ``changed`` from the first one on."""
    loop = Attacked()
    loop.changed = changed
    loop.begin()
    loop.begun.append(loop.clock.now())
    loop.move(300)
    assert loop.snapshot.is_commanded
    return loop


def is_at_rest(loop: Attacked, cycles: int = 50) -> bool:
    return len(set(loop.sent[-cycles:])) == 1


def test_motion_goes_on_when_the_robots_numbers_wrap() -> None:
    loop = in_motion(lambda message: replace(message, seqno=(message.seqno + 2**32 - 350) % 2**32))
    assert loop.newest.seqno > 2**31
    loop.move(100)
    assert loop.newest.seqno < 2**31
    assert_within_limits(loop)
    assert (loop.snapshot.session, loop.snapshot.wire.missed, loop.snapshot.is_commanded) == (1, 0, True)


def test_arm_comes_to_rest_without_a_step_when_the_robots_numbers_begin_anew_in_motion() -> None:
    loop = in_motion()
    before, begun, first = len(loop.cycles), len(loop.events), loop.newest.seqno + 1
    loop.changed = lambda message: replace(message, seqno=message.seqno - first)
    loop.move(400)
    assert_within_limits(loop)
    assert_led_within_limits(loop)
    assert len(loop.cycles) - before >= 400 - RECENT / CYCLE - 1  # as long as the robot may follow there is no reply
    assert (loop.snapshot.session, loop.snapshot.is_commanded) == (2, False)
    assert_says(loop.events[begun].said, "session_restarted_in_motion", arm="left", session=2)
    assert is_at_rest(loop)
    loop.activate()
    loop.move(100)
    assert_within_limits(loop)
    assert loop.snapshot.is_commanded


def test_session_that_begins_anew_in_motion_goes_on_from_the_last_command_where_that_was_sent_with_a_speed() -> None:
    """The speed keeps a robot that follows it degrees away from the position that was sent."""
    loop = Attacked(feeds_speed=True)
    loop.begin()
    loop.begun.append(loop.clock.now())
    loop.move(390)
    last, before, first = loop.cycles[-1].sent, len(loop.cycles), loop.newest.seqno + 1
    assert abs(last.velocity[0]) > 0.8
    loop.changed = lambda message: replace(message, seqno=message.seqno - first)
    loop.run(RECENT + 0.2)
    again = loop.cycles[before].sent
    assert again.position == pytest.approx(last.position, abs=1e-3)
    assert dist(loop.robot.arm.planned, last.position) > 0.05
    assert_within_limits(loop)
    assert_led_within_limits(loop)
    assert loop.snapshot.session == 2
    assert is_at_rest(loop)


@pytest.mark.parametrize("length", [5, 10, 40])
def test_arm_comes_to_rest_without_a_step_when_the_robots_numbers_begin_anew_again_and_again(length: int) -> None:
    loop = in_motion()
    left_at, before = loop.sent[-1], len(loop.cycles)
    loop.changed = lambda message: replace(message, seqno=message.seqno % length)
    loop.move(700)  # the first datagram of each session gets no reply
    assert_within_limits(loop)
    assert_led_within_limits(loop)
    assert len(loop.cycles) - before > 100  # the others are answered
    assert not loop.snapshot.is_commanded
    assert is_at_rest(loop)
    assert loop.robot.arm.motors_on
    assert dist(loop.sent[-1], left_at) < BRAKING


class FastClock(ManualClock):
    """Ours, of a robot that is so many times faster than a real one."""

    def __init__(self, pace: float) -> None:
        super().__init__(100.0)
        self._pace = pace

    def advance(self, duration: float) -> None:
        super().advance(duration / self._pace)


@pytest.mark.parametrize("pace", [0.5, 1.0, 3.0, 10.0])
def test_virtual_robot_that_was_restarted_is_answered_after_a_second_whatever_its_pace(pace: float) -> None:
    """Its clock begins anew with it."""
    loop = EgmLoop()
    loop.clock = FastClock(pace)
    loop.begin()
    loop.run(2.0 * pace)
    loop.robot = VirtualArmEnd(Side.LEFT, position=loop.robot.arm.position)
    loop.robot.start(FULL_SPEED)
    begun, before = loop.clock.now(), len(loop.cycles)
    loop.run(1.1 * pace)
    assert loop.snapshot.session == 2
    assert 1.0 < loop.cycles[before].state.time - begun < 1.0 + 5.0 * max(CYCLE, CYCLE / pace)
    assert loop.snapshot.is_running
    loop.activate()
    loop.run(1.0)
    assert loop.snapshot.is_commanded


STATES = {"motors": MotorState.OFF, "mci": MciState.STOPPED, "rapid": RapidState.STOPPED}


@pytest.mark.parametrize("field", STATES)
def test_arm_comes_to_rest_without_a_step_when_the_robot_says_falsely_that_it_stopped(field: str) -> None:
    loop = in_motion()
    left_at, before, first = loop.sent[-1], len(loop.cycles), loop.newest.seqno + 1
    false: dict[str, Any] = {field: STATES[field]}
    loop.changed = lambda message: message if (message.seqno - first) % 100 else replace(message, **false)
    loop.move(400)
    assert_within_limits(loop)
    assert_led_within_limits(loop)
    assert len(loop.cycles) - before == 400
    assert not loop.snapshot.is_commanded
    assert is_at_rest(loop)
    assert dist(loop.sent[-1], left_at) < BRAKING


BRAKING = 0.7
"""How far from where it was an arm that swings comes to rest, over all joints: its lead and its way to stop [rad]."""


def displaced(by_deg: Callable[[int], float]) -> Callable[[RobotMessage], RobotMessage]:
    """One joint is reported elsewhere, planned and measured, as far as ``by_deg`` says for a number."""

    def change(message: RobotMessage) -> RobotMessage:
        by = radians(by_deg(message.seqno))
        there = [
            joints([value + by * (index == 2) for index, value in enumerate(each)])
            for each in (message.measured, message.planned)
        ]
        return replace(message, measured=there[0], planned=there[1])

    return change


JUMPS: dict[str, Callable[[int], float]] = {
    "every 100": lambda seqno: 0.0 if seqno % 100 else 30.0,
    "every other": lambda seqno: 30.0 * (seqno % 2),
    "forth and back": lambda seqno: 30.0 if seqno % 2 else -30.0,
    "farther each": lambda seqno: 30.0 * (seqno % 5),
}


@pytest.mark.parametrize("name", JUMPS)
def test_robot_that_jumps_is_reported_as_such_and_leads_no_command_away(name: str) -> None:
    loop = in_motion()
    begun, before, left_at = len(loop.events), len(loop.cycles), loop.sent[-1]
    loop.changed = displaced(JUMPS[name])
    loop.move(500)
    assert_within_limits(loop)
    assert_led_within_limits(loop)
    assert len(loop.cycles) - before == 500
    assert loop.snapshot.limiter.implausible >= 5
    doubts = [event for event in loop.events[begun:] if isinstance(event, ImplausibleFeedback)]
    assert doubts
    for event in doubts:
        assert not event.is_other_arm
        code = "position_not_believed_for_long" if event.is_lost else "position_not_believed"
        assert_says(event.said, code, joint="yumi_joint_7_l")
        assert radians(9.95) <= event.said.values["distance"] < radians(99.95)
        if event.is_lost:
            assert event.said.values["cause"] == message("positions_implausible")
    if name == "forth and back":  # no datagram is true: the arm holds
        assert [event.deactivated for event in doubts if event.is_lost] == [(CONTROLLER,)]
        assert loop.snapshot.problem is ArmProblem.IMPLAUSIBLE
        assert is_at_rest(loop)
        assert dist(loop.sent[-1], left_at) < BRAKING
    else:
        assert loop.snapshot.is_commanded
        assert max(abs(value - middle) for value, middle in zip(loop.sent[-1], loop.home, strict=True)) < 0.5


@pytest.mark.parametrize("by_deg", [-30.0, -5.0, 2.0, 10.0])
def test_arm_that_holds_does_not_run_after_positions_that_stay_displaced(by_deg: float) -> None:
    """Since the robot follows its commands, positions that are reported displaced would always be ahead of them."""
    loop = in_motion()
    loop.changed = displaced(lambda seqno: by_deg)
    loop.move(60)
    if loop.snapshot.is_commanded:
        loop.deactivate()
    left_at = loop.robot.arm.position
    loop.run(1.5)
    assert_within_limits(loop)
    assert loop.robot.arm.motors_on
    assert is_at_rest(loop)
    assert dist(loop.robot.arm.position, left_at) < BRAKING
