"""Inverse kinematics of one arm: every posture that brings tool0 to a pose with a given arm angle, and the Jacobian.

The pose and the arm angle are seven equations for seven joints. No two neighbouring axes of this arm meet, so there is
no closed form, but three facts reduce the seven unknowns to two (lengths as in :mod:`abb_protocols.robot.kinematics`):

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

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import pi, tau

import numpy as np
import numpy.ma  # np.unique imports it when called first, 80 ms in the middle of a motion
from numpy.typing import NDArray

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.chain import Chain
from abb_protocols.robot.differential_kinematics import CONVERGED, posture_near, wrist_of, wrist_target
from abb_protocols.robot.joints import YUMI_LIMITS, JointLimits, Joints, Pose, Side, joints
from abb_protocols.robot.kinematics import (
    ARM_ANGLE_REFERENCES,
    ELBOW_AXIS,
    ELBOW_OFFSET,
    FLANGE_OFFSET,
    FOREARM,
    JOINT_OFFSETS,
    SHOULDER_OFFSET,
    TURNS_ABOUT,
    UPPER_ARM,
    WRIST_AXIS,
    WRIST_OFFSET,
    compose_poses,
    foot_to_body,
    inverse_pose,
    matrix_from_quaternion,
    tool0_to_body,
    turn_between,
)
from abb_protocols.robot.rotations import cross, wrapped_angles

_Array = NDArray[np.float64]
_Rows = NDArray[np.intp]

_SHOULDER = np.array(JOINT_OFFSETS[0])
_TOOL0_TO_AXIS_6 = np.array([(0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)])  # Ry(90°): tool z along axis 6
TO_WRIST: Mapping[Side, Chain] = {
    side: Chain(TURNS_ABOUT, np.array([*JOINT_OFFSETS, (0.0, 0.0, 0.0)]), np.eye(3), reference, ELBOW_AXIS, WRIST_AXIS)
    for side, reference in ARM_ANGLE_REFERENCES.items()
}
"""The chain of each arm from its foot to the wrist, where axis 6 begins, turned as axis 6."""
TO_TOOL0: Mapping[Side, Chain] = {
    side: replace(chain, offsets=np.array([*JOINT_OFFSETS, (FLANGE_OFFSET, 0.0, 0.0)]), end=_TOOL0_TO_AXIS_6)
    for side, chain in TO_WRIST.items()
}
"""The same to tool0, the flange's length further."""

_GRID = (128, 72)  # cells over the ranges of axes 1 and 2: 2.7° a cell
_GRID_MARGIN = 0.02  # [rad] beyond the ranges: a root on the edge lies inside a cell
_CELL_MARGIN = 0.75  # a cell may hold a root if zero is nearer to its values than this share of their spread
_STARTS = np.array([(0.25, 0.25), (0.25, 0.75), (0.75, 0.25), (0.75, 0.75)])  # in a cell, where an equation is steep
_DAMPING = 0.1  # of a step by the squares of what is missing
_NEAR_ROOT = 0.1  # of either equation; what is no root after all, polishing leaves out
_NEARLY_SINGULAR = 0.01  # smallest singular value below which postures may lie closer together than a cell
_SAME = 1e-7  # [rad]
_AT_LIMIT = 1e-10  # [rad] a joint that is calculated to be so little beyond its limit is at it


class Unreachable(CommandRefused):
    """No posture within the limits has the pose; the message says what is nearest.

    Attributes:
        nearest: the posture that is nearest to the pose, where it was looked for [rad], (7,).
    """

    def __init__(self, said: Message | str, nearest: Joints | None = None) -> None:
        super().__init__(said)
        self.nearest = nearest


@dataclass(frozen=True, slots=True)
class _Targets:
    """n poses with their arm angles in the foot frame of one arm.

    Attributes:
        wrist: where axis 6 starts, the flange's length behind tool0 [m], (n, 3).
        rotation: of axis 6's frame at a6 = 0; its first column runs along axis 6, (n, 3, 3).
        angle: the arm angle [rad], (n,).
        chain: the one of the arm.
    """

    wrist: _Array
    rotation: _Array
    angle: _Array
    chain: Chain

    def of(self, rows: _Rows) -> _Targets:
        """The targets with these numbers, in this order; a number may come more than once."""
        return _Targets(self.wrist[rows], self.rotation[rows], self.angle[rows], self.chain)


