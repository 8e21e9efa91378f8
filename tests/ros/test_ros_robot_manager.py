"""The robot manager as an rclpy client sees it: services, actions and state; the robot behind it is a fake."""

from __future__ import annotations

from math import nan
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from control_msgs.msg import DynamicInterfaceGroupValues, SpeedScalingFactor
from geometry_msgs.msg import Inertia, Point, Quaternion, Vector3
from geometry_msgs.msg import Pose as PoseMessage
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from robot_manager_bench import Goal, RobotManagerRig
from std_srvs.srv import Trigger
from yumi_interfaces.action import Recover, SetMode
from yumi_interfaces.msg import RobotState
from yumi_interfaces.srv import (
    AllowCollision,
    LoadModule,
    ReadSignal,
    ReadVariable,
    RunModule,
    RunRoutine,
    SetPayload,
    SetSpeedRatio,
    SetSpeedScale,
    SetTool,
    WriteSignal,
    WriteVariable,
)

from abb_protocols.catalogue import message
from abb_protocols.robot.description import Mass
from abb_protocols.robot.joints import Pose, Side
from abb_protocols.rws.operations.event_log import RwsEvent
from abb_protocols.rws.values import ControllerState, EventType
from yumi.driver.robot_state import RobotMode

pytestmark = pytest.mark.ros

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
ROUTINE = {"arm": "left", "routine": "wave"}
MODULE = {"arm": "right", "file_name": "wave.mod", "text": "MODULE wave ENDMODULE"}

PRESSED = message("emergency_stop_pressed")


@pytest.mark.parametrize(
    ("service", "method"),
    [
        ("start_egm", "start_egm"),
        ("stop_egm", "stop_egm"),
        ("robot_is_ready", "check_ready"),
        ("get_state", "describe"),
        ("motors_on", "motors_on"),
        ("motors_off", "motors_off"),
        ("start_rapid", "start_rapid"),
        ("stop_rapid", "stop_rapid"),
        ("pp_to_main", "pp_to_main"),
    ],
)
def test_trigger_calls_its_method_and_passes_on_what_it_says(rig: RobotManagerRig, service: str, method: str) -> None:
    answer = rig.call(Trigger, service)
    assert (answer.success, answer.message) == (True, f"{method} done")
    assert rig.manager.calls == [(method,)]


@pytest.mark.parametrize(
    ("kind", "service", "fields"),
    [
        (WriteSignal, "write_signal", {"name": "lamp", "value": "1"}),
        (WriteVariable, "write_variable", {"task": "T_ROB_L", "module": "m", "name": "n", "value": "1"}),
        (AllowCollision, "allow_collision", {"part": "right gripper", "other": "left gripper", "seconds": 5.0}),
        (SetSpeedRatio, "set_speed_ratio", {"percent": 50}),
    ],
)
def test_request_that_moves_nothing_is_answered_while_a_routine_runs(
    rig: RobotManagerRig, kind: Any, service: str, fields: dict[str, Any]
) -> None:
    rig.manager.may_go_on.clear()
    client = rig.client.node.create_client(RunRoutine, "/yumi_robot_manager/run_routine")
    rig.client.until(client.service_is_ready)
    routine = client.call_async(RunRoutine.Request(**ROUTINE))
    rig.client.until(rig.manager.runs_routine.is_set)
    try:
        assert rig.call(kind, service, **fields).success
        assert not routine.done()
    finally:
        rig.manager.may_go_on.set()
        rig.client.until(routine.done)
        rig.client.node.destroy_client(client)


