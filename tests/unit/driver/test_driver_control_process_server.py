"""The loop inside the control process, with a pipe and arms of the test."""

from __future__ import annotations

import os
import select
import socket
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from abb_protocols.catalogue import clause, message
from abb_protocols.robot.joints import Side
from abb_runtime.clock import ManualClock
from abb_runtime.process.child import PipeClosed, PipeEnd
from refusals import assert_says
from yumi.control.allowed_collisions import AllowedCollisions
from yumi.control.loop_events import ControllerFailed, CycleFailed, ReportsDropped
from yumi.control.shared_memory import shared_numbers
from yumi.driver import control_process
from yumi.driver.control_process import (
    NO_NUMBER,
    ControlProcessAnswer,
    ControlProcessArm,
    ControlProcessCall,
    ControlProcessRefusal,
    ControlProcessStop,
    ControlServer,
    WakeMode,
    run_control_process,
)


class Source:
    """Something that is readable once it was told so."""

    def __init__(self) -> None:
        self._reader, self._writer = os.pipe()

    def fileno(self) -> int:
        return self._reader

    def make_readable(self) -> None:
        os.write(self._writer, b"x")

    def close(self) -> None:
        os.close(self._reader)
        os.close(self._writer)


class Parent(Source):
    """Its end of the pipe: sends its messages, then closes; remembers what it received."""

    def __init__(self) -> None:
        super().__init__()
        self.received: list[Any] = []
        self.messages: list[object] = [ControlProcessStop()]

    def receive(self) -> Any:
        if not self.messages:
            raise PipeClosed
        return self.messages.pop(0)

    def send(self, value: object) -> None:
        self.received.append(value)

    def send_soon(self, value: object) -> bool:
        self.received.append(value)
        return True

    def flush(self) -> bool:
        return True


class Arm:
    """An arm that takes 100 ms for a cycle, and fails at the first if it is broken."""

    state = collisions = None

    def __init__(self, clock: ManualClock, parent: Parent, *, is_broken: bool) -> None:
        self.manager = SimpleNamespace(deactivate_commanding=self._deactivate)
        self.is_still = True
        self.deactivated = 0
        self.settled = 0
        self.watched: list[float] = []
        self._clock, self._parent, self._is_broken = clock, parent, is_broken

    def _deactivate(self) -> None:
        self.deactivated += 1

    def reply(self, now: float) -> None:
        self._clock.advance(0.1)
        self._parent.make_readable()
        if self._is_broken:
            raise ValueError("a command of six joints")

    def settle(self, now: float) -> bool:
        self.settled += 1
        return True

    def is_datagram_due(self, now: float) -> bool:
        return False

    def watch_silence(self, now: float) -> None:
        self.watched.append(now)

    def take_events(self) -> tuple[object, ...]:
        return ()


class Processors:
    """Remembers what was asked of them."""

    def __init__(self) -> None:
        self.calls: list[str] = []

    def hold(self) -> None:
        self.calls.append("hold")

    def release(self) -> None:
        self.calls.append("release")


@pytest.fixture
def parent() -> Iterator[Parent]:
    parent = Parent()
    yield parent
    parent.close()


@pytest.fixture
def arms(clock: ManualClock, parent: Parent) -> dict[Side, Arm]:
    """The left one is broken."""
    return {side: Arm(clock, parent, is_broken=side is Side.LEFT) for side in Side}


def run(
    arms: dict[Side, Arm], parent: Parent, clock: ManualClock, processors: Any = None, given_up: Any = None
) -> dict[Side, int]:
    """Until the parent stops it, with a datagram for each arm; returns how many cycles were reported as done."""
    sockets = {side: Source() for side in arms}
    done = dict.fromkeys(arms, 0)

    def release(side: Side) -> None:
        done[side] += 1

    for each in sockets.values():
        each.make_readable()
    connected: Any = {side: ControlProcessArm(arm, sockets[side]) for side, arm in arms.items()}  # type: ignore[arg-type]
    events: Any = {side: SimpleNamespace(release=lambda side=side: release(side)) for side in arms}
    ControlServer(parent, connected, events, clock.now, processors, given_up).run()  # type: ignore[arg-type]
    for each in sockets.values():
        each.close()
    return done


def test_control_process_does_not_take_its_own_standstill_for_the_robots_silence(
    arms: dict[Side, Arm], parent: Parent, clock: ManualClock
) -> None:
    run(arms, parent, clock)
    assert [arm.watched[0] for arm in arms.values()] == [0.0, 0.0]


