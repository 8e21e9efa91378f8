from __future__ import annotations

import re
from collections.abc import Mapping
from math import inf, isnan, nan, pi, radians
from time import time_ns
from typing import Any

import pytest
import rclpy
from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import ZERO_JOINTS, Joints, Side, joint_names
from abb_runtime.clock import ManualClock
from controller_states import read_goal
from refusals import refused
from yumi.control.counters import WireCounters
from yumi.control.goals import CONFIGURED_DELAY, GoalKind, MemoryBuffer, SessionGoal
from yumi.control.hand_over import Commander, HandOver, requested_by
from yumi.control.motion.stream_begin import FARTHEST_STREAM_BEGIN
from yumi.control.shared_state import ARM_PROBLEM_CODES, ArmProblem, Snapshot, read_snapshot
from yumi.ros.command_topics import (
    CommandTopic,
    ForwardTopic,
    JointCommandTopic,
    JointStreamTopic,
    JointVelocityTopic,
)
from yumi.ros.topic_refusals import RefusalLog

pytestmark = pytest.mark.ros
NAMES = joint_names(Side.RIGHT)
SECOND_JOINT = {"joint": "yumi_joint_2_r", "lower": radians(-143.5), "upper": radians(43.5)}


def refusal(noun: str, code: str, **values: Any) -> Message:
    """Of a command."""
    return message("command_refused", noun=noun, reason=message(code, **values))


def no_joint(name: str) -> Message:
    return refusal("Goal", "no_joint_of_arm", name=name, arm="right", joints=NAMES)


def how_to_activate(controller: str) -> str:
    return (
        f"yumi switch right {controller} (in ROS: ros2 control switch_controllers -c /r/controller_manager "
        f"--activate {controller})"
    )


def newest(buffers: Boxes, session: int) -> tuple[int, Joints] | None:
    """Number and positions of the newest goal."""
    number, goal = read_goal(buffers.goals, session)
    return None if goal is None else (number, goal.position)


class Boxes:
    def __init__(self) -> None:
        self.snapshots = MemoryBuffer()
        self.goals = MemoryBuffer()
        self.speeds = MemoryBuffer()


class Clock:
    """Stands at 1000.050 s."""

    def now(self) -> Clock:
        return self

    nanoseconds = 1_000_050_000_000


class Node:
    """Remembers what is logged."""

    def __init__(self) -> None:
        self.warnings: list[str] = []

    def get_logger(self) -> Node:
        return self

    def warning(self, sentence: str, **_: Any) -> None:
        self.warnings.append(sentence)

    def get_clock(self) -> Clock:
        return Clock()

    def get_namespace(self) -> str:
        return "/r"

    def create_subscription(self, *_: Any) -> None:
        return None


def commanded(
    reference: Joints, *, session: int = 3, activation: int = 1, goal_kind: GoalKind = GoalKind.POSITION
) -> Snapshot:
    """An arm that a controller commands."""
    return Snapshot(
        wire=WireCounters(session=session),
        is_streaming=True,
        is_running=True,
        activation=activation,
        goal_kind=goal_kind,
        reference=reference,
        sent=reference,
    )


@pytest.fixture
def buffers(middle: Joints) -> Boxes:
    buffers = Boxes()
    snapshot = Snapshot(
        wire=WireCounters(session=3),
        is_streaming=True,
        is_running=True,
        activation=1,
        goal_kind=GoalKind.POSITION,
        reference=middle,
        sent=middle,
    )
    buffers.snapshots.write(snapshot)
    return buffers


@pytest.fixture
def node() -> Node:
    return Node()


@pytest.fixture
def topic(node: Node, buffers: Boxes) -> JointCommandTopic:
    return JointCommandTopic(node, Side.RIGHT, buffers.goals, lambda: read_snapshot(buffers.snapshots))


def goal(names: list[str], position: list[float]) -> Any:
    return JointState(name=names, position=position)


def test_topic_passes_a_whole_goal_on(topic: JointCommandTopic, buffers: Boxes) -> None:
    position = [0.1, -0.2, 0.3, 0.4, 0.5, 0.6, 0.7]
    topic.take(goal(list(NAMES), position))
    assert newest(buffers, 3) == (1, tuple(position))


