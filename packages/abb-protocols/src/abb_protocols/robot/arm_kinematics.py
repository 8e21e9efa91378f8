"""Robot arms as data: a chain of turning axes with its limits and its place, and the paths of poses it can follow.

An `Arm` says where tool0 is for joint positions, which postures have a pose, and which joint positions follow a path of
poses from a posture. Everything is seen from the robot's base frame, which RAPID calls world here, for many postures at
once: arrays begin with the number of postures, n; the arm has k joints.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from abb_protocols.catalogue import message
from abb_protocols.errors import YumiError
from abb_protocols.robot.chain import Chain
from abb_protocols.robot.confdata import Confdata
from abb_protocols.robot.joints import JointLimits, Joints, Pose
from abb_protocols.robot.kinematics import matrix_from_quaternion, quaternion_from_matrix

_Array = NDArray[np.float64]
_Postures = Callable[[Pose, float], tuple[Joints, ...]]

_CONVERGED = 1e-9  # [m], [rad]
_ITERATIONS = 12
_LONGEST_NEWTON_STEP = 0.5  # [rad]
_LONGEST_STEP = 0.25  # [rad] of a joint from one pose of a path to the next, where the arm follows them
_WINDOW = 48  # poses that are solved together
_SAME_CONFIGURATION = 0.02  # [rad] beside the border of a quarter turn or branch, where a position counts to both


class PathLost(YumiError):
    """A path of poses cannot be followed.

    Attributes:
        index: the first pose that is not reached.
    """

    def __init__(self, index: int) -> None:
        super().__init__(message("path_lost", pose=index))
        self.index = index


@dataclass(frozen=True, eq=False, kw_only=True)
class KinematicArm(Chain):
    """One robot arm: the chain to tool0, whose foot is bolted somewhere.

    Attributes:
        name: in sentences.
        axes: ABB's numbers of the joints, from the foot to the flange; the seventh is ``eax_a`` of a jointtarget.
        foot_to_world: where the foot stands.
        limits: ranges, speeds and accelerations of the joints.
        home: where it stands at first [rad].
        configuration: RAPID's ``confdata`` of a posture.
        tool_speed: the highest of the tool [m/s].
        tool_acceleration: the highest of the tool [m/s²].
        find_postures: all postures within the limits of a pose of tool0 in the world and an arm angle [rad].
        is_of_yumi: whether it is one of an IRB 14000.
        spherical_wrist: index of the joint that puts the two beside it in line at zero: axis 5 of such a wrist.
    """

    name: str
    axes: tuple[int, ...]
    foot_to_world: Pose
    limits: JointLimits
    home: Joints
    configuration: Callable[[Joints], Confdata]
    tool_speed: float
    tool_acceleration: float
    find_postures: _Postures
    is_of_yumi: bool = False
    spherical_wrist: int | None = None

    @cached_property
    def _foot_rotation(self) -> _Array:
        return matrix_from_quaternion(self.foot_to_world.orientation)

    # Forward ------------------------------------------------------------------------------------------------------

    def forward(self, positions: _Array) -> tuple[_Array, _Array]:
        """Where tool0 is in the world: positions [m], (n, 3), and rotations, (n, 3, 3), of joint positions, (n, k)."""
        _, _, tip, rotation = self.places(positions)
        foot = self._foot_rotation
        return tip @ foot.T + np.array(self.foot_to_world.position), foot @ rotation

    def tool0(self, position: Joints) -> Pose:
        """Where tool0 is in the world."""
        points, rotations = self.forward(np.array([position]))
        x, y, z = points[0].tolist()
        return Pose((x, y, z), quaternion_from_matrix(rotations[0]))

    # Inverse ------------------------------------------------------------------------------------------------------

    def postures(self, tool0: Pose, angle: float) -> tuple[Joints, ...]:
        """All postures within the limits, those of least joint angles first; found ones are remembered."""
        return _remembered(self, tool0, angle)

    def follow(self, points: _Array, rotations: _Array, angles: _Array, start: Joints) -> _Array:
        """The joint positions that bring tool0 along a path of close poses, without a change of the branch.

        Args:
            points: positions of tool0 in the world [m], (n, 3).
            rotations: its rotations, (n, 3, 3).
            angles: arm angles [rad], (n,); not looked at with six joints.
            start: the posture the path begins beside [rad].

        Returns:
            Joint positions [rad], (n, k); limits are not looked at.

        Raises:
            PathLost: the path goes out of reach, or through a singularity.
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
                raise PathLost(done)
            result[done : done + count] = found[:count]
            before = found[count - 1]
            done += count
        return result

    def reached(self, points: _Array, rotations: _Array, angle: float, start: Joints) -> Joints | None:
        """The posture of one pose, (1, 3) and (1, 3, 3), that Newton's method finds from another one, within limits."""
        found, is_reached = self._solved(points, rotations, np.array([angle]), np.array(start))
        position = tuple(found[0].tolist())
        return position if bool(is_reached[0]) and self.limits.outside(position) is None else None

    def _solved(self, points: _Array, rotations: _Array, angles: _Array, start: _Array) -> tuple[_Array, _Array]:
        """Newton's method from one posture to all poses: joint positions (n, k), and which have converged (n,)."""
        foot = self._foot_rotation
        points = (points - np.array(self.foot_to_world.position)) @ foot
        rotations = foot.T @ rotations
        at = np.repeat(start[None], len(points), 0)
        is_reached = np.zeros(len(points), dtype=bool)
        for _ in range(_ITERATIONS):
            missing, derivative = self.missing(at, points, rotations, angles)
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

    # Configurations -----------------------------------------------------------------------------------------------

    def has_configuration(self, position: Joints, wanted: Confdata) -> bool:
        """Whether a posture is of a configuration; beside the border between two it is of both."""
        here = self.configuration(position)
        if here == wanted:
            return True
        nearby = [self.configuration(tuple(v + sign * _SAME_CONFIGURATION for v in position)) for sign in (-1.0, 1.0)]
        fits = all(
            getattr(wanted, name) in {getattr(each, name) for each in (here, *nearby)} for name in ("cf1", "cf4", "cf6")
        )
        return fits and wanted.cfx in {each.cfx for each in (here, *nearby)}

    def is_beside_configuration(self, position: Joints, wanted: Confdata) -> bool:
        """Whether axes 1, 4 and 6 of a posture are at most a quarter turn beside those of a configuration."""
        here = self.configuration(position)
        return all(abs(getattr(here, name) - getattr(wanted, name)) <= 1 for name in ("cf1", "cf4", "cf6"))


@lru_cache(512)
def _remembered(arm: KinematicArm, tool0: Pose, angle: float) -> tuple[Joints, ...]:
    return arm.find_postures(tool0, angle)
