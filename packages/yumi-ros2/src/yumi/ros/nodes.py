"""Bases of the nodes of the driver: executors and timer threads for their callbacks, and their parameters.

A turn of an executor looks at every entity of all its nodes, several times for each request. With the whole driver in
one executor a turn takes ten milliseconds, during which no other thread runs; so each family of nodes has one with a
thread of its own. A node's timer costs such a turn, too, many times as much as what most timers do; so periodic work
has a :class:`TimerThread`, which also goes on while a service call waits.

Parameters of controllers and of a controller manager are ROS parameters with type, range, unit and description.
"""

from __future__ import annotations

import re
import threading
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from math import inf, isinf
from pathlib import Path
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy._rclpy_pybind11 import InvalidHandle
from rclpy.exceptions import ParameterException
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.parameter import Parameter as RosParameter

from abb_protocols.catalogue import message, quoted, said_by
from abb_protocols.errors import CommandRefused, MissingPrerequisite, YumiError
from abb_runtime.clock import Clock
from abb_runtime.parameters import Parameter, ParameterFileEntry, ParameterType, Value, Values, read_parameter_file
from abb_runtime.process.supervision import SupervisedThread, ThreadFailures, no_thread
from yumi.control.controller import find_controller_parameter
from yumi.control.controller_info import ParameterInfo
from yumi.control.manager.controller_switch import Strictness
from yumi.ros.messages import RATE

_THREADS = 8  # so many slow callbacks of a family run side by side
_SPIN_TIMEOUT = 0.5  # [s] how soon a failed callback is logged
_FAILURE_PAUSE = 0.01  # [s]
_LEAST_PAUSE = 0.001  # [s] a timer thread that is behind lets others run
_ANSWER_TRIES = 50  # each of which the middleware gives 0.1 s
_CANCELLING = 1.0  # [s] at most, until rclpy has set the flag of a goal that is cancelled


class _LateAnswers:
    """Sends an answer again that DDS has dropped, as it had not discovered the client yet, although the client called.

    A client that has just begun on a busy machine would else wait in vain. The middleware itself waits 0.1 s, then
    rclpy warns; the other tries have a thread of their own, as a callback may not wait so long.

    Args:
        send: of a service of rclpy: the answer and the header of its request.
        name: of the service.
        log_error: gets that an answer was given up.
    """

    def __init__(self, send: Callable[[Any, Any], None], name: str, log_error: Callable[[str], None]) -> None:
        warnings.filterwarnings("error", "failed to send response", RuntimeWarning)
        self._send, self._name, self._log_error = send, name, log_error

    def __call__(self, answer: Any, header: Any) -> None:
        if not self._is_sent(answer, header):
            threading.Thread(target=self._send_again, args=(answer, header), name="late answer", daemon=True).start()

    def _send_again(self, answer: Any, header: Any) -> None:
        try:
            if not any(self._is_sent(answer, header) for _ in range(_ANSWER_TRIES)):
                self._log_error(f"An answer of {self._name} did not reach its client, which DDS has not discovered.")
        except InvalidHandle:
            return  # the node was destroyed meanwhile
        except Exception as error:  # of the middleware; the thread of the next answer is another one
            self._log_error(f"An answer of {self._name} could not be sent, {type(error).__name__}: {error}.")

    def _is_sent(self, answer: Any, header: Any) -> bool:
        try:
            self._send(answer, header)
        except (RuntimeWarning, SystemError) as error:  # of rclpy's C++, which goes on after the warning
            if not isinstance(error, RuntimeWarning) and not isinstance(error.__cause__, RuntimeWarning):
                raise
            return False
        return True


def _send_late_answers(node: Any, log_error: Callable[[str], None]) -> None:
    """Have all services of a node send an answer again that DDS has dropped."""
    for service in node.services:
        if not isinstance(service.send_response, _LateAnswers):
            service.send_response = _LateAnswers(service.send_response, service.srv_name, log_error)


