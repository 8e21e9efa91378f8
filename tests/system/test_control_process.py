"""The control process, with the test as the robot on the other end of real sockets."""

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

from abb_protocols.egm.codec import MciState, MotorState, RapidState, RobotCodec, RobotMessage, SensorMessage
from abb_protocols.errors import CommandRefused, NoConnection, RobotNotReady
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, home, joint_names
from abb_runtime.clock import SystemClock, wait_until
from abb_runtime.process.child import ChildProcess, PipeEnd
from abb_runtime.process.realtime import prefer_process
from abb_runtime.udp import Poller, UdpClient, UdpServer, free_port
from refusals import refused
from yumi.control.controller import State
from yumi.control.goals import write_goal
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.loop_events import AllowedCollisionsChanged, ControlProcessEnded, Event, SessionLost
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.shared_state import Snapshot, read_snapshot
from yumi.control.trajectory_commands import FollowTrajectory
from yumi.driver.control_process import ControlProcess
from yumi.driver.settings import CollisionSettings, read_controllers
from yumi.driver.wiring import EgmPlan, build_arms
from yumi.planning.trajectory_request import MOST_POINTS, JointTrajectory, plan_trajectory

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

    def send_for(self, seconds: float, seqno: int) -> int:
        """Send a datagram each cycle, whatever is answered; returns the number of the next one."""
        clock = SystemClock()
        begin, first = clock.now(), seqno
        while (due := begin + (seqno - first) * CYCLE) < begin + seconds:
            while (left := due - clock.now()) > 0.0:
                self._poller.wait(left)
            self._link.send(self._codec.encode(replace(MESSAGE, seqno=seqno, measured_time=1.0 + seqno * CYCLE)))
            seqno += 1
        return seqno

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
def control(ports: Mapping[Side, int], events: Queue[Event]) -> Iterator[ControlProcess]:
    controllers = {side: read_controllers(side) for side in Side}
    plan = EgmPlan("127.0.0.1", "127.0.0.1", ports, 0.05, CYCLE, controllers)
    lines = ControlProcess(partial(build_arms, plan), events.put)
    lines.start()
    yield lines
    lines.stop()


@pytest.fixture
def robot(ports: Mapping[Side, int]) -> Iterator[Robot]:
    robot = Robot(ports[RIGHT])
    yield robot
    robot.close()


def snapshot(control: ControlProcess) -> Snapshot:
    """After a cycle: the snapshot is written before it is done."""
    assert control.buffers[RIGHT].cycle_done.acquire(timeout=5.0)
    return read_snapshot(control.buffers[RIGHT].snapshots)


def test_control_process_answers_with_the_measured_position_then_follows_goals(
    control: ControlProcess, robot: Robot
) -> None:
    assert robot.exchange(MESSAGE).position == pytest.approx(HOME, abs=1e-6)
    assert snapshot(control).is_running
    control.call(Commands.switch_controllers, RIGHT, (POSITION,))
    write_goal(control.buffers[RIGHT].goals, 1, ELSEWHERE)
    reply = robot.exchange(replace(MESSAGE, seqno=1, measured_time=1.004))
    assert reply.position is not None
    assert 0.0 < (reply.position[0] or 0.0) < 0.2


PAIR = "right gripper", "left gripper"


def test_control_process_lets_parts_touch_until_their_time_is_over(
    ports: Mapping[Side, int], events: Queue[Event]
) -> None:
    controllers = {side: read_controllers(side) for side in Side}
    kept = CollisionSettings(enabled=True)
    plan = EgmPlan("127.0.0.1", "127.0.0.1", ports, 0.05, CYCLE, controllers, collision=kept)
    control = ControlProcess(partial(build_arms, plan), events.put)
    control.start()
    try:
        with pytest.raises(CommandRefused, match="no two parts 'right gripper' and 'shelf'"):
            control.call(Commands.allow_collision, "right gripper", "shelf", 1.0)
        control.call(Commands.allow_collision, *PAIR, 0.1)
        changes = [events.get(timeout=10.0) for _ in range(2)]
        control.call(Commands.allow_collision, *PAIR, 60.0)
        control.call(Commands.end_allowed_collision, *PAIR)
        changes += [events.get(timeout=10.0) for _ in range(2)]
    finally:
        control.stop()
    pairs = [change.pairs for change in changes if isinstance(change, AllowedCollisionsChanged)]
    assert pairs == [(PAIR[::-1],), (), (PAIR[::-1],), ()]


def test_control_process_goes_on_when_the_terminal_stops_its_programs(control: ControlProcess, robot: Robot) -> None:
    for child in active_children():
        os.kill(child.pid or 0, signal.SIGTSTP)
    assert robot.exchange(MESSAGE).position == pytest.approx(HOME, abs=1e-6)


