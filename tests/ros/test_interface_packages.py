"""The message packages that set-up builds: their types are Jazzy's, and their actions work over DDS."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest

pytestmark = pytest.mark.ros
rclpy = pytest.importorskip("rclpy")

DOMAIN = 61
BUILT_HERE = Path(sys.prefix) / "share" / "control_msgs"
SECONDS = 10.0

# As an installed ROS 2 Jazzy has them; a type whose hash differs does not talk to its namesake elsewhere.
JAZZY_HASHES = {
    "msg/JointTolerance": "RIHS01_c254f9cece0f3b733017b6990fd46d1326e25242d6b8844398c97d9a88e7d648",
    "msg/JointComponentTolerance": "RIHS01_739ea7566931944d33830fa10f1bf5e7a7fbdc3172bce7a7eaac642bd6e3ffa4",
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


@pytest.mark.skipif(not BUILT_HERE.exists(), reason="a sourced ROS 2 brings its own")
@pytest.mark.parametrize("name", JAZZY_HASHES)
def test_message_has_the_type_hash_of_jazzy(name: str) -> None:
    description = json.loads((BUILT_HERE / f"{name}.json").read_text())
    assert description["type_hashes"][0]["hash_string"] == JAZZY_HASHES[name]


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
