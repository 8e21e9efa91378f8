"""Postures for the poses that scripts give: all of a pose, or the one to go to."""

from __future__ import annotations

from collections.abc import Sequence

from abb_protocols.catalogue import message, quoted
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.confdata import Confdata, configuration
from abb_protocols.robot.inverse_kinematics import (
    Unreachable,
    arm_angle,
    nearest_posture,
    postures,
    postures_of_each,
    unreachable,
)
from abb_protocols.robot.joints import JointLimits, Joints, Pose, Side
from yumi.api.poses import checked_angle, numbers_from
from yumi.control.motion.setpoint import largest_difference

_FURTHER_ANGLES = tuple(sign * number * 0.2618 for number in range(1, 12) for sign in (1.0, -1.0))  # [rad] 15° apart


def postures_of(side: Side, tool0: Pose, angle: float | None, now: Joints, limits: JointLimits) -> tuple[Joints, ...]:
    """All postures of a pose of tool0 with an arm angle, None for the present one; the nearest to ``now`` first."""
    found = postures(side, tool0, arm_angle(side, now) if angle is None else checked_angle(angle), limits)
    return tuple(sorted(found, key=lambda each: largest_difference(each, now)))


def posture_for(
    side: Side,
    tool0: Pose,
    angle: float | None,
    desired: Confdata | Sequence[int] | None,
    now: Joints,
    limits: JointLimits,
) -> Joints:
    """The posture to go to: with the configuration, or the nearest.

    Raises:
        Unreachable: there is none; where no arm angle was asked for, with none of those tried.
    """
    with_angle = arm_angle(side, now) if angle is None else checked_angle(angle)
    wanted = None if desired is None else _checked_configuration(desired)
    if wanted is None:
        try:
            near = nearest_posture(side, tool0, with_angle, now, limits)
        except Unreachable:
            near = None
        if near is not None and largest_difference(near, now) < 1.0:
            return near
    for angles in ([with_angle], [with_angle + turn for turn in _FURTHER_ANGLES] if angle is None else []):
        for own in postures_of_each(side, [tool0] * len(angles), angles, limits):
            found = [each for each in own if wanted is None or configuration(each) == wanted]
            if found:
                return min(found, key=lambda each: largest_difference(each, now))
    x, y, z = tool0.position
    if wanted is None:
        reason = message(
            "posture_missing" if angle is None else "posture_missing_at_angle", arm=side.word, x=x, y=y, z=z
        )
        raise unreachable(side, tool0, reason, now, limits)
    raise Unreachable(
        message(
            "posture_missing_in_configuration" if angle is None else "posture_missing_in_configuration_at_angle",
            arm=side.word,
            configuration=wanted,
            x=x,
            y=y,
            z=z,
        )
    )


def _checked_configuration(given: Sequence[int]) -> tuple[int, ...]:
    values = numbers_from(given, 4, "configuration")
    if any(each != int(each) for each in values):
        raise CommandRefused(message("pose_configuration_not_whole", given=quoted(given)))
    return tuple(map(int, values))
