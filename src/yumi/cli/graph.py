"""Commands for the ROS 2 graph, for those who have no ``ros2``: topics, services and parameters of any node.

They use rclpy alone. A message is shown, and given, as JSON with the names of its fields.
"""

from __future__ import annotations

import json
import time
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import click
import yaml

from yumi.cli.options import demand_ros, limit_discovery
from yumi.errors import CommandRefused, RobotNotReady, SettingsError

DISCOVERY = 5.0
"""What is in the graph is found within this time [s]."""

SETTLED = 0.5
"""Nothing more is expected when no new name has come for this time: participants are announced every 0.2 s [s]."""

_POLL = 0.05  # [s]


@contextmanager
def graph() -> Iterator[Any]:
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


def _spin(node: Any, until: Callable[[], bool], timeout: float | None) -> bool:
    """Serve the node until something is so; whether it was in time."""
    import rclpy  # noqa: PLC0415

    end = None if timeout is None else time.monotonic() + timeout
    while not until():
        if end is not None and time.monotonic() > end:
            return False
        rclpy.spin_once(node, timeout_sec=_POLL)
    return True


def _found(node: Any, name: str, known: Callable[[], Sequence[tuple[str, Sequence[str]]]], what: str) -> Any:
    """The type of a topic or service by its name, as a Python class."""
    full, kinds = f"/{name.lstrip('/')}", dict[str, Sequence[str]]()

    def is_there() -> bool:
        kinds.update(known())
        return full in kinds

    if not _spin(node, is_there, DISCOVERY):
        near = ", ".join(sorted(each for each in kinds if name.rpartition("/")[2] in each)[:5])
        raise RobotNotReady(
            f"There is no {what} {full} in the ROS 2 graph{f'; similar: {near}' if near else ''}. Does a driver run, "
            "with the same ROS_DOMAIN_ID?"
        )
    package, folder, kind = kinds[full][0].split("/")
    try:
        return getattr(import_module(f"{package}.{folder}"), kind)
    except (ImportError, AttributeError) as error:
        raise RobotNotReady(f"{full} has the type {package}/{folder}/{kind}, which is not installed here.") from error


def values_of(message: Any) -> Any:
    """A message as dictionaries, lists and plain values; NaN and infinities stay, as Python's JSON writes them."""
    if hasattr(message, "get_fields_and_field_types"):
        return {name: values_of(getattr(message, name)) for name in message.get_fields_and_field_types()}
    if isinstance(message, bytes | bytearray):
        return list(message)
    if isinstance(message, list | tuple | array) or hasattr(message, "tolist"):
        return [values_of(each) for each in message]
    return message


def fill(message: Any, values: object) -> Any:
    """Give a message's fields the values of a dictionary; lists of messages come from lists of dictionaries.

    Raises:
        SettingsError: a field is unknown, or a value does not fit.
    """
    fields: Mapping[str, str] = message.get_fields_and_field_types()
    message._check_fields = True  # else a message takes anything, and the middleware fails with it
    if not isinstance(values, Mapping):
        raise SettingsError(f"{values!r} is no JSON object; the fields are {', '.join(fields) or 'none'}.")
    for name, value in values.items():
        if name not in fields:
            raise SettingsError(f"There is no field {name!r}; the fields are {', '.join(fields) or 'none'}.")
        now = getattr(message, name)
        try:
            if hasattr(now, "get_fields_and_field_types"):
                fill(now, value)
            elif isinstance(value, list) and "/" in fields[name]:
                package, kind = fields[name].partition("<")[2].rstrip(">").partition(",")[0].split("/")
                made = getattr(import_module(f"{package}.msg"), kind)
                setattr(message, name, [fill(made(), each) for each in value])
            elif isinstance(value, str) and "string" not in fields[name].partition("<")[0]:
                raise TypeError("a text")
            elif isinstance(now, float):
                setattr(message, name, float(value))
            else:
                setattr(message, name, value)
        except (AssertionError, TypeError, ValueError) as error:
            raise SettingsError(f"{name} is {value!r}; it takes {fields[name]}.") from error
    return message


@click.command()
@click.option("--json", "is_json", is_flag=True, help="Print JSON.")
def topics(is_json: bool) -> None:
    """The topics of the ROS 2 graph with their types.

    \b
    Examples:
      yumi topics
    """
    with graph() as node:
        found: dict[str, list[str]] = {}
        own = {name for name, _ in node.get_publisher_names_and_types_by_node(node.get_name(), node.get_namespace())}

        grown = time.monotonic()

        def is_settled() -> bool:  # the names come one participant after another
            nonlocal grown
            before = len(found)
            found.update((name, list(kinds)) for name, kinds in node.get_topic_names_and_types() if name not in own)
            grown = time.monotonic() if len(found) > before else grown
            return bool(found) and time.monotonic() - grown > SETTLED

        _spin(node, is_settled, DISCOVERY)
    click.echo(json.dumps(found) if is_json else "\n".join(f"{name:<60} {', '.join(found[name])}" for name in found))


