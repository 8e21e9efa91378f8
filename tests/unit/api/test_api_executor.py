from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from math import inf, isnan, nan
from threading import Event
from typing import Any

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, GoalNotReached, RobotNotReady
from abb_protocols.robot.joints import (
    CHAIN_AXES,
    YUMI_LIMITS,
    ZERO_JOINTS,
    Joints,
    Pose,
    Side,
    home,
    joint_names,
    joints,
)
from abb_protocols.robot.kinematics import IDENTITY_QUATERNION, tool0_to_body
from controller_states import read_goal
from fake_robot import FakeRobot, Switch
from refusals import assert_says, refused
from yumi.api import motion_executor
from yumi.api.arm_access import wait_for
from yumi.api.motion_registry import MotionRegistry
from yumi.api.robot_arm import Arm
from yumi.api.streams import OLDEST_JOG
from yumi.control.controller import CONTROLLER_IDLE_TIME
from yumi.control.controllers.joint_goal import GoalOutcome, JointGoal, StopMotion
from yumi.control.counters import WireCounters
from yumi.control.goals import CONFIGURED_DELAY, UNKNOWN_JOINTS, MemoryBuffer, SessionGoal, stream_delay, write_speeds
from yumi.control.hand_over import MOTION_BEGINS, Commander, HandOver, requested_by
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.loop_events import (
    ControllerFailed,
    ControllerReport,
    ControlProcessEnded,
    RobotStoppedFollowing,
    SessionLost,
)
from yumi.control.motion.setpoint import largest_difference
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.motion.stream_begin import FARTHEST_STREAM_BEGIN
from yumi.control.shared_state import Skew, TrajectoryFeedback
from yumi.control.tool_goal import pose_goal
from yumi.control.trajectory_commands import ArmPlan, FollowTrajectory, ResultCode, TrajectoryEnded, TrajectoryOutcome
from yumi.driver.controller_names import GOAL_CONTROLLER, JOG_CONTROLLER, STREAM_CONTROLLER, TRAJECTORY_CONTROLLER
from yumi.driver.stops import Cause
from yumi.planning.tool_path import ToolMotion
from yumi.planning.trajectory_request import JointTrajectory, plan_trajectory

RIGHT, LEFT = home(Side.RIGHT), home(Side.LEFT)
BY_NAME = dict(zip(joint_names(Side.RIGHT), RIGHT, strict=True))
PAGE, OTHER_PAGE = "a page", "another page"  # who jogs
LOST = SessionLost(Side.RIGHT, 0.08, (GOAL_CONTROLLER,))


@pytest.fixture
def robot() -> FakeRobot:
    robot = FakeRobot()
    robot.control.hand_over = HandOver(robot.clock.now)
    return robot


def test_executor_orders_both_arms_at_once(robot: FakeRobot) -> None:
    motions = robot.executor.move({Side.RIGHT: RIGHT, Side.LEFT: list(LEFT)}, 0.3, None)
    assert [(order.side, order.message) for order in robot.control.commands] == [
        (Side.RIGHT, JointGoal(RIGHT, motions[0].identity, 0.3, None)),
        (Side.LEFT, JointGoal(LEFT, motions[1].identity, 0.3, None)),
    ]


@pytest.mark.parametrize("names", [joint_names(Side.RIGHT), [f"joint_{axis}" for axis in CHAIN_AXES]])
def test_joints_by_name_are_put_in_chain_order(robot: FakeRobot, names: Sequence[str]) -> None:
    backwards = dict(reversed(list(zip(names, RIGHT, strict=True))))
    robot.executor.move({Side.RIGHT: backwards}, None, None)
    assert robot.control.commands[0].message.position == RIGHT  # type: ignore[attr-defined]


def test_joints_that_a_goal_leaves_out_stay_where_they_were_sent(robot: FakeRobot) -> None:
    robot.control.snapshots[Side.RIGHT] = robot.control.snapshots[Side.RIGHT]._replace(sent=RIGHT)
    expected = (0.1, *RIGHT[1:])
    robot.executor.move({Side.RIGHT: {"j1": 0.1}}, None, None)
    assert robot.control.commands[0].message.position == expected  # type: ignore[attr-defined]
    robot.end(robot.control.commands[0])
    robot.control.snapshots[Side.RIGHT] = robot.control.snapshots[Side.RIGHT]._replace(sent=expected)
    robot.control.on_command = robot.rest
    robot.executor.stream({Side.RIGHT: {"j1": 0.1}})
    newest = read_goal(robot.goals[Side.RIGHT], 1)
    assert newest is not None
    assert newest[1].position == expected


def test_trajectory_names_all_joints_in_each_point(robot: FakeRobot) -> None:
    with refused(CommandRefused, "trajectory_point_without_joints", joints=7):
        robot.executor.follow({Side.RIGHT: [(1.0, {"j2": 0.0})]})


def test_trajectory_takes_joints_by_name(robot: FakeRobot) -> None:
    robot.control.on_command = robot.rest
    robot.executor.follow({Side.RIGHT: [(1.0, BY_NAME, {f"j{axis}": 0.0 for axis in CHAIN_AXES})]})
    with refused(CommandRefused, "goal_joint_of_other_arm", joint="yumi_joint_1_r", arm="left", other="right"):
        robot.executor.follow({Side.LEFT: [(1.0, BY_NAME)]})


def test_motion_says_what_it_is(robot: FakeRobot) -> None:
    (motion,) = robot.executor.move({Side.RIGHT: RIGHT}, None, None)
    assert repr(motion) == f"<yumi.Motion {motion.identity} of the right arm: under way, 100%>"
    robot.end(robot.control.commands[0])
    assert repr(motion) == f"<yumi.Motion {motion.identity} of the right arm: ended>"


def test_motion_is_done_when_the_arm_stands_at_its_goal(robot: FakeRobot) -> None:
    (motion,) = robot.executor.move({Side.RIGHT: RIGHT}, None, None)
    assert not motion.is_done
    robot.end(robot.control.commands[0])
    motion.wait(0.0)
    assert motion.is_done


@pytest.mark.parametrize("outcome", [GoalOutcome.ABORTED, GoalOutcome.REPLACED, GoalOutcome.STOPPED])
def test_motion_that_ends_elsewhere_says_why(robot: FakeRobot, outcome: GoalOutcome) -> None:
    (motion,) = robot.executor.move({Side.RIGHT: RIGHT}, None, None)
    robot.end(robot.control.commands[0], outcome, "something came between")
    with refused(GoalNotReached, "goal_not_reached", arm="right"):
        motion.wait()


def test_motion_goes_on_when_no_one_waits_any_longer(robot: FakeRobot) -> None:
    (motion,) = robot.executor.move({Side.LEFT: LEFT}, None, None)
    with refused(GoalNotReached, "goal_not_reached_yet", arm="left", timeout=0.0):
        motion.wait(0.0)
    robot.end(robot.control.commands[0])
    motion.wait(0.0)


