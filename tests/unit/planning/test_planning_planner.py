"""Plans of one and both arms: free by the limiter's shapes, within the joints' limits, or refused in a sentence."""

from __future__ import annotations

import importlib.util
import pickle
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from itertools import combinations, count, cycle, islice, pairwise
from math import dist
from statistics import median
from typing import Any

import numpy as np
import pytest

from abb_protocols.catalogue import Message
from abb_protocols.errors import CommandRefused, PlanNotFound, WhyNoPlan
from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import (
    CYCLE,
    YUMI_LIMITS,
    ArmCommand,
    Joints,
    Pose,
    Side,
    home,
    joint_names,
    joints,
    named_pose,
)
from abb_protocols.robot.kinematics import IDENTITY_QUATERNION, tool0_to_body
from abb_runtime.clock import ManualClock
from apart_arms import NEAR, ApartArms
from mesh_judge import MeshJudge
from refusals import refused
from soak import long, short, tell
from trajectories import sent_beside_speeds
from yumi.control.collisions import BODY_MARGIN
from yumi.control.motion.robot_response import SERVO_CYCLES
from yumi.control.motion.spline import SplineSampler
from yumi.core.collision import CollisionModel, Obstacle
from yumi.planning.planner import CLEARANCES, Goal, Plan, Planner
from yumi.planning.scene_description import disabled_pairs, planning_description
from yumi.planning.trajectory_request import JointTrajectory, plan_trajectory

pytestmark = pytest.mark.skipif(importlib.util.find_spec("roboplan") is None, reason="needs yumi-ros2[planning]")

BOX = Obstacle("box", Pose((0.42, 0.0, 0.15), IDENTITY_QUATERNION), (0.25, 0.3, 0.3))
SHAPES = CollisionModel(dict.fromkeys(Side, GripperModules.SERVO), obstacles=(BOX,))
HOME = {side: home(side) for side in Side}
PROBLEMS = 200
MOTIONS = 1000
SEED = 1
LONG = 300.0
"""A limit of time that RoboPlan's searches, which look at the machine's clock, do not reach on a slow machine [s]."""
RANDOM = (0.7, 0.6, 0.9, 0.8, 1.5, 0.8, 2.0)
"""How far random postures are from one in front of the robot [rad]."""
FRONT = (0.0, -1.1, 0.0, 0.4, 0.0, 0.6, 0.0)
TO_BODY = (-0.3, *[0.0] * 6)
"""From home the elbow comes so near to the body that the limiter stops the right arm [rad]."""


class TickingClock(ManualClock):
    """Goes on by ``tick`` [s] each time it is read."""

    def __init__(self, tick: float) -> None:
        super().__init__(-tick)
        self._tick = tick

    def now(self) -> float:
        self.advance(self._tick)
        return super().now()


@pytest.fixture(scope="module")
def planner() -> Planner:
    """Whose time does not pass: a busy machine ends no plan early."""
    return Planner(obstacles=(BOX,), clock=ManualClock())


@pytest.fixture(scope="module")
def problem(planner: Planner) -> tuple[dict[Side, Joints], dict[Side, Joints]]:
    return next(problems(planner, 1))


@pytest.fixture(scope="module")
def planned(planner: Planner, problem) -> Plan:
    """At half the joints' speeds."""
    return planner.plan(*problem, timeout=LONG, speed_scale=0.5)


def splines(plan: Plan) -> dict[Side, SplineSampler]:
    """The ways as the trajectory controllers follow them; they refuse what is too fast for a joint."""
    return {
        side: SplineSampler(
            plan_trajectory(JointTrajectory(joint_names(side), points), (side,), YUMI_LIMITS)[side].spline
        )
        for side, points in plan.points.items()
    }


def nearest(plan: Plan) -> float:
    """By the limiter's shapes, whose distances are not those the planner looks at, each 10 ms, up to NEAR [m].

    Not of upper arm and body, which stand nearer at home.
    """
    ways = splines(plan)
    distances = [NEAR]
    for time in np.arange(0.0, plan.duration + 0.01, 0.01).tolist():
        at = {side: ways[side].position(time) if side in ways else plan.start[side] for side in Side}
        pairs = SHAPES.nearest(at, 10_000, within=NEAR)
        distances += [each.distance for each in pairs if not (each.part.endswith("upper arm") and each.other == "body")]
    return min(distances)


