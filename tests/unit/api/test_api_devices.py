"""Gamepads, SpaceMice and leader arms: what their axes and buttons mean, and how they are read."""

from __future__ import annotations

from itertools import count
from math import nan
from types import SimpleNamespace
from typing import Any

import pytest

import fake_evdev
from abb_protocols.errors import CommandRefused, MissingPrerequisite, RobotNotReady
from abb_protocols.robot.joints import ZERO_JOINTS, Side
from fake_evdev import DROPPED, FakeInputDevice, Range, axis, button, change
from refusals import refused
from yumi.api import input_device, teleoperation_devices
from yumi.api.input_device import find_devices, open_device
from yumi.api.teleoperation_devices import Device, Gamepad, Leader, LeaderReading, SpaceMouse, teleoperate
from yumi.driver.device_frame import DeviceHand, DeviceSettings, TeleoperationReport

SETTINGS = DeviceSettings(speed=0.2, turning=1.0)


def connect(monkeypatch: pytest.MonkeyPatch, *devices: FakeInputDevice) -> None:
    monkeypatch.setattr(input_device, "_evdev", lambda: fake_evdev.library(*devices))


def opened(monkeypatch: pytest.MonkeyPatch, device: FakeInputDevice) -> Device:
    connect(monkeypatch, device)
    found, source = open_device()
    if found.kind == "gamepad":
        return Gamepad(source, SETTINGS)
    return SpaceMouse(source, SETTINGS, (Side.RIGHT,))


def right(device: Device, now: float = 0.0) -> DeviceHand:
    return device.read(now)[Side.RIGHT]


# ---- which devices there are


def test_gamepads_and_space_mice_are_found_among_other_devices(monkeypatch: pytest.MonkeyPatch) -> None:
    devices = (fake_evdev.mouse(), fake_evdev.gamepad(), fake_evdev.bluetooth_gamepad(), fake_evdev.space_mouse())
    connect(monkeypatch, *devices)
    assert [(each.path, each.kind) for each in find_devices()] == [
        ("/dev/input/event5", "gamepad"),
        ("/dev/input/event6", "gamepad"),
        ("/dev/input/event7", "spacemouse"),
    ]
    assert all(device.is_closed for device in devices)


def test_device_is_chosen_by_its_kind_or_its_path(monkeypatch: pytest.MonkeyPatch) -> None:
    connect(monkeypatch, fake_evdev.mouse(), fake_evdev.gamepad(), fake_evdev.space_mouse())
    assert open_device()[0].kind == "gamepad"
    assert open_device("", "spacemouse")[0].path == "/dev/input/event7"
    assert open_device("/dev/input/event7")[0].kind == "spacemouse"
    with refused(RobotNotReady, "input_device_of_other_kind", name="A mouse"):
        open_device("/dev/input/event1")
    with refused(RobotNotReady, "input_device_of_other_kind", kind="gamepad"):
        open_device("/dev/input/event7", "gamepad")
    with refused(RobotNotReady, "input_device_unreadable", path="/dev/input/event99"):
        open_device("/dev/input/event99")


def test_machine_without_a_device_says_whether_some_may_not_be_read(monkeypatch: pytest.MonkeyPatch) -> None:
    connect(monkeypatch, fake_evdev.mouse())
    monkeypatch.setattr(input_device, "glob", lambda pattern: ["/dev/input/event1"])
    with refused(RobotNotReady, "no_input_device", kind="spacemouse"):
        open_device("", "spacemouse")
    monkeypatch.setattr(input_device, "glob", lambda pattern: ["/dev/input/event1", "/dev/input/event2"])
    with refused(RobotNotReady, "input_devices_unreadable", count=1):
        open_device()


def test_library_that_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "evdev", None)
    with refused(MissingPrerequisite, "extra_missing", extra="teleop"):
        find_devices()


def test_library_names_codes_as_they_are_named_here() -> None:
    ecodes = pytest.importorskip("evdev").ecodes

    def all_of(names: str | tuple[str, ...]) -> set[str]:
        return {names} if isinstance(names, str) else {*names}

    for kind, names in fake_evdev.ECODES.bytype.items():
        assert not [name for code, name in names.items() if not all_of(name) <= all_of(ecodes.bytype[kind][code])]
    assert (ecodes.EV_KEY, ecodes.EV_REL, ecodes.EV_ABS, ecodes.SYN_DROPPED) == (1, 2, 3, 3)
    assert {each.kind for each in find_devices()} <= {"gamepad", "spacemouse"}