def arm_angle(side: Side, position: Joints) -> float:
    """How far the elbow is turned about the line from shoulder to wrist, ``eax_a`` of a robtarget [rad], -π to π.

    Not defined where the line runs along the body's y axis or along axis 3; what is returned there is finite.
    """
    return wrist_of(side, position).angle


def jacobian(side: Side, position: Joints, tool: Pose | None = None) -> _Array:
    """How the tool moves with the joints: velocity [m/s] and angular velocity [rad/s] of the tool frame, (6, 7).

    Args:
        side: the arm.
        position: joint positions in chain order [rad].
        tool: the tool's frame in tool0; None is tool0.

    Returns:
        Rows x, y, z of the velocity and of the angular velocity, in the body frame; columns in chain order.
    """
    points, axes, tip, rotation = (value[0] for value in TO_TOOL0[side].places(np.array([position])))
    if tool is not None:
        tip = tip + rotation @ np.array(tool.position)
    foot = matrix_from_quaternion(foot_to_body(side).orientation)
    return np.concatenate([foot @ cross(axes, tip - points).T, foot @ axes.T])


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
    return postures_of_each(side, [tool0], [angle], limits)[0]


def postures_of_each(
    side: Side, tool0s: Sequence[Pose], angles: Sequence[float], limits: JointLimits = YUMI_LIMITS
) -> list[tuple[Joints, ...]]:
    """As :func:`postures`, of many poses at once: a map of what is in reach takes a fifth of the time.

    Args:
        side: the arm.
        tool0s: poses of tool0 in the body frame.
        angles: an arm angle [rad] for each of them.
        limits: the ranges of the joints.
    """
    if not len(tool0s):
        return []
    targets = _targets(side, tool0s, angles)
    found, of = _polished(*_candidates(targets), targets)
    new, of_new = found, of
    while len(new):
        derivative = _missing(new, targets.of(of_new))[1]
        singular = np.linalg.svd(derivative, compute_uv=False)[:, -1] < _NEARLY_SINGULAR
        turned, of_turned = _turned_over(new), np.tile(of_new, 3)
        beside, of_beside = _beside(new[singular], of_new[singular], targets)
        more, of_more = _polished(np.concatenate([turned, beside]), np.concatenate([of_turned, of_beside]), targets)
        count = len(found)
        found, of = np.concatenate([found, more]), np.concatenate([of, of_more])
        kept = _distinct(found, of)
        found, of, is_new = found[kept], of[kept], kept >= count
        new, of_new = found[is_new], of[is_new]
    result = []
    for number in range(len(tool0s)):
        within = [joints(each) for base in found[of == number] for each in _turns(base, limits)]
        result.append(tuple(sorted(within, key=lambda each: max(map(abs, each)))))
    return result


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
    if miss > CONVERGED:
        position, error = _polish(np.array([seed]), _targets(side, [tool0], [angle]))
        result, miss = joints(position[0]), float(error[0])
    if miss > CONVERGED:
        raise Unreachable(message("pose_not_reached", arm=side.word, miss=miss))
    outside = limits.outside(result)
    if outside is not None:
        raise Unreachable(
            message(
                "pose_beyond_range",
                arm=side.word,
                joint=outside + 1,
                lower=limits.lower[outside],
                upper=limits.upper[outside],
                position=result[outside],
            )
        )
    return result


_METRES_PER_RADIAN = 0.3  # what a turn counts beside a distance, where a pose cannot be had
_DESCENTS = 12
_LONGEST_DESCENT = 60
_SAME_POSE = 1e-4  # [m], [rad]
_SMALLEST_GAIN = 1e-6  # of what is missing; a step that saves less ends it


