"""Differential kinematics: how the wrist and the tool of one arm move with the joints, fast enough for every cycle.

:func:`wrist_of` is forward kinematics with all derivatives, :class:`DifferentialSolver` the step of the joints that
makes up for what is missing to a target, and :func:`posture_near` repeats that step. A pose and an arm angle are seven
equations, those of :mod:`abb_protocols.robot.inverse_kinematics`; the wrist and the frame of axis 6 stand for tool0,
which only lies the flange's length further along. Where axes are in line, the step is damped (Y. Nakamura, H. Hanafusa,
1986): no joint has to jump, and the arm angle, which counts least, gives way first.

Plain numbers, as one posture at a time takes a tenth of NumPy's time in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import atan2, copysign, cos, hypot, inf, pi, sin, sqrt, tau
from operator import mul
from typing import NamedTuple

from abb_protocols.robot.joints import Joints, Pose, Side, Vector, joints, rotate
from abb_protocols.robot.kinematics import (
    ARM_ANGLE_REFERENCES,
    ELBOW_AXIS,
    FLANGE_OFFSET,
    JOINT_OFFSETS,
    TURNS_ABOUT,
    WRIST_AXIS,
    compose_poses,
    foot_to_body,
    inverse_pose,
)

_BODY_TO_FOOT = {side: inverse_pose(foot_to_body(side)) for side in Side}

CONVERGED = 1e-12
"""A posture that misses its target by less has it [m], [rad].

