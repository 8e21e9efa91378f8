"""The controller manager of one arm, with the services, topics and meanings of ros2_control (Jazzy).

The node ``controller_manager`` waits for a robot description, then serves the arm's controllers. ``~/activity`` says
who is in which state whenever that changes, latched. ``/diagnostics`` has controllers, hardware and rate.

The controllers run in the control process; here each loaded one has a node of its name, with its parameters and the
topics and actions of its type. The arm itself is a hardware component of ros2_control, which decides whether its
interfaces can be used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as Overdue
from functools import partial
from itertools import pairwise
from pathlib import Path
from threading import Lock
from typing import Any, Protocol
from xml.etree import ElementTree

import rclpy
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
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import Executor
from std_msgs.msg import String

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, RobotNotReady, YumiError
from abb_protocols.robot.joints import Side, joint_names
from abb_runtime.clock import Clock
from abb_runtime.parameters import Values
from abb_runtime.process.supervision import ThreadFailures
from yumi.control.controller import State
from yumi.control.controller_info import ControllerInfo, HardwareInfo, ParameterInfo
from yumi.control.loop_commands import CommandPort, Commands
from yumi.control.loop_events import (
    ControllerReport,
    ControlProcessEnded,
    Event,
    ReportsDropped,
    is_fault,
    is_logged,
    is_warning,
)
from yumi.control.manager.controller_switch import Strictness
from yumi.driver.settings import ControllerSettings
from yumi.driver.stops import Explain, explained
from yumi.ros.manager_diagnostics import (
    DIAGNOSTIC_ERROR,
    DIAGNOSTIC_WARN,
    ManagerStatus,
    controllers_status,
    hardware_status,
    manager_status,
)
from yumi.ros.messages import (
    ACTIVITY,
    LATCHED_QOS,
    SERVICES_QOS,
    activity,
    controller_state,
    filled_message,
    hardware_interfaces,
    hardware_state,
    lifecycle_of_ros_message,
    lifecycle_state,
    seconds,
    stamp,
)
from yumi.ros.nodes import (
    COMMON_PARAMETERS,
    ManagerParameters,
    Presets,
    TimerThread,
    declare_parameters,
    parameter_remarks,
    pass_on_parameter_changes,
)

try:
    from controller_manager_msgs.srv import CleanupController
except ImportError:  # installations from before December 2025
    CleanupController = None

_BASE_CLASS = "controller_interface::ControllerInterface"
_HARDWARE_ID = "ros2_control"

_DIAGNOSTICS_PERIOD = 1.0  # [s]
_REMINDER = 2.0  # [s] between two that the description is still waited for
_SWITCH_TIMEOUT = 1.0  # [s], ros2_control's own where a request says 0
_NO_EFFORTS = "EGM takes no efforts: take a type for positions or velocities"
_ADVICE: Mapping[str, str] = {
    "ur_controllers/ScaledJointTrajectoryController": (
        "take joint_trajectory_controller/JointTrajectoryController, whose trajectories follow the robot's speed_scale"
    ),
    "effort_controllers/JointGroupEffortController": _NO_EFFORTS,
    "effort_controllers/GripperActionController": _NO_EFFORTS,
    "position_controllers/GripperActionController": "the gripper's actions need no controller: gripper/gripper_cmd",
    "parallel_gripper_action_controller/GripperActionController": (
        "the gripper's actions need no controller: gripper/parallel_gripper_cmd"
    ),
}
"""What to do about types of other robots' files."""


class ControllerInterface(Protocol):
    """Topics or actions of one controller."""

    def on_event(self, event: Any) -> None:
        """An event of the controller, see :meth:`yumi.control.controller.Controller.take_reports`."""

    def destroy(self) -> None:
        """End them; before the node is destroyed."""


MakeInterface = Callable[[Any, Side, str], ControllerInterface]
"""Makes what a controller of some kind offers besides parameters, from its node, the arm and its name."""


