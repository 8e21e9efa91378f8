"""One arm's controller manager in this process, on controllers in memory: what the tools never see at work."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from threading import Event, Timer
from types import SimpleNamespace
from typing import Any, Concatenate, ParamSpec, TypeVar
from unittest.mock import Mock

import pytest
from controller_manager_bench import (
    Manager,
    boolean,
    get_parameter,
    integer,
    number,
    numbers,
    set_parameter,
    text,
    texts,
)
from rcl_interfaces.msg import Log, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_bench import Client
from std_msgs.msg import String

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import YUMI_LIMITS, ArmState, Side, home, joint_names
from abb_protocols.robot.urdf import robot_description
from abb_runtime.clock import SystemClock
from abb_runtime.parameters import Parameter, ParameterFileEntry, Values
from controller_arms import LimitedArm, PerfectArm
from reported_limiter import ReportedLimiter
from yumi.control.controller import Controller, State
from yumi.control.controller_info import ControllerInfo
from yumi.control.goals import MemoryBuffer
from yumi.control.loop import ArmLoop
from yumi.control.loop_commands import Commands, serve
from yumi.control.loop_events import (
    ControllerFailed,
    ControllerReport,
    ControlProcessEnded,
    ProblemOver,
    RobotFollows,
    RobotStoppedFollowing,
    SessionLost,
    SessionResumed,
    SessionStarted,
)
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.shared_state import ArmProblem
from yumi.control.stream_monitor import StreamReport
from yumi.driver.settings import ControllerSettings
from yumi.driver.stops import Cause, explained
from yumi.ros import nodes
from yumi.ros.controller_manager_node import ControllerManagerNode, ControllerNodes, DescriptionWait
from yumi.ros.nodes import TimerThread

pytestmark = pytest.mark.ros

KIND = "tests/Watcher"
P = ParamSpec("P")
T = TypeVar("T")
SPEEDS = ("slow", "fast")
WEIGHTS = {"parameter": "weights", "lowest": 0.0, "highest": 9.0, "unit": "kg"}
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def no_value(code: str, **values: Any) -> Message:
    """Why a controller's parameter cannot have a value."""
    return message("controller_parameter_refused", controller="watcher", reason=message(code, **values))


class Watcher(Controller):
    """Watches, and has a parameter of each type."""

    kind = KIND
    is_command = False

    def __init__(self) -> None:
        self.values: Values = {}

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        return (
            Parameter("gain", 1.0, 0.0, 2.0, "1/s", "Stiffness."),
            Parameter("count", 3, 1, 5, description="How many."),
            Parameter("is_loud", False, description="Whether it is loud."),
            Parameter("mode", "slow", choices=SPEEDS, description="How."),
            Parameter("weights", (1.0, 2.0), 0.0, 9.0, "kg", "How heavy."),
            Parameter("joints", joint_names, description="Which joints.", read_only=True),
        )

    def configure(self, values: Values) -> None:
        self.values = values

    def activate(self, state: ArmState) -> None:
        return None


class MemoryLine:
    """The control process with one arm, in this process; ``is_gone`` makes it end."""

    def __init__(self) -> None:
        self.made: list[Watcher] = []
        self.is_gone = False
        self.may_answer = Event()
        self.may_answer.set()
        manager = ControllerManager(joint_names(Side.RIGHT), {KIND: self._make}, "ROB_R")
        limiter = ReportedLimiter(YUMI_LIMITS)
        loop = ArmLoop(Side.RIGHT, LimitedArm(PerfectArm(home(Side.RIGHT)), limiter), manager, limiter, MemoryBuffer())
        self._commands = Commands({Side.RIGHT: loop}, lambda: 0.0)

    def _make(self, _: str) -> Watcher:
        self.made.append(Watcher())
        return self.made[-1]

    def call(self, command: Callable[Concatenate[Commands, P], T], /, *args: P.args, **kwargs: P.kwargs) -> T:
        if self.is_gone:
            raise RobotNotReady("The control process has ended; restart the driver.")
        self.may_answer.wait()
        return serve(self._commands, command, *args, **kwargs)


class Interface:
    """Remembers the events of its controller."""

    def __init__(self) -> None:
        self.notices: list[object] = []

    def on_event(self, event: object) -> None:
        self.notices.append(event)

    def destroy(self) -> None:
        self.notices.append("destroyed")


