"""Fixtures of pytest for tests against an ABB YuMi that is not there: pytest finds them where yumi-ros2 is installed.

::

    def test_arm_arrives(abb_controller):
        with yumi.connect(**abb_controller.connect_options) as robot:
            robot.right.move_to(goal)
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:  # every run of pytest loads this file; the robot is loaded by the tests that want one
    from yumi.testing.virtual_yumi import ControllerProcess, VirtualYumi


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marks by which a test chooses what its robot is like."""
    config.addinivalue_line(
        "markers", "abb_controller(**options): options of `yumi controller` for the fixture, as left_object=0.02"
    )
    config.addinivalue_line("markers", "virtual_yumi(**settings): fields of WorldSettings for the fixture")


@pytest.fixture
def abb_controller(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[ControllerProcess]:
    """A virtual IRC5 with a YuMi in a process of its own: Robot Web Services and EGM on free ports, in real time."""
    from yumi.testing.virtual_yumi import ControllerProcess  # noqa: PLC0415 - see above

    mark = request.node.get_closest_marker("abb_controller")
    log = tmp_path_factory.mktemp("abb_controller") / "controller.log"
    with ControllerProcess(log, mark.kwargs if mark else {}) as controller:
        yield controller


@pytest.fixture
def virtual_yumi(request: pytest.FixtureRequest) -> VirtualYumi:
    """A virtual IRC5 with a YuMi in memory and in virtual time: nothing moves until the test lets time pass."""
    from virtual_irc5.world import WorldSettings  # noqa: PLC0415
    from yumi.testing.virtual_yumi import VirtualYumi  # noqa: PLC0415 - see above

    mark = request.node.get_closest_marker("virtual_yumi")
    return VirtualYumi(WorldSettings(**mark.kwargs) if mark else None)
