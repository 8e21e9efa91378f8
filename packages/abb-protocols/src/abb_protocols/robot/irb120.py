"""A robot of six axes with a spherical wrist as data: IRB 120-3/0.6."""

from __future__ import annotations

from functools import cache
from itertools import product
from math import acos, atan2, cos, hypot, pi, radians, sin, tau

import numpy as np
from numpy.typing import NDArray

from abb_protocols.robot.arm_kinematics import KinematicArm
from abb_protocols.robot.confdata import CONFIGURATION_TOLERANCE, Confdata, quarter_turn
from abb_protocols.robot.joints import ORIGIN_POSE, JointLimits, Joints, Pose
from abb_protocols.robot.kinematics import matrix_from_quaternion
from abb_protocols.robot.rotations import rotations_about

_Array = NDArray[np.float64]

_X, _Y, _Z = range(3)
_ROUNDING = 1e-9  # [rad]: a limit after a calculation is not beyond the limit

# Lengths of an IRB 120-3/0.6 [m] (reference/robots.md).
_BASE, _LOWER_ARM, _ELBOW_RISE, _FOREARM, _FLANGE = 0.290, 0.270, 0.070, 0.302, 0.072
_REACH = hypot(_FOREARM, _ELBOW_RISE)
_ELBOW_ANGLE = atan2(_FOREARM, _ELBOW_RISE)  # from the lower arm's direction to the wrist, all joints at zero

# Ranges and speeds: ABB's; accelerations and jerks: ours, as ABB publishes none.
_IRB120_LIMITS = JointLimits(
    lower=tuple(map(radians, (-165.0, -110.0, -110.0, -160.0, -120.0, -400.0))),
    upper=tuple(map(radians, (165.0, 110.0, 70.0, 160.0, 120.0, 400.0))),
    velocity=tuple(map(radians, (250.0, 250.0, 250.0, 320.0, 320.0, 420.0))),
    acceleration=(25.0, 25.0, 25.0, 50.0, 50.0, 50.0),
    jerk=(400.0, 400.0, 400.0, 800.0, 800.0, 800.0),
)


def _six_axis_configuration(position: Joints) -> Confdata:
    """RAPID's confdata of an IRB 120: quarter turns of axes 1, 4 and 6, and one of eight branches.

    The branch adds 4 where the wrist is behind axis 1, 2 where it is behind the lower arm, 1 where axis 5 is negative.
    """
    a1, a2, a3, a4, a5, a6 = position
    wrist_ahead = _LOWER_ARM * sin(a2) + _REACH * sin(a2 + a3 + _ELBOW_ANGLE)
    cfx = 4 * (wrist_ahead < 0.0) + 2 * (sin(a3 + _ELBOW_ANGLE) < 0.0) + (a5 < -CONFIGURATION_TOLERANCE)
    return Confdata(quarter_turn(a1), quarter_turn(a4), quarter_turn(a6), cfx)


def _six_axis_postures(tool0: Pose, limits: JointLimits) -> tuple[Joints, ...]:
    """In closed form: two ways to face the wrist, two elbows, two wrists, and full turns within the limits."""
    rotation = matrix_from_quaternion(tool0.orientation)
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


def _turn(axis: int, angle: float) -> _Array:
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
    return list(product(*choices))


@cache
def irb120() -> KinematicArm:
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
    return KinematicArm(
        turns_about=(_Z, _Y, _Y, _X, _Y, _X),
        offsets=np.array(offsets),
        end=_TOOL0_AT_ZERO,
        name="robot",
        axes=(1, 2, 3, 4, 5, 6),
        foot_to_world=ORIGIN_POSE,
        limits=_IRB120_LIMITS,
        home=(0.0, 0.0, 0.0, 0.0, radians(30.0), 0.0),
        configuration=_six_axis_configuration,
        tool_speed=6.2,
        tool_acceleration=28.0,
        find_postures=lambda tool0, _: _six_axis_postures(tool0, _IRB120_LIMITS),
        spherical_wrist=4,
    )
