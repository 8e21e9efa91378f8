"""The tools of ros2_control as plain rclpy clients: what each calls, in its order, with its fields."""

from __future__ import annotations

from typing import Any

from controller_manager_msgs.srv import (
    CleanupController,
    ConfigureController,
    ListControllers,
    ListControllerTypes,
    ListHardwareComponents,
    ListHardwareInterfaces,
    LoadController,
    ReloadControllerLibraries,
    SetHardwareComponentState,
    SwitchController,
    UnloadController,
)
from lifecycle_msgs.msg import State
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue, SetParametersResult
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    GetParameterTypes,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
from ros_bench import Client

BEST_EFFORT, STRICT = SwitchController.Request.BEST_EFFORT, SwitchController.Request.STRICT

SERVICES = {
    "list_controllers": ListControllers,
    "list_controller_types": ListControllerTypes,
    "load_controller": LoadController,
    "configure_controller": ConfigureController,
    "switch_controller": SwitchController,
    "unload_controller": UnloadController,
    "cleanup_controller": CleanupController,
    "reload_controller_libraries": ReloadControllerLibraries,
    "list_hardware_components": ListHardwareComponents,
    "list_hardware_interfaces": ListHardwareInterfaces,
    "set_hardware_component_state": SetHardwareComponentState,
}
PARAMETER_SERVICES = {
    "describe_parameters": DescribeParameters,
    "get_parameter_types": GetParameterTypes,
    "get_parameters": GetParameters,
    "list_parameters": ListParameters,
    "set_parameters": SetParameters,
    "set_parameters_atomically": SetParametersAtomically,
}
CALL_TIMEOUT = 10.0
"""How long the spawner waits for an answer before it asks again [s]."""


class Manager:
    """One controller manager as the tools call it."""

    def __init__(self, client: Client, name: str = "/r/controller_manager") -> None:
        self.client = client
        self.name = name
        self.namespace = name.rpartition("/")[0]

    def call(self, service: str, /, **fields: Any) -> Any:
        kind = SERVICES[service]
        return self.client.call(kind, f"{self.name}/{service}", kind.Request(**fields), CALL_TIMEOUT)

    def controllers(self) -> dict[str, Any]:
        return {state.name: state for state in self.call("list_controllers").controller}

    def state(self, name: str) -> str:
        controllers = self.controllers()
        return str(controllers[name].state) if name in controllers else "not loaded"

    def switch(
        self,
        activate: list[str],
        deactivate: list[str],
        strictness: int = STRICT,
        asap: bool = True,
        timeout: float = 5.0,
    ) -> Any:
        fields = {"activate_controllers": activate, "deactivate_controllers": deactivate, "strictness": strictness}
        request = SwitchController.Request(**fields, activate_asap=asap)
        request.timeout.sec, request.timeout.nanosec = int(timeout), int(timeout % 1.0 * 1e9)
        return self.client.call(SwitchController, f"{self.name}/switch_controller", request, CALL_TIMEOUT)

    def set_parameter(self, name: str, value: ParameterValue) -> SetParametersResult:
        """As the spawner: one call for each parameter."""
        return set_parameter(self.client, self.name, name, value)

    def spawn(self, name: str, kind: str | None = None, files: list[str] | None = None, inactive: bool = False) -> bool:
        """The spawner's sequence for one controller; whether it ends with exit code 0."""
        if name not in self.controllers():
            if files:
                assert self.set_parameter(f"{name}.params_file", texts(files)).successful
            if kind:
                assert self.set_parameter(f"{name}.type", text(kind)).successful
            if not self.call("load_controller", name=name).ok:
                return False
        if not self.call("configure_controller", name=name).ok:
            return False
        return inactive or bool(self.switch([name], []).ok)

    def unspawn(self, name: str) -> bool:
        return bool(self.switch([], [name]).ok and self.call("unload_controller", name=name).ok)

    def component(self, name: str) -> Any:
        return next(each for each in self.call("list_hardware_components").component if each.name == name)

    def set_hardware(self, name: str, number: int, label: str) -> Any:
        """As hardware_spawner: id and label, and both compared afterwards."""
        return self.call("set_hardware_component_state", name=name, target_state=State(id=number, label=label))


def set_parameter(client: Client, node: str, name: str, value: ParameterValue) -> SetParametersResult:
    request = SetParameters.Request(parameters=[Parameter(name=name, value=value)])
    (result,) = client.call(SetParameters, f"{node}/set_parameters", request).results
    return result


def get_parameter(client: Client, node: str, name: str) -> ParameterValue:
    (value,) = client.call(GetParameters, f"{node}/get_parameters", GetParameters.Request(names=[name])).values
    return value


def text(value: str) -> ParameterValue:
    return ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=value)


def texts(values: list[str]) -> ParameterValue:
    return ParameterValue(type=ParameterType.PARAMETER_STRING_ARRAY, string_array_value=values)


def number(value: float) -> ParameterValue:
    return ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)


def numbers(values: list[float]) -> ParameterValue:
    return ParameterValue(type=ParameterType.PARAMETER_DOUBLE_ARRAY, double_array_value=values)


def integer(value: int) -> ParameterValue:
    return ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=value)


def boolean(value: bool) -> ParameterValue:
    return ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=value)