class _MultiThreadedExecutor(MultiThreadedExecutor):  # type: ignore[misc]  # rclpy has no types
    """Reports a failed callback soon; rclpy's own looks when the next callback comes, however late."""

    def __init__(self, log_error: Callable[[str], None]) -> None:
        super().__init__(num_threads=_THREADS)
        self._log_error = log_error

    def add_node(self, node: Any) -> bool:
        _send_late_answers(node, self._log_error)
        return bool(super().add_node(node))

    def spin_once(self, timeout_sec: float | None = None) -> None:
        super().spin_once(timeout_sec)
        for future in [each for each in self._futures if each.done()]:
            self._futures.remove(future)
            future.result()  # raises what the callback raised

    def start_threads(self) -> None:
        """Start the pool's threads now; rclpy starts one whenever callbacks meet, and the driver would grow for hours.

        Raises:
            MissingPrerequisite: the operating system permits none; fewer than all are enough.
        """
        try:
            self._executor.submit(lambda: None).result()
        except RuntimeError as error:
            raise MissingPrerequisite(no_thread("ROS 2's services", error)) from error
        together = threading.Barrier(_THREADS)
        try:
            for _ in range(_THREADS):
                self._executor.submit(together.wait)
        except RuntimeError:  # the operating system permits fewer: so many callbacks run side by side
            together.abort()

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        is_done = bool(super().shutdown(timeout_sec))
        self._executor.shutdown(wait=False)  # the pool's threads end, which rclpy leaves to the garbage collector
        return is_done


class Executors:
    """Some executors, with a thread each between start and stop; ``log_error`` gets what a callback failed with."""

    def __init__(self, log_error: Callable[[str], None]) -> None:
        self._log_error = log_error
        self._is_over = threading.Event()
        self._executors: list[Executor] = []
        self._threads: list[SupervisedThread] = []
        self._failures = ThreadFailures()

    def add_multi_threaded(self, name: str, *nodes: Any) -> Executor:
        """Add one for services and actions, which may take their time."""
        return self._add(_MultiThreadedExecutor(self._log_error), name, nodes)

    def add_single_threaded(self, name: str, *nodes: Any) -> Executor:
        """Add one for topics that come hundreds of times a second."""
        return self._add(SingleThreadedExecutor(), name, nodes)

    def start(self) -> None:
        """Spin all from now on.

        Raises:
            MissingPrerequisite: the operating system permits too few threads.
        """
        for executor in self._executors:
            for node in executor.get_nodes():
                _send_late_answers(node, self._log_error)
            if isinstance(executor, _MultiThreadedExecutor):
                executor.start_threads()
        for thread in self._threads:
            thread.start()

    def stop(self) -> None:
        """Begin no further callback; one that runs is not waited for."""
        self._is_over.set()
        for executor in self._executors:
            executor.shutdown()
        for thread in self._threads:
            thread.join()

    def _add(self, executor: Executor, name: str, nodes: tuple[Any, ...]) -> Executor:
        for node in nodes:
            executor.add_node(node)
        self._executors.append(executor)
        self._threads.append(SupervisedThread(name, partial(self._spin, executor), self._is_over))
        return executor

    def _spin(self, executor: Executor) -> None:
        while not self._is_over.is_set():
            try:
                executor.spin_once(timeout_sec=_SPIN_TIMEOUT)
            except InvalidHandle:
                continue  # a controller's node was destroyed while the executor looked for work
            except Exception as error:  # of one callback; the others must still be served
                if self._is_over.is_set():
                    return  # the executor was shut down while it looked for work
                if self._failures.note("A callback", error):
                    self._log_error(f"A callback failed with {type(error).__name__}: {error}.")
                self._is_over.wait(_FAILURE_PAUSE)


@dataclass(eq=False, slots=True)
class _Timer:
    what: str
    action: Callable[[], None]
    period: float
    due: float
    is_failing: bool = False


