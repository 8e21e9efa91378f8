"""`yumi measure` with a robot in memory: what is asked, what is refused, what ends it, and what is kept."""

from __future__ import annotations

import json
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from math import degrees, radians
from pathlib import Path
from types import SimpleNamespace, TracebackType
from typing import Any, cast
from zipfile import ZipFile

import numpy as np
import pytest
from click.testing import CliRunner, Result

from abb_protocols.catalogue import Message, message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused, GoalNotReached, RobotNotReady, YumiError
from abb_protocols.robot.joints import YUMI_LIMITS, Joints, Side, joint_names, joints, named_pose
from refusals import assert_says, refused
from yumi.cli.main import main
from yumi.control.motion.spline import TrajectoryPoint
from yumi.driver.controller_names import TRAJECTORY_CONTROLLER
from yumi.driver.settings import CalibrateWhen, Settings
from yumi.planning.trajectory_request import JointTrajectory, plan_trajectory
from yumi_evaluation import cli, measurement
from yumi_evaluation.cli import measure
from yumi_evaluation.measurement import LARGEST, MOTIONS, Examined, clear_directions, settings_for_measuring

BOTH = tuple(Side)
FORTH = joints([1.0] * 7)


def ready() -> dict[Side, Joints]:
    return {side: named_pose(side, "ready") for side in Side}


class FakeRobot:
    """A robot at a place that does what it is asked, and notes that.

    Attributes:
        places: of its arms [rad].
        done: what was asked of it, in order.
        ends: called before each motion; may raise.
        opens: called when it is connected; may raise.
    """

    places = ready()
    done: list[str]
    ends: Callable[[int], None]
    opens: Callable[[], None]

    def __init__(self, *arguments: Any) -> None:
        self.right, self.left = (
            SimpleNamespace(executor=SimpleNamespace(snapshot=lambda side: SimpleNamespace(sent=self.places[side])))
            for _ in range(2)
        )
        self.controller = SimpleNamespace(joint_target=lambda unit: self.places[Side.LEFT])

    def __enter__(self) -> FakeRobot:
        type(self).opens()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.done.append("close")

    @contextmanager
    def record(self, file: Path) -> Iterator[None]:
        file.write_text("cycles")
        yield

    def follow(self, **ways: Any) -> None:
        type(self).ends(self.done.count("follow"))
        self.done.append("follow")


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch) -> type[FakeRobot]:
    """The robot that is connected to, on this machine."""

    class Robot(FakeRobot):
        places = ready()
        done: list[str] = []  # noqa: RUF012 - of this one test
        ends = staticmethod(lambda number: None)
        opens = staticmethod(lambda: None)

    examined = Examined(True, [{"requirement": "reachable"}], {"controller": "virtual"}, {"10.0.0.7": "ROBOT"})
    monkeypatch.setattr(measurement, "Robot", Robot)
    monkeypatch.setattr(measurement, "examine", lambda settings: examined)
    return Robot


@pytest.fixture
def at_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cli, "_is_at_a_terminal", lambda: True)


def run(folder: Path, *arguments: str, answers: str = "") -> Result:
    return CliRunner().invoke(measure, ["right", *arguments, "--output", str(folder / "new")], input=answers)


def archive(folder: Path) -> dict[str, bytes]:
    with ZipFile(folder / "new.zip") as packed:
        return {name: packed.read(name) for name in packed.namelist()}


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: motion.name)
def test_motion_keeps_two_degrees_and_ten_degrees_a_second(motion: measurement.MeasuredMotion) -> None:
    start = named_pose(Side.RIGHT, "ready")
    rows = motion.trajectory(start, FORTH)
    points = tuple(TrajectoryPoint(time, *map(tuple, values)) for time, *values in rows)
    limits = YUMI_LIMITS.slower(top_speed=radians(10.0))  # what is faster is refused
    plan = plan_trajectory(JointTrajectory(joint_names(Side.RIGHT), points), (Side.RIGHT,), limits)[Side.RIGHT]
    moved = np.array([row[1] for row in rows]) - np.array(start)
    assert 0.7 * LARGEST < np.abs(moved).max() <= LARGEST
    assert moved[0] == pytest.approx([0.0] * 7)
    assert moved[-1] == pytest.approx([0.0] * 7, abs=1e-9)
    assert plan.spline.end == pytest.approx(motion.duration)
    assert motion.duration < 16.0  # of which an identification takes all cycles