class ControllerManagerNode:
    """The node ``controller_manager`` of one arm.

    Args:
        side: which arm.
        namespace: of its nodes, such as ``/r``.
        control: where the controllers are commanded.
        known: the controllers of ``controllers.yaml``, loaded or not.
        executor: what spins this node and those of the controllers.
        interfaces: what controllers of a type offer besides parameters.
        clock: the machine's clock.
        timers: for what has to be requested from the control process.
    """

    def __init__(
        self,
        side: Side,
        namespace: str,
        control: CommandPort,
        known: Iterable[ControllerSettings],
        executor: Executor,
        interfaces: Mapping[str, MakeInterface],
        clock: Clock,
        timers: TimerThread,
    ) -> None:
        self.node: Any = rclpy.create_node(
            "controller_manager", namespace=namespace, allow_undeclared_parameters=True, enable_logger_service=True
        )
        self._log = self.node.get_logger()
        self._clock = self.node.get_clock()
        self._name = self.node.get_fully_qualified_name()  # both arms' managers have the same bare name
        self._parameters = ManagerParameters(self.node)
        self._nodes = ControllerNodes(side, namespace, control, executor, interfaces)
        self._controllers = ManagedControllers(side, control, self._nodes, self._parameters, known, self._log)
        self._hardware = ArmHardware(side, control)
        self._activity = ActivityTopic(self.node, self._controllers.list, self._hardware.info)
        self._has_changed = self.node.create_guard_condition(self._publish_activity, MutuallyExclusiveCallbackGroup())
        executor.add_node(self.node)
        self._wait = DescriptionWait(self.node, side, self._serve)
        self._diagnostics = self.node.create_publisher(DiagnosticArray, "/diagnostics", 1)
        timers.every(_DIAGNOSTICS_PERIOD, f"/diagnostics of {self._name}", self._publish_diagnostics)

    def on_event(self, event: Event, explain: Explain | None = None) -> None:
        """Log an event of the control process and update the activity; from any thread.

        Args:
            event: what happened.
            explain: calls back with what stopped the robot, once that is known; a fault is logged with it then.
        """
        if isinstance(event, ControllerReport):
            self._nodes.on_event(event.controller, event.report)
            if is_logged(event):
                if is_warning(event):  # a line for each: rclpy refuses another severity from the same line
                    self._log.warning(str(event))
                else:
                    self._log.info(str(event))
            return
        if isinstance(event, ControlProcessEnded | ReportsDropped):
            self._nodes.on_event_of_all(event)
        if not is_fault(event):
            self._log.info(str(event))
        elif explain is None:
            self._log.error(str(event))
        else:
            explain(lambda cause: self._log.error(str(explained(event, cause))))
        self.update()

    def update(self) -> None:
        """Have the executor publish the activity if it has changed; from any thread."""
        self._has_changed.trigger()

    def destroy(self) -> None:
        """When nothing spins any more."""
        self._nodes.destroy()
        self.node.destroy_node()

    def _publish_activity(self) -> None:
        if self._wait.is_over:
            self._activity.update()

    def _serve(self) -> None:
        try:
            self._controllers.begin()
        except YumiError as error:
            self._log.error(f"The controllers cannot be served: {error}")
            return
        self._services = ControllerManagerServices(self.node, self._controllers, self._hardware, self._activity.update)
        self._activity.update()

    def _publish_diagnostics(self) -> None:
        array = DiagnosticArray()
        array.header.stamp = stamp(self._clock.now().nanoseconds)
        array.status = [
            DiagnosticStatus(
                name=f"{self._name}: {task}", hardware_id=_HARDWARE_ID, level=level, message=text, values=pairs
            )
            for task, (level, text, pairs) in self._statuses()
        ]
        self._diagnostics.publish(array)

    def _statuses(self) -> Iterable[tuple[str, ManagerStatus]]:
        if not self._wait.is_over:
            return [("Controller Manager Activity", (DIAGNOSTIC_WARN, "Waiting for robot description....", []))]
        try:
            controllers, hardware = self._controllers.list(), self._hardware.info()
        except YumiError as error:
            return [("Controller Manager Activity", (DIAGNOSTIC_ERROR, str(error), []))]
        threshold = self._parameters.threshold
        return [
            ("Controllers Activity", controllers_status(controllers, threshold)),
            ("Hardware Components Activity", hardware_status(hardware, threshold)),
            ("Controller Manager Activity", manager_status(hardware, threshold)),
        ]


