"""Gamepads and SpaceMice of this machine: found and read by evdev, the kernel's interface to input devices."""

from __future__ import annotations

from collections.abc import Mapping
from glob import glob
from math import inf
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

from abb_protocols.catalogue import message, said_by
from abb_protocols.errors import RobotNotReady, missing_extra
from yumi.api.teleoperation_devices import Inputs

if TYPE_CHECKING:
    from evdev import InputDevice

_Kind = Literal["gamepad", "spacemouse"]

_DEAD = 0.1  # of an axis: so far from its middle it rests
_FORGOTTEN = 0.1  # [s] a SpaceMouse that reports changes reports no more where its cap rests
_SILENT = 0.2  # [s] a SpaceMouse whose cap is not at rest reports each 8 to 16 ms: a silent one may be out of range
_LOST = 1.0  # [s] the kernel leaves out what has not changed, but no hand holds all six axes still for so long
_FARTHEST = 350.0  # where the cap of a SpaceMouse that reports changes is at its end
_SIX = ("X", "Y", "Z", "RX", "RY", "RZ")
_3DCONNEXION = 0x256F
_LOGITECH = 0x046D  # its SpaceNavigators and SpacePilots are older than 3Dconnexion's own number
_NODES = "/dev/input/event*"


class FoundDevice(NamedTuple):
    """A device of this machine.

    Attributes:
        path: of its file.
        name: as it calls itself.
        kind: what it is.
    """

    path: str
    name: str
    kind: _Kind

    def __str__(self) -> str:
        return f"{self.path}  {self.kind:<11}{self.name}"


def _evdev() -> Any:
    try:
        import evdev  # noqa: PLC0415 - the extra brings it
    except ImportError as error:
        raise missing_extra(message("devices_need_evdev"), "yumi-ros2", "teleop") from error
    return evdev


def find_devices() -> tuple[FoundDevice, ...]:
    """The gamepads and SpaceMice that this user may read.

    Raises:
        MissingPrerequisite: evdev is not installed.
    """
    evdev, found = _evdev(), []
    for path in sorted(evdev.list_devices()):
        try:
            device = evdev.InputDevice(path)
        except OSError:  # unplugged meanwhile
            continue
        kind = _kind_of(device)
        if kind is not None:
            found.append(FoundDevice(path, device.name, kind))
        device.close()
    return tuple(found)


def open_device(path: str = "", kind: _Kind | None = None) -> tuple[FoundDevice, OpenDevice]:
    """A gamepad or SpaceMouse: the one at ``path``, or the first of a kind, or the first.

    Raises:
        MissingPrerequisite: evdev is not installed.
        RobotNotReady: there is none, or it cannot be read; the message says what to do.
    """
    evdev = _evdev()
    if not path:
        fitting = [each for each in find_devices() if kind in (None, each.kind)]
        if not fitting:
            unreadable = len(glob(_NODES)) - len(evdev.list_devices())
            code = "input_devices_unreadable" if unreadable > 0 else "no_input_device"
            raise RobotNotReady(message(code, kind=kind or "gamepad or spacemouse", count=unreadable))
        path = fitting[0].path
    try:
        device = evdev.InputDevice(path)
    except OSError as error:
        raise RobotNotReady(message("input_device_unreadable", path=path, why=said_by(error))) from error
    found = _kind_of(device)
    if found is None or kind not in (None, found):
        device.close()
        raise RobotNotReady(message("input_device_of_other_kind", path=path, name=device.name, kind=kind or "gamepad"))
    return FoundDevice(path, device.name, found), OpenDevice(device, reports_on=found == "spacemouse")


def _kind_of(device: InputDevice) -> _Kind | None:
    names = {code for codes in _codes_of(device).values() for code in codes.values()}
    is_six = any({f"{prefix}_{axis}" for axis in _SIX} <= names for prefix in ("ABS", "REL"))
    is_ours = device.info.vendor in (_3DCONNEXION, _LOGITECH) or "space" in device.name.lower()
    if is_six and is_ours and "BTN_0" in names:
        return "spacemouse"
    return "gamepad" if {"BTN_SOUTH", "BTN_TL", "BTN_TR", "ABS_X", "ABS_Y"} <= names else None


def _codes_of(device: InputDevice) -> Mapping[int, Mapping[int, str]]:
    """The codes that a device has, with their names, by their type."""
    ecodes = _evdev().ecodes
    return {
        kind: {code: _name(ecodes.bytype[kind].get(code, "")) for code in codes}
        for kind, codes in device.capabilities(absinfo=False).items()
        if kind in (ecodes.EV_KEY, ecodes.EV_ABS, ecodes.EV_REL)
    }


