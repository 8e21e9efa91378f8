"""What the machine must have before anything is installed: the first thing missing, as one sentence.

Written in the syntax of Python 3.6, so that an old Python says the sentence instead of failing on the file.
"""

import os
import platform
import shutil
import subprocess
import sys
import sysconfig
from typing import NamedTuple

OLDEST_PYTHON = (3, 10)
NEWEST_PYTHON = (3, 14)
OLDEST_GLIBC = (2, 28)  # the wheels are manylinux_2_28
OUR_INTERFACES = "yumi_interfaces"
WITHOUT_ROS = (
    "source a ROS 2 of your own first, or do without: all but yumi.ros (EGM, RWS, RAPID, the virtual controller) runs "
    "after pip install yumi-ros2[virtual]"
)


class Machine(NamedTuple):
    """What was found on this machine."""

    python: "tuple[int, int]"
    executable: str
    has_headers: bool
    system: str
    processor: str
    glibc: "tuple[int, ...]"
    compiler: "str | None"
    sourced: "str | None"
    """The distribution of a sourced ROS 2, None where none is sourced."""
    unimportable: "tuple[str, ...]"
    """The packages of a sourced ROS 2 that are needed and cannot be imported."""


def inspect_machine(needed_packages: "tuple[str, ...]") -> Machine:
    """Look at the machine, its Python and its environment; `needed_packages` are asked of a sourced ROS 2."""
    sourced = sourced_distribution(os.environ)
    return Machine(
        python=sys.version_info[:2],
        executable=sys.executable,
        has_headers=os.path.exists(os.path.join(sysconfig.get_path("include"), "Python.h")),
        system=platform.system(),
        processor=platform.machine(),
        glibc=_glibc(),
        compiler=compiler_on_path(os.environ),
        sourced=sourced,
        unimportable=_unimportable(("rclpy", *needed_packages)) if sourced else (),
    )


def sourced_distribution(environment: "os._Environ[str] | dict[str, str]") -> "str | None":
    """The distribution whose setup.bash was sourced in this shell, None where none was.

    The activated virtual environment of a clone is in the path, too, and no ROS 2 of its own.
    """
    prefixes = environment.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    if not [prefix for prefix in prefixes if prefix and prefix != environment.get("VIRTUAL_ENV")]:
        return None
    return environment.get("ROS_DISTRO") or "(of unknown distribution)"


def compiler_on_path(environment: "os._Environ[str] | dict[str, str]") -> "str | None":
    """The C++ compiler that set-up takes, None where there is none."""
    chosen = environment.get("CXX", "").split()
    candidates = chosen[:1] or ["c++", "g++", "clang++"]
    return next(filter(None, (shutil.which(name) for name in candidates)), None)


def first_problem(machine: Machine) -> "str | None":
    """One sentence: what is missing and what to do; None where set-up can go on."""
    ros_problem = _sourced_problem if machine.sourced else _wheels_problem
    return _python_problem(machine) or ros_problem(machine) or _compiler_problem(machine)


def _python_problem(machine: Machine) -> "str | None":
    version = _dotted(machine.python)
    if not OLDEST_PYTHON <= machine.python <= NEWEST_PYTHON:
        return (
            f"{machine.executable} is Python {version}, but Python {_dotted(OLDEST_PYTHON)} to "
            f"{_dotted(NEWEST_PYTHON)} is needed; name another: make setup PYTHON=python3.12"
        )
    return None


def _sourced_problem(machine: Machine) -> "str | None":
    if "rclpy" in machine.unimportable:
        return (
            f"ROS 2 {machine.sourced} is sourced, but {machine.executable} cannot import its rclpy; name the Python "
            "that ROS uses (make setup PYTHON=/usr/bin/python3), or use a shell where ROS is not sourced"
        )
    if machine.unimportable == (OUR_INTERFACES,):
        return (
            f"the sourced ROS 2 {machine.sourced} knows no {OUR_INTERFACES}, which come with this clone; build them "
            f"and source what was built: colcon build --base-paths interfaces/{OUR_INTERFACES} && . install/setup.sh"
        )
    if machine.unimportable:
        lacking = [name for name in machine.unimportable if name != OUR_INTERFACES]
        packages = (f"ros-{machine.sourced}-{name}".replace("_", "-") for name in lacking)
        return f"the sourced ROS 2 lacks {', '.join(lacking)}; {_install(' '.join(packages))}"
    return None


def _wheels_problem(machine: Machine) -> "str | None":
    if machine.system != "Linux" or machine.processor not in ("x86_64", "AMD64"):
        return f"PyPI has ROS 2 for Linux on x86-64, and this is {machine.system} on {machine.processor}; {WITHOUT_ROS}"
    if machine.glibc < OLDEST_GLIBC:
        return (
            f"PyPI has ROS 2 for glibc {_dotted(OLDEST_GLIBC)} or newer, and this machine has "
            f"{_dotted(machine.glibc) or 'another C library'}; {WITHOUT_ROS}"
        )
    if not machine.has_headers:
        package = f"python{_dotted(machine.python)}-dev"
        return f"{machine.executable} has no Python.h, and message packages must be built; {_install(package)}"
    return None


def _compiler_problem(machine: Machine) -> "str | None":
    if machine.compiler is None:
        return f"no C++ compiler was found, and the driver is partly compiled; {_install('g++')}, or name one in CXX"
    return None


def _install(packages: str) -> str:
    return f"install it (Debian, Ubuntu: apt install {packages})"


def _glibc() -> "tuple[int, ...]":
    if "CS_GNU_LIBC_VERSION" not in os.confstr_names:
        return ()
    version = (os.confstr("CS_GNU_LIBC_VERSION") or "").split(" ")[-1]
    return tuple(int(part) for part in version.split(".") if part.isdigit())


def _unimportable(packages: "tuple[str, ...]") -> "tuple[str, ...]":
    return tuple(name for name in packages if subprocess.call(_import(name), stderr=subprocess.DEVNULL) != 0)


def _import(package: str) -> "list[str]":
    return [sys.executable, "-c", "import " + package]


def _dotted(version: "tuple[int, ...]") -> str:
    return ".".join(str(part) for part in version)
