"""A second program at a driver's local endpoint: over a real socket, with a robot that notes what it is asked."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import socket
import stat
import struct
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from math import inf, nan
from pathlib import Path
from typing import Any

import pytest

import yumi
from abb_protocols.catalogue import from_wire, message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused, GoalNotReached, RobotNotReady, StopNotConfirmed
from abb_protocols.robot.gripper_values import GripOutcome
from abb_protocols.robot.joints import YUMI_LIMITS, ZERO_JOINTS, Joints, Side, home, joints, named_pose
from fake_driver import ROBOT, WAIT, FakeDriver
from refusals import refused
from yumi.api.attach import RunningDriver, attach
from yumi.api.motion_executor import RETREAT_SPEED_SCALE
from yumi.api.motion_registry import Motion, MotionWay
from yumi.control.controller import CONTROLLER_IDLE_TIME
from yumi.control.controllers.joint_goal import GoalOutcome, JointGoal, StopMotion
from yumi.control.hand_over import Commander, HandOver
from yumi.control.loop_commands import ControllerCommand
from yumi.control.loop_events import ControllerReport, SessionLost
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.shared_state import JointStates, Snapshot
from yumi.control.trajectory_commands import FollowTrajectory, ResultCode, TrajectoryEnded, TrajectoryOutcome
from yumi.driver import endpoint_server, motion_commands
from yumi.driver.controller_names import GOAL_CONTROLLER, STREAM_CONTROLLER
from yumi.driver.endpoint import MAX_REQUEST, EndpointClient, endpoint_folder, endpoint_path, find_driver
from yumi.driver.endpoint_server import MAX_CLIENTS, MAX_SILENT
from yumi.driver.gripper_follower import closed_of, goal_of
from yumi.driver.reports import ArmMode
from yumi.driver.robot_state import RobotMode
from yumi.planning.planner import Plan

NOT_UNDERSTOOD = "request_not_understood"
COLLISION = message("event_50204", number=50204, title="Motion supervision")


@pytest.fixture(autouse=True)
def _a_folder_of_its_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))


@pytest.fixture
def driver() -> Iterator[FakeDriver]:
    driver = FakeDriver()
    driver.server.start()
    yield driver
    driver.server.stop()


@pytest.fixture
def attached(driver: FakeDriver) -> Iterator[RunningDriver]:
    with attach() as attached:
        yield attached


def raw() -> tuple[socket.socket, Any]:
    """A client that speaks the protocol by hand."""
    connection = socket.socket(socket.AF_UNIX)
    connection.settimeout(WAIT)
    connection.connect(str(find_driver()))
    return connection, connection.makefile("rwb")


def answer_to(line: bytes, *more: bytes) -> dict[str, Any]:
    """The answer to a line; more lines are answered on the same connection."""
    connection, file = raw()
    with connection, file:
        file.write(b"".join(each + b"\n" for each in (line, *more)))
        file.flush()
        answer: dict[str, Any] = json.loads(file.readline())
        for _ in more:
            assert json.loads(file.readline())["result"]
    return answer


def test_state_has_all_that_the_driver_knows(driver: FakeDriver, attached: RunningDriver) -> None:
    driver.server.note(logging.WARNING, "Motors off: an emergency stop.")
    state = attached.state
    right = state.arms["right"]
    assert (state.robot, state.process, state.operating_mode, state.motors) == (ROBOT, os.getpid(), "AUTO", "motoron")
    assert (right.mode, right.position, right.session) == (ArmMode.HOLDING, home(Side.RIGHT), 1)
    assert right.pose is not None
    assert right.cycles is not None
    assert [each.name for each in state.controllers["left"] if each.commands] == [GOAL_CONTROLLER]
    gripper = state.grippers["left"]
    assert gripper is not None
    assert (gripper.width, gripper.is_holding, gripper.state) == (0.02, True, "keep object")
    assert [(event.level, event.said.sentence) for event in state.events] == [
        ("warning", "Motors off: an emergency stop.")
    ]


def test_state_is_shown_in_lines(driver: FakeDriver, attached: RunningDriver) -> None:
    stop, cause = message("stop_open", stop="50204-1"), message("text", text="a <collision>")
    driver.manager.robot = replace(driver.manager.robot, reasons=(stop,), causes=(cause,), stop="50204-1")
    shown = repr(attached.state).splitlines()
    assert shown[:4] == [
        f"robot {ROBOT}, driver process {os.getpid()}",
        "operating mode AUTO, motoron, RAPID running, speed_scale 1, speed ratio 100 %",
        f"cannot move: {stop}",
        "stopped by: a <collision>",
    ]
    assert "left gripper: keep object, 20.0 mm, holding" in shown
    assert "stopped by: a &lt;collision&gt;" in attached.state._repr_html_()
    own = driver.manager.state()
    assert repr(own).splitlines() == [
        *shown[1:4],
        "right arm: EGM off, no state machine",
        "left arm: EGM off, no state machine",
    ]
    assert "stopped by: a &lt;collision&gt;" in own._repr_html_()


def test_arms_retreat_on_a_planned_path(
    driver: FakeDriver, attached: RunningDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: dict[str, object] = {}
    start = {side: home(side) for side in Side}
    points = {
        side: (
            TrajectoryPoint(0.0, start[side], ZERO_JOINTS, ZERO_JOINTS),
            TrajectoryPoint(1.0, start[side], ZERO_JOINTS, ZERO_JOINTS),
        )
        for side in Side
    }

    class FakePlanner:
        def __init__(self, grippers: object, **shapes: object) -> None:
            asked.update(shapes)

        def plan(self, start: object, goal: object, **options: object) -> Plan:
            asked.update(options, start=start, goal=goal)
            return Plan({side: home(side) for side in Side}, points, 1.0, 0.1, 0.02)

    monkeypatch.setattr("yumi.planning.planner.Planner", FakePlanner)

    def arrive(command: ControllerCommand) -> None:
        if isinstance(command.message, FollowTrajectory):
            report = TrajectoryEnded(
                command.message.goal, TrajectoryOutcome.SUCCEEDED, ResultCode.SUCCESSFUL, message("goal_reached")
            )
            driver.robot.motions.note(ControllerReport(command.side, command.controller, report))
        else:
            driver.robot.rest(command)

    driver.robot.control.on_command = arrive
    assert attached.retreat() == "The right and the left arm stand at the goal"
    assert (asked["start"], asked["goal"]) == (start, start)
    assert asked["speed_scale"] == RETREAT_SPEED_SCALE
    assert [each.name for each in asked["obstacles"]] == ["table"]  # type: ignore[attr-defined]
    assert [type(each.message) for each in driver.robot.control.commands[-2:]] == [FollowTrajectory] * 2


def test_state_says_what_stopped_the_robot(driver: FakeDriver, attached: RunningDriver) -> None:
    driver.manager.robot = replace(
        driver.manager.robot, reasons=(message("motors_off"),), causes=(COLLISION,), stop="50204-1"
    )
    driver.robot.motions.note(SessionLost(Side.RIGHT, 0.08, (GOAL_CONTROLLER,)))
    state = attached.state
    said = [each.message for each in (*state.reasons, *state.causes)]
    assert (said, state.stop) == ([message("motors_off"), COLLISION], "50204-1")
    assert (state.causes[0].code, state.causes[0].actions) == (COLLISION.code, ())
    assert (state.arms["right"].mode, state.arms["left"].mode) == (ArmMode.FAULT, ArmMode.HOLDING)


def test_controllers_are_read_again_only_when_they_have_changed(driver: FakeDriver, attached: RunningDriver) -> None:
    attached.state  # noqa: B018
    control = driver.robot.control
    control.call = lambda *args: pytest.fail("the control process was asked again")  # type: ignore[method-assign,assignment]
    assert attached.controllers["right"][0].name == GOAL_CONTROLLER


def test_watched_state_comes_again_and_again_with_new_events(driver: FakeDriver, attached: RunningDriver) -> None:
    states = attached.watch(60.0)
    assert next(states).events == ()
    driver.server.note(logging.INFO, "Motors on.")
    events = next(state.events for state in states if state.events)
    assert [event.said.sentence for event in events] == ["Motors on."]
    assert next(states).events == ()


def test_requests_reach_the_robot_manager(driver: FakeDriver) -> None:
    steps: list[str] = []
    with attach(ROBOT, on_step=steps.append) as attached:
        assert attached.start_egm("right") == "EGM runs"
        attached.start_egm()
        attached.set_mode("motors_off")
        attached.stop_egm()
        attached.speed_scale = 0.3
        assert attached.speed_scale == 0.3
        attached.calibrate("left")
    assert driver.manager.asked == [(Side.RIGHT,), None, RobotMode.MOTORS_OFF, "stop"]
    assert driver.calibrated == [(Side.LEFT,)]
    assert steps == ["motors off"]
    assert len(driver.changes) == 6  # the state that was asked for changed nothing


def test_stop_has_to_be_confirmed_by_its_id(driver: FakeDriver, attached: RunningDriver) -> None:
    driver.manager.robot = replace(driver.manager.robot, stop="50204-1")
    with pytest.raises(StopNotConfirmed, match="A person must confirm it") as refusal:
        attached.recover()
    assert refusal.value.stop == "50204-1"
    assert attached.recover(refusal.value.stop) == "The robot is ready"


def test_gripper_opens_and_closes(driver: FakeDriver, attached: RunningDriver) -> None:
    assert attached.open_gripper("right", 0.03).width == 0.03
    assert attached.close_gripper("right", 5.0).outcome is GripOutcome.HOLDING
    assert [(goal.position, goal.force) for goal in driver.grippers[Side.RIGHT].goals] == [(0.015, 0.0), (0.0, 5.0)]


def test_gripper_does_not_move_while_a_stop_waits(driver: FakeDriver, attached: RunningDriver) -> None:
    driver.manager.robot = replace(driver.manager.robot, stop="50204-1")
    with pytest.raises(RobotNotReady, match="A stop waits"):
        attached.open_gripper("left")
    assert driver.grippers[Side.LEFT].goals == []


def test_stop_that_comes_while_a_gripper_command_begins_counts(driver: FakeDriver, attached: RunningDriver) -> None:
    def stop() -> None:
        driver.manager.robot = replace(driver.manager.robot, stop="50204-1")

    driver.grippers[Side.LEFT].on_begin = stop
    with pytest.raises(RobotNotReady, match="A stop waits"):
        attached.open_gripper("left")
    assert driver.grippers[Side.LEFT].goals == []


def test_gripper_that_others_command_is_left_to_them(driver: FakeDriver, attached: RunningDriver) -> None:
    with driver.grippers[Side.LEFT].alone():
        with refused(CommandRefused, "gripper_busy", gripper="left"):
            attached.open_gripper("left")
        with refused(CommandRefused, "gripper_busy", gripper="left"):
            attached.calibrate()
        attached.open_gripper("right")
    assert (driver.grippers[Side.LEFT].goals, driver.calibrated) == ([], [])
    attached.calibrate()


@pytest.mark.parametrize(
    ("position", "goal"),
    [
        ("ready", named_pose(Side.RIGHT, "ready")),
        (home(Side.RIGHT), home(Side.RIGHT)),
        ({"j1": 0.2}, (0.2, *home(Side.RIGHT)[1:])),
        ({"yumi_joint_6_r": 0.2}, (*home(Side.RIGHT)[:6], 0.2)),
    ],
)
def test_arm_moves_to_a_position_a_pose_or_some_joints(
    driver: FakeDriver, attached: RunningDriver, position: Any, goal: Any
) -> None:
    driver.arrive()
    assert "stands at the goal" in attached.move_to(right=position, speed_scale=0.2)
    message = driver.robot.control.commands[0].message
    assert isinstance(message, JointGoal)
    assert (message.position, message.speed_scale) == (goal, 0.2)


def test_joints_are_named_to_the_driver_as_they_are(
    driver: FakeDriver, attached: RunningDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    def move(goals: Any, *rest: Any, **options: Any) -> None:
        raise CommandRefused(str(goals[Side.RIGHT]))

    monkeypatch.setattr(driver.robot.executor, "move", move)
    with pytest.raises(CommandRefused, match="cell_yumi_joint_1_r"):  # a prefix that only the driver knows
        attached.move_to(right={"cell_yumi_joint_1_r": 0.2})


def test_both_arms_move_at_once(driver: FakeDriver, attached: RunningDriver) -> None:
    driver.arrive()
    attached.move_to(right="home", left="ready")
    assert {command.side for command in driver.robot.control.commands} == set(Side)


def test_controller_that_commanded_the_arm_does_so_again(driver: FakeDriver, attached: RunningDriver) -> None:
    driver.robot.executor.activate([Side.RIGHT], STREAM_CONTROLLER)
    driver.arrive()
    attached.move_to(right="home")
    assert driver.robot.executor.commanding(Side.RIGHT) == (STREAM_CONTROLLER,)


def test_controller_that_commanded_the_arm_does_so_again_after_a_refusal(
    driver: FakeDriver, attached: RunningDriver
) -> None:
    driver.robot.executor.activate([Side.RIGHT], STREAM_CONTROLLER)
    driver.robot.control.refuses = True
    with pytest.raises(CommandRefused, match="Not now"):
        attached.move_to(right="home")
    assert driver.robot.executor.commanding(Side.RIGHT) == (STREAM_CONTROLLER,)


def test_arm_whose_motion_was_stopped_holds(driver: FakeDriver, attached: RunningDriver) -> None:
    driver.robot.executor.activate([Side.RIGHT], STREAM_CONTROLLER)
    with pytest.raises(GoalNotReached):
        attached.move_to(right="home", timeout=0.05)
    assert driver.robot.executor.commanding(Side.RIGHT) == (GOAL_CONTROLLER,)


@pytest.mark.parametrize(
    ("position", "code", "values"),
    [
        ({"j1": nan}, "goal_position_not_finite", {"position": "j1"}),
        ([*[0.0] * 6, inf], "goal_position_not_finite", {"position": 7, "value": "inf"}),
        ({"j1": "far"}, "goal_not_angles", {}),
        (
            {"j2": 4.0},
            "goal_joint_out_of_range",
            {"position": 4.0, "lower": YUMI_LIMITS.lower[1], "upper": YUMI_LIMITS.upper[1]},
        ),
        ({"j8": 0.0}, "goal_joint_unknown", {"joint": "j8"}),
        ("nowhere", "pose_name_unknown", {"name": "nowhere", "poses": ("home", "calibration", "ready")}),
        ([0.0] * 6, "goal_joint_count_of_arm", {"count": 6}),
    ],
)
def test_impossible_position_is_refused_and_changes_nothing(
    driver: FakeDriver, attached: RunningDriver, position: Any, code: str, values: dict[str, Any]
) -> None:
    with refused(CommandRefused, code, **values):
        attached.move_to(right=position)
    assert driver.robot.control.commands == []


def test_arm_that_moves_is_left_to_who_moves_it(driver: FakeDriver, attached: RunningDriver) -> None:
    control = driver.robot.control
    control.snapshots[Side.RIGHT] = control.snapshots[Side.RIGHT]._replace(velocity=(0.1,) * 7)
    with refused(CommandRefused, "arm_moves_commanded_by", arm="right", controllers=(GOAL_CONTROLLER,)):
        attached.move_to(right="home")
    assert control.commands == []


def test_motion_that_the_script_has_just_begun_is_left_to_it(driver: FakeDriver, attached: RunningDriver) -> None:
    driver.robot.executor.move({Side.RIGHT: "ready"}, None, None)
    with refused(CommandRefused, "arm_moves_commanded_by", arm="right"):
        attached.move_to(right="home")
    assert len(driver.robot.control.commands) == 1


def test_motion_that_ends_elsewhere_says_why(driver: FakeDriver, attached: RunningDriver) -> None:
    robot = driver.robot
    robot.control.on_command = lambda command: robot.end(command, GoalOutcome.ABORTED, "it was held back")
    with refused(GoalNotReached, "goal_not_reached", arm="left", reason=message("text", text="it was held back")):
        attached.move_to(left="home")


def test_motion_is_stopped_when_its_time_is_up(driver: FakeDriver, attached: RunningDriver) -> None:
    with refused(GoalNotReached, "motion_took_too_long", longest=0.05):
        attached.move_to(left="home", timeout=0.05)
    assert isinstance(driver.robot.control.commands[-1].message, StopMotion)


def test_motion_goes_on_when_it_cannot_be_said_how_far_it_is(
    driver: FakeDriver, attached: RunningDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def way(motion: Motion) -> MotionWay:
        asked.append(motion)
        if len(asked) == 2:
            driver.robot.end(driver.robot.control.commands[0])
        raise RobotNotReady("The control process does not answer.")

    monkeypatch.setattr(Motion, "way", property(way))
    assert attached.move_to(right="home") == "The right arm stands at the goal"
    assert len(asked) >= 2


def test_motion_of_a_client_that_goes_away_is_stopped(driver: FakeDriver) -> None:
    stopped = threading.Event()

    def note(command: Any) -> None:
        if isinstance(command.message, StopMotion):
            stopped.set()

    driver.robot.control.on_command = note
    connection, file = raw()
    with connection, file:
        file.write(b'{"id": 1, "method": "move", "right": "home"}\n')
        file.flush()
        assert "motions" in json.loads(file.readline())
    assert stopped.wait(WAIT)


def test_second_move_is_refused_while_one_is_under_way(driver: FakeDriver) -> None:
    is_moving = threading.Event()
    driver.robot.control.on_command = lambda command: is_moving.set()
    with attach() as first, attach() as second, ThreadPoolExecutor(1) as other:
        moving = other.submit(lambda: first.move_to(right="home"))
        assert is_moving.wait(WAIT)
        with refused(CommandRefused, "another_move_under_way"):
            second.move_to(left="home")
        driver.robot.end(driver.robot.control.commands[0])
        moving.result(WAIT)


def test_stop_waits_for_nothing_that_others_have_asked_for(driver: FakeDriver) -> None:
    driver.manager.blocks = threading.Event()
    with ThreadPoolExecutor(MAX_CLIENTS) as others, attach() as attached:

        def start() -> str:
            with attach() as one:
                return one.start_egm()

        starts = [others.submit(start) for _ in range(endpoint_server.MAX_WORK)]
        assert attached.stop_egm() == "EGM has ended"
        driver.manager.blocks.set()
        assert {each.result(WAIT) for each in starts} == {"EGM runs"}


@pytest.mark.parametrize("value", [nan, inf])
@pytest.mark.parametrize(
    ("name", "ask"),
    [
        ("force", lambda attached, value: attached.close_gripper("right", value)),
        ("width", lambda attached, value: attached.open_gripper("right", value)),
        *(
            (name, lambda attached, value, name=name: attached.move_to(right="home", **{name: value}))
            for name in ("speed_scale", "acceleration", "timeout", "speed")
        ),
        ("speed_scale", lambda attached, value: setattr(attached, "speed_scale", value)),
        ("seconds", lambda attached, value: attached.allow_collision("right gripper", "table", seconds=value)),
    ],
)
def test_number_that_is_not_finite_is_not_taken_for_one_that_is_left_out(
    driver: FakeDriver, name: str, ask: Callable[[RunningDriver, float], object], value: float
) -> None:
    with attach() as attached:
        with refused(CommandRefused, "value_not_finite", name=name):
            ask(attached, value)
        assert attached.stop_egm() == "EGM has ended"
    assert driver.robot.control.commands == []


@pytest.mark.parametrize("limit", ["MAX_WORK", "MAX_PENDING"])
def test_stop_is_not_refused_however_much_is_asked_for(
    driver: FakeDriver, monkeypatch: pytest.MonkeyPatch, limit: str
) -> None:
    with attach() as attached:
        monkeypatch.setattr(endpoint_server, limit, 0)
        with refused(CommandRefused, "too_many_requests"):
            attached.start_egm()
        assert attached.stop_egm() == "EGM has ended"
        assert attached.set_mode("motors_off") == "The motors are off"


@pytest.mark.parametrize(
    ("line", "code"),
    [
        (b"nonsense", NOT_UNDERSTOOD),
        (b"[]", NOT_UNDERSTOOD),
        (b'{"id": 7, "method": "shut_down"}', NOT_UNDERSTOOD),
        (b'{"id": 7, "method": "move", "arm": "right"}', NOT_UNDERSTOOD),
        (b'{"id": 7, "method": "move"}', "no_arm_has_goal"),
        (b'{"id": 7, "method": "move", "right": [0, 0, 0, 0, 0, 0, NaN]}', NOT_UNDERSTOOD),
        (b'{"id": 7, "method": "move", "right": [0, 0, 0]}', "goal_joint_count_of_arm"),
        (b'{"id": 7, "method": "move", "right": "home", "speed_scale": 2}', NOT_UNDERSTOOD),
        (b'{"id": 7, "method": "subscribe", "rate": 1000}', NOT_UNDERSTOOD),
        (b'{"id": 7, "method": "set_mode", "mode": "fast"}', NOT_UNDERSTOOD),
        (
            b'{"id": 7, "method": "grip", "arm": "right", "action": "open", "width": 0.2}',
            "gripper_position_out_of_range",
        ),
        (b'{"id": 7, "method": "grip", "arm": "right", "action": "close", "force": 50}', "gripper_force_out_of_range"),
        (b'{"id": 7, "method": "set_speed_scale", "speed_scale": 3}', "speed_scale_out_of_range"),
        (b'{"id": 7, "method": "switch_controllers", "arm": "right"}', "no_controller_named"),
        (b"[" * 100_000, NOT_UNDERSTOOD),
        (b'{"method": ' + b"[" * 100_000, NOT_UNDERSTOOD),
        (b'{"x": ' + b"[" * 100_000, NOT_UNDERSTOOD),
        (b'{"id": ' + b'{"id": ' * 100_000, NOT_UNDERSTOOD),
        (b'{"method": "recover", "confirm": "\xff"}', NOT_UNDERSTOOD),
        (b'{"id": 7, "method": "' + b"x" * 100_000 + b'"}', NOT_UNDERSTOOD),
    ],
)
def test_request_that_is_none_is_refused_with_its_number(driver: FakeDriver, line: bytes, code: str) -> None:
    answer = answer_to(line, b'{"method": "get_state"}')
    said = answer["error"]["said"]
    assert said["code"] == code
    assert said["sentence"] == sentence(from_wire(said), FrontEnd.ROS)
    assert len(json.dumps(said["values"])) < 200
    assert answer.get("id", 0) == (7 if b'"id": 7' in line and b"NaN" not in line else 0)
    assert driver.robot.control.commands == []
    assert driver.manager.asked == []


def test_fault_of_ours_is_answered_too(driver: FakeDriver, caplog: pytest.LogCaptureFixture) -> None:
    driver.manager.stop_egm = lambda: {}["gone"]  # type: ignore[method-assign]
    said = answer_to(b'{"method": "stop_egm"}')["error"]["said"]
    assert (said["code"], said["values"]["kind"]) == ("driver_failed", "KeyError")
    assert "A request of the local endpoint failed" in caplog.text


def test_fault_of_ours_ends_a_subscription_with_its_sentence(
    driver: FakeDriver, attached: RunningDriver, caplog: pytest.LogCaptureFixture
) -> None:
    states = attached.watch(60.0)
    next(states)
    driver.manager.state = lambda: {}["gone"]  # type: ignore[method-assign]
    with refused(CommandRefused, "driver_failed", kind="KeyError"):
        for _ in states:
            pass
    assert "A request of the local endpoint failed" in caplog.text


def test_client_that_sends_too_long_a_line_is_disconnected(driver: FakeDriver) -> None:
    connection, file = raw()
    with connection, file:
        connection.sendall(b"x" * (MAX_REQUEST + 1))
        assert json.loads(file.readline())["error"]["said"]["code"] == "request_too_long"
        poll_until(lambda: not driver.server.client_count)
    with attach() as attached:
        assert attached.state.is_connected


def test_joints_that_egm_does_not_report_are_those_the_controller_was_asked_for(driver: FakeDriver) -> None:
    driver.robot.control.snapshots[Side.LEFT] = Snapshot()
    driver.read[Side.LEFT] = JointStates(0.0, home(Side.LEFT), ZERO_JOINTS)
    connection, file = raw()
    with connection, file:
        connection.sendall(b'{"method": "subscribe", "id": 1, "rate": 30.0}\n')
        arms = json.loads(file.readline())["state"]["arms"]
    assert arms["left"]["position"] is None
    assert tuple(arms["left"]["resting"]) == home(Side.LEFT)
    assert arms["right"]["resting"] is None
    assert driver.subscriptions == 1


def test_client_that_does_not_read_is_disconnected(driver: FakeDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(endpoint_server, "MAX_BACKLOG", 1 << 14)
    connection, file = raw()
    with connection, file:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.sendall(b'{"method": "subscribe", "rate": 60}\n')
        poll_until(lambda: not driver.server.client_count)
    with attach() as attached:
        assert attached.state.is_connected


def poll_until(condition: Callable[[], bool]) -> None:
    deadline = threading.Event()
    for _ in range(1000):
        if condition():
            return
        deadline.wait(0.01)
    raise AssertionError("the condition did not come true")


def test_one_client_too_many_is_refused(driver: FakeDriver) -> None:
    clients = [attach() for _ in range(MAX_CLIENTS)]
    poll_until(lambda: driver.server.client_count == MAX_CLIENTS)  # each is served, although it asks for nothing
    with attach() as one_more, refused(CommandRefused, "too_many_clients", most=16):
        one_more.state  # noqa: B018
    assert all(client.state.is_connected for client in clients)
    clients.pop().close()
    poll_until(lambda: driver.server.client_count < MAX_CLIENTS)
    with attach() as one_more:
        assert one_more.state.is_connected
    for client in clients:
        client.close()


STOPS = [lambda one: one.stop_egm() == "EGM has ended", lambda one: one.set_mode("motors_off") == "The motors are off"]


@pytest.mark.parametrize("stop", STOPS, ids=["stop_egm", "motors_off"])
def test_stop_is_served_however_many_clients_there_are(
    driver: FakeDriver, stop: Callable[[RunningDriver], bool]
) -> None:
    with ExitStack() as stack:
        for _ in range(MAX_CLIENTS):
            stack.enter_context(attach())
        poll_until(lambda: driver.server.client_count == MAX_CLIENTS)
        for _ in range(MAX_SILENT + 5):  # more than may wait with nothing to ask for
            stack.enter_context(raw()[0])
        for _ in range(2):
            one_more = stack.enter_context(attach())
            assert stop(one_more)
            assert stop(one_more)
            with refused(CommandRefused, "too_many_clients", most=16):
                one_more.start_egm()
        assert driver.server.client_count == MAX_CLIENTS


def test_clients_that_ask_for_nothing_take_no_place(driver: FakeDriver) -> None:
    with ExitStack() as stack:
        for _ in range(MAX_SILENT):
            stack.enter_context(raw()[0])
        for _ in range(MAX_CLIENTS):
            assert stack.enter_context(attach()).state.is_connected
        assert driver.server.client_count == MAX_CLIENTS


class ShiftedTime:
    """The endpoint's clock: that of the machine, which can be put forward."""

    def __init__(self, machine: Callable[[asyncio.BaseEventLoop], float]) -> None:
        self.ahead = 0.0
        self.machine = machine

    def now(self, loop: asyncio.BaseEventLoop) -> float:
        return self.machine(loop) + self.ahead


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> ShiftedTime:
    clock = ShiftedTime(asyncio.BaseEventLoop.time)
    monkeypatch.setattr(asyncio.BaseEventLoop, "time", lambda loop: clock.now(loop))  # noqa: PLW0108 - a method needs its loop
    return clock


