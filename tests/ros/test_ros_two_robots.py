"""Two virtual YuMis in one ROS graph: each name moves its own robot, and their frames are another's nowhere."""

from __future__ import annotations

import importlib
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import partial
from math import inf
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pytest
from control_msgs.action import FollowJointTrajectory, GripperCommand
from controller_manager_msgs.srv import ListHardwareComponents, SwitchController
from geometry_msgs.msg import PoseStamped
from rcl_interfaces.srv import GetParameters
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_bench import TIMEOUT, Client, Robot
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from trajectory_msgs.msg import JointTrajectoryPoint

from abb_protocols.robot.joints import CHAIN_AXES, Side, home
from abb_runtime.process.command_process import CommandProcess
from urdf_kinematics import links_to_root, matrix

pytestmark = [pytest.mark.ros, pytest.mark.timeout(180)]

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
FOUND = 0.6  # [s] from a new process's node to the driver's answer
ANNOUNCED = 3.0  # [s] the same by Fast DDS's own announcements, at the latest
MOVED = 0.05  # [rad]
STANDING, REST = 1e-7, 0.3  # [rad] or [m], [s]
PREFIXES = {"cell1": "", "cell2": "b_"}
ARMS = {prefix: [f"{prefix}yumi_joint_{axis}_{side}" for side in "rl" for axis in CHAIN_AXES] for prefix in ("", "b_")}
FINGERS = {
    prefix: [f"{prefix}gripper_{side}_joint{end}" for side in "rl" for end in ("", "_m")] for prefix in ("", "b_")
}


@dataclass
class Heard:
    """What came on the topics of one robot.

    Attributes:
        joints: newest position of each joint by name [rad] or [m].
        complete: the stamps of complete messages of joint states [s].
        poses: newest tool pose of each arm.
    """

    joints: dict[str, float] = field(default_factory=dict)
    complete: list[float] = field(default_factory=list)
    poses: dict[str, Any] = field(default_factory=dict)


def seconds(message: Any) -> float:
    """The time in a message's header [s]."""
    return float(message.header.stamp.sec + message.header.stamp.nanosec * 1e-9)


