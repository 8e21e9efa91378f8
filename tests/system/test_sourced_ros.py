"""The driver with a sourced ROS 2, as on Ubuntu: ROS comes from a tree of the system, all else from an environment.

The tree is made of the files that ``make setup`` has installed, which are those of Jazzy; nothing is downloaded.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from importlib.metadata import distributions
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PREFIX = Path(sys.prefix)
PYTHON = f"lib/python{sys.version_info[0]}.{sys.version_info[1]}"
SITE = PREFIX / PYTHON / "site-packages"
INDEX = PREFIX / "share/ament_index/resource_index/packages"
OURS = "yumi_ros2"

pytestmark = [pytest.mark.soak, pytest.mark.timeout(300)]


def link(source: Path, target: Path) -> None:
    """A file, or a whole folder, at another place too: what is loaded from there finds its neighbours there."""
    target.parent.mkdir(parents=True, exist_ok=True)
    if source.is_dir():
        shutil.copytree(source, target, copy_function=_link_file)
    else:
        _link_file(str(source), str(target))


def _link_file(source: str, target: str) -> str:
    try:
        os.link(source, target)
    except OSError:  # another file system
        shutil.copy2(source, target)
    return target


def of_ros() -> set[str]:
    """What in the environment belongs to ROS, by its name in ``site-packages``."""
    names = {each.name for each in INDEX.iterdir()} - {OURS}
    for distribution in distributions(path=[str(SITE)]):
        if distribution.name.startswith(("ros-", "ros_")):
            names |= {file.parts[0] for file in distribution.files or () if ".." not in file.parts}
    return names


class Machine:
    """A ROS 2 that is installed for all users and sourced, and an environment that sees it.

    Attributes:
        python: of the environment.
        ros: the tree, such as ``/opt/ros/jazzy``.
        variables: of a shell in which the tree is sourced.
    """

    def __init__(self, folder: Path) -> None:
        self.ros, venv = folder / "opt/ros/jazzy", folder / "venv"
        names = of_ros()
        subprocess.run([sys.executable, "-m", "venv", "--system-site-packages", "--without-pip", str(venv)], check=True)
        for entry in SITE.iterdir():
            is_of_ros = entry.name in names or (entry.name.startswith("ros_") and entry.name.endswith(".libs"))
            is_our_clone = entry.name.startswith((OURS, "_editable", "__editable")) or entry.suffix == ".pth"
            if entry.name != "__pycache__" and not is_our_clone:
                link(entry, (self.ros if is_of_ros else venv) / PYTHON / "site-packages" / entry.name)
        for entry in (PREFIX / "lib").iterdir():
            if not entry.name.startswith("python"):
                link(entry, self.ros / "lib" / entry.name)
        link(PREFIX / "share", self.ros / "share")
        shutil.rmtree(self.ros / "share" / OURS, ignore_errors=True)
        (self.ros / "share/ament_index/resource_index/packages" / OURS).unlink(missing_ok=True)
        packages = self.ros / PYTHON / "site-packages"
        self.python = venv / "bin/python"
        kept = {name: value for name, value in os.environ.items() if not name.startswith(("ROS_", "AMENT_", "PYTHON"))}
        kept.pop("VIRTUAL_ENV", None)
        self.variables = {
            **kept,
            "PATH": f"{self.ros / 'bin'}:{kept['PATH']}",
            "AMENT_PREFIX_PATH": str(self.ros),
            "LD_LIBRARY_PATH": ":".join(map(str, (self.ros / "lib", *packages.glob("*.libs")))),
            "PYTHONPATH": os.pathsep.join(map(str, (packages, *ROOT.glob("packages/*/src")))),
            "ROS_DISTRO": "jazzy",
            "ROS_VERSION": "2",
            "ROS_LOG_DIR": str(folder / "log"),
        }

    def run(self, *arguments: str) -> str:
        done = subprocess.run(
            [str(self.python), *arguments],
            cwd=ROOT,
            env=self.variables,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=200.0,
            check=False,
        )
        assert done.returncode == 0, done.stdout
        return done.stdout


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Machine:
    return Machine(tmp_path_factory.mktemp("machine"))


def test_ros_is_that_of_the_system_and_all_else_that_of_the_environment(machine: Machine) -> None:
    names = ("rclpy", "std_msgs", "yumi_interfaces", "numpy", "yumi")
    printed = machine.run("-c", f"import {', '.join(names)}\nfor each in {', '.join(names)}: print(each.__file__)")
    where = dict(zip(names, map(Path, printed.splitlines()), strict=True))
    assert [name for name, file in where.items() if machine.ros in file.parents] == list(names[:3])
    assert machine.python.parents[1] in where["numpy"].parents


def test_driver_works_with_all_that_belongs_to_it(machine: Machine) -> None:
    """The part of ``tests/ros`` that ``make test`` runs."""
    arguments = ("-p", "no:cacheprovider", "-q", "-m", "smoke", "tests/ros/test_ros_driver.py")
    printed = machine.run("-m", "pytest", *arguments)
    assert " passed" in printed
    assert "skipped" not in printed
