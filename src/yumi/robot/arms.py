"""Robot arms as data: a chain of turning axes with its limits, for the two arms of a YuMi and for other robots.

An `Arm` says where tool0 is for joint positions, which postures have a pose, and which joint positions follow a path of
poses from a posture. Everything is seen from the robot's base frame, which RAPID calls world here, for many postures at
once: arrays begin with the number of postures, n; the arm has k joints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from itertools import product
from math import acos, atan2, cos, hypot, pi, radians, sin, sqrt, tau
from typing import cast

import numpy as np
from numpy.typing import NDArray

from yumi.catalogue import message
from yumi.errors import YumiError
from yumi.robot.inverse_kinematics import (
    CONFIGURATION_TOLERANCE,
    Configuration,
    configuration,
    postures,
    quarter_turn,
)
from yumi.robot.joints import CHAIN_AXES, YUMI_LIMITS, JointLimits, Joints, Pose, Side, Vector, home
from yumi.robot.kinematics import (
    ELBOW_OFFSET,
    FLANGE,
    FOREARM,
    IDENTITY,
    SHOULDER_HEIGHT,
    SHOULDER_OFFSET,
    UPPER_ARM,
    WRIST_OFFSET,
    compose,
    foot_to_body,
    matrix,
    quaternion_from_matrix,
)

Array = NDArray[np.float64]
Postures = Callable[[Pose, float], tuple[Joints, ...]]

_X, _Y, _Z = range(3)
_CONVERGED = 1e-9  # [m], [rad]
_ITERATIONS = 12
_LONGEST_NEWTON_STEP = 0.5  # [rad]
_LONGEST_STEP = 0.25  # [rad] of a joint from one pose of a path to the next, where the arm follows them
_WINDOW = 48  # poses that are solved together
_ELBOW_AXIS = 3  # the axis whose direction the arm angle is of, in chain order
_WRIST_AXIS = 6
_ROUNDING = 1e-9  # [rad]: a limit after a calculation is not beyond the limit
_SAME_CONFIGURATION = 0.02  # [rad] beside the border of a quarter turn or branch, where a position counts to both


class Lost(YumiError):
    """A path of poses cannot be followed.

    Attributes:
        index: the first pose that is not reached.
        posture: the joint positions before it [rad].
    """

    def __init__(self, index: int, posture: Joints) -> None:
        super().__init__(message("path_lost", pose=index))
        self.index = index
        self.posture = posture


@dataclass(frozen=True, eq=False)
class Arm:
    """One robot arm.

    Attributes:
        name: in sentences.
        axes: ABB's numbers of the joints, from the foot to the flange; the seventh is ``eax_a`` of a jointtarget.
        turns_about: the direction of each joint in the all-zero pose: 0 x, 1 y, 2 z of the foot.
        offsets: in front of each joint and of tool0, in the all-zero pose [m], (k+1, 3).
        foot_to_world: where the foot stands.
        limits: ranges, speeds and accelerations of the joints.
        home: where it stands at first [rad].
        reference: the direction in the foot frame that the arm angle is counted from; None with six joints.
        configuration: RAPID's ``confdata`` of a posture.
        tool_speed: the highest of the tool [m/s].
        tool_acceleration: the highest of the tool [m/s²].
        find_postures: all postures within the limits of a pose of tool0 in the world and an arm angle [rad].
        is_of_yumi: whether it is one of an IRB 14000.
        wrist: index of the joint that puts the two beside it in line at zero: a spherical wrist's axis 5.
    """

    name: str
    axes: tuple[int, ...]
    turns_about: tuple[int, ...]
    offsets: Array
    foot_to_world: Pose
    limits: JointLimits
    home: Joints
    reference: Vector | None
    configuration: Callable[[Joints], Configuration]
    tool_speed: float
    tool_acceleration: float
    find_postures: Postures
    is_of_yumi: bool = False
    wrist: int | None = None

    @property
    def joint_count(self) -> int:
        """How many joints there are, k."""
        return len(self.axes)

    @cached_property
    def _foot_rotation(self) -> Array:
        return matrix(self.foot_to_world.orientation)

    @cached_property
    def _tool0(self) -> Array:
        """Orientation of tool0 in the all-zero pose: z forward, along the foot's x."""
        return np.array([(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)])

    # Forward ------------------------------------------------------------------------------------------------------

    def chain(self, positions: Array) -> tuple[Array, Array, Array, Array]:
        """In the foot frame: points on the axes, their directions (n, k, 3), tool0 (n, 3), its rotation (n, 3, 3)."""
        count = len(positions)
        sines, cosines = np.sin(positions), np.cos(positions)
        rotation = np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
        point = np.zeros((count, 3))
        points, axes = np.empty((count, self.joint_count, 3)), np.empty((count, self.joint_count, 3))
        for index, axis in enumerate(self.turns_about):
            point = point + rotation @ self.offsets[index]
            points[:, index], axes[:, index] = point, rotation[:, :, axis]
            # A turn about one axis mixes the other two columns.
            second, third = (axis + 1) % 3, (axis + 2) % 3
            sine, cosine = sines[:, index, None], cosines[:, index, None]
            before, after = rotation[:, :, second].copy(), rotation[:, :, third].copy()
            rotation[:, :, second] = cosine * before + sine * after
            rotation[:, :, third] = cosine * after - sine * before
        return points, axes, point + rotation @ self.offsets[-1], rotation @ self._tool0

    def forward(self, positions: Array) -> tuple[Array, Array]:
        """Where tool0 is in the world: positions [m], (n, 3), and rotations, (n, 3, 3), of joint positions, (n, k)."""
        _, _, tip, rotation = self.chain(positions)
        foot = self._foot_rotation
        return tip @ foot.T + np.array(self.foot_to_world.position), foot @ rotation

    def tool0(self, position: Joints) -> Pose:
        """Where tool0 is in the world."""
        points, rotations = self.forward(np.array([position]))
        x, y, z = points[0].tolist()
        return Pose((x, y, z), quaternion_from_matrix(rotations[0]))

    def angles(self, positions: Array) -> Array:
        """The arm angles [rad], (n,); zeros with six joints."""
        if self.reference is None:
            return np.zeros(len(positions))
        points, axes, _, _ = self.chain(positions)
        line = points[:, _WRIST_AXIS] - points[:, 0]
        line = line / np.linalg.norm(line, axis=1, keepdims=True)
        reference, elbow = np.array(self.reference), axes[:, _ELBOW_AXIS]
        along = np.sum(elbow * line, 1)
        sine, cosine = np.sum(_cross(line, reference) * elbow, 1), elbow @ reference - along * (line @ reference)
        return _wrapped(np.arctan2(sine, cosine) + pi / 2.0)

    # Inverse ------------------------------------------------------------------------------------------------------

    def postures(self, tool0: Pose, angle: float) -> tuple[Joints, ...]:
        """All postures within the limits, those of least joint angles first; found ones are remembered."""
        return _remembered(self, tool0, angle)

    def follow(self, points: Array, rotations: Array, angles: Array, start: Joints) -> Array:
        """The joint positions that bring tool0 along a path of close poses, without a change of the branch.

        Args:
            points: positions of tool0 in the world [m], (n, 3).
            rotations: its rotations, (n, 3, 3).
            angles: arm angles [rad], (n,); not looked at with six joints.
            start: the posture the path begins beside [rad].

        Returns:
            Joint positions [rad], (n, k); limits are not looked at.

        Raises:
            Lost: the path goes out of reach, or through a singularity.
        """
        result = np.empty((len(points), self.joint_count))
        done, before = 0, np.array(start)
        while done < len(points):
            window = slice(done, done + _WINDOW)
            found, is_reached = self._solved(points[window], rotations[window], angles[window], before)
            steps = np.max(np.abs(np.diff(np.concatenate([before[None], found]), axis=0)), 1)
            follows = is_reached & (steps < _LONGEST_STEP)
            count = len(found) if bool(follows.all()) else int(np.argmin(follows))
            if count == 0:
                raise Lost(done, cast("Joints", tuple(before.tolist())))
            result[done : done + count] = found[:count]
            before = found[count - 1]
            done += count
        return result

    def reached(self, points: Array, rotations: Array, angle: float, start: Joints) -> Joints | None:
        """The posture of one pose, (1, 3) and (1, 3, 3), that Newton's method finds from another one, within limits."""
        found, is_reached = self._solved(points, rotations, np.array([angle]), np.array(start))
        position = cast("Joints", tuple(found[0].tolist()))
        return position if bool(is_reached[0]) and self.limits.outside(position) is None else None

    def _solved(self, points: Array, rotations: Array, angles: Array, start: Array) -> tuple[Array, Array]:
        """Newton's method from one posture to all poses: joint positions (n, k), and which have converged (n,)."""
        foot = self._foot_rotation
        points = (points - np.array(self.foot_to_world.position)) @ foot
        rotations = foot.T @ rotations
        at = np.repeat(start[None], len(points), 0)
        is_reached = np.zeros(len(points), dtype=bool)
        for _ in range(_ITERATIONS):
            missing, derivative = self._missing(at, points, rotations, angles)
            is_reached = np.max(np.abs(missing), 1) < _CONVERGED
            if bool(is_reached.all()):
                break
            # Damped where it is singular; exact elsewhere, as the damping is below what counts.
            transposed = np.swapaxes(derivative, 1, 2)
            square = derivative @ transposed + 1e-12 * np.eye(derivative.shape[1])
            step = (transposed @ np.linalg.solve(square, missing[..., None]))[..., 0]
            largest = np.max(np.abs(step), 1)
            at = at + step * np.minimum(1.0, _LONGEST_NEWTON_STEP / np.maximum(largest, 1e-30))[:, None]
        return at, is_reached

    def _missing(self, at: Array, points: Array, rotations: Array, angles: Array) -> tuple[Array, Array]:
        """What is missing to poses in the foot frame, (n, k), and how it shrinks with the joints, (n, k, k)."""
        origins, axes, tip, rotation = self.chain(at)
        turn = rotations @ np.swapaxes(rotation, 1, 2)
        missing = np.concatenate([points - tip, rotation_vectors(turn)], 1)
        if self.reference is None:
            rows = [np.swapaxes(_cross(axes, tip[:, None] - origins), 1, 2), np.swapaxes(axes, 1, 2)]
            return missing, np.concatenate(rows, 1)
        # The arm angle and its derivative: x and y of the elbow's axis, seen along the line from shoulder to wrist.
        reference, elbow, wrist = np.array(self.reference), axes[:, _ELBOW_AXIS], origins[:, _WRIST_AXIS]
        from_shoulder = wrist - origins[:, 0]
        length = np.linalg.norm(from_shoulder, axis=1)[:, None]
        line = from_shoulder / length
        normal, across = _cross(line, reference), _cross(reference, elbow)
        along, along_reference = np.sum(line * elbow, 1)[:, None], (line @ reference)[:, None]
        y, x = np.sum(normal * elbow, 1)[:, None], (elbow @ reference)[:, None] - along * along_reference
        d_tip, d_wrist = _cross(axes, np.stack([tip, wrist])[:, :, None] - origins)
        d_line = (d_wrist - line[:, None] * _along(d_wrist, line)[..., None]) / length[:, None]
        d_elbow = np.zeros_like(axes)
        d_elbow[:, :_ELBOW_AXIS] = _cross(axes[:, :_ELBOW_AXIS], elbow[:, None])
        d_y = _along(d_line, across) + _along(d_elbow, normal)
        d_along = _along(d_elbow, line) + _along(d_line, elbow)
        d_x = d_elbow @ reference - d_along * along_reference - along * (d_line @ reference)
        slope = (x * d_y - y * d_x) / np.maximum(x * x + y * y, 1e-30)
        angle = np.arctan2(y, x)[:, 0] + pi / 2.0
        missing = np.concatenate([missing, _wrapped(angles - angle)[:, None]], 1)
        rows = [np.swapaxes(d_tip, 1, 2), np.swapaxes(axes, 1, 2), slope[:, None]]
        return missing, np.concatenate(rows, 1)

    # Configurations -----------------------------------------------------------------------------------------------

    def has_configuration(self, position: Joints, wanted: Configuration) -> bool:
        """Whether a posture is of a configuration; beside the border between two it is of both."""
        here = self.configuration(position)
        if here == wanted:
            return True
        nearby = [
            self.configuration(cast("Joints", tuple(v + sign * _SAME_CONFIGURATION for v in position)))
            for sign in (-1.0, 1.0)
        ]
        fits = all(
            getattr(wanted, name) in {getattr(each, name) for each in (here, *nearby)} for name in ("cf1", "cf4", "cf6")
        )
        return fits and wanted.cfx in {each.cfx for each in (here, *nearby)}

    def is_beside_configuration(self, position: Joints, wanted: Configuration) -> bool:
        """Whether axes 1, 4 and 6 of a posture are at most a quarter turn beside those of a configuration."""
        here = self.configuration(position)
        return all(abs(getattr(here, name) - getattr(wanted, name)) <= 1 for name in ("cf1", "cf4", "cf6"))


