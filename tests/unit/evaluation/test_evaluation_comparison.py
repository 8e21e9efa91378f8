"""`yumi compare`: the figures, the settings file and the sentences of logs of virtual robots."""

from __future__ import annotations

import json
from dataclasses import replace
from math import degrees, radians
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from virtual_logs import HOME, VirtualRobot, motions, times

from abb_protocols.catalogue import clause, message
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.robot.joints import CHAIN_AXES, CYCLE, YUMI_LIMITS, Side, joints
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_parameters import read_egm_parameters
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.flight_recorder import RecordedCycle
from yumi.control.goals import MemoryBuffer, SessionGoal, write_goal
from yumi.control.stage_times import StageTimes
from yumi.recording.writer import RecordingWriter
from yumi_evaluation.cli import compare
from yumi_evaluation.comparison import compare as compared
from yumi_evaluation.comparison import document
from yumi_evaluation.identification import Dynamics, answer
from yumi_evaluation.logs import Logs, RobotLog
from yumi_evaluation.virtual_time import VirtualArmRig

ANOTHER = VirtualRobot(
    Dynamics(10.0, replace(ArmModel(), reference_delay=0.002, delay=0.018, lag=0.009)), radians(1e-4), 0.01
)


def log_of(robot: VirtualRobot, seed: int = 3) -> RobotLog:
    random = np.random.default_rng(seed)
    return robot.log(motions(random), random, "one")


def tables(where: Path, log: RobotLog) -> list[str]:
    """The log as CSV files, as arguments."""
    header = ",".join(["time_s", *(f"{name}_rad" for name in log.joints)])
    is_sent = np.isfinite(log.commands).all(axis=1)
    commands = np.column_stack((np.arange(len(log.commands)) * CYCLE, log.commands))[is_sent]
    for name, rows in (("joints", np.column_stack((log.times, log.measured))), ("commands", commands)):
        np.savetxt(where / f"{name}.csv", rows, delimiter=",", header=header, comments="", fmt="%.9f")
    return [str(where / "joints.csv"), "--commands", str(where / "commands.csv"), "--output", str(where / "out")]


def run(*arguments: str) -> Result:
    return CliRunner().invoke(compare, list(arguments), catch_exceptions=False)


@pytest.fixture
def without_picture(monkeypatch: pytest.MonkeyPatch) -> None:
    """The picture takes as long as the comparison, and another test has it drawn."""
    monkeypatch.setattr("yumi_evaluation.pictures.draw_comparison", lambda _, file: file.parent.mkdir())


@pytest.mark.timeout(120)
def test_command_prints_each_record_and_writes_settings_of_a_robot_that_moves_so(tmp_path: Path) -> None:
    log = log_of(ANOTHER)
    result = run(*tables(tmp_path, log), "--json", "-")
    assert result.exit_code == 0
    found = json.loads(result.stdout)
    (record,), (robot,) = found["records"], found["robots"]
    difference = np.degrees(answer(log, Dynamics()) - log.measured)
    assert record["record"] == "joints"
    assert record["rms_deg"] == pytest.approx(np.sqrt(np.square(difference).mean()), rel=0.01)
    assert record["joints_deg"] == pytest.approx(
        np.sqrt(np.square(difference).mean(axis=0)).tolist(), rel=0.02, abs=1e-4
    )
    assert robot["k"]["value"] == pytest.approx(10.0, rel=0.02)
    assert "start it with the settings file" in robot["verdict"]
    assert (tmp_path / "out" / "comparison.svg").read_text().count("<svg") == 1
    parameters = read_egm_parameters(tmp_path / "out" / "yumi.yaml")
    assert parameters.position_gain == pytest.approx(10.0, rel=0.02)
    model = parameters.applied(ArmModel(), CHAIN_AXES)
    quiet = replace(ANOTHER, noise=0.0, lost=0.0)
    true = log_of(quiet)
    again = answer(true, Dynamics(parameters.position_gain or 0.0, model))
    assert degrees(np.sqrt(np.square(again - true.measured).mean())) < 0.002