# ---- gamepads


def test_bumpers_of_a_gamepad_are_the_clutches_of_both_arms(monkeypatch: pytest.MonkeyPatch) -> None:
    pad = fake_evdev.gamepad()
    device = opened(monkeypatch, pad)
    assert not any(hand.clutch for hand in device.read(0.0).values())
    pad.events.append([button("BTN_TR", 1)])
    assert {side: hand.clutch for side, hand in device.read(0.0).items()} == {Side.RIGHT: True, Side.LEFT: False}
    pad.events += [[button("BTN_TL", 1)], [button("BTN_TR", 0)]]
    assert {side: hand.clutch for side, hand in device.read(0.0).items()} == {Side.RIGHT: False, Side.LEFT: True}


@pytest.mark.parametrize(
    ("events", "twist"),
    [
        ([axis("Y", -32768)], (0.2, 0, 0, 0, 0, 0)),
        ([axis("X", -32768)], (0, 0.2, 0, 0, 0, 0)),
        ([axis("RZ", 255)], (0, 0, 0.2, 0, 0, 0)),
        ([axis("Z", 255)], (0, 0, -0.2, 0, 0, 0)),
        ([axis("HAT0X", 1)], (0, 0, 0, 1.0, 0, 0)),
        ([axis("RY", -32768)], (0, 0, 0, 0, 1.0, 0)),
        ([axis("RX", -32768)], (0, 0, 0, 0, 0, 1.0)),
        ([axis("X", 2000), axis("RY", -3000)], ZERO_JOINTS[:6]),  # sticks that do not rest quite in the middle
        ([axis("X", -18022)], (0, 0.2 * 0.5, 0, 0, 0, 0)),
    ],
)
def test_sticks_triggers_and_cross_move_and_turn_the_tool(
    monkeypatch: pytest.MonkeyPatch, events: list[Any], twist: tuple[float, ...]
) -> None:
    pad = fake_evdev.gamepad()
    device = opened(monkeypatch, pad)
    assert right(device).twist == pytest.approx(ZERO_JOINTS[:6])
    pad.events.append(events)
    assert right(device).twist == pytest.approx(twist, abs=1e-4)


def test_cross_turns_the_elbow_of_the_arm(monkeypatch: pytest.MonkeyPatch) -> None:
    pad = fake_evdev.gamepad()
    device = opened(monkeypatch, pad)
    pad.events.append([axis("HAT0Y", -1)])
    assert right(device).elbow == 1.0


def test_gamepad_whose_right_stick_is_z_and_rz_is_understood(monkeypatch: pytest.MonkeyPatch) -> None:
    pad = fake_evdev.bluetooth_gamepad()
    device = opened(monkeypatch, pad)
    assert right(device).twist == pytest.approx(ZERO_JOINTS[:6], abs=1e-9)
    pad.events.append([axis("Z", 0), axis("RZ", 0), axis("GAS", 255)])
    assert right(device).twist == pytest.approx((0, 0, 0.2, 0, 1.0, 1.0))


def test_buttons_of_a_gamepad_move_the_grippers_of_clutches_that_are_held(monkeypatch: pytest.MonkeyPatch) -> None:
    pad = fake_evdev.gamepad()
    device = opened(monkeypatch, pad)
    pad.events.append([button("BTN_SOUTH", 1)])
    assert right(device).gripper is None
    pad.events.append([button("BTN_SOUTH", 0), button("BTN_TR", 1)])
    assert right(device).gripper is None
    pad.events.append([button("BTN_SOUTH", 1)])
    assert {side: hand.gripper for side, hand in device.read(0.0).items()} == {Side.RIGHT: 1.0, Side.LEFT: None}
    pad.events.append([button("BTN_SOUTH", 0), button("BTN_EAST", 1)])
    assert right(device).gripper == 0.0


def test_what_was_missed_is_read_again(monkeypatch: pytest.MonkeyPatch) -> None:
    pad = fake_evdev.gamepad()
    device = opened(monkeypatch, pad)
    pad.events.append([button("BTN_TR", 1), axis("X", -32768)])
    assert right(device).clutch
    pad.events.append([DROPPED])  # the button was let go, and the stick, in what the kernel had no room for
    assert not right(device).clutch
    assert right(device).twist == pytest.approx(ZERO_JOINTS[:6])


