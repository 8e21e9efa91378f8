"""`yumi teleop`: a person teleoperates the running driver's robot with a gamepad, a SpaceMouse or a leader arm."""

from __future__ import annotations

import sys
from collections.abc import Callable
from contextlib import ExitStack
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from math import radians
from pathlib import Path
from typing import Any

import click
import msgspec

from abb_protocols.catalogue import message, said_by
from abb_protocols.errors import CommandRefused, SettingsError
from abb_runtime.options import ARMS_TYPE, JsonOutput, OptionNumber, json_option, robot_option
from yumi.api.attach import attach
from yumi.api.input_device import find_devices, open_device
from yumi.api.teleoperation_devices import Device, Gamepad, Leader, LeaderArm, SpaceMouse, teleoperate
from yumi.cli.from_table import arms_of
from yumi.driver.command import side_of
from yumi.driver.device_frame import DeviceSettings, TeleoperatedArmReport, TeleoperationReport

_DEFAULT = DeviceSettings()


def _of_settings(name: str, lowest: float, highest: float, default: float, text: str) -> Callable[..., Any]:
    kind = OptionNumber(name, lowest, highest, is_open=False)
    return click.option(f"--{name}", type=kind, default=default, show_default=True, help=text)


def _numbers(text: str) -> tuple[float, ...]:
    """Numbers with commas between them."""
    try:
        return tuple(map(float, text.split(",")))
    except ValueError:
        raise click.BadParameter(f"{text!r} is no list of numbers, such as 1,-1,1,1,1,1,1.") from None


@click.command()
@click.argument("device", type=click.Choice(["gamepad", "spacemouse", "leader"]), required=False)
@click.option("--list", "is_list", is_flag=True, help="List the gamepads and SpaceMice of this machine, and end.")
@click.option(
    "--path", default="", metavar="FILE", help="The device's file, such as /dev/input/event7; else the first."
)
@click.option("--arm", type=ARMS_TYPE, help="Which arm.")
@_of_settings("scale", 0.2, 1.0, _DEFAULT.scale, "Factor on what the hand does.")
@_of_settings("tool-speed", 0.01, 1.0, 0.1, "Of the tool, at most, in m/s.")
@_of_settings("turning", 0.05, 6.0, 0.5, "Of the tool's orientation and of the elbow, at most, in rad/s.")
@_of_settings("joint-speed", 0.05, 3.0, _DEFAULT.joint_speed, "Of each joint after a leader, at most, in rad/s.")
@_of_settings("yaw", -360.0, 360.0, 0.0, "Where you stand, in degrees: 0 is behind the robot, 180 opposite of it.")
@click.option("--tool", "is_in_tool", is_flag=True, help="Directions are those of the tool.")
@click.option("--leader", metavar="FILE.py:NAME", default="", help="What makes the leader arm: a class or function.")
@click.option("--absolute", is_flag=True, help="A follower goes to where its leader is, from 0.2 rad away at most.")
@click.option("--signs", type=_numbers, help="1 or -1 for each joint of the leader, in chain order.")
@click.option("--offsets", type=_numbers, help="Added to each joint of the leader after its sign, in rad.")
@robot_option()
@json_option
def teleop(
    device: str | None,
    is_list: bool,
    robot: str | None,
    json_output: JsonOutput,
    tool_speed: float,
    turning: float,
    joint_speed: float,
    scale: float,
    yaw: float,
    absolute: bool,
    **options: Any,
) -> None:
    """Move arms with a gamepad, a SpaceMouse or a leader arm.

    An arm moves while its clutch is held, a button of the device, and holds when it is released. Without DEVICE the
    first gamepad or SpaceMouse is taken. It needs a running driver, and ends with Ctrl-C. With --json a line is written
    for each change.

    \b
    Gamepad: bumpers are the clutches of the two arms, or of one with --arm; left stick and triggers move,
      right stick and cross turn, cross up and down turns the elbow; lower button closes the gripper, right button opens
      it.
    SpaceMouse: the left button is the clutch of the arm, the right one without --arm; the right button closes and opens
      its gripper.

    \b
    Examples:
      yumi teleop --list
      yumi teleop gamepad --tool-speed 0.05
      yumi teleop spacemouse --arm left
      yumi teleop leader --leader my_leader.py:MyLeader --arm right
    """
    if is_list:
        found = find_devices()
        json_output.write(msgspec.json.encode([each._asdict() for each in found]).decode())
        json_output.say("\n".join(map(str, found)) or str(message("no_input_device", kind="gamepad or spacemouse")))
        return
    settings = DeviceSettings(
        scale=scale,
        yaw=radians(yaw),
        speed=tool_speed,
        turning=turning,
        joint_speed=joint_speed,
        is_absolute=absolute,
    )
    show = _Changes(json_output)
    with ExitStack() as stack:
        driver = stack.enter_context(attach(robot or ""))
        held = _leader(**options) if device == "leader" else _input_device(stack, device, settings, **options)
        try:
            teleoperate(driver, held, settings, show.take)
        except KeyboardInterrupt:
            json_output.say("Ended; the arms hold.")


