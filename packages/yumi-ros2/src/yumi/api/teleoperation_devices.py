"""Devices with which a script lets a person teleoperate: gamepads, SpaceMice and leader arms.

A device is read again and again, see :func:`teleoperate`. What its axes and buttons mean is decided here, from values
alone; where the values come from is :mod:`yumi.api.input_device`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping, Sequence
from math import isfinite
from typing import NamedTuple, Protocol

from abb_protocols.catalogue import message, said_by
from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.robot.joints import JOINT_COUNT, Side, joints
from yumi.api.attach import RunningDriver
from yumi.driver.device_frame import DeviceFrame, DeviceHand, DeviceSettings, Six, TeleoperationReport
from yumi.driver.motion_commands import Teleoperate


class Device(Protocol):
    """What a person holds."""

    def read(self, now: float) -> Mapping[Side, DeviceHand]:
        """What it reports ``now`` [s] for each arm, without waiting.

        Raises:
            YumiError: it is gone, or what it reports means nothing.
        """


_RATE = 60.0
"""Frames a second."""


def teleoperate(
    driver: RunningDriver,
    device: Device,
    settings: DeviceSettings,
    on_report: Callable[[TeleoperationReport], None] = lambda report: None,
    wait: Callable[[float], object] = time.sleep,
) -> None:
    """Have the arms of a running driver follow a device, until one of the two fails.

    Args:
        driver: of the robot.
        device: read :data:`_RATE` times a second.
        settings: how the arms follow.
        on_report: takes what became of each frame.
        wait: waits for so long [s]; what it raises ends teleoperation.

    Raises:
        YumiError: the device or the driver is gone, or the driver refuses; the arms brake then and hold.
    """
    due = time.monotonic()
    while True:
        now = time.monotonic()
        reports = device.read(now)
        frame = DeviceFrame(
            time=now,
            right=reports.get(Side.RIGHT, DeviceHand()),
            left=reports.get(Side.LEFT, DeviceHand()),
            settings=settings,
        )
        on_report(driver.call(Teleoperate(frame=frame)))
        due = max(due + 1.0 / _RATE, time.monotonic())
        wait(max(0.0, due - time.monotonic()))


class Inputs(NamedTuple):
    """The axes and buttons of a gamepad or SpaceMouse.

    Attributes:
        axes: by the kernel's name, such as ``ABS_X``: -1 to 1, or 0 to 1 of a trigger; 0 where it rests.
        pressed: the buttons that are held, by the kernel's name, such as ``BTN_TR``.
    """

    axes: Mapping[str, float]
    pressed: frozenset[str]


class InputSource(Protocol):
    """Where the inputs of a gamepad or SpaceMouse come from."""

    def inputs(self, now: float) -> Inputs:
        """The newest, without waiting; raises RobotNotReady where the device is gone."""


class Gamepad:
    """A gamepad: the left stick and the triggers move the tool, the right stick and the cross turn it.

    The right bumper is the clutch of the right arm, the left bumper that of the left arm; both may be held. The lower
    button closes the grippers of the arms whose clutch is held, the right one opens them.

    Args:
        source: of its inputs.
        settings: of which a stick pushed to its end takes the full speeds.
        sides: the arms that it moves.
        is_in_tool: whether directions are those of the tool.
    """

    def __init__(
        self,
        source: InputSource,
        settings: DeviceSettings,
        sides: Collection[Side] = tuple(Side),
        *,
        is_in_tool: bool = False,
    ) -> None:
        self._source, self._settings, self._is_in_tool = source, settings, is_in_tool
        self._sides = sides
        self._grippers: dict[Side, float] = {}

    def read(self, now: float) -> Mapping[Side, DeviceHand]:
        axes, pressed = self._source.inputs(now)

        def axis(name: str) -> float:
            return axes.get(name, 0.0)

        # Without an axis RX the right stick is Z and RZ, as over Bluetooth, and the triggers are others, or buttons.
        is_usual = "ABS_RX" in axes
        right_x, right_y = ("ABS_RX", "ABS_RY") if is_usual else ("ABS_Z", "ABS_RZ")
        triggers = ("ABS_Z", "ABS_RZ") if is_usual else ("ABS_BRAKE", "ABS_GAS")
        lower, upper = (axis(name) for name in triggers)
        if not axes.keys() & set(triggers):
            lower, upper = float("BTN_TL2" in pressed), float("BTN_TR2" in pressed)
        translation = -axis("ABS_Y"), -axis("ABS_X"), upper - lower
        turn = axis("ABS_HAT0X"), -axis(right_y), -axis(right_x)
        bumpers = {Side.RIGHT: "BTN_TR", Side.LEFT: "BTN_TL"}
        clutches = {side: bumper in pressed for side, bumper in bumpers.items() if side in self._sides}
        reports = {}
        for side, is_held in clutches.items():
            if is_held and {"BTN_SOUTH", "BTN_EAST"} & pressed:
                self._grippers[side] = 1.0 if "BTN_SOUTH" in pressed else 0.0
            reports[side] = DeviceHand(
                clutch=is_held,
                twist=_twist_of(translation, turn, self._settings),
                elbow=-axis("ABS_HAT0Y") * self._settings.turning,
                gripper=self._grippers.get(side),
                is_in_tool=self._is_in_tool,
            )
        return reports


class SpaceMouse:
    """A SpaceMouse: its cap moves and turns the tool as it is moved and turned itself.

    The left button is the clutch; the right one closes and opens the grippers while the clutch is held.

    Args:
        source: of its inputs.
        settings: of which a cap pushed to its end takes the full speeds.
        sides: the arms that it moves.
        is_in_tool: whether directions are those of the tool.
    """

    def __init__(
        self, source: InputSource, settings: DeviceSettings, sides: Sequence[Side], *, is_in_tool: bool = False
    ) -> None:
        self._source, self._settings, self._sides, self._is_in_tool = source, settings, tuple(sides), is_in_tool
        self._gripper: float | None = None
        self._was_pressed = False

    def read(self, now: float) -> Mapping[Side, DeviceHand]:
        axes, pressed = self._source.inputs(now)

        def moved(x: str, y: str, z: str) -> tuple[float, float, float]:
            """The device has x to the right, y towards the person and z down."""
            right, back, down = (axes.get(f"ABS_{name}", axes.get(f"REL_{name}", 0.0)) for name in (x, y, z))
            return -back, -right, -down

        is_held, is_pressed = "BTN_0" in pressed, "BTN_1" in pressed
        if is_held and is_pressed and not self._was_pressed:
            self._gripper = 0.0 if self._gripper == 1.0 else 1.0
        self._was_pressed = is_pressed
        hand = DeviceHand(
            clutch=is_held,
            twist=_twist_of(moved("X", "Y", "Z"), moved("RX", "RY", "RZ"), self._settings),
            gripper=self._gripper,
            is_in_tool=self._is_in_tool,
        )
        return dict.fromkeys(self._sides, hand)


def _twist_of(translation: Sequence[float], turn: Sequence[float], settings: DeviceSettings) -> Six:
    """The velocity of deflections from -1 to 1: x away from the person, y to the left, z up; and turns about them."""
    (x, y, z), (a, b, c) = translation, turn
    speed, turning = settings.speed, settings.turning
    return (speed * x, speed * y, speed * z, turning * a, turning * b, turning * c)


class LeaderReading(NamedTuple):
    """A leader arm at one moment.

    Attributes:
        joints: its angles [rad], (7,), in chain order.
        clutch: whether the person holds the clutch: a button, a pedal, or a grip that is squeezed.
        gripper: 0 is open, 1 is closed; None where it has none.
    """

    joints: Sequence[float]
    clutch: bool
    gripper: float | None = None


class LeaderArm(Protocol):
    """An arm of your own that a person leads, such as a GELLO; what reads it is yours to write."""

    def read(self) -> LeaderReading:
        """Where it is now, without waiting."""


class Leader:
    """A leader arm as a device: its joints become those of the arm that follows.

    Args:
        arm: that is led.
        side: that follows.
        signs: 1 or -1 for each joint, (7,): which way the follower's joint turns.
        offsets: added to each joint after its sign [rad], (7,).
    """

    def __init__(
        self,
        arm: LeaderArm,
        side: Side,
        signs: Sequence[float] = (1.0,) * JOINT_COUNT,
        offsets: Sequence[float] = (0.0,) * JOINT_COUNT,
    ) -> None:
        if len(signs) != JOINT_COUNT or set(signs) - {1.0, -1.0}:
            raise CommandRefused(message("leader_signs_malformed", count=JOINT_COUNT, given=str(list(signs))))
        if len(offsets) != JOINT_COUNT or not all(map(isfinite, offsets)):
            raise CommandRefused(message("leader_offsets_malformed", count=JOINT_COUNT, given=str(list(offsets))))
        self._arm, self._side, self._signs, self._offsets = arm, side, tuple(signs), tuple(offsets)

    def read(self, now: float) -> Mapping[Side, DeviceHand]:
        try:
            reading = self._arm.read()
            values = tuple(map(float, reading.joints))
        except Exception as error:  # of another person's program
            raise RobotNotReady(message("leader_failed", kind=type(error).__name__, why=said_by(error))) from error
        if len(values) != JOINT_COUNT or not all(map(isfinite, values)):
            raise CommandRefused(message("leader_joints_malformed", count=JOINT_COUNT, given=str(list(values))))
        rows = zip(self._signs, values, self._offsets, strict=True)
        position = joints([sign * value + offset for sign, value, offset in rows])
        gripper = None if reading.gripper is None else min(1.0, max(0.0, float(reading.gripper)))
        return {self._side: DeviceHand(clutch=bool(reading.clutch), joints=position, gripper=gripper)}
