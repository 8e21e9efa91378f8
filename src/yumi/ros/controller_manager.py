"""The services of one arm's controller manager, with the names, types and meanings of ros2_control (Jazzy).

The node ``controller_manager`` of one arm: it waits for a robot description, then serves the arm's controllers.

``~/activity``: who is in which state, told again whenever that changes, and known to whoever comes late.

What a controller manager tells on ``/diagnostics``: its controllers, its hardware, its rate; as ros2_control.

A change that is asked for twice: clients that give up waiting send the same request again, after it was served.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from threading import Lock
from typing import Any, TypeVar

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
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import Executor
from rclpy.qos import DurabilityPolicy, QoSProfile

from yumi.clock import Clock
from yumi.control.controller import ControllerInfo, HardwareInfo, State
from yumi.control.events import ControllerReport, ControlProcessEnded, Event, is_fault
from yumi.control.loop import CommandPort
from yumi.control.statistics import Statistics
from yumi.driver.settings import ControllerSettings
from yumi.driver.stops import Cause, explained
from yumi.errors import YumiError
from yumi.robot.joints import CYCLE, Side
from yumi.ros.controllers import ArmControllers, ArmHardware, ControllerNodes, MakeInterface
from yumi.ros.executors import Ticker
from yumi.ros.messages import (
    ACTIVITY,
    activity,
    controller_state,
    filled,
    hardware_interfaces,
    hardware_state,
    lifecycle_state,
    stamp,
    state_of,
)
from yumi.ros.parameters import ManagerParameters
from yumi.ros.topics import DescriptionWait

T = TypeVar("T")

JUST_FINISHED = 1.0
"""A request that waited while the same one was served is looked at within this time after it [s]."""


class Repeats:
    """Gives a request that comes again, in flight or just finished, the outcome of the first.

    Only a success is remembered, since a refusal has changed nothing; and only the last, since another change in
    between, also one that nobody asked for, makes the same request a new one.

    Args:
        clock: tells what is just finished.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._lock = Lock()
        self._last: tuple[object, object, float] | None = None
        self._changes = 0

    def once(self, request: object, carry: Callable[[], T]) -> T:
        """What ``carry`` gives, or has just given for an equal ``request``; what it raises is raised."""
        with self._lock:
            last = self._last
            if last is not None and last[0] == request and self._clock.now() - last[2] <= JUST_FINISHED:
                return last[1]  # type: ignore[return-value]  # an equal request gave it
            self._last, changes = None, self._changes
            outcome = carry()
            if changes == self._changes:
                self._last = (request, outcome, self._clock.now())
            return outcome

    def forget(self) -> None:
        """Something else has changed: the next request is a new one; from any thread."""
        self._changes += 1
        self._last = None


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


_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class ActivityTopic:
    """Publishes the states of one arm's controllers and hardware when they have changed, if there is a type for it.

    Args:
        node: the controller manager's node.
        controllers: what is loaded.
        hardware: the arm's component.
    """

    def __init__(
        self, node: Any, controllers: Callable[[], tuple[ControllerInfo, ...]], hardware: Callable[[], HardwareInfo]
    ) -> None:
        self._clock = node.get_clock()
        self._log = node.get_logger()
        self._controllers = controllers
        self._hardware = hardware
        self._lock = Lock()
        self._last: tuple[tuple[str, State], ...] | None = None
        self._publisher = None
        if ACTIVITY is not None:
            self._publisher = node.create_publisher(ACTIVITY, "~/activity", _LATCHED)

    def update(self) -> None:
        """Look, and tell if something has changed; without the fast line there is nothing to tell."""
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


HARDWARE_ID = "ros2_control"
_PERIOD = 1.0  # [s]

Threshold = Callable[[str, str], tuple[float, float]]
"""From a subject and a quantity to where a warning and an error begin, [Hz] or [µs]."""


Status = tuple[bytes, str, list[KeyValue]]
"""Level, sentence and values."""

OK: bytes = DiagnosticStatus.OK
WARN: bytes = DiagnosticStatus.WARN
ERROR: bytes = DiagnosticStatus.ERROR


