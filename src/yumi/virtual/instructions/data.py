"""The data of the robot's instructions: types, conversions to the units of this package, and geometry without a robot.

RAPID has degrees and millimetres in ABB's order, this package SI units in chain order. The functions of positions,
orientations, frames and robtargets calculate in RAPID's own units.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, degrees, dist, hypot, radians, sin
from typing import Any, TypeVar

import numpy as np

from yumi.rapid.builtins.data import DATA
from yumi.rapid.library import Call, Library
from yumi.rapid.types import RapidRuntimeError
from yumi.robot.arm_kinematics import Arm
from yumi.robot.joints import (
    JOINT_COUNT,
    JointLimits,
    Joints,
    Pose,
    Quaternion,
    Vector,
    abb_from_chain,
    chain_from_abb,
    joints,
    rotate,
)
from yumi.robot.kinematics import (
    compose,
    euler_zyx,
    inverse,
    matrix,
    multiply,
    quaternion_from_euler_zyx,
    quaternion_from_matrix,
    upper_half,
)
from yumi.virtual.controller.egm import EgmState
from yumi.virtual.controller.units import MechanicalUnit
from yumi.virtual.mechanics.egm_motion import StopMode

T = TypeVar("T")

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


def add_data(library: Library, own_unit: str, units: Sequence[MechanicalUnit]) -> None:
    """Register types and data; ``ROB_ID`` is the robot of the task."""
    library.object_type("egmident", EgmIdentity)
    library.object_type("syncident", SyncPoint)
    library.object_type("mecunit", lambda: units[0])
    for name in ("egmstate", "egmstopmode", "egmframetype"):
        library.alias(name, "num")
    library.record("egm_minmax", {"min": "num", "max": "num"})
    library.record("tasks", {"taskname": "string"})
    for name, components in _RECORDS.items():
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
    trans, rot = rapid_from_pose(pose if wobj is None else compose(inverse(wobj), pose))
    turns = tuple(float(number) for number in arm.configuration(position))
    angle_deg = NOT_PRESENT if arm.reference is None else degrees(float(arm.angles(np.array([position]))[0]))
    return trans, rot, turns, (angle_deg, *(NOT_PRESENT,) * 5)


def rapid_from_pose(pose: Pose) -> _RapidPose:
    """RAPID's pose, in millimetres."""
    x, y, z = pose.position
    return (x * 1e3, y * 1e3, z * 1e3), pose.orientation


def _within(value: float, low: float, high: float) -> float:
    return min(max(value, low), high) if low - ROUNDING <= value <= high + ROUNDING else value


POSES = Library(DATA)
_SHORTEST_MM = 1e-6  # between the points of a frame
_NOT_NORMALISED = 1e-2  # how far the length of a quaternion may be from 1


def _pose_in_mm(value: Any) -> Pose:
    """A RAPID pose, in its own unit [mm]."""
    return Pose(tuple(value[0]), unit_quaternion(value[1]))


def unit_quaternion(value: Any) -> Quaternion:
    """An orient at length 1; raises ERR_ILLQUAT where it is far from that."""
    w, x, y, z = value
    length = hypot(w, x, y, z)
    if abs(length - 1.0) > _NOT_NORMALISED:
        sentence = f"The orientation [{w:g},{x:g},{y:g},{z:g}] has the length {length:.4g}, not 1: use NOrient."
        raise RapidRuntimeError("ERR_ILLQUAT", sentence)
    return (w / length, x / length, y / length, z / length)


def _rapid_in_mm(pose: Pose) -> Any:
    return pose.position, upper_half(pose.orientation)


def _moved_by(point: Any, x: float, y: float, z: float) -> Any:
    px, py, pz = point.trans
    return point._replace(trans=point.trans._make((px + x, py + y, pz + z)))


def _moved_in_tool(
    point: Any, x: float, y: float, z: float, rx: float | None, ry: float | None, rz: float | None
) -> tuple[Any, ...]:
    """Moved and turned in the tool's own frame: first about x, then about the new y, then about the new z."""
    orientation = unit_quaternion(point.rot)
    px, py, pz = point.trans
    dx, dy, dz = rotate(orientation, (x, y, z))
    turned = orientation
    for axis, angle_deg in enumerate((rx, ry, rz)):
        half = radians(angle_deg or 0.0) / 2.0
        turn = [cos(half), 0.0, 0.0, 0.0]
        turn[axis + 1] = sin(half)
        turned = multiply(turned, (turn[0], turn[1], turn[2], turn[3]))
    return ((px + dx, py + dy, pz + dz), turned, *point[2:])


def _orientation_of_angles(z_deg: float, y_deg: float, x_deg: float) -> Quaternion:
    return upper_half(quaternion_from_euler_zyx((radians(x_deg), radians(y_deg), radians(z_deg))))


def _frame_through(p1: Vector, p2: Vector, p3: Vector, origin: float = 1.0) -> Pose:
    """The frame with its x axis from p1 to p2 and p3 on the side of positive y; `origin` is where it lies."""
    a, b, c = (np.array(point) for point in (p1, p2, p3))
    x = b - a
    y = (c - a) - x * float((c - a) @ x) / max(float(x @ x), _SHORTEST_MM**2)
    if float(np.linalg.norm(x)) < _SHORTEST_MM or float(np.linalg.norm(y)) < _SHORTEST_MM:
        raise RapidRuntimeError("ERR_FRAME", "The three points of the frame are in a line: choose others.")
    x, foot = x / np.linalg.norm(x), c - y
    y = y / np.linalg.norm(y)
    at = {1.0: a, 2.0: b, 3.0: foot}.get(origin)
    if at is None:
        raise RapidRuntimeError("ERR_ARGVALERR", f"DefFrame takes \\Origin 1, 2 or 3, not {origin:g}.")
    px, py, pz = at.tolist()
    return Pose((px, py, pz), quaternion_from_matrix(np.stack([x, y, np.cross(x, y)], 1)))


