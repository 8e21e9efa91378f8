"""Lines and streams of the tool through ROS, as a plain client asks for them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest
from builtin_interfaces.msg import Time
from controller_manager_bench import Manager, boolean, set_parameter
from geometry_msgs.msg import PoseStamped, TwistStamped
from ros_bench import Client, Robot
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from yumi.rws.client import RwsClient

# A machine that stands still for 100 ms ends EGM in the middle of a motion.
pytestmark = [pytest.mark.ros, pytest.mark.real_time, pytest.mark.timeout(120)]

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
    tool.client.until(tool.client.hears("The goal is reached"), what="the end of the line")


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