def _along(vectors: Array, direction: Array) -> Array:
    """Scalar products, (n, k), of vectors, (n, k, 3), and one direction each, (n, 3)."""
    return np.asarray((vectors @ direction[:, :, None])[..., 0])


def _cross(a: Array, b: Array) -> Array:
    """Cross products along the last axis, of few vectors in half of NumPy's time: a line takes thousands."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    a0, a1, a2, b0, b1, b2 = a[..., 0], a[..., 1], a[..., 2], b[..., 0], b[..., 1], b[..., 2]
    result[..., 0] = a1 * b2 - a2 * b1
    result[..., 1] = a2 * b0 - a0 * b2
    result[..., 2] = a0 * b1 - a1 * b0
    return result


def rotation_vectors(rotations: Array) -> Array:
    """Axis times angle [rad] of rotations, (n, 3), for (n, 3, 3); the axis of a half turn is one of the two."""
    vector = 0.5 * np.stack(
        [
            rotations[:, 2, 1] - rotations[:, 1, 2],
            rotations[:, 0, 2] - rotations[:, 2, 0],
            rotations[:, 1, 0] - rotations[:, 0, 1],
        ],
        -1,
    )
    sine, cosine = np.linalg.norm(vector, axis=1), (np.trace(rotations, axis1=1, axis2=2) - 1.0) / 2.0
    angle = np.arctan2(sine, cosine)
    result = vector * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)[:, None]
    for index in np.flatnonzero((sine < 1e-6) & (cosine < 0.0)):  # half a turn: the axis is in the symmetric part
        _, x, y, z = quaternion_from_matrix(rotations[index])
        result[index] = np.array((x, y, z)) / max(sqrt(x * x + y * y + z * z), 1e-30) * angle[index]
    return np.asarray(result)


def rotations_about(vectors: Array) -> Array:
    """Rotations, (n, 3, 3), of axis times angle [rad], (n, 3)."""
    angle = np.linalg.norm(vectors, axis=1)
    axis = vectors / np.maximum(angle, 1e-30)[:, None]
    cross = np.zeros((len(vectors), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -axis[:, 2], axis[:, 1], -axis[:, 0]
    cross -= np.swapaxes(cross, 1, 2)
    sine, versine = np.sin(angle)[:, None, None], (1.0 - np.cos(angle))[:, None, None]
    return np.asarray(np.eye(3) + sine * cross + versine * (cross @ cross))


def _wrapped(angles: Array) -> Array:
    return np.asarray((angles + pi) % tau - pi)


@lru_cache(512)
def _remembered(arm: Arm, tool0: Pose, angle: float) -> tuple[Joints, ...]:
    return arm.find_postures(tool0, angle)


# The arms of a YuMi, and its arm alone (IRB 14050) --------------------------------------------------------------------

_YUMI_OFFSETS = np.array(
    [
        (0.0, 0.0, SHOULDER_HEIGHT),
        (-SHOULDER_OFFSET, 0.0, 0.0),
        (SHOULDER_OFFSET, 0.0, 0.0),
        (ELBOW_OFFSET, 0.0, UPPER_ARM),
        (0.0, 0.0, ELBOW_OFFSET),
        (FOREARM, 0.0, -WRIST_OFFSET),
        (0.0, 0.0, WRIST_OFFSET),
        (FLANGE, 0.0, 0.0),
    ]
)
_YUMI_TURNS = (_Z, _Y, _Z, _Y, _X, _Y, _X)


@cache
def yumi_arm(side: Side, limits: JointLimits = YUMI_LIMITS) -> Arm:
    """One arm of an IRB 14000; the world is the body frame."""
    x, y, z = (matrix(foot_to_body(side).orientation).T @ (0.0, 1.0 if side is Side.RIGHT else -1.0, 0.0)).tolist()
    return Arm(
        f"{side.word} arm",
        CHAIN_AXES,
        _YUMI_TURNS,
        _YUMI_OFFSETS,
        foot_to_body(side),
        limits,
        home(side),
        (x, y, z),
        configuration,
        1.5,
        11.0,
        lambda tool0, angle: postures(side, tool0, angle, limits),
        is_of_yumi=True,
    )


@cache
def irb14050() -> Arm:
    """The single-arm YuMi: the arm of an IRB 14000 on its foot, its arm angle counted from the foot's z axis."""
    to_body, body_reference = foot_to_body(Side.LEFT), np.array(yumi_arm(Side.LEFT).reference)
    z = np.array([0.0, 0.0, 1.0])

    def find(tool0: Pose, angle: float) -> tuple[Joints, ...]:
        # The same half-plane of the elbow, counted from the direction that an IRB 14000's arm counts from.
        turned = matrix(tool0.orientation)
        wrist = np.array(tool0.position) - turned[:, _Z] * FLANGE
        line = (wrist - _YUMI_OFFSETS[0]) / np.linalg.norm(wrist - _YUMI_OFFSETS[0])
        across = _cross(line, z)
        across = across / np.linalg.norm(across)
        inside = _cross(across, line) * cos(angle - pi / 2.0) + across * sin(angle - pi / 2.0)
        other = _cross(line, body_reference)
        other = other / np.linalg.norm(other)
        counted = atan2(float(inside @ other), float(inside @ _cross(other, line))) + pi / 2.0
        return postures(Side.LEFT, compose(to_body, tool0), float((counted + pi) % tau - pi))

    return Arm(
        "robot",
        CHAIN_AXES,
        _YUMI_TURNS,
        _YUMI_OFFSETS,
        Pose((0.0, 0.0, 0.0), IDENTITY),
        YUMI_LIMITS,
        home(Side.LEFT),
        (0.0, 0.0, 1.0),
        configuration,
        1.5,
        11.0,
        find,
    )