def test_control_process_deactivates_what_commands_when_a_cycle_fails(
    arms: dict[Side, Arm], parent: Parent, clock: ManualClock
) -> None:
    parent.messages = [ControlProcessCall(7, "list_controllers", (Side.LEFT,), {}), ControlProcessStop()]
    run({Side.LEFT: arms[Side.LEFT]}, parent, clock)
    assert arms[Side.LEFT].deactivated >= 1
    failures = [each for each in parent.received if isinstance(each, CycleFailed)]
    assert "ValueError: a command of six joints" in str(failures[0])


def test_control_process_serves_one_arm_while_the_other_fails(
    arms: dict[Side, Arm], parent: Parent, clock: ManualClock
) -> None:
    done = run(arms, parent, clock)
    assert done[Side.RIGHT] >= 1
    assert done[Side.LEFT] == arms[Side.LEFT].settled == 0
    assert {each.side for each in parent.received if isinstance(each, CycleFailed)} == {Side.LEFT}


@pytest.mark.parametrize("method", ["watch_silence", "take_events", "settle"])
def test_control_process_serves_one_arm_while_another_part_of_the_other_fails(
    arms: dict[Side, Arm], parent: Parent, clock: ManualClock, monkeypatch: pytest.MonkeyPatch, method: str
) -> None:
    def fail(*_: object) -> None:
        raise ValueError("a defect")

    arms[Side.LEFT] = Arm(clock, parent, is_broken=False)
    monkeypatch.setattr(arms[Side.LEFT], method, fail)
    done = run(arms, parent, clock)
    assert done[Side.RIGHT] >= 1
    assert arms[Side.LEFT].deactivated >= 1
    assert {str(each.side) for each in parent.received if isinstance(each, CycleFailed)} == {str(Side.LEFT)}