@pytest.fixture(scope="module")
def rig(ros: None) -> Iterator[SimpleNamespace]:
    executor, line, interface, clock = SingleThreadedExecutor(), MemoryLine(), Interface(), SystemClock()
    entries = {
        "gain": ParameterFileEntry(1, "file:1", is_general=False),
        "nobody's": ParameterFileEntry(1, "file:2", is_general=True),
    }
    known = [ControllerSettings("listed", KIND, entries)]
    interfaces = {KIND: lambda *_: interface}
    arm = ControllerManagerNode(Side.RIGHT, "/r", line, known, executor, interfaces, clock, TimerThread(clock, print))
    client = Client(executor)
    descriptions = client.node.create_publisher(String, "/r/robot_description", LATCHED)
    yield SimpleNamespace(
        arm=arm, line=line, interface=interface, client=client, manager=Manager(client), descriptions=descriptions
    )
    client.close()
    arm.destroy()


@pytest.fixture
def manager(rig: SimpleNamespace) -> Manager:
    """With its description."""
    rig.descriptions.publish(String(data=robot_description()))
    rig.client.sentences.clear()
    manager: Manager = rig.manager
    return manager


@pytest.fixture
def watcher(rig: SimpleNamespace, manager: Manager) -> Iterator[Watcher]:
    """A controller ``watcher``, inactive."""
    assert manager.spawn("watcher", KIND, inactive=True)
    yield rig.line.made[-1]
    assert manager.call("unload_controller", name="watcher").ok


def services(rig: SimpleNamespace) -> set[str]:
    kinds = dict(rig.client.node.get_service_names_and_types())
    return {name for name, (kind, *_) in kinds.items() if kind.startswith("controller_manager_msgs/")}


def test_manager_serves_nothing_but_parameters_until_it_has_a_description(rig: SimpleNamespace) -> None:
    rate = get_parameter(rig.client, "/r/controller_manager", "update_rate").integer_value
    assert rate == 248
    rig.client.until(rig.client.hears("Waiting for a message on robot_description."))
    assert not services(rig)


@pytest.mark.parametrize("reminders", [0, 1])
def test_manager_whose_description_comes_in_time_does_not_say_that_it_waits(reminders: int) -> None:
    """The timer is overdue when the node is first spun, before the description that has long been there."""
    node = Mock()
    wait = DescriptionWait(node, Side.RIGHT, lambda: None)
    (_, remind), (_, _, take, _) = node.create_timer.call_args.args, node.create_subscription.call_args.args
    for _ in range(reminders):
        remind()
    take(String(data=robot_description()))
    assert wait.is_over
    assert node.get_logger.return_value.mock_calls == []
    node.create_timer.return_value.cancel.assert_called_once()


@pytest.mark.parametrize(
    ("urdf", "sentence"),
    [
        ("no XML", "The robot description cannot be used: it is not XML"),
        ("<robot/>", "The robot description cannot be used: it has no joint yumi_joint_1_r, yumi_joint_2_r"),
    ],
)
def test_manager_keeps_waiting_after_a_description_without_its_arm(
    rig: SimpleNamespace, urdf: str, sentence: str
) -> None:
    rig.descriptions.publish(String(data=urdf))
    rig.client.until(rig.client.hears(sentence))
    assert not services(rig)


def test_manager_ignores_another_description_once_it_serves(rig: SimpleNamespace, manager: Manager) -> None:
    assert manager.controllers() == {}
    assert len(services(rig)) == 11
    rig.descriptions.publish(String(data="<robot/>"))
    rig.client.until(rig.client.hears("Another robot description has come; it is ignored"))


def test_listed_controller_is_loaded_with_the_parameters_of_the_list(manager: Manager) -> None:
    assert manager.call("load_controller", name="listed").ok  # its type is known, too
    assert get_parameter(manager.client, "/r/listed", "gain").double_value == 1.0
    assert manager.call("unload_controller", name="listed").ok


