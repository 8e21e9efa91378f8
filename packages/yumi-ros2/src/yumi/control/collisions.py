"""The collision limiter: it keeps both arms apart from each other, from the body and from what stands around the robot.

The invariant, for whatever moves the arms: if both arms brake now as hard as they may, no two parts
come nearer to each other than the margin. A command is sent only if the whole of its braking path is clear of the whole
of the other arm's; else the arm brakes, along the path that was found clear when the command before was sent. So what
was once kept is kept, however the commands are chosen. And if the link of either arm is lost, now or while it brakes,
nothing touches where it goes on to without commands.

Whether a command is clear is decided in ``core/collision_limiter.hpp``, and what is sent in place of one that is not in
``core/arm_collisions.hpp`` (docs/explanation/decisions/0032-arms-keep-apart.md).

This is no safety function: a person in the way, or a part that was not declared, is not seen.
"""

from __future__ import annotations

from ctypes import byref
from itertools import chain
from math import inf, isfinite
from struct import Struct

import numpy as np
from numpy.typing import NDArray

from abb_protocols.robot.joints import JointLimits, Joints, Side
from yumi.control.motion.robot_response import plan_gain
from yumi.control.motion.setpoint import Setpoint
from yumi.control.shared_state import Limited
from yumi.core.collision import TOOL_FRAME, CollisionModel
from yumi.core.library import SETPOINT_STRUCT, LimitedParts, load, new_handle

COLLISION_MARGIN = 0.010
"""No two parts, padding included, come nearer to each other than this [m]."""

BODY_MARGIN = -0.002
"""From the body and the other arm's shoulder the arms keep half of their padding: at home they are that near [m]."""

COLLISION_DISTANCES = 20_000
"""Calculated for an arm in a cycle at most; what needs more is left to slower commands."""

_SEVEN = Struct("7d")


def declared_margins(model: CollisionModel, margin: float) -> NDArray[np.float64]:
    """How near any two parts may come to each other [m], (parts, parts)."""
    is_near = model.frames == 0  # the shoulders are as near to the other arm as to the body, and bolted to it
    is_near[model.body] = True
    return np.where(is_near[:, None] | is_near, min(margin, BODY_MARGIN), margin)


class CollisionLimiter:
    """Keeps both arms apart; :meth:`arm` is what the limiter of one arm uses.

    Args:
        model: the shapes.
        limits: of the joints: how hard they brake.
        gain: of the robots' position loops [1/s].
        margin: the distance kept [m].
        distances: that may be calculated for an arm in a cycle.

    Attributes:
        model, limits, margin: as above.
        is_of: which parts are an arm's, (parts,).
        margins: between all pairs of parts [m], (parts, parts); another array when other pairs may touch.
        library: the core.
        handle: what the core calls the comparison of both arms.
        arm_collisions_handle: and what it knows of each of them.
    """

    def __init__(
        self,
        model: CollisionModel,
        limits: JointLimits,
        gain: float,
        margin: float = COLLISION_MARGIN,
        distances: int = COLLISION_DISTANCES,
    ) -> None:
        if not (isfinite(margin) and isfinite(gain)):
            raise ValueError(f"margin {margin} m and gain {gain} 1/s: both must be finite")
        self.model = model
        self.margin = margin
        self.limits = limits
        self._arms = {side: ArmCollisionLimiter(self, side, number) for number, side in enumerate(Side)}
        self.is_of = {side: np.zeros(len(model.names), dtype=bool) for side in Side}
        for side, parts in model.arms.items():
            self.is_of[side][parts] = True
        self._declared = declared_margins(model, margin)
        self.library = load()
        numbers = {name: number for number, name in enumerate(model.names)}
        names = np.array([numbers[name] for name in model.names])
        braking = np.array([*limits.acceleration, *limits.jerk, plan_gain(gain)])
        self.handle = new_handle(self, "collisions", model.handle, braking.ctypes.data, names.ctypes.data)
        self.arm_collisions_handle = new_handle(self, "arm_collisions", self.handle, distances, plan_gain(gain))
        self.permit()

    def arm(self, side: Side) -> ArmCollisionLimiter:
        """What one arm's limiter asks."""
        return self._arms[side]

    def pairs_of(self, name: str, other: str) -> int:
        """How many pairs of parts have these names, in either order; see :meth:`permit`."""
        return int(np.triu(self._found(name, other)).sum())

    def permit(self, *pairs: tuple[str, str]) -> None:
        """Let the parts of these names touch, and no others.

        A name is that of a part (``right gripper``), of an arm (``right arm``) or of what stands still (``table``).
        """
        margins = self._declared.copy()
        for pair in pairs:
            margins[self._found(*pair)] = -inf
        self.margins = margins
        self.library.arm_collisions_permit(self.arm_collisions_handle, margins.ctypes.data)

    def _found(self, name: str, other: str) -> NDArray[np.bool_]:
        """Which pairs of parts of an arm, and of the other one or what stands still, have these names.

        ``right arm`` is all of the arm, and ``right gripper`` all that is fixed to its tool0: the fingers, a camera,
        cups and declared tools, too.
        """
        first, second = (np.array(self.model.names) == wanted for wanted in (name, other))
        for side, its in self.is_of.items():
            for group, parts in (("arm", its), ("gripper", its & (self.model.frames == TOOL_FRAME))):
                first, second = (
                    found | parts if wanted == f"{side.word} {group}" else found
                    for found, wanted in ((first, name), (second, other))
                )
        one_arm = sum(np.outer(its, its) for its in self.is_of.values()) > 0
        still = ~(self.is_of[Side.RIGHT] | self.is_of[Side.LEFT])
        return np.asarray((np.outer(first, second) | np.outer(second, first)) & ~one_arm & ~np.outer(still, still))