class TimerThread:
    """Calls actions at fixed periods, one after the other, between start and stop.

    A late call is not made up for; an action that failed is called again at its next time.

    Args:
        clock: what the periods are measured on.
        log_error: called with what an action fails with, once until it succeeds.
        name: of the thread.
    """

    def __init__(self, clock: Clock, log_error: Callable[[str], None], name: str = "timers") -> None:
        self._clock = clock
        self._log_error = log_error
        self._timers: list[_Timer] = []
        self._lock = threading.RLock()
        self._has_changed, self._is_over = threading.Event(), threading.Event()
        self._failures = ThreadFailures()
        self._thread = SupervisedThread(name, self._run, self._is_over)

    def every(self, period: float, what: str, action: Callable[[], None]) -> Callable[[], None]:
        """Call ``action``, which publishes ``what``, once each ``period`` [s].

        Returns:
            What ends that; no call goes on after it, except one that ends itself.
        """
        timer = _Timer(what, action, period, self._clock.now() + period)
        with self._lock:
            self._timers.append(timer)
        self._has_changed.set()

        def end() -> None:
            with self._lock:
                if timer in self._timers:
                    self._timers.remove(timer)

        return end

    def start(self) -> None:
        self._thread.start()

    def stop(self) -> None:
        """Call nothing any more; before the actions lose what they need."""
        self._is_over.set()
        self._has_changed.set()
        self._thread.join()

    def tick(self) -> float:
        """Call what is due; returns the time until the next call [s]. The thread does that once it has started."""
        now = self._clock.now()
        for timer in tuple(self._timers):
            if timer.due > now:
                continue
            timer.due = timer.due + timer.period if now < timer.due + timer.period else now + timer.period
            try:
                timer.action()
                timer.is_failing = False
            except Exception as error:  # the others still have to be published
                self._failures.note(f"Publishing {timer.what}", error)
                if not timer.is_failing:
                    timer.is_failing = True
                    self._log_error(f"{timer.what} could not be published, {type(error).__name__}: {error}.")
        return min((timer.due for timer in self._timers), default=inf) - self._clock.now()

    def _run(self) -> None:
        while not self._is_over.is_set():
            self._has_changed.clear()
            with self._lock:
                pause = self.tick()
            self._has_changed.wait(max(_LEAST_PAUSE, pause) if pause < inf else None)


def is_cancelled(handle: Any, clock: Clock) -> bool:
    """Whether the client of an action's goal has cancelled it, for a goal whose cancel callback was called.

    rclpy sets the flag, without which no goal can end as cancelled, only after that callback; what the callback has
    stopped may have ended by then.
    """
    end = clock.now() + _CANCELLING
    while not handle.is_cancel_requested and clock.now() < end:
        clock.wait(0.001)
    return bool(handle.is_cancel_requested)


_ROS_TYPES = {
    ParameterType.BOOL: RosParameter.Type.BOOL,
    ParameterType.INTEGER: RosParameter.Type.INTEGER,
    ParameterType.DOUBLE: RosParameter.Type.DOUBLE,
    ParameterType.STRING: RosParameter.Type.STRING,
    ParameterType.DOUBLE_ARRAY: RosParameter.Type.DOUBLE_ARRAY,
    ParameterType.STRING_ARRAY: RosParameter.Type.STRING_ARRAY,
}
_LARGEST_INTEGER = 2**63 - 1

Presets = Mapping[str, ParameterFileEntry]
"""Values of a controller's parameters in ``controllers.yaml``, by name."""


def _parameter_descriptor(parameter: Parameter) -> ParameterDescriptor:
    """What ``ros2 param describe`` shows: unit and rule stand beside the description."""
    is_bounded = not (isinf(parameter.lowest) and isinf(parameter.highest))
    rules = []
    if parameter.choices:
        rules.append(f"one of {', '.join(parameter.choices)}")
    if parameter.type is ParameterType.DOUBLE_ARRAY and is_bounded:
        rules.append(f"each from {parameter.lowest:g} to {parameter.highest:g}")
    if parameter.unit:
        rules.append(f"in {parameter.unit}")
    if parameter.fixed:
        rules.append(f"fixed: {parameter.fixed}")
    elif parameter.read_only:
        rules.append("only while the controller is unconfigured")
    described = ParameterDescriptor(
        name=parameter.name,
        type=_ROS_TYPES[parameter.type].value,
        description=f"{parameter.description} [{parameter.unit}]" if parameter.unit else parameter.description,
        additional_constraints="; ".join(rules),
        read_only=bool(parameter.fixed),
    )
    lowest, highest = parameter.lowest, parameter.highest
    if is_bounded and parameter.type is ParameterType.DOUBLE:
        described.floating_point_range = [FloatingPointRange(from_value=lowest, to_value=highest)]
    elif is_bounded and parameter.type is ParameterType.INTEGER:
        low, high = (int(max(-_LARGEST_INTEGER, min(_LARGEST_INTEGER, bound))) for bound in (lowest, highest))
        described.integer_range = [IntegerRange(from_value=low, to_value=high)]
    return described


