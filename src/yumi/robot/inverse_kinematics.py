"""Inverse kinematics of one arm: every posture that brings tool0 to a pose with a given arm angle.

The pose and the arm angle are seven equations for seven joints. No two neighbouring axes of this arm meet, so there is
no closed form, but three facts reduce the seven unknowns to two (lengths as in :mod:`yumi.robot.kinematics`):

1. The arm angle says in which half-plane through shoulder S and wrist W the axis of joint 3 lies, so axis 7 follows
   from axes 1 and 2, and with it elbow point P on axis 3 and the direction e of that axis.
2. With d = W - P, C = d·n (n along axis 6) and Q = d·d, the distance gives axis 5 without solving anything:
   ``tan(a5 / 2) = (Q - elbow² - forearm²) / (2 wrist (forearm + C))``.
3. Two equations are left, both smooth in axes 1 and 2: ``d·e cos(a5/2) = wrist n·e sin(a5/2)`` and
   ``sin²(a4) + cos²(a4) = 1``, where ``n·e = sin(a4) sin(a5)`` and
   ``forearm cos(a5) + wrist sin(a5) - C = elbow cos(a4) sin(a5)``.

`postures` looks at the two equations on a grid over the ranges of axes 1 and 2, refines the cells that may hold a root,
and polishes each on all seven equations. Where axes are nearly in line (a2 = 0 or a5 = 0: the arm angle does not hold
them), postures lie closer together than the grid; these are found from each other, by turning the wrist or the shoulder
over and by following the curve on which six of the seven equations hold.

Poses are in the body frame, which RAPID and EGM call world; the arm angle is ``eax_a`` of a robtarget
(reference/yumi.md §5.2).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import floor, pi, tau
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from yumi.errors import CommandRefused
from yumi.robot.differential_kinematics import posture_near, wrist_target
from yumi.robot.joints import YUMI_LIMITS, JointLimits, Joints, Pose, Side, joints
from yumi.robot.kinematics import (
    ELBOW_OFFSET,
    FLANGE,
    FOREARM,
    SHOULDER_HEIGHT,
    SHOULDER_OFFSET,
    UPPER_ARM,
    WRIST_OFFSET,
    compose,
    foot_to_body,
    inverse,
    matrix,
)

Array = NDArray[np.float64]

_X, _Y, _Z = range(3)
# Each joint in the all-zero pose, from body to flange: the axis it turns about and the offset in front of it [m].
_AXES = (_Z, _Y, _Z, _Y, _X, _Y, _X)
_OFFSETS = np.array(
    [
        (0.0, 0.0, SHOULDER_HEIGHT),
        (-SHOULDER_OFFSET, 0.0, 0.0),
        (SHOULDER_OFFSET, 0.0, 0.0),
        (ELBOW_OFFSET, 0.0, UPPER_ARM),
        (0.0, 0.0, ELBOW_OFFSET),
        (FOREARM, 0.0, -WRIST_OFFSET),
        (0.0, 0.0, WRIST_OFFSET),
    ]
)
_SHOULDER = _OFFSETS[0]
_TOOL0_TO_AXIS_6 = np.array([(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)])  # Ry(90°): tool z along axis 6

_GRID = (128, 72)  # cells over the ranges of axes 1 and 2: 2.7° a cell
_GRID_MARGIN = 0.02  # [rad] beyond the ranges: a root on the edge lies inside a cell
_CELL_MARGIN = 0.75  # a cell may hold a root if zero is nearer to its values than this share of their spread
_NEARLY_SINGULAR = 0.01  # smallest singular value below which postures may lie closer together than a cell
_CONVERGED = 1e-12  # [m], [rad]: near a singularity a joint is off by a million times more
_SAME = 1e-7  # [rad]
_ROUNDING = 1e-9  # of a quarter turn: 90° after a calculation is not less than 90°


class Unreachable(CommandRefused):
    """No posture within the limits has the pose; the message says what is nearest."""


@dataclass(frozen=True, slots=True)
class _Target:
    """A pose and an arm angle in the foot frame.

    Attributes:
        wrist: where axis 6 starts, the flange's length behind tool0 [m], (3,).
        rotation: of axis 6's frame at a6 = 0; its first column runs along axis 6, (3, 3).
        angle: the arm angle [rad].
        reference: the direction the arm angle is counted from, (3,).
    """

    wrist: Array
    rotation: Array
    angle: float
    reference: Array


class Configuration(NamedTuple):
    """RAPID's ``confdata``: which of the postures of a pose and an arm angle is meant (reference/robots.md).

    Attributes:
        cf1: quarter turn of axis 1, rounded down: 0 from 0° to 90°, -1 from -90° to 0°.
        cf4: the same of axis 4.
        cf6: the same of axis 6.
        cfx: the branch, 0 to 7: 4 if a2 < 0°, 2 if a5 < 0°, 1 if a3 < -90°, added up.
    """

    cf1: int
    cf4: int
    cf6: int
    cfx: int


def configuration(position: Joints) -> Configuration:
    """The configuration of a posture [rad].

    Quarter turns rounded down are ABB's rule. Between two branches the arm passes a singularity.
    That a2 counts 4 and a3 counts 1 is inferred from public targets of YuMi arms, that a5 counts 2 from what is left;
    ABB's manual was not at hand.
    """
    a1, a2, _, a3, a4, a5, a6 = position
    cf1, cf4, cf6 = (floor(angle / (pi / 2.0) + _ROUNDING) for angle in (a1, a4, a6))
    return Configuration(cf1, cf4, cf6, cfx=4 * (a2 < 0.0) + 2 * (a5 < 0.0) + (a3 < -pi / 2.0))


def arm_angle(side: Side, position: Joints) -> float:
    """How far the elbow is turned about the line from shoulder to wrist, ``eax_a`` of a robtarget [rad], -π to π.

    Not defined where the line runs along the body's y axis or along axis 3; what is returned there is finite.
    """
    return arm_angle_from(_reference(side), position)


def arm_angle_from(reference: NDArray[np.float64], position: Joints) -> float:
    """The arm angle counted from another direction in the foot frame, (3,); a single-arm robot counts from z."""
    _, axes, wrist, _ = _chain(np.array([position]))
    line = _unit(wrist - _SHOULDER)[0]
    sine, cosine = (
        np.cross(line, reference) @ axes[0, 3],
        axes[0, 3] @ reference - (axes[0, 3] @ line) * (line @ reference),
    )
    return float(_wrapped(np.arctan2(sine, cosine) + pi / 2.0))


def jacobian(side: Side, position: Joints, tool: Pose | None = None) -> Array:
    """How the tool moves with the joints: velocity [m/s] and angular velocity [rad/s] of the tool frame, (6, 7).

    Args:
        side: the arm.
        position: joint positions in chain order [rad].
        tool: the tool's frame in tool0; None is tool0.

    Returns:
        Rows x, y, z of the velocity and of the angular velocity, in the body frame; columns in chain order.
    """
    points, axes, wrist, rotation = (value[0] for value in _chain(np.array([position])))
    tip = wrist + rotation[:, _X] * FLANGE
    if tool is not None:
        tip = tip + rotation @ _TOOL0_TO_AXIS_6 @ np.array(tool.position)
    foot = matrix(foot_to_body(side).orientation)
    return np.concatenate([foot @ np.cross(axes, tip - points).T, foot @ axes.T])


def postures(side: Side, tool0: Pose, angle: float, limits: JointLimits = YUMI_LIMITS) -> tuple[Joints, ...]:
    """All postures within the limits that bring tool0 to a pose with an arm angle.

    Args:
        side: the arm.
        tool0: pose of tool0 in the body frame.
        angle: the arm angle [rad].
        limits: the ranges of the joints. Joints that may turn further than once appear with each of their turns.

    Returns:
        Joint positions in chain order [rad], smallest largest joint angle first; none when the pose is out of reach.
        Exactly where axes 1 and 7 (a2 = 0) or 4 and 6 (a5 = 0) are in line, a whole curve of postures has the pose and
        the arm angle; one or more of them are returned.
    """
    target = _target(side, tool0, angle)
    found = _polished(_candidates(target), target)
    new = found
    while len(new):
        singular = np.linalg.svd(_residual(new, target)[1], compute_uv=False)[:, -1] < _NEARLY_SINGULAR
        more = _polished(np.concatenate([_turned_over(new), *_beside(new[singular], target)]), target)
        together = _distinct(np.concatenate([found, more]))
        found, new = together, together[len(found) :]
    within = [position for base in found for position in _turns(base, limits)]
    return tuple(sorted((joints(position) for position in within), key=lambda each: max(map(abs, each))))


def nearest_posture(side: Side, tool0: Pose, angle: float, seed: Joints, limits: JointLimits = YUMI_LIMITS) -> Joints:
    """The posture that continues from ``seed``: the same branch, for streams and paths of small steps.

    Args:
        side: the arm.
        tool0: pose of tool0 in the body frame.
        angle: the arm angle [rad].
        seed: the posture to continue from, chain order [rad].
        limits: the ranges of the joints.

    Raises:
        Unreachable: no posture of the pose is reached from the seed, or it is out of range; the message says by
            how much.
    """
    # Quickly where the arm is free; near singularities, and where there is no posture, with more care.
    result, miss = posture_near(side, wrist_target(side, tool0, angle), seed)
    if miss > _CONVERGED:
        position, error = _polish(np.array([seed]), _target(side, tool0, angle))
        result, miss = joints(position[0]), float(error[0])
    if miss > _CONVERGED:
        raise Unreachable(
            f"The {side.word} arm does not reach the pose from where it is: the nearest posture misses it by "
            f"{miss:.4f} (metres and radians). Choose a pose within reach, or another arm angle."
        )
    outside = limits.outside(result)
    if outside is not None:
        raise Unreachable(
            f"The {side.word} arm would leave the range of its joint {outside + 1} of 7 ({limits.range_deg(outside)}): "
            f"the pose needs {np.degrees(result[outside]):.1f}°. Choose another arm angle or configuration."
        )
    return result


def _target(side: Side, tool0: Pose, angle: float) -> _Target:
    in_foot = compose(inverse(foot_to_body(side)), tool0)
    rotation = matrix(in_foot.orientation) @ _TOOL0_TO_AXIS_6.T
    return _Target(np.array(in_foot.position) - rotation[:, _X] * FLANGE, rotation, angle, _reference(side))


def _reference(side: Side) -> Array:
    """The body's y axis, pointing to the other arm for the right arm and to the left arm's outside."""
    to_left = np.array([0.0, 1.0 if side is Side.RIGHT else -1.0, 0.0])
    return np.asarray(matrix(foot_to_body(side).orientation).T @ to_left)


# -- Forward kinematics and the seven equations, of n postures at once ------------------------------------------------


def _chain(positions: Array) -> tuple[Array, Array, Array, Array]:
    """In the foot frame: points on axes and their directions (n, 7, 3), wrist (n, 3), frame of axis 6 (n, 3, 3)."""
    count = len(positions)
    sines, cosines = np.sin(positions), np.cos(positions)
    rotation, point = np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3))
    points, axes = np.empty((count, 7, 3)), np.empty((count, 7, 3))
    for index, axis in enumerate(_AXES):
        point = point + rotation @ _OFFSETS[index]
        points[:, index], axes[:, index] = point, rotation[:, :, axis]
        # A turn about one axis mixes the other two columns.
        second, third = (axis + 1) % 3, (axis + 2) % 3
        sine, cosine = sines[:, index, None], cosines[:, index, None]
        turned = np.empty((count, 3, 3))
        turned[:, :, axis] = rotation[:, :, axis]
        turned[:, :, second] = cosine * rotation[:, :, second] + sine * rotation[:, :, third]
        turned[:, :, third] = cosine * rotation[:, :, third] - sine * rotation[:, :, second]
        rotation = turned
    return points, axes, point, rotation


def _residual(positions: Array, target: _Target) -> tuple[Array, Array]:
    """What is missing to the target, and how it shrinks with the joints.

    Returns:
        Position [m], rotation [rad] and arm angle [rad] missing, (n, 7), and their derivatives, (n, 7, 7).
    """
    points, axes, wrist, rotation = _chain(positions)
    turn = target.rotation @ np.swapaxes(rotation, 1, 2)
    vector = 0.5 * np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], -1
    )
    sine, cosine = np.linalg.norm(vector, axis=1), (np.trace(turn, axis1=1, axis2=2) - 1.0) / 2.0
    vector *= np.where(sine > 1e-9, np.arctan2(sine, cosine) / np.maximum(sine, 1e-9), 1.0)[:, None]

    from_shoulder = wrist - _SHOULDER
    length = np.linalg.norm(from_shoulder, axis=1)[:, None]
    line, elbow, reference = from_shoulder / length, axes[:, 3], target.reference
    normal = np.cross(line, reference)
    along, along_reference = np.sum(line * elbow, 1)[:, None], (line @ reference)[:, None]
    y, x = np.sum(normal * elbow, 1)[:, None], (elbow @ reference)[:, None] - along * along_reference
    missing = _wrapped(target.angle - np.arctan2(y, x) - pi / 2.0)

    d_wrist = np.cross(axes, wrist[:, None] - points)
    d_line = (d_wrist - line[:, None] * np.sum(d_wrist * line[:, None], 2, keepdims=True)) / length[:, None]
    d_elbow = np.zeros_like(axes)
    d_elbow[:, :3] = np.cross(axes[:, :3], elbow[:, None])
    d_y = np.sum(np.cross(d_line, reference) * elbow[:, None], 2) + np.sum(d_elbow * normal[:, None], 2)
    d_along = np.sum(d_elbow * line[:, None], 2) + np.sum(d_line * elbow[:, None], 2)
    d_x = d_elbow @ reference - d_along * along_reference - along * (d_line @ reference)
    d_angle = (x * d_y - y * d_x) / np.maximum(x * x + y * y, 1e-30)
    derivative = np.concatenate([np.swapaxes(d_wrist, 1, 2), np.swapaxes(axes, 1, 2), d_angle[:, None]], 1)
    return np.concatenate([target.wrist - wrist, vector, missing], 1), derivative


def _polish(positions: Array, target: _Target) -> tuple[Array, Array]:
    """Newton's method on all seven equations: positions [rad], and the largest of what is still missing, (n,)."""
    missing, derivative = _residual(positions, target)
    for _ in range(16):
        step = _solve(derivative, missing)
        largest = np.max(np.abs(step), 1)
        positions = positions + step * np.minimum(1.0, 0.5 / np.maximum(largest, 1e-30))[:, None]
        missing, derivative = _residual(positions, target)
        if float(largest.max()) < 1e-9:  # quadratic: the next step would be rounding
            break
    return positions, np.max(np.abs(missing), 1)


