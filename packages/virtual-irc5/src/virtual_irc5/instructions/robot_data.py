"""The data of the robot's instructions: RAPID's robtarget, jointtarget and their like, in the units of this package.

RAPID has degrees and millimetres in ABB's order, this package SI units in chain order.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees, hypot, radians
from typing import Any

import numpy as np

from abb_protocols.robot.arm_kinematics import KinematicArm
from abb_protocols.robot.joints import (
    JOINT_COUNT,
    JointLimits,
    Joints,
    Pose,
    Quaternion,
    abb_from_chain,
    chain_from_abb,
    joints,
)
from abb_protocols.robot.kinematics import compose_poses, inverse_pose, quaternion_of_upper_half
from virtual_irc5.mechanics.egm_client import EgmClientState
from virtual_irc5.mechanics.egm_motion import EgmStopMode
from virtual_irc5.rapid import STANDARD, Call, Library, RapidRuntimeError
from virtual_irc5.rapid.builtins.data import LINEAR_AXIS_MM_S, ROTATING_AXIS_DEG_S

FRAME_TYPES = ("BASE", "TOOL", "WOBJ", "WORLD", "JOINT")

# What a program has set for its motions, and what TriggStopProc stores at a stop.
_RECORDS: dict[str, dict[str, str]] = {
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


ROBOT_DATA = Library(STANDARD)
ROBOT_DATA.object_type("egmident", EgmIdentity)
ROBOT_DATA.object_type("syncident", SyncPoint)
ROBOT_DATA.object_type("mecunit", lambda: None)  # each library has its own, with a unit of its controller
for _name in ("egmstate", "egmstopmode", "egmframetype"):
    ROBOT_DATA.alias(_name, "num")
ROBOT_DATA.record("egm_minmax", {"min": "num", "max": "num"})
ROBOT_DATA.record("tasks", {"taskname": "string"})
for _name, _components in _RECORDS.items():
    ROBOT_DATA.record(_name, _components)
for _state in EgmClientState:
    ROBOT_DATA.data(f"EGM_STATE_{_state.name}", "egmstate", float(_state))
for _mode in EgmStopMode:
    ROBOT_DATA.data(f"EGM_STOP_{_mode.name}", "egmstopmode", float(_mode.value))
for _number, _name in enumerate(FRAME_TYPES):
    ROBOT_DATA.data(f"EGM_FRAME_{_name}", "egmframetype", float(_number))
ROBOT_DATA.formula("MaxRobReorientSpeed", "", "num", lambda: 500.0)
ROBOT_DATA.formula("MaxExtLinearSpeed", "", "num", lambda: LINEAR_AXIS_MM_S)
ROBOT_DATA.formula("MaxExtReorientSpeed", "", "num", lambda: ROTATING_AXIS_DEG_S)


NOT_PRESENT = 9e9
"""What RAPID writes for an axis that is not there."""

_ROUNDING = 1e-6
"""A num has seven digits: read back, a joint at its limit may lie this far beyond it [rad]."""

JointTarget = tuple[tuple[float, ...], tuple[float, ...]]
"""``robax`` and ``extax``, six values each [deg]; :data:`NOT_PRESENT` for axes that are not there."""

_RapidPose = tuple[tuple[float, float, float], tuple[float, float, float, float]]


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
    return tuple(position)


def axis_index(call: Call, name: str, arm: KinematicArm) -> int:
    """Index in chain order of the axis whose number an argument is; raises ERR_AXIS_PAR."""
    number = call[name]
    if number not in arm.axes:
        raise call.error("ERR_AXIS_PAR", f"the robot has the axes 1 to {arm.joint_count}, not {number:g}.")
    return arm.axes.index(number)


def pose_from_rapid(pose: Any) -> Pose:
    """A frame in metres from RAPID's in millimetres."""
    x, y, z = (value * 1e-3 for value in pose[0])
    w, i, j, k = pose[1]
    return Pose((x, y, z), (w, i, j, k))


def wobj_from_rapid(wobj: Any) -> Pose:
    """The work object's object frame in the world: user frame, then object frame."""
    return compose_poses(pose_from_rapid(wobj.uframe), pose_from_rapid(wobj.oframe))


def robtarget(arm: KinematicArm, position: Joints, tool: Pose | None, wobj: Pose | None) -> tuple[Any, ...]:
    """RAPID's robtarget of the tool at joint positions [rad]; ``eax_a`` is the arm angle of seven axes."""
    pose = arm.tool0(position)
    pose = pose if tool is None else compose_poses(pose, tool)
    pose = Pose(pose.position, quaternion_of_upper_half(pose.orientation))
    trans, rot = rapid_from_pose(pose if wobj is None else compose_poses(inverse_pose(wobj), pose))
    turns = tuple(float(number) for number in arm.configuration(position))
    angle_deg = NOT_PRESENT if arm.reference is None else degrees(float(arm.angles(np.array([position]))[0]))
    return trans, rot, turns, (angle_deg, *(NOT_PRESENT,) * 5)


def rapid_from_pose(pose: Pose) -> _RapidPose:
    """RAPID's pose, in millimetres."""
    x, y, z = pose.position
    return (x * 1e3, y * 1e3, z * 1e3), pose.orientation


def _within(value: float, low: float, high: float) -> float:
    return min(max(value, low), high) if low - _ROUNDING <= value <= high + _ROUNDING else value


_NOT_NORMALISED = 1e-2  # how far the length of a quaternion may be from 1


def unit_quaternion(value: Any) -> Quaternion:
    """An orient at length 1; raises ERR_ILLQUAT where it is far from that."""
    w, x, y, z = value
    length = hypot(w, x, y, z)
    if abs(length - 1.0) > _NOT_NORMALISED:
        sentence = f"The orientation [{w:g},{x:g},{y:g},{z:g}] has the length {length:.4g}, not 1: use NOrient."
        raise RapidRuntimeError("ERR_ILLQUAT", sentence)
    return (w / length, x / length, y / length, z / length)
