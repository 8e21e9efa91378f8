"""The parameters of a controller as ROS parameters of its node: declared with type, range, unit and description.

The parameters of a controller manager's node: its own, and those that say how each controller is loaded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from math import isinf
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter as RosParameter

from yumi.control.controller import ParameterInfo
from yumi.control.controller_manager import Strictness
from yumi.errors import CommandRefused, YumiError
from yumi.settings import Entry, Parameter, ParameterType, Value, Values

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


_STRICTNESS = "defaults.switch_controller.strictness"
_STRICTNESSES = {"best_effort": Strictness.BEST_EFFORT, "strict": Strictness.STRICT}
_THRESHOLDS = "diagnostics.threshold"


class ManagerParameters:
    """Declares and reads them. The node must allow parameters that nobody declared: tools set them before loading.

    Args:
        node: the controller manager's node.
        rate: how often controllers are updated [Hz].
    """

    def __init__(self, node: Any, rate: int) -> None:
        self._node = node
        self._declare_own(rate)
        node.add_on_set_parameters_callback(self._check)

    def note_type(self, name: str, kind: str) -> None:
        """Declare the type of a controller that was loaded from the start, for tools that offer what can be loaded."""
        if not self._node.has_parameter(f"{name}.type"):
            self._node.declare_parameter(f"{name}.type", kind, _dynamic("Type of the controller."))

    def type_of(self, name: str) -> str:
        """The type of the controller ``name``.

        Raises:
            CommandRefused: nobody has said.
        """
        kinds = tuple(text for text in self._texts(f"{name}.type") if text)
        if len(kinds) != 1:
            raise CommandRefused(
                f"Controller {name!r} has {'no type' if not kinds else f'the types {kinds}'}; set the parameter "
                f"{name}.type of {self._node.get_name()} to one first."
            )
        return kinds[0]

    def arguments_of(self, name: str) -> tuple[str, ...]:
        """The ROS arguments of the controller's node: its parameter files, then its own options."""
        files = [word for file in self._texts(f"{name}.params_file") for word in ("--params-file", file)]
        options = [word for text in self._texts(f"{name}.node_options_args") for word in text.split()]
        return (*files, *(word for word in options if word != "--ros-args"))

    @property
    def strictness(self) -> Strictness:
        """How strict a switch is that does not say."""
        return _STRICTNESSES[self._node.get_parameter(_STRICTNESS).value]

    def threshold(self, subject: str, quantity: str) -> tuple[float, float]:
        """From where on a figure is worth a warning, and an error: [Hz] or [µs]."""
        warn, error = (
            self._node.get_parameter(f"{_THRESHOLDS}.{subject}.{quantity}.{level}").value for level in ("warn", "error")
        )
        return float(warn), float(error)

    def _texts(self, name: str) -> tuple[str, ...]:
        """One text or a list of them; empty where nothing, or something else, is set."""
        value = self._node.get_parameter(name).value if self._node.has_parameter(name) else None
        texts = [value] if isinstance(value, str) else value if isinstance(value, list) else []
        return tuple(text for text in texts if isinstance(text, str))

    def _declare_own(self, rate: int) -> None:
        fixed = {
            "update_rate": (rate, "How often controllers are updated [Hz]: the robot's own rate."),
            "enforce_command_limits": (True, "Whether commands are kept within the joints' limits: always."),
            "handle_exceptions": (True, "Whether a controller that fails is deactivated: always."),
            "defaults.allow_controller_activation_with_inactive_hardware": (False, "Never: EGM must run."),
            "defaults.deactivate_controllers_on_hardware_self_deactivate": (True, "Always, when EGM ends."),
        }
        for name, (value, description) in fixed.items():
            self._node.declare_parameter(name, value, ParameterDescriptor(description=description, read_only=True))
        words = " or ".join(_STRICTNESSES)
        rule = ParameterDescriptor(
            description="Strictness of a switch that asks for 0.", additional_constraints=f"one of {words}"
        )
        self._node.declare_parameter(_STRICTNESS, "best_effort", rule)
        self._declare_thresholds()

    def _declare_thresholds(self) -> None:
        for subject in ("controller_manager", "controllers", "hardware_components"):
            for figure in ("mean_error", "standard_deviation"):
                self._declare_threshold(f"{subject}.periodicity.{figure}", 5.0, 10.0, "Hz")
        for subject in ("controllers", "hardware_components"):
            self._declare_threshold(f"{subject}.execution_time.mean_error", 1000.0, 2000.0, "µs")
            self._declare_threshold(f"{subject}.execution_time.standard_deviation", 100.0, 200.0, "µs")

    def _declare_threshold(self, name: str, warn: float, error: float, unit: str) -> None:
        for level, value in (("warn", warn), ("error", error)):
            description = ParameterDescriptor(description=f"From where on /diagnostics shows it as {level} [{unit}].")
            self._node.declare_parameter(f"{_THRESHOLDS}.{name}.{level}", value, description)

    def _check(self, parameters: list[Any]) -> SetParametersResult:
        for parameter in parameters:
            if parameter.name == _STRICTNESS and parameter.value not in _STRICTNESSES:
                words = " or ".join(_STRICTNESSES)
                return SetParametersResult(successful=False, reason=f"{_STRICTNESS} is {words}.")
        return SetParametersResult(successful=True)


def _dynamic(description: str) -> ParameterDescriptor:
    """Of a parameter whose type tools may change: the spawner sets lists where a file had a text."""
    return ParameterDescriptor(description=description, dynamic_typing=True)
