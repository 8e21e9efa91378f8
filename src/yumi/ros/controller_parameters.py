"""The parameters of a controller as ROS parameters of its node: declared with type, range, unit and description."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from math import isinf
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter as RosParameter

from yumi.control.inventory import ParameterInfo
from yumi.control.parameter import Parameter, ParameterType, Value, Values
from yumi.errors import CommandRefused, YumiError
from yumi.parameter_file import Entry

_TYPES = {
    ParameterType.BOOL: RosParameter.Type.BOOL,
    ParameterType.INTEGER: RosParameter.Type.INTEGER,
    ParameterType.DOUBLE: RosParameter.Type.DOUBLE,
    ParameterType.STRING: RosParameter.Type.STRING,
    ParameterType.DOUBLE_ARRAY: RosParameter.Type.DOUBLE_ARRAY,
    ParameterType.STRING_ARRAY: RosParameter.Type.STRING_ARRAY,
}
_LARGEST_INTEGER = 2**63 - 1

Presets = Mapping[str, Entry]
"""What ``controllers.yaml`` says of a controller, by parameter."""


def descriptor(parameter: Parameter) -> ParameterDescriptor:
    """What ``ros2 param describe`` tells: unit and rule stand beside the sentence."""
    return ParameterDescriptor(
        name=parameter.name,
        type=_TYPES[parameter.type].value,
        description=f"{parameter.description} [{parameter.unit}]" if parameter.unit else parameter.description,
        additional_constraints=_constraints(parameter),
        floating_point_range=_floating_range(parameter),
        integer_range=_integer_range(parameter),
    )


def _constraints(parameter: Parameter) -> str:
    rules = []
    if parameter.choices:
        rules.append(f"one of {', '.join(parameter.choices)}")
    if parameter.type is ParameterType.DOUBLE_ARRAY and _is_bounded(parameter):
        rules.append(f"each from {parameter.lowest:g} to {parameter.highest:g}")
    if parameter.unit:
        rules.append(f"in {parameter.unit}")
    if parameter.read_only:
        rules.append("only while the controller is unconfigured")
    return "; ".join(rules)


def _is_bounded(parameter: Parameter) -> bool:
    return not (isinf(parameter.lowest) and isinf(parameter.highest))


def _floating_range(parameter: Parameter) -> list[FloatingPointRange]:
    if parameter.type is not ParameterType.DOUBLE or not _is_bounded(parameter):
        return []
    return [FloatingPointRange(from_value=parameter.lowest, to_value=parameter.highest)]


def _integer_range(parameter: Parameter) -> list[IntegerRange]:
    if parameter.type is not ParameterType.INTEGER or not _is_bounded(parameter):
        return []
    lowest, highest = (
        int(max(-_LARGEST_INTEGER, min(_LARGEST_INTEGER, bound))) for bound in (parameter.lowest, parameter.highest)
    )
    return [IntegerRange(from_value=lowest, to_value=highest)]


def declare(node: Any, infos: Iterable[ParameterInfo], presets: Presets) -> Values:
    """Declare parameters on a controller's node.

    Args:
        node: which may have parameter files of its own.
        infos: the parameters and what the controller holds.
        presets: what holds where the node's own files say nothing.

    Returns:
        What the controller shall hold otherwise than it does.

    Raises:
        CommandRefused: a file gives a value of the wrong type or out of its range.
    """
    held = {info.parameter.name: info for info in infos}
    wanted: dict[str, Value] = {
        name: entry.value for name, entry in presets.items() if name in held or not entry.is_general
    }
    for name, info in held.items():
        wanted[name] = _declared(node, info.parameter, wanted.get(name, info.value))
    return {name: value for name, value in wanted.items() if name not in held or value != held[name].value}


def _declared(node: Any, parameter: Parameter, value: Value) -> Value:
    name = parameter.name
    try:
        accepted = parameter.accept(value)
    except CommandRefused as refusal:
        raise CommandRefused(f"Parameter {name!r} of {node.get_name()!r} {refusal}") from refusal
    try:
        initial = list(accepted) if isinstance(accepted, tuple) else accepted
        declared: Value = value_of(node.declare_parameter(name, initial, descriptor(parameter)))
    except ParameterException as error:
        raise CommandRefused(f"Parameter {name!r} of {node.get_name()!r}: {error}.") from error
    return declared


def value_of(parameter: Any) -> Any:
    """The value of a ROS parameter; lists become tuples."""
    is_list = parameter.type_ in {RosParameter.Type.DOUBLE_ARRAY, RosParameter.Type.STRING_ARRAY}
    return tuple(parameter.value) if is_list else parameter.value


def pass_on_changes(node: Any, names: Iterable[str], change: Callable[[Values], None]) -> None:
    """Have ``change`` called with what is set on ``node`` among ``names``; what it refuses is refused to the client."""
    known = frozenset(names)

    def on_set(parameters: list[Any]) -> SetParametersResult:
        values = {parameter.name: value_of(parameter) for parameter in parameters if parameter.name in known}
        try:
            if values:
                change(values)
        except YumiError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(on_set)


def declare_common(node: Any, rate: int) -> None:
    """Declare what every controller of ros2_control has; ``rate`` of the controller manager in [Hz]."""
    node.declare_parameter("update_rate", rate, _fixed("Rate of its updates [Hz]: the robot's own."))
    node.declare_parameter("is_async", False, _fixed("Whether it runs in a thread of its own: never."))


def _fixed(description: str) -> ParameterDescriptor:
    return ParameterDescriptor(description=description, read_only=True)
