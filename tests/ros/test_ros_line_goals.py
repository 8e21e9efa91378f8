"""Goals of the action ``move_linear`` whose end is not reported, that are cancelled early, or whose arm is held."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import count
from threading import Event, Lock
from types import SimpleNamespace
from typing import Any

import pytest
from geometry_msgs.msg import PoseStamped
from yumi_interfaces.action import MoveLinear

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import ZERO_JOINTS, Joints, Side, home, joints
from refusals import assert_says, refused
from yumi.control.counters import WireCounters
from yumi.control.goals import GoalKind, MemoryBuffer
from yumi.control.hand_over import Commander, HandOver, requested_by
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.loop_events import ControlProcessEnded, ReportsDropped
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.shared_state import Snapshot
from yumi.control.trajectory_commands import (
    ArmPlan,
    CancelTrajectory,
    FollowTrajectory,
    ResultCode,
    TrajectoryEnded,
    TrajectoryOutcome,
)
from yumi.driver.control_process import PROCESS_ENDED
from yumi.planning.smoothing import smooth_spline_through
from yumi.ros import line_actions
from yumi.ros.line_actions import MoveLinearAction
from yumi.ros.tool_topics import LineGoal, TargetPoseTopic

pytestmark = pytest.mark.ros

WAIT = 10.0  # [s]
HOME = home(Side.RIGHT)
STANDS = Snapshot(
    wire=WireCounters(session=1),
    is_streaming=True,
    is_running=True,
    activation=1,
    goal_kind=GoalKind.TOOL,
    sent=HOME,
    reference=HOME,
)

LATE = message("arm_moved_after_trajectory", late=2.0)


class Node:
    """Remembers what is logged."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def get_logger(self) -> Node:
        return self

    get_clock = get_logger

    def warning(self, sentence: str, **_: Any) -> None:
        self.lines.append(sentence)

    info = warning

    def create_subscription(self, *_: Any) -> None:
        return None


class Target:
    """Plans lines and notes what the controller is commanded; ``motion`` is where that commands the arm to be."""

    controller = "cartesian_controller"

    def __init__(self) -> None:
        self.turn = Lock()
        self.commands: list[object] = []
        self.motion: Any = iter(lambda: HOME, None)
        self.snapshot: Any = lambda: STANDS

    def check(self) -> Snapshot:
        return self.snapshot()

    def commanded(self) -> Joints:
        position: Joints = next(self.motion)
        return position

    def command(self, message: object, activation: int = 0) -> None:
        self.commands.append(message)

    def plan(self, *_: Any) -> ArmPlan:
        end = TrajectoryPoint(1.0, HOME)
        return ArmPlan(Side.RIGHT, end, smooth_spline_through([TrajectoryPoint(0.0, HOME), end]), None)


class Handle:
    """A goal, and how it ended."""

    is_active, end = True, ""

    def __init__(self) -> None:
        self.request, self.goal_id = MoveLinear.Goal(), SimpleNamespace(uuid=b"1")
        self.looks = 0

    @property
    def is_cancel_requested(self) -> bool:
        """Not yet while the cancel callback runs, as rclpy has it."""
        self.looks += 1
        return self.looks > 3

    def abort(self) -> None:
        self.end = "aborted"

    def canceled(self) -> None:
        assert self.looks > 3, "rclpy: goal_handle attempted invalid transition from state EXECUTING"
        self.end = "cancelled"


class Bench:
    """The action with what is behind it."""

    def __init__(self) -> None:
        self.target, self.snapshot, self.is_followed = Target(), STANDS, Event()
        self.target.snapshot = lambda: self.snapshot
        buffers = {Side.RIGHT: SimpleNamespace(tool_path=MemoryBuffer())}
        self.hand_over = HandOver(lambda: 0.0)
        self.control: Any = SimpleNamespace(
            buffers=buffers, snapshot=lambda side: self.snapshot, call=self.call, hand_over=self.hand_over
        )
        targets, frames = {Side.RIGHT: self.target}, SimpleNamespace(measured=lambda side: None)
        self.action = MoveLinearAction(Side.RIGHT, Node(), "", self.control, lambda: 0.0, targets, frames, "base")

    def call(self, command: Any, *commands: ControllerCommand) -> None:
        assert command is Commands.send_commands
        for each in commands:
            if each.activation not in (0, self.snapshot.activation):  # as the control process has it
                raise CommandRefused(message("interrupted_while_planned", arm=each.side.word))
        self.target.commands += [each.message for each in commands]
        self.is_followed.set()


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Bench:
    monkeypatch.setattr(line_actions, "ActionServer", lambda *_, **__: SimpleNamespace(destroy=lambda: None))
    monkeypatch.setattr(line_actions, "_REPORTED_WITHIN", 0.05)
    return Bench()


@pytest.mark.parametrize("change", [{"activation": 2}, {"wire": WireCounters(session=2)}, {"activation": 0}])
def test_line_whose_end_is_not_reported_ends_with_its_activation(bench: Bench, change: dict[str, Any]) -> None:
    handle, worker = Handle(), ThreadPoolExecutor(1)
    ended = worker.submit(bench.action._execute, handle)
    try:
        assert bench.is_followed.wait(WAIT)
        bench.snapshot = STANDS._replace(**change)
        result = ended.result(WAIT)
    finally:
        bench.action.destroy()
        worker.shutdown()
    assert handle.end == "aborted"
    assert result.code == "line_ended_unreported"
    follow, cancel = bench.target.commands
    assert isinstance(follow, FollowTrajectory)
    assert cancel == CancelTrajectory(follow.goal)


