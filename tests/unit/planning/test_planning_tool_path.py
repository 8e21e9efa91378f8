"""Lines of the tool: planned within all limits, rounded at corners, with the elbow where it is wanted."""

from __future__ import annotations

from math import nan

import numpy as np
import pytest

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.inverse_kinematics import Unreachable, arm_angle
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Pose, Side, joints
from abb_protocols.robot.kinematics import quaternion_of, quaternion_product, tool0_to_body
from cartesian_bench import deviation, shares
from refusals import refused
from unit.robot.test_robot_kinematics import rad
from yumi.control.motion.spline import SplineSampler, TrajectoryPoint
from yumi.control.trajectory_commands import ArmPlan
from yumi.planning.common_time import stretched
from yumi.planning.smoothing import smooth_spline_through
from yumi.planning.tool_path import LineWaypoint, ToolPath, plan_path

START = rad((20, -90, -110, 10, 30, 60, 10))
HERE = tool0_to_body(Side.RIGHT, START)


def moved(x: float, y: float, z: float, turn: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Pose:
    place = tuple(a + b for a, b in zip(HERE.position, (x, y, z), strict=True))
    return Pose((place[0], place[1], place[2]), quaternion_product(HERE.orientation, quaternion_of(turn)))


def sampled(plan: ArmPlan) -> np.ndarray:
    walk = SplineSampler(plan.spline)
    count = int(plan.spline.end / CYCLE) + 4
    rows = [walk.position(number * CYCLE) for number in range(-3, count)]
    return np.array(rows)


def test_a_line_is_straight_and_keeps_all_limits() -> None:
    goal = moved(0.1, -0.15, 0.1, (0.2, 0.1, 0.0))
    plan = plan_path(Side.RIGHT, START, [LineWaypoint(goal)], YUMI_LIMITS)
    positions = sampled(plan)
    off = deviation(Side.RIGHT, positions, HERE, goal)
    assert off.position < 1e-6
    assert off.orientation < 1e-6
    assert off.elbow < 1e-6
    assert max(shares(positions)) < 0.95
    end = tool0_to_body(Side.RIGHT, plan.spline.last.position)
    assert end.position == pytest.approx(goal.position, abs=1e-9)


def test_a_line_takes_the_time_its_speed_gives_and_little_more() -> None:
    length = 0.2062
    slow = plan_path(Side.RIGHT, START, [LineWaypoint(moved(0.1, -0.15, 0.1))], YUMI_LIMITS, speed=0.05)
    assert slow.spline.end == pytest.approx(length / 0.05, abs=0.3)
    fast = plan_path(Side.RIGHT, START, [LineWaypoint(moved(0.1, -0.15, 0.1))], YUMI_LIMITS, speed=0.25)
    assert fast.spline.end < length / 0.25 + 0.4


def test_the_elbow_turns_evenly_to_the_arm_angle() -> None:
    begin = arm_angle(Side.RIGHT, START)
    goal = LineWaypoint(moved(0.05, -0.05, 0.0), begin + 0.3)
    plan = plan_path(Side.RIGHT, START, [goal], YUMI_LIMITS)
    assert arm_angle(Side.RIGHT, plan.spline.last.position) == pytest.approx(begin + 0.3, abs=1e-9)


def test_a_tool_is_what_moves_straight() -> None:
    tool = Pose((0.02, 0.0, 0.15), quaternion_of((0.0, 0.3, 0.0)))
    begin = tool0_to_body(Side.RIGHT, START, tool)
    x, y, z = begin.position
    goal = Pose((x, y - 0.1, z), quaternion_product(begin.orientation, quaternion_of((0.0, 0.0, 0.5))))
    plan = plan_path(Side.RIGHT, START, [LineWaypoint(goal)], YUMI_LIMITS, tool=tool)
    assert deviation(Side.RIGHT, sampled(plan), begin, goal, tool).position < 1e-6


def test_corners_are_rounded_within_their_zone() -> None:
    corner, goal = moved(0.0, -0.1, 0.0), moved(0.0, -0.1, 0.1)
    plan = plan_path(Side.RIGHT, START, [LineWaypoint(corner), LineWaypoint(goal)], YUMI_LIMITS, zone=0.02)
    positions = sampled(plan)
    places = np.array([tool0_to_body(Side.RIGHT, joints(row.tolist())).position for row in positions])
    nearest = np.min(np.linalg.norm(places - corner.position, axis=1))
    assert 0.004 < nearest < 0.02
    assert max(shares(positions)) < 0.95
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / CYCLE
    in_corner = speeds[int(np.argmin(np.linalg.norm(places[:-1] - corner.position, axis=1)))]
    assert in_corner > 0.05  # no stop


def test_a_line_through_axes_in_line_slows_down() -> None:
    start = rad((-35, -80, -100, 40, 60, 25, -40))
    begin = tool0_to_body(Side.RIGHT, start)
    x, y, z = begin.position
    goal = Pose((x + 0.05, y - 0.1, z), begin.orientation)
    plan = plan_path(Side.RIGHT, start, [LineWaypoint(goal)], YUMI_LIMITS)
    positions = sampled(plan)
    assert max(shares(positions)) < 0.95
    assert deviation(Side.RIGHT, positions, begin, goal).position < 1e-5


def test_a_line_out_of_reach_is_refused_with_the_place() -> None:
    with refused(Unreachable, "path_unreachable", arm="right") as caught:
        plan_path(Side.RIGHT, START, [LineWaypoint(moved(0.6, -0.6, 0.0))], YUMI_LIMITS)
    values = caught.value.said.values
    assert 0.0 < values["share"] < 1.0
    place = [HERE.position[0] + 0.6 * values["share"], HERE.position[1] - 0.6 * values["share"], HERE.position[2]]
    assert [values["x"], values["y"], values["z"]] == pytest.approx(place, abs=1e-6)
    assert values["reason"].code in {"arm_stretched_out", "joint_leaves_range"}


@pytest.mark.parametrize(
    ("waypoints", "options", "code", "values"),
    [
        ([], {}, "path_without_poses", {}),
        ([LineWaypoint(moved(nan, 0, 0))], {}, "pose_not_finite", {"pose": "pose 1"}),
        ([LineWaypoint(moved(100, 0, 0))], {}, "pose_too_far", {"pose": "pose 1", "farthest": 3.0}),
        (
            [LineWaypoint(Pose((0.3, 0.0, 0.3), (2.0, 0.0, 0.0, 0.0)))],
            {},
            "pose_not_unit",
            {"pose": "pose 1", "length": 2.0},
        ),
        ([LineWaypoint(moved(0.1, 0, 0), nan)], {}, "path_angle_not_finite", {"pose": 1, "angle": "nan"}),
        (
            [LineWaypoint(moved(0.1, 0, 0))],
            {"speed": 2.0},
            "path_value_out_of_range",
            {"name": "speed", "value": 2.0, "lowest": 0.0001, "highest": 1.5, "unit": "m/s"},
        ),
        ([LineWaypoint(moved(0.1, 0, 0))], {"speed": nan}, "path_value_out_of_range", {"name": "speed"}),
        (
            [LineWaypoint(moved(0.1, 0, 0))],
            {"acceleration": 0.0},
            "path_value_out_of_range",
            {"name": "acceleration", "value": 0.0},
        ),
    ],
)
def test_what_is_no_path_is_refused(
    waypoints: list[LineWaypoint], options: dict[str, float], code: str, values: dict[str, object]
) -> None:
    with refused(CommandRefused, code, **values):
        plan_path(Side.RIGHT, START, waypoints, YUMI_LIMITS, **options)


def test_a_path_that_goes_nowhere_is_over_at_once() -> None:
    plan = plan_path(Side.RIGHT, START, [LineWaypoint(HERE)], YUMI_LIMITS)
    assert plan.spline.end == 0.0


def test_the_velocity_of_a_path_is_its_rate_of_change() -> None:
    path = ToolPath(
        [LineWaypoint(HERE, 0.1), LineWaypoint(moved(0, -0.1, 0, (0.3, 0, 0)), 0.2), LineWaypoint(moved(0.1, -0.1, 0))],
        speed=0.25,
        turning=1.0,
        zone=0.02,
    )
    for parameter in np.linspace(0.01, path.length - 0.01, 40).tolist():
        at, before, after = (path.at(parameter + offset) for offset in (0.0, -1e-6, 1e-6))
        velocity = np.subtract(after.tool.position, before.tool.position) / 2e-6
        assert at.velocity == pytest.approx(velocity, abs=1e-6)
        w, x, y, z = before.tool.orientation
        turn = quaternion_product(after.tool.orientation, (w, -x, -y, -z))
        assert np.array(turn[1:]) / 1e-6 == pytest.approx(np.array(at.rotation), abs=1e-6)
        assert at.turning == pytest.approx((after.angle - before.angle) / 2e-6, abs=1e-6)


def test_a_smooth_spline_has_no_jumps() -> None:
    def point(time: float, value: float) -> TrajectoryPoint:
        return TrajectoryPoint(time, (value,) * 7)

    points = [point(0.0, 0.0), point(0.1, 0.05), point(0.25, 0.02), point(0.3, 0.1)]
    spline = smooth_spline_through(points, (0.2,) * 7)
    walk = SplineSampler(spline)
    assert walk.motion(0.0)[1][0] == pytest.approx(0.2)
    assert walk.motion(0.3)[1][0] == 0.0
    for knot in points[1:-1]:
        early, late = walk.setpoint(knot.time - 1e-9), walk.setpoint(knot.time + 1e-9)
        assert early.position[0] == pytest.approx(knot.position[0], abs=1e-8)
        assert early.velocity[0] == pytest.approx(late.velocity[0], abs=1e-6)
        assert early.acceleration[0] == pytest.approx(late.acceleration[0], abs=1e-5)


def test_a_stretched_plan_is_the_same_way() -> None:
    plan = plan_path(Side.RIGHT, START, [LineWaypoint(moved(0.05, -0.1, 0.0))], YUMI_LIMITS)
    longer = stretched(plan, 2.0 * plan.spline.end)
    own, other = SplineSampler(plan.spline), SplineSampler(longer.spline)
    for time in np.linspace(0.0, plan.spline.end, 17).tolist():
        expected: Joints = own.position(time)
        assert other.position(2.0 * time) == pytest.approx(expected, abs=1e-9)