def test_client_that_asks_for_nothing_is_disconnected_and_one_that_has_attached_still_commands(
    clock: ShiftedTime, driver: FakeDriver
) -> None:
    connection, file = raw()
    with connection, file, attach() as attached, attach() as watching:
        states = watching.watch(60.0)
        next(states)
        connection.sendall(b"nonsense\n")  # not a request
        assert json.loads(file.readline())["error"]["said"]["code"] == NOT_UNDERSTOOD
        poll_until(lambda: driver.server.client_count == 2)
        clock.ahead = 600.0
        assert attached.stop_egm() == "EGM has ended"
        next(states)
        assert json.loads(file.readline())["error"]["said"]["code"] == "silent_client"
        assert file.readline() == b""


def test_client_that_attached_while_all_places_were_taken_is_not_kept(clock: ShiftedTime, driver: FakeDriver) -> None:
    with ExitStack() as stack:
        clients = [stack.enter_context(attach()) for _ in range(MAX_CLIENTS)]
        poll_until(lambda: driver.server.client_count == MAX_CLIENTS)
        connection, file = raw()
        stack.enter_context(connection)
        stack.enter_context(file)
        connection.sendall(b'{"method": "attach"}\nnonsense\n')
        assert json.loads(file.readline())["error"]["said"]["code"] == NOT_UNDERSTOOD  # so the client has attached
        clock.ahead = 600.0
        assert clients[0].state.is_connected
        assert json.loads(file.readline())["error"]["said"]["code"] == "too_many_clients"
        assert file.readline() == b""


