"""What any rclpy program sees of the driver while it drives a virtual robot over real sockets."""

from __future__ import annotations

import re
from itertools import pairwise
from math import inf, nan, radians
from statistics import median
from typing import Any

import pytest
from control_msgs.action import GripperCommand
from control_msgs.msg import GripperCommand as CommandMessage
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros_bench import Client, Robot
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import SetBool, Trigger

from abb_protocols.catalogue import clause, message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.robot.joints import CYCLE, Side, finger_names, home, joint_names
from abb_runtime.process.command_process import CommandProcess

pytestmark = [pytest.mark.ros, pytest.mark.timeout(120)]


def said(code: str, **values: Any) -> str:
    """How the driver words a message."""
    return sentence(message(code, **values), FrontEnd.ROS)


def goal_refused(code: str, **values: Any) -> str:
    return said("command_refused", noun="Goal", reason=message(code, **values))


class Arm:
    """One arm seen through its topics."""

    def __init__(self, client: Client, side: Side) -> None:
        self.states: list[Any] = []
        self._client = client
        node, name = client.node, side.value
        self._publisher = node.create_publisher(JointState, f"{name}/joint_commands", 10)
        node.create_subscription(JointState, f"{name}/joint_states", self.states.append, 1000)

    def command(self, names: list[str], position: list[float]) -> None:
        self._client.until(lambda: self._publisher.get_subscription_count() > 0)
        self._publisher.publish(JointState(name=names, position=position))

    def states_since(self, begin: float) -> list[Any]:
        """Those made after ``begin`` [s]; a busy machine brings older ones late."""
        return [state for state in self.states if state.header.stamp.sec + state.header.stamp.nanosec * 1e-9 >= begin]

    def position(self) -> list[float]:
        count = len(self.states)
        self._client.until(lambda: len(self.states) > count)
        return list(self.states[-1].position)

    def rest(self) -> list[float]:
        """Where it has come to rest."""
        self._client.until(lambda: len(self.states) > 50 and self._moved(50) < radians(0.005))
        return list(self.states[-1].position)

    def _moved(self, count: int) -> float:
        last, first = self.states[-1].position, self.states[-count].position
        return max(abs(after - before) for before, after in zip(first, last, strict=True))


@pytest.mark.smoke
def test_driver_offers_the_services_and_actions_of_the_interface(client: Client) -> None:
    services = {"start_egm", "stop_egm", "robot_is_ready", "get_state"}

    def offered() -> set[str]:
        return {
            name.rsplit("/", 1)[1]
            for name, kinds in client.node.get_service_names_and_types()
            if kinds == ["std_srvs/srv/Trigger"] and name.startswith("/yumi_robot_manager/")
        }

    client.until(lambda: services <= offered())
    for side in Side:
        assert ActionClient(client.node, GripperCommand, f"{side.value}/gripper/gripper_cmd").wait_for_server(10.0)


@pytest.mark.smoke
def test_driver_brought_the_robot_to_ready(idle: Client, driver: CommandProcess) -> None:
    assert "The robot is ready." in driver.log.read_text()
    answer = idle.call(Trigger, "yumi_robot_manager/robot_is_ready")
    assert (answer.success, answer.message) == (True, "ready")
    state = idle.call(Trigger, "yumi_robot_manager/get_state")
    assert state.message == (
        "operating mode AUTO; controller motoron; RAPID running; right arm IDLE, EGM off; left arm IDLE, EGM off"
    )


def test_description_is_there_for_late_comers(client: Client) -> None:
    got: list[Any] = []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    client.node.create_subscription(String, "robot_description", got.append, latched)
    client.until(lambda: bool(got))
    assert all(name in got[0].data for side in Side for name in joint_names(side))


@pytest.mark.smoke
def test_goal_before_egm_is_refused_with_a_sentence(idle: Client) -> None:
    arm = Arm(idle, Side.RIGHT)
    refusal = goal_refused("arm_without_egm", arm="right")
    idle.until(lambda: _publish_until_heard(idle, arm, "yumi_joint_1_r", 0.1, refusal))


@pytest.mark.real_time  # processes that take the processors delay most cycles
@pytest.mark.parametrize("side", list(Side))
def test_joint_states_come_at_250_hz_with_seven_names(egm_running: Client, side: Side) -> None:
    arm = Arm(egm_running, side)
    egm_running.until(lambda: len(arm.states) > 250)
    stamps = [state.header.stamp.sec + state.header.stamp.nanosec * 1e-9 for state in arm.states]
    assert all(tuple(state.name) == joint_names(side) for state in arm.states)
    intervals = [after - before for before, after in pairwise(stamps)]
    assert median(intervals) == pytest.approx(CYCLE, rel=0.2)  # a busy machine loses some, and the mean with them
    assert stamps == sorted(stamps)