def test_what_still_waited_when_events_were_missed_is_older_than_what_is_read_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pad = fake_evdev.gamepad()
    device = opened(monkeypatch, pad)
    pad.events += [[DROPPED, button("BTN_TR", 1)], [axis("X", -32768)]]  # the bumper was let go after that
    assert not right(device).clutch
    assert right(device).twist == pytest.approx(ZERO_JOINTS[:6])


def test_cap_of_a_space_mouse_rests_when_events_were_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    mouse = fake_evdev.space_mouse(reports_changes=True)
    device = opened(monkeypatch, mouse)
    mouse.events.append([change("X", -350)])
    assert right(device).twist != pytest.approx(ZERO_JOINTS[:6])
    mouse.events.append([DROPPED])
    assert right(device).twist == pytest.approx(ZERO_JOINTS[:6])


def test_gamepad_moves_the_arms_that_it_is_for(monkeypatch: pytest.MonkeyPatch) -> None:
    pad = fake_evdev.gamepad()
    connect(monkeypatch, pad)
    device = Gamepad(open_device()[1], SETTINGS, (Side.LEFT,))
    pad.events.append([button("BTN_TR", 1), button("BTN_TL", 1)])
    assert {side: hand.clutch for side, hand in device.read(0.0).items()} == {Side.LEFT: True}


def test_button_that_is_held_from_the_beginning_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    pad = fake_evdev.gamepad()
    pad.held.add("BTN_TR")
    pad.axes[0] = Range(-32768, -32768, 32767)
    assert right(opened(monkeypatch, pad)) == DeviceHand(
        clutch=True, twist=(0.0, 0.2, 0.0, 0.0, 0.0, 0.0), elbow=0.0, gripper=None
    )


def test_device_that_was_unplugged_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    pad = fake_evdev.gamepad()
    device = opened(monkeypatch, pad)
    pad.is_gone = True
    with refused(RobotNotReady, "input_device_gone", name="Xbox Pad"):
        device.read(0.0)


# ---- SpaceMice


@pytest.mark.parametrize("reports_changes", [False, True])
def test_cap_of_a_space_mouse_moves_the_tool_as_it_is_moved(
    monkeypatch: pytest.MonkeyPatch, *, reports_changes: bool
) -> None:
    mouse, move = fake_evdev.space_mouse(reports_changes=reports_changes), change if reports_changes else axis
    device = opened(monkeypatch, mouse)
    mouse.events.append([move("Y", -350), move("X", -350), move("Z", -350), move("RZ", -350)])
    assert right(device).twist == pytest.approx((0.2, 0.2, 0.2, 0.0, 0.0, 1.0))
    assert not right(device).clutch
    mouse.events.append([button("BTN_0", 1)])
    assert right(device, 0.05).clutch


def test_cap_that_rests_reports_no_changes_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    mouse = fake_evdev.space_mouse(reports_changes=True)
    device = opened(monkeypatch, mouse)
    mouse.events.append([change("Y", -350)])
    assert right(device, 1.0).twist == pytest.approx((0.2, 0, 0, 0, 0, 0))
    assert right(device, 1.05).twist == pytest.approx((0.2, 0, 0, 0, 0, 0))
    assert right(device, 1.15).twist == pytest.approx(ZERO_JOINTS[:6])