@pytest.mark.parametrize(("method", "asked"), [("start_egm", []), ("stop_egm", ["stop"])])
def test_request_that_comes_while_its_connection_is_closed_is_carried_out_only_if_it_is_a_stop(
    clock: ShiftedTime, driver: FakeDriver, method: str, asked: list[str]
) -> None:
    connection, file = raw()
    with connection, file:
        connection.sendall(b"nonsense\n")
        assert json.loads(file.readline())["error"]["said"]["code"] == NOT_UNDERSTOOD
        clock.ahead = 600.0  # with the next data that comes the connection is closed
        connection.sendall(b'{"method": "%s"}\n' % method.encode())
        assert json.loads(file.readline())["error"]["said"]["code"] == "silent_client"
        assert file.readline() == b""
    poll_until(lambda: driver.manager.asked == asked)
    with attach() as attached:
        assert attached.state.is_connected
    assert driver.manager.asked == asked


def test_stop_whose_answer_takes_long_is_answered_however_many_clients_there_are(
    clock: ShiftedTime, driver: FakeDriver
) -> None:
    begun, may_end = threading.Event(), threading.Event()

    def stop_egm() -> str:
        begun.set()
        assert may_end.wait(WAIT)
        return "EGM has ended"

    driver.manager.stop_egm = stop_egm  # type: ignore[method-assign]
    with ExitStack() as stack, ThreadPoolExecutor(1) as other:
        clients = [stack.enter_context(attach()) for _ in range(MAX_CLIENTS)]
        poll_until(lambda: driver.server.client_count == MAX_CLIENTS)
        stopped = other.submit(stack.enter_context(attach()).stop_egm)
        assert begun.wait(WAIT)
        clock.ahead = 600.0
        assert clients[0].state.is_connected
        may_end.set()
        assert stopped.result(WAIT) == "EGM has ended"