Near a singularity a joint is off by a million times more.
"""

_METRE_IN_RADIANS = 4.0  # what a metre counts beside a radian of the tool's orientation
_LEAST_DAMPING = 1e-14  # squared: without effect where the pose depends on the joints
_SINGULAR = 0.05  # damped where it depends on them less than this
_ELBOW_FREEDOM = 0.05  # squared: the elbow gives way where it turns less than this with the joints, the pose held
_NOT_ZERO = 1e-30  # squared: the arm angle of an elbow on the line from shoulder to wrist is any

_Row = tuple[float, ...]
"""Seven numbers: one for each joint, chain order, or one for each equation."""


class WristTarget(NamedTuple):
    """A pose of tool0 and an arm angle, in the foot frame.

    Attributes:
        wrist: where axis 6 starts [m].
        x: direction of axis 6.
        y: second direction of the frame at a6 = 0.
        z: third one.
        angle: the arm angle [rad].
    """

    wrist: Vector
    x: Vector
    y: Vector
    z: Vector
    angle: float


class Wrist(NamedTuple):
    """Where a posture has its wrist, and how that changes with the joints, in the foot frame.

    Attributes:
        wrist, x, y, z, angle: as in :class:`WristTarget`.
        velocity: of the wrist with each joint, rows x, y, z [m/rad], (3, 7).
        rotation: of its frame with each joint, rows x, y, z, (3, 7).
        elbow: of the arm angle with each joint, (7,).
    """

    wrist: Vector
    x: Vector
    y: Vector
    z: Vector
    angle: float
    velocity: tuple[_Row, ...]
    rotation: tuple[_Row, ...]
    elbow: _Row


def wrist_target(side: Side, tool0: Pose, angle: float) -> WristTarget:
    """The target of a pose of tool0 in the body frame and an arm angle [rad]."""
    in_foot = compose_poses(_BODY_TO_FOOT[side], tool0)
    w, x, y, z = in_foot.orientation
    # Columns of the rotation matrix of tool0: its z runs along axis 6, its x against the frame's third direction.
    first = (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y))
    second = (2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x))
    third = (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y))
    px, py, pz = in_foot.position
    wrist = (px - FLANGE_OFFSET * third[0], py - FLANGE_OFFSET * third[1], pz - FLANGE_OFFSET * third[2])
    return WristTarget(wrist, third, second, (-first[0], -first[1], -first[2]), angle)


def rotated_to_foot(side: Side, vector: Vector) -> Vector:
    """A direction or velocity of the body frame as the foot frame has it."""
    return rotate(_BODY_TO_FOOT[side].orientation, vector)


def wrist_of(side: Side, position: Joints) -> Wrist:
    """Wrist, arm angle and all their derivatives of a posture."""
    px = py = pz = 0.0
    columns: list[Vector] = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
    points, axes = list[Vector](), list[Vector]()
    for about, (x, y, z), angle in zip(TURNS_ABOUT, JOINT_OFFSETS, position, strict=True):
        (x1, x2, x3), (y1, y2, y3), (z1, z2, z3) = columns
        px, py, pz = px + x * x1 + y * y1 + z * z1, py + x * x2 + y * y2 + z * z2, pz + x * x3 + y * y3 + z * z3
        points.append((px, py, pz))
        axes.append(columns[about])
        # A turn about one axis mixes the other two columns.
        second, third, s, c = (about + 1) % 3, (about + 2) % 3, sin(angle), cos(angle)
        (a1, a2, a3), (b1, b2, b3) = columns[second], columns[third]
        columns[second] = (c * a1 + s * b1, c * a2 + s * b2, c * a3 + s * b3)
        columns[third] = (c * b1 - s * a1, c * b2 - s * a2, c * b3 - s * a3)
    wrist = points[WRIST_AXIS]
    moved = [_cross(axis, _sum(wrist, point, -1.0)) for axis, point in zip(axes, points, strict=True)]

    # The arm angle lies between the reference and the elbow's axis, seen along the line from shoulder to wrist.
    reference, elbow, from_shoulder = ARM_ANGLE_REFERENCES[side], axes[ELBOW_AXIS], _sum(wrist, points[0], -1.0)
    length = hypot(*from_shoulder)
    line = _times(1.0 / length, from_shoulder)
    normal, along, along_reference = _cross(line, reference), _dot(line, elbow), _dot(line, reference)
    sine, cosine = _dot(normal, elbow), _dot(elbow, reference) - along * along_reference
    size = max(sine * sine + cosine * cosine, _NOT_ZERO)
    # Its change with the line's direction, then with the wrist; and with the elbow's axis, then with a turn of that.
    with_line = _times(cosine / size, _cross(reference, elbow))
    with_line = _sum(with_line, _sum(_times(along_reference, elbow), reference, along), sine / size)
    with_wrist = _times(1.0 / length, _sum(with_line, line, -_dot(with_line, line)))
    with_axis = _sum(_times(cosine / size, normal), _sum(reference, line, -along_reference), -sine / size)
    with_turn = _cross(elbow, with_axis)
    changes = [_dot(with_wrist, each) for each in moved]
    for index in range(ELBOW_AXIS):
        changes[index] += _dot(axes[index], with_turn)
    x_axis, y_axis, z_axis = columns
    return Wrist(
        wrist,
        x_axis,
        y_axis,
        z_axis,
        (atan2(sine, cosine) + 1.5 * pi) % tau - pi,
        tuple(zip(*moved, strict=True)),
        tuple(zip(*axes, strict=True)),
        tuple(changes),
    )


def _cross(a: Vector, b: Vector) -> Vector:
    a1, a2, a3 = a
    b1, b2, b3 = b
    return (a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1)


def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _sum(a: Vector, b: Vector, factor: float) -> Vector:
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])


def _times(factor: float, a: Vector) -> Vector:
    return (factor * a[0], factor * a[1], factor * a[2])


def target_error(now: Wrist, target: WristTarget) -> _Row:
    """What is missing to a target: position [m], rotation [rad] and arm angle [rad], (7,), in the foot frame."""
    (ax, ay, az), (bx, by, bz), (cx, cy, cz) = now.x, now.y, now.z
    (ux, uy, uz), (vx, vy, vz), (wx, wy, wz) = target.x, target.y, target.z
    # Half the sum of the cross products of the directions: the axis times the sine of the angle between the frames.
    rx = 0.5 * (ay * uz - az * uy + by * vz - bz * vy + cy * wz - cz * wy)
    ry = 0.5 * (az * ux - ax * uz + bz * vx - bx * vz + cz * wx - cx * wz)
    rz = 0.5 * (ax * uy - ay * ux + bx * vy - by * vx + cx * wy - cy * wx)
    sine = hypot(rx, ry, rz)
    if sine > 1e-6:
        cosine = 0.5 * (ax * ux + ay * uy + az * uz + bx * vx + by * vy + bz * vz + cx * wx + cy * wy + cz * wz - 1.0)
        factor = atan2(sine, cosine) / sine
        rx, ry, rz = factor * rx, factor * ry, factor * rz
    (px, py, pz), (qx, qy, qz) = now.wrist, target.wrist
    return (qx - px, qy - py, qz - pz, rx, ry, rz, (target.angle - now.angle + pi) % tau - pi)


class DifferentialSolver:
    """Changes of the joints for desired changes of position, rotation and arm angle, see :func:`target_error`.

    The pose comes first, the arm angle takes what freedom is left. Away from singularities both are exact. Where the
    pose cannot change in a direction, its changes are damped; where the elbow cannot turn with the pose held, it gives
    way. What is not reached is left for the next steps. Making one takes about 60 µs, each change 10 µs.

    Args:
        now: where the arm is.
        locked: joints that do not take part.
        weakest: that of the step before, from which it goes on to be found.

    Attributes:
        weakest: the change of the pose that the joints can make least, (6,), as far as it is known.
        independence: how much the pose changes in it with the joints, towards 0 where axes are in line.
    """

    def __init__(self, now: Wrist, locked: Sequence[int] = (), weakest: Sequence[float] = (1.0,) * 6) -> None:
        rows = [*([_METRE_IN_RADIANS * value for value in row] for row in now.velocity), *map(list, now.rotation)]
        elbow = list(now.elbow)
        for row in (*rows, elbow):
            for index in locked:
                row[index] = 0.0
        self._rows, self._elbow = rows, elbow
        products = [[sum(map(mul, row, other)) for other in rows[: index + 1]] for index, row in enumerate(rows)]
        self._factor = _factored(products, _LEAST_DAMPING)
        # Inverse iteration: its answer comes near to the weakest direction, and a step further in each cycle.
        found = self._solved(weakest)
        size = sqrt(sum(map(mul, found, found)))
        self.weakest = tuple([value / size for value in found])
        square = sqrt(sum(map(mul, weakest, weakest))) / size
        self.independence = sqrt(square)
        if square < _SINGULAR * _SINGULAR:
            self._factor = _factored(products, _SINGULAR * _SINGULAR - square + _LEAST_DAMPING)
        kept = self._joints(self._solved([sum(map(mul, row, elbow)) for row in rows]))
        self._free = [value - own for value, own in zip(elbow, kept, strict=True)]
        self._freedom = max(sum(map(mul, self._free, self._free)), _ELBOW_FREEDOM)

    def change(self, desired: _Row, most: float = inf) -> Joints:
        """The change of the joints for a desired change [m], [rad], in the foot frame.

        Where the weakest direction would take the joints further than ``most`` [rad], less of it is made: at the end
        of its reach the arm slides along it.
        """
        px, py, pz, rx, ry, rz, angle = desired
        metre = _METRE_IN_RADIANS
        goal: tuple[float, ...] = (metre * px, metre * py, metre * pz, rx, ry, rz)
        weak, furthest = sum(map(mul, goal, self.weakest)), most * self.independence
        if abs(weak) > furthest:
            less = copysign(abs(weak) - furthest, weak)
            goal = tuple([value - less * each for value, each in zip(goal, self.weakest, strict=True)])
        change = self._joints(self._solved(goal))
        factor = (angle - sum(map(mul, self._elbow, change))) / self._freedom
        return joints([value + factor * free for value, free in zip(change, self._free, strict=True)])

    def _joints(self, solved: Sequence[float]) -> list[float]:
        return [sum(map(mul, solved, column)) for column in zip(*self._rows, strict=True)]

    def _solved(self, goal: Sequence[float]) -> list[float]:
        factor, half = self._factor, list[float]()
        for line, value in zip(factor, goal, strict=True):
            half.append((value - sum(map(mul, line, half))) / line[-1])  # the shorter one ends the sum
        for index in range(5, -1, -1):
            line = factor[index]
            value = half[index] = half[index] / line[index]
            for column in range(index):
                half[column] -= line[column] * value
        return half


def _factored(products: list[list[float]], damping: float) -> list[list[float]]:
    """The lower half of ``products + damping``, a symmetric matrix given by its own, by Cholesky's method."""
    factor: list[list[float]] = []
    for row in products:
        line: list[float] = []
        for value, other in zip(row, factor, strict=False):  # the last value of a row has no other
            line.append((value - sum(map(mul, line, other))) / other[-1])
        line.append(sqrt(max(row[-1] - sum(map(mul, line, line)), 0.0) + damping))
        factor.append(line)
    return factor


def posture_near(side: Side, target: WristTarget, seed: Joints, steps: int = 12) -> tuple[Joints, float]:
    """The posture of a target that continues from a seed, by Newton's method.

    Returns:
        The joints [rad], (7,), and the largest of what it misses [m], [rad]; not small where there is none.
    """
    position = seed
    for _ in range(steps):
        now = wrist_of(side, position)
        left = target_error(now, target)
        miss = max(map(abs, left))
        if miss < CONVERGED:
            return position, miss
        change = DifferentialSolver(now).change(left)
        factor = min(1.0, 0.5 / max(map(abs, change)))
        position = joints([value + factor * step for value, step in zip(position, change, strict=True)])
    return position, max(map(abs, target_error(wrist_of(side, position), target)))
