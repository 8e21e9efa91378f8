"""Robot arms as data: a chain of turning axes with its limits, for the two arms of a YuMi and for other robots.

An `Arm` says where tool0 is for joint positions, which postures have a pose, and which joint positions follow a path of
poses from a posture. Everything is seen from the robot's base frame, which RAPID calls world here, for many postures at
once: arrays begin with the number of postures, n; the arm has k joints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from math import pi, sqrt, tau
from typing import cast

import numpy as np
from numpy.typing import NDArray

from yumi.errors import YumiError
from yumi.robot.inverse_kinematics import Configuration, configuration, postures
from yumi.robot.joints import CHAIN_AXES, YUMI_LIMITS, JointLimits, Joints, Pose, Side, Vector, home
from yumi.robot.kinematics import (
    ELBOW_OFFSET,
    FLANGE,
    FOREARM,
    SHOULDER_HEIGHT,
    SHOULDER_OFFSET,
    UPPER_ARM,
    WRIST_OFFSET,
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
_ROUNDING = 1e-9  # of a quarter turn: 90° after a calculation is not less than 90°
_SAME_CONFIGURATION = 0.02  # [rad] beside the border of a quarter turn or branch, where a position counts to both


class Lost(YumiError):
    """A path of poses cannot be followed.

    Attributes:
        index: the first pose that is not reached.
        posture: the joint positions before it [rad].
    """

    def __init__(self, index: int, posture: Joints) -> None:
        super().__init__(f"The arm cannot follow the path beyond its pose {index}.")
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
        sine, cosine = np.sum(np.cross(line, reference) * elbow, 1), elbow @ reference - along * (line @ reference)
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
        rows = [np.swapaxes(np.cross(axes, tip[:, None] - origins), 1, 2), np.swapaxes(axes, 1, 2)]
        if self.reference is None:
            return missing, np.concatenate(rows, 1)
        size, count = 1e-6, self.joint_count
        beside = np.concatenate([at[:, None], at[:, None] + size * np.eye(count)], 1).reshape(-1, count)
        all_angles = self.angles(beside).reshape(len(at), count + 1)
        slope = _wrapped(all_angles[:, 1:] - all_angles[:, :1]) / size
        missing = np.concatenate([missing, _wrapped(angles - all_angles[:, 0])[:, None]], 1)
        return missing, np.concatenate([*rows, slope[:, None]], 1)

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
    )