class Cells:
    """Both robots as a client of another process sees them.

    Attributes:
        client: what hears and calls them.
        heard: what each robot has told.
        frames: the newest transform of each frame.
        moving: the stamp of each of those that move [s].
    """

    def __init__(self, client: Client) -> None:
        self.client = client
        self.heard = {cell: Heard() for cell in PREFIXES}
        self.frames: dict[str, Any] = {}
        self.moving: dict[str, float] = {}
        node = client.node
        for cell, prefix in PREFIXES.items():
            node.create_subscription(JointState, f"/{cell}/joint_states", self._taking(cell, prefix), 10)
            for side in "rl":
                poses = self.heard[cell].poses
                take = self._keeping(poses, side)
                node.create_subscription(PoseStamped, f"/{cell}/{side}/tcp_pose", take, 10)
        node.create_subscription(TFMessage, "/tf", self._take_moving_frames, 100)
        node.create_subscription(
            TFMessage, "/tf_static", self._take_frames, QoSProfile(depth=10, durability=LATCHED.durability)
        )

    def wait(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        self.client.until(lambda: time.monotonic() >= end, seconds + 5.0)

    def call(self, name: str, kind: Any = Trigger, **fields: Any) -> Any:
        return self.client.call(kind, name, kind.Request(**fields))

    def goal(self, kind: Any, name: str, goal: Any) -> Any:
        """The result of an action's goal."""
        action = ActionClient(self.client.node, kind, name)
        self.client.until(action.server_is_ready)
        sent = action.send_goal_async(goal)
        self.client.until(sent.done)
        assert sent.result().accepted
        ended = sent.result().get_result_async()
        self.client.until(ended.done)
        action.destroy()
        return ended.result().result

    def moved(self, change: Callable[[], object]) -> set[str]:
        """The joints of both robots that are elsewhere when they stand after ``change``, with their robot."""
        before = {cell: dict(heard.joints) for cell, heard in self.heard.items()}

        def elsewhere() -> set[str]:
            return {
                f"{cell}/{name}"
                for cell, heard in self.heard.items()
                for name, position in heard.joints.items()
                if abs(position - before[cell][name]) > (MOVED if "yumi" in name else 0.005)
            }

        change()
        self.client.until(lambda: bool(elsewhere()), what="a motion")
        self.wait_for_rest()
        return elsewhere()

    def wait_for_rest(self) -> None:
        """Until no joint of both robots has moved for a while, and all that moves with them was told since then."""
        positions, since = dict[str, dict[str, float]](), time.time()

        def stand() -> bool:
            nonlocal since
            now = {cell: dict(heard.joints) for cell, heard in self.heard.items()}
            if now.keys() != positions.keys() or any(
                abs(position - positions[cell].get(name, inf)) > STANDING
                for cell, joints in now.items()
                for name, position in joints.items()
            ):
                positions.update(now)
                since = time.time()
            told = [*self.moving.values(), *(max(heard.complete, default=0.0) for heard in self.heard.values())]
            told += [seconds(pose) for heard in self.heard.values() for pose in heard.poses.values()]
            return min(told) > since + REST

        self.client.until(stand, what="rest of both robots")

    def frame(self, name: str, root: str) -> Any:
        """``name_to_root`` from what was heard on /tf and /tf_static, (4, 4)."""
        pose = np.eye(4)
        while name != root:
            transform = self.frames[name]
            place, turn = transform.transform.translation, transform.transform.rotation
            pose = matrix((place.x, place.y, place.z), (turn.w, turn.x, turn.y, turn.z)) @ pose
            name = transform.header.frame_id
        return pose

    def wait_for_joint_states(self) -> None:
        """Until complete messages of both robots have come whose stamps are of now."""
        begin = time.time()
        for heard in self.heard.values():
            heard.complete.clear()
        self.client.until(
            lambda: all(sum(stamp > begin for stamp in heard.complete) > 10 for heard in self.heard.values()),
            what="complete joint states of both robots",
        )

    def _taking(self, cell: str, prefix: str) -> Callable[[Any], None]:
        heard, names = self.heard[cell], [*ARMS[prefix], *FINGERS[prefix]]

        def take(message: Any) -> None:
            assert message.header.frame_id == f"{cell}/{prefix}yumi_base_link"
            heard.joints.update(zip(message.name, message.position, strict=True))
            if list(message.name) == names:
                heard.complete.append(seconds(message))

        return take

    def _keeping(self, poses: dict[str, Any], side: str) -> Callable[[Any], None]:
        return lambda message: poses.update({side: message})

    def _take_moving_frames(self, message: Any) -> None:
        self._take_frames(message)
        self.moving.update({each.child_frame_id: seconds(each) for each in message.transforms})

    def _take_frames(self, message: Any) -> None:
        self.frames.update({each.child_frame_id: each for each in message.transforms})


@pytest.fixture(scope="module")
def cells(ros: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cells]:
    folder = tmp_path_factory.mktemp("cells")
    with ExitStack() as stack:
        robots = {cell: Robot(_made(folder / f"robot-{cell}")) for cell in PREFIXES}
        for robot in robots.values():
            robot.begin()
            stack.callback(robot.stop)
        for robot in robots.values():
            robot.wait_until_ready()
        names = {
            "cell1": ["--ros-args", "-r", "__ns:=/cell1", "--"],
            "cell2": ["--namespace", "cell2", "--prefix", "b_"],
        }
        drivers = []
        for cell, robot in robots.items():
            address = ["--robot", f"127.0.0.1:{robot.rws_port}", *robot.egm_options]
            driver = CommandProcess(f"driver {cell}", "yumi", ["up", *address, *names[cell]], folder / f"{cell}.log")
            drivers.append(stack.enter_context(driver))
        for driver in drivers:
            driver.wait_until_ready(2 * TIMEOUT)
        client = Client()
        stack.callback(client.close)
        yield Cells(client)


def _made(folder: Path) -> Path:
    folder.mkdir()
    return folder


ASK = """
import sys, time
import rclpy
from std_srvs.srv import Trigger
rclpy.init()
node = rclpy.create_node("asker")
begin, turns = time.monotonic(), 0
service, answer = node.create_client(Trigger, sys.argv[1]), None
while not (answer and answer.done()) and turns < 2000:
    rclpy.spin_once(node, timeout_sec=0.01)
    turns += 1
    if answer is None and service.service_is_ready():
        answer = service.call_async(Trigger.Request())
print(min(time.monotonic() - begin, turns * 0.01) if answer.result().message else "no answer")
"""
"""How long a new process waits for an answer; while it is not let on a processor, it does not wait."""


@pytest.mark.real_time
@pytest.mark.alone
def test_new_process_is_answered_soon_after_it_has_its_node(cells: Cells) -> None:
    """Most are: what a full socket of one has dropped comes with a heartbeat of Fast DDS, 1 s later, or the next."""
    ask = [sys.executable, "-c", ASK, "/cell1/yumi_robot_manager/get_state"]
    waited = [float(subprocess.run(ask, capture_output=True, check=True, timeout=30.0).stdout) for _ in range(5)]
    assert median(waited) < FOUND
    assert max(waited) < ANNOUNCED


def test_all_nodes_are_in_their_robots_namespaces(cells: Cells) -> None:
    for cell in PREFIXES:
        assert "EGM off" in cells.call(f"/{cell}/yumi_robot_manager/get_state").message
    cells.wait(1.5)
    of_tests = ("/test_client", "/application", "/rosout")  # nodes of this process, of other tests also

    def nodes() -> list[str]:
        found = cells.client.node.get_node_names_and_namespaces()
        names = [f"{space}/{name}".replace("//", "/") for name, space in found]
        return [name for name in names if not name.startswith(of_tests)]

    # What a driver of another test has left, if its farewell was lost, is gone after the lease of 20 s.
    cells.client.until(lambda: all(name.startswith(("/cell1/", "/cell2/")) for name in nodes()), 25.0, "farewell")
    ours = nodes()
    assert len(set(ours)) == len(ours)
    for cell in PREFIXES:
        assert {f"/{cell}/{side}/{node}" for side in "rl" for node in ("controller_manager", "gripper")} <= {*ours}
        assert {f"/{cell}/yumi_robot_manager", f"/{cell}/robot_state_publisher"} <= {*ours}
    for cell in PREFIXES:
        for side, unit in (("r", "ROB_R"), ("l", "ROB_L")):
            answer = cells.call(f"/{cell}/{side}/controller_manager/list_hardware_components", ListHardwareComponents)
            assert [component.name for component in answer.component] == [unit]


def test_joint_states_are_complete_and_fresh_before_during_and_after_egm(cells: Cells) -> None:
    cells.wait_for_joint_states()
    answer = cells.call("/cell1/yumi_robot_manager/start_egm")
    assert answer.success, answer.message
    cells.wait_for_joint_states()
    assert "EGM off" in cells.call("/cell2/yumi_robot_manager/get_state").message  # start_egm was for cell1 alone
    answer = cells.call("/cell1/yumi_robot_manager/motors_off")
    assert answer.success, answer.message
    cells.wait_for_joint_states()


def test_each_topic_and_action_moves_its_own_robot_only(cells: Cells) -> None:
    for cell in PREFIXES:
        answer = cells.call(f"/{cell}/yumi_robot_manager/start_egm")
        assert answer.success, answer.message
    node, (joint_7,) = cells.client.node, [f"yumi_joint_{axis}_r" for axis in (4,)]
    goals = node.create_publisher(JointState, "/cell1/r/joint_commands", 10)
    cells.client.until(lambda: goals.get_subscription_count() == 1)
    goal = JointState(name=[joint_7], position=[home(Side.RIGHT)[4] + 0.3])
    assert cells.moved(lambda: goals.publish(goal)) == {f"cell1/{joint_7}"}

    hand = GripperCommand.Goal()
    hand.command.position = 0.02
    is_for = "/cell2/l/gripper/gripper_cmd"
    fingers = {f"cell2/b_gripper_l_joint{end}" for end in ("", "_m")}
    assert cells.moved(lambda: cells.goal(GripperCommand, is_for, hand)) == fingers

    answer = cells.call(
        "/cell2/l/controller_manager/switch_controller",
        SwitchController,
        activate_controllers=["joint_trajectory_controller"],
        deactivate_controllers=["joint_position_controller"],
        strictness=SwitchController.Request.STRICT,
    )
    assert answer.ok, answer.message
    names = [f"b_yumi_joint_{axis}_l" for axis in CHAIN_AXES]
    target = [cells.heard["cell2"].joints[name] for name in names]
    target[4] += 0.2
    motion = FollowJointTrajectory.Goal()
    motion.trajectory.joint_names = names
    motion.trajectory.points = [JointTrajectoryPoint(positions=target)]
    motion.trajectory.points[0].time_from_start.sec = 1
    action = "/cell2/l/joint_trajectory_controller/follow_joint_trajectory"
    assert cells.moved(lambda: cells.goal(FollowJointTrajectory, action, motion)) == {f"cell2/{names[4]}"}


def test_frames_of_both_robots_are_apart_and_where_another_forward_kinematics_has_them(cells: Cells) -> None:
    cells.wait_for_rest()
    described: dict[str, str] = {}
    for cell, prefix in PREFIXES.items():
        value = cells.call(f"/{cell}/robot_state_publisher/get_parameters", GetParameters, names=["robot_description"])
        urdf = value.values[0].string_value
        topic = cells.client.node.create_subscription(
            String,
            f"/{cell}/robot_description",
            lambda message, cell=cell: described.update({cell: message.data}),
            LATCHED,
        )
        cells.client.until(lambda cell=cell: cell in described)
        cells.client.node.destroy_subscription(topic)
        assert described[cell] == urdf
        links = links_to_root(urdf, cells.heard[cell].joints)
        for link, pose in links.items():
            found = cells.frame(f"{cell}/{link}", f"{cell}/{prefix}yumi_base_link")
            assert found == pytest.approx(pose, abs=1e-6), link
        for side in "rl":
            message = cells.heard[cell].poses[side]
            assert message.header.frame_id == f"{cell}/{prefix}yumi_base"
            place, turn = message.pose.position, message.pose.orientation
            pose = matrix((place.x, place.y, place.z), (turn.w, turn.x, turn.y, turn.z))
            assert pose == pytest.approx(links[f"{prefix}yumi_tool0_{side}"], abs=1e-6)
            assert pose == pytest.approx(
                cells.frame(f"{cell}/{prefix}yumi_tcp_{side}", f"{cell}/{prefix}yumi_base_link"), abs=1e-6
            )
    assert all(name.startswith(("cell1/yumi", "cell1/gripper", "cell2/b_")) for name in cells.frames)


def test_both_fingertips_are_where_pinocchio_has_them(cells: Cells) -> None:
    pin = pytest.importorskip("pinocchio", reason="needs yumi-ros2[planning]")
    for cell, prefix in PREFIXES.items():
        value = cells.call(f"/{cell}/robot_state_publisher/get_parameters", GetParameters, names=["robot_description"])
        model = pin.buildModelFromXML(value.values[0].string_value)
        cells.wait_for_rest()
        positions, data = pin.neutral(model), model.createData()
        for name, position in cells.heard[cell].joints.items():
            positions[model.joints[model.getJointId(name)].idx_q] = position
        pin.framesForwardKinematics(model, data, positions)
        base = data.oMf[model.getFrameId(f"{prefix}yumi_base")].inverse()
        for side in "rl":
            tips = f"{prefix}gripper_{side}_fingertips"
            pose = (base * data.oMf[model.getFrameId(tips)]).homogeneous
            assert cells.frame(f"{cell}/{tips}", f"{cell}/{prefix}yumi_base_link") == pytest.approx(pose, abs=1e-6)


def test_each_header_that_leaves_names_a_frame_of_its_robot(cells: Cells) -> None:
    """That of /diagnostics is empty, as upstream's is: its parts are in no place."""
    cells.call("/cell2/yumi_robot_manager/start_egm")
    cells.call(
        "/cell2/l/controller_manager/switch_controller",
        SwitchController,
        activate_controllers=["joint_trajectory_controller"],
        deactivate_controllers=["joint_position_controller"],
        strictness=SwitchController.Request.BEST_EFFORT,  # a test before this one may have switched
    )
    node, heard, subscriptions = cells.client.node, dict[str, str](), []
    for name, (full, *_) in node.get_topic_names_and_types():
        package, _, word = full.split("/")
        kind = getattr(importlib.import_module(f"{package}.msg"), word, None)  # actions have hidden topics
        spaces = [f"{each.node_namespace}/" for each in node.get_publishers_info_by_topic(name)]
        if hasattr(kind, "header") and spaces and all(each.startswith("/cell2/") for each in spaces):
            take = partial(lambda name, message: heard.update({name: message.header.frame_id}), name)
            subscriptions.append(node.create_subscription(kind, name, take, 10))
    of_controllers = {f"/cell2/l/{each}_controller/controller_state" for each in ("joint_trajectory",)}
    of_manager = {f"/cell2/yumi_robot_manager/{each}" for each in ("state", "gpio_states")}
    of_arms = {
        f"/cell2/{side}/{each}" for side in "rl" for each in ("joint_states", "gripper/joint_states", "tcp_pose")
    }
    cells.client.until(lambda: heard.keys() >= of_controllers | of_manager | of_arms | {"/cell2/joint_states"}, 5.0)
    for subscription in subscriptions:
        node.destroy_subscription(subscription)
    roots = {each.header.frame_id for each in cells.frames.values()}
    assert {name: frame for name, frame in heard.items() if frame not in {*cells.frames, *roots}} == {}
    assert all(frame.startswith("cell2/b_") for frame in heard.values())