def test_space_mouse_that_falls_silent_away_from_rest_moves_nothing_and_soon_lets_the_clutch_go(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mouse = fake_evdev.space_mouse()
    device = opened(monkeypatch, mouse)

    def state(now: float) -> tuple[bool, float]:
        hand = right(device, now)
        assert hand.twist is not None
        return hand.clutch, hand.twist[0]

    mouse.events.append([button("BTN_0", 1), axis("Y", -350), axis("X", -35)])
    assert state(1.0) == state(1.19) == (True, pytest.approx(0.2))
    assert state(1.21) == (True, 0.0)  # its cap may be held still to a count: the kernel reports changes alone
    mouse.events.append([axis("X", -36)])
    assert state(1.3) == (True, pytest.approx(0.2))
    assert state(2.31) == (False, 0.0)  # it is out of range
    mouse.events.append([axis("X", -37)])
    assert state(2.4) == (False, pytest.approx(0.2))  # the clutch may have been let go meanwhile
    mouse.events.append([button("BTN_0", 0), button("BTN_0", 1)])
    assert state(2.41) == (True, pytest.approx(0.2))


def test_clutch_of_a_space_mouse_at_rest_is_held_however_long_it_is_silent(monkeypatch: pytest.MonkeyPatch) -> None:
    mouse = fake_evdev.space_mouse()
    device = opened(monkeypatch, mouse)
    mouse.events.append([button("BTN_0", 1), axis("Y", -350), axis("Y", -5)])
    assert right(device, 1.0).clutch
    assert right(device, 60.0).clutch


def test_gamepad_whose_stick_is_held_still_moves_the_tool_on(monkeypatch: pytest.MonkeyPatch) -> None:
    pad = fake_evdev.gamepad()
    device = opened(monkeypatch, pad)
    pad.events.append([button("BTN_TR", 1), axis("Y", -32768)])
    assert right(device, 1.0).twist == right(device, 60.0).twist == pytest.approx((0.2, 0, 0, 0, 0, 0), abs=1e-4)


def test_button_of_a_space_mouse_closes_and_opens_the_gripper(monkeypatch: pytest.MonkeyPatch) -> None:
    mouse = fake_evdev.space_mouse()
    device = opened(monkeypatch, mouse)
    grips = []
    for events in ([button("BTN_1", 1)], [button("BTN_1", 0), button("BTN_0", 1)], [button("BTN_1", 1)], [], []):
        mouse.events.append(events)
        grips.append(right(device).gripper)
    mouse.events += [[button("BTN_1", 0)]]
    right(device)
    mouse.events += [[button("BTN_1", 1)]]
    grips.append(right(device).gripper)
    assert grips == [None, None, 1.0, 1.0, 1.0, 0.0]


# ---- leader arms


class Arm:
    def __init__(self, *joints: float, clutch: bool = True, gripper: float | None = None) -> None:
        self.reading = LeaderReading(joints, clutch, gripper)

    def read(self) -> LeaderReading:
        return self.reading


def test_joints_of_a_leader_get_signs_and_offsets() -> None:
    device = Leader(Arm(0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, gripper=1.2), Side.LEFT, (1, -1, 1, 1, 1, 1, -1), (1.0,) * 7)
    assert device.read(0.0) == {
        Side.LEFT: DeviceHand(
            clutch=True,
            joints=pytest.approx((1.1, 0.8, 1.3, 1.4, 1.5, 1.6, 0.3)),
            gripper=1.0,  # type: ignore[arg-type]
        )
    }


@pytest.mark.parametrize("joints", [(0.0,) * 6, (nan, *ZERO_JOINTS[1:])])
def test_leader_that_reports_no_joints_is_refused(joints: tuple[float, ...]) -> None:
    with refused(CommandRefused, "leader_joints_malformed", count=7):
        Leader(Arm(*joints), Side.RIGHT).read(0.0)


def test_signs_and_offsets_that_are_none_are_refused() -> None:
    with refused(CommandRefused, "leader_signs_malformed"):
        Leader(Arm(*ZERO_JOINTS), Side.RIGHT, (1.0, 0.5, 1.0, 1.0, 1.0, 1.0, 1.0))
    with refused(CommandRefused, "leader_offsets_malformed"):
        Leader(Arm(*ZERO_JOINTS), Side.RIGHT, offsets=(nan,) * 7)


# ---- frame by frame


class Ended(Exception):
    """The person has ended it."""


def test_frames_that_take_longer_than_their_period_follow_each_other_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    connect(monkeypatch, fake_evdev.gamepad())
    now, waits = count(0.0, 0.1), list[float]()  # each look at the clock takes longer than a period
    monkeypatch.setattr(teleoperation_devices.time, "monotonic", lambda: next(now))

    def wait(seconds: float) -> None:
        waits.append(seconds)
        if len(waits) == 3:
            raise Ended

    driver = SimpleNamespace(call=lambda command: TeleoperationReport())
    with pytest.raises(Ended):
        teleoperate(driver, Gamepad(open_device()[1], SETTINGS), SETTINGS, wait=wait)  # type: ignore[arg-type]
    assert waits == [0.0, 0.0, 0.0]
