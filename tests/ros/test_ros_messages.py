"""ROS messages to values and back, and the stamps of both clocks."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from math import nan
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import msgspec
import pytest
from builtin_interfaces.msg import Duration
from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTolerance
from rclpy.qos import qos_profile_services_default
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from yumi_interfaces import srv

from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused, TrajectoryRefused
from abb_protocols.robot.joints import YUMI_LIMITS, ZERO_JOINTS, Side, joint_names
from abb_runtime.clock import ManualClock
from refusals import refused
from yumi.control.controller import State
from yumi.control.controller_info import ControllerInfo
from yumi.control.manager.controller_manager import ControllerManager
from yumi.control.trajectory_commands import Tolerances
from yumi.driver.commands import offered_to
from yumi.planning.trajectory_request import MOST_POINTS, plan_trajectory
from yumi.ros import messages
from yumi.ros.trajectory_messages import stamp_of, tolerances_of, trajectory_of

pytestmark = pytest.mark.ros


def test_page_says_how_many_requests_a_service_of_ours_keeps() -> None:
    page = (Path(__file__).parents[2] / "docs/reference/ros-interface.md").read_text(encoding="utf-8")
    assert f"- A service keeps {qos_profile_services_default.depth} requests that wait" in page


def test_message_of_an_older_installation_is_filled_as_far_as_it_goes() -> None:
    older = SimpleNamespace(ok=False)
    assert messages.filled_message(older, ok=True, message="done") == SimpleNamespace(ok=True)


@pytest.mark.parametrize(("state", "number"), [(state, number) for number, state in enumerate(State, start=1)])
def test_state_is_reported_by_id_and_label_and_found_by_either(state: State, number: int) -> None:
    told = messages.lifecycle_state(state)
    assert (told.id, told.label) == (number, state.value)
    assert messages.lifecycle_of_ros_message(told) is state
    assert messages.lifecycle_of_ros_message(SimpleNamespace(id=0, label=state.value)) is state


@pytest.mark.parametrize(("number", "label"), [(0, ""), (0, "Active"), (10, "configuring")])
def test_what_is_no_state_to_be_in_is_refused(number: int, label: str) -> None:
    choices = "1 unconfigured, 2 inactive, 3 active, 4 finalized"
    with refused(CommandRefused, "state_not_primary", number=number, label=label, choices=choices):
        messages.lifecycle_of_ros_message(SimpleNamespace(id=number, label=label))


@pytest.mark.parametrize("state", list(State))
def test_controller_reports_what_it_requires_only_once_it_is_configured(state: State) -> None:
    info = ControllerInfo("one", "tests/One", state, ("a/position",), (), ("a/velocity",))
    told = messages.controller_state(info)
    wanted = ["a/position"] if state in {State.INACTIVE, State.ACTIVE} else []
    assert list(told.required_command_interfaces) == wanted
    assert bool(told.required_state_interfaces) is bool(wanted)


FIRST = joint_names(Side.RIGHT)[0]


@pytest.mark.parametrize(
    ("fields", "remark"),
    [
        ({"path_tolerance": [JointTolerance(name="elbow")]}, "'elbow' is not a joint of this controller"),
        (
            {"goal_tolerance": [JointTolerance(name=FIRST, position=-0.5)]},
            f"a tolerance of {FIRST} is negative; -1 is unlimited",
        ),
        ({"goal_time_tolerance": Duration(sec=-2)}, "goal_time_tolerance is -2 s; -1 is unlimited"),
    ],
)
def test_tolerances_that_cannot_be_leave_the_controllers_own_and_say_why(fields: dict[str, Any], remark: str) -> None:
    good = JointTolerance(name=FIRST, position=0.1)
    goal = FollowJointTrajectory.Goal(**{"goal_tolerance": [good], **fields})
    assert tolerances_of(goal, [Side.RIGHT]) == ({Side.RIGHT: Tolerances()}, remark)


@pytest.mark.parametrize("field", ["position", "velocity", "acceleration"])
@pytest.mark.parametrize("which", ["path_tolerance", "goal_tolerance"])
def test_tolerance_that_is_nan_is_refused(which: str, field: str) -> None:
    goal = FollowJointTrajectory.Goal(**{which: [JointTolerance(name=FIRST, **{field: nan})]})
    with refused(TrajectoryRefused, "joint_tolerance_not_a_number", joint=FIRST):
        tolerances_of(goal, [Side.RIGHT])


def test_trajectory_of_too_many_points_is_refused_before_they_are_read() -> None:
    trajectory = JointTrajectory(joint_names=[FIRST], points=[JointTrajectoryPoint(effort=[1.0])] * (MOST_POINTS + 1))
    with refused(TrajectoryRefused, "trajectory_too_long", points=20001, most=20000):
        trajectory_of(trajectory)


def test_points_with_efforts_are_refused() -> None:
    trajectory = JointTrajectory(joint_names=[FIRST], points=[JointTrajectoryPoint(positions=[0.0], effort=[1.0])])
    with refused(TrajectoryRefused, "trajectory_with_efforts"):
        trajectory_of(trajectory)


EPOCH = 1_700_000_000_000_000_000


class RosClock:
    """Runs with the monotonic clock, and can be set."""

    def __init__(self, clock: ManualClock) -> None:
        self.offset = EPOCH
        self.interruption = 0.0
        self._clock = clock

    def now(self) -> int:
        self._clock.advance(self.interruption)
        return self.offset + round(self._clock.now() * 1e9)


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def ros_clock(clock: ManualClock) -> RosClock:
    return RosClock(clock)


def test_stamp_is_the_ros_time_of_a_moment_past(clock: ManualClock, ros_clock: RosClock) -> None:
    stamps = messages.Stamps(ros_clock.now, clock.now)
    clock.advance(2.0)
    assert stamps.at(1.5) == EPOCH + 1_500_000_000


def test_stamps_keep_their_distance_when_reading_the_clocks_is_interrupted(
    clock: ManualClock, ros_clock: RosClock
) -> None:
    stamps = messages.Stamps(ros_clock.now, clock.now)
    first = stamps.at(0.0)
    clock.advance(0.004)
    ros_clock.interruption = 0.003
    assert stamps.at(0.004) - first == pytest.approx(4_000_000, abs=5_000)


def test_stamps_follow_a_clock_that_was_set(clock: ManualClock, ros_clock: RosClock) -> None:
    stamps = messages.Stamps(ros_clock.now, clock.now)
    first = stamps.at(0.0)
    ros_clock.offset += 10**9
    assert stamps.at(0.0) - first == 10**9


@pytest.mark.parametrize("nanosec", [1_000_000_000, 4_294_967_295])
def test_time_with_more_nanoseconds_than_a_second_is_refused(nanosec: int) -> None:
    def refuses(name: str) -> AbstractContextManager[object]:
        return refused(
            CommandRefused, "nanoseconds_out_of_range", name=f"Trajectory refused: {name}", nanoseconds=nanosec
        )

    point, late = JointTrajectoryPoint(positions=[0.0] * 7), JointTrajectoryPoint(positions=[0.0] * 7)
    late.time_from_start = Duration(sec=1, nanosec=nanosec)
    with refuses("time_from_start of point 2"):
        trajectory_of(JointTrajectory(points=[point, late]))
    goal = FollowJointTrajectory.Goal(goal_time_tolerance=Duration(nanosec=nanosec))
    with refuses("goal_time_tolerance"):
        tolerances_of(goal, [Side.RIGHT])
    message = JointTrajectory()
    message.header.stamp.nanosec = nanosec
    with refuses("header.stamp"):
        stamp_of(message)


def test_time_is_a_duration_of_seconds_and_nanoseconds() -> None:
    assert messages.seconds(Duration(sec=-1, nanosec=0), "") == -1.0
    assert messages.seconds(Duration(sec=-1, nanosec=250_000_000), "") == -0.75
    assert messages.nanoseconds(Duration(sec=2, nanosec=999_999_999), "") == 2_999_999_999


LONG = "x" * 1_000_000


@pytest.mark.parametrize(
    "refuse",
    [
        lambda: messages.goal_of_ros_message(JointState(name=[LONG], position=[0.0]), Side.RIGHT, ZERO_JOINTS),
        lambda: messages.side_of_ros_message(LONG),
        lambda: messages.mode_of(LONG),
        lambda: messages.lifecycle_of_ros_message(SimpleNamespace(id=9, label=LONG)),
        lambda: plan_trajectory(trajectory_of(JointTrajectory(joint_names=[LONG])), [Side.RIGHT], YUMI_LIMITS),
        lambda: ControllerManager(joint_names(Side.RIGHT), {}, "ROB_R").load_kind(LONG, LONG),
    ],
)
def test_name_of_a_million_characters_is_cut_in_the_refusal(refuse: Callable[[], object]) -> None:
    with pytest.raises(CommandRefused, match=f"'{'x' * 79}…") as refusal:
        refuse()
    assert len(str(refusal.value)) < 500


def test_tolerance_of_a_joint_with_a_name_of_a_million_characters_is_cut_in_the_remark() -> None:
    goal = FollowJointTrajectory.Goal(path_tolerance=[JointTolerance(name=LONG)])
    _, remark = tolerances_of(goal, [Side.RIGHT])
    assert remark == f"'{'x' * 79}… is not a joint of this controller"


def test_every_service_has_a_type_with_its_arguments() -> None:
    for kind in offered_to(FrontEnd.ROS):
        required = {each.name for each in msgspec.structs.fields(kind) if each.required}
        if kind.method() not in {"set_mode", "recover"}:  # actions
            known = getattr(srv, kind.__name__).Request.get_fields_and_field_types() if required else {}
            assert required <= {*known}, kind
