"""Rotations as axis times angle and as matrices, angles within half a turn, cross products: many at once, by NumPy."""

from __future__ import annotations

from math import pi, sqrt, tau

import numpy as np
from numpy.typing import NDArray

from abb_protocols.robot.kinematics import quaternion_from_matrix

_Array = NDArray[np.float64]


def cross(a: _Array, b: _Array) -> _Array:
    """Cross products along the last axis, of few vectors in half of NumPy's time: a line takes thousands."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    a0, a1, a2, b0, b1, b2 = a[..., 0], a[..., 1], a[..., 2], b[..., 0], b[..., 1], b[..., 2]
    result[..., 0] = a1 * b2 - a2 * b1
    result[..., 1] = a2 * b0 - a0 * b2
    result[..., 2] = a0 * b1 - a1 * b0
    return result


def rotation_vectors(rotations: _Array) -> _Array:
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


def rotations_about(vectors: _Array) -> _Array:
    """Rotations, (n, 3, 3), of axis times angle [rad], (n, 3)."""
    angle = np.linalg.norm(vectors, axis=1)
    axis = vectors / np.maximum(angle, 1e-30)[:, None]
    cross = np.zeros((len(vectors), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -axis[:, 2], axis[:, 1], -axis[:, 0]
    cross -= np.swapaxes(cross, 1, 2)
    sine, versine = np.sin(angle)[:, None, None], (1.0 - np.cos(angle))[:, None, None]
    return np.asarray(np.eye(3) + sine * cross + versine * (cross @ cross))


def wrapped_angles(angles: _Array) -> _Array:
    """Angles [rad] from -π to π."""
    return np.asarray((angles + pi) % tau - pi)