@pytest.mark.parametrize(
    ("kind", "service", "fields", "call"),
    [
        (SetSpeedRatio, "set_speed_ratio", {"percent": 50}, (50,)),
        (RunRoutine, "run_routine", ROUTINE, (Side.LEFT, "wave", False)),
        (RunRoutine, "run_routine", {**ROUTINE, "unchecked": True}, (Side.LEFT, "wave", True)),
        (LoadModule, "load_module", MODULE, (Side.RIGHT, "wave.mod", MODULE["text"])),
        (
            RunModule,
            "run_module",
            {**MODULE, "routine": "wave", "unchecked": True},
            (Side.RIGHT, "wave.mod", MODULE["text"], "wave", True),
        ),
        (WriteSignal, "write_signal", {"name": "lamp", "value": "1"}, ("lamp", "1")),
        (
            WriteVariable,
            "write_variable",
            {"task": "T_ROB_L", "module": "m", "name": "n", "value": "[1]"},
            ("T_ROB_L", "m", "n", "[1]"),
        ),
        (
            SetTool,
            "set_tool",
            {
                "arm": "right",
                "tcp": PoseMessage(position=Point(z=0.1), orientation=Quaternion(w=1.0)),
                "load": Inertia(m=0.2, com=Vector3(z=0.05), ixx=1e-4, iyz=2e-5, izz=3e-4),
            },
            (
                Side.RIGHT,
                Pose((0.0, 0.0, 0.1), (1.0, 0.0, 0.0, 0.0)),
                Mass(0.2, (0.0, 0.0, 0.05), (1e-4, 0.0, 0.0, 0.0, 2e-5, 3e-4)),
            ),
        ),
        (
            SetPayload,
            "set_payload",
            {"arm": "left", "payload": Inertia(m=0.1, com=Vector3(x=0.01, z=0.12))},
            (Side.LEFT, Mass(0.1, (0.01, 0.0, 0.12), (0.0,) * 6)),
        ),
    ],
)
def test_order_reaches_its_method_with_its_arguments(
    rig: RobotManagerRig, kind: Any, service: str, fields: dict[str, Any], call: tuple[Any, ...]
) -> None:
    answer = rig.call(kind, service, **fields)
    assert answer.success, answer.message
    assert rig.manager.calls == [(service, *call)]


def parameter_of(rig: RobotManagerRig) -> float:
    request = GetParameters.Request(names=["speed_scale"])
    return float(rig.client.call(GetParameters, "yumi_robot_manager/get_parameters", request).values[0].double_value)


def test_speed_scale_is_set_by_a_service_and_reported_by_the_parameter(rig: RobotManagerRig) -> None:
    assert parameter_of(rig) == rig.speed.value
    answer = rig.call(SetSpeedScale, "set_speed_scale", speed_scale=0.25)
    assert answer.success
    assert answer.message == str(message("speed_scale_in_force", value=0.25))
    assert (rig.speed.value, parameter_of(rig)) == (0.25, 0.25)


def test_a_collision_is_allowed_and_ended_by_the_same_service(rig: RobotManagerRig) -> None:
    pair = {"part": "right gripper", "other": "left gripper"}
    assert rig.call(AllowCollision, "allow_collision", **pair, seconds=5.0).success
    assert rig.call(AllowCollision, "allow_collision", **pair, seconds=0.0).success
    assert rig.manager.calls == [
        ("allow_collision", "right gripper", "left gripper", 5.0),
        ("end_allowed_collision", "right gripper", "left gripper"),
    ]
    rig.manager.refusals["allow_collision"] = "nothing keeps the arms apart"
    answer = rig.call(AllowCollision, "allow_collision", **pair, seconds=5.0)
    assert (answer.success, answer.message) == (False, "nothing keeps the arms apart")


def test_speed_scale_is_published_to_late_subscribers_too(rig: RobotManagerRig) -> None:
    assert rig.call(SetSpeedScale, "set_speed_scale", speed_scale=0.5).success
    factors: list[float] = []
    rig.client.node.create_subscription(
        SpeedScalingFactor, "/yumi_robot_manager/speed_scale", lambda told: factors.append(told.factor), LATCHED
    )
    rig.client.until(lambda: factors[-1:] == [0.5])
    assert rig.call(SetSpeedScale, "set_speed_scale", speed_scale=0.25).success
    rig.client.until(lambda: factors[-1:] == [0.25])


def test_signals_are_published_as_one_group_while_a_client_listens(rig: RobotManagerRig) -> None:
    states: list[Any] = []
    rig.client.node.create_subscription(
        DynamicInterfaceGroupValues, "/yumi_robot_manager/gpio_states", states.append, 1
    )
    rig.client.until(lambda: bool(states))
    (values,) = states[0].interface_values
    assert list(states[0].interface_groups) == ["controller"]
    assert dict(zip(values.interface_names, values.values, strict=True)) == rig.manager.signals()