class ManagedControllers:
    """Loads, configures, switches and unloads, and keeps the controllers' nodes in step.

    Args:
        side: which arm.
        control: where the controllers are commanded.
        nodes: their nodes.
        parameters: those of the controller manager, which say what to load and from which files.
        known: those of ``controllers.yaml``, loaded or not.
        log: for warnings about what is not refused.
    """

    def __init__(
        self,
        side: Side,
        control: CommandPort,
        nodes: ControllerNodes,
        parameters: ManagerParameters,
        known: Iterable[ControllerSettings],
        log: Any,
    ) -> None:
        self._side = side
        self._control = control
        self._nodes = nodes
        self._parameters = parameters
        self._known = {settings.name: settings for settings in known}
        self._log = log

    def begin(self) -> None:
        """Make the nodes of the controllers that were loaded from the start.

        Raises:
            YumiError: the control process has ended.
        """
        for settings in self._known.values():
            self._parameters.note_type(settings.name, settings.kind)
        for info in self.list():
            self._nodes.add(info, presets=self._known[info.name].entries)

    def list(self) -> tuple[ControllerInfo, ...]:
        """All loaded controllers."""
        return self._control.call(Commands.list_controllers, self._side)

    def kinds(self) -> tuple[str, ...]:
        """The types that can be loaded."""
        return self._control.call(Commands.list_controller_kinds, self._side)

    def load(self, name: str) -> None:
        """Load the controller of the type that the parameter ``<name>.type`` says, with its parameter files.

        Raises:
            YumiError: no or an unknown type, the name is taken, or a value in a file is not allowed.
        """
        kind, arguments = self._parameters.type_of(name), self._parameters.arguments_of(name)
        if kind in _ADVICE:
            raise CommandRefused(message("controller_type_not_here", controller=name, kind=kind, advice=_ADVICE[kind]))
        self._control.call(Commands.load_controller, self._side, name, kind)
        settings = self._known.get(name)
        presets = settings.entries if settings is not None and settings.kind == kind else {}
        try:
            self._nodes.add(self._info(name), arguments, presets)
        except Exception:
            self._control.call(Commands.unload_controller, self._side, name)
            raise

    def configure(self, name: str) -> None:
        """Make a controller inactive; an inactive one is cleaned up first."""
        self._control.call(Commands.configure_controller, self._side, name)

    def cleanup(self, name: str) -> None:
        """Make an inactive controller unconfigured; an unconfigured one stays as it is."""
        if self._info(name).state is not State.UNCONFIGURED:
            self._control.call(Commands.clean_up_controller, self._side, name)

    def unload(self, name: str) -> None:
        """Forget a controller that is not active, and its node."""
        self._control.call(Commands.unload_controller, self._side, name)
        self._nodes.remove(name)

    def switch(self, activate: Sequence[str], deactivate: Sequence[str], strictness: int, timeout: float) -> str:
        """Switch between two cycles; what was done as a sentence.

        Args:
            activate: names of controllers to activate.
            deactivate: names of controllers to deactivate.
            strictness: one of the wire's numbers, 0 for the default.
            timeout: how long to wait for the control process [s]; 0 for the default.

        Raises:
            RobotNotReady: it took longer; the switch may still happen.
            YumiError: a rule forbids it; nothing was changed.
        """
        limit = timeout if timeout > 0.0 else _SWITCH_TIMEOUT
        try:
            chosen = Strictness(strictness) if strictness else self._parameters.strictness
        except ValueError as error:
            raise CommandRefused(message("strictness_unknown", value=strictness)) from error
        if chosen in {Strictness.AUTO, Strictness.FORCE_AUTO}:
            self._log.warning(f"Strictness {chosen.name} is treated as BEST_EFFORT, as ros2_control does.")
            chosen = Strictness.BEST_EFFORT
        thread = ThreadPoolExecutor(1, f"switch-{self._side.value}")
        switch = partial(
            self._control.call, Commands.switch_controllers, self._side, tuple(activate), tuple(deactivate), chosen
        )
        waiting = thread.submit(switch)
        thread.shutdown(wait=False)  # it ends with the answer
        try:
            return waiting.result(limit)
        except Overdue as error:
            raise RobotNotReady(message("switch_timed_out", limit=limit)) from error

    def reload(self, is_forced: bool) -> None:
        """Unload all controllers; there are no libraries to load again.

        Raises:
            YumiError: one is active and it is not forced.
        """
        controllers = self.list()
        active = [info.name for info in controllers if info.state is State.ACTIVE]
        if active and not is_forced:
            raise CommandRefused(message("controllers_are_active", controllers=tuple(active)))
        if active:
            self._control.call(Commands.switch_controllers, self._side, (), active)
        for info in controllers:
            self.unload(info.name)

    def _info(self, name: str) -> ControllerInfo:
        controllers = self.list()
        for info in controllers:
            if info.name == name:
                return info
        loaded = tuple(info.name for info in controllers)
        raise CommandRefused(message("controller_unknown", controller=name, loaded=loaded))


