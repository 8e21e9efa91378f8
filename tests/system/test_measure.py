"""`yumi measure` through the whole path: driver, network and a virtual controller in processes of their own.

It takes a minute and a half; its parts are tested in ``unit/evaluation``, the motions on a robot in memory.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from math import inf, radians
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest
from script_bench import VirtualRobot, run_python

import yumi
from abb_protocols.robot.joints import CHAIN_AXES, CYCLE, Joints, Side
from abb_runtime.faults import Fault
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_parameters import EgmParameters, read_egm_parameters, write_egm_parameters
from yumi.recording.reader import read_recording
from yumi_evaluation.identification import Dynamics, answer
from yumi_evaluation.logs import read_logs

ANOTHER = EgmParameters(position_gain=6.5, reference_delay=0.0065, delay=0.018, lag=0.009)
MOTIONS = ("ramp", "sine", "step")

# The command as it is installed; the environment of a test may be older than its entry point.
PROGRAM = """
from yumi.cli.main import main
from yumi_evaluation.cli import measure
main.add_command(measure, "measure")
main()
"""


def begin(robot: VirtualRobot, folder: Path, *arguments: str) -> subprocess.Popen[str]:
    ports = [f"--{name.replace('_', '-')}={robot.options[name]}" for name in ("left_egm_port", "right_egm_port")]
    host, _, rws_port = robot.address.partition(":")
    where = ("--robot", f"{host}:{rws_port}", *ports, "--output", str(folder / "measured"))
    return run_python(folder, "-c", PROGRAM, "measure", *arguments, "--yes", *where)


@dataclass
class Measured:
    """What the command has left and printed."""

    folder: Path
    output: str
    exit_code: int

    @property
    def recordings(self) -> Path:
        return self.folder / "measured" / "recordings"

    @property
    def comparison(self) -> dict[str, Any]:
        return dict(json.loads((self.folder / "measured" / "comparison.json").read_text()))


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Measured]:
    """Of the right arm of a virtual robot with other parameters."""
    folder = tmp_path_factory.mktemp("measure")
    write_egm_parameters(ANOTHER, folder / "another.yaml", "For a test.")
    robot = VirtualRobot(folder, dynamics=folder / "another.yaml")
    robot.start()
    try:
        process = begin(robot, folder, "right", "--json")
        output, _ = process.communicate(timeout=240.0)
        yield Measured(folder, output, process.returncode)
    finally:
        robot.stop()


pytestmark = [pytest.mark.soak, pytest.mark.timeout(300)]


def test_parameters_of_another_robot_are_found(measured: Measured) -> None:
    assert measured.exit_code == 0, measured.output
    (robot,) = measured.comparison["robots"]
    model = ANOTHER.applied(ArmModel(), CHAIN_AXES)
    true = Dynamics(ANOTHER.position_gain or 0.0, model)
    assert robot["k"]["value"] == pytest.approx(true.gain, rel=0.05)
    assert robot["lag_s"]["value"] == pytest.approx(true.lag(CYCLE), rel=0.05)
    assert robot["dead_time_s"]["value"] == pytest.approx(true.dead_time(CYCLE), abs=1e-3)
    assert [each["record"] for each in measured.comparison["records"]] == [f"{name}, right arm" for name in MOTIONS]
    assert "start it with the settings file" in " ".join(measured.output.split())
    printed = json.loads(measured.output.splitlines()[-1])
    assert printed["robots"] == measured.comparison["robots"]
    names = [Path(name).name for name in printed["files"]]
    assert names == ["recordings", "comparison.svg", "yumi.yaml", "measured.zip"]


def test_virtual_robot_with_the_settings_moves_as_the_measured_one(measured: Measured) -> None:
    parameters = read_egm_parameters(measured.folder / "measured" / "yumi.yaml")
    dynamics = Dynamics(parameters.position_gain or 0.0, parameters.applied(ArmModel(), CHAIN_AXES))
    motions = read_logs(measured.recordings).motions
    assert len(motions) == len(MOTIONS)
    for log in motions:
        difference = np.degrees(answer(log, dynamics) - log.measured)
        assert np.sqrt(np.square(difference).mean()) <= 0.002
        as_delivered = np.degrees(answer(log, Dynamics()) - log.measured)
        assert np.sqrt(np.square(as_delivered).mean()) > 0.02  # so that the settings say something


def test_no_joint_was_sent_further_than_two_degrees_or_faster_than_ten_degrees_a_second(measured: Measured) -> None:
    for name in MOTIONS:
        frames = read_recording(measured.recordings / f"{name}.mcap", before=inf, after=inf).frames
        assert [side for side, own in frames.items() if own] == [Side.RIGHT]
        sent = np.degrees([frame.sent for frame in frames[Side.RIGHT]])
        assert 1.4 < np.abs(sent - sent[0]).max() <= 2.0
        assert np.abs(np.diff(sent, axis=0)).max() / CYCLE <= 10.0 + 1e-6
        assert not np.any([frame.sent_velocity for frame in frames[Side.RIGHT]])


def test_archive_has_all_evidence_and_no_address_or_password(measured: Measured) -> None:
    with ZipFile(measured.folder / "measured.zip") as packed:
        texts = {name: packed.read(name) for name in packed.namelist()}
    expected = {"comparison.json", "comparison.svg", "doctor.json", "measurement.json", "yumi.yaml"}
    assert {*texts} == {f"measured/{name}" for name in (*expected, *(f"recordings/{each}.mcap" for each in MOTIONS))}
    document = json.loads(texts["measured/measurement.json"])
    assert (document["controller"], document["motions"], document["ended"]) == ("virtual", ["ramp", "step", "sine"], "")
    assert document["egm_motion"]["max_speed_deviation"] == 10.0
    for name, content in texts.items():
        assert b"127.0.0.1" not in content, name
        assert b"robotics" not in content, name


def has_moved(position: Joints | None, since: Joints | None) -> bool:
    """By half a degree."""
    assert position is not None
    assert since is not None
    return max(abs(now - then) for now, then in zip(position, since, strict=True)) > radians(0.5)


def test_emergency_stop_ends_the_measurement_and_what_was_recorded_is_kept(tmp_path: Path) -> None:
    robot = VirtualRobot(tmp_path)
    robot.start()
    try:
        with begin(robot, tmp_path, "both") as process:
            assert process.stdout is not None
            for line in process.stdout:
                if line.startswith("Ramp: all joints of the right arm and the left arm move by 1.9°"):
                    break
            with yumi.attach(robot.address) as driver:
                states = driver.watch(20.0)
                starts = next(states).arms["left"].position
                next(state for state in states if has_moved(state.arms["left"].position, starts))
            robot.inject(Fault.EMERGENCY_STOP)
            rest = process.stdout.read()
        assert process.returncode == 1
        error = rest[rest.index("Error:") :]
        assert "Emergency stop" in error
        assert "robot.recover" not in error
        assert f"What was recorded until then is in {tmp_path / 'measured.zip'}." in error
        motions = read_logs(tmp_path / "measured" / "recordings").motions
        assert {log.name for log in motions} >= {"ramp, right arm", "ramp, left arm"}
    finally:
        robot.stop()