class ManagerDiagnostics:
    """Publishes three statuses a second for one controller manager.

    Args:
        node: the controller manager's node.
        controllers: the arm's controllers; None while the robot description is awaited.
        hardware: the arm's component.
        threshold: where warnings and errors begin.
        rate: how often controllers shall be updated [Hz].
        ticker: has them published; it waits for the fast line each time.
    """

    def __init__(
        self,
        node: Any,
        controllers: ArmControllers,
        hardware: ArmHardware,
        is_waiting: Callable[[], bool],
        threshold: Threshold,
        rate: int,
        ticker: Ticker,
    ) -> None:
        self._name = node.get_fully_qualified_name()  # both arms' managers have the same bare name
        self._clock = node.get_clock()
        self._controllers = controllers
        self._hardware = hardware
        self._is_waiting = is_waiting
        self._threshold = threshold
        self._rate = rate
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 1)
        ticker.every(_PERIOD, f"/diagnostics of {self._name}", self._publish)

    def _publish(self) -> None:
        array = DiagnosticArray()
        array.header.stamp = stamp(self._clock.now().nanoseconds)
        array.status = [
            DiagnosticStatus(
                name=f"{self._name}: {task}", hardware_id=HARDWARE_ID, level=level, message=text, values=pairs
            )
            for task, (level, text, pairs) in self._tasks()
        ]
        self._publisher.publish(array)

    def _tasks(self) -> Iterable[tuple[str, Status]]:
        if self._is_waiting():
            waiting = "Waiting for robot description...."
            return [("Controller Manager Activity", (WARN, waiting, []))]
        try:
            controllers, hardware = self._controllers.list(), self._hardware.info()
        except YumiError as error:
            return [("Controller Manager Activity", (ERROR, str(error), []))]
        return [
            ("Controllers Activity", controllers_status(controllers, self._threshold)),
            ("Hardware Components Activity", hardware_status(hardware, self._rate, self._threshold)),
            ("Controller Manager Activity", manager_status(hardware, self._rate, self._threshold)),
        ]


def controllers_status(controllers: Iterable[ControllerInfo], threshold: Threshold) -> Status:
    """The controllers' states, and how long the updates of the active ones take."""
    infos = tuple(controllers)
    if not infos:
        return WARN, "No controllers are currently loaded", []
    pairs, level = [], OK
    for info in infos:
        pairs.append(_pair(f"{info.name}.state", info.state.value))
        if info.state is State.ACTIVE and info.execution_time.count:
            pairs.append(_pair(f"{info.name}.execution_time", _times(info.execution_time)))
            level = max(level, _time_level(info.execution_time, "controllers", threshold))
    is_all = all(info.state is State.ACTIVE for info in infos)
    return level, "All controllers are active" if is_all else "Not all controllers are active", pairs


def hardware_status(hardware: HardwareInfo, rate: int, threshold: Threshold) -> Status:
    """The component's state, how long reading and writing take, and how often."""
    pairs = [_pair(f"{hardware.name}.state", hardware.state.value)]
    if hardware.state is not State.ACTIVE:
        return ERROR, "No hardware components are active", pairs
    level = OK
    for word, times in (("read", hardware.read_time), ("write", hardware.write_time)):
        if times.count:
            pairs.append(_pair(f"{hardware.name}.{word}_cycle.execution_time", _times(times)))
            pairs.append(_pair(f"{hardware.name}.{word}_cycle.periodicity", _rates(hardware.period)))
            level = max(level, _time_level(times, "hardware_components", threshold))
    level = max(level, _rate_level(hardware.period, rate, "hardware_components", threshold))
    return level, "All hardware components are active", pairs


def manager_status(hardware: HardwareInfo, rate: int, threshold: Threshold) -> Status:
    """How often the controllers are updated; the robot's datagrams are what makes it."""
    pairs, period = [_pair("update_rate", str(rate))], hardware.period
    if not period.count:
        return OK, "Controller Manager is running", pairs
    mean, deviation, slowest, fastest = _in_hertz(period)
    figures = {"average": mean, "standard_deviation": deviation, "min": slowest, "max": fastest}
    pairs += [_pair(f"periodicity.{key}", f"{value:.2f}") for key, value in figures.items()]
    return _rate_level(period, rate, "controller_manager", threshold), "Controller Manager is running", pairs


def _pair(key: str, value: str) -> KeyValue:
    return KeyValue(key=key, value=value)


def _times(times: Statistics) -> str:
    mean, lowest, highest, deviation = (
        value * 1e6 for value in (times.mean, times.minimum, times.maximum, times.deviation)
    )
    return f"Avg: {mean:.1f} [{lowest:.1f} - {highest:.1f}] us, StdDev: {deviation:.1f}"


def _rates(period: Statistics) -> str:
    mean, deviation, slowest, fastest = _in_hertz(period)
    return f"Avg: {mean:.1f} [{slowest:.1f} - {fastest:.1f}] Hz, StdDev: {deviation:.1f}"


