"""What an installation of the wheel gets is what is pinned, and is all that it needs."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path

import pytest
import requirements
from installation import Clone
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

CLONE = Clone(Path(__file__).resolve().parents[3])


def pinned(*extras: str) -> dict[str, str]:
    """Version by name."""
    found = {}
    for line in requirements.requirements(CLONE, extras):
        requirement = Requirement(line.partition(" --hash")[0])
        (specifier,) = requirement.specifier
        assert specifier.operator == "=="
        assert "--hash=sha256:" in line
        found[canonicalize_name(requirement.name)] = specifier.version
    return found


@pytest.mark.parametrize("extras", [(), ("ros", "record"), ("evaluation", "plot")])
def test_each_package_is_pinned_to_what_the_tests_run_with(extras: tuple[str, ...]) -> None:
    found = pinned(*extras)
    assert found == {name: version(name) for name in found}


def test_all_that_a_package_needs_is_among_them_and_no_more() -> None:
    plain, with_ros = pinned(), pinned("ros", "record")
    assert {"aiohttp", "multidict", "numpy", "click"} <= plain.keys()
    assert not {"pytest", "ros-rclpy", "mcap", "mkdocs"} & plain.keys()
    assert plain.items() < with_ros.items()
    assert {"ros-rclpy", "ros-rmw-fastrtps-cpp", "mcap"} <= with_ros.keys()  # an extra of one names the second
    assert not {"lark-parser", "empy", "pytest", "ros-ament-cmake"} & with_ros.keys()


def test_extra_that_does_not_exist_is_refused() -> None:
    with pytest.raises(SystemExit, match=r"there is no extra rso; there are: .*ros"):
        requirements.requirements(CLONE, ["rso"])


def test_package_without_a_pin_is_refused(tmp_path: Path) -> None:
    (tmp_path / "setup").mkdir()
    (tmp_path / "setup" / "excluded.txt").write_text("")
    (tmp_path / "constraints.txt").write_text("numpy==1.0 --hash=sha256:00\n")
    with pytest.raises(SystemExit, match=r"constraints\.txt has no pin of aiohappyeyeballs, .*run: make constraints"):
        requirements.requirements(Clone(tmp_path), [])