@pytest.mark.parametrize("value", [0.0, 1.5, -1.0, nan])
def test_service_refuses_a_speed_scale_out_of_range(rig: RobotManagerRig, value: float) -> None:
    before = rig.speed.value
    answer = rig.call(SetSpeedScale, "set_speed_scale", speed_scale=value)
    assert not answer.success
    assert answer.message == str(message("speed_scale_out_of_range", value=value, lowest=0.01, highest=1.0))
    assert rig.speed.value == parameter_of(rig) == before


def test_speed_scale_is_a_parameter_with_a_range(rig: RobotManagerRig) -> None:
    def set_to(value: float) -> bool:
        parameter = Parameter("speed_scale", value=value).to_parameter_msg()
        request = SetParameters.Request(parameters=[parameter])
        answer = rig.client.call(SetParameters, "yumi_robot_manager/set_parameters", request)
        return bool(answer.results[0].successful)

    assert set_to(0.5)
    assert rig.speed.value == 0.5
    assert not set_to(0.0)
    assert not set_to(nan)
    assert not set_to(1.01)
    assert (rig.speed.value, parameter_of(rig)) == (0.5, 0.5)


@pytest.mark.parametrize(
    ("kind", "service", "fields"),
    [
        (ReadSignal, "read_signal", {"name": "lamp"}),
        (ReadVariable, "read_variable", {"task": "T_ROB_L", "module": "m", "name": "n"}),
    ],
)
def test_reading_answers_the_value(rig: RobotManagerRig, kind: Any, service: str, fields: dict[str, str]) -> None:
    answer = rig.call(kind, service, **fields)
    assert (answer.success, answer.value, answer.message) == (True, f"{service} done", "")
    assert rig.manager.calls == [(service, *fields.values())]


def test_refusal_of_the_robot_is_the_answer_and_in_the_log(rig: RobotManagerRig) -> None:
    rig.manager.refusals["motors_on"] = "The emergency stop is pressed; release it."
    answer = rig.call(Trigger, "motors_on")
    assert (answer.success, answer.message) == (False, "The emergency stop is pressed; release it.")
    rig.client.until(rig.client.hears("motors_on: The emergency stop is pressed; release it."))


def test_unknown_arm_is_refused_and_nothing_is_asked_of_the_robot(rig: RobotManagerRig) -> None:
    answer = rig.call(RunRoutine, "run_routine", arm="middle", routine="wave")
    assert (answer.success, answer.code) == (False, "arm_unknown")
    assert answer.message == str(message("arm_unknown", arm="middle"))
    assert rig.manager.calls == []


@pytest.mark.parametrize("mode", list(RobotMode))
def test_set_mode_reports_its_steps_and_the_state_it_reached(rig: RobotManagerRig, mode: RobotMode) -> None:
    goal = Goal(rig, SetMode, "set_mode", mode=mode.value)
    status, result = goal.end()
    assert (status, result.success, result.message) == (GoalStatus.STATUS_SUCCEEDED, True, "go_to done")
    assert goal.steps == ["motors on", "start EGM"]
    assert rig.manager.calls == [("go_to", mode)]
    assert result.state.operating_mode == "AUTO"


def test_recover_says_what_it_did(rig: RobotManagerRig) -> None:
    goal = Goal(rig, Recover, "recover")
    status, result = goal.end()
    assert (status, result.success, result.message) == (GoalStatus.STATUS_SUCCEEDED, True, "recover done")
    assert goal.steps == ["read the event log"]


def test_action_whose_step_fails_is_aborted_with_the_reason(rig: RobotManagerRig) -> None:
    rig.manager.refusals["recover"] = "The controller is in MANUAL; turn it to AUTO on the FlexPendant."
    status, result = Goal(rig, Recover, "recover").end()
    assert (status, result.success) == (GoalStatus.STATUS_ABORTED, False)
    assert result.message == "The controller is in MANUAL; turn it to AUTO on the FlexPendant."


def test_unknown_mode_is_answered_with_those_there_are(rig: RobotManagerRig) -> None:
    status, result = Goal(rig, SetMode, "set_mode", mode="fly").end()
    assert status == GoalStatus.STATUS_ABORTED
    modes = ("motors_off", "ready", "egm_left", "egm_right", "egm_both")
    assert result.message == str(message("mode_not_known", mode="fly", modes=modes))
    assert rig.manager.calls == []