def test_topic_takes_joints_in_any_order(topic: JointCommandTopic, buffers: Boxes) -> None:
    position = [0.1, -0.2, 0.3, 0.4, 0.5, 0.6, 0.7]
    topic.take(goal(list(reversed(NAMES)), position[::-1]))
    assert newest(buffers, 3) == (1, tuple(position))


def test_topic_keeps_the_goal_of_joints_that_are_not_named(
    topic: JointCommandTopic, buffers: Boxes, middle: Joints
) -> None:
    topic.take(goal([NAMES[0]], [0.1]))
    topic.take(goal([NAMES[6]], [0.7]))
    assert newest(buffers, 3) == (2, (0.1, *middle[1:6], 0.7))


def test_topic_starts_from_the_reference_again_in_a_new_session(
    topic: JointCommandTopic, buffers: Boxes, middle: Joints
) -> None:
    topic.take(goal([NAMES[0]], [0.1]))
    buffers.snapshots.write(
        commanded(middle, session=4),
    )
    topic.take(goal([NAMES[6]], [0.7]))
    assert newest(buffers, 4) == (2, (*middle[:6], 0.7))


def test_topic_starts_from_the_reference_again_after_the_controller_was_activated_again(
    topic: JointCommandTopic, buffers: Boxes, middle: Joints
) -> None:
    topic.take(goal([NAMES[0]], [0.1]))
    buffers.snapshots.write(
        commanded(middle, activation=2),
    )
    topic.take(goal([NAMES[6]], [0.7]))
    assert newest(buffers, 3) == (2, (*middle[:6], 0.7))


@pytest.mark.parametrize(
    ("names", "position", "said"),
    [
        ([NAMES[2]], [nan], message("goal_joint_not_finite", joint="yumi_joint_7_r", value="nan")),
        ([NAMES[2]], [inf], message("goal_joint_not_finite", joint="yumi_joint_7_r", value="inf")),
        ([NAMES[1]], [pi], message("goal_joint_out_of_range", position=pi, **SECOND_JOINT)),
        (["yumi_joint_1_l"], [0.0], no_joint("yumi_joint_1_l")),
        ([NAMES[0], NAMES[0]], [0.0, 0.1], refusal("Goal", "joint_named_twice", name="yumi_joint_1_r")),
        ([NAMES[0]], [], refusal("Goal", "names_and_values_differ", names=1, what="position", values=0)),
        ([], [], refusal("Goal", "names_and_values_differ", names=0, what="position", values=0)),
        ([], [0.0] * 7, refusal("Goal", "names_and_values_differ", names=0, what="position", values=7)),
        ([NAMES[1]], [-130.0], message("goal_joint_in_degrees", position=-130.0, **SECOND_JOINT)),
    ],
)
def test_topic_refuses_a_goal_with_a_sentence_and_changes_nothing(
    topic: JointCommandTopic, node: Node, buffers: Boxes, names: list[str], position: list[float], said: Message
) -> None:
    topic.take(goal(names, position))
    assert buffers.goals.read() is None
    assert node.warnings == [str(said)]


@pytest.mark.parametrize(
    ("snapshot", "reason"),
    [
        (Snapshot(), message("arm_without_egm", arm="right")),
        (Snapshot(is_streaming=True), message("arm_without_egm", arm="right")),
        (
            Snapshot(is_running=True),
            message(
                "no_controller_for_topic",
                taker="position controller",
                arm="right",
                how=how_to_activate("joint_position_controller"),
            ),
        ),
        (
            Snapshot(is_running=True, activation=1, goal_kind=GoalKind.POSITION),
            message("no_reference_yet", arm="right"),
        ),
    ],
)
def test_topic_refuses_goals_before_the_arm_can_take_them(
    topic: JointCommandTopic, node: Node, buffers: Boxes, snapshot: Snapshot, reason: Message
) -> None:
    buffers.snapshots.write(snapshot)
    topic.take(goal(list(NAMES), [0.0] * 7))
    assert buffers.goals.read() is None
    assert node.warnings == [str(message("command_refused", noun="Goal", reason=reason))]