def nearest_reachable_posture(
    side: Side, tool0: Pose, seed: Joints, limits: JointLimits = YUMI_LIMITS
) -> tuple[Joints, Pose]:
    """The posture within the limits whose tool0 is nearest to a pose out of reach; takes some tenths of a second.

    Found by damped least squares from the seed and other postures; a nearer one that those miss may exist.

    Args:
        side: the arm.
        tool0: the pose, in the body frame.
        seed: where the arm is [rad].
        limits: the ranges of the joints.

    Returns:
        The posture [rad], and the pose of tool0 there. A turn by 1 rad counts as 0.3 m.
    """
    lower, upper = np.array(limits.lower), np.array(limits.upper)
    weights = np.array([1.0] * 3 + [_METRES_PER_RADIAN] * 3)

    def missing_at(position: _Array) -> _Array:
        here = tool0_to_body(side, joints(position.tolist()))
        return np.asarray(np.concatenate(_difference(tool0, here)) * weights)

    starts = [np.clip(seed, lower, upper), *np.random.default_rng(0).uniform(lower, upper, (_DESCENTS - 1, len(lower)))]
    found = [_descended(side, each, missing_at, (lower, upper), weights) for each in starts]
    best = joints(min(found, key=lambda each: float(np.linalg.norm(missing_at(each)))).tolist())
    return best, tool0_to_body(side, best)


def _difference(pose: Pose, here: Pose) -> tuple[_Array, _Array]:
    """The way [m] and the turn [rad] from here to a pose."""
    turn = turn_between(here.orientation, pose.orientation)
    return np.subtract(pose.position, here.position), np.array(turn)


def _descended(
    side: Side, position: _Array, missing_at: Callable[[_Array], _Array], ends: tuple[_Array, _Array], weights: _Array
) -> _Array:
    """From a posture to one where less is missing, and no small change saves more."""
    left, damping = missing_at(position), 1e-3
    for _ in range(_LONGEST_DESCENT):
        derivative = jacobian(side, joints(position.tolist())) * weights[:, None]
        down = derivative.T @ left
        is_free = ~((position <= ends[0]) & (down < 0.0)) & ~((position >= ends[1]) & (down > 0.0))
        own = derivative[:, is_free]
        step = np.zeros(len(position))
        step[is_free] = np.linalg.solve(own.T @ own + damping * np.eye(own.shape[1]), own.T @ left)
        after = np.clip(position + step, *ends)
        still = missing_at(after)
        gain = float(np.linalg.norm(left) - np.linalg.norm(still))
        if gain <= 0.0:
            damping *= 10.0
            if damping > 1e3:
                break
            continue
        position, left, damping = after, still, max(damping * 0.3, 1e-6)
        if gain < _SMALLEST_GAIN:
            break
    return position


def unreachable(
    side: Side, tool0: Pose, reason: Message, seed: Joints, limits: JointLimits = YUMI_LIMITS
) -> Unreachable:
    """The error of a pose that no posture has: with the posture that is nearest to it, and where that is."""
    position, there = nearest_reachable_posture(side, tool0, seed, limits)
    away, turn = (float(np.linalg.norm(each)) for each in _difference(tool0, there))
    if max(away, turn) <= _SAME_POSE:
        return Unreachable(message("nearest_arm_angle", reason=reason, angle=arm_angle(side, position)), position)
    x, y, z = there.position
    return Unreachable(message("nearest_pose", reason=reason, x=x, y=y, z=z, distance=away, turn=turn), position)


def _targets(side: Side, tool0s: Sequence[Pose], angles: Sequence[float]) -> _Targets:
    body_to_foot = inverse_pose(foot_to_body(side))
    in_foot = [compose_poses(body_to_foot, tool0) for tool0 in tool0s]
    rotation = (
        np.array([matrix_from_quaternion(each.orientation) for each in in_foot]).reshape(-1, 3, 3) @ _TOOL0_TO_AXIS_6.T
    )
    tip = np.array([each.position for each in in_foot]).reshape(-1, 3)
    wrist = tip - rotation[:, :, 0] * FLANGE_OFFSET
    return _Targets(wrist, rotation, np.array(angles, dtype=float), TO_WRIST[side])


