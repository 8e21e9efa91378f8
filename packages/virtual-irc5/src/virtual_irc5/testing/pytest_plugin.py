"""Fixtures of pytest for tests without an ABB robot: pytest finds the fixtures where virtual-irc5 is installed.

::

    @pytest.mark.virtual_robot(model="irb120", programs={"T_ROB1": [Path("main.mod")]})
    def test_program_ends(virtual_robot):
        virtual_robot.start_rapid(once=True)
        virtual_robot.wait(10.0)
        assert not virtual_robot.is_running
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:  # every run of pytest loads this file; the robot is loaded by the tests that want one
    from virtual_irc5.testing.controller_process import ControllerProcess
    from virtual_irc5.testing.virtual_robot import VirtualRobot


def pytest_configure(config: pytest.Config) -> None:
    """Declare the marks by which a test chooses what its robot is like."""
    config.addinivalue_line(
        "markers", "abb_controller(**options): options of `virtual-irc5 run` for the fixture, as model='irb120'"
    )
    config.addinivalue_line(
        "markers",
        "virtual_robot(**settings): model, programs and cfg as of `virtual-irc5 run`, and fields of WorldSettings",
    )


@pytest.fixture
def abb_controller(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[ControllerProcess]:
    """A virtual IRC5 in a process of its own: Robot Web Services and EGM on free ports, in real time."""
    from virtual_irc5.testing.controller_process import ControllerProcess  # noqa: PLC0415 - see above

    mark = request.node.get_closest_marker("abb_controller")
    log = tmp_path_factory.mktemp("abb_controller") / "controller.log"
    with ControllerProcess(log, mark.kwargs if mark else {}) as controller:
        yield controller


@pytest.fixture
def virtual_robot(request: pytest.FixtureRequest) -> VirtualRobot:
    """A virtual IRC5 in memory and in virtual time: nothing moves until the test lets time pass."""
    from virtual_irc5.testing.virtual_robot import VirtualRobot, virtual_robot_settings  # noqa: PLC0415 - see above
    from virtual_irc5.world import WorldSettings  # noqa: PLC0415

    mark = request.node.get_closest_marker("virtual_robot")
    given = dict(mark.kwargs) if mark else {}
    chosen = {name: given.pop(name) for name in ("model", "programs", "cfg") if name in given}
    return VirtualRobot(virtual_robot_settings(**chosen, settings=WorldSettings(**given)))
