"""The data types and predefined data of the robot's instructions, beside RAPID's own.

RAPID's values and ours: degrees and millimetres in ABB's order there, SI units in chain order here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees, radians
from typing import Any, TypeVar, cast

import numpy as np

from yumi.rapid.library import Library
from yumi.robot.arms import Arm
from yumi.robot.joints import JOINT_COUNT, JointLimits, Joints, Pose, abb_from_chain, chain_from_abb, joints
from yumi.robot.kinematics import compose, inverse, upper_half
from yumi.virtual.controller.egm import EgmState
from yumi.virtual.controller.units import MechanicalUnit
from yumi.virtual.mechanics.motion import StopMode

FRAME_TYPES = ("BASE", "TOOL", "WOBJ", "WORLD", "JOINT")


# What a program has set for its motions, and what TriggStopProc stores at a stop.
_SETTINGS: dict[str, dict[str, str]] = {
    "veldata": dict.fromkeys(("oride", "max"), "num"),
    "accdata": dict.fromkeys(("acc", "ramp", "finepramp"), "num"),
    "singdata": dict.fromkeys(("wrist", "lockaxis4", "base"), "bool"),
    "confsupdata": {"jsup": "bool", "lsup": "bool", "ax1": "num", "ax4": "num", "ax6": "num"},
    "motsetdata": {
        "vel": "veldata",
        "acc": "accdata",
        "sing": "singdata",
        "conf": "confsupdata",
        "pathresol": "num",
        "motionsup": "bool",
        "tunevalue": "num",
        "acclim": "bool",
        "accmax": "num",
        "decellim": "bool",
        "decelmax": "num",
        "cirpathreori": "num",
        "worldacclim": "bool",
        "worldaccmax": "num",
        "evtbufferact": "bool",
    },
    "progdisp": {"pdisp": "pose", "eoffs": "extjoint"},
    "restartdata": {
        "restartstop": "bool",
        "stoponpath": "bool",
        **dict.fromkeys(("predo1val", "postdo1val"), "dionum"),
        **{f"{when}go{number}val": "num" for number in range(1, 5) for when in ("pre", "post")},
        **dict.fromkeys(("preshadowval", "shadowflanks", "postshadowval"), "dionum"),
    },
}


@dataclass(eq=False, slots=True)
class EgmIdentity:
    """What an egmident stands for; the arm unit keeps the names of the variables that are reserved."""


@dataclass(eq=False, slots=True)
class SyncPoint:
    """What a syncident stands for: tasks meet at its name, so it holds nothing."""


def add_data(library: Library, own_unit: str, units: Sequence[MechanicalUnit]) -> None:
    """Register types and data; ``ROB_ID`` is the robot of the task."""
    library.object_type("egmident", EgmIdentity)
    library.object_type("syncident", SyncPoint)
    library.object_type("mecunit", lambda: units[0])
    for name in ("egmstate", "egmstopmode", "egmframetype"):
        library.alias(name, "num")
    library.record("egm_minmax", {"min": "num", "max": "num"})
    library.record("tasks", {"taskname": "string"})
    for name, components in _SETTINGS.items():
        library.record(name, components)
    for state in EgmState:
        library.data(f"EGM_STATE_{state.name}", "egmstate", float(state))
    for mode in StopMode:
        library.data(f"EGM_STOP_{mode.name}", "egmstopmode", float(mode.value))
    for number, name in enumerate(FRAME_TYPES):
        library.data(f"EGM_FRAME_{name}", "egmframetype", float(number))
    for unit in units:
        library.data(unit.name, "mecunit", unit)
        if unit.name == own_unit:
            library.data("ROB_ID", "mecunit", unit)


NOT_PRESENT = 9e9
"""What RAPID writes for an axis that is not there."""

ROUNDING = 1e-6
"""A num has seven digits: read back, a joint at its limit may lie this far beyond it [rad]."""

JointTarget = tuple[tuple[float, ...], tuple[float, ...]]
"""``robax`` and ``extax``, six values each [deg]; :data:`NOT_PRESENT` for axes that are not there."""

T = TypeVar("T")

_Frame = tuple[tuple[float, float, float], tuple[float, float, float, float]]


def jointtarget(position: Joints) -> JointTarget:
    """RAPID's jointtarget of joint positions [rad]."""
    if len(position) < JOINT_COUNT:
        return tuple(degrees(value) for value in position), (NOT_PRESENT,) * 6
    robax, eax_a = abb_from_chain(joints([degrees(value) for value in position]))
    return robax, (eax_a, *(NOT_PRESENT,) * 5)


def chain_from_jointtarget(target: Any, now: Joints, limits: JointLimits) -> Joints:
    """Joint positions [rad] of a jointtarget; an axis with 9E9 stays where it is ``now`` [rad]."""
    chain_deg = target.robax if len(now) < JOINT_COUNT else chain_from_abb(target.robax, target.extax[0])
    position = [
        is_now if value_deg >= NOT_PRESENT else _within(radians(value_deg), low, high)
        for value_deg, is_now, low, high in zip(chain_deg, now, limits.lower, limits.upper, strict=True)
    ]
    return cast("Joints", tuple(position))


def chain_order(axes: Sequence[T]) -> tuple[T, T, T, T, T, T, T]:
    """One thing per axis, from ABB's order (1 to 7) to chain order."""
    a1, a2, a3, a4, a5, a6, a7 = axes
    return (a1, a2, a7, a3, a4, a5, a6)


def pose_from_rapid(pose: Any) -> Pose:
    """A frame in metres from RAPID's in millimetres."""
    x, y, z = (value * 1e-3 for value in pose[0])
    w, i, j, k = pose[1]
    return Pose((x, y, z), (w, i, j, k))


def wobj_from_rapid(wobj: Any) -> Pose:
    """The work object's object frame in the world: user frame, then object frame."""
    return compose(pose_from_rapid(wobj.uframe), pose_from_rapid(wobj.oframe))


def robtarget(arm: Arm, position: Joints, tool: Pose | None, wobj: Pose | None) -> tuple[Any, ...]:
    """RAPID's robtarget of the tool at joint positions [rad]; ``eax_a`` is the arm angle of seven axes."""
    pose = arm.tool0(position)
    pose = pose if tool is None else compose(pose, tool)
    pose = Pose(pose.position, upper_half(pose.orientation))
    trans, rot = frame(pose if wobj is None else compose(inverse(wobj), pose))
    turns = tuple(float(number) for number in arm.configuration(position))
    angle_deg = NOT_PRESENT if arm.reference is None else degrees(float(arm.angles(np.array([position]))[0]))
    return trans, rot, turns, (angle_deg, *(NOT_PRESENT,) * 5)


def frame(pose: Pose) -> _Frame:
    """RAPID's pose, in millimetres."""
    x, y, z = pose.position
    return (x * 1e3, y * 1e3, z * 1e3), pose.orientation


def _within(value: float, low: float, high: float) -> float:
    return min(max(value, low), high) if low - ROUNDING <= value <= high + ROUNDING else value
