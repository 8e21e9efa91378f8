"""EGM Path Correction on the whole virtual controller: a sensor's offsets beside the lines and circles of a program."""

from __future__ import annotations

import socket
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from math import pi, sin
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from abb_protocols.egm import egm_pb2 as pb
from abb_protocols.egm.codec import MciState, PathCorrection, RobotMessage, SensorCodec, SensorMessage
from abb_protocols.robot.joints import Side, Vector
from abb_protocols.robot.kinematics import matrix_from_quaternion
from virtual_irc5.controller.installed_system import ROBOTS, factory_system, with_programs
from virtual_irc5.mechanics.egm_client import EgmClientState
from virtual_irc5.world import World, WorldSettings

Array = NDArray[np.float64]
Sensor = Callable[[RobotMessage], bytes | None]

PARAMETERS = """MOC:CFG_1.0:6:1::
EXT_MOTION_DATA:
      -name "pathCorr" -ext_motion_level 2
"""

SEAM = r"""MODULE Seam
    VAR egmident egmID1;
    PERS tooldata torch:=[TRUE,[[0,0,60],[1,0,0,0]],[0.3,[0,0,30],[1,0,0,0],0,0,0]];
    PERS tooldata sensor:=[TRUE,[[30,0,60],[1,0,0,0]],[0.1,[0,0,30],[1,0,0,0],0,0,0]];
    PERS wobjdata plate:=[FALSE,TRUE,"",[[300,0,250],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
    CONST robtarget seam_start:=[[0,-100,0],[0,0,1,0],[-1,0,-1,0],[9E9,9E9,9E9,9E9,9E9,9E9]];

    PROC main()
        MoveAbsJ [[0,0,0,0,30,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v1000,fine,torch;
        ConfL\Off;
        EGMReset egmID1;
        EGMGetId egmID1;
        {setup}
        {act}
        MoveJ seam_start,v200,fine,torch\WObj:=plate;
        TPWrite "seam";
        {moves}
        TPWrite "done "+ValToStr(EGMGetState(egmID1));
    {handler}
    ENDPROC
ENDMODULE
"""
SETUP = r'EGMSetupUC ROB_1,egmID1,"pathCorr","UCdevice"\PathCorr\APTR\CommTimeout:=0.5;'
ACT = r"EGMActMove egmID1,sensor.tframe\SampleRate:=48;"
LINE = r"EGMMoveL egmID1,Offs(seam_start,0,200,0),v100,fine,torch\WObj:=plate;"


def offset(point: Vector) -> bytes:
    """The sensor's datagram with an offset beside the path [m]."""
    return SensorCodec().encode_correction(PathCorrection(1, point, age_ms=5))


def always(point: Vector) -> Sensor:
    return lambda _: offset(point)


@dataclass
class Seam:
    """A program with corrected moves on an IRB 120, and a sensor that answers each datagram of the robot."""

    path: Path
    parts: dict[str, str]
    sensor: Sensor
    sent: list[RobotMessage] = field(default_factory=list)
    points: list[Array] = field(
        default_factory=list
    )  # of the torch on the plate [m]: planned, from the seam's start on
    parameters: str = PARAMETERS
    datagram: bytes = b""  # the last

    def __post_init__(self) -> None:
        file, cfg = self.path / "seam.mod", self.path / "MOC.cfg"
        parts = {"setup": SETUP, "act": ACT, "handler": "", **self.parts}
        program = SEAM
        for name, text in parts.items():
            program = program.replace("{" + name + "}", text)
        file.write_text(program, encoding="ascii")
        cfg.write_text(self.parameters, encoding="ascii")
        system = with_programs(factory_system(ROBOTS["irb120"]), {"T_ROB1": [file]}, cfg=[cfg])
        self.world = World(WorldSettings(system=system))
        self.world.controller.set_motors(on=True)
        self.world.controller.start_rapid("once")

    @property
    def screen(self) -> Sequence[str]:
        return list(self.world.controller.screens["T_ROB1"])

    @property
    def events(self) -> list[int]:
        return [event.code for event in self.world.controller.events.entries()]

    def step(self) -> None:
        codec = SensorCodec(axes=6)
        sent = self.world.cycle({Side.RIGHT: self._inbox} if self._inbox else {})
        self._inbox.clear()
        if Side.RIGHT in sent:
            self.datagram = sent[Side.RIGHT]
            self.sent.append(codec.decode(sent[Side.RIGHT]))
            answer = self.sensor(self.sent[-1])
            self._inbox = [] if answer is None else [answer]
        if "seam" in self.screen:
            arm = self.world.arms[Side.RIGHT]
            pose = arm.tool_pose(arm.planned, None)
            self.points.append(
                pose.position + matrix_from_quaternion(pose.orientation) @ (0.0, 0.0, 0.06) - (0.3, 0.0, 0.25)
            )

    _inbox: list[bytes] = field(default_factory=list)

    def run(self, limit: float = 20.0) -> Seam:
        while self.world.controller.is_running and self.world.controller.time < limit:
            self.step()
        assert not self.world.controller.is_running, f"still running after {limit} s"
        return self


