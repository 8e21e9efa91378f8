"""The message packages that set-up builds: their types are Jazzy's, and their actions work over DDS."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytestmark = pytest.mark.ros
rclpy = pytest.importorskip("rclpy")

DOMAIN = 61
BUILT_HERE = Path(sys.prefix) / "share" / "yumi_message_packages"
SHARE = Path(sys.prefix) / "share"
SECONDS = 10.0

# As an installed ROS 2 Jazzy has them; a type whose hash differs does not talk to its namesake elsewhere.
JAZZY_HASHES = {
    "control_msgs/msg/JointTolerance": "c254f9cece0f3b733017b6990fd46d1326e25242d6b8844398c97d9a88e7d648",
    "control_msgs/msg/JointComponentTolerance": "739ea7566931944d33830fa10f1bf5e7a7fbdc3172bce7a7eaac642bd6e3ffa4",
    "control_msgs/action/FollowJointTrajectory": "738ebcb7a2d7cfa42f9f1001cc99ce3a4383d1cfe508015d9be8485e4b1c66f6",
    "control_msgs/srv/QueryTrajectoryState": "4a0935dffef18bc5b9e101c9d03d84e681ecd4cebd724b8f11fde008751a325a",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "controller_manager_msgs/msg/ControllerState": "9a8780ab9814b6032978a07c6c7033cf1a7894ac8d948a6fb72afea07b04cc83",
    "controller_manager_msgs/msg/HardwareInterface": "b4c556991db81ca56a49338b5e8f0675a6707faee54fba161d2bbd4d963d418a",
    "controller_manager_msgs/msg/HardwareComponentState": (
        "8723f76b60e3ea54920065e3e777d93c68b76fc12839ad6a6ca4e0a6439b384c"
    ),
    "controller_manager_msgs/msg/ControllerManagerActivity": (
        "35b7de5d611b6780e89732de325f2f765eacdb8a7adfe5821a27af4a03a7c244"
    ),
    "controller_manager_msgs/srv/ListControllers": "4f8e36bb1fa5afdeba45c2d56ae6a2097b1493a253f961dd6290c085033bd189",
    "controller_manager_msgs/srv/SetHardwareComponentState": (
        "940b15846ed3e1fb561ab45edf77a992b811fd59c574f45d5205a84a0deb2f65"
    ),
}

# Types that have grown a field within Jazzy: an older installation has the hash that comes without it.
GROWN = {
    ("controller_manager_msgs/srv/SwitchController", "message"): (
        "86024c2b173a21e59e6dd474331f1f6380449f806b7466bc8289c79a7baffbe7"
    ),
    ("control_msgs/msg/JointTrajectoryControllerState", "speed_scaling_factor"): (
        "6cb9ac0858fc11b54bd6c0a46f032ea243c16856182276d8eb0875f6ce6a8335"
    ),
}


@pytest.fixture
def loopback_only(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")


@pytest.fixture
def node(loopback_only: None) -> Iterator[rclpy.node.Node]:
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=DOMAIN)
    node = rclpy.create_node("interface_packages", namespace=f"test_{os.getpid()}", context=context)
    yield node
    node.destroy_node()
    rclpy.shutdown(context=context)


@pytest.fixture
def executor(node: rclpy.node.Node) -> Iterator[rclpy.executors.Executor]:
    executor = rclpy.executors.SingleThreadedExecutor(context=node.context)
    executor.add_node(node)
    yield executor
    executor.shutdown()


@pytest.fixture
def gripper(node: rclpy.node.Node, executor: rclpy.executors.Executor) -> Iterator[SimpleNamespace]:
    """A GripperCommand server whose fingers are at once where the goal wants them, and a client of it."""
    from control_msgs.action import GripperCommand
    from rclpy.action import ActionClient, ActionServer

    def execute(goal: rclpy.action.server.ServerGoalHandle) -> GripperCommand.Result:
        state = {"position": goal.request.command.position, "effort": 4.0, "reached_goal": True}
        goal.publish_feedback(GripperCommand.Feedback(**state))
        goal.succeed()
        return GripperCommand.Result(**state)

    server = ActionServer(node, GripperCommand, "gripper_cmd", execute)
    client = ActionClient(node, GripperCommand, "gripper_cmd")
    while not client.server_is_ready():
        executor.spin_once(timeout_sec=SECONDS)
    yield SimpleNamespace(client=client, Goal=GripperCommand.Goal)
    client.destroy()
    server.destroy()


def _described(name: str) -> dict[str, Any]:
    package, rest = name.split("/", 1)
    return dict(json.loads((SHARE / package / f"{rest}.json").read_text()))


def _hash_without(description: dict[str, Any], field: str) -> str:
    """The hash of REP 2016 of a type from whose parts `field` is taken away."""
    for part in (description["type_description"], *description["referenced_type_descriptions"]):
        part["fields"] = [
            {key: value for key, value in entry.items() if key != "default_value"}
            for entry in part["fields"]
            if entry["name"] != field
        ]
    return hashlib.sha256(json.dumps(description).encode()).hexdigest()


built_here = pytest.mark.skipif(not BUILT_HERE.exists(), reason="a sourced ROS 2 brings its own")


@built_here
@pytest.mark.parametrize("name", JAZZY_HASHES)
def test_interface_has_the_type_hash_of_jazzy(name: str) -> None:
    hashes = {entry["type_name"]: entry["hash_string"] for entry in _described(name)["type_hashes"]}
    assert hashes[name] == f"RIHS01_{JAZZY_HASHES[name]}"


@built_here
@pytest.mark.parametrize(("name", "field"), GROWN)
def test_interface_that_has_grown_has_the_type_hash_of_older_jazzy_without_its_last_field(
    name: str, field: str
) -> None:
    assert _hash_without(_described(name)["type_description_msg"], field) == GROWN[name, field]


@pytest.mark.parametrize(
    ("action", "part", "fields"),
    [
        ("GripperCommand", "Goal", ["command"]),
        ("GripperCommand", "Result", ["position", "effort", "stalled", "reached_goal"]),
        ("GripperCommand", "Feedback", ["position", "effort", "stalled", "reached_goal"]),
        ("ParallelGripperCommand", "Goal", ["command"]),
        ("ParallelGripperCommand", "Result", ["state", "stalled", "reached_goal"]),
        ("FollowJointTrajectory", "Result", ["error_code", "error_string"]),
    ],
)
def test_action_has_the_fields_of_jazzy(action: str, part: str, fields: list[str]) -> None:
    import control_msgs.action

    assert list(getattr(getattr(control_msgs.action, action), part).get_fields_and_field_types()) == fields


def test_trajectory_errors_have_the_numbers_of_jazzy() -> None:
    from control_msgs.action import FollowJointTrajectory

    result = FollowJointTrajectory.Result
    assert (result.SUCCESSFUL, result.INVALID_GOAL, result.INVALID_JOINTS) == (0, -1, -2)
    assert (result.OLD_HEADER_TIMESTAMP, result.PATH_TOLERANCE_VIOLATED, result.GOAL_TOLERANCE_VIOLATED) == (-3, -4, -5)


def test_gripper_action_carries_goal_feedback_and_result(
    gripper: SimpleNamespace, executor: rclpy.executors.Executor
) -> None:
    goal, felt = gripper.Goal(), rclpy.task.Future()
    goal.command.position = 0.02
    accepted = gripper.client.send_goal_async(goal, feedback_callback=lambda message: felt.set_result(message.feedback))
    executor.spin_until_future_complete(accepted, timeout_sec=SECONDS)
    finished = accepted.result().get_result_async()
    executor.spin_until_future_complete(finished, timeout_sec=SECONDS)
    executor.spin_until_future_complete(felt, timeout_sec=SECONDS)

    result = finished.result().result
    assert (result.position, result.effort, result.stalled, result.reached_goal) == (0.02, 4.0, False, True)
    assert felt.result().position == 0.02
