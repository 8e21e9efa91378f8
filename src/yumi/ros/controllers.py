"""One arm's controllers in ROS: they run in the control process; here each loaded one has a node of its name.

The node has the controller's parameters, and the topics and actions of its type. The arm itself is a hardware component
of ros2_control, which decides whether its interfaces can be used.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as Overdue
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

import rclpy
from rclpy.executors import Executor

from yumi.control.controller import ControllerInfo, HardwareInfo, ParameterInfo, State
from yumi.control.controller_manager import Strictness
from yumi.control.events import ControlProcessEnded, ReportsDropped
from yumi.control.loop import CommandPort, Commands
from yumi.driver.settings import ControllerSettings
from yumi.errors import CommandRefused, RobotNotReady, YumiError
from yumi.process.supervision import Failures
from yumi.robot.joints import Side
from yumi.ros.parameters import ManagerParameters, Presets, common_parameters, declare, pass_on_changes, remarks_on
from yumi.settings import Values


class ControllerInterface(Protocol):
    """Topics or actions of one controller."""

    def on_event(self, event: Any) -> None:
        """An event of the controller, see :meth:`yumi.control.controller.Controller.take_reports`."""

    def destroy(self) -> None:
        """End them; before the node is destroyed."""


MakeInterface = Callable[[Any, Side, str], ControllerInterface]
"""Makes what a controller of some kind offers besides parameters, from its node, the arm and its name."""


class ControllerNodes:
    """The nodes of one arm's controllers, with their parameters; they come with loading and go with unloading.

    Args:
        side: which arm.
        namespace: of the nodes, such as ``/r``.
        control: where the controllers are commanded.
        executor: what spins the nodes.
        interfaces: what controllers of a type offer besides parameters.
        rate: of the controller manager [Hz].
    """

    def __init__(
        self,
        side: Side,
        namespace: str,
        control: CommandPort,
        executor: Executor,
        interfaces: Mapping[str, MakeInterface],
        rate: int,
    ) -> None:
        self._side = side
        self._namespace = namespace
        self._control = control
        self._executor = executor
        self._make_interface = interfaces
        self._rate = rate
        self._nodes: dict[str, tuple[Any, ControllerInterface | None]] = {}
        self._failures = Failures()

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
            every = (*common_parameters(self._rate), *infos)
            changed = declare(node, every, presets or {})
            for remark in remarks_on(node, every, presets or {}, files):
                node.get_logger().warning(remark)
            if changed:
                change(changed)
            pass_on_changes(node, (each.parameter.name for each in infos if not each.parameter.fixed), change)
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

_SWITCH_TIMEOUT = 1.0  # [s], ros2_control's own where a request says 0


class ArmControllers:
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
            raise CommandRefused(
                f"Controller {name!r} cannot be loaded: there is no type {kind!r} here; {_ADVICE[kind]}."
            )
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
            raise CommandRefused(
                f"Strictness {strictness} is unknown; choose 1 (best effort) or 2 (strict)."
            ) from error
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
            raise RobotNotReady(f"Switch controller timed out after {limit:g} seconds!") from error

    def reload(self, is_forced: bool) -> None:
        """Unload all controllers; there are no libraries to load again.

        Raises:
            YumiError: one is active and it is not forced.
        """
        controllers = self.list()
        active = [info.name for info in controllers if info.state is State.ACTIVE]
        if active and not is_forced:
            raise CommandRefused(f"Controllers are active: {', '.join(active)}; deactivate them first, or force it.")
        if active:
            self._control.call(Commands.switch_controllers, self._side, (), active)
        for info in controllers:
            self.unload(info.name)

    def _info(self, name: str) -> ControllerInfo:
        controllers = self.list()
        for info in controllers:
            if info.name == name:
                return info
        loaded = ", ".join(info.name for info in controllers) or "none"
        raise CommandRefused(f"There is no controller {name!r}; loaded are: {loaded}.")


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