@pytest.mark.parametrize("problem", [ArmProblem.REFERENCES_IGNORED, ArmProblem.IMPLAUSIBLE])
@pytest.mark.parametrize("kind", [JointCommandTopic, JointVelocityTopic, ForwardTopic])
def test_topics_refuse_with_the_cause_what_an_arm_with_a_problem_cannot_do(
    node: Node, buffers: Boxes, kind: type[CommandTopic], problem: ArmProblem
) -> None:
    topic: Any
    if kind is ForwardTopic:
        topic = forwarding(node, buffers, GoalKind.POSITION, {"forward_position_controller"})
        buffers.snapshots.write(commanded(ZERO_JOINTS)._replace(problem=problem))
        topic.take(Float64MultiArray(data=[0.0] * 7))
    else:
        topic = commanding(kind, node, buffers, ZERO_JOINTS)
        goal_kind = read_snapshot(buffers.snapshots).goal_kind
        buffers.snapshots.write(commanded(ZERO_JOINTS, goal_kind=goal_kind)._replace(problem=problem))
        topic.take(JointState(name=list(NAMES), position=[0.0] * 7, velocity=[0.0] * 7))
    assert buffers.goals.read() is None
    assert buffers.speeds.read() is None
    reason = message(ARM_PROBLEM_CODES[problem], arm="right")
    assert node.warnings == [str(message("command_refused", noun=topic.noun, reason=reason))]


def test_topic_passes_on_when_a_goal_arrived_and_how_fast_it_moves(node: Node, buffers: Boxes) -> None:
    topic = JointCommandTopic(node, Side.RIGHT, buffers.goals, lambda: read_snapshot(buffers.snapshots), lambda: 12.5)
    topic.take(JointState(name=[NAMES[0]], position=[0.1], velocity=[0.7]))
    _, taken = read_goal(buffers.goals, 3)
    assert taken is not None
    assert (taken.time, taken.velocity[0]) == (12.5, 0.7)
    assert all(map(isnan, taken.velocity[1:]))


@pytest.mark.parametrize(("sec", "nanosec", "time"), [(1000, 30_000_000, 12.48), (999, 0, 12.5), (1001, 0, 12.5)])
def test_topic_takes_the_time_of_a_goal_from_its_stamp_where_that_can_be_true(
    node: Node, buffers: Boxes, sec: int, nanosec: int, time: float
) -> None:
    topic = JointCommandTopic(node, Side.RIGHT, buffers.goals, lambda: read_snapshot(buffers.snapshots), lambda: 12.5)
    message = JointState(name=[NAMES[0]], position=[0.1])
    message.header.stamp = Time(sec=sec, nanosec=nanosec)
    topic.take(message)
    _, taken = read_goal(buffers.goals, 3)
    assert taken is not None
    assert taken.time == pytest.approx(time)


def test_topic_refuses_a_goal_with_an_impossible_speed(topic: JointCommandTopic, node: Node, buffers: Boxes) -> None:
    topic.take(JointState(name=[NAMES[0]], position=[0.1], velocity=[9.0]))
    assert buffers.goals.read() is None
    assert node.warnings == [str(refusal("Goal", "speed_too_high", name="yumi_joint_1_r", value=9.0, highest=pi))]


def commanding(kind: type[CommandTopic], node: Node, buffers: Boxes, middle: Joints) -> CommandTopic:
    """A topic on an arm whose controller takes its goals."""
    buffers.snapshots.write(commanded(middle, goal_kind=kind.kind))
    return kind(node, Side.RIGHT, buffers.goals, lambda: read_snapshot(buffers.snapshots))


def test_velocity_topic_stops_joints_that_are_not_named(node: Node, buffers: Boxes, middle: Joints) -> None:
    topic = commanding(JointVelocityTopic, node, buffers, middle)
    topic.take(JointState(name=[NAMES[6]], velocity=[0.3]))
    _, taken = read_goal(buffers.goals, 3)
    assert taken is not None
    assert taken.velocity == (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.3)


