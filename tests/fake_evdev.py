"""Input devices that are none, as the library evdev shows them: their events come from the test."""

from __future__ import annotations

import errno
from collections.abc import Iterable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, NamedTuple

EV_SYN, EV_KEY, EV_REL, EV_ABS = 0, 1, 2, 3
SYN_DROPPED = 3
KEYS = {
    0x100: ("BTN_0", "BTN_MISC"),
    0x101: "BTN_1",
    0x110: ("BTN_LEFT", "BTN_MOUSE"),
    0x130: ("BTN_A", "BTN_GAMEPAD", "BTN_SOUTH"),
    0x131: ("BTN_B", "BTN_EAST"),
    0x136: "BTN_TL",
    0x137: "BTN_TR",
    0x138: "BTN_TL2",
    0x139: "BTN_TR2",
}
AXES = {0: "X", 1: "Y", 2: "Z", 3: "RX", 4: "RY", 5: "RZ", 9: "GAS", 10: "BRAKE", 16: "HAT0X", 17: "HAT0Y"}
ECODES = SimpleNamespace(
    EV_SYN=EV_SYN,
    EV_KEY=EV_KEY,
    EV_REL=EV_REL,
    EV_ABS=EV_ABS,
    SYN_DROPPED=SYN_DROPPED,
    bytype={
        EV_KEY: KEYS,
        EV_ABS: {code: f"ABS_{name}" for code, name in AXES.items()},
        EV_REL: {code: f"REL_{name}" for code, name in AXES.items() if code < 6},
    },
)


class Event(NamedTuple):
    """An event of a device."""

    type: int
    code: int
    value: int


class Range(NamedTuple):
    """An axis as the kernel describes it."""

    value: int
    min: int
    max: int


def axis(name: str, value: int) -> Event:
    """An axis has moved."""
    return Event(EV_ABS, next(code for code, each in AXES.items() if each == name), value)


def change(name: str, value: int) -> Event:
    """An axis that reports changes has moved."""
    return axis(name, value)._replace(type=EV_REL)


def button(name: str, value: int) -> Event:
    """A button was pressed, 1, or let go, 0."""
    return Event(EV_KEY, next(code for code, names in KEYS.items() if name == names or name in names), value)


DROPPED = Event(EV_SYN, SYN_DROPPED, 0)


class FakeInputDevice:
    """A device at a path.

    Attributes:
        events: what it reports next, a list for each time it is read.
        held: the buttons that are held.
        is_gone: whether it was unplugged.
    """

    def __init__(
        self, path: str, name: str, vendor: int, buttons: Iterable[str], axes: Mapping[str, Range], changes: str = ""
    ) -> None:
        self.path, self.name, self.info = path, name, SimpleNamespace(vendor=vendor)
        self._buttons = [button(each, 0).code for each in buttons]
        self.axes = {axis(each, 0).code: span for each, span in axes.items()}
        self._changes = [axis(each, 0).code for each in changes.split()]
        self.events: list[Sequence[Event]] = []
        self.held: set[str] = set()
        self.is_gone = self.is_closed = False

    def capabilities(self, *, absinfo: bool) -> dict[int, list[int]]:
        assert not absinfo
        known = {EV_SYN: [0], EV_KEY: self._buttons, EV_ABS: list(self.axes), EV_REL: self._changes}
        return {kind: codes for kind, codes in known.items() if codes}

    def absinfo(self, code: int) -> Range:
        return self.axes[code]

    def active_keys(self) -> list[int]:
        return [button(each, 1).code for each in self.held]

    def read(self) -> Sequence[Event]:
        if self.is_gone:
            raise OSError(errno.ENODEV, "No such device")
        if not self.events:
            raise BlockingIOError
        return self.events.pop(0)

    def close(self) -> None:
        self.is_closed = True


_STICK, _TRIGGER, _CROSS = Range(0, -32768, 32767), Range(0, 0, 255), Range(0, -1, 1)


def gamepad(path: str = "/dev/input/event5") -> FakeInputDevice:
    """A gamepad as the kernel's driver xpad has it."""
    sticks = dict.fromkeys(("X", "Y", "RX", "RY"), _STICK)
    axes = {**sticks, **dict.fromkeys(("Z", "RZ"), _TRIGGER), **dict.fromkeys(("HAT0X", "HAT0Y"), _CROSS)}
    return FakeInputDevice(path, "Xbox Pad", 0x45E, ("BTN_A", "BTN_B", "BTN_TL", "BTN_TR"), axes)


def bluetooth_gamepad(path: str = "/dev/input/event6") -> FakeInputDevice:
    """A gamepad whose right stick is Z and RZ."""
    axes = {**dict.fromkeys(("X", "Y", "Z", "RZ"), Range(32768, 0, 65535)), **dict.fromkeys(("GAS", "BRAKE"), _TRIGGER)}
    return FakeInputDevice(path, "Pad over Bluetooth", 0x45E, ("BTN_A", "BTN_B", "BTN_TL", "BTN_TR"), axes)


def space_mouse(path: str = "/dev/input/event7", *, reports_changes: bool = False) -> FakeInputDevice:
    """A SpaceMouse, as newer ones report, or as older ones do."""
    six = ("X", "Y", "Z", "RX", "RY", "RZ")
    axes = {} if reports_changes else dict.fromkeys(six, Range(0, -350, 350))
    changes = " ".join(six) if reports_changes else ""
    return FakeInputDevice(path, "3Dconnexion SpaceMouse Compact", 0x256F, ("BTN_0", "BTN_1"), axes, changes)


def mouse(path: str = "/dev/input/event1") -> FakeInputDevice:
    """A mouse, with which nobody teleoperates."""
    return FakeInputDevice(path, "A mouse", 0x46D, ("BTN_LEFT",), {}, "X Y")


def library(*devices: FakeInputDevice) -> Any:
    """The library evdev on a machine with these devices."""

    def open_device(path: str) -> FakeInputDevice:
        for device in devices:
            if device.path == path:
                return device
        raise FileNotFoundError(errno.ENOENT, "No such file or directory")

    return SimpleNamespace(
        ecodes=ECODES, list_devices=lambda: [device.path for device in devices], InputDevice=open_device
    )