@pytest.mark.parametrize(
    ("goal", "code", "values"),
    [
        ((nan, *RIGHT[1:]), "goal_joint_not_finite", {"joint": "yumi_joint_1_r"}),
        ((*RIGHT[:6], inf), "goal_joint_not_finite", {"joint": "yumi_joint_6_r", "value": "inf"}),
        (
            (0.0, 1.0, *RIGHT[2:]),
            "goal_joint_out_of_range",
            {"joint": "yumi_joint_2_r", "position": 1.0, "lower": YUMI_LIMITS.lower[1], "upper": YUMI_LIMITS.upper[1]},
        ),
        (RIGHT[:3], "goal_joint_count_of_arm", {"count": 3, "joints": 7, "names": joint_names(Side.RIGHT)}),
        ("nowhere", "pose_name_unknown", {"name": "nowhere", "poses": ("home", "calibration", "ready")}),
        (1.0, "goal_not_angles", {"given": "1.0"}),
        (
            (0, -130, -135, 30, 0, 40, 0),
            "goal_joint_in_degrees",
            {
                "joint": "yumi_joint_2_r",
                "position": -130.0,
                "lower": YUMI_LIMITS.lower[1],
                "upper": YUMI_LIMITS.upper[1],
            },
        ),
        (
            {**BY_NAME, "elbow": 0.0},
            "goal_joint_unknown",
            {"joint": "elbow", "arm": "right", "joints": joint_names(Side.RIGHT), "count": 7},
        ),
        ({**BY_NAME, "j7": 0.0}, "goal_refused", {"reason": message("joint_named_twice", name="yumi_joint_7_r")}),
        (
            dict(zip(joint_names(Side.LEFT), LEFT, strict=True)),
            "goal_joint_of_other_arm",
            {"joint": "yumi_joint_1_l", "arm": "right", "other": "left"},
        ),
        ({**BY_NAME, "yumi_joint_2_r": nan}, "goal_joint_not_finite", {"joint": "yumi_joint_2_r"}),
        ({**BY_NAME, "yumi_joint_2_r": "up"}, "goal_not_angles", {}),
    ],
)
def test_executor_refuses_an_impossible_goal_and_asks_no_one(
    robot: FakeRobot, goal: object, code: str, values: dict[str, Any]
) -> None:
    for ask in (
        lambda: robot.executor.move({Side.LEFT: LEFT, Side.RIGHT: goal}, None, None),  # type: ignore[dict-item]
        lambda: robot.executor.stream({Side.RIGHT: goal}),  # type: ignore[dict-item]
    ):
        with refused(CommandRefused, code, **values):
            ask()
    assert robot.control.commands == robot.control.switches == []


@pytest.mark.parametrize("name", ["speed_scale", "acceleration"])
@pytest.mark.parametrize("value", [nan, 0.0, -0.5, 1.01, inf, "fast"])
def test_goal_with_an_impossible_scale_leaves_a_stream_under_way(robot: FakeRobot, name: str, value: Any) -> None:
    robot.control.on_command = robot.rest
    robot.executor.stream({Side.RIGHT: RIGHT})
    switches, commands = list(robot.control.switches), list(robot.control.commands)
    scales: dict[str, Any] = {"speed_scale": None, "acceleration": None, name: value}
    code = "goal_scale_no_number" if value == "fast" else "goal_scale_out_of_range"
    with refused(CommandRefused, code, name=name):
        robot.executor.move({Side.RIGHT: RIGHT}, **scales)
    assert (robot.control.switches, robot.control.commands) == (switches, commands)


def test_motion_that_the_fast_line_refuses_does_not_begin(robot: FakeRobot) -> None:
    robot.control.refuses = True
    with pytest.raises(CommandRefused, match="Not now"):
        robot.executor.move({Side.RIGHT: RIGHT}, None, None)
    robot.motions.note(LOST)  # there is nothing to fail


def test_arm_that_does_not_follow_is_not_moved(robot: FakeRobot) -> None:
    robot.control.snapshots[Side.LEFT] = robot.control.snapshots[Side.LEFT]._replace(is_running=False)
    with refused(RobotNotReady, "goal_refused", reason=message("arm_without_egm", arm="left")):
        robot.executor.move({Side.RIGHT: RIGHT, Side.LEFT: LEFT}, None, None)
    assert robot.control.commands == []


def test_goal_of_a_stopped_robot_is_refused_with_what_stopped_it(robot: FakeRobot) -> None:
    robot.control.snapshots[Side.LEFT] = robot.control.snapshots[Side.LEFT]._replace(is_running=False)
    robot.motions.cause = lambda: Cause((message("emergency_stop_pressed"),), "10013-1-a")
    reason = message("goal_refused", reason=message("arm_without_egm", arm="left"))
    with refused(RobotNotReady, "explained_stop", event=reason, stop="10013-1-a") as caught:
        robot.executor.move({Side.LEFT: LEFT}, None, None)
    assert caught.value.stop == "10013-1-a"


def test_arm_that_no_one_named_is_not_moved() -> None:
    robot = FakeRobot((Side.RIGHT,))
    with refused(RobotNotReady, "arm_not_named_to_connect", arm="left"):
        robot.executor.move({Side.LEFT: LEFT}, None, None)


def test_fault_ends_the_motions_of_its_arm_only(robot: FakeRobot) -> None:
    right, left = robot.executor.move({Side.RIGHT: RIGHT, Side.LEFT: LEFT}, None, None)
    robot.motions.note(LOST)
    with refused(GoalNotReached, "feedback_lost", arm="right"):
        right.wait()
    assert not left.is_done


def test_motion_that_a_stop_has_ended_says_its_cause_and_what_to_confirm(robot: FakeRobot) -> None:
    waiting: list[Callable[[Cause], None]] = []
    robot.motions.explain = waiting.append
    (motion,) = robot.executor.move({Side.RIGHT: RIGHT}, None, None)
    robot.motions.note(RobotStoppedFollowing(Side.RIGHT, (GOAL_CONTROLLER,)))
    robot.end(robot.control.commands[0], GoalOutcome.ABORTED, "the controller was deactivated")
    assert not motion.is_done
    pressed = message("event_10013", number=10013, title="Emergency stop")
    waiting[0](Cause((pressed,), "10013-7-a1b2c3"))
    with refused(GoalNotReached, "explained_stop", causes=(pressed,), stop="10013-7-a1b2c3") as end:
        motion.wait()
    assert end.value.stop == "10013-7-a1b2c3"
    with refused(RobotNotReady, "arm_waits_for_recovery", arm="right", fault=end.value.said) as refusal:
        robot.executor.move({Side.RIGHT: RIGHT}, None, None)
    assert refusal.value.stop == "10013-7-a1b2c3"