def _missing(positions: _Array, targets: _Targets) -> tuple[_Array, _Array]:
    """What is missing to the targets, one for each posture, and how it shrinks with the joints."""
    return targets.chain.missing(positions, targets.wrist, targets.rotation, targets.angle)


def _polish(positions: _Array, targets: _Targets) -> tuple[_Array, _Array]:
    """Newton's method on all seven equations: positions [rad], and the largest of what is still missing, (n,)."""
    positions, left = positions.copy(), np.arange(len(positions))
    for _ in range(16):
        missing, derivative = _missing(positions[left], targets.of(left))
        step = _solve(derivative, missing)
        largest = np.max(np.abs(step), 1)
        positions[left] += step * np.minimum(1.0, 0.5 / np.maximum(largest, 1e-30))[:, None]
        left = left[largest > 1e-9]  # quadratic: the next step would be rounding
        if not len(left):
            break
    return positions, np.max(np.abs(_missing(positions, targets)[0]), 1)


def _solve(derivative: _Array, missing: _Array) -> _Array:
    """The steps of the joints that make up for what is missing; where nothing does, the smallest that comes nearest."""
    try:
        return np.asarray(np.linalg.solve(derivative, missing[:, :, None])[:, :, 0])
    except np.linalg.LinAlgError:  # one of them is exactly singular
        return np.asarray((np.linalg.pinv(derivative, rcond=1e-13) @ missing[:, :, None])[:, :, 0])


def _polished(positions: _Array, of: _Rows, targets: _Targets) -> tuple[_Array, _Rows]:
    """Those from which a posture of the target ``of`` is reached, each once, joints from -π to π, and their targets."""
    if not len(positions):
        return positions, of
    positions, errors = _polish(positions, targets.of(of))
    good = errors < CONVERGED
    positions, of = wrapped_angles(positions[good]), of[good]
    kept = _distinct(positions, of)
    return positions[kept], of[kept]


# -- Where postures may be --------------------------------------------------------------------------------------------


class _TwoEquations:
    """What is left of the seven equations, in axes 1 and 2, for one of the two senses of axis 7.

    One target for each pair of angles, or one for all of them.
    """

    def __init__(self, targets: _Targets, a1: _Array, a2: _Array, sense: _Array) -> None:
        line = targets.wrist - _SHOULDER
        along = _unit(line)
        y = _unit(cross(along, np.array(targets.chain.reference)))
        x = cross(y, along)
        beta = targets.angle[:, None] - pi / 2.0
        inside = x * np.cos(beta) + y * np.sin(beta)  # in the half-plane of axis 3, normal to the line
        c1, s1, c2, s2 = np.cos(a1), np.sin(a1), np.cos(a2), np.sin(a2)

        def behind_axis_1(vector: _Array) -> tuple[_Array, _Array, _Array]:
            x, y, z = vector.T
            return c1 * x + s1 * y, c1 * y - s1 * x, z

        # Axis 7: e lies in the plane, e·normal = 0.
        normal_x, normal_y, normal_z = behind_axis_1(cross(along, inside))
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
        n_x, n_y, n_z = behind_axis_1(targets.rotation[:, :, 0])
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

    def positions(self, targets: _Targets) -> _Array:
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
        *_, rotation = targets.chain.places(result)
        left = np.swapaxes(rotation, 1, 2) @ targets.rotation
        result[:, 6] = np.arctan2(left[:, 2, 1], left[:, 1, 1])
        return result


