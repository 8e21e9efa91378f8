"""A virtual YuMi for tests of programs that use the driver."""

from __future__ import annotations

import logging

from virtual_irc5.testing.virtual_robot import VirtualRobot
from yumi.driver.bringup import Bringup
from yumi.driver.state_machine import EgmMotionSettings

_log = logging.getLogger(__name__)


class VirtualYumi(VirtualRobot):
    """A virtual YuMi with the driver's program, in memory and in virtual time."""

    def start_egm(self, motion: EgmMotionSettings | None = None) -> None:
        """Bring the robot to ready and start EGM on both arms, as the driver does.

        Args:
            motion: of EGM; the driver's own when left out.

        Raises:
            RobotNotReady: it did not become ready, or EGM did not start; the message says why.
        """
        with self.client() as client:
            bringup = Bringup(client, motion or EgmMotionSettings(), self, _log.info)
            bringup.make_ready()
            bringup.start_egm()