def test_parameters_of_every_type_reach_the_controller(watcher: Watcher, manager: Manager) -> None:
    values = {"gain": number(1.5), "count": integer(5), "is_loud": boolean(True), "mode": text("fast")}
    for name, value in (values | {"weights": numbers([4.0])}).items():
        assert set_parameter(manager.client, "/r/watcher", name, value).successful
    wanted = {"gain": 1.5, "count": 5, "is_loud": True, "mode": "fast", "weights": (4.0,)}
    assert {name: watcher.values[name] for name in wanted} == wanted


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("gain", number(2.5), "Parameter gain out of range Min: 0.0, Max: 2.0, value: 2.5"),  # rclpy's own words
        ("gain", integer(1), "Wrong parameter type"),
        ("mode", text("late"), no_value("value_not_a_choice", parameter="mode", value="'late'", choices=SPEEDS)),
        ("weights", numbers([1.0, 10.0]), no_value("value_out_of_range_with_unit", value="(1.0, 10.0)", **WEIGHTS)),
        ("weights", numbers([float("nan")]), no_value("value_out_of_range_with_unit", value="(nan,)", **WEIGHTS)),
    ],
)
def test_refused_parameter_changes_nothing_and_says_why(
    watcher: Watcher, manager: Manager, name: str, value: Any, said: Message | str
) -> None:
    before = get_parameter(manager.client, "/r/watcher", name), dict(watcher.values)
    refused = set_parameter(manager.client, "/r/watcher", name, value)
    assert not refused.successful
    assert refused.reason.startswith(str(said))
    assert (get_parameter(manager.client, "/r/watcher", name), dict(watcher.values)) == before


@pytest.mark.parametrize(
    ("name", "type_", "description", "constraints"),
    [
        ("gain", ParameterType.PARAMETER_DOUBLE, "Stiffness. [1/s]", "in 1/s"),
        ("count", ParameterType.PARAMETER_INTEGER, "How many.", ""),
        ("mode", ParameterType.PARAMETER_STRING, "How.", "one of slow, fast"),
        ("weights", ParameterType.PARAMETER_DOUBLE_ARRAY, "How heavy. [kg]", "each from 0 to 9; in kg"),
        ("joints", ParameterType.PARAMETER_STRING_ARRAY, "Which joints.", "only while the controller is unconfigured"),
    ],
)
def test_parameter_reports_type_unit_and_rule(
    watcher: Watcher, manager: Manager, name: str, type_: int, description: str, constraints: str
) -> None:
    request = DescribeParameters.Request(names=[name])
    (told,) = manager.client.call(DescribeParameters, "/r/watcher/describe_parameters", request).descriptors
    assert (told.type, told.description, told.additional_constraints) == (type_, description, constraints)


@pytest.mark.parametrize("node", ["controller_manager", "watcher"])
def test_rate_of_the_manager_and_its_controllers_is_fixed(watcher: Watcher, manager: Manager, node: str) -> None:
    assert get_parameter(manager.client, f"/r/{node}", "update_rate").integer_value == 248
    refused = set_parameter(manager.client, f"/r/{node}", "update_rate", integer(100))
    assert refused.reason == "Trying to set a read-only parameter: update_rate."


def test_whole_numbers_tell_their_range(watcher: Watcher, manager: Manager) -> None:
    request = DescribeParameters.Request(names=["count"])
    (told,) = manager.client.call(DescribeParameters, "/r/watcher/describe_parameters", request).descriptors
    (bounds,) = told.integer_range
    assert (bounds.from_value, bounds.to_value) == (1, 5)


def test_settled_parameter_is_refused_until_the_controller_is_cleaned_up(watcher: Watcher, manager: Manager) -> None:
    refused = set_parameter(manager.client, "/r/watcher", "joints", texts(["one"]))
    said = message("controller_parameter_settled", parameter="joints", controller="watcher", state="inactive")
    assert refused.reason == str(said)
    assert manager.call("cleanup_controller", name="watcher").ok
    assert set_parameter(manager.client, "/r/watcher", "joints", texts(["one"])).successful


def test_notice_of_a_controller_reaches_what_it_offers(rig: SimpleNamespace, watcher: Watcher) -> None:
    rig.arm.on_event(ControllerReport(Side.RIGHT, "watcher", "arrived"))
    rig.arm.on_event(ControllerReport(Side.RIGHT, "gone", "lost"))
    assert rig.interface.notices[-1] == "arrived"


def test_reports_of_a_stream_are_logged_whatever_their_severity(rig: SimpleNamespace, manager: Manager) -> None:
    for said, is_warning in (("leaves its range", True), ("follows it", False), ("leaves it again", True)):
        report = StreamReport(message("text", text=said), is_warning)
        rig.arm.on_event(ControllerReport(Side.RIGHT, "watcher", report))
        manager.client.until(manager.client.hears(said))