def _candidates(targets: _Targets) -> tuple[_Array, _Rows]:
    """Postures near a root of the two equations, cells of the grid that may hold one refined; and their targets."""
    a1, a2 = (
        np.linspace(low - _GRID_MARGIN, high + _GRID_MARGIN, count + 1)
        for low, high, count in zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, _GRID, strict=False)
    )
    cell = np.array([a1[1] - a1[0], a2[1] - a2[0]])
    starts, senses, numbers = [], [], []
    for number in range(len(targets.angle)):
        one = targets.of(np.array([number]))
        grid = _TwoEquations(one, a1[None, :, None], a2[None, None, :], np.array([1.0, -1.0])[:, None, None])
        may_hold = _over_corners(np.maximum, grid.side_of_plane) > -0.1
        for values in (grid.first, grid.second):
            low, high = _over_corners(np.minimum, values), _over_corners(np.maximum, values)
            may_hold &= (low <= _CELL_MARGIN * (high - low)) & (high >= -_CELL_MARGIN * (high - low))
        i_sense, i, j = np.nonzero(may_hold)
        corners = np.stack([a1[i], a2[j]], 1)
        starts.append(np.concatenate([corners + share * cell for share in _STARTS]))
        senses.append(np.tile(np.where(i_sense == 0, 1.0, -1.0), len(_STARTS)))
        numbers.append(np.full(len(i) * len(_STARTS), number))
    start, of = np.concatenate(starts), np.concatenate(numbers)
    sense: _Array = np.concatenate(senses)
    at, step = start, 1e-6
    for _ in range(8):
        # Here, and a step further in each of the two directions.
        offsets = np.array([(0.0, 0.0), (step, 0.0), (0.0, step)]).repeat(len(at), axis=0)
        places = np.tile(at, (3, 1)) + offsets
        near = _TwoEquations(targets.of(np.tile(of, 3)), places[:, 0], places[:, 1], np.tile(sense, 3))
        (f, f_right, f_up), (g, g_right, g_up) = near.first.reshape(3, -1), near.second.reshape(3, -1)
        f_1, g_1, f_2, g_2 = (f_right - f) / step, (g_right - g) / step, (f_up - f) / step, (g_up - g) / step
        # Levenberg's step: where both equations say nearly the same, Newton's leads far away.
        damping = _DAMPING * (f * f + g * g)
        in_1, in_2, across = f_1 * f_1 + g_1 * g_1 + damping, f_2 * f_2 + g_2 * g_2 + damping, f_1 * f_2 + g_1 * g_2
        slope_1, slope_2 = f_1 * f + g_1 * g, f_2 * f + g_2 * g
        determinant = np.maximum(in_1 * in_2 - across * across, 1e-300)
        change = np.stack([across * slope_2 - in_2 * slope_1, across * slope_1 - in_1 * slope_2], 1)
        change /= determinant[:, None]
        at = at + change * np.minimum(1.0, 1.0 / np.maximum(np.max(np.abs(change) / cell, 1), 1e-30))[:, None]
        kept = np.all(np.abs(at - start) < 3.0 * cell, 1)  # what goes further away belongs to another cell
        at, start, sense, of = at[kept], start[kept], sense[kept], of[kept]
    end = _TwoEquations(targets.of(of), at[:, 0], at[:, 1], sense)
    good = (np.abs(end.first) < _NEAR_ROOT) & (np.abs(end.second) < _NEAR_ROOT) & (end.side_of_plane > -1e-3)
    at, sense, of = at[good], sense[good], of[good]
    _, first = np.unique(np.round(np.column_stack([of, at, sense]), 5), axis=0, return_index=True)
    at, sense, of = at[first], sense[first], of[first]
    own = targets.of(of)
    return _TwoEquations(own, at[:, 0], at[:, 1], sense).positions(own), of


def _over_corners(function: np.ufunc, values: _Array) -> _Array:
    """``function`` of the four corners of each cell; ``values`` (2, n, m) at the corners."""
    rows = function(values[:, :-1], values[:, 1:])
    return np.asarray(function(rows[:, :, :-1], rows[:, :, 1:]))


def _turned_over(positions: _Array) -> _Array:
    """The postures with the wrist, the shoulder and both turned over, which would be the same without offsets."""
    wrist = positions * (1, 1, 1, 1, 1, -1, 1) + np.array([0, 0, 0, 0, pi, 0, pi])
    both = np.concatenate([positions, wrist]) * (1, -1, 1, 1, 1, 1, 1) + np.array([pi, 0, pi, 0, 0, 0, 0])
    return np.concatenate([wrist, both])


