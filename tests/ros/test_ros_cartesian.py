"""Lines and streams of the tool through ROS, as a plain client asks for them."""

from __future__ import annotations

from collections.abc import Iterator
from math import dist
from typing import Any

import pytest
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Time
from controller_manager_bench import Manager, boolean, set_parameter
from geometry_msgs.msg import PoseStamped, TransformStamped, TwistStamped
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_bench import Client, Robot
from sensor_msgs.msg import JointState
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from yumi_interfaces.action import MoveBothLinear, MoveLinear
from yumi_interfaces.srv import InverseKinematics, Jacobian

from abb_protocols.robot.joints import Pose, Side, joint_names, joints
from abb_protocols.robot.kinematics import IDENTITY_QUATERNION, tool0_to_body
from abb_runtime.rws.client import RwsClient

# A machine that stands still for 100 ms ends EGM in the middle of a motion.
pytestmark = [pytest.mark.ros, pytest.mark.real_time, pytest.mark.timeout(120)]

FINGERTIPS = Pose((0.0, 0.0, 0.1142), IDENTITY_QUATERNION)
CARTESIAN, POSITION = "cartesian_controller", "joint_position_controller"


class Tool:
    """The right tool, as a client sees and moves it."""

    def __init__(self, client: Client) -> None:
        self.client, self.pose = client, None
        node: Any = client.node
        node.create_subscription(PoseStamped, "/r/tcp_pose", self._take, 10)
        self.target = node.create_publisher(PoseStamped, f"/r/{CARTESIAN}/target_pose", 10)
        self.twist = node.create_publisher(TwistStamped, f"/r/{CARTESIAN}/servo_twist", 10)
        self.servo = node.create_publisher(PoseStamped, f"/r/{CARTESIAN}/servo_pose", 10)
        for publisher in (self.target, self.twist, self.servo):
            client.until(lambda own=publisher: own.get_subscription_count() > 0, what="a subscription")
        client.until(lambda: self.pose is not None, what="tcp_pose")

    def _take(self, message: Any) -> None:
        self.pose = message

    @property
    def height(self) -> float:
        assert self.pose is not None
        return float(self.pose.pose.position.z)

    def moved(self, up: float) -> Any:
        """Where it is, but higher [m]."""
        assert self.pose is not None
        message = PoseStamped(header=self.pose.header, pose=self.pose.pose)
        message.pose.position.z += up
        return message


@pytest.fixture
def tool(egm_running: Client) -> Iterator[Tool]:
    manager = Manager(egm_running, "/r/controller_manager")
    manager.switch([CARTESIAN], [POSITION])
    yield Tool(egm_running)
    manager.switch([POSITION], [CARTESIAN])


def test_tcp_pose_is_the_controllers_robtarget(tool: Tool, robot: Robot) -> None:
    with RwsClient(f"127.0.0.1:{robot.rws_port}") as controller:
        page = controller.call("GET", "/rw/motionsystem/mechunits/ROB_R/robtarget", (("tool", "tool0"),))
    assert page is not None
    fields = page.states[0].fields
    place = tool.pose.pose.position
    assert (place.x, place.y, place.z) == pytest.approx([float(fields[each]) / 1e3 for each in "xyz"], abs=1e-5)


def test_target_pose_moves_the_tool_on_a_line(tool: Tool) -> None:
    begin = tool.height
    tool.target.publish(tool.moved(0.05))
    tool.client.until(lambda: abs(tool.height - begin - 0.05) < 1e-3, what="the target")
    tool.client.until(tool.client.hears("the goal is reached"), what="the end of the line")


def test_a_stream_of_velocities_moves_the_tool_and_stops(tool: Tool) -> None:
    begin = tool.height

    def goes_on() -> bool:
        message = TwistStamped()
        message.header.frame_id = "yumi_base"
        message.twist.linear.z = -0.05
        tool.twist.publish(message)
        return tool.height < begin - 0.02

    tool.client.until(goes_on, what="the motion")


def test_a_stream_of_poses_is_followed(tool: Tool) -> None:
    target = tool.moved(0.02)
    target.header.stamp = Time()  # the same message again and again is not old

    def has_arrived() -> bool:
        tool.servo.publish(target)
        return abs(tool.height - target.pose.position.z) < 1e-3

    tool.client.until(has_arrived, what="the pose")


