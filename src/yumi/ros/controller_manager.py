"""The services of one arm's controller manager, with the names, types and meanings of ros2_control (Jazzy)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from controller_manager_msgs.srv import (
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
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup

from yumi.ros.arm_controllers import ArmControllers
from yumi.ros.arm_hardware import ArmHardware
from yumi.ros.controller_messages import (
    controller_state,
    filled,
    hardware_interfaces,
    hardware_state,
    lifecycle_state,
    state_of,
)
from yumi.ros.repeats import Repeats

try:
    from controller_manager_msgs.srv import CleanupController
except ImportError:  # installations from before December 2025
    CleanupController = None

BASE_CLASS = "controller_interface::ControllerInterface"
Carry = Callable[[Any], None]


class ControllerManagerServices:
    """Offers them from the moment it is made; what asks for a change is answered one after the other.

    Args:
        node: the controller manager's node.
        controllers: the arm's controllers.
        hardware: the arm as a hardware component.
        repeats: knows a change that is asked for again.
        rate: how often controllers are updated [Hz].
        on_change: called after each change that was asked for.
    """

    def __init__(
        self,
        node: Any,
        controllers: ArmControllers,
        hardware: ArmHardware,
        repeats: Repeats,
        rate: int,
        on_change: Callable[[], None],
    ) -> None:
        self._node = node
        self._log = node.get_logger()
        self._controllers = controllers
        self._hardware = hardware
        self._repeats = repeats
        self._rate = rate
        self._on_change = on_change
        self._changes = MutuallyExclusiveCallbackGroup()
        self._lists = MutuallyExclusiveCallbackGroup()  # of their own: looking never waits for a slow change
        self._offer_changes()
        self._offer_lists()

    def _offer_changes(self) -> None:
        controllers = self._controllers
        changes: Mapping[str, tuple[Any, Carry]] = {
            "load_controller": (LoadController, lambda request: controllers.load(request.name)),
            "configure_controller": (ConfigureController, lambda request: controllers.configure(request.name)),
            "cleanup_controller": (CleanupController, lambda request: controllers.cleanup(request.name)),
            "unload_controller": (UnloadController, lambda request: controllers.unload(request.name)),
            "reload_controller_libraries": (
                ReloadControllerLibraries,
                lambda request: controllers.reload(request.force_kill),
            ),
        }
        for name, (kind, carry) in changes.items():
            if kind is not None:
                self._create(kind, name, self._answer_with(name, carry), self._changes)
        self._create(SwitchController, "switch_controller", self._switch, self._changes)
        self._create(SetHardwareComponentState, "set_hardware_component_state", self._set_hardware, self._changes)

    def _offer_lists(self) -> None:
        lists = {
            "list_controllers": (ListControllers, self._list_controllers),
            "list_controller_types": (ListControllerTypes, self._list_types),
            "list_hardware_components": (ListHardwareComponents, self._list_components),
            "list_hardware_interfaces": (ListHardwareInterfaces, self._list_interfaces),
        }
        for name, (kind, fill) in lists.items():
            self._create(kind, name, self._list_with(name, fill), self._lists)

    def _create(self, kind: Any, name: str, answer: Callable[[Any, Any], Any], group: Any) -> None:
        self._node.create_service(kind, f"~/{name}", answer, callback_group=group)

    def _answer_with(self, name: str, carry: Carry) -> Callable[[Any, Any], Any]:
        def answer(request: Any, response: Any) -> Any:
            response.ok = self._try(name, lambda: self._repeats.once((name, request), lambda: carry(request)))
            return response

        return answer

    def _list_with(self, name: str, fill: Callable[[Any], None]) -> Callable[[Any, Any], Any]:
        def answer(_: Any, response: Any) -> Any:
            try:
                fill(response)
            except Exception as error:
                self._log.error(f"{name}: {error}")
            return response

        return answer

    def _try(self, name: str, carry: Callable[[], object]) -> bool:
        try:
            carry()
        except Exception as error:  # of ROS, too: a parameter file that it cannot read; a service always answers
            self._log.error(f"{name}: {error}")
            return False
        finally:
            self._on_change()
        return True

    def _switch(self, request: Any, response: Any) -> Any:
        def carry() -> str:
            timeout = request.timeout.sec + request.timeout.nanosec * 1e-9
            return self._controllers.switch(
                request.activate_controllers, request.deactivate_controllers, request.strictness, timeout
            )

        try:
            sentence = self._repeats.once(("switch_controller", request), carry)
            return filled(response, ok=True, message=sentence)
        except Exception as error:
            self._log.error(f"switch_controller: {error}")
            return filled(response, ok=False, message=str(error))
        finally:
            self._on_change()

    def _set_hardware(self, request: Any, response: Any) -> Any:
        def carry() -> None:
            self._hardware.bring_to(request.name, state_of(request.target_state))

        name = "set_hardware_component_state"
        response.ok = self._try(name, lambda: self._repeats.once((name, request), carry))
        response.state = lifecycle_state(self._hardware.state)
        return response

    def _list_controllers(self, response: Any) -> None:
        response.controller = [controller_state(info, self._rate) for info in self._controllers.list()]

    def _list_types(self, response: Any) -> None:
        response.types = list(self._controllers.kinds())
        response.base_classes = [BASE_CLASS] * len(response.types)

    def _list_components(self, response: Any) -> None:
        response.component = [hardware_state(self._hardware.info(), self._rate)]

    def _list_interfaces(self, response: Any) -> None:
        info = self._hardware.info()
        response.command_interfaces = hardware_interfaces(info.command_interfaces)
        response.state_interfaces = hardware_interfaces(info.state_interfaces)
