"""The wheels in empty environments without a compiler: they install, and what they bring runs.

The commands are those of ``Containerfile``, which need no container engine; pip needs the package index.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import time
from pathlib import Path
from shutil import copy, which

import pytest

from soak import tell

ROOT = Path(__file__).parents[2]
TOOLS = ("sh", "bash", "uname", "ldconfig", "dirname", "cat")
"""What is on the path beside the environment's own commands."""

pytestmark = [pytest.mark.soak, pytest.mark.timeout(900)]


@pytest.fixture(scope="module")
def wheels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder `dist` of `make wheels`, for the Python of the tests."""
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    for package in (ROOT / "packages").iterdir():
        subprocess.run(command, cwd=package, check=True)
    driver = ROOT / "packages" / "yumi-ros2"
    subprocess.run(command, cwd=driver, check=True, env={**os.environ, "YUMI_WHEEL_INTERFACES": "1"})
    listed = subprocess.run(
        ["make", "--dry-run", "wheels"], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout
    for command in re.findall(r" (export .*)", listed):
        exported = command.replace(" dist/", f" {folder}/").split()
        subprocess.run([f"{sys.prefix}/bin/uv", *exported], cwd=ROOT, check=True)
    return folder


class Image:
    """What an image of the Containerfile has, in a folder.

    Attributes:
        installed_in: how long pip took [s].
        size: of the environment, without Python [MB].
    """

    def __init__(self, name: str, wheels: Path, folder: Path) -> None:
        self._folder = folder
        self._venv = folder / "venv"
        (folder / "tools").mkdir()
        for tool in TOOLS:
            (folder / "tools" / tool).symlink_to(which(tool) or "/nonexistent")
        subprocess.run(
            [f"{sys.prefix}/bin/uv", "venv", "--no-project", "--seed", "--python", sys.executable, str(self._venv)],
            check=True,
        )
        empty = self._size()
        stage = (ROOT / "Containerfile").read_text().replace("\\\n", " ").partition(f" AS {name}\n")[2]
        installation = re.sub(r"--mount=\S+ ", "", re.search(r"^RUN (.*)$", stage, re.MULTILINE)[1])  # type: ignore[index]
        begin = time.monotonic()
        self.run(["sh", "-ec", installation.replace("/dist/", f"{wheels}/")], timeout=600.0)
        self.installed_in = time.monotonic() - begin
        self.size = self._size() - empty

    def run(self, command: list[str], timeout: float = 120.0, *, check: bool = True) -> str:
        kept = {name: value for name, value in os.environ.items() if name.startswith("PIP_") or "proxy" in name.lower()}
        done = subprocess.run(
            command,
            cwd=self._folder,
            env={**kept, "PATH": f"{self._venv / 'bin'}:{self._folder / 'tools'}", "HOME": str(self._folder)},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=timeout,
            check=False,
        )
        assert done.returncode == 0 or not check, done.stdout
        return done.stdout

    def _size(self) -> float:
        files = (path for path in self._venv.rglob("*") if path.is_file() and not path.is_symlink())
        return sum(path.stat().st_size for path in files) / 1e6


def test_driver_installs_without_a_compiler_and_runs_the_demonstration(wheels: Path, tmp_path: Path) -> None:
    image = Image("driver", wheels, tmp_path)
    assert image.run(["sh", "-c", "command -v c++ g++ cc gcc clang make cmake"], check=False) == ""
    begin = time.monotonic()
    printed = image.run(["yumi", "demo"])
    assert "No picture of the joint paths" in printed
    assert printed.rstrip().endswith("Task completed")
    tell(f"[ros]: {image.installed_in:.0f} s, {image.size:.0f} MB; yumi demo: {time.monotonic() - begin:.0f} s")


ARRIVED = 0.002
"""As near to its goal is an arm that has arrived [rad]."""

IMPORTS = 5.0
"""What says that an extra is missing has computed nothing else [s]."""


def computed() -> float:
    """Processor time of all processes that have ended [s]: it is no longer on a machine that does other things."""
    return os.times().children_user + os.times().children_system


SCRIPT = """
import yumi
from pathlib import Path
from virtual_irc5.testing.controller_process import ControllerProcess
with ControllerProcess(Path("log"), {"calibrated": True}) as controller:
    with yumi.connect(**controller.connect_options) as robot:
        goal = yumi.degrees(20, -110, -135, 30, 0, 40, 0)
        robot.right.move_to(goal)
        print("largest error", max(abs(a - b) for a, b in zip(goal, robot.right.position)))
"""


def test_without_ros_scripts_and_the_virtual_controller_run_and_what_is_missing_is_named(
    wheels: Path, tmp_path: Path
) -> None:
    image = Image("controller", wheels, tmp_path)
    _, _, error = image.run(["python", "-c", SCRIPT]).partition("largest error ")
    assert float(error) < ARRIVED
    for command, extra in (
        (["up"], "ros"),
        (["demo"], "ros"),
        (["evaluate", "--virtual-time"], "evaluation"),
        (["tune"], "evaluation"),
        (["bench"], "evaluation"),
    ):
        begin = computed()
        assert f"yumi-ros2[{extra}]" in image.run(["yumi", *command], check=False)
        assert computed() - begin < IMPORTS
    tell(f"without ROS: {image.installed_in:.0f} s, {image.size:.0f} MB")


LARGEST = 130.0
"""Of the virtual controller without the page [MB]."""


def test_virtual_controller_runs_a_program_of_six_axes_without_the_driver(wheels: Path, tmp_path: Path) -> None:
    empty = tmp_path / "venv"
    subprocess.run([f"{sys.prefix}/bin/uv", "venv", "--no-project", "--python", sys.executable, str(empty)], check=True)
    install = [f"{sys.prefix}/bin/uv", "pip", "install", "--no-config", "--find-links", str(wheels)]
    of_environment = {**os.environ, "VIRTUAL_ENV": str(empty)}
    subprocess.run([*install, "virtual-irc5"], check=True, env=of_environment)
    assert not list(empty.glob("lib/python*/site-packages/yumi*"))
    files = (path for path in empty.rglob("*") if path.is_file() and not path.is_symlink())
    size = sum(path.stat().st_size for path in files) / 1e6
    for name in ("six_axes.mod", "test_any_robot.py"):
        copy(ROOT / "examples" / name, tmp_path)
    command = [
        "run",
        "--model",
        "irb120",
        "--program",
        "T_ROB1=six_axes.mod",
        "--start",
        "--once",
        "--show",
        "--rws-port",
        "0",
    ]
    with subprocess.Popen(
        [str(empty / "bin" / "virtual-irc5"), *command, "--until-stdin-closes"],
        cwd=tmp_path,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as running:
        assert running.stdin is not None
        assert running.stdout is not None
        printed = [running.stdout.readline() for _ in range(2)]
        running.stdin.close()
    assert printed[1] == "[T_ROB1] arrived\n"
    assert running.returncode == 0
    tell(f"virtual-irc5: {size:.0f} MB")
    assert size < LARGEST
    subprocess.run([*install, "pytest"], check=True, env=of_environment)
    subprocess.run([str(empty / "bin" / "pytest"), "test_any_robot.py"], cwd=tmp_path, check=True)
