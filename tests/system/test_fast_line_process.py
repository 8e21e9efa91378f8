"""The fast line as a process of its own, with the test as the robot on the other end of real sockets."""

from __future__ import annotations

import os
import signal
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from math import cos
from multiprocessing import active_children
from queue import Queue

import pytest

from yumi.clock import SystemClock, wait_until
from yumi.control.commands import put_goal
from yumi.control.controller import State
from yumi.control.controllers.joint_trajectory import FollowTrajectory
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
from yumi.control.shared_state import Snapshot, peek_snapshot
from yumi.control.trajectory import MOST_POINTS, JointTrajectory, TrajectoryPoint, plan_trajectory
from yumi.driver.control_process import ChildProcess, FastLines, PipeEnd
from yumi.driver.settings import read_controllers
from yumi.driver.wiring import EgmPlan, build_arm
from yumi.egm.codec import RobotCodec
from yumi.egm.messages import MciState, MotorState, RapidState, RobotMessage, SensorMessage
from yumi.egm.udp import Poller, UdpClient, UdpServer, free_port
from yumi.errors import CommandRefused, NoConnection, RobotNotReady
from yumi.process.realtime import prefer_process
from yumi.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, home, joint_names

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


def stream_both_arms(pipe: PipeEnd, ports: Mapping[Side, int]) -> None:
    """In a child: a robot that is wherever it was told to be; tells the longest answer when asked, ends at None."""
    prefer_process()
    clock, codec, poller = SystemClock(), RobotCodec(), Poller()
    links = {side: UdpClient("127.0.0.1", port) for side, port in ports.items()}
    positions = {side: home(side) for side in ports}
    sent, longest = dict.fromkeys(ports, 0.0), 0.0

    def take(side: Side) -> None:
        nonlocal longest
        for datagram in links[side].receive():
            longest = max(longest, clock.now() - sent[side])
            positions[side] = codec.decode(datagram).position or positions[side]  # type: ignore[assignment]

    for side in ports:
        poller.watch(links[side], partial(take, side))
    begin, number = clock.now(), 0
    while not pipe.has_value() or pipe.receive() is not None:
        for side, here in positions.items():
            state = replace(MESSAGE, seqno=number, measured_time=1.0 + number * CYCLE, measured=here, planned=here)
            sent[side] = clock.now()
            links[side].send(codec.encode(state))
        number += 1
        while (left := begin + number * CYCLE - clock.now()) > 0.0:
            poller.wait(left)
    pipe.send(longest)


def way(side: Side, seconds: float, count: int) -> FollowTrajectory:
    """Back and forth by a tenth of a radian, with a second to get there from wherever the arm moves."""
    start, step = home(side), seconds / count
    times = [step * (number + 1) for number in range(count)]
    points = [TrajectoryPoint(1.0 + time, (*start[:6], start[6] + 0.05 * (1.0 - cos(time)))) for time in times]
    points[-1] = TrajectoryPoint(1.0 + times[-1], points[-2].position)
    plan = plan_trajectory(JointTrajectory(joint_names(side), tuple(points)), (side,), YUMI_LIMITS)[side]
    return FollowTrajectory(plan, 1)


@pytest.mark.timeout(120)
def test_no_cycle_is_missed_while_goals_of_twenty_thousand_points_are_handed_over_to_moving_arms(
    ports: Mapping[Side, int], fast_lines: FastLines
) -> None:
    follow = {Side.RIGHT: way(Side.RIGHT, 80.0, MOST_POINTS), Side.LEFT: way(Side.LEFT, 20.0, 200)}
    robot = ChildProcess("robot", stream_both_arms, ports)
    robot.start()
    try:
        clock = SystemClock()
        wait_until(clock, lambda: all(fast_lines.snapshot(side).is_running for side in Side), 10.0, lambda: "no EGM")
        for side in Side:
            fast_lines.ask(SwitchControllers(side, activate=("joint_trajectory_controller",)))
        clock.wait(0.5)
        before = [fast_lines.snapshot(side).missed for side in Side]
        for goal in range(1, 4):
            for side in Side:
                order = replace(follow[side], goal=goal)
                fast_lines.ask(SendOrders((Order(side, "joint_trajectory_controller", order),)))
        clock.wait(0.5)
        assert [fast_lines.snapshot(side).missed for side in Side] == before
        assert all(fast_lines.snapshot(side).interruptions == 0 for side in Side)
        assert max(map(abs, fast_lines.snapshot(RIGHT).velocity)) > 0.0
    finally:
        robot.pipe.send(None)
        longest = robot.pipe.receive()
        robot.join(5.0)
    assert longest < 5.0 * CYCLE  # feedback would be interrupted