def _in_hertz(period: Statistics) -> tuple[float, float, float, float]:
    """Mean, standard deviation (to first order), lowest and highest rate of some periods [Hz]."""
    if not period.count or period.mean <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    fastest = 1.0 / period.minimum if period.minimum > 0.0 else 0.0
    return 1.0 / period.mean, period.deviation / period.mean**2, 1.0 / period.maximum, fastest


def _time_level(times: Statistics, subject: str, threshold: Threshold) -> bytes:
    mean = _level(times.mean * 1e6, threshold(subject, "execution_time.mean_error"))
    return max(mean, _level(times.deviation * 1e6, threshold(subject, "execution_time.standard_deviation")))


def _rate_level(period: Statistics, rate: int, subject: str, threshold: Threshold) -> bytes:
    if not period.count:
        return OK
    mean, deviation, _, _ = _in_hertz(period)
    worst = _level(abs(mean - rate), threshold(subject, "periodicity.mean_error"))
    return max(worst, _level(deviation, threshold(subject, "periodicity.standard_deviation")))


def _level(value: float, limits: tuple[float, float]) -> bytes:
    warn, error = limits
    if value > error:
        return ERROR
    return WARN if value > warn else OK


Explain = Callable[[Callable[[Cause], None]], None]

RATE = round(1.0 / CYCLE)
"""``update_rate`` [Hz]: the robot's own, 4.032 ms a cycle."""


class ArmManager:
    """One arm's controller manager on the ROS side.

    Args:
        side: which arm.
        line: where the controllers live.
        known: the controllers of ``controllers.yaml``, loaded or not.
        executor: what spins this node and those of the controllers.
        interfaces: what controllers of a kind offer besides parameters.
        clock: the machine's clock.
        ticker: for what has to be asked of the fast line.
        on_look: called whenever the arm's activity is looked at.
    """

    def __init__(
        self,
        side: Side,
        line: CommandPort,
        known: Iterable[ControllerSettings],
        executor: Executor,
        interfaces: Mapping[str, MakeInterface],
        clock: Clock,
        ticker: Ticker,
        on_look: Callable[[], None] = lambda: None,
    ) -> None:
        self.node: Any = rclpy.create_node(
            "controller_manager", namespace=side.value, allow_undeclared_parameters=True, enable_logger_service=True
        )
        self._on_look = on_look
        self._repeats = Repeats(clock)
        self._parameters = ManagerParameters(self.node, RATE, self._repeats.forget)
        self._nodes = ControllerNodes(side, line, executor, interfaces, RATE)
        self._controllers = ArmControllers(side, line, self._nodes, self._parameters, known, self.node.get_logger())
        self._hardware = ArmHardware(side, line)
        self._activity = ActivityTopic(self.node, self._controllers.list, self._hardware.info)
        self._news = self.node.create_guard_condition(self._look, MutuallyExclusiveCallbackGroup())
        executor.add_node(self.node)
        self._wait = DescriptionWait(self.node, side, self._serve)
        self._diagnostics = ManagerDiagnostics(
            self.node,
            self._controllers,
            self._hardware,
            lambda: not self._wait.is_over,
            self._parameters.threshold,
            RATE,
            ticker,
        )

    def tell(self, event: Event, explain: Explain | None = None) -> None:
        """Log what happened in the fast line and look at who is in which state; from any thread.

        Args:
            event: what happened.
            explain: calls back with what stopped the robot, once that is known; a fault is logged with it then.
        """
        if isinstance(event, ControllerReport):
            self._nodes.tell(event.controller, event.report)
            return
        if isinstance(event, ControlProcessEnded):
            self._nodes.tell_all(event)
        log = self.node.get_logger()
        if not is_fault(event):
            log.info(str(event))
        elif explain is None:
            log.error(str(event))
        else:
            explain(lambda cause: log.error(explained(event, cause)))
        self.look()

    def look(self) -> None:
        """Have the executor look whether the activity has changed; from any thread."""
        self._repeats.forget()
        self._news.trigger()

    def destroy(self) -> None:
        """When nothing spins any more."""
        self._nodes.destroy()
        self.node.destroy_node()

    def _look(self) -> None:
        if self._wait.is_over:
            self._update()

    def _update(self) -> None:
        self._activity.update()
        self._on_look()

    def _serve(self) -> None:
        try:
            self._controllers.begin()
        except YumiError as error:
            self.node.get_logger().error(f"The controllers cannot be served: {error}")
            return
        self._services = ControllerManagerServices(
            self.node, self._controllers, self._hardware, self._repeats, RATE, self._update
        )
        self._update()
