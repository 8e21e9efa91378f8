from __future__ import annotations

from math import nan

import pytest

from abb_protocols.catalogue import message
from abb_protocols.robot.joints import (
    CYCLE,
    YUMI_LIMITS,
    ZERO_JOINTS,
    ArmCommand,
    ArmState,
    Joints,
    Side,
    joint_names,
    joints,
)
from controller_arms import LimitedArm
from egm_loop import EgmLoop
from refusals import assert_says
from reported_limiter import ReportedLimiter
from yumi.control.controller import Controller
from yumi.control.counters import LimiterCounters, WireCounters
from yumi.control.cycle import Cycle
from yumi.control.goals import MemoryBuffer
from yumi.control.limiter import Limiter
from yumi.control.loop import LONGEST_UNANSWERED, ArmLoop
from yumi.control.loop_commands import Commands
from yumi.control.loop_events import (
    ControllerFailed,
    ControllersLate,
    RobotFollows,
    RobotStoppedFollowing,
    SessionLost,
    SessionResumed,
    SessionStarted,
    is_fault,
)
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.motion.standstill import SentPositions
from yumi.control.shared_state import Limited, Snapshot, read_snapshot


class ScriptedArm:
    """Reports what the test puts in, remembers what it was told."""

    def __init__(self) -> None:
        self.next: ArmState | None = None
        self.told: list[ArmCommand] = []
        self.lost: float | None = None
        self.age = 0.0
        self.foreign = 0

    def read(self, now: float) -> ArmState | None:
        state, self.next = self.next, None
        return state

    def write(self, command: ArmCommand) -> None:
        self.told.append(command)

    def silence(self, now: float) -> float:
        return self.age

    def lost_after(self, now: float) -> float | None:
        lost, self.lost = self.lost, None
        return lost

    def wire_counters(self) -> WireCounters:
        return WireCounters(session=1, missed=3, foreign=self.foreign)


class Pusher(Controller):
    kind = "test/Pusher"
    fault = False

    def activate(self, state: ArmState) -> None:
        self.goal = state.position

    def update(self, state: ArmState) -> ArmCommand | None:
        if self.fault:
            raise RuntimeError("broken")
        return ArmCommand(tuple(value + 0.001 for value in state.position))  # type: ignore[arg-type]

    @property
    def reference(self) -> Joints | None:
        return self.goal


@pytest.fixture
def arm() -> ScriptedArm:
    return ScriptedArm()


@pytest.fixture
def snapshots() -> MemoryBuffer:
    return MemoryBuffer()


@pytest.fixture
def loop(arm: ScriptedArm, snapshots: MemoryBuffer) -> ArmLoop:
    manager = ControllerManager(joint_names(Side.LEFT))
    manager.load("pusher", Pusher())
    manager.configure("pusher")
    limiter = ReportedLimiter(YUMI_LIMITS)
    return ArmLoop(Side.LEFT, LimitedArm(arm, limiter), manager, limiter, snapshots)


def feed(
    loop: ArmLoop, arm: ScriptedArm, position: Joints, *, session: int = 1, is_running: bool = True, now: float = 1.0
) -> None:
    arm.next = ArmState(now, 0.004, session, position, ZERO_JOINTS, position, is_running)
    loop.run(now)


def test_loop_does_nothing_without_a_datagram(loop: ArmLoop, arm: ScriptedArm) -> None:
    assert loop.run(0.0) is None
    assert arm.told == []
    assert loop.state is None


def test_loop_answers_the_first_datagram_with_the_measured_position(
    loop: ArmLoop, arm: ScriptedArm, middle: Joints
) -> None:
    feed(loop, arm, middle)
    assert arm.told == [ArmCommand(middle)]
    assert loop.take_events() == [SessionStarted(Side.LEFT, 1), RobotFollows(Side.LEFT)]