def free_posture(planner: Planner, random: np.random.Generator) -> dict[Side, Joints]:
    while True:
        both = {}
        for side in Side:
            values = np.array(FRONT) + random.uniform(-1.0, 1.0, 7) * RANDOM
            both[side] = joints(np.clip(values, YUMI_LIMITS.lower, YUMI_LIMITS.upper).tolist())
        if planner.is_free(both):
            return both


def problems(planner: Planner, seed: int) -> Iterator[tuple[dict[Side, Joints], dict[Side, Joints]]]:
    """Free postures of both arms between which the straight way is not free."""
    random = np.random.default_rng(seed)
    while True:
        start, goal = free_posture(planner, random), free_posture(planner, random)
        between = (
            {side: joints((np.array(start[side]) * (1 - s) + np.array(goal[side]) * s).tolist()) for side in Side}
            for s in np.linspace(0.0, 1.0, 60).tolist()
        )
        if not all(planner.is_free(each) for each in between):
            yield start, goal


@pytest.mark.parametrize("count", [short(1), long(PROBLEMS, 3600.0)])
def test_way_of_both_arms_is_found_where_the_straight_one_is_not_free(count: int) -> None:
    judge, planner = MeshJudge((BOX,)), Planner(obstacles=(BOX,))  # whose time passes: it is told
    times, missed, distances, judged, durations = [], 0, [], [], []
    for number, (start, goal) in enumerate(islice(problems(planner, 1), count), 1):
        try:
            plan = planner.plan(start, goal, timeout=30.0)
        except PlanNotFound:
            missed += 1
            continue
        times.append(plan.planning_time)
        distances.append(nearest(plan) - plan.clearance)
        ways = splines(plan)
        for time in np.arange(0.0, plan.duration + 0.015, 0.015).tolist():
            distance, *pair = judge.distance({side: ways[side].position(time) for side in Side})
            assert distance > 0.0, (number, time, pair)
            judged.append(distance)
        durations.append(plan.duration)
        for side, points in plan.points.items():
            assert points[0].position == pytest.approx(start[side], abs=1e-9)
            assert points[-1].position == pytest.approx(goal[side], abs=1e-9)
        if count > 1 and number % 20 == 0:
            tell(
                f"{number} problems: {missed} not solved, median {median(times):.2f} s, slowest {max(times):.1f} s; "
                f"nearest to the clearance {min(distances) * 1e3:.1f} mm, meshes {min(judged) * 1e3:.1f} mm apart; "
                f"motions of {median(durations):.2f} s"
            )
    assert missed <= 0.05 * count
    assert min(distances) > -0.002  # between two checked postures


def free_motions(planner: Planner, seed: int) -> Iterator[Plan]:
    """Motions with twice the limiter's margin, of the right arm, the left arm and both in turn, from goal to goal."""
    random = np.random.default_rng(seed)
    start = free_posture(planner, random)
    for moved in cycle(((Side.RIGHT,), (Side.LEFT,), tuple(Side))):
        plan = None
        while plan is None:
            drawn = free_posture(planner, random)
            goal = {side: drawn[side] for side in moved}
            if planner.is_free({**start, **goal}):  # not where the other arm stays
                with suppress(PlanNotFound):
                    plan = planner.plan(start, goal)
            if plan is None:
                start = drawn
        yield plan
        start = {**start, **goal}