def declare_parameters(node: Any, infos: Iterable[ParameterInfo], presets: Presets) -> Values:
    """Declare parameters on a controller's node.

    Args:
        node: which may have parameter files of its own.
        infos: the parameters and what the controller holds.
        presets: values that apply where the node's own files give none.

    Returns:
        The values that differ from what the controller holds.

    Raises:
        CommandRefused: a file gives a value of the wrong type or out of its range.
    """
    changed: dict[str, Value] = {}
    for parameter, value in infos:
        name, known = parameter.name, {"name": parameter.name, "node": node.get_name()}
        if parameter.is_group:
            continue
        try:
            accepted = parameter.accept(presets[name].value if name in presets and not parameter.fixed else value)
            initial = list(accepted) if isinstance(accepted, tuple) else accepted
            wanted = _value_of(
                node.declare_parameter(name, initial, _parameter_descriptor(parameter), bool(parameter.fixed))
            )
        except CommandRefused as refusal:
            raise CommandRefused(message("parameter_not_accepted", why=refusal.said, **known)) from refusal
        except ParameterException as error:
            raise CommandRefused(message("parameter_not_accepted", why=said_by(error), **known)) from error
        if wanted != value:
            changed[name] = wanted
    return changed


def parameter_remarks(
    node: Any, infos: Iterable[ParameterInfo], presets: Presets, files: Iterable[Path]
) -> tuple[str, ...]:
    """A sentence for each parameter that is set on a controller's node and changes nothing.

    Args:
        node: with its parameters declared.
        infos: the parameters and what the controller holds.
        presets: values of ``controllers.yaml``.
        files: the node's parameter files; what they say for every node may be for others.

    Raises:
        CommandRefused: a parameter does not exist, or a file has the node in another namespace.
        SettingsError: a file cannot be read.
    """
    controller, full_name = node.get_name(), node.get_fully_qualified_name()
    held = {info.parameter: info.value for info in infos}
    given: dict[str, Value] = {name: entry.value for name, entry in presets.items() if not entry.is_general}
    # rclpy has no public list of what files and options set.
    given |= {name: _value_of(override) for name, override in node._parameter_overrides.items()}
    given.pop("type", None)  # the spawner's
    for section in (section for file in files for section in read_parameter_file(file).sections):
        if section.concerns(full_name):
            for name in (name for name, entry in section.entries.items() if entry.is_general):
                given.pop(name, None)
        elif section.nodes.rpartition("/")[2] == controller:
            raise CommandRefused(
                message(
                    "section_of_other_node",
                    place=section.place,
                    section=section.nodes,
                    node=full_name,
                    controller=controller,
                )
            )
    remarks: dict[str, str] = {}
    for name, value in given.items():
        found = find_controller_parameter(held, name)
        if name.startswith("qos_overrides."):  # `ros2 param dump` of C++ nodes has them
            remarks["qos_overrides"] = (
                f"Parameter 'qos_overrides' of {controller!r} is not used: topics have fixed QoS."
            )
        elif found is None and not node.has_parameter(name):
            words = [each.name for each in held if not each.fixed]
            similar = get_close_matches(name, words, 1)
            unknown = {"name": name, "node": controller}
            if similar:
                raise CommandRefused(message("parameter_unknown_similar", similar=similar[0], **unknown))
            raise CommandRefused(message("parameter_unknown", known=tuple(words) or ("none",), **unknown))
        if found and found.fixed and (found.is_group or value != held[found]):
            stays = "is not used" if found.is_group else f"stays {held[found]!r}"
            remarks[found.name] = f"Parameter {found.name!r} of {controller!r} {stays}: {found.fixed}."
    return tuple(remarks.values())


def _value_of(parameter: Any) -> Any:
    """The value of a ROS parameter; lists become tuples."""
    is_list = parameter.type_ in {RosParameter.Type.DOUBLE_ARRAY, RosParameter.Type.STRING_ARRAY}
    return tuple(parameter.value) if is_list else parameter.value