def _solve(derivative: Array, missing: Array, rank: int = 7) -> Array:
    """The smallest step that makes up for what is missing, in the ``rank`` directions that something depends on."""
    left, values, right = np.linalg.svd(derivative)
    gained = np.einsum("nji,nj->ni", left, missing)[:, :rank] / np.maximum(values[:, :rank], 1e-13)
    return np.asarray(np.einsum("nji,nj->ni", right[:, :rank], gained))


def _polished(positions: Array, target: _Target) -> Array:
    """Those of ``positions`` from which a posture is reached, each posture once, joints from -π to π."""
    if not len(positions):
        return positions
    positions, errors = _polish(positions, target)
    return _distinct(_wrapped(positions[errors < _CONVERGED]))


# -- Where postures may be --------------------------------------------------------------------------------------------


class _TwoEquations:
    """What is left of the seven equations, in axes 1 and 2, for one of the two senses of axis 7."""

    def __init__(self, target: _Target, a1: Array, a2: Array, sense: Array) -> None:
        line = target.wrist - _SHOULDER
        along = _unit(line[None])[0]
        y = _unit(np.cross(along, target.reference)[None])[0]
        x = np.cross(y, along)
        beta = target.angle - pi / 2.0
        inside = x * np.cos(beta) + y * np.sin(beta)  # in the half-plane of axis 3, normal to the line
        c1, s1, c2, s2 = np.cos(a1), np.sin(a1), np.cos(a2), np.sin(a2)

        def behind_axis_1(vector: Array) -> tuple[Array, Array, Array]:
            return c1 * vector[_X] + s1 * vector[_Y], c1 * vector[_Y] - s1 * vector[_X], vector[_Z]

        # Axis 7: e lies in the plane, e·normal = 0.
        normal_x, normal_y, normal_z = behind_axis_1(np.cross(along, inside))
        across = c2 * normal_x - s2 * normal_z
        size = np.hypot(normal_y, across) + 1e-300
        s7, c7 = sense * normal_y / size, sense * across / size
        e_x, e_y, e_z = -c2 * s7, c7, s2 * s7
        inside_x, inside_y, inside_z = behind_axis_1(inside)
        self.side_of_plane = e_x * inside_x + e_y * inside_y + e_z * inside_z  # must be positive
        # From the elbow point to the wrist.
        d_x, d_y, d_z = behind_axis_1(line)
        d_x = d_x - (SHOULDER_OFFSET * (c2 - 1.0) + ELBOW_OFFSET * c2 * c7 + UPPER_ARM * s2)
        d_y = d_y - ELBOW_OFFSET * s7
        d_z = d_z - (UPPER_ARM * c2 - SHOULDER_OFFSET * s2 - ELBOW_OFFSET * s2 * c7)
        n_x, n_y, n_z = behind_axis_1(target.rotation[:, _X])
        n_e, d_n = n_x * e_x + n_y * e_y + n_z * e_z, d_x * n_x + d_y * n_y + d_z * n_z
        distance_squared = d_x * d_x + d_y * d_y + d_z * d_z
        numerator = distance_squared - ELBOW_OFFSET**2 - FOREARM**2
        denominator = 2.0 * WRIST_OFFSET * (FOREARM + d_n)
        size = np.hypot(numerator, denominator) + 1e-300
        half_sine, half_cosine = numerator / size, denominator / size
        s5, c5 = 2.0 * half_sine * half_cosine, half_cosine**2 - half_sine**2
        c4_s5 = (FOREARM * c5 + WRIST_OFFSET * s5 - d_n) / ELBOW_OFFSET
        self.first = 10.0 * ((d_x * e_x + d_y * e_y + d_z * e_z) * half_cosine - WRIST_OFFSET * half_sine * n_e)
        self.second = c4_s5 * c4_s5 + n_e * n_e - s5 * s5
        self._a1_a2, self._s7_c7, self._s2_c2, self._d = (a1, a2), (s7, c7), (s2, c2), (d_x, d_y, d_z)
        self._s5_c5, self._s4_s5, self._c4_s5 = (s5, c5), n_e, c4_s5

    def positions(self, target: _Target) -> Array:
        """All seven joints [rad], (n, 7), for axes 1 and 2 at or near a root."""
        (s5, c5), (s7, c7), (s2, c2), (d_x, d_y, d_z) = self._s5_c5, self._s7_c7, self._s2_c2, self._d
        sign = np.where(s5 < 0.0, -1.0, 1.0)
        a4 = np.arctan2(self._s4_s5 * sign, self._c4_s5 * sign)
        # Axis 3 turns the wrist as seen from axis 4 to where it is seen from the upper arm.
        x, z = FOREARM + WRIST_OFFSET * s5, ELBOW_OFFSET + np.cos(a4) * WRIST_OFFSET * (c5 - 1.0)
        arm_x, arm_z = d_x * c2 * c7 + d_y * s7 - d_z * s2 * c7, d_x * s2 + d_z * c2
        a3 = np.arctan2(arm_x * z - arm_z * x, arm_x * x + arm_z * z)
        a1, a2 = self._a1_a2
        result = np.stack([a1, a2, np.arctan2(s7, c7), a3, a4, np.arctan2(s5, c5), np.zeros_like(a1)], 1)
        *_, rotation = _chain(result)
        left = np.swapaxes(rotation, 1, 2) @ target.rotation
        result[:, 6] = np.arctan2(left[:, 2, 1], left[:, 1, 1])
        return result