def _input_device(
    stack: ExitStack, kind: Any, settings: DeviceSettings, path: str, arm: str | None, is_in_tool: bool, **_: Any
) -> Device:
    found, opened = open_device(path, kind)
    stack.callback(opened.close)
    click.echo(f"{found.kind.capitalize()} {found.name}", err=True)
    if found.kind == "gamepad":
        return Gamepad(opened, settings, [side_of(each) for each in arms_of(arm or "both")], is_in_tool=is_in_tool)
    sides = [side_of(each) for each in arms_of(arm or "right")]
    return SpaceMouse(opened, settings, sides, is_in_tool=is_in_tool)


def _leader(leader: str, arm: str | None, signs: Any, offsets: Any, **_: Any) -> Device:
    if not leader or arm not in ("right", "left"):
        raise SettingsError(message("leader_options_missing"))
    options = {name: value for name, value in (("signs", signs), ("offsets", offsets)) if value is not None}
    try:
        return Leader(_made(leader), side_of(arm), **options)  # type: ignore[arg-type]
    except CommandRefused as error:
        raise SettingsError(error.said) from error


def _made(place: str) -> LeaderArm:
    """What a class or function of a file or module makes, named as ``file.py:name`` or ``module:name``."""
    source, _, name = place.rpartition(":")
    try:
        if source.endswith(".py"):
            spec = spec_from_file_location(Path(source).stem, source)
            if spec is None or spec.loader is None:
                raise ImportError(source)
            module = module_from_spec(spec)
            sys.modules[spec.name] = module
            spec.loader.exec_module(module)
        else:
            module = import_module(source)
        made: LeaderArm = getattr(module, name)()
    except Exception as error:  # it is another person's program
        raise SettingsError(
            message("leader_not_made", place=place, kind=type(error).__name__, why=said_by(error))
        ) from error
    return made


class _Changes:
    """Prints what has changed from frame to frame."""

    def __init__(self, json_output: JsonOutput) -> None:
        self._json = json_output
        self._last: TeleoperationReport | None = None

    def take(self, report: TeleoperationReport) -> None:
        last, self._last = self._last, report
        if report == last:
            return
        self._json.write(msgspec.json.encode(report).decode())
        for side, arm in report.arms.items():
            before = TeleoperatedArmReport() if last is None else last.arms[side]
            if (arm.clutch, arm.why, arm.gripper) != (before.clutch, before.why, before.gripper):
                self._json.say(_line(side.word, arm))
            elif arm.limited is not None and before.limited is None:
                self._json.say(f"{side.word:<6}kept apart: {arm.limited}")


def _line(arm: str, report: TeleoperatedArmReport) -> str:
    reasons = [str(each.message) for each in (report.why, report.gripper) if each is not None]
    return f"{arm:<6}{report.clutch}" + "".join(f"; {reason}" for reason in reasons)