class Goals:
    """An action of Cartesian controllers."""

    def __init__(self, client: Client, kind: Any, name: str) -> None:
        self.client, self.feedback, self._kind = client, [], kind
        self._action = ActionClient(client.node, kind, name)
        client.until(self._action.server_is_ready, what="the action")

    def send(self, **fields: Any) -> Any:
        self.feedback.clear()
        goal = self._kind.Goal(**fields)
        return self._answer(self._action.send_goal_async(goal, lambda told: self.feedback.append(told.feedback)))

    def end(self, handle: Any) -> tuple[int, Any]:
        ended = self._answer(handle.get_result_async())
        return ended.status, ended.result

    def _answer(self, future: Any) -> Any:
        self.client.until(future.done, what="an answer of the action")
        return future.result()

    def destroy(self) -> None:
        self._action.destroy()


class Lines(Goals):
    """The action of an arm's Cartesian controller."""

    def __init__(self, client: Client, side: Side) -> None:
        super().__init__(client, MoveLinear, f"/{side.value}/{CARTESIAN}/move_linear")
        self.places: list[Any] = []
        client.node.create_subscription(PoseStamped, f"/{side.value}/tcp_pose", self.places.append, 10)
        client.until(lambda: bool(self.places), what="tcp_pose")

    @property
    def height(self) -> float:
        return float(self.places[-1].pose.position.z)

    def send(self, target: Any, **fields: Any) -> Any:
        return super().send(target_pose=target, **fields)


def in_tool(side: Side, along: float) -> Any:
    """Ahead of an arm's tool, seen from the tool [m]."""
    message = PoseStamped()
    message.header.frame_id = f"yumi_tcp_{side.value}"
    message.pose.position.z, message.pose.orientation.w = along, 1.0
    return message


@pytest.fixture(params=[Side.LEFT])
def lines(request: pytest.FixtureRequest, egm_running: Client) -> Iterator[tuple[Lines, Side]]:
    side = request.param
    manager = Manager(egm_running, f"/{side.value}/controller_manager")
    manager.switch([CARTESIAN], [POSITION])
    own = Lines(egm_running, side)
    yield own, side
    own.destroy()
    manager.switch([POSITION], [CARTESIAN])


def test_line_of_the_action_is_reached_refused_and_cancelled(lines: tuple[Lines, Side]) -> None:
    own, side = lines
    begin = own.places[-1].pose.position
    # There and back in the frame of the tool, with feedback on the way.
    status, result = own.end(own.send(in_tool(side, -0.05), speed=0.1))
    assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True)
    assert result.message.startswith("The goal is reached")
    there = result.pose.pose.position
    assert dist((there.x, there.y, there.z), (begin.x, begin.y, begin.z)) == pytest.approx(0.05, abs=1e-3)
    assert result.pose.header.frame_id == "yumi_base"
    progress = [each.progress for each in own.feedback]
    assert progress == sorted(progress)
    assert 0.0 < progress[0] < progress[-1] <= 1.0
    # Refused with the reason, and nothing moves.
    far, moon = in_tool(side, -1.5), in_tool(side, 0.01)
    moon.header.frame_id = "moon"
    for target, fields, words in (
        (far, {"speed": 1.0}, "arm cannot follow it beyond"),
        (moon, {}, "there is no frame 'moon'"),
        (in_tool(side, 0.05), {"speed": 2.0}, "speed is 2; allowed is"),
        (in_tool(side, 0.05), {"speed": -1.0}, "speed is -1; give a finite number"),
    ):
        status, result = own.end(own.send(target, **fields))
        assert (status, result.success) == (GoalStatus.STATUS_ABORTED, False)
        assert words in result.message
    # Cancelled on its way back.
    handle = own.send(in_tool(side, 0.05), speed=0.02)
    own.client.until(lambda: any(each.progress > 0.1 for each in own.feedback), what="feedback")
    cancelled = handle.cancel_goal_async()
    status, result = own.end(handle)
    assert cancelled.done()
    assert (status, result.success) == (GoalStatus.STATUS_CANCELED, False)
    # A newer goal takes the place of an older one.
    older = own.send(in_tool(side, 0.02), speed=0.01)
    own.client.until(lambda: any(each.progress > 0.1 for each in own.feedback), what="feedback")
    newer = own.send(in_tool(side, -0.01), speed=0.1)
    assert own.end(older)[0] == GoalStatus.STATUS_ABORTED
    assert own.end(newer)[0] == GoalStatus.STATUS_SUCCEEDED


def test_line_of_the_action_is_refused_while_another_controller_commands_the_arm(egm_running: Client) -> None:
    own = Lines(egm_running, Side.LEFT)
    status, result = own.end(own.send(in_tool(Side.LEFT, -0.01)))
    assert status == GoalStatus.STATUS_ABORTED
    assert "no Cartesian controller is active on the left arm; activate one first" in result.message
    own.destroy()