def test_command_that_is_refused_takes_no_arm(node: Node, buffers: Boxes, middle: Joints) -> None:
    hand_over = HandOver(lambda: 1.0)
    buffers.snapshots.write(commanded(middle, goal_kind=GoalKind.VELOCITY))
    topic = JointVelocityTopic(
        node, Side.RIGHT, buffers.goals, lambda: read_snapshot(buffers.snapshots), lambda: 1.0, hand_over
    )
    for speed, commander in ((nan, Commander.NONE), (0.1, Commander.STREAM)):
        topic.take(JointState(name=[NAMES[0]], velocity=[speed]))
        assert hand_over.of(Side.RIGHT).who is commander


def forwarding(node: Node, buffers: Boxes, kind: GoalKind, active: set[str]) -> ForwardTopic:
    """The topic of the controller ``mine`` on an arm that the ``active`` ones command."""
    buffers.snapshots.write(commanded(ZERO_JOINTS, goal_kind=kind))
    both = (buffers.goals, buffers.speeds)
    return ForwardTopic(
        node, Side.RIGHT, both, lambda: read_snapshot(buffers.snapshots), lambda: 1.0, "mine", lambda: active
    )


def test_forward_topic_passes_seven_positions_on(node: Node, buffers: Boxes, middle: Joints) -> None:
    topic = forwarding(node, buffers, GoalKind.FORWARD_POSITION, {"mine"})
    topic.take(Float64MultiArray(data=list(middle)))
    assert topic.name == "mine/commands"
    assert newest(buffers, 3) == (1, middle)


def test_forward_topic_passes_seven_speeds_on(node: Node, buffers: Boxes) -> None:
    forwarding(node, buffers, GoalKind.FORWARD_VELOCITY, {"mine"}).take(Float64MultiArray(data=[0.1] * 7))
    _, taken = read_goal(buffers.speeds, 3)
    assert taken is not None
    assert taken.velocity == (0.1,) * 7


@pytest.mark.parametrize(
    ("kind", "active", "values", "said"),
    [
        (
            GoalKind.FORWARD_POSITION,
            {"mine"},
            [0.0] * 6,
            refusal("Goal", "values_wrong_count", count=6, joints=7),
        ),
        (
            GoalKind.FORWARD_POSITION,
            {"mine"},
            [9.0] * 7,
            message(
                "goal_joint_in_degrees",
                joint="yumi_joint_1_r",
                position=9.0,
                lower=radians(-168.5),
                upper=radians(168.5),
            ),
        ),
        (
            GoalKind.FORWARD_POSITION,
            {"mine"},
            [0.0, -130.0, -135.0, 30.0, 0.0, 40.0, 0.0],
            message("goal_joint_in_degrees", position=-130.0, **SECOND_JOINT),
        ),
        (
            GoalKind.FORWARD_VELOCITY,
            {"mine"},
            [0.0] * 14,
            refusal("Speed", "values_wrong_count", count=14, joints=7),
        ),
        (
            GoalKind.FORWARD_VELOCITY,
            {"mine"},
            [inf] * 7,
            refusal("Speed", "speed_not_finite", name="yumi_joint_1_r", value=inf),
        ),
        (
            GoalKind.POSITION,
            {"other"},
            [0.0] * 7,
            refusal(
                "Command",
                "no_controller_for_topic",
                taker="forward controller",
                arm="right",
                how=how_to_activate("mine"),
            ),
        ),
        (
            GoalKind.FORWARD_POSITION,
            {"other"},
            [0.0] * 7,
            refusal(
                "Command",
                "controller_inactive_on_arm",
                controller="mine",
                arm="right",
                how=how_to_activate("mine"),
            ),
        ),
    ],
)
def test_forward_topic_refuses_with_a_sentence_and_changes_nothing(
    kind: GoalKind, active: set[str], values: list[float], said: Message, node: Node, buffers: Boxes
) -> None:
    forwarding(node, buffers, kind, active).take(Float64MultiArray(data=values))
    assert buffers.goals.read() is buffers.speeds.read() is None
    assert node.warnings == [str(said)]


