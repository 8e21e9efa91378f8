"""A chain of turning joints, for many positions at once by NumPy: where its axes and its end are, and how that changes.

Everything is seen from the chain's foot. Arrays begin with the number of positions, n; the chain has k joints.
:mod:`abb_protocols.robot.kinematics` has one position of a YuMi's arm in plain numbers, which takes a tenth of the
time.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from numpy.typing import NDArray

from abb_protocols.robot.joints import Vector
from abb_protocols.robot.rotations import cross, rotation_vectors, wrapped_angles

_Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Chain:
    """Joints one after the other; in the all-zero pose each turns about an axis of the foot.

    Attributes:
        turns_about: the direction of each joint in the all-zero pose: 0 x, 1 y, 2 z of the foot.
        offsets: in front of each joint and of the end, in the all-zero pose [m], (k+1, 3).
        end: orientation of the end in the all-zero pose, (3, 3).
        reference: the direction that the arm angle is counted from; None of a chain that has none.
        elbow: index of the joint whose direction the arm angle is of.
        wrist: index of the joint where the line ends that the elbow turns about, and that begins at the first one.
    """

    turns_about: tuple[int, ...]
    offsets: _Array
    end: _Array
    reference: Vector | None = None
    elbow: int = 0
    wrist: int = 0

    @property
    def joint_count(self) -> int:
        """How many joints there are, k."""
        return len(self.turns_about)

    def places(self, positions: _Array) -> tuple[_Array, _Array, _Array, _Array]:
        """Points on the axes and their directions (n, k, 3), the end (n, 3) and its rotation (n, 3, 3)."""
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
        return points, axes, point + rotation @ self.offsets[-1], rotation @ self.end

    def angles(self, positions: _Array) -> _Array:
        """The arm angles [rad], (n,); zeros of a chain that has none."""
        if self.reference is None:
            return np.zeros(len(positions))
        points, axes, _, _ = self.places(positions)
        line = points[:, self.wrist] - points[:, 0]
        line = line / np.linalg.norm(line, axis=1, keepdims=True)
        reference, elbow = np.array(self.reference), axes[:, self.elbow]
        along = np.sum(elbow * line, 1)
        sine, cosine = np.sum(cross(line, reference) * elbow, 1), elbow @ reference - along * (line @ reference)
        return wrapped_angles(np.arctan2(sine, cosine) + pi / 2.0)

    def missing(self, positions: _Array, points: _Array, rotations: _Array, angles: _Array) -> tuple[_Array, _Array]:
        """What is missing to poses of the end and arm angles, and how it shrinks with the joints.

        Args:
            positions: of the joints [rad], (n, k).
            points: where the end is to be [m], (n, 3).
            rotations: how it is to be turned, (n, 3, 3).
            angles: the arm angles [rad], (n,); not looked at by a chain that has none.

        Returns:
            Position [m], rotation [rad] and arm angle [rad] missing, (n, k), and their derivatives, (n, k, k).
        """
        origins, axes, tip, rotation = self.places(positions)
        missing = [points - tip, rotation_vectors(rotations @ np.swapaxes(rotation, 1, 2))]
        if self.reference is None:
            rows = [np.swapaxes(cross(axes, tip[:, None] - origins), 1, 2), np.swapaxes(axes, 1, 2)]
            return np.concatenate(missing, 1), np.concatenate(rows, 1)
        # The arm angle and its derivative: x and y of the elbow's axis, seen along the line from shoulder to wrist.
        reference, elbow, wrist = np.array(self.reference), axes[:, self.elbow], origins[:, self.wrist]
        from_shoulder = wrist - origins[:, 0]
        length = np.linalg.norm(from_shoulder, axis=1)[:, None]
        line = from_shoulder / length
        normal, across = cross(line, reference), cross(reference, elbow)
        along, along_reference = np.sum(line * elbow, 1)[:, None], (line @ reference)[:, None]
        y, x = np.sum(normal * elbow, 1)[:, None], (elbow @ reference)[:, None] - along * along_reference
        d_tip, d_wrist = cross(axes, np.stack([tip, wrist])[:, :, None] - origins)
        d_line = (d_wrist - line[:, None] * _along(d_wrist, line)[..., None]) / length[:, None]
        d_elbow = np.zeros_like(axes)
        d_elbow[:, : self.elbow] = cross(axes[:, : self.elbow], elbow[:, None])
        d_y = _along(d_line, across) + _along(d_elbow, normal)
        d_along = _along(d_elbow, line) + _along(d_line, elbow)
        d_x = d_elbow @ reference - d_along * along_reference - along * (d_line @ reference)
        slope = (x * d_y - y * d_x) / np.maximum(x * x + y * y, 1e-30)
        missing.append(wrapped_angles(angles - np.arctan2(y, x)[:, 0] - pi / 2.0)[:, None])
        rows = [np.swapaxes(d_tip, 1, 2), np.swapaxes(axes, 1, 2), slope[:, None]]
        return np.concatenate(missing, 1), np.concatenate(rows, 1)


def _along(vectors: _Array, direction: _Array) -> _Array:
    """Scalar products, (n, k), of vectors, (n, k, 3), and one direction each, (n, 3)."""
    return np.asarray((vectors @ direction[:, :, None])[..., 0])