# A robot of six axes with a spherical wrist (IRB 120) -----------------------------------------------------------------

# Lengths of an IRB 120-3/0.6 [m] (reference/robots.md).
_BASE, _LOWER_ARM, _ELBOW_RISE, _FOREARM, _FLANGE = 0.290, 0.270, 0.070, 0.302, 0.072
_REACH = hypot(_FOREARM, _ELBOW_RISE)
_ELBOW_ANGLE = atan2(_FOREARM, _ELBOW_RISE)  # from the lower arm's direction to the wrist, all joints at zero

# Ranges and speeds: ABB's; accelerations and jerks: ours, as ABB publishes none.
IRB120_LIMITS = JointLimits(
    lower=cast("Joints", tuple(map(radians, (-165.0, -110.0, -110.0, -160.0, -120.0, -400.0)))),
    upper=cast("Joints", tuple(map(radians, (165.0, 110.0, 70.0, 160.0, 120.0, 400.0)))),
    velocity=cast("Joints", tuple(map(radians, (250.0, 250.0, 250.0, 320.0, 320.0, 420.0)))),
    acceleration=cast("Joints", (25.0, 25.0, 25.0, 50.0, 50.0, 50.0)),
    jerk=cast("Joints", (400.0, 400.0, 400.0, 800.0, 800.0, 800.0)),
)


