"""What one arm of the virtual robot can do: the numbers of its servo, its drives and its brakes."""

from __future__ import annotations

from dataclasses import dataclass

from yumi.robot.joints import Joints
from yumi.robot.limits import YUMI_LIMITS, JointLimits


@dataclass(frozen=True, slots=True)
class ArmModel:
    """The dynamics of one arm; see reference/egm.md §6.5 for what is documented and what is a model.

    Attributes:
        limits: positions and speeds the joints can have.
        delay: pure delay from the planned to the measured position [s]; larger means a later answer.
        lag: time constant of the servo behind the delay [s]; larger means corners are rounded more.
        filtering_delay: what EGM's level 1 (filtering) adds to the delay [s].
        acceleration: highest accelerations of a RAPID motion [rad/s²], (7,).
        jerk: highest jerks of a RAPID motion [rad/s³], (7,).
        brake_deceleration: how hard the brakes stop every joint [rad/s²].
        step: longest time the arm moves at one planned speed, EGM's own cycle [s].
    """

    limits: JointLimits = YUMI_LIMITS
    delay: float = 0.016
    lag: float = 0.010
    filtering_delay: float = 0.016
    # ABB publishes 11 m/s² at the tool, no joint values: about that at half a metre for the large joints.
    acceleration: Joints = (20.0, 20.0, 20.0, 20.0, 40.0, 40.0, 40.0)
    jerk: Joints = (300.0, 300.0, 300.0, 300.0, 600.0, 600.0, 600.0)
    brake_deceleration: float = 60.0
    step: float = 0.004032