class ControllerNodes:
    """The nodes of one arm's controllers, with their parameters; they come with loading and go with unloading.

    Args:
        side: which arm.
        namespace: of the nodes, such as ``/r``.
        control: where the controllers are commanded.
        executor: what spins the nodes.
        interfaces: what controllers of a type offer besides parameters.
    """

    def __init__(
        self,
        side: Side,
        namespace: str,
        control: CommandPort,
        executor: Executor,
        interfaces: Mapping[str, MakeInterface],
    ) -> None:
        self._side = side
        self._namespace = namespace
        self._control = control
        self._executor = executor
        self._make_interface = interfaces
        self._nodes: dict[str, tuple[Any, ControllerInterface | None]] = {}
        self._failures = ThreadFailures()

    def add(self, info: ControllerInfo, arguments: Sequence[str] = (), presets: Presets | None = None) -> None:
        """Make the node of a loaded controller.

        Args:
            info: the controller.
            arguments: ROS arguments of its node, e.g. parameter files.
            presets: the entries of ``controllers.yaml`` for a controller that is not loaded from the start.

        Raises:
            CommandRefused: a value in its parameter files is not allowed; there is no node.
            RobotNotReady: the control process has ended.
        """
        name = info.name

        def change(values: Values) -> None:
            self._control.call(Commands.set_parameters, self._side, name, values)

        node: Any = rclpy.create_node(
            name,
            namespace=self._namespace,
            cli_args=["--ros-args", *arguments] if arguments else None,
            use_global_arguments=False,
        )
        try:
            # The controller gets what its parameter files set now, and what is set on the node later.
            infos: tuple[ParameterInfo, ...] = self._control.call(Commands.list_parameters, self._side, name)
            files = [Path(word) for option, word in pairwise(arguments) if option == "--params-file"]
            every = (*COMMON_PARAMETERS, *infos)
            changed = declare_parameters(node, every, presets or {})
            for remark in parameter_remarks(node, every, presets or {}, files):
                node.get_logger().warning(remark)
            if changed:
                change(changed)
            pass_on_parameter_changes(node, (each.parameter.name for each in infos if not each.parameter.fixed), change)
            make = self._make_interface.get(info.kind)
            self._nodes[name] = (node, make(node, self._side, name) if make else None)
        except Exception:
            node.destroy_node()
            raise
        self._executor.add_node(node)

    def remove(self, name: str) -> None:
        """Destroy the node of an unloaded controller."""
        if name in self._nodes:
            self._executor.remove_node(self._nodes[name][0])
            self._destroy(name)

    def on_event(self, name: str, event: object) -> None:
        """Pass an event of one controller on to its topics and actions, else log it; from any thread."""
        node, interface = self._nodes.get(name, (None, None))
        if interface is not None:
            interface.on_event(event)
        elif node is not None and not isinstance(event, ControlProcessEnded | ReportsDropped):
            node.get_logger().info(str(event))

    def on_event_of_all(self, event: object) -> None:
        """Pass on what concerns all controllers; from any thread."""
        for name in tuple(self._nodes):
            self._failures.attempt(f"Handling {type(event).__name__} of {name}", self.on_event, name, event)

    def destroy(self) -> None:
        """Destroy all; when nothing spins any more."""
        for name in tuple(self._nodes):
            self._destroy(name)

    def _destroy(self, name: str) -> None:
        node, interface = self._nodes.pop(name)
        if interface is not None:
            interface.destroy()
        node.destroy_node()


