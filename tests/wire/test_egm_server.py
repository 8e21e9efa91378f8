"""The EGM server on a real socket, with the test as the robot on the other end."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from math import inf, nan, sqrt
from pathlib import Path
from typing import Any

import pytest
from egm_robots import MESSAGE, SIX

import yumi
from abb_protocols.catalogue import Message, message
from abb_protocols.egm import egm_pb2 as pb
from abb_protocols.egm.codec import MciState, PathCorrection, Pose, RapidData, RobotCodec, RobotMessage, SensorMessage
from abb_protocols.errors import CommandRefused, NoConnection, ProtocolError, RobotNotReady
from abb_runtime.udp import Poller, UdpClient
from refusals import refused
from yumi import EgmServer
from yumi.driver.egm_server import MOST_UNREADABLE

SEVEN = (0.0, -2.0, 1.0, 0.5, 0.0, 0.7, 0.25)
POSE = Pose((0.25, 0.5, 0.75), (0.0, 1.0, 0.0, 0.0))


class Robot:
    """Says what the test wants and reads the answer."""

    def __init__(self, port: int, axes: int = 6) -> None:
        self._link = UdpClient("127.0.0.1", port)
        self._poller = Poller()
        self._answers: list[bytes] = []
        self._poller.watch(self._link, lambda: self._answers.extend(self._link.receive()))
        self.codec = RobotCodec(axes=axes)

    def say(self, *messages: RobotMessage) -> None:
        for each in messages:
            self.send(self.codec.encode(each))

    def send(self, datagram: bytes) -> None:
        self._link.send(datagram)

    def listen(self) -> bytes:
        self._poller.wait(2.0)
        return self._answers.pop()

    def hear(self) -> SensorMessage:
        return self.codec.decode(self.listen())

    def close(self) -> None:
        self._poller.close()
        self._link.close()


@pytest.fixture
def server() -> Iterator[EgmServer]:
    with EgmServer(0, host="127.0.0.1", timeout=0.05, silence=2.0) as server:
        yield server


@pytest.fixture
def robot(server: EgmServer) -> Iterator[Robot]:
    robot = Robot(server.port)
    yield robot
    robot.close()


@pytest.fixture
def seven(server: EgmServer) -> Iterator[Robot]:
    robot = Robot(server.port, axes=7)
    yield robot
    robot.close()


def seqno(message: RobotMessage, number: int) -> RobotMessage:
    return replace(message, seqno=number, measured_time=message.measured_time + 0.004 * number)


def test_state_is_what_the_robot_says(server: EgmServer, robot: Robot) -> None:
    robot.say(MESSAGE)
    state = server.receive(1.0)
    assert state is not None
    assert (state.joints, state.planned) == (pytest.approx(SIX, abs=1e-6), pytest.approx(SIX, abs=1e-6))
    assert state.pose is not None
    assert state.pose.position == pytest.approx((0.5, 0.1, 0.7), abs=1e-6)
    assert (state.session, state.is_first, state.dt, state.external, state.is_running) == (1, True, 0.0, (), True)


def test_state_of_a_seven_axis_arm_is_in_chain_order(server: EgmServer, seven: Robot) -> None:
    seven.say(replace(MESSAGE, measured=SEVEN, planned=SEVEN))
    state = server.receive(1.0)
    assert state is not None
    assert state.joints == pytest.approx(SEVEN, abs=1e-6)
    server.send(joints=SEVEN, speed=SEVEN)
    heard = seven.hear()
    assert heard.position == heard.velocity == pytest.approx(SEVEN)


def test_external_axes_are_no_part_of_the_arm_when_axes_is_six() -> None:
    with EgmServer(0, host="127.0.0.1", axes=6) as server:
        robot = Robot(server.port)
        robot.say(replace(MESSAGE, measured_external=(1.5,), planned_external=(1.5,)))
        state = server.receive(1.0)
        assert state is not None
        assert (len(state.joints), state.external) == (6, pytest.approx((1.5,), abs=1e-6))
        server.send(joints=SIX, external=[1.25], external_speed=[0.5])
        heard = robot.hear()
        assert (heard.external, heard.external_velocity) == (pytest.approx((1.25,)), pytest.approx((0.5,)))
        robot.close()


@pytest.mark.parametrize(
    ("sent", "heard"),
    [
        ({"joints": [0.1] * 6}, {"position": (0.1,) * 6}),
        ({"speed": [0.1] * 6}, {"velocity": (0.1,) * 6}),
        ({"pose": POSE}, {"tool_position": POSE.position, "tool_orientation": POSE.orientation}),
        ({"twist": [0.1, 0, 0, 0, 0, 0.2]}, {"twist": (0.1, 0, 0, 0, 0, 0.2)}),
    ],
)
def test_server_sends_what_it_is_told_and_nothing_else(
    server: EgmServer, robot: Robot, sent: dict[str, Any], heard: dict[str, Any]
) -> None:
    robot.say(MESSAGE)
    server.receive(1.0)
    server.send(**sent)
    message = robot.hear()
    nothing = SensorMessage(message.seqno)
    for name in ("position", "velocity", "tool_position", "tool_orientation", "twist", "external"):
        value, expected = getattr(message, name), heard.get(name, getattr(nothing, name))
        assert value == (pytest.approx(expected) if expected else expected)


def test_server_holds_the_measured_position_until_it_is_told_another(server: EgmServer, robot: Robot) -> None:
    robot.say(MESSAGE)
    server.receive(1.0)
    server.send()
    first = robot.hear()
    assert first.position == pytest.approx(SIX, abs=1e-6)
    assert first.tool_position == pytest.approx((0.5, 0.1, 0.7), abs=1e-6)
    server.send(joints=[0.5] * 6, speed=[0.1] * 6)
    server.send(data=RapidData(flag=True))
    assert robot.hear() == SensorMessage(2, pytest.approx((0.5,) * 6), rapid_data=RapidData(flag=True))


def test_server_numbers_its_answers_and_holds_anew_in_a_new_session(server: EgmServer, robot: Robot) -> None:
    robot.say(MESSAGE)
    server.receive(1.0)
    server.send(joints=[0.5] * 6)
    assert robot.hear().seqno == 0
    robot.say(replace(MESSAGE, measured_time=200.0))
    state = server.receive(1.0)
    server.send()
    heard = robot.hear()
    assert state is not None
    assert (state.session, state.is_first, heard.seqno) == (2, True, 0)
    assert heard.position == pytest.approx(SIX, abs=1e-6)


def test_loop_yields_the_newest_state_and_ends_when_the_robot_is_silent(server: EgmServer, robot: Robot) -> None:
    robot.say(*(seqno(MESSAGE, number) for number in range(5)))
    states = list(server)
    assert states[-1].message.seqno == 4
    wire = server.wire
    assert len(states) + wire.late == 5
    assert (wire.session, wire.lost, wire.malformed) == (1, 0, 0)


def test_loop_ends_when_the_server_is_stopped(server: EgmServer, robot: Robot) -> None:
    robot.say(MESSAGE)
    for state in server:
        assert state.is_first
        server.stop()


def test_loop_says_what_to_check_when_no_robot_speaks(server: EgmServer) -> None:
    with refused(NoConnection, "no_robot_spoke", port=server.port, timeout=0.05):
        list(server)


def test_state_tells_the_robots_time_since_the_one_before(server: EgmServer, robot: Robot) -> None:
    robot.say(MESSAGE)
    server.receive(1.0)
    robot.say(replace(MESSAGE, seqno=1, measured_time=100.004032))
    state = server.receive(1.0)
    assert state is not None
    assert state.dt == pytest.approx(0.004032, abs=1e-6)


def test_state_of_a_stream_is_not_running(server: EgmServer, robot: Robot) -> None:
    robot.say(replace(MESSAGE, mci=MciState.STOPPED))
    state = server.receive(1.0)
    assert state is not None
    assert not state.is_running


def test_receive_gives_nothing_when_nothing_comes(server: EgmServer) -> None:
    assert server.receive(0.0) is None


def test_correction_reaches_the_robot(server: EgmServer, robot: Robot) -> None:
    robot.say(MESSAGE)
    server.receive(1.0)
    server.send_correction((0.0, 0.0015, -0.0025), age=0.012)
    assert robot.codec.decode_correction(robot.listen()) == PathCorrection(0, (0.0, 0.0015, -0.0025), age_ms=12)


@pytest.mark.parametrize("age", [-0.1, nan, inf, 1e7])
def test_correction_of_an_impossible_age_is_refused(server: EgmServer, robot: Robot, age: float) -> None:
    robot.say(MESSAGE)
    server.receive(1.0)
    with refused(CommandRefused, "correction_of_other_age", limit=1e6):
        server.send_correction((0.0, 0.0, 0.0), age=age)


def of_other_length(name: str, count: int, needed: int) -> Message:
    return message("reference_of_other_length", name=name, count=count, needed=needed)


@pytest.mark.parametrize(
    ("sent", "said"),
    [
        ({"joints": [0.0] * 7}, of_other_length("joints", 7, 6)),
        ({"joints": [0.0] * 5 + [nan]}, message("reference_not_finite", name="joints")),
        ({"speed": [inf] * 6}, message("reference_not_finite", name="speed", value=inf)),
        ({"twist": [0.0] * 3}, of_other_length("twist", 3, 6)),
        ({"external": [0.0]}, of_other_length("external", 1, 0)),
        ({"external_speed": [0.0]}, of_other_length("external_speed", 1, 0)),
        (
            {"pose": Pose((0.0, nan, 0.0), (1.0, 0.0, 0.0, 0.0))},
            message("reference_not_finite", name="position of pose"),
        ),
        (
            {"pose": Pose((0.0, 0.0, 0.0), (1.0, 1.0, 0.0, 0.0))},
            message("reference_not_unit_quaternion", norm=sqrt(2.0)),
        ),
        ({"data": RapidData(numbers=(0.0,) * 41)}, message("rapid_data_too_long", count=41, limit=40)),
        ({"data": RapidData(numbers=(nan,))}, message("reference_not_finite", name="data")),
    ],
)
def test_reference_the_robot_cannot_take_is_refused(
    server: EgmServer, robot: Robot, sent: dict[str, Any], said: Message
) -> None:
    robot.say(MESSAGE)
    server.receive(1.0)
    with refused(CommandRefused, said.code, **said.values):
        server.send(**sent)


def test_nothing_can_be_sent_before_the_robot_speaks(server: EgmServer) -> None:
    with refused(RobotNotReady, "no_state_to_answer"):
        server.send()
    with refused(RobotNotReady, "no_state_to_answer"):
        server.send_correction((0.0, 0.0, 0.0))


def test_what_is_no_robot_is_told_once_it_is_certain(server: EgmServer, robot: Robot) -> None:
    old = pb.EgmRobot.FromString(robot.codec.encode(MESSAGE))
    old.feedBack.ClearField("time")
    for _ in range(MOST_UNREADABLE):
        robot.send(old.SerializeToString())
    with refused(ProtocolError, "sender_cannot_be_guided", port=server.port) as refusal:
        server.receive(1.0)
    assert refusal.value.said.values["reason"] == str(message("datagram_without_time"))


def test_datagrams_of_another_address_are_left_aside() -> None:
    with EgmServer(0, host="127.0.0.1", robot="192.0.2.1") as server:
        robot = Robot(server.port)
        robot.say(MESSAGE)
        assert server.receive(0.05) is None
        robot.close()


def test_port_that_is_taken_is_said(server: EgmServer) -> None:
    with refused(NoConnection, "udp_port_taken", port=server.port):
        EgmServer(server.port, host="127.0.0.1")


def test_importing_the_package_loads_nothing_of_it() -> None:
    code = "import sys, yumi; print(sorted(name for name in sys.modules if name.startswith(('yumi.', 'google'))))"
    own = {**os.environ, "PYTHONPATH": str(Path(yumi.__file__).parents[1])}  # and nothing that the tests add
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, env=own).stdout
    assert loaded.strip() == "[]"


def test_package_has_nothing_else_to_offer() -> None:
    import yumi

    with pytest.raises(AttributeError, match="no attribute 'EgmClient'"):
        yumi.EgmClient  # noqa: B018


def test_server_hears_this_machine_alone_unless_told_where_the_robot_is() -> None:
    with EgmServer(0) as server:
        assert server.address == "127.0.0.1"
    with EgmServer(0, robot="127.0.0.2") as server:
        assert server.address.startswith("127.")
    with EgmServer(0, host="") as server:
        assert server.address == "0.0.0.0"


def test_server_that_hears_this_machine_alone_says_so_when_no_robot_spoke() -> None:
    with (
        EgmServer(0, timeout=0.05) as server,
        refused(NoConnection, "no_robot_spoke_on_this_machine", port=server.port, timeout=0.05),
    ):
        next(iter(server))
