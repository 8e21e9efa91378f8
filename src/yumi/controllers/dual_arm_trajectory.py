"""The dual-arm trajectory controller: one on each arm, both on one trajectory, starting and ending together."""

from __future__ import annotations

from yumi.control.mailbox import Mailbox
from yumi.control.speed_scale import SpeedScale
from yumi.control.trajectory_partner import OtherArm
from yumi.controllers.joint_trajectory import JointTrajectoryController
from yumi.robot.joints import Side
from yumi.robot.limits import YUMI_LIMITS, JointLimits


class DualArmTrajectoryController(JointTrajectoryController):
    """One arm's half; an end of one arm's motion ends the other's.

    Args:
        side: its arm.
        feedback: where others see how it follows.
        ours: where the other arm's controller looks.
        theirs: where the other arm's controller tells.
        limits: what the joints may do.
        speed: the factor on the arm's speed.
    """

    kind = "yumi_controllers/DualArmTrajectoryController"

    def __init__(
        self,
        side: Side,
        feedback: Mailbox,
        ours: Mailbox,
        theirs: Mailbox,
        limits: JointLimits = YUMI_LIMITS,
        speed: SpeedScale | None = None,
    ) -> None:
        super().__init__(side, feedback, limits, OtherArm(ours, theirs), speed)