def test_cause_that_comes_after_recovery_stops_nothing(robot: FakeRobot) -> None:
    waiting: list[Callable[[Cause], None]] = []
    robot.motions.explain = waiting.append
    robot.motions.note(LOST)
    robot.motions.clear_faults()
    waiting[0](Cause((message("event_10125", number=10125, title="Program stopped"),)))
    assert robot.executor.fault(Side.RIGHT) is None


def test_end_of_egm_without_a_stop_is_not_called_one(robot: FakeRobot) -> None:
    (motion,) = robot.executor.move({Side.RIGHT: RIGHT}, None, None)
    robot.motions.note(RobotStoppedFollowing(Side.RIGHT, (GOAL_CONTROLLER,)))
    with refused(GoalNotReached, "ended_by_program"):
        motion.wait()


def test_arm_with_a_fault_waits_for_recovery(robot: FakeRobot) -> None:
    robot.motions.note(LOST)
    with refused(RobotNotReady, "arm_waits_for_recovery", arm="right", fault=LOST.said):
        robot.executor.move({Side.RIGHT: RIGHT}, None, None)
    robot.motions.clear_faults()
    assert robot.executor.move({Side.RIGHT: RIGHT}, None, None)


@pytest.mark.parametrize(
    ("event", "sides"),
    [
        (ControllerFailed(Side.LEFT, message("text", text="it broke")), [Side.LEFT]),
        (ControlProcessEnded(Side.RIGHT, 1), [Side.RIGHT]),
        (SessionLost(Side.RIGHT, 0.08, ()), []),  # an ordered end
    ],
)
def test_fault_concerns_its_arms(robot: FakeRobot, event: object, sides: list[Side]) -> None:
    robot.motions.note(event)  # type: ignore[arg-type]
    assert [side for side in Side if robot.executor.fault(side)] == sides


def test_stream_switches_once_and_then_only_puts_goals(robot: FakeRobot) -> None:
    robot.control.on_command = robot.end
    for _ in range(3):
        robot.executor.stream({Side.RIGHT: RIGHT})
    assert robot.control.switches == [Switch(Side.RIGHT, activate=(STREAM_CONTROLLER,), deactivate=(GOAL_CONTROLLER,))]
    assert read_goal(robot.goals[Side.RIGHT], 1) == (
        3,
        SessionGoal(1, robot.clock.now(), RIGHT, UNKNOWN_JOINTS, CONFIGURED_DELAY),
    )


def test_stream_gives_both_arms_the_point_for_the_same_time(robot: FakeRobot) -> None:
    robot.control.on_command = robot.end
    speeds = (0.1,) * 7
    robot.executor.stream({Side.RIGHT: RIGHT, Side.LEFT: LEFT}, {Side.LEFT: speeds}, 99.9, 0.1)
    goals = {side: read_goal(robot.goals[side], 1) for side in Side}
    assert goals[Side.RIGHT] == (1, SessionGoal(1, 99.9, RIGHT, UNKNOWN_JOINTS, 0.1))
    assert goals[Side.LEFT] == (1, SessionGoal(1, 99.9, LEFT, speeds, 0.1))


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        ({"velocities": {Side.LEFT: (0.0,) * 7}}, "stream_velocity_without_position"),
        ({"velocities": {Side.RIGHT: (0.0,) * 6}}, "stream_velocity_malformed"),
        ({"velocities": {Side.RIGHT: (nan,) * 7}}, "stream_velocity_malformed"),
        ({"time": "now"}, "stream_time_malformed"),
        ({"time": nan}, "stream_time_malformed"),
        ({"time": 94.0}, "stream_time_far"),
        ({"time": 101.5}, "stream_time_far"),
    ],
)
def test_impossible_point_of_a_stream_moves_no_arm(robot: FakeRobot, arguments: dict[str, Any], code: str) -> None:
    with refused(CommandRefused, code):
        robot.executor.stream({Side.RIGHT: RIGHT}, **arguments)
    assert robot.control.commands == robot.control.switches == []
    assert read_goal(robot.goals[Side.RIGHT], 1) == (0, None)


@pytest.mark.parametrize(
    ("tracking", "delay", "code"),
    [
        ("closely", None, "stream_tracking_unknown"),
        ("feed_forward", -0.1, "stream_delay_out_of_range"),
        ("feed_forward", 1.1, "stream_delay_out_of_range"),
        ("feed_forward", nan, "stream_delay_out_of_range"),
        ("feed_forward", "late", "stream_delay_out_of_range"),
        ("gains", 0.1, "stream_delay_out_of_range"),
    ],
)
def test_impossible_tracking_of_a_stream_is_refused(tracking: str, delay: Any, code: str) -> None:
    with refused(CommandRefused, code):
        stream_delay(tracking, delay)


def test_tracking_of_a_stream_says_its_delay() -> None:
    assert (stream_delay(), stream_delay("feed_forward", 0), isnan(stream_delay("gains"))) == (
        CONFIGURED_DELAY,
        0.0,
        True,
    )


def test_end_of_a_stream_brakes_the_arm_that_nothing_else_commands(robot: FakeRobot) -> None:
    robot.control.on_command = robot.end
    robot.executor.stream({Side.RIGHT: RIGHT})
    robot.control.commands.clear()
    robot.executor.end_stream(Side.LEFT, None)
    robot.executor.end_stream(Side.RIGHT, "another client")
    with requested_by(Commander.STREAM, "another client"):
        robot.clock.advance(
            1.1 * CONTROLLER_IDLE_TIME
        )  # nobody commands the arm now, but who takes it over with the same controller
        robot.control.hand_over.take(Side.RIGHT, Commander.STREAM)
        robot.executor.end_stream(Side.RIGHT, None)
    assert robot.control.commands == []
    robot.clock.advance(1.1 * CONTROLLER_IDLE_TIME)
    robot.executor.end_stream(Side.RIGHT, None)
    assert robot.control.hand_over.of(Side.RIGHT).who is Commander.NONE
    assert [(each.side, type(each.message)) for each in robot.control.commands] == [(Side.RIGHT, StopMotion)]


FAR = joints([value + 0.2 for value in LEFT])


def points(robot: FakeRobot) -> dict[Side, SessionGoal | None]:
    """The newest of each arm."""
    return {side: read_goal(robot.goals[side], 1)[1] for side in Side}


def test_stream_that_begins_elsewhere_with_one_arm_moves_neither_and_says_how_far(robot: FakeRobot) -> None:
    with refused(
        CommandRefused, "stream_begins_elsewhere", arm="left", distance=pytest.approx(0.2), most=FARTHEST_STREAM_BEGIN
    ):
        robot.executor.stream({Side.RIGHT: RIGHT, Side.LEFT: FAR})
    assert robot.control.commands == robot.control.switches == []
    assert points(robot) == {Side.RIGHT: None, Side.LEFT: None}
    assert robot.control.hand_over.of(Side.RIGHT).who is Commander.NONE