def pass_on_parameter_changes(node: Any, names: Iterable[str], change: Callable[[Values], None]) -> None:
    """Call ``change`` with what is set on ``node`` among ``names``; what it refuses is refused to the client."""
    known = frozenset(names)

    def on_set(parameters: list[Any]) -> SetParametersResult:
        values = {parameter.name: _value_of(parameter) for parameter in parameters if parameter.name in known}
        try:
            if values:
                change(values)
        except YumiError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    node.add_on_set_parameters_callback(on_set)


_IN_STEP = "every controller runs in each cycle of the robot"
_FIXED = (
    Parameter("update_rate", RATE, unit="Hz", description="Rate of its updates.", fixed=_IN_STEP),
    Parameter("is_async", default=False, description="Whether it runs in a thread of its own.", fixed=_IN_STEP),
    Parameter("thread_priority", (), fixed=_IN_STEP),
    Parameter("async_parameters", (), fixed=_IN_STEP),
    Parameter("fallback_controllers", (), fixed="when a controller fails the arm holds"),
)
COMMON_PARAMETERS = tuple(ParameterInfo(each, each.default) for each in _FIXED)
"""What every controller of ros2_control has."""

_STRICTNESS = "defaults.switch_controller.strictness"
_STRICTNESSES = {"best_effort": Strictness.BEST_EFFORT, "strict": Strictness.STRICT}
_THRESHOLDS = "diagnostics.threshold"
_SUBJECTS = ("controller_manager", "controllers", "hardware_components")
_OF_A_CONTROLLER = ("type", "params_file", "node_options_args", "fallback_controllers")  # what ros2_control's tools set
_CONTROLLER = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,99}")
_LONGEST_TEXT = 10_000  # characters
_MOST_OF_CONTROLLERS = 400  # parameters


def _why_no_texts(name: str, value: object) -> str:
    """Why a parameter of a controller does not take a value; empty when it does. None deletes the parameter."""
    texts = [] if value is None else [value] if isinstance(value, str) else value
    if not isinstance(texts, list) or not all(isinstance(each, str) for each in texts):
        return f"Parameter {name} is {quoted(value)}; it must be a text or a list of texts."
    length = sum(map(len, texts))
    return f"Parameter {name} has {length} characters; allowed are {_LONGEST_TEXT}." if length > _LONGEST_TEXT else ""