def _name(names: str | tuple[str, ...]) -> str:
    """The one name of a code that has several: BTN_0 is BTN_MISC, and BTN_SOUTH is BTN_A and BTN_GAMEPAD, too."""
    each = (names,) if isinstance(names, str) else tuple(names)
    return next((name for name in each if name in ("BTN_0", "BTN_SOUTH", "BTN_EAST")), each[0])


class OpenDevice:
    """A gamepad or SpaceMouse that is open: its newest axes and buttons.

    A button that is held when it is opened counts, which the driver sees: nothing moves until it is released.

    Args:
        device: as the library has it.
        reports_on: whether the device reports on and on while an axis is not at rest, as a SpaceMouse does. When such a
            one falls silent, its axes count as at rest, and soon its buttons as let go, until they are pressed again.
    """

    def __init__(self, device: InputDevice, *, reports_on: bool = False) -> None:
        self._device, self._ecodes, self._reports_on = device, _evdev().ecodes, reports_on
        self._moved = -inf  # when an axis was reported last
        self._codes = _codes_of(device)
        self._ranges = {code: device.absinfo(code) for code in self._codes.get(self._ecodes.EV_ABS, {})}
        self._axes: dict[str, float] = {}
        self._pressed: set[str] = set()
        self._came: dict[str, float] = {}  # when a change was reported last, by axis
        self._read_all()

    def close(self) -> None:
        """Let others have it."""
        self._device.close()

    def inputs(self, now: float) -> Inputs:
        try:
            self._take_events(now)
        except OSError as error:
            raise RobotNotReady(message("input_device_gone", name=self._device.name, why=said_by(error))) from error
        for name, came in self._came.items():
            if now - came > _FORGOTTEN:
                self._axes[name] = 0.0
        axes, silence = dict(self._axes), now - self._moved
        if self._reports_on and any(axes.values()):
            if silence > _SILENT:
                axes = dict.fromkeys(axes, 0.0)
            if silence > _LOST:
                self._pressed.clear()
        return Inputs(axes, frozenset(self._pressed))

    def _take_events(self, now: float) -> None:
        ecodes, is_incomplete = self._ecodes, False
        while True:
            try:
                events = list(self._device.read())
            except BlockingIOError:
                if is_incomplete:  # what is held may have been let go, and what still waited is older than that
                    self._read_all()
                return
            for event in events:
                name = self._codes.get(event.type, {}).get(event.code, "")
                if event.type == ecodes.EV_SYN and event.code == ecodes.SYN_DROPPED:
                    is_incomplete = True  # the kernel had no room for all
                elif event.type == ecodes.EV_KEY and name:
                    (self._pressed.add if event.value else self._pressed.discard)(name)
                elif event.type == ecodes.EV_ABS and name:
                    self._moved = now
                    self._axes[name] = self._deflection(event.code, event.value)
                elif event.type == ecodes.EV_REL and name:
                    self._came[name] = self._moved = now
                    self._axes[name] = _without_rest(max(-1.0, min(1.0, event.value / _FARTHEST)))

    def _read_all(self) -> None:
        """What is held and where the axes are, without the events that led there."""
        keys = self._codes.get(self._ecodes.EV_KEY, {})
        self._pressed = {keys[code] for code in self._device.active_keys() if code in keys}
        for code, name in self._codes.get(self._ecodes.EV_ABS, {}).items():
            self._axes[name] = self._deflection(code, self._device.absinfo(code).value)
        for name in self._came:
            self._axes[name] = 0.0
        self._came.clear()

    def _deflection(self, code: int, value: float) -> float:
        """How far an axis is from where it rests, as a fraction of its range."""
        name, info = self._codes[self._ecodes.EV_ABS][code], self._ranges[code]
        if info.max <= info.min:
            return 0.0
        fraction = (value - info.min) / (info.max - info.min)
        return _without_rest(fraction if self._is_trigger(name) else 2.0 * fraction - 1.0)

    def _is_trigger(self, name: str) -> bool:
        """Whether an axis rests at its lower end: Z and RZ do beside a right stick of RX and RY."""
        names = self._codes.get(self._ecodes.EV_ABS, {}).values()
        is_pad = "BTN_SOUTH" in self._codes.get(self._ecodes.EV_KEY, {}).values()
        return name in ("ABS_GAS", "ABS_BRAKE") or (name in ("ABS_Z", "ABS_RZ") and is_pad and "ABS_RX" in names)


def _without_rest(deflection: float) -> float:
    """0 near the middle, and from there on up to the same end."""
    beyond = max(0.0, abs(deflection) - _DEAD) / (1.0 - _DEAD)
    return beyond if deflection > 0.0 else -beyond