@pytest.mark.parametrize("count", [short(3), long(MOTIONS, 3600.0)])
def test_limiter_changes_nothing_of_motions_with_twice_its_margin(count: int) -> None:
    """In one of a hundred a speed may not be fed forward for some cycles; the commanded motion is never another one."""
    planner, times, durations, late = Planner(obstacles=(BOX,)), [], [], 0
    for number, plan in enumerate(islice(free_motions(planner, SEED), count), 1):
        assert plan.clearance == CLEARANCES[0]
        ways, arms = splines(plan), ApartArms(plan.start, obstacles=(BOX,))
        wanted: dict[Side, list[Joints]] = {side: [] for side in ways}
        for time in np.arange(CYCLE, plan.duration + 0.1, CYCLE).tolist():
            desired = {side: ArmCommand(*way.motion(time)) for side, way in ways.items()}
            arms.cycle(dict.fromkeys(ways, lambda _, side, now=desired: now[side]))
            for side, (position, _) in desired.items():
                wanted[side].append(position)
                sent = sent_beside_speeds(wanted[side][-SERVO_CYCLES - 2 :])[-1]
                assert arms.sent[side].position == pytest.approx(sent, abs=1e-3), (number, time, side)
        counters = [arms.limiters[side].counters for side in Side]
        assert [each.kept_apart for each in counters] == [0, 0], number
        late += any(each.feedforward_withheld for each in counters)
        times.append(plan.planning_time)
        durations.append(plan.duration)
        if count > 6 and number % 20 == 0:
            tell(
                f"{number} motions of {median(durations):.2f} s in the median; planned in {median(times):.2f} s in the "
                f"median, {max(times):.1f} s at most; {late} not fed forward all the time"
            )
    assert late <= 0.01 * count


def test_way_is_found_from_where_the_limiter_holds_an_arm_at_the_body(planner: Planner) -> None:
    held = joints([0.046, -1.469, -2.442, 0.799, 0.127, 0.832, -0.171])
    start = {Side.RIGHT: held, Side.LEFT: home(Side.LEFT)}
    before = SHAPES.nearest(start)[0]
    assert (before.part, before.other) == ("right gripper", "body")
    assert before.distance < -0.002
    plan = planner.plan(start, {Side.RIGHT: home(Side.RIGHT)}, timeout=30.0)
    assert plan.clearance == CLEARANCES[-1]
    assert nearest(plan) > CLEARANCES[-1] - 0.002


def test_plan_keeps_speed_acceleration_and_jerk(planned: Plan) -> None:
    for side, sampler in splines(planned).items():
        rows = np.array([sampler.position(time) for time in np.arange(0.0, planned.duration, 0.004).tolist()])
        for order, (most, share) in enumerate(
            ((YUMI_LIMITS.velocity, 0.5), (YUMI_LIMITS.acceleration, 1.0), (YUMI_LIMITS.jerk, 1.0)), 1
        ):
            rates = np.abs(np.diff(rows, order, axis=0)) / 0.004**order
            assert np.all(rates <= np.array(most) * share * 1.001), (side, order)


def test_arm_that_the_limiter_has_stopped_at_the_body_is_led_out_from_there(planner: Planner) -> None:
    start = {**HOME, Side.RIGHT: joints(np.array(HOME[Side.RIGHT]) + TO_BODY)}
    assert SHAPES.nearest(start)[0].distance == pytest.approx(BODY_MARGIN, abs=5e-4)
    plan = planner.plan(start, {Side.RIGHT: HOME[Side.RIGHT]})
    way = [SHAPES.nearest({**start, Side.RIGHT: joints(each.position)})[0] for each in plan.points[Side.RIGHT]]
    assert min(each.distance for each in way) > BODY_MARGIN - 1e-3
    assert way[-1].distance > 0.0


def test_arm_that_stands_beside_the_body_lets_the_other_one_get_no_nearer_to_a_box() -> None:
    post = Obstacle("post", Pose((0.40, -0.12, 0.06), IDENTITY_QUATERNION), (0.08, 0.08, 0.20))
    start, goal = (
        joints(np.radians(each).tolist())
        for each in ((81, -119, -33, 35, -142, 103, -176), (119, -121, -67, 37, -179, 119, -139))
    )
    plan = Planner(obstacles=(post,)).plan({**HOME, Side.RIGHT: start}, {Side.RIGHT: goal})
    assert plan.clearance < CLEARANCES[0]  # the left arm's, which stands at home
    shapes, way = CollisionModel(dict.fromkeys(Side, GripperModules.SERVO), obstacles=(post,)), splines(plan)
    apart: list[float] = []
    for time in np.arange(0.0, plan.duration + 0.01, 0.01).tolist():
        pairs = shapes.nearest({**HOME, Side.RIGHT: way[Side.RIGHT].position(time)}, 10_000, within=NEAR)
        apart += [each.distance for each in pairs if each.other == post.name]
    assert min(apart) > CLEARANCES[0] - 0.002