def test_what_is_refused_is_said(tool: Tool) -> None:
    message = tool.moved(0.05)
    message.header.frame_id = "moon"
    tool.target.publish(message)
    tool.client.until(tool.client.hears("Target refused: there is no frame 'moon'; take yumi_base"), what="a refusal")
    far = tool.moved(1.5)
    far.header.frame_id = ""
    tool.target.publish(far)
    tool.client.until(tool.client.hears("the right arm cannot follow it beyond"), what="a refusal")


def test_positions_without_times_are_followed_smoothly_where_the_parameter_says_so(egm_running: Client) -> None:
    client, name = egm_running, "/r/joint_trajectory_controller"
    manager = Manager(client, "/r/controller_manager")
    manager.switch([name[3:]], [POSITION])
    heard: list[Any] = []
    client.node.create_subscription(JointState, "/r/joint_states", heard.append, 10)
    client.until(lambda: bool(heard), what="joint_states")
    publisher = client.node.create_publisher(JointTrajectory, f"{name}/joint_trajectory", 1)
    client.until(lambda: publisher.get_subscription_count() > 0, what="a subscription")
    names, begin = list(heard[-1].name), list(heard[-1].position)
    swings = [0.02 * number for number in (0, 1, 2, 3, 3.5, 3.8, 3.9, 4.0)]
    points = [JointTrajectoryPoint(positions=[begin[0] + each, *begin[1:]]) for each in swings]
    message = JointTrajectory(joint_names=names, points=points)
    try:
        publisher.publish(message)
        client.until(client.hears("not after point 1"), what="a refusal: no point has a time")
        assert set_parameter(client, name, "positions_upsampling.enable", boolean(True)).successful
        publisher.publish(message)
        client.until(lambda: abs(heard[-1].position[0] - begin[0] - 0.08) < 2e-3, what="the last point")
    finally:
        set_parameter(client, name, "positions_upsampling.enable", boolean(False))
        manager.switch([POSITION], [name[3:]])


def on_table(x: float, y: float, z: float) -> Any:
    """A place in a frame that this test publishes, with a tool that points down."""
    message = PoseStamped()
    message.header.frame_id = "table"
    place, turn = message.pose.position, message.pose.orientation
    place.x, place.y, place.z = x, y, z
    turn.x, turn.w = 1.0, 0.0
    return message


@pytest.fixture
def both(egm_running: Client) -> Iterator[Goals]:
    managers = [Manager(egm_running, f"/{side.value}/controller_manager") for side in Side]
    for manager in managers:
        manager.switch([CARTESIAN], [POSITION])
    own = Goals(egm_running, MoveBothLinear, f"/dual_arm_{CARTESIAN}/move_linear")
    yield own
    own.destroy()
    for manager in managers:
        manager.switch([POSITION], [CARTESIAN])


def test_both_tools_move_as_one_motion_or_not_at_all(both: Goals) -> None:
    up = {side: [in_tool(side, along) for along in (-0.02, -0.05)] for side in Side}
    for pose in up[Side.LEFT]:
        pose.header.frame_id = "gripper_l_fingertips"
    down = {side: [in_tool(side, 0.05)] for side in Side}
    # The left tool has farther to go; both begin and end together.
    heard: list[Any] = []
    both.client.node.create_subscription(JointState, "/joint_states", heard.append, 10)
    at_rest = "standstill of both arms after the motion before"
    both.client.until(lambda: bool(heard) and max(map(abs, heard[-1].velocity)) < 1e-3, what=at_rest)
    heard.clear()
    status, result = both.end(
        both.send(right=up[Side.RIGHT][:1], left=up[Side.LEFT], speed=0.05, left_tool_frame="gripper_l_fingertips")
    )
    assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True), result.message
    assert {result.right.header.frame_id, result.left.header.frame_id} == {"yumi_base"}
    progress = [each.progress for each in both.feedback]
    assert progress == sorted(progress)
    assert progress
    moving = {side: [any(abs(v) > 0.01 for v in part.velocity[at : at + 7]) for part in heard] for side, at in ARMS}
    right, left = ([each.index(True), len(each) - each[::-1].index(True)] for each in moving.values())
    assert right == pytest.approx(left, abs=10), "begin and end, in hundredths of a second"
    # Where one cannot go, neither moves.
    far = in_tool(Side.LEFT, -1.5)
    status, result = both.end(both.send(right=down[Side.RIGHT], left=[far], speed=1.0))
    assert (status, result.success) == (GoalStatus.STATUS_ABORTED, False)
    assert "the left arm cannot follow it beyond" in result.message
    status, result = both.end(both.send(right=down[Side.RIGHT]))
    assert "one arm has no pose; for one alone take its own cartesian_controller/move_linear" in result.message
    # Cancelled, both stop; an arm whose goal is replaced stops the other.
    handle = both.send(right=down[Side.RIGHT], left=down[Side.LEFT], speed=0.02)
    both.client.until(lambda: any(each.progress > 0.1 for each in both.feedback), what="feedback")
    handle.cancel_goal_async()
    status, result = both.end(handle)
    assert (status, result.success) == (GoalStatus.STATUS_CANCELED, False)
    handle = both.send(right=down[Side.RIGHT], left=down[Side.LEFT], speed=0.02)
    both.client.until(lambda: any(each.progress > 0.1 for each in both.feedback), what="feedback")
    lines = Lines(both.client, Side.RIGHT)
    assert lines.end(lines.send(in_tool(Side.RIGHT, -0.01)))[0] == GoalStatus.STATUS_SUCCEEDED
    status, result = both.end(handle)
    lines.destroy()
    assert status == GoalStatus.STATUS_ABORTED
    assert result.message == ("The right arm did not reach its goal: the motion was cancelled; the arm is at rest.")
    both.client.until(lambda: max(map(abs, heard[-1].velocity)) < 1e-3, what="standstill of both arms")


