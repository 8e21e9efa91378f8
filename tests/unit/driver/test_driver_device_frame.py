"""Frames of devices: what is refused, and that a refusal names the value."""

from __future__ import annotations

from math import inf, nan
from typing import Any

import msgspec
import pytest

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import ZERO_JOINTS
from refusals import refused
from yumi.driver.device_frame import DeviceFrame, DeviceHand, DeviceSettings
from yumi.driver.motion_commands import Teleoperate

POSE = (0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("hand", "code", "values"),
    [
        (DeviceHand(clutch=True), "device_motion_count", {"arm": "right", "count": 0}),
        (DeviceHand(pose=POSE, joints=ZERO_JOINTS), "device_motion_count", {"count": 2}),
        (DeviceHand(pose=(nan, *POSE[1:])), "device_value_implausible", {"value": "nan"}),
        (DeviceHand(pose=(1e4, *POSE[1:])), "device_value_implausible", {"value": "10000"}),
        (DeviceHand(pose=(*POSE[:3], 0.1, 0.0, 0.0, 0.0)), "device_quaternion_malformed", {"length": 0.1}),
        (DeviceHand(joints=(inf, *ZERO_JOINTS[1:])), "device_value_implausible", {"value": "inf"}),
        (DeviceHand(pose=POSE, elbow=nan), "device_value_implausible", {"value": "nan"}),
        (DeviceHand(twist=(nan, 0.0, 0.0, 0.0, 0.0, 0.0)), "twist_implausible", {}),
    ],
)
def test_hand_without_meaning_is_refused(hand: DeviceHand, code: str, values: dict[str, Any]) -> None:
    with refused(CommandRefused, code, **values):
        Teleoperate(frame=DeviceFrame(time=1.0, right=hand)).check()


@pytest.mark.parametrize("time", [nan, inf])
def test_time_that_is_none_is_refused(time: float) -> None:
    with refused(CommandRefused, "device_time_not_finite"):
        DeviceFrame(time=time).check()


@pytest.mark.parametrize(
    ("name", "value"),
    [("scale", 0.1), ("scale", 1.5), ("speed", 0.0), ("turning", nan), ("cutoff", -1.0), ("beta", inf)],
)
def test_setting_out_of_its_range_is_refused(name: str, value: float) -> None:
    with refused(CommandRefused, "device_setting_out_of_range", name=name):
        DeviceSettings(**{name: value}).check()  # type: ignore[arg-type]
    raw = msgspec.json.encode({"time": 1.0, "settings": {name: value}})
    with pytest.raises(msgspec.ValidationError):
        msgspec.json.decode(raw, type=DeviceFrame)