@POSES.function("EulerZYX", r"\switch X | \switch Y | \switch Z, orient Rotation", "num")
def angle_of_orientation(call: Call) -> float:
    """One of the three angles [deg]."""
    index = next((i for i, name in enumerate(("X", "Y", "Z")) if call.present(name)), None)
    if index is None:
        raise RapidRuntimeError("ERR_ARGVALERR", r"EulerZYX needs one of \X, \Y and \Z.")
    return degrees(euler_zyx(unit_quaternion(call["Rotation"]))[index])


@POSES.function("DefFrame", r"pos NewP1, pos NewP2, pos NewP3, \num Origin", "pose")
def frame_of_points(call: Call) -> Any:
    return _rapid_in_mm(_frame_through(call["NewP1"], call["NewP2"], call["NewP3"], call.get("Origin", 1.0)))


@POSES.function("DefDFrame", "pos OldP1, pos OldP2, pos OldP3, pos NewP1, pos NewP2, pos NewP3", "pose")
def displacement_of_points(call: Call) -> Any:
    """What moves three points from where they were to where they are."""
    old, new = (_frame_through(*(call[f"{name}P{number}"] for number in (1, 2, 3))) for name in ("Old", "New"))
    return _rapid_in_mm(compose(new, inverse(old)))


@POSES.function(
    "DefAccFrame",
    "robtarget TargetListOne{*}, robtarget TargetListTwo{*}, num TargetsInList, INOUT num MaxErr, INOUT num MeanErr",
    "pose",
)
def fitted_frame(call: Call) -> Any:
    """The frame that fits best (least squares) between 3 to 10 points seen in both."""
    count = int(call["TargetsInList"])
    lists = [call["TargetListOne"], call["TargetListTwo"]]
    if not 3 <= count <= min(10, len(lists[0]), len(lists[1])):
        raise RapidRuntimeError("ERR_FRAME", f"DefAccFrame takes 3 to 10 targets that are in both lists, not {count}.")
    one, two = (np.array([target.trans for target in each[:count]]) for each in lists)
    centre_one, centre_two = one.mean(0), two.mean(0)
    left, values, right = np.linalg.svd((one - centre_one).T @ (two - centre_two))
    if values[1] < 1e-9 * max(values[0], 1.0):
        raise RapidRuntimeError("ERR_FRAME", "The targets of DefAccFrame are in a line: choose others.")
    mirror = np.diag([1.0, 1.0, float(np.sign(np.linalg.det(left @ right)))])
    rotation = left @ mirror @ right
    origin = centre_one - rotation @ centre_two
    errors = np.linalg.norm(one - (two @ rotation.T + origin), axis=1)
    call["MaxErr"], call["MeanErr"] = float(errors.max()), float(errors.mean())
    return tuple(origin.tolist()), quaternion_from_matrix(rotation)


@POSES.function("MirPos", r"robtarget Point, wobjdata MirPlane, \wobjdata WObj, \switch MirY", "robtarget")
def mirrored_target(call: Call) -> Any:
    r"""In the xy plane of a frame; the tool's x axis is mirrored with it, with \MirY its y axis."""
    target, plane = call["Point"], call["MirPlane"]
    plane_to_world = compose(_pose_in_mm(plane.uframe), _pose_in_mm(plane.oframe))
    wobj = call.get("WObj")
    wobj_to_world = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    if wobj is not None:
        wobj_to_world = compose(_pose_in_mm(wobj.uframe), _pose_in_mm(wobj.oframe))
    to_plane = compose(inverse(plane_to_world), wobj_to_world)
    pose = compose(to_plane, Pose(tuple(target.trans), unit_quaternion(target.rot)))
    mirror = np.diag([1.0, 1.0, -1.0])
    flipped = 1 if call.present("MirY") else 0
    axes = mirror @ matrix(pose.orientation)
    axes[:, flipped] *= -1.0  # the mirror image is left-handed; one of its axes has to turn round
    x, y, z = pose.position
    there = compose(inverse(to_plane), Pose((x, y, -z), quaternion_from_matrix(axes)))
    return there.position, there.orientation, *target[2:]


for _name, _signature, _returns, _compute in (
    ("Offs", "robtarget Point, num XOffset, num YOffset, num ZOffset", "robtarget", _moved_by),
    (
        "RelTool",
        r"robtarget Point, num Dx, num Dy, num Dz, \num Rx, \num Ry, \num Rz",
        "robtarget",
        _moved_in_tool,
    ),
    ("OrientZYX", "num ZAngle, num YAngle, num XAngle", "orient", _orientation_of_angles),
    ("PoseMult", "pose Pose1, pose Pose2", "pose", lambda a, b: _rapid_in_mm(compose(_pose_in_mm(a), _pose_in_mm(b)))),
    ("PoseInv", "pose Pose", "pose", lambda pose: _rapid_in_mm(inverse(_pose_in_mm(pose)))),
    (
        "PoseVect",
        "pose Pose, pos Pos",
        "pos",
        lambda pose, pos: compose(_pose_in_mm(pose), Pose(pos, (1, 0, 0, 0))).position,
    ),
    ("DotProd", "pos Vector1, pos Vector2", "num", lambda a, b: sum(x * y for x, y in zip(a, b, strict=True))),
    ("Vectmagn", "pos Vector", "num", lambda vector: dist(vector, (0.0, 0.0, 0.0))),
    ("CrossProd", "pos Vector1, pos Vector2", "pos", lambda a, b: tuple(np.cross(a, b).tolist())),
):
    POSES.formula(_name, _signature, _returns, _compute)