def test_settings_for_measuring_are_slow_and_leave_the_grippers_alone() -> None:
    settings = settings_for_measuring(Settings())
    assert settings.egm_motion.max_speed_deviation == 10.0
    assert settings.egm_motion.pos_corr_gain == Settings().egm_motion.pos_corr_gain
    assert settings.gripper.calibrate is CalibrateWhen.NEVER
    assert settings.robot.speed_scale == 1.0


def test_slower_settings_stay() -> None:
    slow = replace(Settings(), egm_motion=replace(Settings().egm_motion, max_speed_deviation=5.0))
    assert settings_for_measuring(slow).egm_motion.max_speed_deviation == 5.0


def test_positions_alone_are_sent() -> None:
    for own in measurement.controllers_for_measuring(Settings()).values():
        (values,) = (each.values for each in own if each.name == TRAJECTORY_CONTROLLER)
        assert (values["feedforward"], values["lookahead"]) == (0.0, 0.0)


def test_robot_that_follows_speeds_alone_is_refused() -> None:
    settings = replace(Settings(), egm_motion=replace(Settings().egm_motion, pos_corr_gain=0.0))
    with refused(CommandRefused, "follows_speeds_alone"):
        settings_for_measuring(settings)


def ended(result: Any) -> Message:
    """Why a measurement has ended, of the error that says so and where its archive is."""
    assert isinstance(result.exception, YumiError)
    said = result.exception.said
    assert said.code == "measurement_ended"
    assert Path(said.values["file"]).exists()
    return cast("Message", said.values["error"])


def test_joint_near_the_end_of_its_range_is_refused_with_its_range(robot: type[FakeRobot], tmp_path: Path) -> None:
    near = list(ready()[Side.RIGHT])
    near[1] = YUMI_LIMITS.upper[1] - radians(1.0)
    robot.places = {**ready(), Side.RIGHT: joints(near)}
    result = run(tmp_path, "--yes")
    why = ended(result)
    assert_says(why, "joint_without_room", axis=2, arm="right", position=near[1], room=radians(2.0))
    assert (why.values["lower"], why.values["upper"]) == (YUMI_LIMITS.lower[1], YUMI_LIMITS.upper[1])
    assert robot.done == ["close"]


def test_directions_lead_away_from_the_body_at_home() -> None:
    home = {side: named_pose(side, "home") for side in Side}
    found = clear_directions(Settings(), home, BOTH)
    assert {*found[Side.RIGHT], *found[Side.LEFT]} == {1.0, -1.0}
    assert clear_directions(Settings(), ready(), BOTH)[Side.RIGHT] == (1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0)
    toward = clear_directions(Settings(), home, (Side.LEFT,))[Side.LEFT]
    assert toward != (1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0)


def test_arms_that_are_near_each_other_are_refused(robot: type[FakeRobot], tmp_path: Path) -> None:
    inward = {
        side: (-sign * 1.2, 0.0, sign * 1.2, 0.2, 0.0, 0.5, 0.0) for side, sign in zip(BOTH, (-1, 1), strict=True)
    }
    robot.places = {side: joints(values) for side, values in inward.items()}
    result = run(tmp_path, "--yes")
    assert isinstance(result.exception, CommandRefused)
    assert ended(result).code == "part_too_near"
    assert robot.done == ["close"]


@pytest.mark.usefixtures("at_a_terminal")
def test_start_and_each_motion_are_announced_and_confirmed(robot: type[FakeRobot], tmp_path: Path) -> None:
    result = run(tmp_path, answers="y\ny\ny\nn\n")
    assert robot.done == ["follow", "follow", "close"]
    begins = [line.partition(":")[0] for line in result.stdout.splitlines()]
    assert [word for word in begins if word in ("Start", "Ramp", "Step", "Sine")] == ["Start", "Ramp", "Step", "Sine"]
    assert "all joints of the right arm move by 1.9° at 1 °/s and back" in result.stdout
    assert ended(result) == message("motion_not_confirmed")
    assert {"new/recordings/ramp.mcap", "new/recordings/step.mcap", "new/doctor.json"} <= {*archive(tmp_path)}


@pytest.mark.usefixtures("at_a_terminal")
def test_nothing_is_connected_when_the_start_is_not_confirmed(robot: type[FakeRobot], tmp_path: Path) -> None:
    assert isinstance(run(tmp_path, answers="n\n").exception, CommandRefused)
    assert robot.done == []