class ArmHardware:
    """The component of one arm."""

    def __init__(self, side: Side, control: CommandPort) -> None:
        self._side = side
        self._control = control

    def info(self) -> HardwareInfo:
        """The component with its interfaces.

        Raises:
            YumiError: the control process has ended.
        """
        return self._control.call(Commands.hardware, self._side)

    @property
    def state(self) -> State:
        """Its lifecycle state; finalized without the control process, since only a restart helps then."""
        try:
            return self.info().state
        except YumiError:
            return State.FINALIZED

    def bring_to(self, name: str, target: State) -> None:
        """Bring it to a state; controllers that use what it no longer offers are deactivated, and the arm holds.

        Raises:
            YumiError: there is no such component, or it does not go to that state.
        """
        self._control.call(Commands.set_hardware_state, self._side, name, target)


class DescriptionWait:
    """Waits on ``robot_description`` for the first description that has the arm's joints; later ones change nothing."""

    def __init__(self, node: Any, side: Side, on_description: Callable[[], None]) -> None:
        self._log = node.get_logger()
        self._names = joint_names(side)
        self._on_description = on_description
        self._urdf = ""
        self._is_due = False  # the timer runs before anything is spun, and is overdue then though all is well
        self._reminder = node.create_timer(_REMINDER, self._remind)
        node.create_subscription(String, "robot_description", self._take, LATCHED_QOS)

    @property
    def is_over(self) -> bool:
        """Whether a description has come."""
        return bool(self._urdf)

    def _remind(self) -> None:
        if self._is_due:
            self._log.warning("Waiting for a message on robot_description.")
        self._is_due = True

    def _take(self, message: Any) -> None:
        if self._urdf:
            if message.data != self._urdf:
                self._log.warning("Another robot description has come; it is ignored until the driver is restarted.")
            return
        reason = self._why_not(message.data)
        if reason:
            self._log.error(f"The robot description cannot be used: {reason}.")
            return
        self._urdf = message.data
        self._reminder.cancel()
        self._on_description()

    def _why_not(self, urdf: str) -> str:
        try:
            found = {joint.get("name") for joint in ElementTree.fromstring(urdf).iter("joint")}
        except ElementTree.ParseError as error:
            return f"it is not XML ({error})"
        missing = [name for name in self._names if name not in found]
        return f"it has no joint {', '.join(missing)}" if missing else ""