def _beside(
    positions: _Array, of: _Rows, targets: _Targets, step: float = 0.08, steps: int = 90
) -> tuple[_Array, _Rows]:
    """Postures that lie close to nearly singular ones, or on one curve with them; and their targets.

    At a nearly singular posture one combination of the seven equations (the left singular vector of the smallest
    singular value) hardly depends on the joints. The other six leave a curve of postures (for two axes in line: the
    arm's self-motion at the fixed pose); other postures are where that combination is zero again.
    """
    if not len(positions):
        return positions, of
    left, _, right = np.linalg.svd(_missing(positions, targets.of(of))[1])
    weak, others = (np.concatenate([each, each]) for each in (left[:, :, -1], np.swapaxes(left[:, :, :-1], 1, 2)))
    at, direction = np.concatenate([positions, positions]), np.concatenate([right[:, -1], -right[:, -1]])
    of = np.concatenate([of, of])
    own = targets.of(of)

    def followed(at: _Array, direction: _Array) -> tuple[_Array, _Array, _Array]:
        """The step back onto the curve, the curve's direction, and how far off the weak combination is."""
        missing, derivative = _missing(at, own)
        rows = np.concatenate([others @ derivative, direction[:, None]], 1)
        off = np.einsum("nij,nj->ni", others, missing)
        back = _solve(rows, np.concatenate([off, np.zeros((len(at), 1))], 1))
        tangent = _solve(rows, np.broadcast_to(np.eye(at.shape[1])[-1], at.shape))
        return np.clip(back, -0.2, 0.2), _unit(tangent), np.sum(weak * missing, 1)

    path, off = [at], [np.zeros(len(at))]
    for _ in range(steps):
        at = at + step * direction
        for _ in range(2):
            at = at + followed(at, direction)[0]
        _, direction, value = followed(at, direction)
        path.append(at)
        off.append(value)
    # Closer than a step: a parabola through what is off one step ahead, here (nothing) and one step back.
    ahead, back = np.split(off[1], 2)
    share = (back - ahead) / np.where(ahead + back == 0.0, 1.0, ahead + back)
    found = [positions + np.clip(share, -2.0, 2.0)[:, None] * step * right[:, -1]]
    found_of = [of[: len(positions)]]
    for first in range(1, steps):
        before, here, after = off[first - 1], off[first], off[first + 1]
        crosses = (here * after <= 0.0) & (np.abs(here - after) < 2.0)
        touches = (np.abs(here) < 0.1) & (np.abs(here) < np.abs(before)) & (np.abs(here) <= np.abs(after))
        share = np.where(crosses, here / np.where(crosses & (here != after), here - after, 1.0), 0.0)[:, None]
        found.append(((1.0 - share) * path[first] + share * path[first + 1])[crosses | touches])
        found_of.append(of[crosses | touches])
    return np.concatenate(found), np.concatenate(found_of)


def _distinct(positions: _Array, of: _Rows) -> _Rows:
    """Which of the postures to keep, so that no target has one of them twice."""
    order = np.argsort(of, kind="stable")
    kept = []
    for rows in np.split(order, np.flatnonzero(np.diff(of[order])) + 1):
        own = positions[rows]
        is_same = np.max(np.abs(wrapped_angles(own[:, None] - own)), 2, initial=0.0) <= _SAME
        kept.append(rows[~np.any(np.tril(is_same, -1), 1)])
    return np.sort(np.concatenate(kept))


def _turns(position: _Array, limits: JointLimits) -> Iterator[tuple[float, ...]]:
    """The posture with each full turn of each joint that is within the limits."""
    ranges = zip(position.tolist(), limits.lower, limits.upper, strict=True)
    choices = [
        [
            min(max(value + turn, low), high)
            for turn in (-tau, 0.0, tau)
            if low - _AT_LIMIT <= value + turn <= high + _AT_LIMIT
        ]
        for value, low, high in ranges
    ]
    yield from product(*choices)


def _unit(vectors: _Array) -> _Array:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