def test_arm_that_is_in_the_body_must_be_moved_away_first(planner: Planner) -> None:
    start = {**HOME, Side.RIGHT: joints(np.array(HOME[Side.RIGHT]) + 2.0 * np.array(TO_BODY))}
    with refused(CommandRefused, "plan_start_not_free"):
        planner.plan(start, {Side.RIGHT: HOME[Side.RIGHT]})


def test_arm_that_is_free_is_not_led_to_where_the_limiter_stops_it(planner: Planner) -> None:
    with refused(CommandRefused, "plan_goal_not_free") as refusal:
        planner.plan(HOME, {Side.RIGHT: joints(np.array(HOME[Side.RIGHT]) + TO_BODY)})
    assert_near(refusal.value.said, "body")


def assert_near(said: Message, other: str) -> None:
    """A part of the right arm is near to ``other``, says a refusal."""
    assert said.values["where"].code in ("parts_are_near", "parts_overlap")
    values = said.values["where"].values
    assert (values["part"].startswith("right "), values["other"].startswith(other)) == (True, True), values


def test_pose_is_reached_in_a_posture_that_is_free(planner: Planner) -> None:
    there = tool0_to_body(Side.RIGHT, joints([0.3, -1.0, -0.3, 0.3, 0.2, 0.7, 0.1]))
    plan = planner.plan(HOME, {Side.RIGHT: there})
    assert tuple(plan.points) == (Side.RIGHT,)
    reached = tool0_to_body(Side.RIGHT, joints(plan.points[Side.RIGHT][-1].position))
    assert reached.position == pytest.approx(there.position, abs=1e-6)
    assert nearest(plan) > plan.clearance - 0.002


def way(plan: Plan) -> float:
    """How far the joints go [rad]."""
    return sum(
        dist(first.position, second.position) for points in plan.points.values() for first, second in pairwise(points)
    )


def test_planning_ends_at_its_limit_of_time_with_the_way_that_was_found(
    planner: Planner, problem, planned: Plan, monkeypatch
) -> None:
    monkeypatch.setattr(planner, "_clock", TickingClock(0.7 * LONG))
    hurried = planner.plan(*problem, timeout=LONG)  # over once the search has looked at the clock
    assert way(hurried) > way(planned)  # which was shortened
    assert nearest(hurried) > hurried.clearance - 0.002


def test_motion_is_slowed_only_twice_more_where_that_does_not_help(
    planner: Planner, monkeypatch: pytest.MonkeyPatch
) -> None:
    counts: list[int] = []

    def refused(_start: object, _motion: object) -> list[float]:
        """Fewer cycles of the second motion, and of no slower one."""
        counts.append(2 if counts else 5)
        return [0.1] * counts[-1]

    monkeypatch.setattr(planner, "_refused", refused)
    goal = {Side.RIGHT: named_pose(Side.RIGHT, "ready")}
    planner.plan(HOME, goal, timeout=LONG)
    assert counts == [5, 2, 2, 2]


def test_arm_that_is_there_gets_a_motion_of_one_cycle(planner: Planner) -> None:
    plan = planner.plan(HOME, {Side.RIGHT: HOME[Side.RIGHT]})
    assert plan.duration == pytest.approx(CYCLE)
    assert {point.position for point in plan.points[Side.RIGHT]} == {HOME[Side.RIGHT]}


def test_same_seed_finds_the_same_way(planner: Planner, problem, planned: Plan) -> None:
    assert planner.plan(*problem, timeout=LONG, speed_scale=0.5).points == planned.points


