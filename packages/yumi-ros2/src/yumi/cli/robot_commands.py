"""``yumi state``, ``mode``, ``move``, ``recover``, ``retreat``, ``switch``, ``speed-scale``, ``controllers``.

The others come from the table by themselves, see :mod:`yumi.cli.from_table`. All use the driver's local endpoint.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import radians
from typing import Any, get_args

import click
import msgspec
from click.shell_completion import CompletionItem

from abb_protocols.catalogue import in_words, message
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import GoalNotReached, SettingsError, YumiError
from abb_protocols.robot.joints import JOINT_COUNT, POSES, chain_from_abb, joints
from abb_runtime.options import (
    ARM_TYPE,
    ARMS_TYPE,
    FACTOR_TYPE,
    JsonOutput,
    OptionNumber,
    json_option,
    robot_option,
    speed_scale_option,
    timeout_option,
)
from yumi.api.attach import RunningDriver, attach
from yumi.api.motion_executor import RETREAT_SPEED_SCALE
from yumi.cli.from_table import command_from, of_driver
from yumi.driver.command import ArmName
from yumi.driver.commands import (
    GetControllers,
    GetState,
    Recover,
    SetMode,
    SetSpeedScale,
    SwitchControllers,
    offered_to,
)
from yumi.driver.motion_commands import Move
from yumi.driver.reports import MotionReport
from yumi.driver.robot_state import ModeName


@click.command()
@click.option("--watch", is_flag=True, help="Print it again and again, until Ctrl-C.")
@click.option("--rate", type=OptionNumber("rate", 0.1, 60.0, is_open=False), default=1.0, help="So often a second.")
@robot_option()
@json_option
def state(watch: bool, rate: float, robot: str | None, json_output: JsonOutput) -> None:
    """Show what the robot does, and why it does not move.

    It says what stopped the robot, too. With --watch, --json writes one line each time.

    \b
    Examples:
      yumi state
      yumi state --json
      yumi state --watch --rate 5 --json    a line of JSON five times a second
    """
    with attach(robot or "") as driver:
        states = driver.watch(rate) if watch else iter((driver.state,))
        for each in states:
            json_output.write(msgspec.json.encode(each).decode())
            if not json_output.is_printed:
                if watch and sys.stdout.isatty():
                    click.clear()
                click.echo(str(each))


class _Table(dict[str, Any]):
    """A mapping that is shown as lines."""

    def __init__(self, values: Mapping[str, Any], lines: Sequence[str]) -> None:
        super().__init__(values)
        self._lines = lines

    def __str__(self) -> str:
        return "\n".join(self._lines)


@click.command()
@of_driver
def controllers(driver: RunningDriver) -> object:
    """List the controllers of both arms; which of them command.

    \b
    Examples:
      yumi controllers
    """
    found = driver.controllers
    return _Table(
        {side: list(each) for side, each in found.items()},
        [
            f"{side:<6}{each.name:<36}{each.state:<13}{'commands ' if each.commands else '':<10}{each.type}"
            for side, reports in found.items()
            for each in reports
        ],
    )


@click.command()
@click.argument("name", type=click.Choice(get_args(ModeName)), required=False)
@of_driver
def mode(driver: RunningDriver, name: str | None) -> object:
    """Show the robot's mode, or bring it to NAME.

    \b
    Examples:
      yumi mode                 in a sentence
      yumi mode egm_both        motors on, program running, EGM on both arms
      yumi mode motors_off
    """
    if name is not None:
        return driver.set_mode(name)  # type: ignore[arg-type]
    now = driver.state
    egm = ", ".join(f"{word} arm EGM {each}" for word, each in now.egm.items())
    return f"operating mode {now.operating_mode}, {now.motors}, RAPID {now.program}, {egm}"


def _is_at_a_terminal() -> bool:
    return sys.stdin.isatty()


@click.command()
@click.option("--confirm", default="", help="Id of the stop that you have looked at, as `yumi state` shows it.")
@of_driver
def recover(driver: RunningDriver, confirm: str) -> object:
    """Bring the robot back after a stop; says what stopped it.

    After an emergency stop, a guard stop or a collision a person has to look at the robot first: on a terminal the
    command asks for it, elsewhere --confirm names the stop.

    \b
    Examples:
      yumi recover
    """
    now = driver.state
    if now.stop and not confirm:
        causes = tuple(each.message for each in now.causes)
        if not _is_at_a_terminal():
            raise SettingsError(message("confirm_by_option", causes=causes, stop=now.stop))
        click.echo(in_words(causes), err=True)
        question = f"Is no person near the robot, and nothing in its way? Type yes to confirm the stop {now.stop}"
        if click.prompt(question, default="no", err=True).strip() != "yes":
            raise SettingsError(message("not_confirmed"))
        confirm = now.stop
    return driver.recover(confirm)


def _complete_goal(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    words = [*POSES, *(f"j{axis}=" for axis in range(1, JOINT_COUNT + 1))]
    return [CompletionItem(word) for word in words if word.startswith(incomplete)]


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("arm", type=ARMS_TYPE)
@click.argument("goal", nargs=-1, required=True, shell_complete=_complete_goal)
@click.option("--degrees", "in_degrees", is_flag=True, help="Angles are degrees; without, radians.")
@click.option("--abb", is_flag=True, help="Seven angles are in the FlexPendant's order J1 to J7, not in chain order.")
@speed_scale_option("of the controller, in the settings")
@timeout_option()
@click.option("--pose", is_flag=True, help="GOAL is a place of the tool, x y z [m], and w x y z of its orientation.")
@click.option("--linear", is_flag=True, help="Move the tool to the pose on a straight line.")
@click.option("--speed", type=OptionNumber("speed", 0.0, 1.5, is_open=True), help="Of the tool on the line [m/s].")
@of_driver
def move(
    driver: RunningDriver,
    arm: str,
    goal: tuple[str, ...],
    in_degrees: bool,
    abb: bool,
    speed_scale: float | None,
    timeout: float | None,
    pose: bool,
    linear: bool,
    speed: float | None,
) -> object:
    """Move an arm to a goal and wait until it stands there.

    Ctrl-C stops it, as --timeout does. EGM must run: yumi start. --speed-scale comes on top of the driver's own.

    GOAL is a pose (home, ready, calibration), some joints as NAME=ANGLE (the others stay), or seven angles in chain
    order, axes 1 2 7 3 4 5 6.

    The driver keeps the arms apart from each other, from the body and from declared boxes unless collision.enabled is
    false. What was not declared is not known: see that the way is free.

    \b
    Examples:
      yumi move both home
      yumi move right j1=20 j7=-135 --degrees
      yumi move right 0 -130 30 0 40 0 -135 --abb --degrees
      yumi move right 0.4 -0.2 0.3 --pose             its orientation stays
      yumi move right 0.4 -0.2 0.2 --pose --linear    on a straight line
    """
    if (linear or speed is not None) and not pose:
        raise SettingsError(message("line_options_need_pose"))
    position = _pose_of(goal) if pose else goal_of(goal, in_degrees=in_degrees, abb=abb)
    if arm == "both" and not isinstance(position, str):
        raise SettingsError(message("both_arms_take_a_pose"))
    with _progress() as on_motion:
        return driver.move_to(
            right=position if arm != "left" else None,
            left=position if arm != "right" else None,
            speed_scale=speed_scale,
            timeout=timeout,
            is_pose=pose,
            is_linear=linear,
            speed=speed,
            on_motion=on_motion,
        )


@contextmanager
def _progress() -> Iterator[Callable[[dict[str, MotionReport]], None]]:
    """Shows on a terminal how far motions are; Ctrl-C ends the command, and the driver its motions."""

    def show(motions: dict[str, MotionReport]) -> None:
        parts = [
            f"{word} {it.progress:4.0%}{'' if it.remaining is None else f', {it.remaining:.1f} s left'}"
            for word, it in motions.items()
        ]
        click.echo(f"\r{'   '.join(parts):<60}", nl=False, err=True)

    is_terminal = sys.stderr.isatty()
    try:
        yield show if is_terminal else lambda motions: None
    except KeyboardInterrupt:
        raise GoalNotReached(message("motion_interrupted")) from None
    finally:
        if is_terminal:
            click.echo(err=True)


@click.command()
@speed_scale_option(f"{RETREAT_SPEED_SCALE:g}, a tenth")
@of_driver
def retreat(driver: RunningDriver, speed_scale: float | None) -> object:
    """Lead both arms home on a planned path, slowly.

    EGM must run: yumi start. Ctrl-C stops the arms. It leads out of where the arms were stopped in front of each other.
    What was not declared is not known: see that no person is near the robot, and that the arms hold nothing that is in
    the way.

    \b
    Examples:
      yumi retreat
      yumi retreat --speed-scale 0.05
    """
    with _progress() as on_motion:
        return driver.retreat(speed_scale=speed_scale or RETREAT_SPEED_SCALE, on_motion=on_motion)


def _pose_of(words: Sequence[str]) -> Sequence[float]:
    """The pose that words of the command line give: a place, with or without an orientation.

    Raises:
        SettingsError: they are not three or seven numbers.
    """
    try:
        numbers = [float(word) for word in words]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 7):
        raise SettingsError(message("no_pose_on_command_line"))
    return numbers


def goal_of(words: Sequence[str], *, in_degrees: bool, abb: bool) -> str | Mapping[str, float] | Sequence[float]:
    """The position that words of the command line name: a pose, joints by name, or seven angles.

    Raises:
        SettingsError: they are none of these.
    """
    factor = radians(1.0) if in_degrees else 1.0

    def number(text: str) -> float:
        try:
            return float(text) * factor
        except ValueError:
            raise SettingsError(message("no_angle", text=text, poses=tuple(POSES))) from None

    if len(words) == 1 and words[0] in POSES:
        return words[0]
    if all("=" in word for word in words):
        if abb:
            raise SettingsError(message("abb_order_of_names"))
        pairs = [word.split("=", 1) for word in words]
        named = {name: number(text) for name, text in pairs}
        if len(named) != len(pairs):
            raise SettingsError(message("some_joint_named_twice"))
        return named
    angles = [number(word) for word in words]
    if len(angles) != JOINT_COUNT:
        raise SettingsError(message("angle_count", count=len(angles), joints=JOINT_COUNT))
    return chain_from_abb(angles[:6], angles[6]) if abb else joints(angles)


def _complete_controller(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    """The controllers that the running driver has; none where there is none."""
    try:
        with attach(str(context.params.get("robot") or "")) as driver:
            names = {each.name for reports in driver.controllers.values() for each in reports}
    except YumiError:
        return []
    return [CompletionItem(name) for name in sorted(names) if name.startswith(incomplete)]


@click.command()
@click.argument("arm", type=ARM_TYPE)
@click.argument("activate", nargs=-1, shell_complete=_complete_controller)
@click.option("--deactivate", multiple=True, shell_complete=_complete_controller, help="Deactivate this one, too.")
@of_driver
def switch(driver: RunningDriver, arm: ArmName, activate: tuple[str, ...], deactivate: tuple[str, ...]) -> object:
    """Activate controllers of an arm in place of the others.

    It is one step; what commands its joints until then is deactivated.

    \b
    Examples:
      yumi switch right joint_trajectory_controller
      yumi switch left --deactivate joint_position_controller
    """
    before = [each.name for each in driver.controllers[arm] if each.commands and each.name not in activate]
    if activate:
        deactivate = tuple(dict.fromkeys((*deactivate, *before)))
    return driver.switch(arm, activate, deactivate)


@click.command("speed-scale")
@click.argument("value", type=FACTOR_TYPE, required=False)
@of_driver
def speed_scale(driver: RunningDriver, value: float | None) -> object:
    """Show the factor on all speeds, or set it.

    \b
    Examples:
      yumi speed-scale 0.3
    """
    if value is not None:
        driver.speed_scale = value
    return f"speed_scale is {driver.speed_scale:g}"


_BY_HAND: Mapping[Any, click.Command] = {
    GetState: state,
    GetControllers: controllers,
    SetMode: mode,
    Recover: recover,
    Move: move,
    SwitchControllers: switch,
    SetSpeedScale: speed_scale,
}

DRIVER_COMMANDS = (retreat, *(_BY_HAND.get(kind) or command_from(kind) for kind in offered_to(FrontEnd.SHELL)))