@pytest.mark.parametrize(
    ("kind", "command", "said"),
    [
        (
            JointVelocityTopic,
            JointState(name=[NAMES[0]], velocity=[nan]),
            refusal("Speed", "speed_not_finite", name="yumi_joint_1_r", value=nan),
        ),
        (
            JointVelocityTopic,
            JointState(name=[NAMES[0]], velocity=[3.2]),
            refusal("Speed", "speed_too_high", name="yumi_joint_1_r", value=3.2, highest=pi),
        ),
        (
            JointVelocityTopic,
            JointState(name=[NAMES[0]], velocity=[30.0]),
            refusal("Speed", "speed_looks_like_degrees", name="yumi_joint_1_r", value=30.0, highest=pi),
        ),
        (
            JointVelocityTopic,
            JointState(name=[NAMES[0]]),
            refusal("Speed", "names_and_values_differ", names=1, what="velocity", values=0),
        ),
    ],
)
def test_other_topics_refuse_with_a_sentence_and_change_nothing(
    kind: type[CommandTopic], command: Any, said: Message, node: Node, buffers: Boxes, middle: Joints
) -> None:
    commanding(kind, node, buffers, middle).take(command)
    assert buffers.goals.read() is None
    assert node.warnings == [str(said)]


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        (
            JointVelocityTopic,
            refusal(
                "Speed",
                "no_controller_for_topic",
                taker="velocity controller",
                arm="right",
                how=how_to_activate("joint_velocity_controller"),
            ),
        ),
    ],
)
def test_topics_refuse_what_no_active_controller_takes(
    kind: type[CommandTopic], said: Message, node: Node, buffers: Boxes
) -> None:
    kind(node, Side.RIGHT, buffers.goals, lambda: read_snapshot(buffers.snapshots)).take(kind.type())
    assert buffers.goals.read() is None
    assert node.warnings == [str(said)]


def test_each_of_six_different_bad_goals_is_answered_however_soon_it_follows(
    node: Node, buffers: Boxes, clock: ManualClock
) -> None:
    topic = JointCommandTopic(node, Side.RIGHT, buffers.goals, lambda: read_snapshot(buffers.snapshots), clock.now)
    bad = [
        goal([NAMES[1]], [4.0]),
        goal([NAMES[1]], [nan]),
        goal(["yumi_joint_8_r"], [0.0]),
        goal(["joint_2"], [0.0]),
        goal([], [0.0] * 7),
        goal([NAMES[0], NAMES[0]], [0.0, 0.1]),
    ]
    for each in bad:
        topic.take(each)
        clock.advance(0.6)
    said = [
        message("goal_joint_out_of_range", position=4.0, **SECOND_JOINT),
        message("goal_joint_not_finite", joint="yumi_joint_2_r", value="nan"),
        no_joint("yumi_joint_8_r"),
        no_joint("joint_2"),
        refusal("Goal", "names_and_values_differ", names=0, what="position", values=7),
        refusal("Goal", "joint_named_twice", name="yumi_joint_1_r"),
    ]
    assert node.warnings == [str(each) for each in said]


def test_stream_of_bad_goals_is_logged_once_a_second_with_its_count(
    node: Node, buffers: Boxes, clock: ManualClock
) -> None:
    topic = JointCommandTopic(node, Side.RIGHT, buffers.goals, lambda: read_snapshot(buffers.snapshots), clock.now)
    for number in range(6400):
        topic.take(goal([NAMES[1]], [4.0 + 1e-4 * number]))  # every sentence another number
        clock.advance(1.0 / 3200.0)
    assert len(node.warnings) == 2
    assert node.warnings[1].endswith("(3199 more refusals since the last line)")