def test_control_process_tells_that_the_robot_is_lost_within_100_ms(
    control: ControlProcess, robot: Robot, events: Queue[Event]
) -> None:
    robot.exchange(MESSAGE)
    while not isinstance(event := events.get(timeout=5.0), SessionLost):
        continue
    assert event.side is RIGHT
    assert event.silence < 0.1
    assert not read_snapshot(control.buffers[RIGHT].snapshots).is_streaming


@pytest.mark.parametrize("seconds", [0.3, 2.3])  # in the longer one the socket's buffer overflows
def test_control_process_that_was_stopped_ends_the_motion(
    control: ControlProcess, robot: Robot, events: Queue[Event], seconds: float
) -> None:
    robot.exchange(MESSAGE)
    snapshot(control)
    control.call(Commands.switch_controllers, RIGHT, (POSITION,))
    write_goal(control.buffers[RIGHT].goals, 1, ELSEWHERE)
    sent = robot.exchange(replace(MESSAGE, seqno=1, measured_time=1.0 + CYCLE)).position
    child = next(child for child in active_children() if child.name == "yumi-control")
    os.kill(child.pid, signal.SIGSTOP)
    seqno = robot.send_for(seconds, 2)
    os.kill(child.pid, signal.SIGCONT)
    robot.send_for(0.2, seqno)
    while not isinstance(event := events.get(timeout=5.0), SessionLost):
        continue
    assert event.deactivated == (POSITION,)
    assert event.stood_still == pytest.approx(seconds, abs=0.1)
    assert not control.snapshot(RIGHT).is_commanded
    assert control.snapshot(RIGHT).is_streaming
    assert control.snapshot(RIGHT).sent == pytest.approx(sent, abs=0.001)


def test_control_process_says_that_its_port_is_taken(ports: Mapping[Side, int], events: Queue[Event]) -> None:
    controllers = {side: read_controllers(side) for side in Side}
    plan = EgmPlan("127.0.0.1", "127.0.0.1", ports, 0.05, CYCLE, controllers)
    lines = ControlProcess(partial(build_arms, plan), events.put)
    with (
        UdpServer("127.0.0.1", ports[RIGHT]),
        pytest.raises(NoConnection, match=f"UDP port {ports[RIGHT]} is taken"),
    ):
        lines.start()


def test_control_process_that_was_launched_is_waited_for_or_ended(
    ports: Mapping[Side, int], events: Queue[Event]
) -> None:
    controllers = {side: read_controllers(side) for side in Side}
    plan = EgmPlan("127.0.0.1", "127.0.0.1", ports, 0.05, CYCLE, controllers)
    for is_waited_for in (True, False):
        lines = ControlProcess(partial(build_arms, plan), events.put)
        lines.launch()
        (child,) = (each for each in active_children() if each.name == "yumi-control")
        if is_waited_for:
            lines.start()
            assert child in active_children()
            lines.check()
        lines.stop()
        assert child.exitcode == 0
        assert events.empty()


def test_control_process_that_was_killed_is_started_again(
    control: ControlProcess, robot: Robot, events: Queue[Event]
) -> None:
    robot.exchange(MESSAGE)
    snapshot(control)
    control.call(Commands.switch_controllers, RIGHT, (POSITION,))
    before = control.snapshot(RIGHT).command_epoch
    next(child for child in active_children() if child.name == "yumi-control").kill()
    while not isinstance(events.get(timeout=5.0), ControlProcessEnded):
        continue
    with refused(RobotNotReady, "control_process_is_gone"):
        control.check()
    assert control.revive()
    control.check()
    assert not control.snapshot(RIGHT).is_streaming
    answer = robot.exchange(replace(MESSAGE, seqno=900))
    assert answer.position == pytest.approx(HOME)
    assert control.call(Commands.switch_controllers, RIGHT, (POSITION,))
    after = control.snapshot(RIGHT).command_epoch
    assert after > before, "what was given before would count as given now"


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
    number = 0
    while not pipe.has_value() or pipe.receive() is not None:
        due = clock.now() + CYCLE  # a robot sends no two datagrams at once
        for side, here in positions.items():
            state = replace(MESSAGE, seqno=number, measured_time=1.0 + number * CYCLE, measured=here, planned=here)
            sent[side] = clock.now()
            links[side].send(codec.encode(state))
        number += 1
        while (left := due - clock.now()) > 0.0:
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
    ports: Mapping[Side, int], control: ControlProcess
) -> None:
    follow = {Side.RIGHT: way(Side.RIGHT, 80.0, MOST_POINTS), Side.LEFT: way(Side.LEFT, 20.0, 200)}
    robot = ChildProcess("robot", stream_both_arms, ports)
    robot.start()
    try:
        clock = SystemClock()
        wait_until(clock, lambda: all(control.snapshot(side).is_running for side in Side), 30.0, lambda: "no EGM")
        for side in Side:
            control.call(Commands.switch_controllers, side, ("joint_trajectory_controller",))
        clock.wait(0.5)
        before = [control.snapshot(side).wire.missed for side in Side]
        for goal in range(1, 4):
            for side in Side:
                order = replace(follow[side], goal=goal)
                control.call(Commands.send_commands, ControllerCommand(side, "joint_trajectory_controller", order))
        wait_until(clock, lambda: max(map(abs, control.snapshot(RIGHT).velocity)) > 0.0, 10.0, lambda: "no motion")
        assert [control.snapshot(side).wire.missed for side in Side] == before
        assert all(control.snapshot(side).interruptions == 0 for side in Side)
    finally:
        robot.pipe.send(None)
        longest = robot.pipe.receive()
        robot.join(5.0)
    assert longest < 5.0 * CYCLE  # feedback would be interrupted