def _candidates(target: _Target) -> Array:
    """Postures near a root of the two equations: cells of the grid that may hold one, refined by Newton's method."""
    a1, a2 = (
        np.linspace(low - _GRID_MARGIN, high + _GRID_MARGIN, count + 1)
        for low, high, count in zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, _GRID, strict=False)
    )
    grid = _TwoEquations(target, a1[None, :, None], a2[None, None, :], np.array([1.0, -1.0])[:, None, None])
    may_hold = _over_corners(np.maximum, grid.side_of_plane) > -0.1
    for values in (grid.first, grid.second):
        low, high = _over_corners(np.minimum, values), _over_corners(np.maximum, values)
        may_hold &= (low <= _CELL_MARGIN * (high - low)) & (high >= -_CELL_MARGIN * (high - low))
    senses, i, j = np.nonzero(may_hold)
    cell = np.array([a1[1] - a1[0], a2[1] - a2[0]])
    start = np.stack([a1[i], a2[j]], 1) + cell / 2.0
    sense, at, step = np.where(senses == 0, 1.0, -1.0), start, 1e-6
    for _ in range(8):
        here = _TwoEquations(target, at[:, 0], at[:, 1], sense)
        right = _TwoEquations(target, at[:, 0] + step, at[:, 1], sense)
        up = _TwoEquations(target, at[:, 0], at[:, 1] + step, sense)
        f, g = here.first, here.second
        f_1, g_1 = (right.first - f) / step, (right.second - g) / step
        f_2, g_2 = (up.first - f) / step, (up.second - g) / step
        determinant = f_1 * g_2 - f_2 * g_1
        determinant = np.where(np.abs(determinant) < 1e-12, np.copysign(1e-12, determinant), determinant)
        change = np.stack([f_2 * g - g_2 * f, g_1 * f - f_1 * g], 1) / determinant[:, None]
        at = at + change * np.minimum(1.0, 1.0 / np.maximum(np.max(np.abs(change) / cell, 1), 1e-30))[:, None]
        near = np.all(np.abs(at - start) < 3.0 * cell, 1)  # what goes further away belongs to another cell
        at, start, sense = at[near], start[near], sense[near]
    end = _TwoEquations(target, at[:, 0], at[:, 1], sense)
    good = (np.abs(end.first) < 1e-2) & (np.abs(end.second) < 1e-2) & (end.side_of_plane > -1e-3)
    _, first = np.unique(np.round(np.stack([at[:, 0], at[:, 1], sense], 1)[good], 5), axis=0, return_index=True)
    at, sense = at[good][first], sense[good][first]
    return _TwoEquations(target, at[:, 0], at[:, 1], sense).positions(target)