def test_control_process_goes_on_when_allowed_collisions_fail_and_both_arms_hold(
    clock: ManualClock, parent: Parent, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(_: object) -> None:
        raise ValueError("a defect")

    monkeypatch.setattr(AllowedCollisions, "take_events", fail)
    arms = {side: Arm(clock, parent, is_broken=False) for side in Side}
    done = run(arms, parent, clock)
    assert min(done.values()) >= 1
    assert all(arm.deactivated >= 1 for arm in arms.values())
    assert {each.side for each in parent.received if isinstance(each, CycleFailed)} == set(Side)


class LoggedArm(Arm):
    """Logs what is done with it, and reads its datagram; the right one's reply takes until the left one's comes."""

    def __init__(self, clock: ManualClock, parent: Parent, side: Side, sockets: dict[Side, Source]) -> None:
        super().__init__(clock, parent, is_broken=False)
        self.log: list[tuple[str, Side]] = []
        self._parent, self._side, self._sockets = parent, side, sockets

    def prepare(self) -> None:
        self.log.append(("prepare", self._side))

    def reply(self, now: float) -> None:
        os.read(self._sockets[self._side].fileno(), 1)
        self.log.append(("reply", self._side))
        if self._side is Side.RIGHT:
            self._sockets[Side.LEFT].make_readable()

    def settle(self, now: float) -> bool:
        self.log.append(("settle", self._side))
        if self._side is Side.LEFT:
            self._parent.make_readable()
        return True


class Waits:
    """The core's waits, each of which returns whose file is readable by then."""

    def __init__(self, sockets: dict[Side, Source]) -> None:
        self._sockets = [each.fileno() for each in sockets.values()]

    def wait(self, other: int, timeout: float) -> tuple[list[int], bool]:
        poll = select.poll()
        for descriptor in (*self._sockets, *((other,) if other >= 0 else ())):
            poll.register(descriptor, select.POLLIN)
        ready = {descriptor for descriptor, _ in poll.poll(1e3 * timeout)}
        return [number for number, each in enumerate(self._sockets) if each in ready], other in ready

    def close(self) -> None:
        """Nothing to end."""


@pytest.mark.parametrize("is_in_core", [False, True])
def test_datagram_of_the_other_arm_that_comes_during_a_reply_is_answered_before_what_can_wait(
    parent: Parent, clock: ManualClock, is_in_core: bool
) -> None:
    sockets = {side: Source() for side in (Side.RIGHT, Side.LEFT)}
    arms = {side: LoggedArm(clock, parent, side, sockets) for side in sockets}
    log = arms[Side.LEFT].log = arms[Side.RIGHT].log
    sockets[Side.RIGHT].make_readable()
    fallback: Any = Waits(sockets) if is_in_core else None
    connected: Any = {side: ControlProcessArm(arm, sockets[side], fallback) for side, arm in arms.items()}  # type: ignore[arg-type]
    events: Any = {side: SimpleNamespace(release=lambda: None) for side in sockets}
    ControlServer(parent, connected, events, clock.now).run()  # type: ignore[arg-type]
    for each in sockets.values():
        each.close()
    prepared = [("prepare", side) for side in sockets] if is_in_core else []
    answered = [(done, side) for done in ("reply", "settle") for side in sockets]
    assert log[: len(prepared) + len(answered)] == [*prepared, *answered]


def test_arm_whose_formula_cannot_be_prepared_fails_alone(parent: Parent, clock: ManualClock) -> None:
    sockets = {side: Source() for side in (Side.RIGHT, Side.LEFT)}
    arms = {side: LoggedArm(clock, parent, side, sockets) for side in sockets}
    failures = iter([ValueError("a formula of six gains")])

    def prepare() -> None:
        for failure in failures:
            raise failure

    arms[Side.RIGHT].prepare = prepare  # type: ignore[method-assign]
    sockets[Side.RIGHT].make_readable()
    fallback: Any = Waits(sockets)
    connected: Any = {side: ControlProcessArm(arm, sockets[side], fallback) for side, arm in arms.items()}  # type: ignore[arg-type]
    events: Any = {side: SimpleNamespace(release=lambda: None) for side in sockets}
    ControlServer(parent, connected, events, clock.now).run()  # type: ignore[arg-type]
    for each in sockets.values():
        each.close()
    assert arms[Side.RIGHT].deactivated == arms[Side.LEFT].deactivated + 1  # both are at the end
    assert ("reply", Side.LEFT) in arms[Side.LEFT].log


def test_command_with_a_defect_is_refused_and_the_next_one_is_served(
    arms: dict[Side, Arm], parent: Parent, clock: ManualClock
) -> None:
    parent.messages = [
        ControlProcessCall(4, "list_controllers", (Side.LEFT,), {"no": 1}),
        ControlProcessCall(5, "nothing", (), {}),
        ControlProcessStop(),
    ]
    run(arms, parent, clock)
    answers = {each.number: each.value for each in parent.received if isinstance(each, ControlProcessAnswer)}
    assert isinstance(answers[4], ControlProcessRefusal)
    assert_says(answers[4].said, "command_failed", command="list_controllers", kind="TypeError")
    assert answers[5] == ControlProcessRefusal(message("command_unknown", command="nothing"))


@pytest.mark.timeout(10)
def test_command_for_which_there_is_no_memory_is_refused_and_the_next_one_is_served(
    parent: Parent, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    def receive() -> Any:
        received = parent.messages.pop(0)
        if isinstance(received, Exception):
            raise received
        return received

    parent.messages = [MemoryError("no memory"), ControlProcessCall(5, "nothing", (), {}), ControlProcessStop()]
    monkeypatch.setattr(parent, "receive", receive)
    arms = {side: Arm(clock, parent, is_broken=False) for side in Side}
    run(arms, parent, clock)
    unreadable, refused = [each for each in parent.received if isinstance(each, ControlProcessAnswer)]
    assert unreadable.number == NO_NUMBER
    assert_says(
        unreadable.value.said, "command_unreadable", kind="MemoryError", reason=message("text", text="no memory")
    )  # type: ignore[attr-defined]
    assert refused == ControlProcessAnswer(5, ControlProcessRefusal(message("command_unknown", command="nothing")))


def test_command_that_its_parent_has_given_up_is_dropped_and_both_arms_hold(
    parent: Parent, clock: ManualClock, monkeypatch: pytest.MonkeyPatch
) -> None:
    served: list[Side] = []
    monkeypatch.setitem(control_process.COMMANDS, "list_controllers", lambda _, side: served.append(side))  # type: ignore[arg-type]
    parent.messages = [
        ControlProcessCall(number, "list_controllers", (side,), {}) for number, side in enumerate(Side, 4)
    ]
    parent.messages.append(ControlProcessStop())
    arms = {side: Arm(clock, parent, is_broken=False) for side in Side}
    given_up = shared_numbers(1)
    given_up[0] = 4
    run(arms, parent, clock, given_up=given_up)
    answers = {each.number: each.value for each in parent.received if isinstance(each, ControlProcessAnswer)}
    assert answers == {
        4: ControlProcessRefusal(message("command_too_late", command="list_controllers")),
        5: None,
    }
    assert served == [tuple(Side)[1]]
    failures = [each for each in parent.received if isinstance(each, CycleFailed)]
    assert [each.side for each in failures] == list(arms)
    assert failures[0].failure == clause(message("control_process_stood_still_too_long", duration=5.0))
    assert min(arm.deactivated for arm in arms.values()) >= 2  # at the end, too


def test_control_process_calls_nothing_but_commands(arms: dict[Side, Arm], parent: Parent, clock: ManualClock) -> None:
    parent.messages = [ControlProcessCall(3, "_publish", (Side.RIGHT,), {}), ControlProcessStop()]
    run(arms, parent, clock)
    assert (
        ControlProcessAnswer(3, ControlProcessRefusal(message("command_unknown", command="_publish")))
        in parent.received
    )


class TalkativeArm(Arm):
    """Reports 100 events of 1 kB in each pass; its parent reads from pass 30 on, and stops it when it has read all."""

    def __init__(self, clock: ManualClock, parent: Parent, driver: PipeEnd) -> None:
        super().__init__(clock, parent, is_broken=False)
        self.heard: list[Any] = []
        self._driver = driver

    def take_events(self) -> tuple[object, ...]:
        number = len(self.watched)
        while number >= 30 and self._driver.has_value():
            self.heard.append(self._driver.receive())
            if self.heard[-1] == ReportsDropped(Side.LEFT, 29 * 100 - len(self.heard) + 2):
                self._driver.send(ControlProcessStop())
        failed = ControllerFailed(Side.RIGHT, message("text", text=f"{number}".ljust(1000)))
        return (failed,) * (100 if number < 30 else 0)


@pytest.mark.timeout(20)
def test_arms_are_served_while_the_parent_reads_nothing_and_what_was_dropped_is_reported(
    clock: ManualClock, parent: Parent
) -> None:
    driver, pipe = map(PipeEnd, socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET))
    talkative, silent = TalkativeArm(clock, parent, driver), Arm(clock, parent, is_broken=False)
    run({Side.RIGHT: talkative, Side.LEFT: silent}, pipe, clock)  # type: ignore[arg-type]
    driver.close()
    pipe.close()
    assert silent.settled >= 31
    events = [each for each in talkative.heard if isinstance(each, ControllerFailed)]
    first = [int(each.failure.values["text"]) for each in events]
    assert first == sorted(first)
    assert 256 <= len(events) < 29 * 100
    dropped = [each for each in talkative.heard if isinstance(each, ReportsDropped)]
    assert dropped == [ReportsDropped(side, 29 * 100 - len(events)) for side in (Side.RIGHT, Side.LEFT)]
    assert dropped[0].said == message("reports_dropped", arm="right", count=29 * 100 - len(events))
    assert [talkative.deactivated, silent.deactivated] == [2, 2]  # then, and at the end


def test_processors_are_kept_awake_only_while_a_robot_streams(
    arms: dict[Side, Arm], parent: Parent, clock: ManualClock
) -> None:
    processors = Processors()
    arms[Side.RIGHT].state = object()  # type: ignore[assignment]
    run(arms, parent, clock, processors)
    assert (set(processors.calls[:-1]), processors.calls[-1]) == ({"hold"}, "release")
    processors.calls.clear()
    parent.messages = [ControlProcessStop()]
    arms[Side.RIGHT].state = None
    run(arms, parent, clock, processors)
    assert set(processors.calls) == {"release"}


class ForbiddenProcessors(Processors):
    """What was permitted when the process started is so no more."""

    def hold(self) -> None:
        raise PermissionError("Operation not permitted")

    release = hold


def test_arms_are_served_although_processors_may_not_be_kept_awake_any_more(parent: Parent, clock: ManualClock) -> None:
    arms = {side: Arm(clock, parent, is_broken=False) for side in Side}
    arms[Side.RIGHT].state = object()  # type: ignore[assignment]
    done = run(arms, parent, clock, ForbiddenProcessors())
    assert min(done.values()) >= 1


@pytest.mark.parametrize(
    ("mode", "is_permitted", "words"),
    [
        (WakeMode.AUTO, True, "processors kept awake while EGM runs"),
        (WakeMode.AUTO, False, "asleep between datagrams"),
        (WakeMode.BLOCKING, True, "asleep between datagrams"),
    ],
)
def test_wake_mode_takes_what_is_permitted(
    monkeypatch: pytest.MonkeyPatch, parent: Parent, mode: WakeMode, is_permitted: bool, words: str
) -> None:
    monkeypatch.setattr(control_process.AwakeProcessors, "are_permitted", staticmethod(lambda: is_permitted))
    monkeypatch.setattr(control_process, "prepare_process", lambda: "prepared")
    monkeypatch.setattr(control_process, "ControlServer", lambda *_: SimpleNamespace(run=lambda: None))
    monkeypatch.setattr(control_process.signal, "signal", lambda *_: None)  # type: ignore[attr-defined]
    run_control_process(parent, lambda _: {}, {}, mode)  # type: ignore[arg-type]
    assert parent.received == [f"Control process: prepared, {words}."]
