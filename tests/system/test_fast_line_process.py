"""The fast line as a process of its own, with the test as the robot on the other end of real sockets."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from multiprocessing import active_children
from queue import Queue

import pytest

from yumi.app import EgmPlan, build_arm
from yumi.control.goals import put_goal
from yumi.control.lifecycle import State
from yumi.control.requests import (
    ConfigureController,
    Event,
    FastLineEnded,
    ListControllerKinds,
    ListControllers,
    ListHardware,
    ListParameters,
    LoadController,
    Order,
    SendOrders,
    SessionLost,
    SetHardwareState,
    SetParameters,
    SwitchControllers,
)
from yumi.control.snapshot import Snapshot, peek_snapshot
from yumi.egm.codec import RobotCodec
from yumi.egm.messages import MciState, MotorState, RapidState, RobotMessage, SensorMessage
from yumi.errors import CommandRefused, NoConnection, RobotNotReady
from yumi.hardware.fast_lines import FastLines
from yumi.links.poller import Poller
from yumi.links.udp import UdpClient, UdpServer, free_port
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import Joints, Side
from yumi.settings import read_controllers

pytestmark = pytest.mark.real_time

RIGHT = Side.RIGHT
POSITION = "joint_position_controller"
HOME: Joints = (0.0, -2.0, 1.0, 0.5, 0.0, 0.7, 0.0)
ELSEWHERE: Joints = (0.2, -2.0, 1.0, 0.5, 0.0, 0.7, 0.0)
MESSAGE = RobotMessage(
    0, 0, HOME, HOME, None, None, 1.0, 1.0, MotorState.ON, MciState.RUNNING, RapidState.RUNNING, False
)


class Robot:
    """Sends one datagram and waits for the answer, as often as it is asked to."""

    def __init__(self, port: int) -> None:
        self._link = UdpClient("127.0.0.1", port)
        self._codec = RobotCodec()
        self._poller = Poller()
        self._answers: list[bytes] = []
        self._poller.watch(self._link, lambda: self._answers.extend(self._link.receive()))

    def exchange(self, message: RobotMessage) -> SensorMessage:
        self._link.send(self._codec.encode(message))
        self._poller.wait(5.0)
        return self._codec.decode(self._answers.pop())

    def close(self) -> None:
        self._poller.close()
        self._link.close()


@pytest.fixture
def ports() -> Mapping[Side, int]:
    return {side: free_port() for side in Side}


@pytest.fixture
def events() -> Queue[Event]:
    return Queue()


@pytest.fixture
def fast_lines(ports: Mapping[Side, int], events: Queue[Event]) -> Iterator[FastLines]:
    controllers = {side: read_controllers(side) for side in Side}
    plan = EgmPlan("127.0.0.1", "127.0.0.1", ports, 0.05, CYCLE, controllers)
    lines = FastLines(partial(build_arm, plan), events.put)
    lines.start()
    yield lines
    lines.stop()


@pytest.fixture
def robot(ports: Mapping[Side, int]) -> Iterator[Robot]:
    robot = Robot(ports[RIGHT])
    yield robot
    robot.close()


def snapshot(fast_lines: FastLines) -> Snapshot:
    """After the bell: the snapshot is written before it rings."""
    assert fast_lines.boxes[RIGHT].bell.acquire(timeout=5.0)
    return peek_snapshot(fast_lines.boxes[RIGHT].snapshots)


def test_fast_line_answers_with_the_measured_position_then_follows_goals(fast_lines: FastLines, robot: Robot) -> None:
    assert robot.exchange(MESSAGE).position == pytest.approx(HOME, abs=1e-6)
    assert snapshot(fast_lines).is_running
    fast_lines.ask(SwitchControllers(RIGHT, activate=(POSITION,)))
    put_goal(fast_lines.boxes[RIGHT].goals, 1, ELSEWHERE)
    reply = robot.exchange(replace(MESSAGE, seqno=1, measured_time=1.004))
    assert reply.position is not None
    assert 0.0 < (reply.position[0] or 0.0) < 0.2


class Unreadable:
    """Cannot be unpickled."""

    def __reduce__(self) -> tuple[type, tuple[str]]:
        return int, ("no number",)


def test_fast_line_refuses_a_request_that_cannot_be_read_and_goes_on(fast_lines: FastLines) -> None:
    with pytest.raises(CommandRefused, match=r"The request cannot be read: ValueError: .*no number"):
        fast_lines.ask(SendOrders((Order(RIGHT, POSITION, Unreadable()),)))
    assert fast_lines.ask(ListControllers(RIGHT)).controllers


def test_fast_line_goes_on_when_the_terminal_stops_its_programs(fast_lines: FastLines, robot: Robot) -> None:
    for child in active_children():
        os.kill(child.pid or 0, signal.SIGTSTP)
    assert robot.exchange(MESSAGE).position == pytest.approx(HOME, abs=1e-6)


def test_fast_line_lists_its_controllers(fast_lines: FastLines) -> None:
    infos = fast_lines.ask(ListControllers(RIGHT)).controllers
    states = {info.name: info.state for info in infos}
    assert states.pop("joint_state_broadcaster") is State.ACTIVE
    assert {POSITION, "joint_goal_controller"} <= set(states)
    assert set(states.values()) == {State.INACTIVE}


def test_fast_line_loads_what_it_knows_and_lists_its_parameters(fast_lines: FastLines) -> None:
    (kind,) = (
        kind for kind in fast_lines.ask(ListControllerKinds(RIGHT)).kinds if kind.endswith("/JointPositionController")
    )
    fast_lines.ask(LoadController(RIGHT, "second", kind, {"p": 0.5}))
    fast_lines.ask(ConfigureController(RIGHT, "second"))
    (info,) = (
        info for info in fast_lines.ask(ListParameters(RIGHT, "second")).parameters if info.parameter.name == "p"
    )
    assert (info.value, info.parameter.highest) == (0.5, 2.0)
    assert fast_lines.ask(ListControllers(RIGHT)).controllers[-1].state is State.INACTIVE
    assert peek_snapshot(fast_lines.boxes[RIGHT].snapshots).activity > 0


def test_fast_line_leads_the_hardware_of_an_arm(fast_lines: FastLines) -> None:
    (info,) = fast_lines.ask(SetHardwareState(RIGHT, "ROB_R", State.UNCONFIGURED)).hardware
    assert (info.state, fast_lines.ask(ListHardware(RIGHT)).hardware) == (State.UNCONFIGURED, (info,))
    assert all(each.state is not State.ACTIVE for each in fast_lines.ask(ListControllers(RIGHT)).controllers)


def test_fast_line_passes_orders_to_both_arms_or_none(fast_lines: FastLines) -> None:
    orders = tuple(Order(side, POSITION, "go") for side in Side)
    with pytest.raises(CommandRefused, match="'joint_position_controller' is inactive and takes no orders"):
        fast_lines.ask(SendOrders(orders))


def test_fast_line_refuses_to_start_controllers_before_egm_runs(fast_lines: FastLines) -> None:
    with pytest.raises(CommandRefused, match="EGM is not running on this arm"):
        fast_lines.ask(SwitchControllers(RIGHT, activate=(POSITION,)))


def test_fast_line_refuses_a_gain_out_of_range(fast_lines: FastLines) -> None:
    with pytest.raises(CommandRefused, match="'p' of controller 'joint_position_controller' is 9"):
        fast_lines.ask(SetParameters(RIGHT, POSITION, {"p": 9.0}))


def test_fast_line_tells_that_the_robot_is_lost_within_100_ms(
    fast_lines: FastLines, robot: Robot, events: Queue[Event]
) -> None:
    robot.exchange(MESSAGE)
    while not isinstance(event := events.get(timeout=5.0), SessionLost):
        continue
    assert event.side is RIGHT
    assert event.silence < 0.1
    assert not peek_snapshot(fast_lines.boxes[RIGHT].snapshots).is_streaming


def test_fast_line_says_that_its_port_is_taken(ports: Mapping[Side, int], events: Queue[Event]) -> None:
    controllers = {side: read_controllers(side) for side in Side}
    plan = EgmPlan("127.0.0.1", "127.0.0.1", ports, 0.05, CYCLE, controllers)
    lines = FastLines(partial(build_arm, plan), events.put)
    with (
        UdpServer("127.0.0.1", ports[RIGHT]),
        pytest.raises(NoConnection, match=f"UDP port {ports[RIGHT]} is taken"),
    ):
        lines.start()


def test_fast_line_that_was_killed_is_started_again(fast_lines: FastLines, robot: Robot, events: Queue[Event]) -> None:
    robot.exchange(MESSAGE)
    next(child for child in active_children() if child.name == f"yumi-fast-line-{RIGHT.value}").kill()
    while not isinstance(events.get(timeout=5.0), FastLineEnded):
        continue
    with pytest.raises(RobotNotReady, match="The fast-line process of the right arm has ended; call recover"):
        fast_lines.check()
    assert fast_lines.revive() == (RIGHT,)
    fast_lines.check()
    assert not fast_lines.snapshot(RIGHT).is_streaming
    answer = robot.exchange(replace(MESSAGE, seqno=900))
    assert answer.position == pytest.approx(HOME)
    assert fast_lines.ask(SwitchControllers(RIGHT, activate=(POSITION,))).sentence