class ArmCollisionLimiter:
    """Of one arm's commands, whether they keep the arms apart; see :class:`CollisionLimiter`.

    The arm's limiter asks the core itself; the methods here are for who plans a motion.

    Attributes:
        side: which arm.
        number: that of the arm.
    """

    def __init__(self, both: CollisionLimiter, side: Side, number: int) -> None:
        self.side, self.number = side, number
        self._both = both

    @property
    def handle(self) -> int:
        """What the core calls both arms."""
        return self._both.arm_collisions_handle

    @property
    def limited(self) -> Limited | None:
        """What limits the arm in this cycle."""
        both, found = self._both, LimitedParts()
        if not both.library.arm_collisions_limited(self.handle, self.number, byref(found)):
            return None
        names, is_of_other = both.model.names, both.is_of[self.side.other][found.other]
        other = names[found.other] + (_LAST_HEARD if is_of_other and found.is_stale else "")
        return Limited(names[found.part], other, found.distance)

    def note_measured(self, position: Joints) -> None:
        """An arm that is not heard was read from the controller to be at ``position`` [rad], (7,).

        The other arm keeps clear of what lies between there and where it was read before.
        """
        self._both.library.arm_collisions_note_measured(self.handle, self.number, _SEVEN.pack(*position))

    def sent(self, planned: Joints, sent: Setpoint, robot: Setpoint | None) -> None:
        """An arm is sent a command that :meth:`accepts` has not accepted; arguments as there."""
        self._both.library.arm_collisions_note_sent(self.handle, self.number, *_packed_motion(planned, sent, robot))

    def accepts(self, planned: Joints, sent: Setpoint, robot: Setpoint | None, *, feeds_forward: bool = False) -> bool:
        """Whether an arm may be sent this command in the cycle that begins; if so, it is taken.

        Args:
            planned: where its robot plans to be [rad], (7,).
            sent: how the position sent would move at the end of this cycle's step.
            robot: how the robot would, where a speed is fed forward.
            feeds_forward: whether one is desired; else it is only taken back.
        """
        motion = _packed_motion(planned, sent, robot)
        return bool(self._both.library.arm_collisions_accepts(self.handle, self.number, *motion, feeds_forward))


def _packed_motion(planned: Joints, sent: Setpoint, robot: Setpoint | None) -> tuple[bytes, bytes, bytes | None]:
    values = (SETPOINT_STRUCT.pack(*chain(*each)) if each is not None else None for each in (sent, robot))
    first, second = values
    assert first is not None
    return _SEVEN.pack(*planned), first, second


_LAST_HEARD = " where EGM reported it last"
"""Added to the name of a part of an arm whose datagrams do not arrive."""