def test_line_is_corrected_across_its_direction(tmp_path: Path) -> None:
    seam = Seam(tmp_path, {"moves": LINE}, always((0.02, 0.004, -0.002))).run()
    assert seam.screen == ["seam", f"done {int(EgmClientState.CONNECTED)}"]
    points = np.array(seam.points)
    # The path leads along y and the torch points down: y of the path is x of the plate, z of the path is -z.
    settled = points[points[:, 1] > -0.04]
    assert len(settled) > 300
    assert settled[:, 0] == pytest.approx(0.004, abs=1e-4)
    assert settled[:, 2] == pytest.approx(0.002, abs=1e-4)
    assert points[-1, 1] == pytest.approx(0.1, abs=1e-4), "x of the sensor moves nothing"
    assert np.max(np.linalg.norm(np.diff(points, axis=0), axis=1)) < 0.001, "without a jump"


def test_robot_sends_its_state_at_the_sample_rate_while_the_path_is_corrected(tmp_path: Path) -> None:
    seam = Seam(tmp_path, {"moves": LINE + "WaitTime 0.5;"}, always((0.0, 0.004, 0.0))).run()
    assert [message.seqno for message in seam.sent] == list(range(len(seam.sent)))
    assert {message.mci for message in seam.sent[:-1]} == {MciState.RUNNING}
    assert seam.sent[-1].mci is MciState.STOPPED
    times = np.array([message.measured_time for message in seam.sent[:-1]])
    assert np.diff(times) == pytest.approx(12 * seam.world.cycle_time)
    places = np.array([message.planned_pose.position for message in seam.sent])  # type: ignore[union-attr]
    assert places[0] == pytest.approx((0.0, -0.1, 0.0), abs=1e-3), "the torch on the plate"
    assert places[-1] == pytest.approx((0.004, 0.1, 0.0), abs=1e-3)


def test_public_client_corrects_a_path_over_udp(tmp_path: Path) -> None:
    public = pytest.importorskip("abb_robot_client.egm", reason="needs abb-robot-client")
    client = public.EGM(port=0)
    with closing(client), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as robot:
        robot.bind(("127.0.0.1", 0))
        robot.settimeout(5.0)

        def answer(_: RobotMessage) -> bytes:  # the robot waits for it, so that the test does not depend on time
            robot.sendto(seam.datagram, ("127.0.0.1", client.socket.getsockname()[1]))
            is_received, state = client.receive_from_robot(timeout=5.0)
            assert is_received
            assert len(state.joint_angles) == 6
            assert client.send_to_robot_path_corr([0.0, 4.0, -2.0])
            return robot.recv(1024)

        seam = Seam(tmp_path, {"moves": LINE}, answer)
        seam.run()
    assert seam.points[-1] == pytest.approx((0.004, 0.1, 0.002), abs=2e-4)


def weave(place: float) -> float:
    """Where a seam is beside its line [m] at a place on the line [m]."""
    return 0.005 * sin(2.0 * pi * place / 0.1)


