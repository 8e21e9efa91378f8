"""Commands for a robot whose driver runs: what it does, and what it is asked to do.

Most of them use the driver's local endpoint, such as ``yumi state`` and ``yumi move``; ``yumi shell`` is a prompt of
Python that is connected to it. ``yumi topics``, ``echo``, ``call`` and ``param`` are for those who have no ``ros2``:
they use rclpy alone, for any node of the ROS 2 graph, and show and take messages as JSON with the names of the fields.
"""

from __future__ import annotations

import code
import json
import sys
import time
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import wraps
from importlib import import_module
from math import radians
from pathlib import Path
from typing import Any, cast

import click
import msgspec
import yaml
from click.shell_completion import CompletionItem, get_completion_class

import yumi
from yumi.api.connection import RunningDriver, attach
from yumi.api.motion import RETREAT_SPEED_SCALE
from yumi.catalogue import in_words, message, quoted, said_by
from yumi.cli.options import (
    ARM,
    ARMS,
    OF_DRIVER,
    ONCE,
    SCALE,
    JsonOutput,
    Measure,
    count_option,
    demand_ros,
    egm_port_options,
    json_option,
    limit_discovery,
    robot_option,
    robot_options,
    speed_scale_option,
    timeout_option,
)
from yumi.driver.endpoint import Arm, MotionReport
from yumi.errors import CommandRefused, RobotNotReady, SettingsError, YumiError
from yumi.robot.gripper import MAX_FORCE, TRAVEL, Outcome
from yumi.robot.joints import JOINT_COUNT, POSES, chain_from_abb, joints

_MODES = click.Choice(["motors_off", "ready", "egm_left", "egm_right", "egm_both"])


