"""``yumi topics``, ``echo``, ``call`` and ``param``: the ROS 2 graph for those who have no ``ros2``.

They use rclpy alone, for any node of the graph, and show and take messages as JSON with the names of the fields.
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

from abb_protocols.catalogue import message, quoted, said_by
from abb_protocols.errors import CommandRefused, RobotNotReady, SettingsError
from abb_runtime.options import ONCE_HELP, JsonOutput, count_option, json_option, timeout_option
from yumi.cli.driver_options import demand_ros, limit_discovery

_DISCOVERY = 5.0
"""What is in the ROS 2 graph is found within this time [s]."""

_SETTLED = 1.3
"""Nothing more is expected when no new name has come for this time: what a full socket has dropped comes again with the
next heartbeat of Fast DDS, 1 s later [s]."""

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
    json_output.say("\n".join(f"{name:<60} {', '.join(found[name])}" for name in found))


@click.command()
@click.argument("topic")
@count_option(1)
@click.option("--once", is_flag=True, expose_value=False, help=ONCE_HELP)
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
            json_output.say(yaml.safe_dump(values, sort_keys=False) + "---")


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
    json_output.say(yaml.safe_dump(shown, sort_keys=False).rstrip())
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
    for each, descriptor in zip(shown, described, strict=False):
        json_output.say(parameter_line(each, shown[each], descriptor))


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