@pytest.mark.parametrize("commanded", [Side.RIGHT, Side.LEFT])
def test_point_for_an_arm_that_another_one_commands_is_taken_by_neither(robot: FakeRobot, commanded: Side) -> None:
    robot.control.on_command = robot.end
    both = {Side.RIGHT: RIGHT, Side.LEFT: LEFT}
    robot.executor.stream(both, time=100.0)
    with requested_by(Commander.HEADSET, "person"):
        robot.control.hand_over.take(commanded, Commander.HEADSET)
    with refused(CommandRefused, "arm_commanded_by_another", arm=commanded.word, who="headset"):
        robot.executor.stream(both, time=100.1)
    assert [goal is not None and goal.time for goal in points(robot).values()] == [100.0, 100.0]
    with requested_by(client="person"):
        robot.control.hand_over.let_go(commanded)
    with refused(CommandRefused, "arm_reserved_for_person", arm=commanded.word):
        robot.executor.stream(both, time=100.2)


def test_stream_with_stamps_and_velocities_is_blended_by_its_stamps(robot: FakeRobot) -> None:
    robot.control.on_command = robot.end
    speeds = joints([0.1] * 7)
    for time in (100.0, 100.5, 101.0):
        robot.executor.stream({Side.LEFT: FAR}, {Side.LEFT: speeds}, time, 0.2, blend=1.0)
        goal = points(robot)[Side.LEFT]
        assert goal is not None
        assert (goal.time, goal.delay) == (time, 0.2)
        share = time - 100.0
        fades = 1.875 * 0.2 if share == 0.5 else 0.0  # [rad/s] of the way that is left, in the middle
        way = (1.0 - share) * 0.2
        assert goal.position == pytest.approx([value - way for value in FAR])
        assert goal.velocity == pytest.approx([0.1 + fades] * 7)


def test_blend_of_a_stream_for_the_future_begins_with_its_first_point(robot: FakeRobot) -> None:
    robot.control.on_command = robot.end
    for time, left in ((100.5, 0.2), (100.7, 0.1), (100.9, 0.0)):
        robot.executor.stream({Side.LEFT: FAR}, time=time, blend=0.4)
        goal = points(robot)[Side.LEFT]
        assert goal is not None
        assert goal.position == pytest.approx([value - left for value in FAR])
        robot.clock.advance(0.2)