def test_other_user_is_disconnected(driver: FakeDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    real = os.getuid()
    monkeypatch.setattr(endpoint_server, "_CREDENTIALS", _CredentialsOf(real + 1))
    with attach() as attached, refused(RobotNotReady, "driver_connection_lost"):
        attached.state  # noqa: B018


class _CredentialsOf:
    """Another user's, in place of those that the kernel gives."""

    size = struct.calcsize("3i")

    def __init__(self, user: int) -> None:
        self._user = user

    def unpack(self, data: bytes) -> tuple[int, int, int]:
        process, _, group = struct.unpack("3i", data)
        return process, self._user, group


def test_socket_can_be_opened_by_its_user_only(driver: FakeDriver) -> None:
    assert stat.S_IMODE(driver.server.path.stat().st_mode) == 0o600
    assert stat.S_IMODE(endpoint_folder().stat().st_mode) == 0o700


def test_folder_that_others_may_enter_is_refused(tmp_path: Path) -> None:
    endpoint_folder().chmod(0o755)
    with refused(RobotNotReady, "endpoint_folder_open_to_others"):
        EndpointClient(find_driver())


def test_socket_goes_with_the_driver_and_clients_learn_it() -> None:
    driver = FakeDriver()
    driver.server.start()
    with attach() as attached:
        driver.server.stop()
        with refused(RobotNotReady, "driver_connection_lost"):
            attached.state  # noqa: B018
    assert not driver.server.path.exists()
    assert driver.manager.is_interrupted


def test_socket_of_a_driver_that_was_killed_is_removed(driver: FakeDriver) -> None:
    stale = endpoint_path("10.0.0.1:80")
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(stale))
        dead.listen()
    assert find_driver() == driver.server.path
    assert not stale.exists()


