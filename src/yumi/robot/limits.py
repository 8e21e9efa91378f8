"""What the joints may do: positions from the robot's own motion configuration, speeds from ABB, the rest ours."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import degrees, radians

from yumi.robot.joints import Joints, joints


@dataclass(frozen=True, slots=True)
class JointLimits:
    """What the joints of one arm may do, in chain order.

    Attributes:
        lower: lowest positions [rad], (7,).
        upper: highest positions [rad], (7,).
        velocity: highest speeds [rad/s], (7,).
        acceleration: highest accelerations a commander should ask for [rad/s²], (7,).
        jerk: highest jerks a commander should ask for [rad/s³], (7,).
    """

    lower: Joints
    upper: Joints
    velocity: Joints
    acceleration: Joints
    jerk: Joints

    def slowed_to(self, speed: float) -> JointLimits:
        """The same joints where none may be faster than ``speed`` [rad/s], as EGM's MaxSpeedDeviation has it."""
        return replace(self, velocity=joints([min(top, speed) for top in self.velocity]))

    def outside(self, position: Joints) -> int | None:
        """Index of the first joint whose position [rad] is out of range (or not a number), or None."""
        for index, value in enumerate(position):
            if not self.lower[index] <= value <= self.upper[index]:
                return index
        return None

    def range_deg(self, index: int) -> str:
        """The joint's range for a sentence, e.g. ``-143.5° to 43.5°``."""
        return f"{degrees(self.lower[index]):.1f}° to {degrees(self.upper[index]):.1f}°"


# Positions: MOC.cfg of three real robots, equal for both arms (reference/yumi.md §1.2); speeds: ABB's specification.
# ABB publishes no accelerations of joints, only 11 m/s² at the tool. Ours give about that at half a metre with one
# large joint, and the drives' torque (ArmModel.torque) suffices for all joints at once, at full speed, in any pose,
# with 0.5 kg in the hand. The jerks build that up in 67 ms, over the period of what bends in the arm.
YUMI_LIMITS = JointLimits(
    lower=(-2.94088, -2.50455, -2.94088, -2.15548, -5.06145, -1.53589, -3.9968),
    upper=(2.94088, 0.759218, 2.94088, 1.39626, 5.06145, 2.40855, 3.9968),
    velocity=joints([radians(speed_deg) for speed_deg in (180, 180, 180, 180, 400, 400, 400)]),
    acceleration=(20.0, 20.0, 20.0, 20.0, 40.0, 40.0, 40.0),
    jerk=(300.0, 300.0, 300.0, 300.0, 600.0, 600.0, 600.0),
)