def test_stream_that_is_late_leaves_the_blend_of_the_one_that_has_taken_its_arm(
    robot: FakeRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot.control.on_command = robot.rest
    switching = robot.control.hand_over.switching

    @contextmanager
    def late(sides: Collection[Side]) -> Iterator[None]:
        with switching(sides):
            yield
        monkeypatch.undo()
        robot.clock.advance(CONTROLLER_IDLE_TIME + 0.1)
        with requested_by(client="other"):
            robot.executor.stream({Side.RIGHT: FAR}, blend=1.0)

    monkeypatch.setattr(robot.control.hand_over, "switching", late)
    with refused(CommandRefused, "arm_commanded_by_another"):
        robot.executor.stream({Side.RIGHT: RIGHT})
    robot.clock.advance(0.01)
    with requested_by(client="other"):
        robot.executor.stream({Side.RIGHT: FAR})
    newest = read_goal(robot.goals[Side.RIGHT], 1)
    assert newest is not None
    assert (
        largest_difference(newest[1].position, robot.control.snapshots[Side.RIGHT].sent) < 0.1 * FARTHEST_STREAM_BEGIN
    )


@pytest.mark.parametrize("who", [Commander.PAGE, Commander.STREAM])
def test_program_that_ends_stops_no_arm_that_another_one_has_taken_meanwhile(robot: FakeRobot, who: Commander) -> None:
    motions = robot.executor.move({Side.RIGHT: RIGHT, Side.LEFT: LEFT}, None, None)
    robot.clock.advance(MOTION_BEGINS + 0.1)
    with requested_by(who, "other"):
        robot.control.hand_over.take(Side.RIGHT, who)
    robot.control.on_command = robot.rest
    with refused(GoalNotReached, "goal_not_reached_in_time", arms=("right", "left")):
        wait_for(motions, 0.0, robot.executor)
    assert [each.side for each in robot.control.commands if isinstance(each.message, StopMotion)] == [Side.LEFT]


@pytest.mark.parametrize("requester", [None, "person"])
def test_program_that_ends_stops_an_arm_that_none_commands_any_more(robot: FakeRobot, requester: str | None) -> None:
    """A person has taken the arm, but not ended the motion: its take-over has failed."""
    motions = robot.executor.move({Side.RIGHT: RIGHT}, None, None)
    with requested_by(Commander.DEVICE, "person"):
        robot.control.hand_over.take(Side.RIGHT, Commander.DEVICE)
        robot.control.hand_over.let_go(Side.RIGHT)
    robot.control.on_command = robot.rest
    with requested_by(client=requester), refused(GoalNotReached, "goal_not_reached_in_time"):
        wait_for(motions, 0.0, robot.executor)
    assert [each.side for each in robot.control.commands if isinstance(each.message, StopMotion)] == [Side.RIGHT]


def test_point_that_comes_long_after_the_last_one_begins_a_stream(robot: FakeRobot) -> None:
    robot.control.on_command = robot.end
    robot.executor.stream({Side.LEFT: LEFT})
    robot.clock.advance(0.9 * CONTROLLER_IDLE_TIME)
    robot.executor.stream({Side.LEFT: FAR})  # the same stream jumps
    robot.clock.advance(1.1 * CONTROLLER_IDLE_TIME)
    with refused(CommandRefused, "stream_begins_elsewhere"):
        robot.executor.stream({Side.LEFT: FAR})
    switches = len(robot.control.switches)
    assert not robot.executor.stream({Side.LEFT: FAR}, blend=1.0)
    assert len(robot.control.switches) == switches
    goal = points(robot)[Side.LEFT]
    assert goal is not None
    assert goal.position == pytest.approx(LEFT)


@pytest.mark.parametrize("blend", [0.0, -1.0, 10.1, nan, "slowly"])
def test_impossible_blend_is_refused(robot: FakeRobot, blend: Any) -> None:
    with refused(CommandRefused, "blend_out_of_range", longest=10.0):
        robot.executor.stream({Side.LEFT: FAR}, blend=blend)
    assert robot.control.switches == []


def test_stream_takes_the_arm_back_after_a_goal(robot: FakeRobot) -> None:
    robot.control.on_command = robot.end
    robot.executor.stream({Side.RIGHT: RIGHT})
    robot.executor.move({Side.RIGHT: RIGHT}, None, None)
    robot.executor.stream({Side.RIGHT: RIGHT})
    assert [switch.activate for switch in robot.control.switches] == [
        (STREAM_CONTROLLER,),
        (GOAL_CONTROLLER,),
        (STREAM_CONTROLLER,),
    ]


def test_stream_begins_when_the_motion_before_it_has_ended(robot: FakeRobot) -> None:
    robot.executor.move({Side.RIGHT: RIGHT}, None, None)
    robot.control.on_command = robot.end
    robot.executor.stream({Side.RIGHT: RIGHT})
    assert isinstance(robot.control.commands[-1].message, StopMotion)


def test_stop_ends_a_stream_and_is_a_motion_itself(robot: FakeRobot) -> None:
    robot.control.on_command = robot.end
    robot.executor.stream({Side.LEFT: LEFT})
    (motion,) = robot.executor.stop((Side.LEFT,))
    assert robot.control.commands[-1].message == StopMotion(motion.identity)
    assert robot.control.switches[-1].activate == (GOAL_CONTROLLER,)
    motion.wait(0.0)


def test_arm_that_no_one_commands_needs_no_stop(robot: FakeRobot) -> None:
    robot.control.snapshots[Side.LEFT] = robot.control.snapshots[Side.LEFT]._replace(activation=0)
    assert robot.executor.stop((Side.LEFT,)) == ()


def test_numbers_of_any_kind_are_a_goal(robot: FakeRobot) -> None:
    class Number:
        def __float__(self) -> float:
            return 0.0

    robot.executor.move({Side.RIGHT: [Number(), *RIGHT[1:]]}, None, None)
    assert robot.control.commands[0].message.position == RIGHT  # type: ignore[attr-defined]


def test_both_arms_follow_from_the_same_moment_on(robot: FakeRobot) -> None:
    robot.control.on_command = robot.rest
    robot.executor.follow({Side.RIGHT: [(1.0, RIGHT)], Side.LEFT: [(1.0, LEFT, [0.0] * 7)]})
    plans = [order.message.plan for order in robot.control.commands if isinstance(order.message, FollowTrajectory)]
    assert [(plan.side, plan.start) for plan in plans] == [(Side.RIGHT, 100.1), (Side.LEFT, 100.1)]


@pytest.mark.parametrize("change", [{"wire": WireCounters(session=2)}, {"activation": 9}])
def test_a_path_planned_before_a_stop_is_not_followed_after_it(
    robot: FakeRobot, change: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    robot.control.on_command = robot.rest

    def plan(*_: object) -> Mapping[Side, ArmPlan]:
        before = robot.control.snapshots[Side.RIGHT]
        robot.control.snapshots[Side.RIGHT] = before._replace(**change)
        points = (TrajectoryPoint(1.0, RIGHT),)
        return plan_trajectory(JointTrajectory(joint_names(Side.RIGHT), points), (Side.RIGHT,), YUMI_LIMITS)

    monkeypatch.setattr(motion_executor, "plan_tool_motions", plan)
    with refused(CommandRefused, "goal_refused", reason=message("interrupted_while_planned", arm="right")):
        robot.executor.follow_path({Side.RIGHT: ToolMotion(Pose((0.0, 0.0, 0.0), IDENTITY_QUATERNION), ())})
    assert not any(isinstance(each.message, FollowTrajectory) for each in robot.control.commands)


@pytest.mark.parametrize(
    ("outcome", "is_reached"),
    [(TrajectoryOutcome.SUCCEEDED, True), (TrajectoryOutcome.ABORTED, False), (TrajectoryOutcome.CANCELED, False)],
)
def test_trajectory_ends_as_its_controller_says(robot: FakeRobot, outcome: TrajectoryOutcome, is_reached: bool) -> None:
    robot.control.on_command = robot.rest
    (motion,) = robot.executor.follow({Side.RIGHT: [(1.0, RIGHT)]})
    notice = TrajectoryEnded(motion.identity, outcome, ResultCode.SUCCESSFUL, "It is over.")
    robot.motions.note(ControllerReport(Side.RIGHT, TRAJECTORY_CONTROLLER, notice))
    assert (motion.future.exception() is None) is is_reached
    if not is_reached:
        error = motion.future.exception()
        assert isinstance(error, GoalNotReached)
        assert_says(error.said, "goal_not_reached", arm="right")


def test_motion_that_the_limiter_holds_says_which_parts_and_offers_a_planned_path(robot: FakeRobot) -> None:
    robot.control.on_command = robot.rest
    (motion,) = robot.executor.follow({Side.RIGHT: [(1.0, RIGHT)]})
    robot.control.snapshots[Side.RIGHT] = robot.control.snapshots[Side.RIGHT]._replace(
        limited_part="right gripper", limited_other="body", limited_distance=0.062
    )
    notice = TrajectoryEnded(
        motion.identity, TrajectoryOutcome.ABORTED, ResultCode.GOAL_TOLERANCE_VIOLATED, "It is late."
    )
    robot.motions.note(ControllerReport(Side.RIGHT, TRAJECTORY_CONTROLLER, notice))
    limited = message("parts_not_compared", part="right gripper", other="body", distance=0.062)
    with refused(GoalNotReached, "goal_not_reached_limited", arm="right", limited=limited) as refusal:
        motion.wait()
    assert "retreat" in {each.value for each in refusal.value.said.actions}


@pytest.mark.parametrize(
    ("points", "code", "values"),
    [
        ([], "trajectory_without_points", {}),
        ([(1.0, "no number")] * 20_001, "trajectory_too_long", {"points": 20_001, "most": 20_000}),
        ([(1.0, RIGHT[:6])], "point_value_count", {"point": 1, "count": 6, "quantity": "positions", "joints": 7}),
        ([(1.0, RIGHT), (0.5, RIGHT)], "trajectory_times_not_increasing", {"time": 0.5, "time_before": 1.0}),
        ([(0.001, RIGHT), (0.002, (1.0, *RIGHT[1:]))], "trajectory_beyond_limit", {}),
        ([RIGHT], "trajectory_points_malformed", {}),
        ([(1.0, RIGHT, RIGHT, RIGHT, RIGHT)], "trajectory_points_malformed", {}),
        (3.0, "trajectory_points_malformed", {}),
    ],
)
def test_impossible_trajectory_is_refused_and_no_one_asked(
    robot: FakeRobot, points: object, code: str, values: dict[str, Any]
) -> None:
    with refused(CommandRefused, code, **values):
        robot.executor.follow({Side.LEFT: [(1.0, LEFT)], Side.RIGHT: points})  # type: ignore[dict-item]
    assert robot.control.commands == robot.control.switches == []


def test_motion_knows_how_far_it_is(robot: FakeRobot) -> None:
    begin = robot.control.snapshots[Side.RIGHT]
    goal = (RIGHT[0] + 1.0, *RIGHT[1:])
    robot.control.snapshots[Side.RIGHT] = begin._replace(sent=RIGHT)
    (motion,) = robot.executor.move({Side.RIGHT: goal}, 0.5, 0.5)
    whole = motion.remaining
    assert motion.progress == 0.0
    robot.control.snapshots[Side.RIGHT] = begin._replace(position=(RIGHT[0] + 0.5, *RIGHT[1:]))
    half = motion.remaining
    assert motion.progress == pytest.approx(0.5)
    assert whole is not None
    assert half == pytest.approx(whole / 2.0, abs=1e-3)  # up and down take equally long
    robot.end(robot.control.commands[0])
    assert (motion.progress, motion.remaining) == (1.0, 0.0)


def test_motion_takes_longer_when_the_speed_is_scaled_down(robot: FakeRobot) -> None:
    robot.control.snapshots[Side.RIGHT] = robot.control.snapshots[Side.RIGHT]._replace(sent=RIGHT)
    (motion,) = robot.executor.move({Side.RIGHT: (RIGHT[0] + 1.0, *RIGHT[1:])}, None, None)
    before = motion.remaining
    robot.speed_scale = 0.1
    assert before is not None
    assert motion.remaining == pytest.approx(10.0 * before)


def test_motion_that_is_watched_asks_the_control_process_for_nothing(
    robot: FakeRobot, monkeypatch: pytest.MonkeyPatch
) -> None:
    (motion,) = robot.executor.move({Side.RIGHT: (RIGHT[0] + 1.0, *RIGHT[1:])}, None, None)
    monkeypatch.setattr(robot.control, "call", None)
    way = motion.way
    assert (way.progress, way.remaining) == (motion.progress, motion.remaining)
    assert way.remaining is not None


def test_arm_on_a_trajectory_moves_however_slowly(robot: FakeRobot) -> None:
    now = 100.0

    def show(buffer: MemoryBuffer, number: int, time: float) -> bool:
        buffer.write(
            TrajectoryFeedback(
                number, time, 1.0, 1.0, Skew(), RIGHT, ZERO_JOINTS, RIGHT, ZERO_JOINTS, RIGHT, ZERO_JOINTS, 0.02
            )
        )
        return robot.executor.is_moving(Side.RIGHT)

    assert not robot.executor.is_moving(Side.RIGHT)
    for buffer in (robot.feedback[Side.RIGHT], robot.dual_feedback[Side.RIGHT]):
        assert show(buffer, 7, now - 1.0)
        assert not robot.executor.is_moving(Side.LEFT)
        assert not show(buffer, 7, now - 2.0)  # its controller was deactivated
        assert not show(buffer, 0, now)


def test_trajectory_knows_how_far_it_is(robot: FakeRobot) -> None:
    robot.control.on_command = robot.rest
    (motion,) = robot.executor.follow({Side.RIGHT: [(4.0, RIGHT)]})
    assert (motion.progress, motion.remaining) == (0.0, None)  # the controller has not begun
    feedback = TrajectoryFeedback(
        motion.identity, 0.0, 1.0, 0.5, Skew(), RIGHT, ZERO_JOINTS, RIGHT, ZERO_JOINTS, RIGHT, ZERO_JOINTS, 0.02
    )
    robot.feedback[Side.RIGHT].write(feedback)
    assert (motion.progress, motion.remaining) == (0.25, 6.0)


def test_motion_that_ended_elsewhere_stays_as_far_as_it_was(robot: FakeRobot) -> None:
    begin = robot.control.snapshots[Side.RIGHT]
    robot.control.snapshots[Side.RIGHT] = begin._replace(sent=RIGHT)
    (motion,) = robot.executor.move({Side.RIGHT: (RIGHT[0] + 1.0, *RIGHT[1:])}, None, None)
    robot.control.snapshots[Side.RIGHT] = begin._replace(position=(RIGHT[0] + 0.3, *RIGHT[1:]))
    assert motion.progress == pytest.approx(0.3)
    robot.end(robot.control.commands[0], GoalOutcome.STOPPED)
    assert motion.progress == pytest.approx(0.3)
    assert motion.remaining == 0.0


def test_pose_is_reached_by_its_name(robot: FakeRobot) -> None:
    robot.executor.move(dict.fromkeys(Side, "ready"), None, None)
    right, left = (command.message.position for command in robot.control.commands)  # type: ignore[attr-defined]
    assert (right[0], left[0]) == (-left[0], -right[0])  # mirrored
    assert (right[1], right[3:]) == (left[1], left[3:])


def test_driver_with_ros_keeps_no_fault_and_logs_nothing(caplog: pytest.LogCaptureFixture) -> None:
    motions = MotionRegistry(is_script=False)
    motion = motions.begin(Side.RIGHT)
    motions.note(LOST)
    with refused(GoalNotReached, "feedback_lost"):
        motion.wait()
    assert (motions.fault(Side.RIGHT), caplog.text) == (None, "")


@pytest.mark.parametrize("is_script", [True, False])
def test_motions_are_counted_from_one_for_those_who_read_the_log(is_script: bool) -> None:
    motions = MotionRegistry(is_script=is_script)
    assert [motions.begin(Side.RIGHT).identity for _ in range(3)] == [1, 2, 3]


def test_jog_does_not_end_a_motion_that_began_since_the_last_one(robot: FakeRobot) -> None:
    robot.control.on_command = robot.rest
    twist = (0.1, *ZERO_JOINTS[1:])
    tool = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    for _ in range(2):
        robot.executor.jog_tool(Side.RIGHT, twist, tool, PAGE, is_in_tool=False)
    written = robot.tool_goals[Side.RIGHT].read()
    robot.motions.begin(Side.RIGHT)  # as a line does, by the same controller
    with refused(CommandRefused, "jog_while_moving", arm="right"):
        robot.executor.jog_tool(Side.RIGHT, twist, tool, PAGE, is_in_tool=False)
    assert robot.tool_goals[Side.RIGHT].read() == written


def test_velocity_of_a_tool_has_the_time_at_which_it_was_asked_for(robot: FakeRobot) -> None:
    """Its controller may take it later, as where the arm is held first, and must not take an old one for new."""
    robot.control.on_command = robot.rest
    twist = (0.1, *ZERO_JOINTS[1:])
    tool = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    for _ in range(2):
        robot.executor.jog_tool(Side.RIGHT, twist, tool, PAGE, is_in_tool=False)
    robot.clock.advance(0.05)
    robot.executor.jog_tool(Side.RIGHT, twist, tool, PAGE, is_in_tool=False)
    jogged = robot.tool_goals[Side.RIGHT].read()
    assert jogged is not None
    assert jogged[1].time == robot.clock.now()
    robot.clock.advance(0.05)
    Arm(Side.LEFT, lambda: robot.executor, None).servo_twist((0.1, 0.0, 0.0))  # type: ignore[arg-type]
    streamed = robot.tool_goals[Side.LEFT].read()
    assert streamed is not None
    assert streamed[1].time == robot.clock.now()


def test_poses_of_a_stream_go_on_near_the_tool_after_a_person_has_led_it(robot: FakeRobot) -> None:
    robot.control.on_command = robot.rest
    robot.control.snapshots[Side.RIGHT] = robot.control.snapshots[Side.RIGHT]._replace(sent=RIGHT)
    here, goals = tool0_to_body(Side.RIGHT, RIGHT), robot.tool_goals[Side.RIGHT]

    def follow(up: float) -> None:
        x, y, z = here.position
        robot.executor.stream_tool(
            Side.RIGHT, lambda session: pose_goal(session, Pose((x, y, z + up), here.orientation))
        )

    def count() -> int:
        newest = goals.read()
        return newest[0] if newest else 0

    follow(0.3)  # a stream begins anywhere
    assert count() == 1
    with requested_by(Commander.PAGE, "person", "page"):
        robot.control.hand_over.take(Side.RIGHT, Commander.PAGE)
        robot.control.hand_over.let_go(Side.RIGHT)
    robot.control.hand_over.give_back((Side.RIGHT,))
    with refused(CommandRefused, "tool_stream_begins_elsewhere", arm="right", distance=0.3):
        follow(0.3)
    assert count() == 1
    follows = robot.control.snapshots[Side.RIGHT]
    robot.control.snapshots[Side.RIGHT] = follows._replace(is_running=False)  # where it was sent says nothing then
    with refused(RobotNotReady, "goal_refused"):
        follow(0.3)
    robot.control.snapshots[Side.RIGHT] = follows
    for number, up in enumerate((0.05, 0.3), 2):
        follow(up)
        assert count() == number


def jog_joints(robot: FakeRobot, values: Joints, time: float | None = None) -> bool:
    return robot.executor.jog(Side.RIGHT, values, PAGE, time)


def jog_tool(robot: FakeRobot, values: Joints, time: float | None = None) -> bool:
    return robot.executor.jog_tool(
        Side.RIGHT, values, Pose((0.0, 0.0, 0.0), IDENTITY_QUATERNION), PAGE, time, is_in_tool=False
    )


def newest_jog(robot: FakeRobot, jog: Callable[..., bool]) -> tuple[Joints, float]:
    """Its speeds, or its velocity of the tool, and when it was asked for [s]."""
    newest = robot.speeds[Side.RIGHT].read() if jog is jog_joints else robot.tool_goals[Side.RIGHT].read()
    assert newest is not None
    return newest[1].velocity if jog is jog_joints else newest[1].twist, newest[1].time


JOGS = pytest.mark.parametrize("jog", [jog_joints, jog_tool])


@JOGS
def test_jog_reaches_its_controller_with_the_time_at_which_it_was_asked_for(
    robot: FakeRobot, jog: Callable[..., bool]
) -> None:
    robot.control.on_command = robot.rest
    fast, now = (0.1, *ZERO_JOINTS[1:]), robot.clock.now()
    jog(robot, fast)
    for given, expected in ((None, now), (now - 0.08, now - 0.08), (now + 5.0, now)):  # a time to come is now
        jog(robot, fast, given)
        assert newest_jog(robot, jog) == (fast, expected)


@JOGS
@pytest.mark.parametrize("age", [OLDEST_JOG + 0.01, 3.0, nan])
def test_jog_that_was_asked_for_too_long_ago_is_refused_unless_the_arm_is_to_stand(
    robot: FakeRobot, jog: Callable[..., bool], age: float
) -> None:
    robot.control.on_command = robot.rest
    now = robot.clock.now()
    for speed in (0.1, 0.2):
        jog(robot, (speed, *ZERO_JOINTS[1:]))
    with refused(CommandRefused, "jog_too_old", age=age):
        jog(robot, (0.3, *ZERO_JOINTS[1:]), now - age)
    assert newest_jog(robot, jog)[0][0] == 0.2
    jog(robot, ZERO_JOINTS, now - age)
    assert newest_jog(robot, jog) == (ZERO_JOINTS, now)


@JOGS
def test_jog_that_has_waited_for_the_arm_is_refused(
    robot: FakeRobot, jog: Callable[..., bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    robot.control.on_command = robot.rest
    fast, take_all = (0.1, *ZERO_JOINTS[1:]), robot.control.hand_over.take_all
    for _ in range(2):
        jog(robot, fast)
    written = newest_jog(robot, jog)

    def take_late(*arguments: Any) -> frozenset[Side]:
        robot.clock.advance(0.15)
        return take_all(*arguments)

    monkeypatch.setattr(robot.control.hand_over, "take_all", take_late)
    with refused(CommandRefused, "jog_too_old"):
        jog(robot, fast, robot.clock.now())
    assert newest_jog(robot, jog) == written


def test_first_jog_takes_the_arm_over_and_the_next_one_moves_it(robot: FakeRobot) -> None:
    robot.control.on_command = robot.rest
    speeds = (0.1, *ZERO_JOINTS[1:])
    assert robot.executor.jog(Side.RIGHT, speeds, PAGE)
    assert robot.speeds[Side.RIGHT].read() is None  # the key may have been let go meanwhile
    assert not robot.executor.jog(Side.RIGHT, speeds, PAGE)
    newest = robot.speeds[Side.RIGHT].read()
    assert newest is not None
    assert newest[1].velocity == speeds


def test_jog_ends_when_its_client_asks_no_more_and_leaves_what_others_command(robot: FakeRobot) -> None:
    robot.control.on_command = robot.rest
    speeds = (0.1, *ZERO_JOINTS[1:])
    for _ in range(2):
        robot.executor.jog(Side.RIGHT, speeds, PAGE)
    robot.executor.end_jog(Side.RIGHT, PAGE)
    newest = robot.speeds[Side.RIGHT].read()
    assert newest is not None
    assert newest[1].velocity == ZERO_JOINTS
    robot.executor.jog(Side.RIGHT, speeds, PAGE)
    robot.executor.move({Side.RIGHT: RIGHT}, None, None)
    written = robot.speeds[Side.RIGHT].read()
    robot.executor.end_jog(Side.RIGHT, PAGE)
    assert robot.speeds[Side.RIGHT].read() == written


def test_jog_is_refused_while_another_program_streams_to_the_same_controller(robot: FakeRobot) -> None:
    robot.control.on_command = robot.rest
    speeds, other = (0.1, *ZERO_JOINTS[1:]), (0.0, 0.2, *ZERO_JOINTS[2:])
    for _ in range(2):
        robot.executor.jog(Side.RIGHT, speeds, PAGE)
    write_speeds(robot.speeds[Side.RIGHT], 1, other)  # as a ROS topic does
    with refused(CommandRefused, "jog_streamed_by_another", controller=JOG_CONTROLLER, arm="right"):
        robot.executor.jog(Side.RIGHT, speeds, PAGE)
    robot.executor.end_jog(Side.RIGHT, PAGE)
    newest = robot.speeds[Side.RIGHT].read()
    assert newest is not None
    assert newest[1].velocity == other


def test_jog_takes_over_no_arm_that_another_program_moves_by_the_same_controller(robot: FakeRobot) -> None:
    robot.control.call(Commands.switch_controllers, Side.RIGHT, (JOG_CONTROLLER,), (GOAL_CONTROLLER,))
    moving = robot.control.snapshots[Side.RIGHT]._replace(velocity=(0.3, *ZERO_JOINTS[1:]))
    robot.control.snapshots[Side.RIGHT] = moving
    with refused(CommandRefused, "jog_while_moving", arm="right"):
        robot.executor.jog(Side.RIGHT, (0.1, *ZERO_JOINTS[1:]), PAGE)


def test_jog_does_not_take_an_arm_back_that_another_program_has_taken_while_a_key_is_held(robot: FakeRobot) -> None:
    robot.control.on_command = robot.rest
    speeds = (0.1, *ZERO_JOINTS[1:])
    for _ in range(2):
        robot.executor.jog(Side.RIGHT, speeds, PAGE)
    robot.control.call(Commands.switch_controllers, Side.RIGHT, (TRAJECTORY_CONTROLLER,), (JOG_CONTROLLER,))
    with refused(CommandRefused, "jog_switched_by_another", arm="right"):
        robot.executor.jog(Side.RIGHT, speeds, PAGE)
    assert robot.control.switches[-1].activate == (TRAJECTORY_CONTROLLER,)
    robot.executor.jog(Side.RIGHT, speeds, PAGE)  # the key is pressed again
    assert robot.control.switches[-1].activate == (JOG_CONTROLLER,)


def test_arm_that_one_client_jogs_is_jogged_and_stopped_by_no_other_one(robot: FakeRobot) -> None:
    robot.control.on_command = robot.rest
    speeds, others = (0.1, *ZERO_JOINTS[1:]), (0.0, 0.2, *ZERO_JOINTS[2:])
    tool = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
    robot.executor.jog(Side.RIGHT, speeds, PAGE)
    with refused(CommandRefused, "jogged_by_another", arm="right"):  # also before it moves
        robot.executor.jog(Side.RIGHT, others, OTHER_PAGE)
    robot.executor.jog(Side.RIGHT, speeds, PAGE)
    written, switches = robot.speeds[Side.RIGHT].read(), list(robot.control.switches)
    with refused(CommandRefused, "jogged_by_another", arm="right"):
        robot.executor.jog(Side.RIGHT, others, OTHER_PAGE)
    with refused(CommandRefused, "jogged_by_another", arm="right"):
        robot.executor.jog_tool(Side.RIGHT, others, tool, OTHER_PAGE, is_in_tool=False)
    robot.executor.end_jog(Side.RIGHT, OTHER_PAGE)
    assert (robot.speeds[Side.RIGHT].read(), robot.control.switches) == (written, switches)
    robot.executor.jog(Side.LEFT, others, OTHER_PAGE)
    robot.executor.jog(Side.RIGHT, speeds, PAGE)


@pytest.mark.parametrize("is_ended", [True, False])
def test_arm_is_free_for_the_next_client_when_a_jog_has_ended_or_comes_no_more(
    robot: FakeRobot, *, is_ended: bool
) -> None:
    robot.control.on_command = robot.rest
    speeds, others = (0.1, *ZERO_JOINTS[1:]), (0.0, 0.2, *ZERO_JOINTS[2:])
    for _ in range(2):
        robot.executor.jog(Side.RIGHT, speeds, PAGE)
    if is_ended:
        robot.executor.end_jog(Side.RIGHT, PAGE)
    else:
        robot.clock.advance(0.31)
    robot.executor.jog(Side.RIGHT, others, OTHER_PAGE)
    robot.executor.end_jog(Side.RIGHT, PAGE)  # late: it is not its jog any more
    newest = robot.speeds[Side.RIGHT].read()
    assert newest is not None
    assert newest[1].velocity == others


def test_jog_ends_while_another_one_waits_for_its_arm_to_come_to_rest(robot: FakeRobot) -> None:
    robot.control.on_command = robot.rest
    for _ in range(2):
        robot.executor.jog(Side.LEFT, (0.1, *ZERO_JOINTS[1:]), PAGE)
    waits, is_stopped = Event(), Event()
    ended: list[bool] = []

    def rest_late(command: ControllerCommand) -> None:
        waits.set()
        ended.append(is_stopped.wait(2.0))
        robot.rest(command)

    robot.control.on_command = rest_late
    with ThreadPoolExecutor(2) as others:
        taking = others.submit(robot.executor.jog, Side.RIGHT, (0.1, *ZERO_JOINTS[1:]), PAGE)
        assert waits.wait(2.0)
        for side in Side:
            robot.executor.end_jog(side, PAGE)
        is_stopped.set()
        assert taking.result()
    newest = robot.speeds[Side.LEFT].read()
    assert newest is not None
    assert (newest[1].velocity, ended) == (ZERO_JOINTS, [True])


def test_trajectory_from_elsewhere_than_where_it_was_planned_is_refused(robot: FakeRobot) -> None:
    robot.control.on_command = robot.rest
    start = {side: home(side) for side in Side}
    away = {**start, Side.LEFT: (home(Side.LEFT)[0] + 0.03, *home(Side.LEFT)[1:])}
    points = [(0.0, home(Side.RIGHT)), (1.0, home(Side.RIGHT))]
    with refused(CommandRefused, "arm_moved_since_plan", arm="left", distance=0.03):
        robot.executor.follow({Side.RIGHT: points}, away)
    assert robot.control.commands == []
    robot.executor.follow({Side.RIGHT: points}, start)
    assert isinstance(robot.control.commands[-1].message, FollowTrajectory)


@pytest.mark.parametrize("unknown", Side)
def test_plan_is_refused_while_egm_does_not_report_where_an_arm_is(robot: FakeRobot, unknown: Side) -> None:
    robot.control.on_command = robot.rest
    off = robot.control.snapshots[unknown]._replace(is_streaming=False, is_running=False, activation=0)
    robot.control.snapshots[unknown] = off  # with the last position that was streamed: a person may have led it away
    points = [(0.0, home(Side.RIGHT)), (1.0, home(Side.RIGHT))]
    with refused(RobotNotReady, "plan_without_position", arm=unknown.word):
        robot.executor.follow({Side.RIGHT: points}, {side: home(side) for side in Side})
    assert robot.control.commands == []


def test_motion_that_is_not_wanted_any_more_is_not_sent(robot: FakeRobot) -> None:
    def gone() -> None:
        raise RobotNotReady("Who asked for it is gone.")

    with pytest.raises(RobotNotReady, match="is gone"):
        robot.executor.move({Side.RIGHT: RIGHT}, None, None, check=gone)
    assert robot.control.commands == []
    assert not robot.motions.is_open(Side.RIGHT)
