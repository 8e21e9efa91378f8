"""What one arm of the virtual robot can do: the numbers of its servo, its drives and its brakes."""

from __future__ import annotations

from dataclasses import dataclass

from yumi.robot.cycle import CYCLE
from yumi.robot.dynamics import HAND
from yumi.robot.joints import Joints
from yumi.robot.limits import YUMI_LIMITS, JointLimits
from yumi.robot.model import Mass


@dataclass(frozen=True, slots=True)
class ArmModel:
    """The dynamics of one arm; see reference/egm.md §6.5 for what is documented and what is a model.

    Attributes:
        limits: positions and speeds the joints can have; accelerations and jerks of RAPID motions.
        delay: pure delay from the planned to the measured position [s]; larger means a later answer.
        lag: time constant of the servo behind the delay [s]; larger means corners are rounded more.
        filtering_delay: what EGM's level 1 (filtering) adds to the delay [s].
        brake_deceleration: how hard the brakes stop every joint [rad/s²].
        step: longest time the arm moves at one planned speed, EGM's own cycle [s].
        supervises_load: whether EGM references that need too much torque stop the robot (50375).
        torque: what the drives can give at the joints [N m], (7,).
        torque_time: how long they may be asked for more: the time constant of the mean that is supervised [s];
            as long as the servo's lag, which is what smooths a step of the reference.
        payload: what hangs on tool0, seen from tool0; None is a bare flange.
    """

    limits: JointLimits = YUMI_LIMITS
    delay: float = 0.016
    lag: float = 0.010
    filtering_delay: float = 0.016
    brake_deceleration: float = 60.0
    step: float = CYCLE
    supervises_load: bool = True
    # ABB publishes no torques. These are of the order of strain-wave gears of the joints' sizes: a tenth more than any
    # motion within the limits can need, all joints at once in the worst pose with 0.5 kg in the hand; and less than
    # what a step of several joints asks for at full-speed settings.
    torque: Joints = (72.0, 72.0, 36.0, 36.0, 6.0, 6.0, 6.0)
    torque_time: float = 0.010
    payload: Mass | None = HAND