def of_driver(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the driver that runs, and print what it returns: a sentence, or JSON with ``--json``."""

    @robot_option()
    @json_option
    @wraps(command)
    def with_driver(*args: Any, robot: str | None, json_output: JsonOutput, **options: Any) -> None:
        def report(step: str) -> None:
            click.echo(step, err=True)

        with attach(robot or "", on_step=report) as driver:
            result = command(driver, *args, **options)
        json_output.write(msgspec.json.encode(result).decode())
        if not json_output.is_printed:
            click.echo(str(result))

    return with_driver


def _arms(word: str) -> tuple[Arm, ...]:
    return ("right", "left") if word == "both" else (cast("Arm", word),)


@click.command()
@click.option("--watch", is_flag=True, help="Print it again and again, until Ctrl-C.")
@click.option("--rate", type=Measure("rate", 0.1, 60.0, is_open=False), default=1.0, help="So often a second.")
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
@click.argument("name", type=_MODES, required=False)
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


@click.command()
@click.argument("arm", type=ARMS, required=False)
@of_driver
def start(driver: RunningDriver, arm: str | None) -> object:
    """Start EGM; makes the robot ready first if need be.

    Without ARM it starts on the arms that are configured.

    \b
    Examples:
      yumi start
      yumi start right
    """
    return driver.start_egm(_arms(arm) if arm else ())


@click.command()
@of_driver
def stop(driver: RunningDriver) -> object:
    """Bring the arms to rest and end EGM.

    It waits for nothing else.

    \b
    Examples:
      yumi stop
    """
    return driver.stop_egm()


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


@click.command()
@click.argument("arm", type=ARMS, default="both")
@of_driver
def calibrate(driver: RunningDriver, arm: str) -> object:
    """Close the fingers of a gripper and call that zero.

    EGM must not run. Without ARM both grippers are calibrated.

    \b
    Examples:
      yumi calibrate right
    """
    return driver.calibrate(_arms(arm))


@click.command()
@click.argument("arm", type=ARM)
@click.argument("action", type=click.Choice(["open", "close"]))
@click.option(
    "--width", type=Measure("width", 0.0, 2.0 * TRAVEL, is_open=True), help="Open so far [m]; else all the way."
)
@click.option("--force", type=Measure("force", 0.0, MAX_FORCE, is_open=True), help="Hold with this force [N].")
@of_driver
def grip(driver: RunningDriver, arm: Arm, action: str, width: float | None, force: float | None) -> object:
    """Open or close a gripper; says what it holds.

    \b
    Examples:
      yumi grip right open --width 0.03
      yumi grip right close --force 8
    """
    if (action == "open" and force is not None) or (action == "close" and width is not None):
        raise SettingsError(message("width_opens_force_closes"))
    done = driver.open_gripper(arm, width) if action == "open" else driver.close_gripper(arm, force)
    held = f"something {done.width * 1e3:.1f} mm wide" if done.outcome is Outcome.HOLDING else ""
    words = {"arm": arm, "outcome": done.outcome.value, "width": done.width}
    return _Table(words, [f"The {arm} gripper is {done.outcome.value}{f' {held}' if held else ''}."])


def _complete_goal(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[CompletionItem]:
    words = [*POSES, *(f"j{axis}=" for axis in range(1, JOINT_COUNT + 1))]
    return [CompletionItem(word) for word in words if word.startswith(incomplete)]


@click.command(context_settings={"ignore_unknown_options": True})
@click.argument("arm", type=ARMS)
@click.argument("goal", nargs=-1, required=True, shell_complete=_complete_goal)
@click.option("--degrees", "in_degrees", is_flag=True, help="Angles are degrees; without, radians.")
@click.option("--abb", is_flag=True, help="Seven angles are in the FlexPendant's order J1 to J7, not in chain order.")
@speed_scale_option("of the controller, in the settings")
@timeout_option()
@click.option("--pose", is_flag=True, help="GOAL is a place of the tool, x y z [m], and w x y z of its orientation.")
@click.option("--linear", is_flag=True, help="Move the tool to the pose on a straight line.")
@click.option("--speed", type=Measure("speed", 0.0, 1.5, is_open=True), help="Of the tool on the line [m/s].")
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
    position = pose_of(goal) if pose else goal_of(goal, in_degrees=in_degrees, abb=abb)
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
    """Shows on a terminal how far motions are."""
    if not sys.stderr.isatty():
        yield lambda motions: None
        return

    def show(motions: dict[str, MotionReport]) -> None:
        parts = [
            f"{word} {it.progress:4.0%}{'' if it.remaining is None else f', {it.remaining:.1f} s left'}"
            for word, it in motions.items()
        ]
        click.echo(f"\r{'   '.join(parts):<60}", nl=False, err=True)

    try:
        yield show
    finally:
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


def pose_of(words: Sequence[str]) -> Sequence[float]:
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
@click.argument("arm", type=ARM)
@click.argument("activate", nargs=-1, shell_complete=_complete_controller)
@click.option("--deactivate", multiple=True, shell_complete=_complete_controller, help="Deactivate this one, too.")
@of_driver
def switch(driver: RunningDriver, arm: Arm, activate: tuple[str, ...], deactivate: tuple[str, ...]) -> object:
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
@click.argument("value", type=SCALE, required=False)
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


DRIVER_COMMANDS = (state, controllers, mode, start, stop, recover, calibrate, grip, move, retreat, switch, speed_scale)


# ---- yumi shell, yumi completion

_HISTORY = Path.home() / ".yumi_history"


@click.command()
@robot_options(OF_DRIVER)
@egm_port_options()
@speed_scale_option()
def shell(**options: Any) -> None:
    """Open a Python prompt with the driver or a robot.

    With a driver that runs it has `driver`. With --robot it connects to that robot by itself, and has `robot`.

    \b
    Examples:
      yumi shell                          driver.move_to(right="home")
      yumi shell --robot 192.168.125.1    robot.right.move_to("home")
    """
    if options["robot"] is None:
        if any(value is not None for value in options.values()):
            raise click.UsageError("These options need --robot; without it the running driver is used as it is.")
        try:
            driver = attach()
        except RobotNotReady as error:
            if error.said.code != "no_driver_runs":
                raise
            raise RobotNotReady(message("no_driver_for_shell", error=error.said)) from None
        with driver:
            prompt({"driver": driver, "yumi": yumi}, f"{driver!r}: driver.state, driver.move_to(right='home') …")
        return
    with yumi.connect(options.pop("robot"), **options) as robot:
        prompt({"robot": robot, "yumi": yumi}, f"{robot!r}: robot.right.move_to('home') …")


def prompt(names: dict[str, object], banner: str) -> None:
    """Read and carry out Python until the end of input, with completion and history where there is readline."""
    with suppress(ImportError):
        import readline  # noqa: PLC0415 - not every Python has it
        import rlcompleter  # noqa: PLC0415

        readline.set_completer(rlcompleter.Completer(names).complete)
        readline.parse_and_bind("tab: complete")
        with suppress(OSError):  # there is none yet
            readline.read_history_file(_HISTORY)
        readline.set_history_length(1000)
    sys.ps1 = "yumi> "
    try:
        code.interact(banner, local=names, exitmsg="")
    finally:
        with suppress(ImportError, OSError):
            import readline  # noqa: PLC0415

            readline.write_history_file(_HISTORY)


@click.command()
@click.argument("name", metavar="SHELL", type=click.Choice(["bash", "zsh", "fish"]))
@click.pass_context
def completion(context: click.Context, name: str) -> None:
    """Print what makes the shell complete yumi's commands.

    It completes commands, options, controllers and poses.

    \b
    Examples:
      eval "$(yumi completion bash)"               in ~/.bashrc; zsh likewise
      yumi completion fish | source                in ~/.config/fish/config.fish
    """
    kind = get_completion_class(name)
    assert kind is not None, "these are click's own"
    click.echo(kind(context.find_root().command, {}, "yumi", "_YUMI_COMPLETE").source())


# ---- the ROS 2 graph

_DISCOVERY = 5.0
"""What is in the ROS 2 graph is found within this time [s]."""

_SETTLED = 0.5
"""Nothing more is expected when no new name has come for this time: participants are announced every 0.2 s [s]."""

_SPIN_PERIOD = 0.05  # [s]


@click.command()
@json_option
def topics(json_output: JsonOutput) -> None:
    """List the topics of the ROS 2 graph with their types.

    \b
    Examples:
      yumi topics
    """
    with _graph_node() as node:
        found: dict[str, list[str]] = {}
        own = {name for name, _ in node.get_publisher_names_and_types_by_node(node.get_name(), node.get_namespace())}

        grown = time.monotonic()

        def is_settled() -> bool:  # the names come one participant after another
            nonlocal grown
            before = len(found)
            found.update((name, list(kinds)) for name, kinds in node.get_topic_names_and_types() if name not in own)
            grown = time.monotonic() if len(found) > before else grown
            return bool(found) and time.monotonic() - grown > _SETTLED

        _spin_until(node, is_settled, _DISCOVERY)
    json_output.write(json.dumps(found))
    if not json_output.is_printed:
        click.echo("\n".join(f"{name:<60} {', '.join(found[name])}" for name in found))


@click.command()
@click.argument("topic")
@count_option(1)
@click.option("--once", is_flag=True, expose_value=False, help=ONCE)
@timeout_option(10.0)
@json_option
def echo(topic: str, count: int, timeout: float, json_output: JsonOutput) -> None:
    """Print messages of a topic.

    --timeout is for each message; --json writes one line for each.

    \b
    Examples:
      yumi echo r/joint_states              one message, as with --once
      yumi echo yumi_robot_manager/state --json
    """
    with _graph_node() as node:
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: PLC0415

        kind = _type_of(node, topic, node.get_topic_names_and_types, "topic")
        infos = node.get_publishers_info_by_topic(f"/{topic.lstrip('/')}")
        is_latched = bool(infos) and all(it.qos_profile.durability == DurabilityPolicy.TRANSIENT_LOCAL for it in infos)
        quality = QoSProfile(
            depth=100,
            reliability=ReliabilityPolicy.BEST_EFFORT if not is_latched else ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if is_latched else DurabilityPolicy.VOLATILE,
        )
        received: list[Any] = []
        node.create_subscription(kind, f"/{topic.lstrip('/')}", received.append, quality)
        for _ in range(count):
            if not _spin_until(node, lambda: bool(received), timeout):
                raise RobotNotReady(message("no_message_on_topic", topic=topic, timeout=timeout))
            values = message_values(received.pop(0))
            json_output.write(json.dumps(values))
            if not json_output.is_printed:
                click.echo(yaml.safe_dump(values, sort_keys=False) + "---")


@click.command()
@click.argument("service")
@click.argument("request", default="{}")
@timeout_option(60.0)
@json_option
def call(service: str, request: str, timeout: float, json_output: JsonOutput) -> None:
    """Call a ROS 2 service.

    REQUEST is a JSON object or YAML of its fields. The exit code is 1 where the answer says "no success".

    \b
    Examples:
      yumi call yumi_robot_manager/get_state
      yumi call yumi_robot_manager/set_speed_ratio '{percent: 50}'
    """
    with _graph_node() as node:
        kind = _type_of(node, service, node.get_service_names_and_types, "service")
        try:
            values = yaml.safe_load(request)
        except yaml.YAMLError as error:
            raise SettingsError(message("request_no_yaml", request=request, error=said_by(error))) from error
        asked = fill_message(kind.Request(), values if values is not None else {})
        answer = _call_service(node, kind, f"/{service.lstrip('/')}", asked, timeout)
    shown = message_values(answer)
    json_output.write(json.dumps(shown))
    if not json_output.is_printed:
        click.echo(yaml.safe_dump(shown, sort_keys=False).rstrip())
    if getattr(answer, "success", True) is False or getattr(answer, "ok", True) is False:
        raise click.exceptions.Exit(1)


_PARAM_VERBS = {"list": "NODE", "get": "NODE NAME", "set": "NODE NAME VALUE"}
"""What ``ros2 param`` can do, and what each takes."""


@click.command(context_settings={"ignore_unknown_options": True})  # negative numbers are none
@click.argument("words", nargs=-1, required=True, metavar="[list|get|set] NODE [NAME [VALUE]]")
@json_option
def param(words: Sequence[str], json_output: JsonOutput) -> None:
    """List the parameters of a node, show one, or set it.

    The verbs of `ros2 param` may be left out. Each value is shown with its meaning, unit and range; --json writes the
    values alone.

    \b
    Examples:
      yumi param r/joint_position_controller
      yumi param r/joint_position_controller p
      yumi param r/joint_position_controller p 1.3
    """
    if words[0] in _PARAM_VERBS:  # none may do what another one is for, as set what was only to be read
        verb, *words = words
        if len(words) != len(_PARAM_VERBS[verb].split()):
            raise click.UsageError(f"{verb} takes {_PARAM_VERBS[verb]}, not {' '.join(words) or 'nothing'}.")
    if len(words) > 3:
        raise click.UsageError(f"Give NODE, NAME and VALUE, not {' '.join(words)}.")
    node_name = words[0]
    name, value = (words[at] if at < len(words) else None for at in (1, 2))
    with _graph_node() as node:
        from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters  # noqa: PLC0415
        from rclpy.parameter import parameter_value_to_python  # noqa: PLC0415

        base = f"/{node_name.strip('/')}"
        if name is not None and value is not None:
            _set_parameter(node, base, name, value)
        names = [name] if name is not None else None
        if names is None:
            listed = _call_service(node, ListParameters, f"{base}/list_parameters", ListParameters.Request())
            names = sorted(listed.result.names)
        answer = _call_service(node, GetParameters, f"{base}/get_parameters", GetParameters.Request(names=names))
        shown = {
            each: message_values(parameter_value_to_python(it)) for each, it in zip(names, answer.values, strict=False)
        }
        if name is not None and shown.get(name) is None:
            raise CommandRefused(message("node_without_parameter", node=base, name=name))
        asked = DescribeParameters.Request(names=names)
        described = _call_service(node, DescribeParameters, f"{base}/describe_parameters", asked).descriptors
    json_output.write(json.dumps(shown))
    if not json_output.is_printed:
        for each, descriptor in zip(shown, described, strict=False):
            click.echo(parameter_line(each, shown[each], descriptor))


def _set_parameter(node: Any, base: str, name: str, value: str) -> None:
    from rcl_interfaces.srv import SetParameters  # noqa: PLC0415 - yumi works without ROS
    from rclpy.parameter import Parameter  # noqa: PLC0415

    given = yaml.safe_load(value)
    try:
        parameter = Parameter(name, value=given).to_parameter_msg()
    except (TypeError, AttributeError) as error:
        raise SettingsError(message("no_value_of_parameter", value=value)) from error
    asked = SetParameters.Request(parameters=[parameter])
    answer = _call_service(node, SetParameters, f"{base}/set_parameters", asked)
    if not answer.results[0].successful:
        raise CommandRefused(message("parameter_not_set", name=name, node=base, reason=answer.results[0].reason))


def parameter_line(name: str, value: object, descriptor: Any) -> str:
    """A parameter as YAML, with what its descriptor says of it as a comment."""
    ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
    remarks = [descriptor.description] if descriptor.description else []
    remarks += [f"{each.from_value:g} to {each.to_value:g}" for each in ranges]
    remarks += [descriptor.additional_constraints] if descriptor.additional_constraints and not ranges else []
    line = yaml.safe_dump({name: value}, sort_keys=False).rstrip()
    return f"{line}  # {'; '.join(remark.rstrip('.') for remark in remarks)}" if remarks else line


GRAPH_COMMANDS = (topics, echo, call, param)


@contextmanager
def _graph_node() -> Iterator[Any]:
    """A node that looks at the graph, with the discovery that the driver has by default."""
    demand_ros()
    limit_discovery()
    import rclpy  # noqa: PLC0415 - yumi works without ROS
    from rclpy.signals import SignalHandlerOptions  # noqa: PLC0415

    is_ours = not rclpy.ok()  # in a program that uses ROS itself, its context serves
    if is_ours:
        rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node(f"yumi_command_{time.monotonic_ns()}", start_parameter_services=False)
    try:
        yield node
    finally:
        node.destroy_node()
        if is_ours:
            rclpy.try_shutdown()


def _spin_until(node: Any, until: Callable[[], bool], timeout: float | None) -> bool:
    """Serve the node until something is so; whether it was in time."""
    import rclpy  # noqa: PLC0415

    end = None if timeout is None else time.monotonic() + timeout
    while not until():
        if end is not None and time.monotonic() > end:
            return False
        rclpy.spin_once(node, timeout_sec=_SPIN_PERIOD)
    return True


def _type_of(node: Any, name: str, known: Callable[[], Sequence[tuple[str, Sequence[str]]]], what: str) -> Any:
    """The type of a topic or service by its name, as a Python class."""
    full, kinds = f"/{name.lstrip('/')}", dict[str, Sequence[str]]()

    def is_there() -> bool:
        kinds.update(known())
        return full in kinds

    if not _spin_until(node, is_there, _DISCOVERY):
        near = tuple(sorted(each for each in kinds if name.rpartition("/")[2] in each)[:5])
        is_topic = what == "topic"
        if near:
            raise RobotNotReady(
                message(
                    "topic_not_in_graph_similar" if is_topic else "service_not_in_graph_similar",
                    name=full,
                    similar=near,
                )
            )
        raise RobotNotReady(message("topic_not_in_graph" if is_topic else "service_not_in_graph", name=full))
    package, folder, kind = kinds[full][0].split("/")
    try:
        return getattr(import_module(f"{package}.{folder}"), kind)
    except (ImportError, AttributeError) as error:
        raise RobotNotReady(message("type_not_installed", name=full, type=f"{package}/{folder}/{kind}")) from error


def message_values(message: Any) -> Any:
    """A message as dictionaries, lists and plain values; NaN and infinities stay, as Python's JSON writes them."""
    if hasattr(message, "get_fields_and_field_types"):
        return {name: message_values(getattr(message, name)) for name in message.get_fields_and_field_types()}
    if isinstance(message, bytes | bytearray):
        return list(message)
    if isinstance(message, list | tuple | array) or hasattr(message, "tolist"):
        return [message_values(each) for each in message]
    return message


def fill_message(target: Any, values: object) -> Any:
    """Give a message's fields the values of a dictionary; lists of messages come from lists of dictionaries.

    Raises:
        SettingsError: a field is unknown, or a value does not fit.
    """
    fields: Mapping[str, str] = target.get_fields_and_field_types()
    target._check_fields = True  # else a message takes anything, and the middleware fails with it
    if not isinstance(values, Mapping):
        raise SettingsError(message("fields_no_object", given=quoted(values), fields=tuple(fields)))
    for name, value in values.items():
        if name not in fields:
            raise SettingsError(message("no_field", name=name, fields=tuple(fields)))
        now = getattr(target, name)
        try:
            if hasattr(now, "get_fields_and_field_types"):
                fill_message(now, value)
            elif isinstance(value, list) and "/" in fields[name]:
                package, kind = fields[name].partition("<")[2].rstrip(">").partition(",")[0].split("/")
                made = getattr(import_module(f"{package}.msg"), kind)
                setattr(target, name, [fill_message(made(), each) for each in value])
            elif isinstance(value, str) and "string" not in fields[name].partition("<")[0]:
                raise TypeError("a text")
            elif isinstance(now, float):
                setattr(target, name, float(value))
            else:
                setattr(target, name, value)
        except (AssertionError, TypeError, ValueError) as error:
            raise SettingsError(
                message("field_takes_other", name=name, given=quoted(value), type=fields[name])
            ) from error
    return target


def _call_service(node: Any, kind: Any, name: str, request: Any, timeout: float = _DISCOVERY) -> Any:
    client = node.create_client(kind, name)
    if not client.wait_for_service(_DISCOVERY):
        raise RobotNotReady(message("service_unavailable", service=name))
    future = client.call_async(request)
    if not _spin_until(node, future.done, timeout):
        raise RobotNotReady(message("service_not_in_time", service=name, timeout=timeout))
    return future.result()