def test_only_socket_of_a_driver_that_was_killed_is_removed() -> None:
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(endpoint_path(ROBOT)))
    with refused(RobotNotReady, "no_driver_runs"):
        attach()
    assert not endpoint_path(ROBOT).exists()


def test_socket_of_a_driver_that_was_killed_makes_room_for_the_next_one() -> None:
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(endpoint_path(ROBOT)))
    driver = FakeDriver()
    driver.server.start()
    with attach("192.168.125.1") as attached:
        assert attached.state.robot == ROBOT
    driver.server.stop()


def test_without_a_driver_the_way_to_start_one_is_named() -> None:
    with refused(RobotNotReady, "no_driver_runs"):
        yumi.attach()


def test_one_of_several_drivers_has_to_be_named(driver: FakeDriver) -> None:
    other = endpoint_path("127.0.0.1:8080", "/cell2")
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind(str(other))
        listening.listen()
        with refused(RobotNotReady, "several_drivers_run"):
            find_driver()
        assert {find_driver(name) for name in ("cell2", "/cell2", "127.0.0.1", "127.0.0.1:8080")} == {other}
        with refused(RobotNotReady, "no_driver_of_robot", robot="cell3"):
            find_driver("cell3")


def test_driver_goes_on_without_an_endpoint_where_its_path_is_too_long(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    folder = tmp_path / ("x" * 100)
    folder.mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(folder))
    lines: list[str] = []
    server = FakeDriver(lambda level, line: lines.append(line)).server
    server.start()
    server.stop()
    with refused(RobotNotReady, "endpoint_path_too_long", path=f"{folder}/yumi/{ROBOT}.sock") as refusal:
        endpoint_path(ROBOT)
    assert lines == [f"No command and no second script finds this driver: {refusal.value.said}"]


