"""The commands as a person runs them: the demonstration, its interruption, and what a driver refuses to start with."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from pathlib import Path

import pytest
from click.testing import CliRunner
from refused_starts import YUMI, expect_one_sentence, up
from ros_bench import Robot

from yumi.cli.main import main

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]
MARK = "YUMI_TEST_MARK"


@pytest.fixture(autouse=True)
def _domain_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no other test has its driver."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(1 + (int(os.environ["ROS_DOMAIN_ID"]) + 49) % 100))


@pytest.fixture
def mark(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> str:
    """An environment variable that every process of one test inherits."""
    monkeypatch.setenv(MARK, str(tmp_path))
    return str(tmp_path)


def processes_with(mark: str) -> list[str]:
    """Command lines of the living processes that inherited ``mark``, but for this one."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            is_ours = f"{MARK}={mark}".encode() in (folder / "environ").read_bytes().split(b"\0")
            command = (folder / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except (FileNotFoundError, ProcessLookupError, PermissionError):
            continue  # it has ended, or is somebody else's
        if is_ours and command and int(folder.name) != os.getpid():
            found.append(command)
    return found


@pytest.mark.timeout(240)
def test_demo_completes_the_task_and_leaves_no_process(mark: str, tmp_path: Path) -> None:
    picture, report = tmp_path / "paths.png", tmp_path / "report.json"
    options = ["--picture", str(picture), "--json", str(report), "--logs", str(tmp_path / "logs")]
    done = subprocess.run(
        [*YUMI, "demo", *options], capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.rstrip().endswith("Task completed")
    figures = json.loads(report.read_text())
    assert {side: arm["grip"] for side, arm in figures.items()} == {"right": "closed", "left": "holding"}
    assert all(arm["final_error_deg"] < 0.1 for arm in figures.values())
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert processes_with(mark) == []


@pytest.mark.timeout(240)
@pytest.mark.parametrize(
    "moment",
    [
        pytest.param("start the driver", marks=pytest.mark.soak),
        pytest.param("start EGM on both arms", marks=pytest.mark.soak),
        "move the right arm",
    ],
)
def test_demo_interrupted_at_any_moment_stops_motion_and_leaves_no_process(
    mark: str, tmp_path: Path, moment: str
) -> None:
    demo = subprocess.Popen(
        [*YUMI, "demo", "--logs", str(tmp_path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        stdin=subprocess.DEVNULL,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    assert demo.stdout is not None
    with demo.stdout as output:
        for line in output:
            if moment in line:
                break
        demo.send_signal(signal.SIGINT)
        rest = output.read()
    assert demo.wait() == 130, rest
    assert "cancelled: motion stopped, EGM ended" in rest
    assert processes_with(mark) == []
    if moment == "move the right arm":
        assert "Bring-up: stop EGM" in (tmp_path / "driver.log").read_text()


def test_driver_says_that_the_password_is_wrong_without_showing_it(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("YUMI_PASSWORD", "not-it-4711")
    outcome = up("--robot", f"127.0.0.1:{robot.rws_port}")
    expect_one_sentence(outcome, "password")
    assert "not-it-4711" not in outcome[1]


def test_driver_refuses_settings_with_a_sentence(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("robot: {adress: x}")
    result = CliRunner().invoke(main, ["up", "--config", str(file)])
    assert (result.exit_code, result.stderr.split(";")[0]) == (2, "Error: mine.yaml: robot has no setting 'adress'")


@pytest.mark.parametrize(
    "command", [[], ["demo"], ["up"], ["doctor"], ["controller"], ["record"], ["record", "show"], ["record", "list"]]
)
def test_every_command_has_help_with_an_example(command: list[str]) -> None:
    result = CliRunner().invoke(main, [*command, "--help"])
    assert result.exit_code == 0
    assert "Example" in result.stdout


def test_driver_says_that_its_folder_for_logs_cannot_be_written(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Below a file no folder can be made, whoever asks for it."""
    (tmp_path / "file").touch()
    folder = tmp_path / "file" / "logs"
    monkeypatch.setenv("ROS_LOG_DIR", str(folder))
    code, error = up("--robot", f"127.0.0.1:{robot.rws_port}", *robot.egm_options)
    assert code == 2, error
    assert error.startswith("Error: ROS 2 does not start: ")
    assert str(folder) in error
    assert error.endswith(
        "; set ROS_LOG_DIR to a folder that can be written, or unset it, and check ROS_DOMAIN_ID, RMW_IMPLEMENTATION "
        "and the --ros-args."
    )
    assert len(error.splitlines()) == 1
