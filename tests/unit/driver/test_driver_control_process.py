"""The parent's handle on the control process, with a pipe in memory."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue
from threading import Event as Flag
from typing import Any

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.robot.joints import ZERO_JOINTS, Side, home, joints
from abb_runtime.process.child import PipeClosed
from refusals import refused
from yumi.control.controllers.joint_goal import JointGoal
from yumi.control.counters import WireCounters
from yumi.control.goals import GoalKind
from yumi.control.hand_over import Commander
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.loop_events import ControlProcessEnded, CycleFailed, Event
from yumi.control.shared_state import Snapshot
from yumi.driver import control_process
from yumi.driver.control_process import (
    HUNG_PROCESS,
    PROCESS_STARTING,
    STALE_SNAPSHOT,
    ControlProcess,
    ControlProcessAnswer,
    ControlProcessRefusal,
)

LONG = 5.0
LEFT = Side.LEFT


class Child:
    """A process that says what the test says."""

    is_started = True

    def __init__(self, *_: object) -> None:
        self.exit_code: int | None = None
        self.says: SimpleQueue[Any] = SimpleQueue()
        self.sent: list[object] = []
        self.is_waited_for, self.has_ended = Flag(), Flag()
        self.pipe = self

    def start(self) -> None:
        """It runs already."""

    def send(self, message: object) -> None:
        """The test says what it answers."""
        self.sent.append(message)

    def receive(self) -> Any:
        self.is_waited_for.set()
        said = self.says.get(timeout=LONG)
        if said is PipeClosed:
            raise PipeClosed("the end")
        return said

    def join(self, timeout: float) -> bool:
        self.exit_code = -9
        self.has_ended.set()
        return True


@pytest.fixture
def child(monkeypatch: pytest.MonkeyPatch) -> Child:
    child = Child()
    monkeypatch.setattr(control_process, "ChildProcess", lambda *_: child)
    return child


@pytest.fixture
def heard() -> SimpleQueue[Event]:
    return SimpleQueue()


@pytest.fixture
def control(child: Child, heard: SimpleQueue[Event]) -> Iterator[ControlProcess]:
    def hear(event: Event) -> None:
        heard.put(event)
        if isinstance(event, CycleFailed):
            raise RuntimeError("can't start new thread")

    control = ControlProcess(lambda _: {}, hear)
    child.says.put("started")
    control.start()
    yield control
    child.says.put(PipeClosed)
    control.stop()


def test_listener_that_fails_is_logged_once_and_hears_what_follows(
    child: Child, control: ControlProcess, heard: SimpleQueue[Event], caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.ERROR):
        for _ in range(3):
            child.says.put(CycleFailed(LEFT, "no more"))
            assert isinstance(heard.get(timeout=LONG), CycleFailed)
        child.says.put(PipeClosed)
        assert [heard.get(timeout=LONG) for _ in Side] == [ControlProcessEnded(side, -9) for side in Side]
    assert [record.getMessage() for record in caplog.records] == [
        "Handling CycleFailed of the left arm failed with RuntimeError: can't start new thread"
    ]


@pytest.mark.parametrize(("age", "is_known"), [(0.0, True), (STALE_SNAPSHOT + 0.1, False)])
def test_process_that_stands_still_does_not_count_as_running(
    age: float, is_known: bool, control: ControlProcess
) -> None:
    made = Snapshot(
        time.monotonic() - age, wire=WireCounters(session=3), is_streaming=True, is_running=True, activation=7
    )
    control.buffers[LEFT].snapshots.write(made)
    snapshot = control.snapshot(LEFT)
    assert (snapshot.is_streaming, snapshot.is_running, snapshot.is_commanded) == (is_known,) * 3
    assert snapshot.session == 3


@pytest.mark.parametrize(
    ("kind", "away", "is_busy"),
    [(GoalKind.NONE, 0.1, True), (GoalKind.NONE, 0.0, False), (GoalKind.POSITION, 0.1, False)],
)
def test_arm_that_stands_before_its_goal_keeps_its_commander(
    kind: GoalKind, away: float, is_busy: bool, control: ControlProcess
) -> None:
    goal = joints([away, *ZERO_JOINTS[1:]])
    made = Snapshot(time.monotonic() + LONG, is_running=True, activation=7, goal_kind=kind, reference=goal)
    control.buffers[LEFT].snapshots.write(made)
    control.hand_over.take(LEFT, Commander.TRAJECTORY, -1.0)
    assert control.hand_over.of(LEFT).who is (Commander.TRAJECTORY if is_busy else Commander.NONE)


def test_command_that_is_not_answered_is_given_up_for_the_process_too(
    control: ControlProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(control_process, "_ANSWER_TIMEOUT", 0.01)
    for number in (1, 2):
        with refused(RobotNotReady, "control_process_does_not_answer", timeout=0.01):
            control.call(Commands.hold, LEFT)
        assert control._given_up[0] == number


def test_command_that_the_process_refuses_takes_no_arm(
    child: Child, control: ControlProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    refusal = ControlProcessRefusal(message("arm_without_egm", arm="left"))
    goal = ControllerCommand(LEFT, "c", JointGoal(home(LEFT)))
    with monkeypatch.context() as answering, refused(CommandRefused, "arm_without_egm"):
        answering.setattr(child, "send", lambda call: child.says.put(ControlProcessAnswer(call.number, refusal)))
        control.call(Commands.send_commands, goal)
    assert control.hand_over.of(LEFT).who is Commander.NONE


def test_command_is_refused_and_not_kept_for_a_process_that_is_starting_again(
    child: Child, control: ControlProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It would serve the command late, and report that it had stood still."""
    monkeypatch.setattr(control_process, "_ANSWER_TIMEOUT", 0.01)
    child.says.put(PipeClosed)
    assert child.has_ended.wait(LONG)
    again = Child()
    monkeypatch.setattr(control_process, "ChildProcess", lambda *_: again)
    with ThreadPoolExecutor(1) as other:
        revived = other.submit(control.revive)
        assert again.is_waited_for.wait(LONG)
        with refused(RobotNotReady, PROCESS_STARTING.code):
            control.call(Commands.hold, LEFT)
        assert (again.sent, control._given_up[0]) == ([], 0)
        again.says.put("started")
        assert revived.result(LONG)
    with refused(RobotNotReady, "control_process_does_not_answer", timeout=0.01):
        control.call(Commands.hold, LEFT)
    assert len(again.sent) == 1
    again.says.put(PipeClosed)


@pytest.mark.parametrize("is_streaming", [False, True])
def test_process_that_stands_still_while_a_robot_streams_is_found_out(
    is_streaming: bool, control: ControlProcess
) -> None:
    """The heartbeats of the robot's watchdog depend on it."""
    for side in Side:
        control.buffers[side].snapshots.write(Snapshot(time.monotonic(), is_streaming=True, is_running=True))
    control.check()
    made = Snapshot(time.monotonic() - HUNG_PROCESS - 1.0, is_streaming=is_streaming, is_running=True)
    control.buffers[LEFT].snapshots.write(made)
    if is_streaming:
        with refused(RobotNotReady, "control_process_stands_still") as refusal:
            control.check()
        assert refusal.value.said.values["duration"] == pytest.approx(HUNG_PROCESS + 1.0, abs=0.5)
    else:
        control.check()