@pytest.mark.parametrize(
    ("event", "sentence"),
    [
        (ControlProcessEnded(Side.RIGHT, 1), str(PROCESS_ENDED)),
        (ReportsDropped(Side.RIGHT, 300), str(ReportsDropped(Side.RIGHT, 300))),
    ],
)
def test_line_whose_end_cannot_be_reported_says_why(bench: Bench, event: object, sentence: str) -> None:
    handle, worker = Handle(), ThreadPoolExecutor(1)
    ended = worker.submit(bench.action._execute, handle)
    try:
        assert bench.is_followed.wait(WAIT)
        bench.action.on_arm_event(Side.RIGHT, event)
        result = ended.result(WAIT)
    finally:
        bench.action.destroy()
        worker.shutdown()
    assert (handle.end, result.message) == ("aborted", sentence)


def test_line_that_the_limiter_holds_says_which_parts(bench: Bench) -> None:
    handle, worker = Handle(), ThreadPoolExecutor(1)
    ended = worker.submit(bench.action._execute, handle)
    try:
        assert bench.is_followed.wait(WAIT)
        (follow,) = bench.target.commands
        assert isinstance(follow, FollowTrajectory)
        bench.snapshot = STANDS._replace(limited_part="right gripper", limited_other="body")
        late = TrajectoryEnded(follow.goal, TrajectoryOutcome.ABORTED, ResultCode.GOAL_TOLERANCE_VIOLATED, LATE)
        assert bench.action.on_arm_event(Side.RIGHT, late)
        result = ended.result(WAIT)
    finally:
        bench.action.destroy()
        worker.shutdown()
    assert handle.end == "aborted"
    limited = message("parts_near", part="right gripper", other="body", distance=0.0)
    said = message("goal_not_reached_limited", arm="right", reason=LATE, limited=limited)
    assert (result.code, result.message) == ("goal_not_reached_limited", str(said))


def test_line_that_is_cancelled_while_it_waits_stops_nobody_elses_motion(bench: Bench) -> None:
    handle, places = Handle(), count()

    def moves() -> Any:
        for place in places:
            bench.action._cancel(handle)  # the arm goes on moving meanwhile
            yield joints([0.01 * place, *ZERO_JOINTS[1:]])

    bench.target.motion = moves()
    result = bench.action._execute(handle)
    assert (handle.end, result.message) == ("cancelled", "Cancelled before the arm moved.")
    assert all(isinstance(each, CancelTrajectory) and each.goal is not None for each in bench.target.commands)


@pytest.mark.parametrize("is_taken_meanwhile", [False, True])
def test_line_for_an_arm_that_a_person_moves_does_not_brake_it(bench: Bench, is_taken_meanwhile: bool) -> None:
    def take() -> None:
        with requested_by(Commander.HEADSET, "person"):
            bench.hand_over.take(Side.RIGHT, Commander.HEADSET)

    def moves() -> Iterator[Joints]:
        for step in range(100):
            if step == 2:
                take()
            yield joints([0.01 * step, *ZERO_JOINTS[1:]])

    if not is_taken_meanwhile:
        take()
    handle, bench.target.motion = Handle(), moves()
    result = bench.action._execute(handle)
    assert (handle.end, result.code) == ("aborted", "arm_commanded_by_another")
    assert bench.target.commands == [CancelTrajectory()] * is_taken_meanwhile


def test_line_that_is_cancelled_before_it_is_executed_does_not_move_the_arm(bench: Bench) -> None:
    handle = Handle()
    bench.action._cancel(handle)
    result = bench.action._execute(handle)
    assert (handle.end, result.message) == ("cancelled", "Cancelled before the arm moved.")
    assert bench.target.commands == []
    assert not bench.action._open


@pytest.mark.parametrize("meanwhile", ["waiting for its turn", "being planned"])
def test_line_does_not_move_an_arm_that_was_stopped_and_follows_again_meanwhile(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, meanwhile: str
) -> None:
    def stop_and_recover(*_: Any) -> None:
        bench.snapshot = STANDS._replace(wire=WireCounters(session=2), activation=2)

    if meanwhile == "being planned":
        plan = bench.target.plan
        monkeypatch.setattr(bench.target, "plan", lambda *given: stop_and_recover() or plan(*given))  # type: ignore[func-returns-value]
    else:

        @contextmanager
        def turn() -> Iterator[None]:
            stop_and_recover()
            yield

        monkeypatch.setattr(bench.target, "turn", turn())
    handle = Handle()
    result = bench.action._execute(handle)
    assert handle.end == "aborted"
    assert result.code == "interrupted_while_planned"
    assert bench.target.commands == []


def test_line_is_refused_where_the_arm_is_held_elsewhere_than_it_is_commanded() -> None:
    held = STANDS._replace(sent=joints([HOME[0] - 0.3, *HOME[1:]]), limited_part="right fingers", limited_other="table")
    control: Any = SimpleNamespace(
        hand_over=HandOver(lambda: 0.0),
        buffers={Side.RIGHT: SimpleNamespace(goals=MemoryBuffer(), tool_goals=MemoryBuffer())},
        snapshot=lambda side: held,
        call=lambda *_: {Side.RIGHT: HOME},
    )
    target = TargetPoseTopic(Node(), Side.RIGHT, control, lambda: 0.0, "cartesian_controller", None)  # type: ignore[arg-type]
    with refused(CommandRefused, "command_refused") as refusal:
        target.plan(LineGoal((PoseStamped(),)))
    limited = message("parts_near", part="right fingers", other="table", distance=0.0)
    reason = refusal.value.said.values["reason"]
    assert_says(reason, "arm_held_from_command_by", arm="right", distance=0.3, limited=limited)