def test_failure_of_a_controller_is_logged_and_an_active_one_is_not_activated_again(
    rig: SimpleNamespace, watcher: Watcher, manager: Manager
) -> None:
    assert manager.switch(["watcher"], []).ok
    failure = message("text", text="Controller 'watcher' failed.")
    rig.arm.on_event(ControllerFailed(Side.RIGHT, failure))
    manager.client.until(manager.client.hears(str(message("controller_failed", arm="right", failure=failure))))
    assert not manager.switch(["watcher"], []).ok
    assert manager.switch([], ["watcher"]).ok


def test_begin_and_end_of_egm_are_logged_when_they_happen_and_a_fault_once_its_cause_is_known(
    rig: SimpleNamespace, manager: Manager
) -> None:
    cause = Cause((message("event_50204", number=50204, title="Motion supervision"),))
    waiting: list[Callable[[Cause], None]] = []
    lost = SessionLost(Side.RIGHT, 0.09, ("joint_position_controller",))
    ordinary = [
        SessionStarted(Side.RIGHT, 3),
        RobotFollows(Side.RIGHT),
        RobotStoppedFollowing(Side.RIGHT, ()),
        SessionLost(Side.RIGHT, 0.09, ()),
        SessionResumed(Side.RIGHT, 3),
        ProblemOver(Side.RIGHT, ArmProblem.REFERENCES_IGNORED),
    ]
    logged: list[Log] = []
    subscription = manager.client.node.create_subscription(Log, "/rosout", logged.append, 100)
    manager.client.until(lambda: subscription.get_publisher_count() > 0)
    for event in ordinary:
        rig.arm.on_event(event, waiting.append)
    rig.arm.on_event(lost, waiting.append)
    manager.client.until(lambda: str(ordinary[-1]) in [line.msg for line in logged])
    assert [line.msg for line in logged if line.level == logging.INFO] == [str(event) for event in ordinary]
    assert str(lost) not in "".join(line.msg for line in logged)
    (explain,) = waiting
    explain(cause)
    manager.client.until(
        lambda: str(explained(lost, cause)) in [line.msg for line in logged if line.level == logging.ERROR]
    )
    manager.client.node.destroy_subscription(subscription)


@pytest.mark.parametrize(("strictness", "is_ok"), [("strict", False), ("best_effort", True)])
def test_default_strictness_is_a_parameter_of_the_manager(manager: Manager, strictness: str, is_ok: bool) -> None:
    assert manager.set_parameter("defaults.switch_controller.strictness", text(strictness)).successful
    assert manager.spawn("watcher", KIND, inactive=True)
    assert manager.switch(["watcher", "nobody"], [], strictness=0).ok is is_ok
    manager.switch([], ["watcher"], strictness=1)
    assert manager.call("unload_controller", name="watcher").ok


def test_unknown_default_strictness_is_refused(manager: Manager) -> None:
    refused = manager.set_parameter("defaults.switch_controller.strictness", text("lenient"))
    assert refused.reason == "defaults.switch_controller.strictness is best_effort or strict."


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        (
            "anything",
            text("x"),
            "Parameter 'anything' does not exist; those of a controller are <controller>.type, <",
        ),
        ("", text("x"), "Parameter '' does not exist; those of a controller are"),
        (".type", text("x"), "Parameter '.type' does not exist; those of a controller are"),
        ("two words.type", text("x"), "Parameter 'two words.type' does not exist; those of a controller are"),
        ("spare.kind", text("x"), "Parameter 'spare.kind' does not exist; those of a controller are"),
        ("x" * 100_000, text("x"), f"Parameter '{'x' * 79}… does not exist; those of a controller are"),
        ("x" * 101 + ".type", text("x"), f"Parameter '{'x' * 79}… does not exist; those of a controller are"),
        ("spare.type", text("x" * 10_001), "Parameter spare.type has 10001 characters; allowed are 10000."),
        ("spare.params_file", texts(["x" * 5001] * 2), "spare.params_file has 10002 characters; allowed are 10000."),
        ("spare.type", integer(3), "Parameter spare.type is 3; it must be a text or a list of texts."),
    ],
)
def test_parameter_that_no_controller_has_is_refused_and_not_kept(
    manager: Manager, name: str, value: ParameterValue, reason: str
) -> None:
    result = manager.set_parameter(name, value)
    assert not result.successful
    assert reason in result.reason
    assert len(result.reason) < 400
    assert get_parameter(manager.client, manager.name, name).type == ParameterType.PARAMETER_NOT_SET