def _over_corners(function: np.ufunc, values: Array) -> Array:
    """``function`` of the four corners of each cell; ``values`` (2, n, m) at the corners."""
    rows = function(values[:, :-1], values[:, 1:])
    return np.asarray(function(rows[:, :, :-1], rows[:, :, 1:]))


def _turned_over(positions: Array) -> Array:
    """The postures with the wrist, the shoulder and both turned over, which would be the same without offsets."""
    wrist = positions * (1, 1, 1, 1, 1, -1, 1) + np.array([0, 0, 0, 0, pi, 0, pi])
    both = np.concatenate([positions, wrist]) * (1, -1, 1, 1, 1, 1, 1) + np.array([pi, 0, pi, 0, 0, 0, 0])
    return np.concatenate([wrist, both])


def _beside(positions: Array, target: _Target, step: float = 0.08, steps: int = 90) -> Iterator[Array]:
    """Postures that lie close to nearly singular ones, or on one curve with them.

    At a nearly singular posture one combination of the seven equations (the left singular vector of the smallest
    singular value) hardly depends on the joints. The other six leave a curve of postures (for two axes in line: the
    arm's self-motion at the fixed pose); other postures are where that combination is zero again.
    """
    if not len(positions):
        return
    left, _, right = np.linalg.svd(_residual(positions, target)[1])
    weak = np.concatenate([left[:, :, -1], left[:, :, -1]])
    at, direction = np.concatenate([positions, positions]), np.concatenate([right[:, -1], -right[:, -1]])

    def without_weak(values: Array) -> Array:
        return np.asarray(values - np.einsum("ni,nj,nj...->ni...", weak, weak, values))

    path, off = [at], [np.zeros(len(at))]
    for _ in range(steps):
        at = at + step * direction
        for _ in range(3):  # back onto the curve along the shortest way
            missing, derivative = _residual(at, target)
            at = at + np.clip(_solve(without_weak(derivative), without_weak(missing), rank=6), -0.2, 0.2)
        missing, derivative = _residual(at, target)
        tangent = np.linalg.svd(without_weak(derivative))[2][:, -1]
        direction = tangent * np.sign(np.sum(tangent * direction, 1))[:, None]
        path.append(at)
        off.append(np.sum(weak * missing, 1))
    # Closer than a step: a parabola through what is off one step ahead, here (nothing) and one step back.
    ahead, back = np.split(off[1], 2)
    share = (back - ahead) / np.where(ahead + back == 0.0, 1.0, ahead + back)
    yield positions + np.clip(share, -2.0, 2.0)[:, None] * step * right[:, -1]
    for first in range(1, steps):
        before, here, after = off[first - 1], off[first], off[first + 1]
        crosses = (here * after <= 0.0) & (np.abs(here - after) < 2.0)
        touches = (np.abs(here) < 0.1) & (np.abs(here) < np.abs(before)) & (np.abs(here) <= np.abs(after))
        share = np.where(crosses, here / np.where(crosses & (here != after), here - after, 1.0), 0.0)[:, None]
        yield ((1.0 - share) * path[first] + share * path[first + 1])[crosses | touches]


def _distinct(positions: Array) -> Array:
    kept: list[Array] = []
    for position in positions:
        if all(np.max(np.abs(_wrapped(position - other))) > _SAME for other in kept):
            kept.append(position)
    return np.array(kept).reshape(-1, 7)


def _turns(position: Array, limits: JointLimits) -> Iterator[tuple[float, ...]]:
    """The posture with each full turn of each joint that is within the limits."""
    ranges = zip(position.tolist(), limits.lower, limits.upper, strict=True)
    choices = [
        [value + turn for turn in (-tau, 0.0, tau) if low - _SAME <= value + turn <= high + _SAME]
        for value, low, high in ranges
    ]
    yield from product(*choices)


def _wrapped(angles: Array) -> Array:
    return np.asarray((angles + pi) % tau - pi)


def _unit(vectors: Array) -> Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