ARMS = ((Side.RIGHT, 0), (Side.LEFT, 7))  # where joints of an arm begin in joint_states


def test_both_arms_are_refused_where_one_is_commanded_by_another_controller(egm_running: Client) -> None:
    own = Goals(egm_running, MoveBothLinear, f"/dual_arm_{CARTESIAN}/move_linear")
    status, result = own.end(own.send(**{side.word: [in_tool(side, -0.01)] for side in Side}))
    assert status == GoalStatus.STATUS_ABORTED
    assert "no Cartesian controller is active on the left arm; activate one first" in result.message
    own.destroy()


def test_poses_in_frames_of_others_are_passed_without_a_stop_and_their_postures_known(
    lines: tuple[Lines, Side],
) -> None:
    own, side = lines
    client, away = own.client, 1.0 if side is Side.LEFT else -1.0
    broadcaster = client.node.create_publisher(
        TFMessage, "/tf_static", QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    )
    table = TransformStamped(child_frame_id="table")
    table.header.frame_id = "yumi_base"
    table.transform.translation.x, table.transform.translation.z = 0.35, 0.2
    broadcaster.publish(TFMessage(transforms=[table]))
    goal = on_table(0.0, away * 0.25, 0.0)
    asked = InverseKinematics.Request(target_pose=goal, tool_frame=f"gripper_{side.value}_fingertips")

    def answer() -> Any:
        return client.call(InverseKinematics, f"/{side.value}/{CARTESIAN}/inverse_kinematics", asked)

    client.until(lambda: "no frame 'table'" not in answer().message, what="the frame")
    found = answer()
    assert (found.success, found.message) == (True, "")
    tool = FINGERTIPS
    for posture in found.postures:
        assert tuple(posture.name) == joint_names(side)
        there = tool0_to_body(side, joints(posture.position), tool)
        assert there.position == pytest.approx((0.35, away * 0.25, 0.2), abs=1e-9)
    # The Jacobian there is how that pose changes.
    rows = client.call(
        Jacobian,
        f"/{side.value}/{CARTESIAN}/jacobian",
        Jacobian.Request(position=found.postures[0].position, tool_frame=asked.tool_frame),
    )
    step = [*found.postures[0].position]
    step[2] += 1e-6
    moved = tool0_to_body(side, joints(step), tool).position
    expected = [(b - a) / 1e-6 for a, b in zip((0.35, away * 0.25, 0.2), moved, strict=True)]
    assert [rows.jacobian[7 * row + 2] for row in range(3)] == pytest.approx(expected, abs=1e-5)
    # There by its joints, then round a corner with the fingertips.
    stream = client.node.create_publisher(JointState, f"/{side.value}/joint_commands", 10)
    manager = Manager(client, f"/{side.value}/controller_manager")
    manager.switch([POSITION], [CARTESIAN])
    client.until(lambda: stream.get_subscription_count() > 0, what="a subscription")
    stream.publish(JointState(name=found.postures[0].name, position=found.postures[0].position))
    speeds: list[float] = []
    client.node.create_subscription(
        JointState, f"/{side.value}/joint_states", lambda it: speeds.append(dist(it.position, step)), 10
    )
    client.until(lambda: bool(speeds) and speeds[-1] < 2e-3, what="the posture")
    manager.switch([CARTESIAN], [POSITION])
    corner, end = on_table(0.05, away * 0.25, 0.0), on_table(0.05, away * 0.30, 0.0)
    status, result = own.end(own.send(end, through=[corner], zone=0.02, speed=0.1, tool_frame=asked.tool_frame))
    assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True), result.message
    place = result.pose.pose.position
    assert (place.x, place.y, place.z) == pytest.approx((0.40, away * 0.30, 0.2), abs=1e-3)
