"""The state of any robot behind EGM, as one datagram tells it."""

from __future__ import annotations

from dataclasses import dataclass

from yumi.egm.messages import RobotMessage
from yumi.hardware.egm_arm import is_running
from yumi.robot.values import Pose


@dataclass(frozen=True, slots=True)
class RobotState:
    """What a robot says in one datagram, and when.

    Attributes:
        time: when it arrived, on this machine's monotonic clock [s].
        dt: robot time since the state before, 0 for the first of a session or after a silence [s].
        session: counts EGM sessions from 1; a change means that the robot began anew.
        is_first: whether it is the first of its session.
        message: all of it.
    """

    time: float
    dt: float
    session: int
    is_first: bool
    message: RobotMessage

    @property
    def joints(self) -> tuple[float, ...]:
        """Measured joint positions [rad]: axes 1 to 6, or 1, 2, 7, 3, 4, 5, 6 of a seven-axis arm."""
        return self.message.measured

    @property
    def external(self) -> tuple[float, ...]:
        """Measured positions of external axes that are no part of the arm [rad], linear ones [m]."""
        return self.message.measured_external

    @property
    def planned(self) -> tuple[float, ...]:
        """Joint positions the controller is heading for [rad]."""
        return self.message.planned

    @property
    def pose(self) -> Pose | None:
        """Measured pose of the tool, in the frame that RAPID gave EGM; None when the robot sent none."""
        return self.message.measured_pose

    @property
    def is_running(self) -> bool:
        """Whether the robot follows what it is sent; a position stream alone does not."""
        return is_running(self.message)
