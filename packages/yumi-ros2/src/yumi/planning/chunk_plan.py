"""The spline of a chunk: through the points of a policy, continuous in velocity and acceleration, within the limits.

It is made in the process that receives the chunk; the control process only leads the arm onto it
(:mod:`yumi.control.motion.chunk_motion`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from abb_protocols.catalogue import message
from abb_protocols.robot.joints import JOINT_COUNT, JointLimits, Side, joint_names
from yumi.control.goals import check_position
from yumi.control.motion.spline import Spline, TrajectoryPoint, spline_through
from yumi.control.motion.spline_limits import ROUNDING, check_motion
from yumi.control.trajectory_commands import trajectory_refused

_Array = NDArray[np.float64]

_FEWEST_POINTS, _MOST_POINTS = 2, 500
SHORTEST_PERIOD, LONGEST_PERIOD = 0.002, 1.0
"""The least and the most time between two points [s]."""

_MOST_SMOOTHED = 0.05  # [rad] points may be moved by
_PASSES = 40
_QUANTITIES = (("velocity", "rad/s"), ("acceleration", "rad/s²"), ("jerk", "rad/s³"))


def plan_chunk(side: Side, times: Sequence[float], positions: _Array, limits: JointLimits) -> Spline:
    """The spline through the points of one arm.

    Points that ask for more than the limits are averaged with their neighbours, which takes the noise of a policy away.
    At both ends the velocity is that of the parabola through the three points there: a chunk is a part of a motion.

    Args:
        side: the arm.
        times: of the points, increasing [s].
        positions: of its joints in chain order [rad], (n, 7).
        limits: of the joints.

    Raises:
        CommandRefused: a position is out of its joint's range.
        TrajectoryRefused: too few or too many points, times too near or too far from each other, or points that ask for
            more than the limits and would have to be moved by more than 0.05 rad.
    """
    names, at = joint_names(side), np.asarray(times, dtype=float)
    if not _FEWEST_POINTS <= len(at) <= _MOST_POINTS:
        raise trajectory_refused(message("chunk_point_count", points=len(at), least=_FEWEST_POINTS, most=_MOST_POINTS))
    for step in np.diff(at):
        check_chunk_time("the time between two points", float(step), SHORTEST_PERIOD, LONGEST_PERIOD)
    for index, name in enumerate(names):
        for value in (positions[:, index].min(), positions[:, index].max()):  # a NaN is both
            check_position(name, index, float(value))
    moved: _Array = positions
    for _ in range(_PASSES):
        spline = _SplineArrays(at, moved)
        if spline.share(limits) <= ROUNDING:
            break
        between = 0.25 * moved[:-2] + 0.5 * moved[1:-1] + 0.25 * moved[2:]
        moved = np.concatenate([moved[:1], between, moved[-1:]])
        if np.abs(moved - positions).max() > _MOST_SMOOTHED:
            raise _SplineArrays(at, positions).beyond(names, limits)
    else:
        raise _SplineArrays(at, positions).beyond(names, limits)
    found = spline.spline()
    check_motion(found.segments, names, limits)
    return found


def check_chunk_time(name: str, value: float, lowest: float, highest: float) -> None:
    """Refuse a time that is out of range [s]; raises TrajectoryRefused."""
    if not lowest * (1.0 - 1e-9) <= value <= highest * (1.0 + 1e-9):  # NaN too
        raise trajectory_refused(
            message("chunk_time_out_of_range", name=name, value=value, lowest=lowest, highest=highest)
        )


class _SplineArrays:
    """The cubic spline of all joints, whose acceleration does not jump.

    Args:
        times: of the points [s], (n,).
        positions: [rad], (n, 7).
    """

    def __init__(self, times: _Array, positions: _Array) -> None:
        self._times, self._positions = times, positions
        count, steps = len(times), np.diff(times)[:, None]
        slopes = np.diff(positions, axis=0) / steps
        first = last = slopes[0]
        if count > _FEWEST_POINTS:
            first = slopes[0] + (slopes[0] - slopes[1]) * steps[0] / (steps[0] + steps[1])
            last = slopes[-1] + (slopes[-1] - slopes[-2]) * steps[-1] / (steps[-1] + steps[-2])
        # The inner velocities follow from equal accelerations on both sides of each point.
        rows, right = np.eye(count), np.zeros((count, JOINT_COUNT))
        right[0], right[-1] = first, last
        for index in range(1, count - 1):
            before, after = 1.0 / steps[index - 1, 0], 1.0 / steps[index, 0]
            rows[index, index - 1 : index + 2] = before, 2.0 * (before + after), after
            right[index] = 3.0 * (before * slopes[index - 1] + after * slopes[index])
        self._velocities: _Array = np.asarray(np.linalg.solve(rows, right), dtype=np.float64)
        begin, end = self._velocities[:-1], self._velocities[1:]
        rates = (6.0 * slopes - 4.0 * begin - 2.0 * end) / steps
        self._jerks: _Array = 6.0 * (begin + end - 2.0 * slopes) / steps**2
        self._accelerations: _Array = np.vstack([rates, rates[-1:] + self._jerks[-1:] * steps[-1]])
        self._turns = self._fastest(steps)

    def _fastest(self, steps: _Array) -> _Array:
        """The velocities within the segments where the acceleration is zero [rad/s]; those at the begin without one."""
        rates, begin = self._accelerations[:-1], self._velocities[:-1]
        at = np.clip(-rates / np.where(self._jerks == 0.0, np.inf, self._jerks), 0.0, steps)
        return begin + at * (rates + 0.5 * at * self._jerks)

    def _shares(self, limits: JointLimits) -> tuple[_Array, _Array, _Array]:
        """Of the limits, of each joint at each time."""
        return (
            np.abs(np.vstack([self._velocities, self._turns])) / limits.velocity,
            np.abs(self._accelerations) / limits.acceleration,
            np.abs(self._jerks) / limits.jerk,
        )

    def share(self, limits: JointLimits) -> float:
        """The largest share of a limit that is used."""
        return max(float(each.max()) for each in self._shares(limits))

    def beyond(self, names: Sequence[str], limits: JointLimits) -> Exception:
        """Why it cannot be followed: the joint that is furthest beyond a limit."""
        shares, tops = self._shares(limits), (limits.velocity, limits.acceleration, limits.jerk)
        worst = int(np.argmax([each.max() for each in shares]))
        row, joint = np.unravel_index(int(shares[worst].argmax()), shares[worst].shape)
        quantity, unit = _QUANTITIES[worst]
        limit = tops[worst][int(joint)]
        return trajectory_refused(
            message(
                "chunk_beyond_limit",
                joint=names[int(joint)],
                quantity=quantity,
                unit=unit,
                value=float(shares[worst][row, joint]) * limit,
                limit=limit,
                time=float(self._times[int(row) % len(self._times)]),
            )
        )

    def spline(self) -> Spline:
        """The same as segments; its last point has a velocity and an acceleration."""
        points = [
            TrajectoryPoint(float(time), tuple(map(float, position)), tuple(map(float, velocity)))
            for time, position, velocity in zip(self._times, self._positions, self._velocities, strict=True)
        ]
        points[-1] = points[-1]._replace(acceleration=tuple(map(float, self._accelerations[-1])))
        return spline_through(points)
