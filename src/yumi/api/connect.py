"""How a script gets its robot: the address, and what else may be said about it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from inspect import signature
from math import radians
from pathlib import Path
from typing import Any, ParamSpec

from yumi.api.asynchronous import AsyncRobot
from yumi.api.motion import GOAL_CONTROLLER, STREAM_CONTROLLER, TRAJECTORY_CONTROLLER
from yumi.api.robot import Robot
from yumi.driver.settings import (
    ControllerSettings,
    Settings,
    override,
    password_of_environment,
    read_controllers,
    read_settings,
)
from yumi.driver.wiring import Controllers
from yumi.egm.udp import is_loopback
from yumi.errors import SettingsError
from yumi.robot.joints import Side
from yumi.settings import Entry

P = ParamSpec("P")
Given = Mapping[str, Any]
"""Settings of one group by name; None where nothing was given."""

VIRTUAL_RWS_PORT = 8080
"""The default port of ``yumi controller``."""


def connect(
    address: str | None = None,
    *,
    arms: str | Sequence[str] = ("right", "left"),
    default_speed_scale: float = 0.5,
    acceleration: float = 0.5,
    speed_scale: float | None = None,
    rws_port: int | None = None,
    left_egm_port: int | None = None,
    right_egm_port: int | None = None,
    user: str | None = None,
    password: str | None = None,
    config: Path | str | None = None,
    controllers: Path | str | None = None,
    on_step: Callable[[str], None] | None = None,
) -> Robot:
    """A robot at ``address``, to be connected by ``with``.

    ::

        with yumi.connect("192.168.125.1") as robot:
            robot.right.move_to(yumi.degrees(0, -130, -135, 30, 0, 40, 0))
            robot.left.gripper.open()
            robot.left.gripper.grasp(force=10.0)

    On entry the robot is brought to ready: motors on, RAPID program running, grippers calibrated, EGM on the arms. On
    exit, also after an error or Ctrl-C, the arms come to rest first, then EGM ends.

    Args:
        address: the controller's, ``host`` or ``host:port``; None takes the settings'. Without a port it is 80, on this
            machine 8080, where ``yumi controller`` serves.
        arms: on which EGM runs; the other one stands still.
        default_speed_scale: share of the joints' highest speeds, above 0 up to 1, of a motion that gives no
            ``speed_scale``.
        acceleration: the same for accelerations and jerks.
        speed_scale: factor on the speed of every motion, 0.01 to 1; None takes the settings': 1 for a robot on this
            machine, 0.1 for any other. See :attr:`yumi.api.robot.Robot.speed_scale`.
        rws_port: HTTP port of Robot Web Services.
        left_egm_port: UDP port where the left arm's datagrams arrive; and the right arm's:
        right_egm_port: as above.
        user: on the controller; ABB's default unless given.
        password: unless given the one in the environment variable ``YUMI_PASSWORD``, or the settings'.
        config: settings instead of the delivered ``yumi.yaml``.
        controllers: controllers instead of the delivered ``controllers.yaml``.
        on_step: given each step of what is done to the robot; None prints them where standard error is a terminal.

    Raises:
        SettingsError: a value is wrong; nothing was connected.
    """
    where = {"left_port": left_egm_port, "right_port": right_egm_port}
    password = password_of_environment() if password is None else password
    robot = {"user": user, "password": password, "speed_scale": speed_scale}
    settings = settings_for(address, rws_port, robot, where, config)
    return Robot(
        settings,
        controllers_for(settings, default_speed_scale, acceleration, controllers),
        _sides(arms),
        on_step or print_step,
    )


def print_step(step: str) -> None:
    """Show on a terminal what is done, and nothing elsewhere: connecting takes seconds."""
    if sys.stderr.isatty():
        sys.stderr.write(f"yumi: {step}\n")


def _asynchronous(build: Callable[P, Robot]) -> Callable[P, AsyncRobot]:
    def connect_async(*args: P.args, **options: P.kwargs) -> AsyncRobot:
        """The same robot for asyncio: ``async with yumi.connect_async(address) as robot``; see :func:`connect`."""
        return AsyncRobot(build(*args, **options))

    connect_async.__signature__ = signature(build)  # type: ignore[attr-defined]
    return connect_async


connect_async = _asynchronous(connect)


def settings_for(
    address: str | None,
    rws_port: int | None = None,
    login: Given | None = None,
    egm: Given | None = None,
    config: Path | str | None = None,
) -> Settings:
    """The settings with what was given to ``connect`` on top; None leaves a value as it is.

    Raises:
        SettingsError: a value is wrong.
    """
    values = {"robot": {**_address(address, rws_port), **(login or {})}, "egm": egm or {}}
    given = {
        group: {key: value for key, value in entries.items() if value is not None} for group, entries in values.items()
    }
    return override(read_settings(Path(config) if config else None), given, "connect")


def controllers_for(
    settings: Settings, default_speed_scale: float, acceleration: float, file: Path | str | None = None
) -> Controllers:
    """The controllers, those for single points with these fractions of the joints' limits and the robot's top speed.

    Raises:
        SettingsError: a value is wrong, or a controller is missing.
    """
    for name, value in (("default_speed_scale", default_speed_scale), ("acceleration", acceleration)):
        if not 0.0 < value <= 1.0:  # NaN too
            raise SettingsError(f"connect: {name} is {value}; allowed is above 0 up to 1.")
    scales = {
        "speed_scale": float(default_speed_scale),
        "acceleration_scale": float(acceleration),
        "top_speed": radians(settings.egm_motion.max_speed_deviation),
    }
    extra = {name: Entry(value, "connect", is_general=False) for name, value in scales.items()}
    chosen: dict[Side, tuple[ControllerSettings, ...]] = {}
    for side in Side:
        entries = read_controllers(side, Path(file) if file else None)
        missing = {GOAL_CONTROLLER, STREAM_CONTROLLER, TRAJECTORY_CONTROLLER} - {entry.name for entry in entries}
        if missing:
            raise SettingsError(f"The controllers of the {side.word} arm lack {', '.join(sorted(missing))}; add them.")
        chosen[side] = tuple(
            replace(entry, entries={**entry.entries, **extra}) if entry.name == GOAL_CONTROLLER else entry
            for entry in entries
        )
    return chosen


def _address(address: str | None, rws_port: int | None) -> Given:
    if address is None:
        return {"rws_port": rws_port}
    host, colon, port = address.rpartition(":") if address.count(":") == 1 else (address, "", "")
    if not host or (colon and not port.isdigit()):
        raise SettingsError(f"{address!r} is not an address; give a host name or IPv4 address, with :port if need be.")
    if colon and rws_port is not None:
        raise SettingsError(
            f"connect: the port is given twice, in {address!r} and as rws_port={rws_port}; give it once."
        )
    usual = VIRTUAL_RWS_PORT if is_loopback(host) else None
    given = int(port) if colon else rws_port
    return {"address": host, "rws_port": usual if given is None else given}


def _sides(arms: str | Sequence[str]) -> tuple[Side, ...]:
    words = (arms,) if isinstance(arms, str) else tuple(arms)
    known = {side.word: side for side in Side}
    if not words or any(word not in known for word in words) or len(set(words)) != len(words):
        raise SettingsError(f"connect: arms is {arms!r}; name 'right', 'left' or both.")
    return tuple(known[word] for word in words)
