"""Lines and streams of the tool under the limiter, with the virtual robot, in virtual time."""

from __future__ import annotations

from collections.abc import Iterator
from math import degrees, hypot, pi, radians, sin

import numpy as np
import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.inverse_kinematics import Unreachable, arm_angle
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ZERO_JOINTS, Pose, Side, Vector, joints
from abb_protocols.robot.kinematics import quaternion_of, quaternion_product, rotation_vector, tool0_to_body
from cartesian_bench import NAME, CartesianBench, deviation, shares
from refusals import assert_says, refused
from soak import long, short, tell
from trajectories import sent_beside_speeds
from unit.robot.test_robot_kinematics import rad
from yumi.control.goals import MemoryBuffer
from yumi.control.loop_events import ControllerReport
from yumi.control.speed_scale import SpeedFactor, SpeedScale
from yumi.control.tool_goal import ToolGoal, pose_goal, twist_goal
from yumi.control.tool_limits import ToolLimits, Wall
from yumi.control.trajectory_commands import ArmPlan, CancelTrajectory, FollowTrajectory, TrajectoryOutcome
from yumi.planning.tool_path import LineWaypoint, plan_path

POSTURE = rad((20, -90, -110, 10, 30, 60, 10))
LIMITS = YUMI_LIMITS.slowed_to(radians(180.0))  # as EGM's MaxSpeedDeviation leaves them
LIMIT = 1.0 + 1e-5  # the last digits of differences