def test_stream_of_invented_names_cannot_flood_the_log(node: Node, buffers: Boxes, clock: ManualClock) -> None:
    topic = JointCommandTopic(node, Side.RIGHT, buffers.goals, lambda: read_snapshot(buffers.snapshots), clock.now)
    for number in range(6400):
        topic.take(goal([f"joint_{number}" + "x" * 1000], [0.0]))
        clock.advance(1.0 / 3200.0)
    assert len(node.warnings) == 20
    assert max(map(len, node.warnings)) < len(str(no_joint("x"))) + 120  # 80 of the name, and a count
    counts = [int(found[1]) for found in re.finditer(r"\((\d+) more", " ".join(node.warnings))]
    assert sum(counts) + len(node.warnings) == pytest.approx(6400, abs=3200)


class Late:
    """A topic of a driver that reads each message so long after it came [s]."""

    def __init__(self, kind: type[CommandTopic], buffers: Boxes, waited: float, patch: pytest.MonkeyPatch) -> None:
        patch.setattr("yumi.ros.topic_refusals.time_ns", lambda: time_ns() + int(waited * 1e9))
        self.log, self._buffers = Node(), buffers
        self._node = rclpy.create_node("driver")
        snapshot = commanded(ZERO_JOINTS, goal_kind=kind.kind)
        self._topic = kind(self._node, Side.RIGHT, buffers.goals, lambda: snapshot, lambda: 100.0)
        patch.setattr(self._topic, "_refusals", RefusalLog(self.log, lambda: 0.0))
        self._publisher = self._node.create_publisher(JointState, kind.name, 1)

    def send(self, message: JointState) -> SessionGoal | None:
        """What becomes of it; None once it is refused."""
        self._publisher.publish(message)
        deadline = time_ns() + 10_000_000_000
        while not self.log.warnings and self._buffers.goals.read() is None:
            assert time_ns() < deadline
            rclpy.spin_once(self._node, timeout_sec=0.1)
        self._node.destroy_node()
        newest = self._buffers.goals.read()
        return None if newest is None else newest[1]


def test_command_counts_from_when_it_came_in(ros: None, monkeypatch: pytest.MonkeyPatch) -> None:
    sent = Late(JointCommandTopic, Boxes(), 0.3, monkeypatch).send(goal(list(NAMES), [0.1] * 7))
    assert sent is not None
    assert sent.time == pytest.approx(99.7, abs=0.1)


def test_command_that_waited_for_long_in_a_busy_driver_is_refused(ros: None, monkeypatch: pytest.MonkeyPatch) -> None:
    late = Late(JointCommandTopic, Boxes(), 2.0, monkeypatch)
    assert late.send(goal(list(NAMES), [0.1] * 7)) is None
    (warning,) = late.log.warnings
    assert warning in {str(refusal("Goal", "command_waited", waited=2.0 + n / 10, longest=0.5)) for n in range(10)}


@pytest.mark.parametrize("speed", [0.0, 0.1])
def test_speed_of_zero_is_never_too_late(ros: None, monkeypatch: pytest.MonkeyPatch, speed: float) -> None:
    sent = Late(JointVelocityTopic, Boxes(), 2.0, monkeypatch).send(
        JointState(name=list(NAMES), velocity=[speed, *[0.0] * 6])
    )
    assert (sent is None) == (speed > 0.0)


def test_goal_is_refused_while_a_person_commands_the_arm_or_has_let_it_go(
    buffers: Boxes, node: Node, middle: Joints
) -> None:
    clock = ManualClock(1.0)
    hand_over = HandOver(clock.now)
    topic = JointCommandTopic(
        node, Side.RIGHT, buffers.goals, lambda: read_snapshot(buffers.snapshots), clock.now, hand_over
    )
    goal = JointState(name=list(NAMES), position=list(middle))
    with requested_by(Commander.HEADSET, "person", "headset"):
        hand_over.take(Side.RIGHT, Commander.DEVICE)
        topic_refuses(topic, goal, node, "arm_commanded_by_another", arm="right", who="headset", client="headset")
        hand_over.let_go(Side.RIGHT)
    topic_refuses(topic, goal, node, "arm_reserved_for_person", arm="right", who="stream")
    assert newest(buffers, 3) is None
    hand_over.give_back((Side.RIGHT,))
    far = JointState(name=list(NAMES), position=[each + 0.2 for each in middle])  # where the stream was meanwhile
    elsewhere = message("stream_begins_elsewhere", arm="right", distance=pytest.approx(0.2), most=FARTHEST_STREAM_BEGIN)
    with refused(CommandRefused, "command_refused", noun="Goal", reason=elsewhere):
        topic._accept(far, clock.now())
    assert newest(buffers, 3) is None
    topic.take(goal)
    assert newest(buffers, 3) == (1, middle)
    topic.take(far)  # the stream goes on, as far as the limits allow
    assert newest(buffers, 3) == (2, tuple(far.position))


