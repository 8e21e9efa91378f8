"""The fixture ``virtual_yumi`` of pytest, beside those of virtual-irc5: found where yumi-ros2 is installed.

::

    def test_arm_arrives(abb_controller):
        with yumi.connect(**abb_controller.connect_options) as robot:
            robot.right.move_to(goal)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:  # every run of pytest loads this file; the robot is loaded by the tests that want one
    from yumi.testing.virtual_yumi import VirtualYumi


def pytest_configure(config: pytest.Config) -> None:
    """Declare the mark by which a test chooses what its robot is like."""
    config.addinivalue_line("markers", "virtual_yumi(**settings): fields of WorldSettings for the fixture")


@pytest.fixture
def virtual_yumi(request: pytest.FixtureRequest) -> VirtualYumi:
    """A virtual IRC5 with a YuMi in memory and in virtual time: nothing moves until the test lets time pass."""
    from virtual_irc5.world import WorldSettings  # noqa: PLC0415
    from yumi.testing.virtual_yumi import VirtualYumi  # noqa: PLC0415 - see above

    mark = request.node.get_closest_marker("virtual_yumi")
    return VirtualYumi(WorldSettings(**mark.kwargs) if mark else None)