@pytest.mark.usefixtures("without_picture")
def test_command_says_of_a_robot_that_moves_so_that_it_does(tmp_path: Path) -> None:
    robot = VirtualRobot(Dynamics(), radians(1e-4), 0.0)
    result = run(*tables(tmp_path, log_of(robot)))
    assert result.exit_code == 0
    assert "The virtual robot moves as the YuMi does" in result.output
    never_asked = clause(message("never_asked_for_more"), FrontEnd.SHELL)
    assert f"not determined ({never_asked[:18]}" in result.output  # a column of the table ends there


def test_log_without_motion_has_no_parameters_and_no_settings_file(tmp_path: Path) -> None:
    log = VirtualRobot(Dynamics(), radians(1e-4), 0.0).log(np.tile(HOME, (400, 1)), np.random.default_rng(1))
    result = run(*tables(tmp_path, log), "--json", "-")
    (robot,) = json.loads(result.stdout)["robots"]
    assert robot["k"] == {"value": None, "why": f"not determined: {clause(message('no_joint_moves'))}"}
    assert robot["verdict"] == "No joint of the YuMi moves in the log: nothing can be said of how it follows."
    assert not (tmp_path / "out" / "yumi.yaml").exists()


def test_rows_in_which_a_joint_is_limited_are_compared_apart() -> None:
    model = ArmModel()
    slow = replace(model, limits=replace(model.limits, velocity=(radians(25.0), *model.limits.velocity[1:])))
    time = times(2.8)
    moved = np.zeros((len(time), 7))
    moved[:, 0] = radians(8.0) * np.clip(time - 0.2, 0.0, 1.0) + radians(40.0) * np.clip(time - 1.7, 0.0, 0.7)
    robot = VirtualRobot(Dynamics(5.0, slow), radians(1e-4), 0.0)
    log = robot.log(HOME + moved, np.random.default_rng(2))
    (record,) = document(compared(Logs((log,)), 5.0))["records"]
    assert record["limited"]["joints"] == ["joint_1"]
    assert 1.7 < record["limited"]["first_row"] * CYCLE < 2.0
    assert record["limited"]["rms_deg"] > 0.5
    assert record["rms_deg"] < 0.01


@pytest.mark.usefixtures("without_picture")
def test_pos_corr_gain_of_the_log_is_not_in_the_gain_of_the_settings(tmp_path: Path) -> None:
    robot = VirtualRobot(Dynamics(2.5), radians(1e-4), 0.0)
    run(*tables(tmp_path, log_of(robot)), "--pos-corr-gain", "0.5")
    assert read_egm_parameters(tmp_path / "out" / "yumi.yaml").position_gain == pytest.approx(5.0, rel=0.02)


def recording_of_the_rig(file: Path) -> None:
    """What the driver's control loop sent to a virtual arm and received of it, as a recording."""
    goals = MemoryBuffer[SessionGoal]()
    controller = JointPositionController(goals, YUMI_LIMITS)
    rig = VirtualArmRig({"joint_position_controller": controller}, side=Side.LEFT)
    rig.start()
    rig.run(0.2)
    rig.switch_to("joint_position_controller")
    begin = rig.robot.arm.planned
    for distance in (0.0, 5.0, 2.0, 6.0):
        goal = joints([value + radians(distance) * (index in (0, 3)) for index, value in enumerate(begin)])
        write_goal(goals, rig.snapshot.session, goal, time=rig.clock.now())
        rig.run(0.8)
    none = joints([0.0] * 7)
    with RecordingWriter(file, 1.7e9) as writer:
        for number, each in enumerate(rig.cycles):
            state, sent = each.state, each.sent
            writer.add_frame(
                Side.LEFT,
                RecordedCycle(
                    number=number + 1, time=state.time, dt=state.dt, session=state.session,
                    is_running=state.is_running, position=state.position, velocity=none, planned=state.planned,
                    desired=None, sent=sent.position, sent_velocity=sent.velocity, reference=None,
                    stages=StageTimes(*(0.0,) * 7),
                ),
            )  # fmt: skip


@pytest.mark.usefixtures("without_picture")
def test_recording_of_a_virtual_robot_is_met_by_the_virtual_robot(tmp_path: Path) -> None:
    recording_of_the_rig(tmp_path / "session.mcap")
    result = run(str(tmp_path / "session.mcap"), "--output", str(tmp_path / "out"), "--json", "-")
    (record,) = json.loads(result.stdout)["records"]
    assert record["record"] == "left arm"
    assert record["rms_deg"] < 0.002
    assert record["rows"] > 600