@pytest.mark.parametrize("word", ["type", "params_file", "node_options_args", "fallback_controllers"])
def test_parameters_that_the_spawner_sets_before_loading_are_taken(manager: Manager, word: str) -> None:
    for value in (texts(["a", "b"]), text("a"), texts([]), ParameterValue()):
        assert manager.set_parameter(f"spare_2.{word}", value).successful
    assert get_parameter(manager.client, manager.name, f"spare_2.{word}").type == ParameterType.PARAMETER_NOT_SET


def test_parameters_of_more_controllers_than_there_can_be_are_refused(
    manager: Manager, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(nodes, "_MOST_OF_CONTROLLERS", 20)  # some are set already
    names = [f"spare_{number}.type" for number in range(25)]
    results = [manager.set_parameter(name, text("x")) for name in names]
    taken = sum(each.successful for each in results)
    assert 0 < taken < 20
    assert not any(each.successful for each in results[taken:])
    assert results[-1].reason.startswith(
        "Parameter spare_24.type refused: 20 parameters of controllers are set; delete"
    )
    assert manager.set_parameter(names[0], text("y")).successful
    for name in names[:taken]:
        assert manager.set_parameter(name, ParameterValue()).successful
    assert manager.set_parameter(names[-1], text("x")).successful
    assert manager.set_parameter(names[-1], ParameterValue()).successful


@pytest.mark.parametrize(("number_", "name"), [(3, "AUTO"), (4, "FORCE_AUTO")])
def test_automatic_strictness_is_best_effort_and_says_so(manager: Manager, number_: int, name: str) -> None:
    assert manager.spawn("watcher", KIND, inactive=True)
    assert manager.switch(["watcher", "nobody"], [], strictness=number_).ok
    manager.client.until(manager.client.hears(f"Strictness {name} is treated as BEST_EFFORT"))
    assert manager.unspawn("watcher")


def test_switch_that_is_not_answered_in_time_fails_in_upstreams_words(
    rig: SimpleNamespace, watcher: Watcher, manager: Manager
) -> None:
    rig.line.may_answer.clear()
    Timer(1.0, rig.line.may_answer.set).start()  # what comes after the answer asks the line, too
    answer = manager.switch([], [], timeout=0.3)
    assert (answer.ok, answer.message) == (False, str(message("switch_timed_out", limit=0.3)))


@pytest.mark.words
def test_switch_that_took_too_long_is_worded_as_upstream_does() -> None:
    assert str(message("switch_timed_out", limit=0.3)) == "Switch controller timed out after 0.3 seconds."


def test_manager_without_the_control_process_lists_nothing_refuses_all_and_is_finalized(
    rig: SimpleNamespace, manager: Manager
) -> None:
    rig.line.is_gone = True
    sentence = "The control process has ended; restart the driver."
    assert manager.controllers() == {}
    manager.client.until(manager.client.hears(f"list_controllers: {sentence}"))
    assert manager.switch(["watcher"], []).message == sentence
    assert manager.set_hardware("ROB_R", 3, "active").state.label == "finalized"
    rig.line.is_gone = False


def test_event_of_all_reaches_every_controller_although_the_first_one_fails(
    ros: None, caplog: pytest.LogCaptureFixture
) -> None:
    interfaces = {name: Mock() for name in ("first", "second")}
    interfaces["first"].on_event.side_effect = ValueError("a fault of ours")
    control = Mock()
    control.call.return_value = ()
    nodes = ControllerNodes(Side.RIGHT, "/apart", control, Mock(), {KIND: lambda node, side, name: interfaces[name]})
    for name in interfaces:
        nodes.add(ControllerInfo(name, KIND, State.ACTIVE, (), ()))
    ended = ControlProcessEnded(Side.RIGHT, 1)
    nodes.on_event_of_all(ended)
    nodes.destroy()
    interfaces["second"].on_event.assert_called_once_with(ended)
    assert caplog.messages == ["Handling ControlProcessEnded of first failed with ValueError: a fault of ours"]
