from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from prerequisites import Machine, compiler_on_path, first_problem, sourced_distribution

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def whole_machine() -> Machine:
    return Machine(
        python=(3, 12),
        executable="/usr/bin/python3",
        has_headers=True,
        system="Linux",
        processor="x86_64",
        glibc=(2, 36),
        compiler="/usr/bin/c++",
        sourced=None,
        unimportable=(),
    )


def test_a_whole_machine_has_no_problem(whole_machine: Machine) -> None:
    assert first_problem(whole_machine) is None


@pytest.mark.parametrize(
    ("lack", "sentence"),
    [
        (
            {"python": (3, 9)},
            r"^/usr/bin/python3 is Python 3\.9, but Python 3\.10 to 3\.14 is needed; .*PYTHON=python3",
        ),
        ({"python": (3, 15)}, r"is Python 3\.15, but Python 3\.10 to 3\.14 is needed"),
        ({"system": "Darwin", "processor": "arm64"}, r"for Linux on x86-64, and this is Darwin on arm64; .*without"),
        ({"processor": "aarch64"}, r"this is Linux on aarch64; .*pip install yumi-ros2\[virtual\]$"),
        ({"glibc": (2, 17)}, r"for glibc 2\.28 or newer, and this machine has 2\.17"),
        ({"glibc": ()}, r"this machine has another C library"),
        ({"compiler": None}, r"^no C\+\+ compiler was found, .*apt install g\+\+"),
        ({"has_headers": False}, r"has no Python\.h, .*apt install python3\.12-dev"),
    ],
)
def test_a_lack_is_said_in_one_sentence(whole_machine: Machine, lack: dict[str, object], sentence: str) -> None:
    problem = first_problem(whole_machine._replace(**lack))
    assert problem is not None
    assert "\n" not in problem
    assert re.search(sentence, problem)


def test_a_sourced_ros_needs_no_wheels_but_a_compiler(whole_machine: Machine) -> None:
    elsewhere = whole_machine._replace(sourced="jazzy", processor="aarch64", has_headers=False)
    assert first_problem(elsewhere) is None
    assert "no C++ compiler was found" in str(first_problem(elsewhere._replace(compiler=None)))


def test_a_sourced_ros_of_another_python_is_refused(whole_machine: Machine) -> None:
    problem = first_problem(whole_machine._replace(sourced="jazzy", unimportable=("rclpy", "control_msgs")))
    assert problem is not None
    assert "ROS 2 jazzy is sourced, but /usr/bin/python3 cannot import its rclpy" in problem


def test_a_sourced_ros_without_a_package_names_the_one_to_install(whole_machine: Machine) -> None:
    problem = first_problem(whole_machine._replace(sourced="jazzy", unimportable=("control_msgs",)))
    assert problem is not None
    assert "lacks control_msgs; install it (Debian, Ubuntu: apt install ros-jazzy-control-msgs)" in problem


@pytest.mark.parametrize(
    ("unimportable", "sentence"),
    [
        (
            ("yumi_interfaces",),
            r"knows no yumi_interfaces, .*: colcon build --base-paths interfaces/yumi_interfaces && ",
        ),
        (("control_msgs", "yumi_interfaces"), r"lacks control_msgs; install it .*ros-jazzy-control-msgs\)$"),
    ],
)
def test_a_sourced_ros_without_our_own_package_is_told_how_to_build_it(
    whole_machine: Machine, unimportable: tuple[str, ...], sentence: str
) -> None:
    problem = first_problem(whole_machine._replace(sourced="jazzy", unimportable=unimportable))
    assert problem is not None
    assert re.search(sentence, problem)


def test_ros_counts_as_sourced_by_its_prefix_path() -> None:
    assert sourced_distribution({"AMENT_PREFIX_PATH": "/opt/ros/jazzy", "ROS_DISTRO": "jazzy"}) == "jazzy"
    assert sourced_distribution({"ROS_DISTRO": "jazzy"}) is None


def test_activated_environment_of_a_clone_is_not_a_sourced_ros() -> None:
    activated = {"AMENT_PREFIX_PATH": "/clone/.venv", "ROS_DISTRO": "jazzy", "VIRTUAL_ENV": "/clone/.venv"}
    assert sourced_distribution(activated) is None
    assert sourced_distribution({**activated, "AMENT_PREFIX_PATH": "/clone/.venv:/opt/ros/jazzy"}) == "jazzy"


def test_a_compiler_named_in_cxx_must_exist() -> None:
    assert compiler_on_path({"CXX": "no-such-compiler -O2"}) is None


@pytest.mark.parametrize("script", ["__main__.py", "prerequisites.py"])
def test_what_checks_the_python_is_written_for_an_old_one(script: str) -> None:
    ast.parse((ROOT / "setup" / script).read_text(), feature_version=(3, 6))