def six_axis_configuration(position: Joints) -> Configuration:
    """RAPID's confdata of an IRB 120: quarter turns of axes 1, 4 and 6, and one of eight branches.

    The branch adds 4 where the wrist is behind axis 1, 2 where it is behind the lower arm, 1 where axis 5 is negative.
    """
    a1, a2, a3, a4, a5, a6 = position  # type: ignore[misc]  # an arm of six joints
    wrist_ahead = _LOWER_ARM * sin(a2) + _REACH * sin(a2 + a3 + _ELBOW_ANGLE)
    cfx = 4 * (wrist_ahead < 0.0) + 2 * (sin(a3 + _ELBOW_ANGLE) < 0.0) + (a5 < -CONFIGURATION_TOLERANCE)
    return Configuration(quarter_turn(a1), quarter_turn(a4), quarter_turn(a6), cfx)


def _six_axis_postures(tool0: Pose, limits: JointLimits) -> tuple[Joints, ...]:
    """In closed form: two ways to face the wrist, two elbows, two wrists, and full turns within the limits."""
    rotation = matrix(tool0.orientation)
    wrist = np.array(tool0.position) - rotation[:, _Z] * _FLANGE
    ahead, up = hypot(float(wrist[0]), float(wrist[1])), float(wrist[2]) - _BASE
    facing = atan2(float(wrist[1]), float(wrist[0]))
    distance = ahead * ahead + up * up
    cosine = (distance - _LOWER_ARM**2 - _REACH**2) / (2.0 * _LOWER_ARM * _REACH)
    if abs(cosine) > 1.0:
        return ()
    found = []
    for a1, forward in ((facing, ahead), (facing + pi, -ahead)):
        for inner in (acos(cosine), -acos(cosine)):
            a3 = inner - _ELBOW_ANGLE
            a2 = atan2(forward, up) - atan2(_REACH * sin(inner), _LOWER_ARM + _REACH * cos(inner))
            # What is left for the wrist: Rx(a4) Ry(a5) Rx(a6).
            left = _turn(_Y, -(a2 + a3)) @ _turn(_Z, -a1) @ rotation @ _TOOL0_AT_ZERO.T
            tilt = atan2(hypot(left[0, 1], left[0, 2]), left[0, 0])
            for a5 in (tilt, -tilt):
                sign = 1.0 if a5 >= 0.0 else -1.0
                if tilt < _ALIGNED:  # axes 4 and 6 are in line: axis 4 stays at zero
                    a4, a6 = 0.0, atan2(left[2, 1], left[1, 1])
                else:
                    a4 = atan2(sign * left[1, 0], -sign * left[2, 0])
                    a6 = atan2(sign * left[0, 1], sign * left[0, 2])
                found += _full_turns((a1, a2, a3, a4, a5, a6), limits)
    return tuple(dict.fromkeys(sorted(found, key=lambda each: max(map(abs, each)))))