SPEEDS, OTHERS = (0.1, *ZERO_JOINTS[1:]), (0.0, 0.2, *ZERO_JOINTS[2:])


def speeds_of(driver: FakeDriver, side: Side) -> Joints:
    newest = driver.robot.speeds[side].read()
    assert newest is not None
    return newest[1].velocity


def test_second_client_does_not_jog_the_arm_that_one_jogs(driver: FakeDriver, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion_commands, "JOG_HOLDS", WAIT)  # the first client holds until it is gone
    driver.robot.control.on_command = driver.robot.rest
    with attach() as second:
        with attach() as first:
            for _ in range(2):
                first.jog("right", SPEEDS)
            with refused(CommandRefused, "jogged_by_another", arm="right"):
                second.jog("right", OTHERS)
            with refused(CommandRefused, "jogged_by_another", arm="right"):
                second.jog_tool("right", linear=(0.0, 0.0, 0.05))
            assert speeds_of(driver, Side.RIGHT) == SPEEDS
        poll_until(lambda: speeds_of(driver, Side.RIGHT) == ZERO_JOINTS)
        for _ in range(2):  # the first one takes the arm over
            second.jog("right", OTHERS)
        assert speeds_of(driver, Side.RIGHT) == OTHERS


def test_all_clients_are_served_while_an_arm_comes_to_rest_for_a_jog(driver: FakeDriver) -> None:
    driver.robot.control.on_command = driver.robot.rest
    waits, is_served = threading.Event(), threading.Event()
    served: list[bool] = []

    def rest_late(command: ControllerCommand) -> None:
        waits.set()
        served.append(is_served.wait(2.0))
        driver.robot.rest(command)

    with attach() as other:
        connection, file = raw()
        with connection, file:
            for _ in range(2):
                file.write(json.dumps({"method": "jog", "arm": "left", "speeds": SPEEDS}).encode() + b"\n")
                file.flush()
                assert "error" not in json.loads(file.readline())
            driver.robot.control.on_command = rest_late
            file.write(json.dumps({"method": "jog", "arm": "right", "speeds": SPEEDS}).encode() + b"\n")
            file.flush()
            assert waits.wait(WAIT)
        # That client is gone: its jog of the left arm ends at once, and nobody waits for the right arm.
        poll_until(lambda: speeds_of(driver, Side.LEFT) == ZERO_JOINTS)
        other.stop_egm()
        is_served.set()
        poll_until(lambda: bool(served))
    assert (served, driver.manager.asked) == ([True], ["stop"])