def test_loop_publishes_a_snapshot_after_each_reply(
    loop: ArmLoop, arm: ScriptedArm, snapshots: MemoryBuffer, middle: Joints
) -> None:
    feed(loop, arm, middle)
    snapshot = read_snapshot(snapshots)
    assert (snapshot.cycles, snapshot.wire.missed, snapshot.is_running, snapshot.position) == (1, 3, True, middle)
    assert snapshot.reference is None


def test_loop_shows_a_switch_in_the_snapshot_at_once(
    loop: ArmLoop, arm: ScriptedArm, snapshots: MemoryBuffer, middle: Joints
) -> None:
    feed(loop, arm, middle)
    Commands({Side.LEFT: loop}, lambda: 1.001).switch_controllers(Side.LEFT, ["pusher"])
    assert read_snapshot(snapshots).is_commanded
    Commands({Side.LEFT: loop}, lambda: 1.002).switch_controllers(Side.LEFT, [], ["pusher"])
    assert not read_snapshot(snapshots).is_commanded


def test_loop_deactivates_controllers_when_the_robot_falls_silent(
    loop: ArmLoop, arm: ScriptedArm, snapshots: MemoryBuffer, middle: Joints
) -> None:
    feed(loop, arm, middle)
    loop.manager.switch(["pusher"], [], loop.state)
    loop.take_events()
    for now in (1.015, 1.03, 1.05):
        loop.watch_silence(now)
    arm.lost = 0.062
    loop.watch_silence(1.062)
    (event,) = loop.take_events()
    assert event == SessionLost(Side.LEFT, 0.062, ("pusher",))
    assert event.said == message("feedback_lost", arm="left", silence=0.062, controllers=("pusher",))
    assert read_snapshot(snapshots) == Snapshot(
        time=1.062, wire=WireCounters(session=1, missed=3), activity=4, position=middle, sent=middle, cycles=1
    )


def test_loop_that_stood_still_ends_what_commanded_before_it_answers_what_waits(
    loop: ArmLoop, arm: ScriptedArm, middle: Joints
) -> None:
    feed(loop, arm, middle)
    loop.manager.switch(["pusher"], [], loop.state)
    feed(loop, arm, middle, now=1.004)
    loop.take_events()
    arm.lost = 2.3
    feed(loop, arm, middle, now=3.304)
    lost, resumed, _ = loop.take_events()
    assert isinstance(lost, SessionLost)
    assert (lost.silence, lost.deactivated, lost.stood_still) == (2.3, ("pusher",), pytest.approx(2.3))
    assert_says(lost.said, "driver_stood_still_in_motion", arm="left", controllers=("pusher",))
    assert resumed == SessionResumed(Side.LEFT, 1)
    assert not loop.manager.is_commanding


def test_loop_that_stood_still_without_a_motion_says_so(loop: ArmLoop, arm: ScriptedArm, middle: Joints) -> None:
    feed(loop, arm, middle)
    loop.take_events()
    arm.lost = 0.3
    loop.watch_silence(1.3)
    (event,) = loop.take_events()
    assert_says(event.said, "driver_stood_still", arm="left", duration=0.3)


def test_loop_tells_that_a_session_goes_on_after_a_silence(loop: ArmLoop, arm: ScriptedArm, middle: Joints) -> None:
    feed(loop, arm, middle)
    arm.lost = 0.1
    loop.watch_silence(1.1)
    loop.take_events()
    feed(loop, arm, middle)
    events = loop.take_events()
    assert events == [SessionResumed(Side.LEFT, 1), RobotFollows(Side.LEFT)]
    assert events[0].said == message("session_resumed", arm="left", session=1)


def test_loop_shows_that_somebody_else_speaks_while_it_waits_for_a_robot(
    loop: ArmLoop, arm: ScriptedArm, snapshots: MemoryBuffer
) -> None:
    arm.foreign = 7
    loop.watch_silence(1.0)
    assert read_snapshot(snapshots).wire.foreign == 7