def lines(count: int, seed: int) -> Iterator[tuple[Side, ArmPlan, Pose, Pose]]:
    """Lines of 0.2 to 0.4 m at 0.25 m/s; every second one through the neighbourhood of axes in line."""
    generator = np.random.default_rng(seed)
    lower, upper = 0.85 * np.array(YUMI_LIMITS.lower), 0.85 * np.array(YUMI_LIMITS.upper)
    found = 0
    while found < count:
        side = tuple(Side)[found % 2]
        middle = generator.uniform(lower, upper)
        if found % 4 < 2:
            # The wrist's axes (a5 = 0), or the shoulder's (a2 = 0), are nearly in line halfway.
            middle[[5, 1][found // 4 % 2]] = generator.choice([-0.03, -0.01, 1e-3, 1e-4])
        position = joints(middle.tolist())
        pose = tool0_to_body(side, position)
        way = generator.normal(size=3)
        way *= generator.uniform(0.1, 0.2) / np.linalg.norm(way)
        turn = quaternion_of(tuple((generator.normal(size=3) * 0.1).tolist()))  # type: ignore[arg-type]
        x, y, z = (np.array(pose.position) - way).tolist()
        begin = Pose((x, y, z), pose.orientation)
        x, y, z = (np.array(pose.position) + way).tolist()
        end = Pose((x, y, z), quaternion_product(pose.orientation, turn))
        try:
            back = plan_path(side, position, [LineWaypoint(begin, arm_angle(side, position))], LIMITS)
            start = back.spline.last.position
            here = tool0_to_body(side, start)
            plan = plan_path(side, start, [LineWaypoint(end, arm_angle(side, start))], LIMITS)
        except Unreachable:
            continue
        found += 1
        yield side, plan, here, end


@pytest.mark.parametrize("count", [short(3), long(200, 1800.0)])
def test_lines_are_straight_and_no_joint_is_beyond_its_limits(count: int) -> None:
    worst = [0.0] * 4
    for number, (side, plan, begin, end) in enumerate(lines(count, 15000), 1):
        bench = CartesianBench(side, plan.first.position)
        before = len(bench.rig.cycles)
        assert bench.follow(plan).outcome is TrajectoryOutcome.SUCCEEDED
        bench.rig.run(0.1)
        commanded = deviation(side, bench.sent[before:], begin, end)
        executed = deviation(side, bench.measured[before:], begin, end)
        where = (side, plan.first.position, end)
        assert commanded.position < 0.2e-3, where
        assert executed.position < 0.5e-3, where
        assert max(commanded.orientation, executed.orientation) < radians(0.1), where
        assert max(commanded.elbow, executed.elbow) < radians(1.0), where
        assert max(shares(bench.sent[before - 3 :])) < LIMIT, where
        assert bench.rig.snapshot.limiter.slowed == 0, where
        worst = [
            max(worst[0], commanded.position),
            max(worst[1], executed.position),
            max(worst[2], commanded.orientation, executed.orientation),
            max(worst[3], commanded.elbow, executed.elbow),
        ]
        if count > 3 and number % 10 == 0:
            tell(
                f"{number} lines: off by at most {worst[0] * 1e3:.3f} mm commanded, {worst[1] * 1e3:.3f} mm executed, "
                f"{degrees(worst[2]):.4f} degrees of orientation, {degrees(worst[3]):.4f} of the elbow"
            )


def test_a_line_slows_down_with_the_speed_scale() -> None:
    factor = MemoryBuffer[SpeedFactor]()
    factor.write(SpeedFactor(0.5))
    bench = CartesianBench(Side.RIGHT, POSTURE, SpeedScale(factor))
    begin = tool0_to_body(Side.RIGHT, bench.start)
    x, y, z = begin.position
    end = Pose((x, y - 0.1, z), begin.orientation)
    plan = plan_path(Side.RIGHT, bench.start, [LineWaypoint(end)], LIMITS)
    before = bench.rig.clock.now()
    assert bench.follow(plan).outcome is TrajectoryOutcome.SUCCEEDED
    assert bench.rig.clock.now() - before == pytest.approx(2.0 * plan.spline.end, abs=0.3)
    assert deviation(Side.RIGHT, bench.measured, begin, end).position < 0.2e-3


def jittered(period: float, seed: int) -> list[float]:
    """Times of a stream for 2 s whose messages come up to a third of a period early or late; some are lost."""
    generator = np.random.default_rng(seed)
    times = np.arange(0.0, 2.0, period)
    times = times + generator.uniform(-0.3, 0.3, len(times)) * period
    return sorted(times[generator.uniform(size=len(times)) > 0.05].tolist())


@pytest.mark.parametrize("rate", [10.0, 50.0, 250.0])
def test_a_stream_of_velocities_is_smooth_and_stops_in_time(rate: float) -> None:
    bench = CartesianBench(Side.RIGHT, POSTURE)
    bench.rig.manager.set_parameters("cartesian_controller", {"twist.timeout": 0.3 if rate < 20.0 else 0.1})
    times, begin = jittered(1.0 / rate, 7), len(bench.rig.cycles)

    def next_goal(now: float) -> ToolGoal | None:
        due = [times.pop(0) for _ in range(len(times)) if times and times[0] <= now]
        twist = (0.05 * sin(2.0 * now), -0.08, 0.04, 0.0, 0.1, 0.2, 0.0)
        return twist_goal(0, twist) if due else None

    bench.stream(2.0, next_goal)
    bench.stream(1.0, lambda now: None)
    sent = bench.sent[begin - 3 :]
    assert max(shares(sent)) < LIMIT
    assert bench.rig.snapshot.limiter.slowed == 0
    moves = np.max(np.abs(np.diff(sent, axis=0)) / CYCLE, axis=1)
    stopped = (np.nonzero(moves > 0.01)[0][-1] - 3) * CYCLE
    assert stopped < 2.0 + (0.3 if rate < 20.0 else 0.1) + 0.35  # the timeout, and braking within the limits


@pytest.mark.parametrize("seed", [17, 18, 19])
def test_an_arm_that_a_velocity_has_led_to_a_singularity_stands_when_it_ends(seed: int) -> None:
    generator = np.random.default_rng(seed)
    position = generator.uniform(0.8 * np.array(YUMI_LIMITS.lower), 0.8 * np.array(YUMI_LIMITS.upper))
    position[[1, 5]] = 0.001, -0.01
    bench = CartesianBench(Side.RIGHT, joints(position.tolist()))
    twist = joints((0.2 * generator.normal(size=7)).tolist())
    bench.stream(1.0, lambda now: twist_goal(0, twist))
    bench.stream(1.5, lambda now: None)
    assert np.max(np.ptp(bench.sent[-50:], axis=0)) < 1e-9


@pytest.mark.parametrize("frame", ["base", "tool"])
def test_a_velocity_is_seen_from_its_frame(frame: str) -> None:
    bench = CartesianBench(Side.RIGHT, POSTURE)
    is_in_tool = frame == "tool"
    begin = tool0_to_body(Side.RIGHT, bench.start)
    bench.stream(1.0, lambda now: twist_goal(0, (0.0, 0.0, -0.05, 0.0, 0.0, 0.0, 0.0), is_in_tool=is_in_tool))
    end = tool0_to_body(Side.RIGHT, joints(bench.sent[-1].tolist()))
    way = np.subtract(end.position, begin.position)
    axis = np.array(begin.orientation)
    w, x, y, z = axis
    tool_z = np.array([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])
    expected = -tool_z if is_in_tool else np.array([0.0, 0.0, -1.0])
    assert way / np.linalg.norm(way) == pytest.approx(expected, abs=0.01)
    assert hypot(*way) == pytest.approx(0.05, rel=0.1)
    assert end.orientation == pytest.approx(begin.orientation, abs=1e-3)


@pytest.mark.parametrize(("rate", "lag"), [(10.0, 0.06), (50.0, 0.02), (250.0, 0.012)])
def test_a_stream_of_poses_is_followed_with_little_lag(rate: float, lag: float) -> None:
    bench = CartesianBench(Side.RIGHT, POSTURE)
    begin = tool0_to_body(Side.RIGHT, bench.start)
    x, y, z = begin.position
    times, first = jittered(1.0 / rate, 8), len(bench.rig.cycles)

    def pose(time: float) -> Pose:
        turn = quaternion_of((0.0, 0.0, 0.1 * (1.0 - np.cos(2.0 * time))))
        return Pose((x, y - 0.05 * (1.0 - np.cos(2.0 * time)), z), quaternion_product(begin.orientation, turn))

    def next_goal(now: float) -> ToolGoal | None:
        due = [times.pop(0) for _ in range(len(times)) if times and times[0] <= now]
        return pose_goal(0, pose(now)) if due else None

    bench.stream(2.0, next_goal)
    bench.stream(0.5, lambda now: None)
    assert max(shares(bench.sent[first - 3 :])) < LIMIT
    assert bench.rig.snapshot.limiter.slowed == 0
    places = np.array([tool0_to_body(Side.RIGHT, joints(row.tolist())).position[1] for row in bench.measured[first:]])
    middle = places[round(0.8 / CYCLE) : round(1.9 / CYCLE)]
    now = np.arange(len(places))[round(0.8 / CYCLE) : round(1.9 / CYCLE)] * CYCLE

    def error(delay: float) -> float:
        return float(np.mean((middle - [pose(time - delay).position[1] for time in now]) ** 2))

    found = min(np.arange(-0.1, 0.2, 0.002).tolist(), key=error)
    assert abs(found) < lag
    assert error(found) ** 0.5 < 2e-3


def test_a_stream_beyond_reach_slides_along_its_end() -> None:
    bench = CartesianBench(Side.RIGHT, POSTURE)
    first = len(bench.rig.cycles)
    bench.stream(4.0, lambda now: twist_goal(0, (0.15, -0.15, 0.1, 0.0, 0.0, 0.0, 0.0)))
    bench.stream(2.0, lambda now: twist_goal(0, (-0.15, 0.15, -0.1, 0.0, 0.0, 0.0, 0.0)))
    assert max(shares(bench.sent[first - 3 :])) < LIMIT
    assert all(YUMI_LIMITS.outside(cycle.sent.position) is None for cycle in bench.rig.cycles)
    places = np.array([tool0_to_body(Side.RIGHT, joints(row.tolist())).position for row in bench.sent[first:]])
    assert float(np.max(np.linalg.norm(np.diff(places, axis=0), axis=1))) / CYCLE < 0.5  # the tool's limit
    out, back = places[round(4.0 / CYCLE) - 1], places[-1]
    assert (out - places[0]) @ (1.0, -1.0, 0.6) > 0.05
    assert (back - out) @ (-1.0, 1.0, -0.6) > 0.05  # it does not stay there


@pytest.mark.parametrize("tilt", [0.0, 0.15])
def test_a_tool_that_a_stream_has_turned_once_round_stays_turned(tilt: float) -> None:
    bench = CartesianBench(Side.RIGHT, rad((20, -90, -110, 10, 30, 60, -200)))
    begin = tool0_to_body(Side.RIGHT, bench.start)

    def turned(now: float) -> ToolGoal:
        angle = 2.0 * pi * min(1.0, now / 4.5)
        turn = quaternion_product(quaternion_of((tilt * sin(angle), 0.0, 0.0)), quaternion_of((0.0, 0.0, angle)))
        return pose_goal(0, Pose(begin.position, quaternion_product(begin.orientation, turn)))

    before = len(bench.rig.cycles)
    bench.stream(7.0, turned)
    sent = bench.sent[before - 3 :]
    assert sent[-1][6] == pytest.approx(radians(160.0), abs=0.02)
    assert np.max(np.abs(sent[-1] - sent[-500])) < 0.01
    speeds = np.diff(sent[100:1000, 6]) / CYCLE
    assert np.max(speeds) - np.min(speeds) < 0.05 + 3.0 * tilt
    assert np.max(np.abs(np.diff(sent[100:1000], 2, axis=0))) / CYCLE**2 < 0.5 + 10.0 * tilt  # nothing jerks it
    assert max(shares(sent)) < LIMIT


@pytest.mark.parametrize("pause", [0.02, 0.04, 0.06, 0.08])
def test_a_velocity_that_comes_while_its_jog_brakes_leads_on_without_a_jerk(pause: float) -> None:
    """As when messages of a page were late: the arm goes on as it is commanded, and stands in time at its end."""
    bench = CartesianBench(Side.RIGHT, POSTURE)

    def brake() -> None:
        bench.rig.manager.receive(NAME, CancelTrajectory(), bench.rig.line.state)

    upwards = twist_goal(0, (0.0, 0.0, 0.15, *ZERO_JOINTS[3:]))
    bench.stream(0.3, lambda time: upwards)
    brake()
    bench.stream(pause, lambda time: None)
    bench.stream(0.1, lambda time: upwards)
    brake()
    bench.stream(0.2, lambda time: None)
    followed = [(cycle.desired.position, cycle.sent.position) for cycle in bench.rig.cycles if cycle.desired]
    sent = sent_beside_speeds([desired for desired, _ in followed])
    assert np.array([each for _, each in followed]) == pytest.approx(np.array(sent))
    assert np.max(np.abs(np.diff(bench.measured, axis=0)[-1])) / CYCLE < 0.01


def test_a_stream_replaces_a_line_and_a_line_a_stream() -> None:
    bench = CartesianBench(Side.RIGHT, POSTURE)
    begin = tool0_to_body(Side.RIGHT, bench.start)
    x, y, z = begin.position
    plan = plan_path(Side.RIGHT, bench.start, [LineWaypoint(Pose((x, y - 0.15, z), begin.orientation))], LIMITS)
    first = len(bench.rig.cycles)
    bench.rig.manager.receive("cartesian_controller", FollowTrajectory(plan, 5), bench.rig.line.state)
    bench.rig.run(0.5)
    bench.stream(0.5, lambda now: twist_goal(0, (0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 0.0)))
    assert bench.ended[0].outcome is TrajectoryOutcome.ABORTED
    assert_says(bench.ended[0].said, "motion_replaced_by_stream")
    bench.rig.run(1.5)
    assert bench.rig.snapshot.velocity == pytest.approx(ZERO_JOINTS, abs=0.01)
    again = plan_path(Side.RIGHT, bench.start, [LineWaypoint(begin)], LIMITS)
    bench.rig.manager.receive("cartesian_controller", FollowTrajectory(again, 6), bench.rig.line.state)
    bench.rig.run_until(lambda: len(bench.ended) > 1, again.spline.end + 2.0)
    assert bench.ended[1].outcome is TrajectoryOutcome.SUCCEEDED
    assert max(shares(bench.sent[first - 3 :])) < LIMIT


@pytest.mark.parametrize(("is_twist_first", "most"), [(False, 0.01), (True, 0.12)])  # [rad/s]; poses begin at rest
def test_a_tool_turns_on_about_the_same_axis_when_a_stream_changes_its_kind(is_twist_first: bool, most: float) -> None:
    bench = CartesianBench(Side.RIGHT, POSTURE)
    start = tool0_to_body(Side.RIGHT, bench.start)
    spin = (0.3, 0.2, -0.1)  # of the tool, seen from the body [rad/s]
    kinds = [
        lambda time: pose_goal(
            0, Pose(start.position, quaternion_product(quaternion_of(spin, time), start.orientation))
        ),
        lambda time: twist_goal(0, (0.0, 0.0, 0.0, *spin, 0.0)),
    ]
    first, second = reversed(kinds) if is_twist_first else kinds
    bench.stream(1.2, first)
    seen = len(bench.sent)
    # What comes next goes on where the stream of poses is, or begins where the tool of the velocities is.
    here = tool0_to_body(Side.RIGHT, joints(bench.sent[-1].tolist()))

    def on(time: float) -> ToolGoal:
        return pose_goal(
            0, Pose(here.position, quaternion_product(quaternion_of(spin, time + CYCLE), here.orientation))
        )

    bench.stream(0.25, on if is_twist_first else second)
    rows = bench.sent[seen - 10 :]
    turns = [tool0_to_body(Side.RIGHT, joints(row.tolist())).orientation for row in rows]
    rates = []
    for before, after in zip(turns[:-5], turns[5:], strict=True):
        w, x, y, z = before
        rates.append(np.array(rotation_vector(quaternion_product(after, (w, -x, -y, -z)))) / (5 * CYCLE))
    across = [np.linalg.norm(rate - (rate @ spin) / np.dot(spin, spin) * np.array(spin)) for rate in rates]
    assert max(across) < most


def wall_before(place: Vector, room: float, way: Vector) -> Wall:
    """A wall so far from a place in a direction [m]."""
    x, y, z = (each / hypot(*way) for each in way)
    px, py, pz = place
    return Wall("window", (px + room * x, py + room * y, pz + room * z), (-x, -y, -z))


def places(positions: np.ndarray) -> np.ndarray:
    return np.array([tool0_to_body(Side.RIGHT, joints(each.tolist())).position for each in positions])


ASIDE, ASKEW, DOWN = (0.0, -1.0, 0.0), (1.0, -2.0, 0.7), (0.0, 0.0, -1.0)


@pytest.mark.parametrize(
    ("kind", "way", "speed"),
    [
        ("twist", ASIDE, 0.1),
        ("twist", ASKEW, 0.3),
        ("twist", DOWN, 0.5),
        ("pose", ASIDE, 0.3),
        ("pose", ASKEW, 0.5),
        ("pose", DOWN, 0.1),
        ("far pose", ASIDE, 0.5),
        ("far pose", ASKEW, 0.1),
        ("far pose", DOWN, 0.3),
    ],
)
def test_a_stream_stays_behind_a_wall_and_slides_along_it(kind: str, way: Vector, speed: float) -> None:
    begin = tool0_to_body(Side.RIGHT, POSTURE)
    wall = wall_before(begin.position, 0.05, way)
    bench = CartesianBench(Side.RIGHT, POSTURE, within=ToolLimits(walls=(wall,)))
    ahead = np.array(way) / np.linalg.norm(way)
    aside = np.cross(ahead, (0.3, 0.2, 0.9))
    aside /= np.linalg.norm(aside)

    def goal(now: float) -> ToolGoal:
        if kind == "twist":
            return twist_goal(0, (*(speed * ahead + 0.05 * aside).tolist(), 0.0, 0.0, 0.0, 0.0))  # type: ignore[arg-type]
        run = min(speed * now, 0.2) if kind == "pose" else 0.2
        x, y, z = (np.array(begin.position) + run * ahead + 0.05 * now * aside).tolist()
        return pose_goal(0, Pose((x, y, z), begin.orientation))

    first = len(bench.rig.cycles)
    bench.stream(1.5, goal)
    sent, measured = places(bench.sent[first:]), places(bench.measured[first:])
    rooms = [wall.distance(place) for place in sent]
    assert min(rooms) > 0.0
    assert min(wall.distance(place) for place in measured) > -0.1e-3
    assert rooms[-1] < 3e-3
    assert (sent[-1] - sent[-100]) @ aside > 0.01  # it slides along the wall
    assert max(shares(bench.sent[first - 3 :])) < LIMIT
    said = [event.report.said for event in bench.rig.events if isinstance(event, ControllerReport)]
    assert said == [message("tool_held_by_wall", wall="window")]


def test_a_tool_beyond_a_wall_goes_no_further_and_comes_back() -> None:
    begin = tool0_to_body(Side.RIGHT, POSTURE)
    wall = wall_before(begin.position, -0.02, (0.0, -1.0, 0.0))
    bench = CartesianBench(Side.RIGHT, POSTURE, within=ToolLimits(walls=(wall,)))
    first = len(bench.rig.cycles)
    bench.stream(0.5, lambda now: twist_goal(0, (0.0, -0.1, 0.0, 0.0, 0.0, 0.0, 0.0)))
    assert wall.distance(places(bench.sent[first:])[-1]) == pytest.approx(-0.02, abs=0.5e-3)
    bench.stream(1.0, lambda now: twist_goal(0, (0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0)))
    assert wall.distance(places(bench.sent[first:])[-1]) > 0.05


def test_a_tool_that_a_wall_holds_leaves_it_as_soon_as_one_that_stands() -> None:
    wall = wall_before(tool0_to_body(Side.RIGHT, POSTURE).position, 0.02, (0.0, -1.0, 0.0))
    bench = CartesianBench(Side.RIGHT, POSTURE, within=ToolLimits(walls=(wall,)))
    rooms, left = [], []
    for before in (-0.2, 0.0):  # it is pushed against the wall; it stands
        bench.stream(1.0, lambda now, speed=before: twist_goal(0, (0.0, speed, 0.0, 0.0, 0.0, 0.0, 0.0)))  # type: ignore[misc]
        first = len(bench.rig.cycles)
        bench.stream(0.4, lambda now: twist_goal(0, (0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0)))
        sent = places(bench.sent[first - 1 :])
        rooms.append(wall.distance(sent[0]))
        left.append(int(np.argmax(sent[:, 1] - sent[0, 1] > 1e-3)))
    assert rooms[0] < 3e-3
    assert rooms[1] > 0.01
    assert left[0] <= left[1] + 3


@pytest.mark.parametrize("kind", ["twist", "pose"])
@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_the_tool_is_not_faster_than_its_limit_on_a_stream(kind: str, scale: float) -> None:
    factor = MemoryBuffer[SpeedFactor]()
    factor.write(SpeedFactor(scale))
    bench = CartesianBench(Side.RIGHT, POSTURE, SpeedScale(factor), ToolLimits(0.1))
    begin = tool0_to_body(Side.RIGHT, bench.start)
    x, y, z = begin.position

    def goal(now: float) -> ToolGoal:
        if kind == "twist":
            return twist_goal(0, (0.2, -0.3, 0.2, 0.0, 0.0, 0.0, 0.0))
        return pose_goal(0, Pose((x + 0.2 * now, y - 0.3 * now, z + 0.2 * now), begin.orientation))

    first = len(bench.rig.cycles)
    bench.stream(0.8, goal)
    speeds = np.linalg.norm(np.diff(places(bench.sent[first:]), axis=0), axis=1) / CYCLE
    assert 0.079 * scale < max(speeds) < 0.1 * scale


def test_a_line_keeps_the_limits_of_the_tool() -> None:
    begin = tool0_to_body(Side.RIGHT, POSTURE)
    x, y, z = begin.position
    wall = wall_before(begin.position, 0.05, (0.0, -1.0, 0.0))
    end = [LineWaypoint(Pose((x, y - 0.04, z), begin.orientation))]
    fast = plan_path(Side.RIGHT, POSTURE, end, LIMITS, speed=0.5)
    slow = plan_path(Side.RIGHT, POSTURE, end, LIMITS, speed=0.5, within=ToolLimits(0.02, (wall,)))
    assert slow.spline.end > 2.0 > 3.0 * fast.spline.end
    beyond = [*end, LineWaypoint(Pose((x, y - 0.06, z), begin.orientation))]
    with refused(CommandRefused, "path_through_wall", pose=2, wall="window") as refusal:
        plan_path(Side.RIGHT, POSTURE, beyond, LIMITS, within=ToolLimits(walls=(wall,)))
    assert refusal.value.said.values["distance"] == pytest.approx(0.01, abs=0.5e-3)
    here = wall_before(begin.position, -0.02, (0.0, -1.0, 0.0))
    with refused(CommandRefused, "path_through_wall", wall="window"):
        plan_path(Side.RIGHT, POSTURE, end, LIMITS, within=ToolLimits(walls=(here,)))
    back = [LineWaypoint(Pose((x, y + 0.01, z), begin.orientation))]
    assert plan_path(Side.RIGHT, POSTURE, back, LIMITS, within=ToolLimits(walls=(here,))).spline.end > 0.0