@pytest.mark.smoke
def test_merged_joint_states_have_both_arms_and_the_fingers(egm_running: Client) -> None:
    got: list[Any] = []
    egm_running.node.create_subscription(JointState, "joint_states", got.append, 10)
    expected = {name for side in Side for name in (*joint_names(side), *finger_names(side))}
    egm_running.until(lambda: bool(got) and set(got[-1].name) == expected)
    assert len(got[-1].position) == len(got[-1].velocity) == len(expected)


@pytest.mark.smoke
def test_arm_goes_where_joint_commands_say(egm_running: Client) -> None:
    arm = Arm(egm_running, Side.RIGHT)
    start = arm.position()
    goal = start[6] + radians(5.0)
    arm.command([joint_names(Side.RIGHT)[6]], [goal])
    egm_running.until(lambda: abs(arm.position()[6] - goal) < radians(0.1))
    assert arm.position()[:6] == pytest.approx(start[:6], abs=radians(0.05))


def test_both_arms_and_a_gripper_follow_one_stream(egm_running: Client) -> None:
    arms = {side: Arm(egm_running, side) for side in Side}
    start = {side: arm.position()[6] for side, arm in arms.items()}
    merged: list[Any] = []
    node = egm_running.node
    node.create_subscription(JointState, "joint_states", merged.append, 10)
    publisher = node.create_publisher(JointState, "joint_commands", 10)
    egm_running.until(lambda: publisher.get_subscription_count() > 0)
    names = [*(joint_names(side)[6] for side in Side), finger_names(Side.RIGHT)[0]]

    def is_there(step: list[int]) -> bool:
        turn = min(radians(5.0), 0.002 * step[0])
        step[0] += 1
        point = JointState(name=names, position=[*(start[side] + turn for side in Side), 0.015])
        point.header.stamp = node.get_clock().now().to_msg()
        publisher.publish(point)
        fingers = dict(zip(merged[-1].name, merged[-1].position, strict=True)) if merged else {}
        return all(
            abs(arm.states[-1].position[6] - start[side] - radians(5.0)) < radians(0.1) for side, arm in arms.items()
        ) and fingers.get(names[2], 0.0) == pytest.approx(0.015, abs=5e-4)

    steps = [0]
    egm_running.until(lambda: is_there(steps))


@pytest.mark.parametrize(
    ("name", "position", "refusal"),
    [
        ("yumi_joint_1_r", nan, said("goal_joint_not_finite", joint="yumi_joint_1_r", value="nan")),
        ("yumi_joint_1_r", inf, said("goal_joint_not_finite", joint="yumi_joint_1_r", value="inf")),
        (
            "yumi_joint_2_r",
            1.0,
            said(
                "goal_joint_out_of_range",
                joint="yumi_joint_2_r",
                position=1.0,
                lower=radians(-143.5),
                upper=radians(43.5),
            ),
        ),
        (
            "elbow",
            0.0,
            goal_refused("no_joint_of_arm", name="elbow", arm="right", joints=joint_names(Side.RIGHT)),
        ),
    ],
)
def test_commands_a_robot_must_never_see_change_nothing(
    egm_running: Client, name: str, position: float, refusal: str
) -> None:
    arm = Arm(egm_running, Side.RIGHT)
    before = arm.rest()
    egm_running.until(lambda: _publish_until_heard(egm_running, arm, name, position, refusal))
    count = len(arm.states)
    egm_running.until(lambda: len(arm.states) > count + 50)
    assert arm.position() == pytest.approx(before, abs=radians(0.05))


def _publish_until_heard(client: Client, arm: Arm, name: str, position: float, refusal: str) -> bool:
    """Each refusal is logged once a second, and the log must have found us: ask again until it is told."""
    arm.command([name], [position])
    return client.hears(refusal)()


@pytest.mark.parametrize(("position", "effort"), [(0.03, 0.0), (-0.001, 0.0), (nan, 0.0), (0.01, 21.0), (0.01, nan)])
def test_gripper_refuses_what_it_cannot_do(client: Client, position: float, effort: float) -> None:
    action = ActionClient(client.node, GripperCommand, "l/gripper/gripper_cmd")
    client.until(action.server_is_ready)
    goal = GripperCommand.Goal()
    goal.command.position, goal.command.max_effort = position, effort
    sent = action.send_goal_async(goal)
    client.until(sent.done)
    assert not sent.result().accepted
    client.until(client.hears("Gripper goal refused: "))
    action.destroy()