class ManagerParameters:
    """Parameters of a controller manager's node: its own, and those that say how each controller is loaded.

    The node must allow undeclared parameters: tools set those of a controller before loading, and no others are taken.

    Args:
        node: the controller manager's node.
    """

    def __init__(self, node: Any) -> None:
        self._node = node
        fixed = {
            "update_rate": (RATE, "How often controllers are updated [Hz]: the robot's own rate."),
            "enforce_command_limits": (True, "Whether commands are kept within the joints' limits: always."),
            "handle_exceptions": (True, "Whether a controller that fails is deactivated: always."),
            "defaults.allow_controller_activation_with_inactive_hardware": (False, "Never: EGM must run."),
            "defaults.deactivate_controllers_on_hardware_self_deactivate": (True, "Always, when EGM ends."),
        }
        for name, (value, description) in fixed.items():
            node.declare_parameter(name, value, ParameterDescriptor(description=description, read_only=True))
        words = " or ".join(_STRICTNESSES)
        rule = ParameterDescriptor(
            description="Strictness of a switch that asks for 0.", additional_constraints=f"one of {words}"
        )
        node.declare_parameter(_STRICTNESS, "best_effort", rule)
        # Upstream's own clock makes its rate; here the robot's datagrams do, however unevenly they arrive. A reply is
        # in time within its cycle, so what counts is how many there are: half a cycle, and a whole one, may vary. The
        # same holds for how long an update takes: one that had to wait for a processor must not be a warning for ever.
        thresholds: list[tuple[str, float, float, str]] = [
            *((f"{subject}.periodicity.mean_error", 5.0, 10.0, "Hz") for subject in _SUBJECTS),
            *((f"{subject}.periodicity.standard_deviation", 0.5 * RATE, 1.0 * RATE, "Hz") for subject in _SUBJECTS),
            *((f"{subject}.execution_time.mean_error", 1000.0, 2000.0, "µs") for subject in _SUBJECTS[1:]),
            *(
                (f"{subject}.execution_time.standard_deviation", 0.5e6 / RATE, 1.0e6 / RATE, "µs")
                for subject in _SUBJECTS[1:]
            ),
        ]
        for name, warn, error, unit in thresholds:
            for level, bound in (("warn", warn), ("error", error)):
                described = ParameterDescriptor(description=f"From where on /diagnostics shows it as {level} [{unit}].")
                node.declare_parameter(f"{_THRESHOLDS}.{name}.{level}", bound, described)

        self._own = frozenset(node.get_parameters_by_prefix(""))  # rclpy's, too

        def check(parameters: list[Any]) -> SetParametersResult:
            reason = next(filter(None, map(self._why_refused, parameters)), "")
            return SetParametersResult(successful=not reason, reason=reason)

        node.add_on_set_parameters_callback(check)

    def _why_refused(self, parameter: Any) -> str:
        """Why a value is not taken; empty when it is."""
        name, value = parameter.name, parameter.value
        if name in self._own:
            is_wrong = name == _STRICTNESS and value not in _STRICTNESSES
            return f"{_STRICTNESS} is {' or '.join(_STRICTNESSES)}." if is_wrong else ""
        controller, _, word = name.rpartition(".")
        if word not in _OF_A_CONTROLLER or not _CONTROLLER.fullmatch(controller):
            known = ", ".join(f"<controller>.{each}" for each in _OF_A_CONTROLLER)
            return f"Parameter {quoted(name)} does not exist; those of a controller are {known}."
        others = self._node.get_parameters_by_prefix("").keys() - self._own
        if name not in others and len(others) >= _MOST_OF_CONTROLLERS:
            return (
                f"Parameter {name} refused: {len(others)} parameters of controllers are set; delete those that are not "
                "needed with ros2 param delete."
            )
        return _why_no_texts(name, value)

    def note_type(self, name: str, kind: str) -> None:
        """Declare the type of a controller that was loaded from the start, for tools that offer what can be loaded."""
        if not self._node.has_parameter(f"{name}.type"):
            # Tools may change the type: the spawner sets lists where a file had a text.
            rule = ParameterDescriptor(description="Type of the controller.", dynamic_typing=True)
            self._node.declare_parameter(f"{name}.type", kind, rule)

    def type_of(self, name: str) -> str:
        """The type of the controller ``name``, as a parameter or in its parameter files.

        Raises:
            CommandRefused: it is not set.
            SettingsError: a parameter file cannot be read.
        """
        kinds = tuple(text for text in self._texts(f"{name}.type") if text)
        for file in () if kinds else self._texts(f"{name}.params_file"):
            # The spawner passes on a type that stands with the controller; in most files it stands with the manager.
            entry = (
                read_parameter_file(Path(file)).parameters(self._node.get_fully_qualified_name()).get(f"{name}.type")
            )
            kinds = (str(entry.value),) if entry else kinds
        if len(kinds) != 1:
            node = self._node.get_name()
            if not kinds:
                raise CommandRefused(message("controller_without_type", controller=name, node=node))
            raise CommandRefused(message("controller_with_types", controller=name, kinds=tuple(kinds), node=node))
        return kinds[0]

    def arguments_of(self, name: str) -> tuple[str, ...]:
        """The ROS arguments of the controller's node: its parameter files, then its own options."""
        files = [word for file in self._texts(f"{name}.params_file") for word in ("--params-file", file)]
        options = [word for text in self._texts(f"{name}.node_options_args") for word in text.split()]
        return (*files, *(word for word in options if word != "--ros-args"))

    @property
    def strictness(self) -> Strictness:
        """Strictness of a switch that names none."""
        return _STRICTNESSES[self._node.get_parameter(_STRICTNESS).value]

    def threshold(self, subject: str, quantity: str) -> tuple[float, float]:
        """From which figure on /diagnostics warns, and shows an error: [Hz] or [µs]."""
        warn, error = (
            self._node.get_parameter(f"{_THRESHOLDS}.{subject}.{quantity}.{level}").value for level in ("warn", "error")
        )
        return float(warn), float(error)

    def _texts(self, name: str) -> tuple[str, ...]:
        """One text or a list of them; empty where nothing, or something else, is set."""
        value = self._node.get_parameter(name).value if self._node.has_parameter(name) else None
        texts = [value] if isinstance(value, str) else value if isinstance(value, list) else []
        return tuple(text for text in texts if isinstance(text, str))
