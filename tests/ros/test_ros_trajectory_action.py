"""FollowJointTrajectory as a plain client sees it: MoveIt for both arms, rqt on the topic, cancels and refusals.

What else ends a goal, tolerances and a newer goal, is in ``contract/test_trajectory_contract``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTrajectoryControllerState
from control_msgs.srv import QueryTrajectoryState
from controller_manager_bench import BEST_EFFORT, STRICT, Manager
from rclpy.action import ActionClient
from ros_bench import Client, begin_egm
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from abb_protocols.robot.joints import Side, joint_names
from trajectories import dual_arm_message
from yumi.control.motion.robot_response import STANDING

# A machine that stands still for 100 ms ends EGM in the middle of a motion.
pytestmark = [pytest.mark.ros, pytest.mark.real_time, pytest.mark.timeout(120)]

SINGLE = "joint_trajectory_controller"
DUAL = "dual_arm_trajectory_controller"
POSITION = "joint_position_controller"
NAMES = list(joint_names(Side.RIGHT))
Result = FollowJointTrajectory.Result


class Goals:
    """An action client that waits for everything."""

    def __init__(self, client: Client, name: str) -> None:
        self._client = client
        self._action = ActionClient(client.node, FollowJointTrajectory, f"{name}/follow_joint_trajectory")
        self.feedback: list[Any] = []
        client.until(self._action.server_is_ready)

    def send(self, trajectory: JointTrajectory, **fields: Any) -> Any:
        goal = FollowJointTrajectory.Goal(trajectory=trajectory, **fields)
        return self.wait(self._action.send_goal_async(goal, self.feedback.append))

    def result(self, handle: Any) -> Any:
        return self.wait(handle.get_result_async())

    def wait(self, future: Any) -> Any:
        self._client.until(future.done)
        return future.result()

    def close(self) -> None:
        self._action.destroy()


def switch(client: Client, activate: dict[str, str]) -> None:
    for arm in ("r", "l"):
        manager = Manager(client, f"/{arm}/controller_manager")
        manager.switch([], [SINGLE, DUAL, POSITION], BEST_EFFORT)
        if arm in activate:
            assert manager.switch([activate[arm]], [], STRICT).ok


@pytest.fixture
def egm(client: Client) -> Client:
    begin_egm(client)
    return client


@pytest.fixture
def right(egm: Client) -> Iterator[Goals]:
    switch(egm, {"r": SINGLE})
    goals = Goals(egm, f"r/{SINGLE}")
    yield goals
    goals.close()
    stop(egm)


@pytest.fixture
def both(egm: Client) -> Iterator[Goals]:
    switch(egm, {"r": DUAL, "l": DUAL})
    goals = Goals(egm, DUAL)
    yield goals
    goals.close()
    stop(egm)


def stop(client: Client) -> None:
    """Deactivate all; an arm that still moves takes no goal, so wait until both stand."""
    switch(client, {})
    for arm in ("r", "l"):
        newest_state(client, arm, is_standing)


def is_standing(state: JointState) -> bool:
    return bool(max(map(abs, state.velocity)) <= STANDING)


def newest_state(client: Client, arm: str, is_wanted: Callable[[JointState], bool] = bool) -> JointState:
    states: list[JointState] = []
    subscription = client.node.create_subscription(JointState, f"{arm}/joint_states", states.append, 10)
    client.until(lambda: any(map(is_wanted, states)))
    client.node.destroy_subscription(subscription)
    return states[-1]


def position(client: Client) -> list[float]:
    return list(newest_state(client, "r").position)


def point(positions: list[float], seconds: float) -> JointTrajectoryPoint:
    time, still = Duration(sec=int(seconds), nanosec=round(seconds % 1 * 1e9)), [0.0] * len(positions)
    return JointTrajectoryPoint(positions=positions, velocities=still, accelerations=still, time_from_start=time)


def planners_trajectory() -> JointTrajectory:
    message = dual_arm_message()
    points = [{**each, "time_from_start": Duration(**each["time_from_start"])} for each in message["points"]]
    return JointTrajectory(joint_names=message["joint_names"], points=[JointTrajectoryPoint(**each) for each in points])


def swing(client: Client, step: float, seconds: float) -> JointTrajectory:
    """Axis 6 of the right arm away by ``step`` [rad], from wherever it is."""
    here = position(client)
    return JointTrajectory(joint_names=NAMES, points=[point([*here[:6], here[6] + step], seconds)])


def test_goal_for_one_arm_succeeds_with_feedback_whatever_the_order_of_its_joints(right: Goals, egm: Client) -> None:
    trajectory = swing(egm, 0.3, 1.0)
    goal = list(trajectory.points[0].positions)
    trajectory.joint_names = NAMES[::-1]
    trajectory.points[0].positions = goal[::-1]
    handle = right.send(trajectory)
    assert handle.accepted
    answer = right.result(handle)
    assert position(egm) == pytest.approx(goal, abs=0.01)
    assert (answer.status, answer.result.error_code) == (GoalStatus.STATUS_SUCCEEDED, Result.SUCCESSFUL)
    assert answer.result.error_string == "The goal is reached."
    feedback = right.feedback[-1].feedback
    assert list(feedback.joint_names) == NAMES
    assert feedback.error.positions[6] == pytest.approx(
        feedback.desired.positions[6] - feedback.actual.positions[6], abs=1e-9
    )


def test_planners_trajectory_moves_both_arms(both: Goals, egm: Client) -> None:
    skews: list[Any] = []
    egm.node.create_subscription(Float64MultiArray, f"{DUAL}/inter_arm_skew", skews.append, 10)
    trajectory = planners_trajectory()
    there = JointTrajectory(joint_names=trajectory.joint_names, points=[point(trajectory.points[0].positions, 2.0)])
    assert both.result(both.send(there)).status == GoalStatus.STATUS_SUCCEEDED
    both.feedback.clear()
    answer = both.result(both.send(trajectory))
    assert answer.result.error_string == "The goal is reached."
    assert (answer.status, answer.result.error_code) == (GoalStatus.STATUS_SUCCEEDED, Result.SUCCESSFUL)
    assert len(both.feedback[-1].feedback.joint_names) == 14
    assert skews


def test_cancelled_goal_ends_as_cancelled(right: Goals, egm: Client) -> None:
    handle = right.send(swing(egm, 0.5, 4.0))
    answer = right.wait(handle.cancel_goal_async())
    assert len(answer.goals_canceling) == 1
    end = right.result(handle)
    assert (end.status, end.result.error_code) == (GoalStatus.STATUS_CANCELED, Result.SUCCESSFUL)


def test_trajectory_on_the_topic_ends_the_open_goal(right: Goals, egm: Client) -> None:
    publisher = egm.node.create_publisher(JointTrajectory, f"r/{SINGLE}/joint_trajectory", 1)
    egm.until(lambda: publisher.get_subscription_count() > 0)
    handle = right.send(swing(egm, 0.5, 4.0))
    publisher.publish(swing(egm, 0.1, 1.0))
    end = right.result(handle)
    assert (end.status, end.result.error_code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert end.result.error_string == "A newer trajectory has replaced this one."


def test_bad_goals_are_rejected_with_the_reason(right: Goals, egm: Client) -> None:
    trajectory = swing(egm, 0.5, 1.0)
    trajectory.joint_names = [*NAMES[:6], NAMES[0]]
    assert not right.send(trajectory).accepted
    egm.until(egm.hears("it names the joint 'yumi_joint_1_r' twice; name each once."))
    assert not right.send(JointTrajectory(joint_names=NAMES)).accepted
    egm.until(egm.hears("it has no points; to stop a motion, cancel its goal."))
    old = swing(egm, 0.5, 1.0)
    old.header.stamp.sec = 1
    assert not right.send(old).accepted
    egm.until(egm.hears("s ago; send it before its end, or with the stamp 0 to start at once."))


def test_deactivated_controller_aborts_its_goal(right: Goals, egm: Client) -> None:
    handle = right.send(swing(egm, 0.5, 4.0))
    switch(egm, {})
    end = right.result(handle)
    assert (end.status, end.result.error_code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert end.result.error_string == "The controller was deactivated; the arm holds."


def test_goal_activates_its_controller_as_delivered(egm: Client) -> None:
    """After start_egm the position controller is active, and moves nothing."""
    switch(egm, {"r": POSITION})
    goals = Goals(egm, f"r/{SINGLE}")
    trajectory = swing(egm, 0.2, 1.0)
    answer = goals.result(goals.send(trajectory))
    assert (answer.status, answer.result.error_string) == (GoalStatus.STATUS_SUCCEEDED, "The goal is reached.")
    goals.close()
    stop(egm)


def test_goal_is_aborted_with_the_command_to_switch_while_another_controller_is_sent_goals(egm: Client) -> None:
    switch(egm, {"r": POSITION})
    goals, here = Goals(egm, f"r/{SINGLE}"), position(egm)
    publisher = egm.node.create_publisher(JointState, "r/joint_commands", 1)
    egm.until(lambda: publisher.get_subscription_count() > 0)
    trajectory, sent = swing(egm, 0.2, 1.0), []

    def stream() -> None:
        publisher.publish(JointState(name=NAMES, position=here))
        sent.append(here)

    sender = egm.node.create_timer(0.05, stream)
    egm.until(lambda: len(sent) > 10)
    answer = goals.result(goals.send(trajectory))
    egm.node.destroy_timer(sender)
    assert (answer.status, answer.result.error_code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert answer.result.error_string.startswith(
        f"Controller '{SINGLE}' is inactive, and {POSITION} commands the arm; wait until its motion has ended, or "
        f"activate {SINGLE}. To activate: yumi switch right {SINGLE} (in ROS: ros2 control switch_controllers"
    )
    goals.close()
    stop(egm)


def query(client: Client, seconds: float) -> Any:
    """The state of the trajectory in some seconds."""
    later = client.node.get_clock().now().nanoseconds + int(seconds * 1e9)
    request = QueryTrajectoryState.Request()
    request.time.sec, request.time.nanosec = later // 10**9, later % 10**9
    return client.call(QueryTrajectoryState, f"r/{SINGLE}/query_state", request)


def test_query_reports_where_the_trajectory_will_be(right: Goals, egm: Client) -> None:
    begin, trajectory = position(egm), swing(egm, 0.5, 4.0)
    trajectory.points.insert(0, point(begin, 0.0))
    handle = right.send(trajectory)
    egm.until(lambda: bool(query(egm, 2.0).success))
    answer = query(egm, 1.0)
    assert list(answer.name) == NAMES
    assert begin[6] < answer.position[6] < begin[6] + 0.5
    assert answer.velocity[6] > 0.0
    right.wait(handle.cancel_goal_async())
    right.result(handle)
    egm.until(lambda: not query(egm, 0.0).success)
    assert query(egm, 0.0).message == "No trajectory is followed at that time; ask for a time within one."


def test_controller_state_reports_joints_and_where_they_are(right: Goals, egm: Client) -> None:
    states: list[Any] = []
    egm.node.create_subscription(JointTrajectoryControllerState, f"r/{SINGLE}/controller_state", states.append, 100)
    egm.until(lambda: len(states) > 100)
    assert list(states[-1].joint_names) == NAMES
    assert list(states[-1].feedback.positions) == pytest.approx(position(egm), abs=0.01)
    assert list(states[-1].output.positions) == pytest.approx(position(egm), abs=0.01)
    first, last = (each.header.stamp.sec + each.header.stamp.nanosec * 1e-9 for each in (states[0], states[-1]))
    assert (len(states) - 1) / (last - first) == pytest.approx(50.0, abs=5.0)
