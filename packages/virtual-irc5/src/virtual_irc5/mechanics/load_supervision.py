"""Supervision of the load that EGM's references put on the drives of an arm."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import exp
from operator import le

from abb_protocols.robot.description import HAND
from abb_protocols.robot.joints import Joints, Side
from virtual_irc5.mechanics.arm_motion import ArmModel, MotionState
from virtual_irc5.mechanics.dynamics import ArmDynamics
from virtual_irc5.mechanics.servo import between


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


_USUAL_TORQUE = ArmModel().torque
_TORQUE_MEMORY = 40  # cycles after which the mean of the torque has forgotten what was before


class LoadSupervision:
    """Supervises the torque that EGM's references need of the drives.

    The real controller stops with event 50375 when a reference needs too much torque of a joint; how it measures is not
    published. Here the mean of the torque over some tens of milliseconds counts, since a reference is made of steps of
    speed, one per cycle, which the servo smooths.

    Args:
        side: the arm.
        model: its payload and the torque of its drives.
        position: where it stands [rad], (7,); the drives hold it there.
    """

    def __init__(self, side: Side, model: ArmModel, position: Joints) -> None:
        self._dynamics = ArmDynamics(side, model.payload)
        self._model = model
        self._is_strong = model.torque == _USUAL_TORQUE and (model.payload is None or model.payload.mass <= HAND.mass)
        # States whose torque has not been computed, as they cannot overload anything; what came before is forgotten.
        self._rest: deque[tuple[MotionState, float]] = deque(maxlen=_TORQUE_MEMORY)
        self._torque = self._dynamics.torque(position)

    @property
    def torque(self) -> Joints:
        """Mean torque at the joints [N m], (7,)."""
        self._catch_up()
        return self._torque

    def advance(self, state: MotionState, dt: float) -> Overload | None:
        """Follow the planned state during ``dt`` [s]; the joint that it overloads, or None.

        Motions within the limits need less than the drives of a YuMi can give (:attr:`ArmModel.torque`): their torque
        is computed only once a state beyond the limits comes.
        """
        limits = self._model.limits
        is_slow = _are_within(state.velocity, limits.velocity)
        if self._is_strong and is_slow and _are_within(state.acceleration, limits.acceleration):
            self._rest.append((state, dt))
            return None
        self._catch_up()
        return self._follow(state, dt)

    def _catch_up(self) -> None:
        if len(self._rest) == _TORQUE_MEMORY:
            first, _ = self._rest[0]
            self._torque = self._dynamics.torque(first.position, first.velocity, first.acceleration)
        while self._rest:
            self._follow(*self._rest.popleft())

    def _follow(self, state: MotionState, dt: float) -> Overload | None:
        needed = self._dynamics.torque(state.position, state.velocity, state.acceleration)
        fraction = 1.0 - exp(-dt / self._model.torque_time)
        self._torque = between(self._torque, needed, fraction)
        loads = [abs(torque) / limit for torque, limit in zip(self._torque, self._model.torque, strict=True)]
        if max(loads) <= 1.0:
            return None
        joint = loads.index(max(loads))
        return Overload(joint, abs(self._torque[joint]), self._model.torque[joint])


def _are_within(values: Joints, most: Joints) -> bool:
    return all(map(le, map(abs, values), most))