def test_positions_by_index_go_on_near_the_arm_after_a_person_has_led_it(
    buffers: Boxes, node: Node, middle: Joints
) -> None:
    clock = ManualClock(1.0)
    hand_over = HandOver(clock.now)
    name = "forward_position_controller"
    buffers.snapshots.write(commanded(middle, goal_kind=GoalKind.FORWARD_POSITION))
    topic = ForwardTopic(
        node,
        Side.RIGHT,
        (buffers.goals, buffers.speeds),
        lambda: read_snapshot(buffers.snapshots),
        clock.now,
        name,
        lambda: {name},
        hand_over,
    )
    near, far = (Float64MultiArray(data=[each + by for each in middle]) for by in (0.05, 0.2))
    topic.take(far)  # as it comes
    assert newest(buffers, 3) == (1, tuple(far.data))
    with requested_by(Commander.PAGE, "person", "page"):
        clock.advance(2.0)
        hand_over.take(Side.RIGHT, Commander.PAGE)
        hand_over.let_go(Side.RIGHT)
    hand_over.give_back((Side.RIGHT,))
    elsewhere = message("stream_begins_elsewhere", arm="right", distance=pytest.approx(0.2), most=FARTHEST_STREAM_BEGIN)
    with refused(CommandRefused, "command_refused", noun="Command", reason=elsewhere):
        topic._accept(far, clock.now())
    assert newest(buffers, 3) == (1, tuple(far.data))
    for count, each in enumerate((near, far), 2):
        topic.take(each)
        assert newest(buffers, 3) == (count, tuple(each.data))


def topic_refuses(topic: CommandTopic, received: Any, node: Node, code: str, **values: Any) -> None:
    """A message that comes on another thread than that of who commands is refused, and the log says why."""
    node.warnings.clear()
    with requested_by():
        topic.take(received)
    assert node.warnings == [str(message(code, **values))]


@pytest.mark.parametrize("taken", list(Side))
def test_point_for_both_arms_is_taken_by_both_or_by_none(node: Node, middle: Joints, taken: Side) -> None:
    clock, closed = ManualClock(1000.0), list[Mapping[Side, float]]()
    hand_over, boxes = HandOver(clock.now), {side: MemoryBuffer[SessionGoal]() for side in Side}
    arms = {
        side: JointCommandTopic(node, side, boxes[side], lambda: commanded(middle), clock.now, hand_over)
        for side in Side
    }
    stream = JointStreamTopic(node, arms, closed.append, clock.now, hand_over)
    names = [*joint_names(Side.RIGHT), *joint_names(Side.LEFT), "gripper_r_joint"]
    point = JointState(name=names, position=[*middle, *middle, 0.0125])
    with requested_by(Commander.HEADSET, "person"):
        hand_over.take(taken, Commander.HEADSET)
    with pytest.raises(CommandRefused, match=f"{taken.word} arm"):
        stream.take(point)
    assert [box.read() for box in boxes.values()] == [None, None]
    assert closed == []
    assert hand_over.of(taken.other).who is Commander.NONE
    with requested_by(client="person"):
        hand_over.let_go(taken)
    hand_over.give_back(tuple(Side))
    stream.take(point)
    goals = [read_goal(box, 3)[1] for box in boxes.values()]
    assert [goal is not None and (goal.position, goal.time, goal.delay) for goal in goals] == [
        (middle, 1000.0, CONFIGURED_DELAY)
    ] * 2
    assert closed == [{Side.RIGHT: pytest.approx(0.5)}]
    assert {hand_over.of(side).who for side in Side} == {Commander.STREAM}