@click.command()
@click.argument("topic")
@click.option("--count", type=click.IntRange(1), default=1, help="Print so many messages.")
@click.option("--once", is_flag=True, expose_value=False, help="One message, as without --count.")
@click.option("--timeout", type=click.FloatRange(0.0, min_open=True), default=10.0, help="Longest wait for each [s].")
@click.option("--json", "is_json", is_flag=True, help="Print JSON, one line each.")
def echo(topic: str, count: int, timeout: float, is_json: bool) -> None:
    """Print messages of TOPIC.

    \b
    Examples:
      yumi echo r/joint_states              one message, as with --once
      yumi echo yumi_robot_manager/state --json
    """
    with graph() as node:
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy  # noqa: PLC0415

        kind = _found(node, topic, node.get_topic_names_and_types, "topic")
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
            if not _spin(node, lambda: bool(received), timeout):
                raise RobotNotReady(f"No message came on {topic} within {timeout:g} s.")
            values = values_of(received.pop(0))
            click.echo(json.dumps(values) if is_json else yaml.safe_dump(values, sort_keys=False) + "---")


@click.command()
@click.argument("service")
@click.argument("request", default="{}")
@click.option("--timeout", type=click.FloatRange(0.0, min_open=True), default=60.0, help="Longest wait [s].")
@click.option("--json", "is_json", is_flag=True, help="Print JSON.")
def call(service: str, request: str, timeout: float, is_json: bool) -> None:
    """Call SERVICE with REQUEST, a JSON object or YAML of its fields; the exit code is 1 where it says "no success".

    \b
    Examples:
      yumi call yumi_robot_manager/get_state
      yumi call yumi_robot_manager/set_speed_ratio '{percent: 50}'
    """
    with graph() as node:
        kind = _found(node, service, node.get_service_names_and_types, "service")
        try:
            values = yaml.safe_load(request)
        except yaml.YAMLError as error:
            raise SettingsError(f"{request!r} is neither JSON nor YAML: {error}.") from error
        asked = fill(kind.Request(), values if values is not None else {})
        answer = _ask(node, kind, f"/{service.lstrip('/')}", asked, timeout)
    shown = values_of(answer)
    click.echo(json.dumps(shown) if is_json else yaml.safe_dump(shown, sort_keys=False).rstrip())
    if getattr(answer, "success", True) is False or getattr(answer, "ok", True) is False:
        raise click.exceptions.Exit(1)


def _ask(node: Any, kind: Any, name: str, request: Any, timeout: float = DISCOVERY) -> Any:
    client = node.create_client(kind, name)
    if not client.wait_for_service(DISCOVERY):
        raise RobotNotReady(f"The service {name} does not answer. Does the node run, with the same ROS_DOMAIN_ID?")
    future = client.call_async(request)
    if not _spin(node, future.done, timeout):
        raise RobotNotReady(f"The service {name} did not answer within {timeout:g} s.")
    return future.result()


_VERBS = {"list": "NODE", "get": "NODE NAME", "set": "NODE NAME VALUE"}
"""Of ``ros2 param``, and what each takes."""


@click.command(context_settings={"ignore_unknown_options": True})  # negative numbers are none
@click.argument("words", nargs=-1, required=True, metavar="[list|get|set] NODE [NAME [VALUE]]")
@click.option("--json", "is_json", is_flag=True, help="Print JSON.")
def param(words: Sequence[str], is_json: bool) -> None:
    """List the parameters of NODE, show one, or set it to VALUE.

    The verbs of `ros2 param` may be left out.

    \b
    Examples:
      yumi param r/joint_position_controller
      yumi param r/joint_position_controller p
      yumi param r/joint_position_controller p 1.3
    """
    if words[0] in _VERBS:  # none may do what another one is for, as set what was only to be read
        verb, *words = words
        if len(words) != len(_VERBS[verb].split()):
            raise click.UsageError(f"{verb} takes {_VERBS[verb]}, not {' '.join(words) or 'nothing'}.")
    if len(words) > 3:
        raise click.UsageError(f"Give NODE, NAME and VALUE, not {' '.join(words)}.")
    node_name = words[0]
    name, value = (words[at] if at < len(words) else None for at in (1, 2))
    with graph() as node:
        from rcl_interfaces.srv import GetParameters, ListParameters, SetParameters  # noqa: PLC0415
        from rclpy.parameter import Parameter, parameter_value_to_python  # noqa: PLC0415

        base = f"/{node_name.strip('/')}"
        if name is not None and value is not None:
            given = yaml.safe_load(value)
            try:
                message = Parameter(name, value=given).to_parameter_msg()
            except (TypeError, AttributeError) as error:
                raise SettingsError(f"{value!r} is no value of a parameter.") from error
            answer = _ask(node, SetParameters, f"{base}/set_parameters", SetParameters.Request(parameters=[message]))
            if not answer.results[0].successful:
                raise CommandRefused(f"{name} of {base} was not set: {answer.results[0].reason}")
        names = [name] if name is not None else None
        if names is None:
            listed = _ask(node, ListParameters, f"{base}/list_parameters", ListParameters.Request())
            names = sorted(listed.result.names)
        answer = _ask(node, GetParameters, f"{base}/get_parameters", GetParameters.Request(names=names))
        shown = {each: values_of(parameter_value_to_python(it)) for each, it in zip(names, answer.values, strict=False)}
        if name is not None and shown.get(name) is None:
            raise CommandRefused(f"{base} has no parameter {name!r}; `yumi param {node_name}` lists them.")
    click.echo(json.dumps(shown) if is_json else yaml.safe_dump(shown, sort_keys=False).rstrip())


COMMANDS = (topics, echo, call, param)