_ALIGNED = 1e-9  # [rad] of axis 5
_TOOL0_AT_ZERO = np.array([(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)])


def _turn(axis: int, angle: float) -> Array:
    vector = np.zeros((1, 3))
    vector[0, axis] = angle
    return np.asarray(rotations_about(vector)[0])


def _full_turns(position: tuple[float, ...], limits: JointLimits) -> list[Joints]:
    choices = [
        [
            turned
            for turns in (-2, -1, 0, 1, 2)
            if low - _ROUNDING <= (turned := value + turns * tau) <= high + _ROUNDING
        ]
        for value, low, high in zip(position, limits.lower, limits.upper, strict=True)
    ]
    return [cast("Joints", each) for each in product(*choices)]


@cache
def irb120() -> Arm:
    """An IRB 120-3/0.6."""
    offsets = (
        (0.0, 0.0, _BASE),
        (0.0, 0.0, 0.0),
        (0.0, 0.0, _LOWER_ARM),
        (0.0, 0.0, _ELBOW_RISE),
        (_FOREARM, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (_FLANGE, 0.0, 0.0),
    )
    return Arm(
        "robot",
        (1, 2, 3, 4, 5, 6),
        (_Z, _Y, _Y, _X, _Y, _X),
        np.array(offsets),
        Pose((0.0, 0.0, 0.0), IDENTITY),
        IRB120_LIMITS,
        cast("Joints", (0.0, 0.0, 0.0, 0.0, radians(30.0), 0.0)),
        None,
        six_axis_configuration,
        6.2,
        28.0,
        lambda tool0, _: _six_axis_postures(tool0, IRB120_LIMITS),
        wrist=4,
    )