class ControllerManagerServices:
    """Serves from the moment it is made; requests for a change are served one after the other.

    Args:
        node: the controller manager's node.
        controllers: the arm's controllers.
        hardware: the arm as a hardware component.
        on_change: called after each requested change.
    """

    def __init__(
        self,
        node: Any,
        controllers: ManagedControllers,
        hardware: ArmHardware,
        on_change: Callable[[], None],
    ) -> None:
        self._log = node.get_logger()
        self._controllers = controllers
        self._hardware = hardware
        self._on_change = on_change
        changes: Mapping[str, tuple[Any, Callable[[Any], None]]] = {
            "load_controller": (LoadController, lambda request: controllers.load(request.name)),
            "configure_controller": (ConfigureController, lambda request: controllers.configure(request.name)),
            "cleanup_controller": (CleanupController, lambda request: controllers.cleanup(request.name)),
            "unload_controller": (UnloadController, lambda request: controllers.unload(request.name)),
            "reload_controller_libraries": (
                ReloadControllerLibraries,
                lambda request: controllers.reload(request.force_kill),
            ),
        }
        lists: Mapping[str, tuple[Any, Callable[[], Mapping[str, object]]]] = {
            "list_controllers": (
                ListControllers,
                lambda: {"controller": [controller_state(info) for info in controllers.list()]},
            ),
            "list_controller_types": (
                ListControllerTypes,
                lambda: {"types": controllers.kinds(), "base_classes": [_BASE_CLASS] * len(controllers.kinds())},
            ),
            "list_hardware_components": (
                ListHardwareComponents,
                lambda: {"component": [hardware_state(hardware.info())]},
            ),
            "list_hardware_interfaces": (
                ListHardwareInterfaces,
                lambda: {
                    "command_interfaces": hardware_interfaces(hardware.info().command_interfaces),
                    "state_interfaces": hardware_interfaces(hardware.info().state_interfaces),
                },
            ),
        }
        change_group = MutuallyExclusiveCallbackGroup()
        list_group = MutuallyExclusiveCallbackGroup()  # of their own: a list never waits for a slow change

        def serve(kind: Any, name: str, answer: Callable[[Any, Any], Any], group: Any) -> None:
            node.create_service(kind, f"~/{name}", answer, qos_profile=SERVICES_QOS, callback_group=group)

        for name, (kind, call) in changes.items():
            if kind is not None:
                serve(kind, name, self._changing(name, call), change_group)
        serve(SwitchController, "switch_controller", self._switch, change_group)
        serve(SetHardwareComponentState, "set_hardware_component_state", self._set_hardware, change_group)
        for name, (kind, fields) in lists.items():
            serve(kind, name, self._listing(name, fields), list_group)

    def _changing(self, name: str, call: Callable[[Any], None]) -> Callable[[Any, Any], Any]:
        def answer(request: Any, response: Any) -> Any:
            response.ok = not self._why_failed(name, lambda: call(request))
            return response

        return answer

    def _listing(self, name: str, fields: Callable[[], Mapping[str, object]]) -> Callable[[Any, Any], Any]:
        def answer(_: Any, response: Any) -> Any:
            try:
                filled_message(response, **fields())
            except Exception as error:
                self._log.error(f"{name}: {error}")
            return response

        return answer

    def _why_failed(self, name: str, call: Callable[[], object]) -> str:
        """Make a change; the reason why it failed, which is logged, or nothing."""
        try:
            call()
        except Exception as error:  # of ROS, too: a parameter file that it cannot read; a service always answers
            self._log.error(f"{name}: {error}")
            return str(error)
        finally:
            self._on_change()
        return ""

    def _switch(self, request: Any, response: Any) -> Any:
        done: list[str] = []

        def call() -> None:
            activate, deactivate = request.activate_controllers, request.deactivate_controllers
            timeout = seconds(request.timeout, "Switch refused: timeout")
            done.append(self._controllers.switch(activate, deactivate, request.strictness, timeout))

        reason = self._why_failed("switch_controller", call)
        return filled_message(response, ok=bool(done), message=done[0] if done else reason)

    def _set_hardware(self, request: Any, response: Any) -> Any:
        def call() -> None:
            self._hardware.bring_to(request.name, lifecycle_of_ros_message(request.target_state))

        response.ok = not self._why_failed("set_hardware_component_state", call)
        response.state = lifecycle_state(self._hardware.state)
        return response


class ActivityTopic:
    """Publishes the states of one arm's controllers and hardware when they have changed, if there is a type for it."""

    def __init__(
        self, node: Any, controllers: Callable[[], tuple[ControllerInfo, ...]], hardware: Callable[[], HardwareInfo]
    ) -> None:
        self._clock = node.get_clock()
        self._log = node.get_logger()
        self._controllers = controllers
        self._hardware = hardware
        self._lock = Lock()
        self._last: tuple[tuple[str, State], ...] | None = None
        self._publisher = node.create_publisher(ACTIVITY, "~/activity", LATCHED_QOS) if ACTIVITY is not None else None

    def update(self) -> None:
        """Publish if something has changed; nothing is known without the control process."""
        if self._publisher is None:
            return
        with self._lock:
            try:
                controllers, hardware = self._controllers(), self._hardware()
            except YumiError as error:
                self._log.warning(f"activity: {error}", throttle_duration_sec=10.0)
                return
            states = (*((info.name, info.state) for info in controllers), (hardware.name, hardware.state))
            if states != self._last:
                self._last = states
                self._publisher.publish(activity(controllers, hardware, self._clock.now().nanoseconds))