@pytest.mark.parametrize(
    ("goal", "code", "values"),
    [
        ({}, "no_arm_has_goal", {}),
        (
            {Side.RIGHT: joints([9.0, *HOME[Side.RIGHT][1:]])},
            "plan_joint_out_of_range",
            {"joint": "yumi_joint_1_r", "position": 9.0, "upper": YUMI_LIMITS.upper[0]},
        ),
        ({Side.RIGHT: Pose((2.0, 0.0, 0.5), IDENTITY_QUATERNION)}, "plan_pose_out_of_reach", {"arm": "right"}),
        ({Side.RIGHT: Pose((0.42, 0.0, 0.2), IDENTITY_QUATERNION)}, "plan_goal_not_free", {}),
    ],
)
def test_impossible_goal_is_refused_with_its_reason(
    planner: Planner, goal: dict[Side, Goal], code: str, values: dict[str, Any]
) -> None:
    with refused(CommandRefused, code, **values) as refusal:
        planner.plan(HOME, goal)
    if code == "plan_goal_not_free":
        assert_near(refusal.value.said, "box")


class Search:
    """In place of RoboPlan's: ends without a path, with ``nodes`` in its two trees."""

    nodes = 0

    def __init__(self, *_: object) -> None: ...

    def setRngSeed(self, seed: int) -> None: ...  # noqa: N802 - as RoboPlan calls it

    def plan(self, *_: object) -> None:
        raise RuntimeError

    def getNodes(self) -> tuple[range, range]:  # noqa: N802
        return range(self.nodes // 2), range(self.nodes // 2)


@pytest.fixture
def search(monkeypatch: pytest.MonkeyPatch) -> type[Search]:
    monkeypatch.setattr(Search, "nodes", 20_000)
    monkeypatch.setattr("roboplan.rrt.RRT", Search)
    return Search


def times(planner: Planner, monkeypatch: pytest.MonkeyPatch, processor_share: float) -> None:
    """A clock that goes on by a second each time it is read, and a processor that is had for a share of the time."""
    monkeypatch.setattr(planner, "_clock", TickingClock(1.0))
    worked = count()
    monkeypatch.setattr("yumi.planning.planner.time.thread_time", lambda: 4.0 * processor_share * next(worked))


@pytest.mark.usefixtures("search")
def test_path_that_complete_searches_do_not_find_does_not_exist(planner: Planner, problem) -> None:
    with refused(PlanNotFound, "no_path") as refusal:
        planner.plan(*problem)
    assert refusal.value.why is WhyNoPlan.NO_PATH


def test_path_may_exist_where_one_of_the_searches_was_cut_short(
    planner: Planner, problem, search: type[Search], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Search, "nodes", 19_998)
    with pytest.raises(PlanNotFound) as refusal:
        planner.plan(*problem)
    assert refusal.value.why is WhyNoPlan.TIME_IS_UP


@pytest.mark.parametrize(("share", "code"), [(0.125, "no_path_in_time_busy"), (0.9, "no_path_in_time")])
def test_path_that_is_not_found_in_time_says_how_busy_the_machine_is(
    planner: Planner, problem, search: type[Search], monkeypatch: pytest.MonkeyPatch, share: float, code: str
) -> None:
    times(planner, monkeypatch, share)
    with refused(PlanNotFound, code, duration=4.0, share=share) as refusal:
        planner.plan(*problem, timeout=2.0)
    assert refusal.value.why is WhyNoPlan.TIME_IS_UP
    assert refusal.value.processor_share == pytest.approx(share)


def test_cause_comes_out_of_the_process_that_plans() -> None:
    error = pickle.loads(pickle.dumps(PlanNotFound("Not found.", WhyNoPlan.TIME_IS_UP, 0.25)))
    assert (str(error), error.why, error.processor_share) == ("Not found.", WhyNoPlan.TIME_IS_UP, 0.25)


@pytest.mark.parametrize("timeout", [30.0, 0.0])
def test_straight_path_is_taken_before_any_search(planner: Planner, search: type[Search], timeout: float) -> None:
    ready = {side: named_pose(side, "ready") for side in Side}
    plan = planner.plan(HOME, ready, timeout=timeout)
    for side, points in plan.points.items():
        whole = np.array(ready[side]) - HOME[side]
        for point in points:
            covered = (np.array(point.position) - HOME[side]) @ whole / (whole @ whole)
            assert np.array(point.position) == pytest.approx(HOME[side] + covered * whole, abs=1e-6)


def test_arms_that_were_stopped_in_front_of_each_other_are_led_home() -> None:
    """Driven at each other until the limiter holds them; then from where they stand, as ``retreat`` does."""
    ready = {side: named_pose(side, "ready") for side in Side}
    arms = ApartArms(ready, obstacles=())
    crossed = {Side.RIGHT: joints([1.4, *ready[Side.RIGHT][1:]]), Side.LEFT: joints([-1.4, *ready[Side.LEFT][1:]])}

    def drive(now: ApartArms, side: Side) -> ArmCommand:
        at = np.array(now.sent[side].position)
        return ArmCommand(joints((at + np.clip(np.array(crossed[side]) - at, -0.004, 0.004)).tolist()))

    for _ in range(500):
        arms.cycle(dict.fromkeys(Side, drive))
    start = arms.measured()
    nearest = arms.shapes.nearest(start)[0]
    assert (nearest.part, nearest.other) == ("right fingers", "left fingers")
    assert 0.0 < nearest.distance < 0.015
    plan = Planner().plan(start, HOME, speed_scale=0.1)
    ways = splines(plan)
    for time in np.arange(CYCLE, plan.duration + 0.5, CYCLE).tolist():
        arms.cycle({side: lambda _, side, at=time: ArmCommand(*ways[side].motion(at)) for side in Side})
    for side in Side:
        assert arms.measured()[side] == pytest.approx(HOME[side], abs=0.01)


LEFT_BEHIND = """
import threading
from yumi.planning.planner import Planner
from yumi.control.motion.point_motion import point_travel
from yumi.control.motion.setpoint import Setpoint
from abb_protocols.robot.joints import YUMI_LIMITS, ZERO_JOINTS, Side, home
from yumi.api.motion_registry import MotionRegistry, MotionWay

planner = Planner()
motion = MotionRegistry().begin(Side.RIGHT)
motion.follow_way(
    lambda plan=point_travel(Setpoint(home(Side.RIGHT)), ZERO_JOINTS, YUMI_LIMITS): MotionWay(plan.duration, None)
)
motion.future.set_result(None)
threading.Thread(target=lambda: threading.Event().wait(), daemon=True).start()
raise ValueError("the last line")
"""


def test_error_that_ends_a_script_is_the_last_that_it_prints() -> None:
    """Not nanobind's list of what a thread that goes on keeps of RoboPlan and Ruckig."""
    ended = subprocess.run([sys.executable, "-c", LEFT_BEHIND], capture_output=True, text=True, check=False)
    assert ended.stderr.splitlines()[-1] == "ValueError: the last line"


@pytest.mark.parametrize("count", [short(300), long(100_000, 1800.0)])
def test_pairs_of_one_arm_that_are_not_checked_never_touch(count: int) -> None:
    """Judged by Pinocchio and Coal in the planner's URDF, without clearance."""
    pin = pytest.importorskip("pinocchio")
    urdf = planning_description(dict.fromkeys(Side, GripperModules.SERVO), clearance=0.0, to_boxes=0.0)
    model = pin.buildModelFromXML(urdf)
    shapes = pin.buildGeomFromUrdfString(model, urdf, pin.GeometryType.COLLISION)
    links = [model.frames[shape.parentFrame].name for shape in shapes.geometryObjects]
    never = {frozenset(pair[:2]) for pair in disabled_pairs(with_fingers=False) if pair[2] == "Never"}
    for first, second in combinations(range(len(links)), 2):
        if {links[first], links[second]} in never:
            shapes.addCollisionPair(pin.CollisionPair(first, second))
    data, shape_data = model.createData(), shapes.createData()
    random = np.random.default_rng(2)
    assert len(shapes.collisionPairs) > 50
    for _ in range(count):
        posture = random.uniform(model.lowerPositionLimit, model.upperPositionLimit)
        assert not pin.computeCollisions(model, data, shapes, shape_data, posture, True)