def test_second_action_is_refused_while_the_first_is_carried_out(rig: RobotManagerRig) -> None:
    rig.manager.may_go_on.clear()
    first = Goal(rig, SetMode, "set_mode", mode="ready")
    rig.client.until(lambda: bool(first.steps))
    status, result = Goal(rig, Recover, "recover").end()
    rig.manager.may_go_on.set()
    assert status == GoalStatus.STATUS_ABORTED
    assert result.message == str(message("another_mode_change"))
    assert first.end()[1].success


def test_motors_go_off_while_another_action_is_carried_out(rig: RobotManagerRig) -> None:
    rig.manager.may_go_on.clear()
    first = Goal(rig, SetMode, "set_mode", mode="ready")
    rig.client.until(lambda: bool(first.steps))
    stop = Goal(rig, SetMode, "set_mode", mode="motors_off")
    rig.client.until(lambda: bool(stop.steps))
    rig.manager.may_go_on.set()
    assert stop.end()[1].success
    assert first.end()[1].success


def test_cancelled_action_ends_before_its_next_step(rig: RobotManagerRig) -> None:
    rig.manager.may_go_on.clear()
    goal = Goal(rig, SetMode, "set_mode", mode="ready")
    rig.client.until(lambda: bool(goal.steps))
    rig.client.until(goal.handle.cancel_goal_async().done)
    rig.manager.may_go_on.set()
    status, result = goal.end()
    assert (status, result.message) == (GoalStatus.STATUS_CANCELED, "Cancelled before: start EGM.")
    assert rig.manager.calls == []


def test_cancelled_recovery_ends_at_once_while_the_controller_does_not_answer(rig: RobotManagerRig) -> None:
    rig.manager.may_go_on.clear()
    goal = Goal(rig, Recover, "recover")
    rig.client.until(lambda: bool(goal.steps))
    rig.client.until(goal.handle.cancel_goal_async().done)
    status, result = goal.end()
    assert (status, result.message) == (GoalStatus.STATUS_CANCELED, "Cancelled while the controller did not answer.")
    assert rig.manager.calls == []


def test_state_is_there_for_late_comers_and_comes_again_when_it_changes(rig: RobotManagerRig) -> None:
    got: list[Any] = []
    topic = rig.client.node.create_subscription(RobotState, "yumi_robot_manager/state", got.append, LATCHED)
    rig.client.until(lambda: bool(got) and got[-1].is_ready)
    event = RwsEvent(7, EventType.ERROR, 10013, "2026-11-21 T 10:00:00", "Emergency stop state", "")
    rig.know(controller_state=ControllerState.EMERGENCY_STOP, reasons=(PRESSED,), last_event=event)
    rig.client.until(lambda: not got[-1].is_ready)
    assert (got[-1].controller_state, got[-1].reason) == ("emergencystop", str(PRESSED))
    assert (got[-1].last_event.number, got[-1].last_event.type) == (10013, "error")
    rig.client.node.destroy_subscription(topic)


@pytest.mark.parametrize(("mode", "may"), [("egm_right", True), ("egm_left", False), ("egm_both", False)])
def test_egm_is_refused_on_an_arm_that_was_deactivated(rig: RobotManagerRig, mode: str, may: bool) -> None:
    rig.inactive.add(Side.LEFT)
    _, result = Goal(rig, SetMode, "set_mode", mode=mode).end()
    assert (result.success, result.message) == ((True, "go_to done") if may else (False, "The left arm is inactive."))


def test_start_egm_is_refused_while_an_arm_is_deactivated_and_what_reads_or_stops_is_not(rig: RobotManagerRig) -> None:
    rig.inactive.add(Side.LEFT)
    refused = rig.call(Trigger, "start_egm")
    assert (refused.success, refused.message) == (False, "The left arm is inactive.")
    assert rig.call(Trigger, "get_state").success
    assert rig.call(Trigger, "stop_egm").success
    assert [name for name, *_ in rig.manager.calls] == ["describe", "stop_egm"]
