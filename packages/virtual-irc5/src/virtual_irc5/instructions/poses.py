"""RAPID's calculations with poses: displacements of targets, frames through points, orientations, vectors."""

from __future__ import annotations

from math import cos, degrees, dist, hypot, radians, sin
from typing import Any

import numpy as np

from abb_protocols.robot.joints import ORIGIN_POSE, Pose, Quaternion, Vector, rotate
from abb_protocols.robot.kinematics import (
    compose_poses,
    euler_zyx,
    inverse_pose,
    matrix_from_quaternion,
    quaternion_from_euler_zyx,
    quaternion_from_matrix,
    quaternion_of_upper_half,
    quaternion_product,
)
from virtual_irc5.instructions.robot_data import unit_quaternion
from virtual_irc5.rapid import STANDARD, Call, Library, RapidRuntimeError

POSES = Library(STANDARD)
_SHORTEST_MM = 1e-6  # between the points of a frame


def _pose_in_mm(value: Any) -> Pose:
    """A RAPID pose, in its own unit [mm]."""
    return Pose(tuple(value[0]), unit_quaternion(value[1]))


def _rapid_in_mm(pose: Pose) -> Any:
    return pose.position, quaternion_of_upper_half(pose.orientation)


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
        turned = quaternion_product(turned, (turn[0], turn[1], turn[2], turn[3]))
    return ((px + dx, py + dy, pz + dz), turned, *point[2:])


def _orientation_of_angles(z_deg: float, y_deg: float, x_deg: float) -> Quaternion:
    return quaternion_of_upper_half(quaternion_from_euler_zyx((radians(x_deg), radians(y_deg), radians(z_deg))))


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
def _angle_of_orientation(call: Call) -> float:
    """One of the three angles [deg]."""
    index = next((i for i, name in enumerate(("X", "Y", "Z")) if call.present(name)), None)
    if index is None:
        raise RapidRuntimeError("ERR_ARGVALERR", r"EulerZYX needs one of \X, \Y and \Z.")
    return degrees(euler_zyx(unit_quaternion(call["Rotation"]))[index])


@POSES.function("DefFrame", r"pos NewP1, pos NewP2, pos NewP3, \num Origin", "pose")
def _frame_of_points(call: Call) -> Any:
    return _rapid_in_mm(_frame_through(call["NewP1"], call["NewP2"], call["NewP3"], call.get("Origin", 1.0)))


@POSES.function("DefDFrame", "pos OldP1, pos OldP2, pos OldP3, pos NewP1, pos NewP2, pos NewP3", "pose")
def _displacement_of_points(call: Call) -> Any:
    """What moves three points from where they were to where they are."""
    old, new = (_frame_through(*(call[f"{name}P{number}"] for number in (1, 2, 3))) for name in ("Old", "New"))
    return _rapid_in_mm(compose_poses(new, inverse_pose(old)))


@POSES.function(
    "DefAccFrame",
    "robtarget TargetListOne{*}, robtarget TargetListTwo{*}, num TargetsInList, INOUT num MaxErr, INOUT num MeanErr",
    "pose",
)
def _fitted_frame(call: Call) -> Any:
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
def _mirrored_target(call: Call) -> Any:
    r"""In the xy plane of a frame; the tool's x axis is mirrored with it, with \MirY its y axis."""
    target, plane = call["Point"], call["MirPlane"]
    plane_to_world = compose_poses(_pose_in_mm(plane.uframe), _pose_in_mm(plane.oframe))
    wobj = call.get("WObj")
    wobj_to_world = ORIGIN_POSE
    if wobj is not None:
        wobj_to_world = compose_poses(_pose_in_mm(wobj.uframe), _pose_in_mm(wobj.oframe))
    to_plane = compose_poses(inverse_pose(plane_to_world), wobj_to_world)
    pose = compose_poses(to_plane, Pose(tuple(target.trans), unit_quaternion(target.rot)))
    mirror = np.diag([1.0, 1.0, -1.0])
    flipped = 1 if call.present("MirY") else 0
    axes = mirror @ matrix_from_quaternion(pose.orientation)
    axes[:, flipped] *= -1.0  # the mirror image is left-handed; one of its axes has to turn round
    x, y, z = pose.position
    there = compose_poses(inverse_pose(to_plane), Pose((x, y, -z), quaternion_from_matrix(axes)))
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
    (
        "PoseMult",
        "pose Pose1, pose Pose2",
        "pose",
        lambda a, b: _rapid_in_mm(compose_poses(_pose_in_mm(a), _pose_in_mm(b))),
    ),
    ("PoseInv", "pose Pose", "pose", lambda pose: _rapid_in_mm(inverse_pose(_pose_in_mm(pose)))),
    (
        "PoseVect",
        "pose Pose, pos Pos",
        "pos",
        lambda pose, pos: compose_poses(_pose_in_mm(pose), Pose(pos, (1, 0, 0, 0))).position,
    ),
    ("DotProd", "pos Vector1, pos Vector2", "num", lambda a, b: sum(x * y for x, y in zip(a, b, strict=True))),
    ("Vectmagn", "pos Vector", "num", lambda vector: dist(vector, (0.0, 0.0, 0.0))),
    ("CrossProd", "pos Vector1, pos Vector2", "pos", lambda a, b: tuple(np.cross(a, b).tolist())),
):
    POSES.formula(_name, _signature, _returns, _compute)


@POSES.function("NOrient", "orient Rotation", "orient")
def _normalized(call: Call) -> Any:
    """The quaternion at length 1, which a cfg file's six digits may miss."""
    rotation = call["Rotation"]
    length = hypot(*rotation)
    if length == 0.0:
        raise call.error("ERR_ILLQUAT", "the orientation [0,0,0,0] has no direction.")
    return tuple(part / length for part in rotation)
