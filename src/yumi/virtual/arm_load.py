"""The load on the drives of one arm: the torque that EGM's references need, and whether the drives can give it.

The real controller stops with event 50375 when a reference needs too much torque of a joint; how it measures is not
published. Here the mean of the torque over some tens of milliseconds counts, since a reference is made of steps of
speed, one per cycle, which the servo smooths.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import exp
from typing import cast

from yumi.robot.dynamics import ArmDynamics
from yumi.robot.joints import Joints, Side
from yumi.virtual.arm_model import ArmModel
from yumi.virtual.arm_motion import MotionState


@dataclass(frozen=True, slots=True)
class Overload:
    """A joint whose reference needs more than its drive can give.

    Attributes:
        joint: its index in chain order.
        torque: mean torque it would need [N m].
        limit: what the drive can give [N m].
    """

    joint: int
    torque: float
    limit: float


class LoadSupervision:
    """Watches what a guided motion asks of the drives.

    Args:
        side: the arm.
        model: its payload and the torque of its drives.
        position: where it stands [rad], (7,); the drives hold it there.
    """

    def __init__(self, side: Side, model: ArmModel, position: Joints) -> None:
        self._dynamics = ArmDynamics(side, model.payload)
        self._model = model
        self.torque = self._dynamics.torque(position)

    def advance(self, state: MotionState, dt: float) -> Overload | None:
        """Take in what the arm was asked to do during ``dt`` [s]; the joint that is overloaded by it, or None."""
        needed = self._dynamics.torque(state.position, state.velocity, state.acceleration)
        share = 1.0 - exp(-dt / self._model.torque_time)
        mean = tuple(old + (new - old) * share for old, new in zip(self.torque, needed, strict=True))
        self.torque = cast("Joints", mean)
        loads = [abs(torque) / limit for torque, limit in zip(self.torque, self._model.torque, strict=True)]
        if max(loads) <= 1.0:
            return None
        joint = loads.index(max(loads))
        return Overload(joint, abs(self.torque[joint]), self._model.torque[joint])