def test_fingers_are_reported_while_they_move_and_egm_runs(egm_running: Client) -> None:
    """Twenty times a second; a slow machine may miss some of them."""
    states: list[Any] = []
    egm_running.node.create_subscription(JointState, "r/gripper/joint_states", states.append, 100)
    for position in (0.0, 0.025):
        assert grip(egm_running, Side.RIGHT, position).result.reached_goal
    egm_running.until(lambda: bool(states) and states[-1].position[0] == 0.025)
    assert len({state.position[0] for state in states}) >= 10


def grip(client: Client, side: Side, position: float) -> Any:
    """The answer of ``gripper_cmd``."""
    action = ActionClient(client.node, GripperCommand, f"{side.value}/gripper/gripper_cmd")
    client.until(action.server_is_ready)
    sent = action.send_goal_async(GripperCommand.Goal(command=CommandMessage(position=position)))
    client.until(sent.done)
    ended = sent.result().get_result_async()
    client.until(ended.done)
    action.destroy()
    return ended.result()


def test_vacuum_that_the_gripper_does_not_have_is_refused(client: Client) -> None:
    answer = client.call(SetBool, "r/gripper/vacuum_1", SetBool.Request(data=True))
    assert (answer.success, answer.message) == (
        False,
        said("gripper_has_no_vacuum", gripper="right", modules="servo", channel=1),
    )


def test_diagnostics_tell_the_state_of_both_arms(egm_running: Client) -> None:
    got: list[Any] = []
    egm_running.node.create_subscription(DiagnosticArray, "/diagnostics", got.append, 10)

    def running() -> set[str]:
        statuses = [status for array in got for status in array.status if status.name.startswith("yumi: EGM")]
        return {status.hardware_id for status in statuses if status.message == "running"}

    egm_running.until(lambda: running() == {"ROB_R", "ROB_L"})


@pytest.mark.parametrize("state", ["idle", "egm_running"])
def test_every_status_of_a_healthy_robot_is_ok(client: Client, request: pytest.FixtureRequest, state: str) -> None:
    request.getfixturevalue(state)
    statuses: dict[str, Any] = {}

    def take(array: DiagnosticArray) -> None:
        statuses.update({status.name: status for status in array.status})

    client.node.create_subscription(DiagnosticArray, "/diagnostics", take, 10)

    def are_ok() -> bool:  # EGM has to run for a moment
        return len(statuses) == 11 and all(status.level == DiagnosticStatus.OK for status in statuses.values())

    try:
        client.until(are_ok)
    except AssertionError:
        found = [f"{each.name}: {each.message}" for each in statuses.values() if each.level != DiagnosticStatus.OK]
        pytest.fail(f"{len(statuses)} statuses; not OK: {found}")


def silences(client: Client) -> list[int]:
    """For how long the right arm's robot was silent [ms], of each line of the log that its feedback is lost."""
    lost = message("feedback_lost", arm="right", silence=0.777, controllers=("joint_position_controller",))
    before, after = clause(lost, FrontEnd.ROS).split("777 ms")
    line = re.compile(rf"{re.escape(before)}(\d+) ms{re.escape(after)}", re.IGNORECASE)  # it may begin a sentence
    return [int(found[1]) for found in map(line.search, client.sentences) if found]


@pytest.mark.real_time  # within 100 ms the driver must notice the silence
def test_driver_survives_a_power_cut_of_the_controller_and_starts_again_without_a_jump(
    egm_running: Client, robot: Robot, driver: CommandProcess
) -> None:
    arm = Arm(egm_running, Side.RIGHT)
    name = joint_names(Side.RIGHT)[6]
    arm.command([name], [arm.position()[6] + radians(60.0)])
    start = arm.position()[6]
    egm_running.until(lambda: abs(arm.position()[6] - start) > radians(5.0))  # in the middle of the motion
    with robot.power_cut():
        egm_running.until(lambda: bool(silences(egm_running)))
        (silence,) = silences(egm_running)
        assert silence <= 100
        refused = egm_running.call(Trigger, "yumi_robot_manager/start_egm")
        assert not refused.success
        assert "127.0.0.1" in refused.message
    begin = egm_running.node.get_clock().now().nanoseconds * 1e-9
    answer = egm_running.call(Trigger, "yumi_robot_manager/start_egm")
    assert answer.success, answer.message
    egm_running.until(lambda: len(arm.states_since(begin)) > 250)
    for state in arm.states_since(begin):
        assert list(state.position) == pytest.approx(home(Side.RIGHT), abs=radians(0.01))
    assert driver.exit_code is None


def test_driver_logs_when_egm_begins_and_ends(idle: Client) -> None:
    assert idle.call(Trigger, "yumi_robot_manager/start_egm").success
    for side in Side:
        idle.until(idle.hears(said("robot_follows", arm=side.word)))
    assert idle.call(Trigger, "yumi_robot_manager/stop_egm").success
    for side in Side:
        idle.until(idle.hears(said("robot_stopped_following", arm=side.word)))
