"""What the statuses of a controller manager say for given controllers and times."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import yaml
from diagnostic_msgs.msg import DiagnosticStatus

from abb_protocols.catalogue import clause, message
from abb_protocols.robot.joints import Side
from yumi.control.controller import State
from yumi.control.controller_info import ControllerInfo, HardwareInfo, Statistics
from yumi.control.counters import LimiterCounters
from yumi.control.shared_state import ARM_PROBLEM_CODES, ArmProblem, Snapshot
from yumi.driver.robot_state import RobotState
from yumi.ros import messages
from yumi.ros.gripper_actions import gripper_status

pytestmark = pytest.mark.ros
AGGREGATOR = Path(__file__).parents[2] / "config" / "diagnostics_aggregator.yaml"
diagnostics = pytest.importorskip("yumi.ros.manager_diagnostics")

QUICK = Statistics(100, 20e-6, 20e-6, 10e-6, 30e-6, 2e-6)
PERIOD = Statistics(100, 0.004, 0.004, 0.002, 0.008, 1e-6)
OK, WARN, ERROR = diagnostics.DIAGNOSTIC_OK, diagnostics.DIAGNOSTIC_WARN, diagnostics.DIAGNOSTIC_ERROR


def threshold(subject: str, quantity: str) -> tuple[float, float]:
    """Like the defaults, narrower where they are wide: [Hz] or [µs]."""
    if "periodicity" in quantity:
        return (124.0, 248.0) if "deviation" in quantity else (5.0, 10.0)
    return (1000.0, 2000.0) if "mean" in quantity else (100.0, 200.0)


def controller(state: State, times: Statistics = QUICK) -> ControllerInfo:
    return ControllerInfo("one", "tests/One", state, (), (), (), times)


def hardware(state: State = State.ACTIVE, times: Statistics = QUICK, period: Statistics = PERIOD) -> HardwareInfo:
    return HardwareInfo("ROB_R", state, (), (), times, times, period)


def test_controllers_status_warns_when_none_is_loaded() -> None:
    assert diagnostics.controllers_status([], threshold) == (WARN, "No controllers are currently loaded", [])


def test_controllers_status_reports_execution_times_of_active_controllers() -> None:
    level, sentence, pairs = diagnostics.controllers_status([controller(State.ACTIVE)], threshold)
    assert (level, sentence) == (OK, "All controllers are active")
    assert {pair.key: pair.value for pair in pairs} == {
        "one.state": "active",
        "one.execution_time": "Avg: 20.0 [10.0 - 30.0] us, StdDev: 2.0",
    }


def test_controllers_status_reports_only_the_state_of_an_inactive_controller() -> None:
    level, sentence, pairs = diagnostics.controllers_status([controller(State.INACTIVE)], threshold)
    assert (level, sentence, [pair.key for pair in pairs]) == (OK, "Not all controllers are active", ["one.state"])


@pytest.mark.parametrize(
    ("mean_us", "deviation_us", "level"),
    [(999.0, 99.0, OK), (1001.0, 0.0, WARN), (2001.0, 0.0, ERROR), (0.0, 101.0, WARN), (0.0, 201.0, ERROR)],
)
def test_controllers_status_shows_the_worst_of_mean_and_deviation(
    mean_us: float, deviation_us: float, level: bytes
) -> None:
    times = Statistics(9, 0.0, mean_us * 1e-6, 0.0, 0.0, deviation_us * 1e-6)
    assert diagnostics.controllers_status([controller(State.ACTIVE, times)], threshold)[0] == level


def test_hardware_status_reports_times_and_rates_of_reading_and_writing() -> None:
    level, sentence, pairs = diagnostics.hardware_status(hardware(), threshold)
    assert (level, sentence) == (OK, "All hardware components are active")
    values = {pair.key: pair.value for pair in pairs}
    assert values["ROB_R.read_cycle.execution_time"] == "Avg: 20.0 [10.0 - 30.0] us, StdDev: 2.0"
    assert values["ROB_R.write_cycle.periodicity"] == "Avg: 250.0 [125.0 - 500.0] Hz, StdDev: 0.1"


@pytest.mark.parametrize("state", [State.INACTIVE, State.UNCONFIGURED])
def test_hardware_status_is_an_error_unless_the_component_is_active(state: State) -> None:
    level, sentence, pairs = diagnostics.hardware_status(hardware(state), threshold)
    assert (level, sentence) == (ERROR, "No hardware components are active")
    assert [(pair.key, pair.value) for pair in pairs] == [("ROB_R.state", state.value)]


def test_manager_status_reports_the_rate_before_the_first_datagram() -> None:
    level, sentence, pairs = diagnostics.manager_status(hardware(period=Statistics()), threshold)
    assert (level, sentence) == (OK, "Controller Manager is running")
    assert [(pair.key, pair.value) for pair in pairs] == [("update_rate", "248")]


@pytest.mark.parametrize(
    ("mean", "deviation", "level", "why"),
    [
        (1 / 247.0, 0.0, OK, ""),
        (1 / 242.0, 0.0, WARN, "; the rate is 242.0 Hz instead of 248 Hz (limit 5 Hz)"),
        (1 / 230.0, 0.0, ERROR, "; the rate is 230.0 Hz instead of 248 Hz (limit 10 Hz)"),
        (1 / 248.0, 1.5e-3, OK, ""),
        (1 / 248.0, 3e-3, WARN, "; the rate varies by 184.5 Hz (limit 124 Hz)"),
    ],
)
def test_manager_status_judges_the_rate_and_says_why(mean: float, deviation: float, level: bytes, why: str) -> None:
    period = Statistics(9, mean, mean, mean, mean, deviation)
    judged = diagnostics.manager_status(hardware(period=period), threshold)
    assert judged[:2] == (level, f"Controller Manager is running{why}")


def test_status_gives_the_reason_of_each_level_above_ok() -> None:
    slow = Statistics(9, 0.0, 1500e-6, 0.0, 0.0, 250e-6)
    level, sentence, _ = diagnostics.hardware_status(hardware(times=slow), threshold)
    assert level == ERROR
    assert "; a read takes 1500 us (limit 1000 us); the time of a read varies by 250 us (limit 200 us)" in sentence


@pytest.mark.parametrize(
    ("snapshot", "is_desired", "level", "sentence"),
    [
        (Snapshot(), False, DiagnosticStatus.OK, "off, no datagrams from the robot; start_egm starts EGM"),
        (Snapshot(), True, DiagnosticStatus.WARN, "no datagrams from the robot though EGM was started; call recover"),
        (Snapshot(is_streaming=True, is_running=True), True, DiagnosticStatus.OK, "running"),
    ],
)
def test_egm_that_nobody_asked_for_is_ok(snapshot: Snapshot, is_desired: bool, level: bytes, sentence: str) -> None:
    status = messages.egm_status(Side.RIGHT, snapshot, is_desired=is_desired)
    assert (status.level, status.message) == (level, sentence)


@pytest.mark.parametrize("problem", [ArmProblem.REFERENCES_IGNORED, ArmProblem.IMPLAUSIBLE])
@pytest.mark.parametrize("is_running", [True, False])
def test_egm_whose_arm_holds_for_a_problem_is_an_error_with_its_cause(problem: ArmProblem, is_running: bool) -> None:
    snapshot = Snapshot(
        is_streaming=True, is_running=is_running, problem=problem, limiter=LimiterCounters(implausible=7)
    )
    status = messages.egm_status(Side.RIGHT, snapshot, is_desired=True)
    assert (status.level, status.message) == (
        DiagnosticStatus.ERROR,
        str(message(ARM_PROBLEM_CODES[problem], arm="right")),
    )
    values = {pair.key: pair.value for pair in status.values}
    assert (values["problem"], values["implausible"]) == (problem.name.lower(), "7")


def test_egm_of_an_arm_that_is_kept_apart_names_the_pair() -> None:
    snapshot = Snapshot(limited_part="right gripper", limited_other="post", limited_distance=0.0114)
    values = {pair.key: pair.value for pair in messages.egm_status(Side.RIGHT, snapshot).values}
    said = message("parts_near", part="right gripper", other="post", distance=0.0114)
    assert values["limited_by"] == clause(said)
    values = {pair.key: pair.value for pair in messages.egm_status(Side.RIGHT, Snapshot()).values}
    assert values["limited_by"] == ""


def test_every_status_belongs_to_one_analyzer_of_the_aggregator() -> None:
    analyzers = yaml.safe_load(AGGREGATOR.read_text())["analyzers"]["ros__parameters"]
    rules = [rule for rule in analyzers.values() if isinstance(rule, dict)]
    tasks = ("Controllers Activity", "Hardware Components Activity", "Controller Manager Activity")
    names = [
        *(f"/cell1/{side.value}/controller_manager: {task}" for side in Side for task in tasks),
        *(messages.egm_status(side, Snapshot()).name for side in Side),
        *(gripper_status(side, None).name for side in Side),
        messages.robot_status(RobotState()).name,
    ]
    for name in names:
        assert sum(is_matched(name, rule) for rule in rules) == 1, name


def is_matched(name: str, rule: dict[str, list[str]]) -> bool:
    """As diagnostic_aggregator's GenericAnalyzer."""
    return (
        name in rule.get("expected", [])
        or any(name.startswith(part) for part in rule.get("startswith", []))
        or any(part in name for part in rule.get("contains", []))
        or any(re.fullmatch(part, name) for part in rule.get("regex", []))
    )
