"""The one table of joint orders and names: chain order inside, ABB's axis order and EGM's split on the wire.

Chain order lists the axes from body to flange in ABB's numbers: 1, 2, 7, 3, 4, 5, 6. RAPID and EGM keep axis 7
apart: ``robax`` (EGM ``joints``) holds axes 1-6 and ``extax.eax_a`` (EGM ``externalJoints[0]``) axis 7
(reference/yumi.md §1.1, reference/egm.md §3.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum

Joints = tuple[float, float, float, float, float, float, float]
"""Seven joint values in chain order; [rad] or [rad/s] unless the name says otherwise."""

JOINT_COUNT = 7
CHAIN_AXES = (1, 2, 7, 3, 4, 5, 6)


class Side(Enum):
    """One arm of the robot; the value is its ROS namespace."""

    RIGHT = "r"
    LEFT = "l"

    @property
    def other(self) -> Side:
        """The arm on the other side."""
        return Side.LEFT if self is Side.RIGHT else Side.RIGHT

    @property
    def word(self) -> str:
        """The arm in a sentence: ``right`` or ``left``."""
        return "right" if self is Side.RIGHT else "left"

    @property
    def task(self) -> str:
        """Name of the arm's RAPID task."""
        return f"T_ROB_{self.name[0]}"

    @property
    def unit(self) -> str:
        """Name of the arm's mechanical unit, EGM device and EGM configuration."""
        return f"ROB_{self.name[0]}"


def joint_names(side: Side) -> tuple[str, ...]:
    """ROS names of the arm's joints in chain order, e.g. ``yumi_joint_7_r`` in third place."""
    return tuple(f"yumi_joint_{axis}_{side.value}" for axis in CHAIN_AXES)


def finger_names(side: Side) -> tuple[str, str]:
    """ROS names of the two finger joints of the arm's gripper."""
    return (f"gripper_{side.value}_joint", f"gripper_{side.value}_joint_m")


def joints(values: Sequence[float]) -> Joints:
    """Check the count of ``values`` (7, chain order) and fix them as a tuple."""
    if len(values) != JOINT_COUNT:
        raise ValueError(f"an arm has {JOINT_COUNT} joints, got {len(values)} values")
    a, b, c, d, e, f, g = (float(value) for value in values)
    return (a, b, c, d, e, f, g)


def chain_from_abb(robax: Sequence[float], eax_a: float) -> Joints:
    """Chain order from RAPID's split: ``robax`` holds axes 1-6, ``eax_a`` axis 7; units are kept."""
    a1, a2, a3, a4, a5, a6 = robax
    return (a1, a2, eax_a, a3, a4, a5, a6)


def abb_from_chain(chain: Joints) -> tuple[tuple[float, float, float, float, float, float], float]:
    """RAPID's split (axes 1-6, axis 7) from chain order; units are kept."""
    a1, a2, a7, a3, a4, a5, a6 = chain
    return (a1, a2, a3, a4, a5, a6), a7