PAIR = "right gripper", "left gripper"


def test_collision_is_allowed_as_long_as_the_block_lasts(driver: FakeDriver) -> None:
    with attach() as attached:
        with attached.allow_collision(*PAIR, seconds=5.0):
            assert attached.state.allowed_collisions == ("right gripper - left gripper",)
        assert attached.state.allowed_collisions == ()


def test_collision_that_a_client_has_allowed_ends_with_its_connection(driver: FakeDriver) -> None:
    with attach() as attached, attach() as other:
        attached.allow_collision(*PAIR, seconds=60.0)
        attached.close()
        poll_until(lambda: not other.state.allowed_collisions)
        other.allow_collision(*PAIR, seconds=60.0)
        with pytest.raises(CommandRefused, match="there is no shelf"):
            other.allow_collision("shelf", "left arm", seconds=1.0)
        assert other.state.allowed_collisions


def test_collision_that_was_allowed_without_an_answer_in_time_ends_with_the_connection(
    driver: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    allow = driver.manager.allow_collision

    def too_late(part: str, other: str, seconds: float) -> str:
        allow(part, other, seconds)
        raise RobotNotReady("The control process did not answer.")

    monkeypatch.setattr(driver.manager, "allow_collision", too_late)
    with attach() as attached, attach() as other:
        with pytest.raises(RobotNotReady, match="did not answer"):
            attached.allow_collision(*PAIR, seconds=60.0)
        assert other.state.allowed_collisions
        attached.close()
        poll_until(lambda: not other.state.allowed_collisions)


def test_collision_that_was_refused_is_not_ended_with_the_connection_whatever_else_the_client_waits_for(
    driver: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended: list[tuple[str, str]] = []
    driver.manager.blocks = threading.Event()
    monkeypatch.setattr(driver.manager, "end_allowed_collision", lambda part, other: ended.append((part, other)))
    connection, file = raw()
    with connection, file:
        for line in (
            b'{"method": "start_egm", "id": 1}',
            b'{"method": "allow_collision", "id": 2, "part": "shelf", "other": "left arm", "seconds": 1.0}',
            b'{"method": "allow_collision", "id": 3, "part": "right gripper", "other": "table", "seconds": 60.0}',
        ):
            file.write(line + b"\n")
            file.flush()
            if b"allow" in line:
                file.readline()
    driver.manager.blocks.set()
    poll_until(lambda: bool(ended))
    assert ended == [("right gripper", "table")]


def test_each_collision_that_a_client_has_allowed_ends_although_one_cannot(
    driver: FakeDriver, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended: list[str] = []

    def end(part: str, other: str) -> str:
        ended.append(other)
        raise CommandRefused("That failed.")

    monkeypatch.setattr(driver.manager, "end_allowed_collision", end)
    with attach() as attached, attach() as other:
        for box in ("table", "wall"):
            attached.allow_collision("right gripper", box, seconds=60.0)
        with pytest.raises(CommandRefused, match="there is no shelf"):
            attached.allow_collision("shelf", "left arm", seconds=60.0)
        attached.close()
        poll_until(lambda: len(ended) > 1)
        assert other.state.is_connected
    assert sorted(ended) == ["table", "wall"]


def test_stream_gives_both_arms_and_grippers_a_point_and_ends_with_its_client(driver: FakeDriver) -> None:
    driver.robot.control.on_command = driver.robot.rest
    right, left = home(Side.RIGHT), home(Side.LEFT)
    with attach() as client:
        client.stream(right=right, left=left, velocities={"left": SPEEDS}, grippers={"right": 0.03}, delay=0.1)
        goals = {side: driver.robot.goals[side].read() for side in Side}
        assert [goal is not None and goal[1].delay for goal in goals.values()] == [0.1, 0.1]
        assert goals[Side.LEFT] is not None
        assert goals[Side.LEFT][1].velocity == SPEEDS
        poll_until(lambda: driver.grippers[Side.RIGHT].goals == [goal_of(closed_of("right", 0.03), 10.0)])
        driver.robot.control.commands.clear()
    poll_until(lambda: {each.side for each in driver.robot.control.commands} == set(Side))


def test_next_client_moves_an_arm_as_soon_as_a_move_is_over(driver: FakeDriver) -> None:
    driver.robot.control.on_command = driver.robot.end
    right = home(Side.RIGHT)
    with attach() as one, attach() as other:
        one.move_to(right=right)
        assert driver.robot.control.hand_over.of(Side.RIGHT).who is Commander.NONE
        other.move_to(right=right)


def test_stream_that_ends_leaves_the_stream_of_another_client_alone(driver: FakeDriver) -> None:
    driver.robot.control.hand_over = HandOver(driver.robot.clock.now)
    driver.robot.control.on_command = driver.robot.rest
    right = home(Side.RIGHT)
    with attach() as other:
        with attach() as client:
            client.stream(right=right)
            with refused(CommandRefused, "arm_commanded_by_another", who="stream"):
                other.stream(right=right)
            driver.robot.clock.advance(1.1 * CONTROLLER_IDLE_TIME)
            other.stream(right=right)
            driver.robot.control.commands.clear()
        poll_until(lambda: driver.server.client_count == 1)
        other.stream(right=right)
        assert driver.robot.control.commands == []


def test_stream_that_begins_elsewhere_is_led_to_its_points_where_it_names_blend(driver: FakeDriver) -> None:
    driver.robot.control.on_command = driver.robot.rest
    far = joints([value + 0.2 for value in home(Side.RIGHT)])
    with attach() as client:
        with refused(CommandRefused, "stream_begins_elsewhere", arm="right"):
            client.stream(right=far, left=home(Side.LEFT))
        assert [driver.robot.goals[side].read() for side in Side] == [None, None]
        client.stream(right=far, left=home(Side.LEFT), blend=1.0)
    newest = driver.robot.goals[Side.RIGHT].read()
    assert newest is not None
    assert newest[1].position == pytest.approx(home(Side.RIGHT))


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        ({}, "stream_empty"),
        ({"right": (0.0,) * 7, "delay": 2.0}, "stream_delay_out_of_range"),
        ({"right": (0.0,) * 7, "blend": 11.0}, "blend_out_of_range"),
        ({"grippers": {"right": 0.1}}, "stream_grippers_malformed"),
        ({"velocities": {"right": (0.0,) * 6}}, "stream_velocity_malformed"),
        ({"left": (0.0,) * 6}, "goal_joint_count_of_arm"),
    ],
)
def test_impossible_point_of_a_stream_is_refused(driver: FakeDriver, arguments: dict[str, Any], code: str) -> None:
    with attach() as client, refused(CommandRefused, code):
        client.stream(**arguments)
    assert [driver.robot.goals[side].read() for side in Side] == [None, None]