@pytest.fixture(scope="module")
def idle_control() -> Iterator[ControlProcess]:
    """One for the tests that leave it as they found it; they come last, since those above look for their own child."""
    controllers = {side: read_controllers(side) for side in Side}
    plan = EgmPlan("127.0.0.1", "127.0.0.1", {side: free_port() for side in Side}, 0.05, CYCLE, controllers)
    lines = ControlProcess(partial(build_arms, plan), lambda event: None)
    lines.start()
    yield lines
    lines.stop()


def test_control_process_that_keeps_nothing_apart_has_nothing_to_allow(idle_control: ControlProcess) -> None:
    with pytest.raises(CommandRefused, match=r"collision\.enabled is false"):
        idle_control.call(Commands.allow_collision, *PAIR, 1.0)


class Unreadable:
    """Cannot be unpickled."""

    def __reduce__(self) -> tuple[type, tuple[str]]:
        return int, ("no number",)


def test_control_process_refuses_a_command_that_cannot_be_read_and_goes_on(idle_control: ControlProcess) -> None:
    with refused(CommandRefused, "command_unreadable", kind="ValueError") as refusal:
        idle_control.call(Commands.send_commands, ControllerCommand(RIGHT, POSITION, Unreadable()))
    assert "no number" in str(refusal.value)
    assert idle_control.call(Commands.list_controllers, RIGHT)


def test_control_process_lists_its_controllers(idle_control: ControlProcess) -> None:
    infos = idle_control.call(Commands.list_controllers, RIGHT)
    states = {info.name: info.state for info in infos}
    assert states.pop("joint_state_broadcaster") is State.ACTIVE
    assert {POSITION, "joint_goal_controller"} <= set(states)
    assert set(states.values()) == {State.INACTIVE}


def test_control_process_loads_what_it_knows_and_lists_its_parameters(idle_control: ControlProcess) -> None:
    (kind,) = (
        kind
        for kind in idle_control.call(Commands.list_controller_kinds, RIGHT)
        if kind.endswith("/JointPositionController")
    )
    idle_control.call(Commands.load_controller, RIGHT, "second", kind)
    idle_control.call(Commands.set_parameters, RIGHT, "second", {"p": 0.5})
    idle_control.call(Commands.configure_controller, RIGHT, "second")
    (info,) = (
        info for info in idle_control.call(Commands.list_parameters, RIGHT, "second") if info.parameter.name == "p"
    )
    assert (info.value, info.parameter.highest) == (0.5, 2.0)
    assert idle_control.call(Commands.list_controllers, RIGHT)[-1].state is State.INACTIVE
    assert read_snapshot(idle_control.buffers[RIGHT].snapshots).activity > 0
    idle_control.call(Commands.unload_controller, RIGHT, "second")


def test_control_process_leads_the_hardware_of_an_arm(idle_control: ControlProcess) -> None:
    info = idle_control.call(Commands.set_hardware_state, RIGHT, "ROB_R", State.UNCONFIGURED)
    assert (info.state, idle_control.call(Commands.hardware, RIGHT)) == (State.UNCONFIGURED, info)
    assert all(each.state is not State.ACTIVE for each in idle_control.call(Commands.list_controllers, RIGHT))
    idle_control.call(Commands.set_hardware_state, RIGHT, "ROB_R", State.ACTIVE)


def test_control_process_passes_commands_to_both_arms_or_none(idle_control: ControlProcess) -> None:
    commands = [ControllerCommand(side, POSITION, "go") for side in Side]
    with pytest.raises(CommandRefused, match="'joint_position_controller' is inactive and takes no commands"):
        idle_control.call(Commands.send_commands, *commands)


def test_control_process_refuses_to_start_controllers_before_egm_runs(idle_control: ControlProcess) -> None:
    with pytest.raises(CommandRefused, match="EGM is not running on this arm"):
        idle_control.call(Commands.switch_controllers, RIGHT, (POSITION,))


def test_control_process_refuses_a_gain_out_of_range(idle_control: ControlProcess) -> None:
    with pytest.raises(CommandRefused, match="Controller 'joint_position_controller': p is 9"):
        idle_control.call(Commands.set_parameters, RIGHT, POSITION, {"p": 9.0})