def test_stop_ends_all_and_is_in_the_archive_without_addresses(robot: type[FakeRobot], tmp_path: Path) -> None:
    def stop(number: int) -> None:
        if number == 1:
            raise GoalNotReached("Stopped: no datagram from 10.0.0.7.")

    robot.ends = staticmethod(stop)
    result = run(tmp_path, "--yes")
    assert isinstance(result.exception, YumiError)
    assert ended(result) == message("text", text="Stopped: no datagram from 10.0.0.7.")
    assert robot.done == ["follow", "close"]
    kept = archive(tmp_path)
    measured = json.loads(kept["new/measurement.json"])
    assert measured["motions"] == ["ramp"]
    assert measured["ended"] == "Stopped: no datagram from ROBOT."
    assert "new/recordings/step.mcap" in kept


def test_stop_is_worded_for_the_shell(robot: type[FakeRobot], tmp_path: Path) -> None:
    stopped = message("arm_waits_for_recovery", arm="right", fault=message("motors_off"))

    def stop(number: int) -> None:
        raise GoalNotReached(stopped)

    robot.ends = staticmethod(stop)
    result = CliRunner().invoke(main, ["measure", "right", "--yes", "--output", str(tmp_path / "new")])
    kept = message("measurement_ended", error=stopped, file=str(tmp_path / "new.zip"))
    assert result.stderr == f"Error: {sentence(kept, FrontEnd.SHELL)}\n"
    assert sentence(kept, FrontEnd.SHELL) != sentence(kept, FrontEnd.SCRIPT)


def test_ctrl_c_ends_all_with_an_exit_code(robot: type[FakeRobot], tmp_path: Path) -> None:
    before = signal.getsignal(signal.SIGTERM)

    def interrupt(number: int) -> None:
        raise KeyboardInterrupt

    robot.ends = staticmethod(interrupt)
    result = run(tmp_path, "--yes")
    assert result.exit_code == 130
    said = message("measurement_ended", error=message("ended_by_signal"), file=str(tmp_path / "new.zip"))
    assert str(said) in result.stderr
    assert robot.done == ["close"]
    assert json.loads(archive(tmp_path)["new/measurement.json"])["motions"] == []
    assert signal.getsignal(signal.SIGTERM) == before


def test_recordings_that_cannot_be_compared_are_kept(robot: type[FakeRobot], tmp_path: Path) -> None:
    result = run(tmp_path, "--yes")  # a file of this robot is no recording
    assert robot.done == ["follow", "follow", "follow", "close"]
    said = ended(result)
    assert said.code == "recording_damaged"
    assert Path(said.values["file"]).name == "ramp.mcap"
    assert json.loads(archive(tmp_path)["new/measurement.json"])["motions"] == ["ramp", "step", "sine"]


def test_robot_that_is_not_ready_is_not_moved(robot: type[FakeRobot], tmp_path: Path) -> None:
    def refuse() -> None:
        raise RobotNotReady(message("not_in_auto", mode="MANR"))

    robot.opens = staticmethod(refuse)
    result = run(tmp_path, "--yes")
    assert ended(result) == message("not_in_auto", mode="MANR")
    assert robot.done == []


@pytest.mark.parametrize(
    ("is_virtual", "arguments", "said"),
    [
        (False, ("--yes",), message("yes_for_virtual_robots", address="192.168.125.1")),
        (False, (), message("no_terminal")),
        (True, (), message("no_terminal_for_virtual")),
    ],
)
def test_real_robot_is_moved_only_by_a_person_at_a_terminal(
    robot: type[FakeRobot],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    is_virtual: bool,
    arguments: tuple[str, ...],
    said: Message,
) -> None:
    monkeypatch.setattr(measurement, "examine", lambda settings: Examined(is_virtual, [], {}, {}))
    result = run(tmp_path, *arguments)
    assert isinstance(result.exception, YumiError)
    assert result.exception.said == said
    assert robot.done == []
    assert not (tmp_path / "new").exists()


def test_folder_with_files_is_not_written_to(robot: type[FakeRobot], tmp_path: Path) -> None:
    (tmp_path / "new").mkdir()
    (tmp_path / "new" / "file").touch()
    refusal = run(tmp_path, "--yes").exception
    assert isinstance(refusal, YumiError)
    assert refusal.said == message("measurement_exists", folder=str(tmp_path / "new"))
    assert robot.done == []


def test_sentences_name_the_right_degrees() -> None:
    for motion in MOTIONS:
        size = degrees(max(abs(place) for _, place, *_ in motion.points))
        assert motion.words.startswith(f"by {size:.1f}° ")