def test_torch_follows_a_seam_that_the_sensor_sees_ahead_within_a_millimetre(tmp_path: Path) -> None:
    ahead = 0.05 * 0.22  # [m] at 50 mm/s: sampling, servo and the filter of corrections

    def see(message: RobotMessage) -> bytes:
        assert message.measured_pose is not None
        return offset((0.0, weave(message.measured_pose.position[1] + ahead), 0.0))

    points = np.array(Seam(tmp_path, {"moves": LINE.replace("v100", "v50")}, see).run().points)
    constant = points[(points[:, 1] > -0.06) & (points[:, 1] < 0.08)]  # at constant speed
    errors = constant[:, 0] - [weave(place) for place in constant[:, 1]]
    assert np.max(np.abs(constant[:, 0])) > 0.004
    assert np.max(np.abs(errors)) < 0.001


def test_circle_is_corrected_away_from_its_centre(tmp_path: Path) -> None:
    circle = r"EGMMoveC egmID1,Offs(seam_start,50,50,0),Offs(seam_start,0,100,0),v50,fine,torch\WObj:=plate;"
    points = np.array(Seam(tmp_path, {"moves": circle}, always((0.0, 0.005, 0.0))).run().points)
    radii = np.linalg.norm(points - (0.0, -0.05, 0.0), axis=1)
    assert radii[0] == pytest.approx(0.05, abs=1e-4)
    settled = radii[len(radii) // 2 :]
    assert settled == pytest.approx(0.055, abs=2e-4)
    assert np.max(np.abs(points[:, 2])) < 1e-4


def test_moves_through_a_zone_are_one_session_and_a_move_without_correction_leads_back(tmp_path: Path) -> None:
    moves = LINE.replace("200,0),v100,fine", "100,0),v100,z10") + LINE.replace("plate;", r"plate\NoCorr;")
    seam = Seam(tmp_path, {"moves": moves}, always((0.0, 0.004, 0.0))).run()
    assert [message.seqno for message in seam.sent] == list(range(len(seam.sent)))
    points = np.array(seam.points)
    assert points[(points[:, 1] > -0.04) & (points[:, 1] < -0.01), 0] == pytest.approx(0.004, abs=2e-4)
    assert points[points[:, 1] > 0.06, 0] == pytest.approx(0.0, abs=2e-4)


def test_correction_goes_on_after_a_stop_of_the_program(tmp_path: Path) -> None:
    seam = Seam(tmp_path, {"moves": LINE}, always((0.0, 0.004, 0.0)))
    controller, arm = seam.world.controller, seam.world.arms[Side.RIGHT]
    while not seam.points or seam.points[-1][1] < 0.0:
        seam.step()
    controller.stop_rapid()
    while not arm.is_stationary:
        seam.step()
    for _ in range(100):
        seam.step()
    stopped = len(seam.sent)
    assert seam.sent[-1].mci is MciState.STOPPED
    assert seam.points[-1][0] == pytest.approx(0.004, abs=1e-4), "it stands beside the path"
    controller.start_rapid("once")
    seam.run()
    assert [message.seqno for message in seam.sent[stopped:]] == list(range(len(seam.sent) - stopped))
    assert seam.screen[-1] == f"done {int(EgmClientState.CONNECTED)}"
    points = np.array(seam.points)
    assert points[points[:, 1] > -0.04, 0] == pytest.approx(0.004, abs=1e-4)


HANDLER = r"""ERROR
        IF ERRNO=ERR_UDPUC_COMM THEN
            TPWrite "no sensor";
            TRYNEXT;
        ENDIF"""


def test_silent_sensor_stops_the_arm_and_raises_an_error_that_the_program_handles(tmp_path: Path) -> None:
    seam = Seam(tmp_path, {"moves": LINE, "handler": HANDLER}, lambda _: None).run()
    assert seam.screen == ["seam", "no sensor", f"done {int(EgmClientState.CONNECTED)}"]
    assert 41822 in seam.events
    assert -0.09 < seam.points[-1][1] < -0.04, "half a second along the line"
    assert np.array(seam.points)[:, 0] == pytest.approx(0.0, abs=1e-5)


def test_silent_sensor_stops_a_program_that_does_not_wait_for_the_path(tmp_path: Path) -> None:
    def see(message: RobotMessage) -> bytes | None:
        assert message.measured_pose is not None
        return offset((0.0, 0.0, 0.0)) if message.measured_pose.position[1] < 0.0 else None

    moves = LINE.replace("fine", "z50") + 'WaitTime 3; TPWrite "too late";'
    seam = Seam(tmp_path, {"moves": moves, "handler": HANDLER}, see).run()
    assert seam.screen == ["seam"]
    assert 41822 in seam.events
    assert 0.03 < seam.points[-1][1] < 0.099


def test_stop_of_egm_leads_back_to_the_path_with_ramp_down(tmp_path: Path) -> None:
    moves = LINE.replace("fine", "z50") + "EGMStop egmID1,EGM_STOP_RAMP_DOWN;"
    seam = Seam(tmp_path, {"moves": moves}, always((0.0, 0.004, 0.0))).run()
    points = np.array(seam.points)
    assert np.max(points[:, 0]) == pytest.approx(0.004, abs=1e-4)
    assert seam.points[-1] == pytest.approx((0.0, 0.1, 0.0), abs=2e-4)


def test_program_that_streams_first_and_moves_to_the_seam_then_is_corrected(tmp_path: Path) -> None:
    parts = {"setup": SETUP + r"EGMStreamStop egmID1; EGMStreamStart egmID1\SampleRate:=4;", "moves": LINE}
    seam = Seam(tmp_path, parts, always((0.0, 0.004, 0.0))).run()
    begins = [index for index, message in enumerate(seam.sent) if message.seqno == 0]
    assert [seam.sent[index].mci for index in begins] == [MciState.STOPPED, MciState.RUNNING]
    assert seam.points[-1] == pytest.approx((0.004, 0.1, 0.0), abs=2e-4)


def test_references_of_joints_do_not_correct_a_path(tmp_path: Path) -> None:
    datagram = SensorCodec(axes=6).encode(SensorMessage(0, (0.1,) * 6))
    seam = Seam(tmp_path, {"moves": LINE, "handler": HANDLER}, lambda _: datagram).run()
    assert "no sensor" in seam.screen
    assert np.array(seam.points)[:, 0] == pytest.approx(0.0, abs=1e-5)


def test_correction_that_is_no_number_makes_the_controller_fail(tmp_path: Path) -> None:
    message = pb.EgmSensorPathCorr(
        header=pb.EgmHeader(seqno=1, mtype=pb.EgmHeader.MSGTYPE_PATH_CORRECTION),
        pathCorr=pb.EgmPathCorr(pos=pb.EgmCartesian(x=0.0, y=float("nan"), z=0.0), age=1),
    )
    seam = Seam(tmp_path, {"moves": LINE}, lambda _: message.SerializeToString()).run()
    assert not seam.world.arms[Side.RIGHT].motors_on
    assert any("path correction that is not of finite" in e.description for e in seam.world.controller.events.entries())


@pytest.mark.parametrize(
    ("parts", "sentence"),
    [
        ({"act": ""}, "EGMMoveL: no path is corrected yet: use EGMActMove before."),
        ({"setup": SETUP.replace(r"PathCorr\APTR", "Joint")}, "EGMActMove: EGMSetupUC has chosen joints (41826)."),
        ({"setup": SETUP.replace(r"PathCorr\APTR", "Pose")}, "EGMActMove: EGMSetupUC has chosen poses (41826)."),
        ({"act": "EGMActJoint egmID1;"}, "EGMActJoint: EGMSetupUC has chosen path corrections (41826)."),
        ({"moves": r"EGMRunJoint egmID1,EGM_STOP_HOLD\J1;"}, "EGMSetupUC has chosen path corrections (41826)."),
        (
            {"setup": SETUP.replace("APTR", "LATR")},
            "EGMSetupUC: this virtual controller has no sensors that look ahead",
        ),
        ({"setup": SETUP.replace("pathCorr", "default")}, "needs the level 2, Path (50452)."),
        (
            {"moves": r"MoveL Offs(seam_start,0,50,0),v50,z10,torch\WObj:=plate;" + LINE},
            "EGMMoveL: EGM has to begin in a fine point",
        ),
        ({"moves": "EGMReset egmID1;" + LINE}, "EGM of the robot is disconnected"),
    ],
)
def test_corrected_move_says_what_is_missing(tmp_path: Path, parts: dict[str, str], sentence: str) -> None:
    seam = Seam(tmp_path, {"moves": LINE, **parts}, always((0.0, 0.0, 0.0))).run()
    assert any(sentence in event.description for event in seam.world.controller.events.entries())
    assert not any(text.startswith("done") for text in seam.screen)