def test_loop_bears_an_interruption_and_goes_on(
    loop: ArmLoop, arm: ScriptedArm, snapshots: MemoryBuffer, middle: Joints
) -> None:
    feed(loop, arm, middle)
    Commands({Side.LEFT: loop}, lambda: 1.0).switch_controllers(Side.LEFT, ["pusher"])
    loop.take_events()
    arm.age = 0.021
    for now in (1.021, 1.03, 1.04):
        loop.watch_silence(now)
    snapshot = read_snapshot(snapshots)
    assert (snapshot.is_streaming, snapshot.is_running, snapshot.interruptions) == (False, True, 1)
    feed(loop, arm, middle)
    assert read_snapshot(snapshots).is_streaming
    assert read_snapshot(snapshots).is_commanded
    assert loop.take_events() == []


def test_loop_deactivates_controllers_when_the_robot_stops_following(
    loop: ArmLoop, arm: ScriptedArm, middle: Joints
) -> None:
    feed(loop, arm, middle)
    loop.manager.switch(["pusher"], [], loop.state)
    loop.take_events()
    feed(loop, arm, middle, is_running=False)
    assert loop.take_events() == [RobotStoppedFollowing(Side.LEFT, ("pusher",))]


def test_loop_begins_a_new_session_without_controllers_and_without_a_jump(
    loop: ArmLoop, arm: ScriptedArm, middle: Joints
) -> None:
    feed(loop, arm, ZERO_JOINTS)
    loop.manager.switch(["pusher"], [], loop.state)
    for now in (20.0, 20.004, 20.008):  # the first datagram alone may be late
        feed(loop, arm, middle, session=2, now=now)
    assert arm.told[1:] == [ArmCommand(middle), ArmCommand(middle)]


def test_loop_holds_and_tells_when_a_controller_fails(loop: ArmLoop, arm: ScriptedArm, middle: Joints) -> None:
    feed(loop, arm, middle)
    loop.manager.switch(["pusher"], [], loop.state)
    loop.take_events()
    Pusher.fault = True
    try:
        feed(loop, arm, middle)
    finally:
        Pusher.fault = False
    (event,) = loop.take_events()
    assert isinstance(event, ControllerFailed)
    assert_says(event.said, "controller_failed", arm="left")
    assert event.failure.values["controller"] == "pusher"
    assert arm.told[-1] == ArmCommand(middle)


def test_loop_is_not_still_while_a_command_leads_the_robot() -> None:
    """What is measured is behind what was commanded, and a command stays in force when nobody answers any more."""
    loop = EgmLoop()
    loop.begin()
    loop.go(YUMI_LIMITS.upper)
    loop.run(0.02)
    loop.deactivate()
    assert not loop.line.is_still
    loop.run(1.0)
    assert loop.line.is_still


def test_loop_shows_what_an_arm_is_kept_apart_from_while_it_is(
    loop: ArmLoop, arm: ScriptedArm, snapshots: MemoryBuffer, middle: Joints, monkeypatch: pytest.MonkeyPatch
) -> None:
    pair = Limited("left gripper", "post", 0.011)
    monkeypatch.setattr(Limiter, "limited", pair)
    monkeypatch.setattr(Limiter, "counters", LimiterCounters())

    def keep_apart_once() -> None:
        counters = loop._limiter.counters
        monkeypatch.setattr(Limiter, "counters", counters._replace(kept_apart=counters.kept_apart + 1))

    feed(loop, arm, middle, now=20.0)
    assert read_snapshot(snapshots).limited_part == ""  # nothing was limited: the pair is an old one
    keep_apart_once()
    feed(loop, arm, middle, now=20.001)
    assert read_snapshot(snapshots).limited_part == ""  # it stands where it is to be
    loop.manager.switch(["pusher"], [], loop.state)
    keep_apart_once()
    feed(loop, arm, middle, now=20.004)
    shown = read_snapshot(snapshots)
    assert shown.limited == pair
    feed(loop, arm, middle, now=20.1)
    assert read_snapshot(snapshots).limited_part == "left gripper"
    feed(loop, arm, middle, now=20.3)
    assert read_snapshot(snapshots).limited_part == ""
    keep_apart_once()
    feed(loop, arm, middle, now=20.304)
    arm.lost = 0.1
    loop.watch_silence(20.4)
    assert read_snapshot(snapshots).limited_part == ""


