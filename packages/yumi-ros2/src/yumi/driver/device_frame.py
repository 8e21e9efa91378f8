"""A frame of a device with which a person teleoperates: what the device reports for each arm at one moment.

The operator's frame has x away from the operator, y to the left and z up; the robot's base has the same axes, seen from
behind the robot. A device with other axes turns them before it sends: WebXR's (x, y, z) is (-z, -x, y) here.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import hypot, isfinite, pi
from typing import Annotated, Literal, TypeAlias

import msgspec

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import Joints, Side, by_side
from yumi.control.shared_state import Limited
from yumi.control.tool_goal import check_twist
from yumi.driver.reports import Said

Six: TypeAlias = tuple[float, float, float, float, float, float]
_Fraction = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]

_FARTHEST = 100.0  # [m], [rad] a device that reports more is not in a room
_NO_QUATERNION = 0.5  # of length 1 it should be


class DeviceHand(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """What a device reports for one arm; with the clutch held exactly one of ``pose``, ``twist`` and ``joints``.

    Attributes:
        clutch: whether the person holds the clutch: nothing moves without.
        pose: of the device's hand in the operator's frame: x, y, z [m] and the quaternion w, x, y, z. The tool moves by
            what the hand has moved since the clutch was pressed.
        twist: velocity of the tool [m/s] and its angular velocity [rad/s] in the operator's frame.
        joints: of a leader arm [rad], (7,) in chain order, with the signs of the arm that follows.
        gripper: 0 is open, 1 is closed; None leaves it. Where it is when the clutch engages changes nothing; each
            change from then on counts.
        elbow: beside a pose an angle [rad] by whose change the arm angle changes, None keeps the arm angle; beside a
            twist the arm angle's speed [rad/s].
        is_in_tool: whether ``twist`` is seen from the tool instead.
    """

    clutch: bool = False
    pose: Joints | None = None
    twist: Six | None = None
    joints: Joints | None = None
    gripper: _Fraction | None = None
    elbow: float | None = None
    is_in_tool: bool = False

    def check(self, arm: str) -> None:
        """See that the values go together; raises CommandRefused."""
        motions = [values for values in (self.pose, self.twist, self.joints) if values is not None]
        if len(motions) > 1 or (self.clutch and not motions):
            raise CommandRefused(message("device_motion_count", arm=arm, count=len(motions)))
        elbow = () if self.elbow is None else (self.elbow,)
        for value in (*(self.pose or ()), *(self.joints or ()), *elbow):
            if not abs(value) <= _FARTHEST:  # NaN too
                raise CommandRefused(message("device_value_implausible", arm=arm, value=f"{value:g}"))
        if self.pose is not None and abs(hypot(*self.pose[3:]) - 1.0) > _NO_QUATERNION:
            raise CommandRefused(message("device_quaternion_malformed", arm=arm, length=hypot(*self.pose[3:])))
        check_twist((*(self.twist or ()), *elbow))


class DeviceSettings(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """How a tool follows a device.

    Attributes:
        scale: the tool moves so much as the hand; turns are not scaled. It is a factor on a twist, too. With a pose,
            scale and yaw are those of when the clutch was pressed.
        yaw: by which the operator's frame is turned about the vertical from the robot's base [rad]: 0 stands behind the
            robot, pi opposite of it.
        speed: of the tool, at most [m/s]; a hand that is faster is followed later.
        turning: of the tool's orientation and of the arm angle, at most [rad/s].
        joint_speed: of the goal of each joint that follows a leader arm, at most [rad/s]; a joint whose goals were
            missing for a while catches up within its own limits.
        cutoff: of the One-Euro filter for a hand that stands still [Hz]; lower takes more of its trembling, 0 is none.
        beta: by which the filter's cutoff grows with the hand's speed [Hz per m/s or rad/s]; higher lags less.
        is_absolute: whether a follower goes to where its leader arm is, no joint further than 0.2 rad away at first,
            instead of keeping the offset that they had when the clutch was pressed.
    """

    scale: Annotated[float, msgspec.Meta(ge=0.2, le=1.0)] = 1.0
    yaw: Annotated[float, msgspec.Meta(ge=-2.0 * pi, le=2.0 * pi)] = 0.0
    speed: Annotated[float, msgspec.Meta(ge=0.01, le=1.0)] = 0.5
    turning: Annotated[float, msgspec.Meta(ge=0.05, le=6.0)] = 2.0
    joint_speed: Annotated[float, msgspec.Meta(ge=0.05, le=3.0)] = 1.0
    cutoff: Annotated[float, msgspec.Meta(ge=0.0, le=100.0)] = 3.0
    beta: Annotated[float, msgspec.Meta(ge=0.0, le=1000.0)] = 20.0
    is_absolute: bool = False

    def check(self) -> None:
        """See that each value is within its range, for settings that no decoder has checked; raises CommandRefused."""
        for name, lowest, highest in _RANGES:
            value = getattr(self, name)
            if not lowest <= value <= highest:  # NaN too
                raise CommandRefused(
                    message("device_setting_out_of_range", name=name, value=value, lowest=lowest, highest=highest)
                )


_RANGES = tuple(
    (field.name, field.type.ge, field.type.le)
    for field in msgspec.inspect.type_info(DeviceSettings).fields  # type: ignore[attr-defined]
    if isinstance(field.type, msgspec.inspect.FloatType)
)


class DeviceFrame(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True, omit_defaults=True):
    """What a device reports at one moment; an arm that is left out has its clutch released.

    Attributes:
        time: on the device's own clock [s], when it was where it reports: the newest counts, older ones are dropped.
        seen: on the clock of the driver's machine [s], a time that the device had been sent when it made the frame, as
            that of the newest state: how old the frame may be. None for a device of the driver's own machine, whose
            frames take no time.
        right: for the right arm.
        left: for the left arm.
        settings: how the tools follow.
    """

    time: float
    seen: float | None = None
    right: DeviceHand = DeviceHand()
    left: DeviceHand = DeviceHand()
    settings: DeviceSettings = DeviceSettings()

    @property
    def by_arm(self) -> Mapping[Side, DeviceHand]:
        """What it reports for each arm."""
        return by_side(self.right, self.left)

    def check(self) -> None:
        """See that the values go together; raises CommandRefused."""
        for time in (self.time, 0.0 if self.seen is None else self.seen):
            if not isfinite(time):
                raise CommandRefused(message("device_time_not_finite", time=str(time)))
        self.settings.check()
        for side, hand in self.by_arm.items():
            hand.check(side.word)


ClutchWord = Literal["released", "engaging", "engaged", "inert"]


class TeleoperatedArmReport(msgspec.Struct, frozen=True):
    """How an arm is teleoperated.

    Attributes:
        clutch: ``released``; ``engaging``, held but the arm is being taken over and moves from when it stands;
            ``engaged``, the arm follows; ``inert``, held, but nothing moves until it was released and pressed again.
        why: a held clutch is inert; None otherwise.
        limited: what the arm is kept apart from now, to be felt.
        gripper: why the gripper did not take its goal; None otherwise.
    """

    clutch: ClutchWord = "released"
    why: Said | None = None
    limited: Limited | None = None
    gripper: Said | None = None


class TeleoperationReport(msgspec.Struct, frozen=True):
    """What became of a frame.

    Attributes:
        right: of the right arm.
        left: of the left arm.
        dropped: frames of this device that were dropped, being older than others or too late.
    """

    right: TeleoperatedArmReport = TeleoperatedArmReport()
    left: TeleoperatedArmReport = TeleoperatedArmReport()
    dropped: int = 0

    @property
    def arms(self) -> Mapping[Side, TeleoperatedArmReport]:
        """Of each arm."""
        return by_side(self.right, self.left)