@pytest.mark.parametrize(("cycles", "is_hung"), [(49, False), (50, True)])
def test_controllers_are_deactivated_before_they_are_asked_again_when_the_core_has_answered_for_long(
    loop: ArmLoop, arm: ScriptedArm, middle: Joints, monkeypatch: pytest.MonkeyPatch, cycles: int, is_hung: bool
) -> None:
    feed(loop, arm, middle, now=20.0)
    loop.manager.switch(["pusher"], [], loop.state)
    loop.take_events()
    monkeypatch.setattr(Limiter, "unanswered", cycles)
    feed(loop, arm, middle, now=20.0 + cycles * CYCLE)
    late = ControllersLate(Side.LEFT, cycles, ("pusher",), ("pusher",) if is_hung else ())
    assert loop.take_events() == [late]
    assert is_fault(late) == is_hung
    assert bool(loop.activation) != is_hung
    assert (arm.told[-1].position == middle) == is_hung


def test_controllers_that_are_late_each_time_are_deactivated(
    loop: ArmLoop, arm: ScriptedArm, middle: Joints, monkeypatch: pytest.MonkeyPatch
) -> None:
    feed(loop, arm, middle, now=20.0)
    loop.manager.switch(["pusher"], [], loop.state)
    for number in range(1, 30):  # the core has answered two datagrams in each update
        assert loop.activation
        monkeypatch.setattr(Limiter, "unanswered", number * 2)
        loop.run(20.0 + number * 2 * CYCLE)
        loop.watch_silence(20.0 + number * 2 * CYCLE)
        if number * 2 * CYCLE > LONGEST_UNANSWERED:
            break
    assert not loop.activation


def test_short_times_without_an_answer_deactivate_nothing_however_many(
    loop: ArmLoop, arm: ScriptedArm, middle: Joints, monkeypatch: pytest.MonkeyPatch
) -> None:
    feed(loop, arm, middle, now=20.0)
    loop.manager.switch(["pusher"], [], loop.state)
    for number in range(1, 10):
        monkeypatch.setattr(Limiter, "unanswered", number * 40)
        feed(loop, arm, middle, now=20.0 + number * 0.16)
    assert loop.activation


@pytest.mark.parametrize(("time", "is_newest"), [(20.004, True), (19.996, False)])
def test_controllers_know_what_the_core_has_sent_in_their_place(
    loop: ArmLoop, arm: ScriptedArm, middle: Joints, monkeypatch: pytest.MonkeyPatch, time: float, is_newest: bool
) -> None:
    feed(loop, arm, middle, now=20.0)
    ours = loop.manager.sent.position
    braked = joints([value + 0.002 for value in middle])
    state = ArmState(time, CYCLE, 1, middle, ZERO_JOINTS, middle, is_running=True)
    monkeypatch.setattr(LimitedArm, "take_braked", lambda arm: (Cycle(state, None, ArmCommand(braked)),))
    monkeypatch.setattr(Limiter, "unanswered", 1)
    loop.watch_silence(20.006)
    assert loop.manager.sent.position == (braked if is_newest else ours)


def test_position_that_is_no_number_has_no_later_command_taken_for_withheld(middle: Joints) -> None:
    sent = SentPositions()
    sent.note(middle, middle)
    sent.note((*middle[:6], nan), middle)
    for _ in range(20):
        sent.note(middle, middle)
        assert not sent.is_held_back(middle, ZERO_JOINTS, middle)
    assert sent.is_held_back((*middle[:6], nan), ZERO_JOINTS, middle)
