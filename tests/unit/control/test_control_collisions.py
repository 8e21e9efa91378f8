"""Whatever drives them, the arms keep apart from each other and from what stands around them."""

from __future__ import annotations

import gc
import subprocess
from collections.abc import Callable
from ctypes import PyDLL, c_bool, c_char_p, c_int64, c_void_p, string_at
from functools import cache
from itertools import chain
from math import dist, inf, radians
from pathlib import Path
from struct import pack
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from numpy.typing import NDArray

from abb_protocols.catalogue import message
from abb_protocols.robot.description import SERVO_GRIPPERS
from abb_protocols.robot.joints import (
    CYCLE,
    YUMI_LIMITS,
    ZERO_JOINTS,
    ArmCommand,
    ArmState,
    Joints,
    Pose,
    Side,
    home,
    joints,
    named_pose,
)
from abb_protocols.robot.kinematics import tool0_to_body
from apart_arms import NEAR, TABLE, UPRIGHT, ApartArms, Drive, at_nearest, at_speed, behind, renew_drive, scaled_by, to
from contract.trajectory_arms import NAME, TrajectoryArm
from reported_limiter import ReportedLimiter
from trajectories import planned
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_motion import EgmMotionParameters
from yumi.control.collisions import BODY_MARGIN, COLLISION_MARGIN, CollisionLimiter
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.goals import MemoryBuffer, write_goal
from yumi.control.limiter import Limiter
from yumi.control.loop_events import KeptApart
from yumi.control.motion.point_motion import point_stop, point_travel
from yumi.control.motion.robot_response import EGM_GAIN, SERVO_CYCLES, plan_gain
from yumi.control.motion.setpoint import Setpoint
from yumi.control.motion.spline import TrajectoryPoint
from yumi.control.trajectory_commands import Tolerances, TrajectoryOutcome
from yumi.core.collision import COLLISION_PADDING, Array, CollisionModel, Distance, Obstacle
from yumi.core.library import COMPILER_FLAGS, CORE_FOLDER, MOTION_STRUCT, STANDARD_LIBRARY, _compiler
from yumi_evaluation.virtual_time import VirtualArmRig

READY = {side: named_pose(side, "ready") for side in Side}
ROUNDING = 1e-3


def forward(side: Side) -> Joints:
    """The forearms lifted and turned outwards, with room on all sides."""
    sign = 1.0 if side is Side.RIGHT else -1.0
    return joints([radians(angle) for angle in (-sign * 40.0, -90.0, -sign * 135.0, 30.0, 0.0, 40.0, 0.0)])


FORWARD = {side: forward(side) for side in Side}


GOALS = {
    Side.RIGHT: joints([radians(angle) for angle in (42.1, -118.4, -92.1, 46.5, -143.6, 42.5, 36.1)]),
    Side.LEFT: joints([radians(angle) for angle in (-39.0, -104.1, 80.0, 8.0, 31.0, 93.0, 57.0)]),
}
MEETING = {
    Side.RIGHT: joints([radians(angle) for angle in (107, -111, -76, 39, -166, 113, -128)]),
    Side.LEFT: joints([radians(angle) for angle in (-106, -105, 78, 38, 161, 111, 124)]),
}


BEFORE_MEETING = {
    side: joints([a + 0.55 * (b - a) for a, b in zip(GOALS[side], MEETING[side], strict=True)]) for side in Side
}


def turned(side: Side, joint_1: float) -> Joints:
    return joints([joint_1, *FORWARD[side][1:]])


def near(arms: ApartArms, positions: dict[Side, Joints]) -> tuple[Distance, ...]:
    """All pairs of parts that are near each other, nearest first."""
    return arms.shapes.nearest(positions, 10_000, within=NEAR)


def nearest(arms: ApartArms, positions: dict[Side, Joints]) -> float:
    """The smallest distance, up to NEAR [m]."""
    return min((each.distance for each in near(arms, positions)), default=NEAR)


def between_arms(arms: ApartArms, positions: dict[Side, Joints]) -> float:
    """As `nearest`, but of the shoulders, which are as near to the other arm as to the body [m]."""
    distances = (
        each.distance
        for each in near(arms, positions)
        if each.other.startswith("left") and "shoulder" not in each.part + each.other
    )
    return min(distances, default=NEAR)


def least_kept(arms: ApartArms, positions: dict[Side, Joints]) -> bool:
    """Whether all but the body is beyond the margin, and the body as far as it has to be."""

    def least(each: Distance) -> float:
        return BODY_MARGIN if each.other == "body" or "shoulder" in each.part + each.other else COLLISION_MARGIN

    return all(each.distance >= least(each) - ROUNDING for each in near(arms, positions))


@pytest.mark.parametrize("drive", [to, behind], ids=["goal", "proportional"])
def test_arms_turned_towards_each_other_come_to_rest_at_the_margin(drive: object) -> None:
    """Both were once sent to joint 1 = ±168° and passed through one another."""
    arms = ApartArms(FORWARD, obstacles=())
    goals = {side: turned(side, radians(sign * 168.0)) for side, sign in ((Side.RIGHT, 1.0), (Side.LEFT, -1.0))}
    drives = {side: drive(goal) for side, goal in goals.items()}
    lowest, names = np.inf, set()
    for cycle in range(200):
        arms.cycle(drives)
        lowest = min(lowest, between_arms(arms, arms.measured() if cycle % 2 else arms.commanded()))
        names |= {limited.other for side in Side if (limited := arms.both.arm(side).limited)}
    assert COLLISION_MARGIN - ROUNDING <= lowest <= COLLISION_MARGIN + 0.01
    assert "left fingers" in names


def test_arm_that_starts_within_the_margin_may_leave_it_and_comes_no_nearer() -> None:
    tip = tool0_to_body(Side.RIGHT, FORWARD[Side.RIGHT], Pose((0.0, 0.0, 0.155), UPRIGHT)).position
    arms = ApartArms(FORWARD, obstacles=(Obstacle("box", Pose(tip, UPRIGHT), (0.03, 0.03, 0.03)),))
    first = nearest(arms, FORWARD)
    assert first < COLLISION_MARGIN - ROUNDING
    for _ in range(50):
        arms.cycle({Side.RIGHT: at_speed(scaled_by(0.1, at_nearest(arms, Side.RIGHT, 1, name="box")))})
    assert nearest(arms, arms.commanded()) >= first - 1e-4
    distances = []
    for _ in range(40):
        arms.cycle({Side.RIGHT: at_speed(scaled_by(0.1, at_nearest(arms, Side.RIGHT, 1, 1.0, "box")))})
        distances.append(nearest(arms, arms.commanded()))
    assert min(distances) >= first - 1e-4
    assert max(distances) > COLLISION_MARGIN


def test_free_motion_is_not_touched() -> None:
    """Sway the forearms, far from everything."""
    arms = ApartArms(READY, obstacles=())
    generator = np.random.default_rng(5)
    for _ in range(6):
        goals = {
            side: joints([p + d for p, d in zip(READY[side], generator.uniform(-0.15, 0.15, 7), strict=True)])
            for side in Side
        }
        start = {side: arms.sent[side].position for side in Side}
        ways = [
            {side: joints(list((1 - s) * np.array(start[side]) + s * np.array(goals[side]))) for side in Side}
            for s in np.linspace(0.0, 1.0, 30)
        ]
        if min(nearest(arms, way) for way in ways) < 0.01:
            continue
        for _ in range(150):
            arms.cycle({side: to(goals[side]) for side in Side})
        assert all(each.counters.kept_apart == 0 for each in arms.limiters.values())


def test_silent_arm_is_where_its_last_command_leads_it() -> None:
    arms = ApartArms(FORWARD, obstacles=())
    for _ in range(60):
        arms.cycle({Side.LEFT: at_speed((-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0))})
    arms.silent[Side.LEFT] = 1000
    goal = to(turned(Side.RIGHT, radians(168.0)))
    lowest, names = np.inf, set()
    for _ in range(300):
        arms.cycle({Side.RIGHT: goal})
        now = {Side.RIGHT: arms.sent[Side.RIGHT].position, Side.LEFT: arms.arms[Side.LEFT].position}
        lowest = min(lowest, between_arms(arms, now))
        names |= {limited.other for limited in [arms.both.arm(Side.RIGHT).limited] if limited}
    assert lowest >= COLLISION_MARGIN - ROUNDING
    # Nobody has read yet where RAPID or a hand has moved it since: the log says what it is based on.
    assert names
    assert all(name.startswith("left ") and name.endswith(" where EGM reported it last") for name in names)


def test_arm_that_was_read_from_the_controller_is_where_it_was_read() -> None:
    both = CollisionLimiter(CollisionModel(SERVO_GRIPPERS), YUMI_LIMITS, EGM_GAIN)
    before, stands, goal, left = at_boundary(both.model)
    both.arm(Side.RIGHT).sent(before, Setpoint(before), None)
    # The left arm has sent nothing yet, so nothing is known of it; then it is read.
    assert both.arm(Side.RIGHT).accepts(stands, Setpoint(goal), None)
    both.arm(Side.RIGHT).sent(before, Setpoint(before), None)
    both.arm(Side.LEFT).note_measured(left)
    assert not both.arm(Side.RIGHT).accepts(before, Setpoint(goal), None)
    limited = both.arm(Side.RIGHT).limited
    assert limited is not None
    assert not limited.other.endswith("last")
    # RAPID takes it away: what lies between two readings is kept clear of, then it has left.
    both.arm(Side.LEFT).note_measured(FORWARD[Side.LEFT])
    assert not both.arm(Side.RIGHT).accepts(before, Setpoint(goal), None)
    both.arm(Side.LEFT).note_measured(FORWARD[Side.LEFT])
    assert both.arm(Side.RIGHT).accepts(before, Setpoint(goal), None)


def test_arm_whose_datagrams_arrive_is_not_where_it_was_read() -> None:
    both = CollisionLimiter(CollisionModel(SERVO_GRIPPERS), YUMI_LIMITS, EGM_GAIN)
    before, _, goal, left = at_boundary(both.model)
    for side, position in ((Side.LEFT, left), (Side.RIGHT, before)):
        both.arm(side).sent(position, Setpoint(position), None)
    both.arm(Side.LEFT).note_measured(FORWARD[Side.LEFT])
    assert not both.arm(Side.RIGHT).accepts(before, Setpoint(goal), None)


def at_boundary(model: CollisionModel) -> tuple[Joints, Joints, Joints, Joints]:
    """Of the right arm turned towards the left one: 4 mm left, 1 mm left, 4 mm missing; and the left one."""
    left = turned(Side.LEFT, radians(-80.0))

    def with_left(beyond: float) -> Joints:
        low, high = radians(20.0), radians(60.0)
        for _ in range(40):
            angle = 0.5 * (low + high)
            pairs = model.nearest({Side.RIGHT: turned(Side.RIGHT, angle), Side.LEFT: left}, 10_000, within=NEAR)
            distance = min((each.distance for each in pairs if each.other.startswith("left")), default=NEAR)
            low, high = (angle, high) if distance > COLLISION_MARGIN + beyond else (low, angle)
        return turned(Side.RIGHT, low)

    return with_left(0.004), with_left(0.001), with_left(-0.004), left


def test_arm_that_stands_at_a_boundary_may_go_on_when_the_other_one_has_left() -> None:
    both, before, stands, goal = standing_at_boundary()
    assert not both.arm(Side.RIGHT).accepts(before, Setpoint(goal), None)
    both.arm(Side.LEFT).sent(FORWARD[Side.LEFT], Setpoint(FORWARD[Side.LEFT]), None)
    assert both.arm(Side.RIGHT).accepts(stands, Setpoint(stands), None)
    assert both.arm(Side.RIGHT).limited is None
    assert both.arm(Side.RIGHT).accepts(before, Setpoint(goal), None)


def test_arm_that_stands_at_a_boundary_may_go_on_when_the_parts_may_touch() -> None:
    both, before, _, goal = standing_at_boundary()
    assert not both.arm(Side.RIGHT).accepts(before, Setpoint(goal), None)
    both.permit(("right arm", "left arm"))
    assert both.arm(Side.RIGHT).accepts(before, Setpoint(goal), None)


def standing_at_boundary() -> tuple[CollisionLimiter, Joints, Joints, Joints]:
    """Both arms; where the right one was before, where it stands, and a goal that is too near to the left one."""
    both = CollisionLimiter(CollisionModel(SERVO_GRIPPERS), YUMI_LIMITS, EGM_GAIN)
    before, stands, goal, left = at_boundary(both.model)
    for side, position in ((Side.LEFT, left), (Side.RIGHT, before)):
        both.arm(side).sent(position, Setpoint(position), None)
    assert both.arm(Side.RIGHT).accepts(stands, Setpoint(stands), None)
    return both, before, stands, goal


SHAPES = CollisionModel(SERVO_GRIPPERS)
SEGMENTED = CollisionLimiter(SHAPES, YUMI_LIMITS, EGM_GAIN)
"""Divides paths; its own arms are sent nothing."""


@cache
def look_into() -> PyDLL:
    """What these tests look at in the core, see ``collision_segments.cpp``."""
    source = Path(__file__).with_name("collision_segments.cpp")
    with TemporaryDirectory() as folder:
        library = f"{folder}/segments.so"
        command = [
            *_compiler(),
            *COMPILER_FLAGS,
            "-O0",
            "-shared",
            "-I",
            str(CORE_FOLDER),
            str(source),
            *STANDARD_LIBRARY,
            "-o",
            library,
        ]
        subprocess.run(command, check=True)
        found = PyDLL(library)
    found.collisions_segments.restype, found.collisions_motion.restype = c_int64, c_void_p
    found.collisions_segments.argtypes = c_void_p, c_char_p, c_bool, c_int64, c_void_p, c_void_p
    found.collisions_motion.argtypes = found.collisions_limit_distances.argtypes = c_void_p, c_int64
    return found


def motion_of(both: CollisionLimiter, side: Side) -> bytes:
    """How the command sent last moves an arm, and where it may go if it is not heard."""
    return string_at(
        look_into().collisions_motion(both.arm_collisions_handle, both.arm(side).number), MOTION_STRUCT.size
    )


def packed(planned: Joints, sent: Setpoint, robot: Setpoint | None = None) -> bytes:
    """The motion of an arm as the core reads it."""
    p, v, a = robot or Setpoint(ZERO_JOINTS)
    return pack("58d", *planned, *chain(*sent), robot is not None, *p, *v, *a, 0.0, *ZERO_JOINTS)


class Segments:
    """Those of where an arm may come until it rests, as they are compared; with ``coasts``, without its link.

    Attributes:
        lines: of the segments that are cut ``level`` times, up to 6: middle, line to the end, and how far off it each
            joint may be, (n, 3, 7) [rad].
        tree: the same, where 2 i and 2 i + 1 are the halves of i of one cut less; empty ones are off by -inf.
        middle, half: of the whole path [rad], (7,).
    """

    def __init__(self, motion: bytes, level: int = 6, *, coasts: bool = False) -> None:
        lines, whole = np.empty((3 * 64, 3, 7)), np.empty((2, 7))
        arguments = motion, coasts, level, lines.ctypes.data, whole.ctypes.data
        self.tree = lines[: look_into().collisions_segments(SEGMENTED.handle, *arguments)]
        self.lines = self.tree[self.tree[:, 2, 0] >= 0.0]
        self.middle, self.half = whole

    def off(self, postures: Array) -> float:
        """By how much a joint is out of every segment, in one of these postures (n, 7) [rad]."""
        middles, lines, off = self.lines.transpose(1, 0, 2)
        lengths = np.maximum(np.einsum("nj,nj->n", lines, lines), 1e-15)
        apart = postures[:, None] - middles
        shares = np.clip(np.einsum("pnj,nj->pn", apart, lines) / lengths, -1.0, 1.0)
        out = np.abs(apart - shares[:, :, None] * lines) - off
        return max(0.0, float(out.max(2).min(1).max()))

    def have(self, posture: Array) -> NDArray[np.bool_]:
        """Which of ``tree`` have a posture (7,), (n,): the same share of its line leads each joint near enough."""
        apart, off = posture - self.tree[:, 0], self.tree[:, 2] + 1e-9
        along = np.where(np.abs(self.tree[:, 1]) > 1e-12, self.tree[:, 1], 1e-12)
        shares = np.sort([(apart - off) / along, (apart + off) / along], axis=0)
        has_way = np.maximum(shares[0].max(1), -1.0) <= np.minimum(shares[1].min(1), 1.0) + 1e-9
        return np.asarray(has_way & (off[:, 0] >= 0.0))

    def covers(self, postures: Array) -> bool:
        """Whether the whole path has these postures (n, 7) [rad]."""
        return bool(np.all(np.abs(postures - self.middle) <= self.half + 1e-9))


def braking_postures(sent: Setpoint, count: int = 400) -> Array:
    """Where the position sent comes when it brakes, (n, 7) [rad]."""
    braking = point_stop(sent, YUMI_LIMITS)
    return np.array([braking.setpoint(braking.duration * index / count).position for index in range(count + 1)])


def test_joint_that_turns_round_stays_in_its_braking_path() -> None:
    """It goes 7.4 mrad forward, then rests 0.2 mrad behind where it began."""
    start = READY[Side.RIGHT]
    sent = Setpoint(start, joints([0.5, *[0.0] * 6]), joints([-20.0, *[0.0] * 6]))
    path = Segments(packed(start, sent))
    assert path.off(braking_postures(sent)) < 1e-4
    assert path.covers(braking_postures(sent))


@pytest.mark.parametrize("seed", range(6))
def test_braking_path_is_in_its_segments(seed: int) -> None:
    """Speeds and accelerations of opposite signs."""
    generator = np.random.default_rng(seed)
    top, jerk = np.array(YUMI_LIMITS.acceleration), np.array(YUMI_LIMITS.jerk)
    for moving in (1, 1, 1, 2, 2, 7):
        which = np.isin(np.arange(7), generator.permutation(7)[:moving])
        acceleration = which * generator.uniform(-1.0, 1.0, 7) * top
        # Below this speed a joint turns round before it rests.
        turning = acceleration * np.abs(acceleration) / (2.0 * jerk)
        velocity = -turning * generator.uniform(0.0, 1.5, 7) * generator.choice([1.0, 4.0])
        sent = Setpoint(READY[Side.RIGHT], joints(list(velocity)), joints(list(acceleration)))
        motion, postures = packed(READY[Side.RIGHT], sent), braking_postures(sent)
        for level in range(7):
            path = Segments(motion, level)
            assert path.off(postures) < 1e-4
        assert path.covers(postures)


def test_robot_that_follows_late_is_compared_where_it_goes_itself() -> None:
    """Its command has gone round by joint 1; the robot would go straight there with joint 4."""
    start = FORWARD[Side.RIGHT]
    before, half_way, after = (joints([*start[:3], start[3] + angle, *start[4:]]) for angle in (-1.1, -0.6, -0.1))
    path = Segments(packed(before, Setpoint(after)))
    assert path.off(np.array([half_way])) < 1e-6
    assert path.covers(np.array([before, half_way, after]))
    both = CollisionLimiter(CollisionModel(SERVO_GRIPPERS, obstacles=(post_at(half_way),)), YUMI_LIMITS, EGM_GAIN)
    detour = turned(Side.RIGHT, half_way[0] - 0.7)
    for robot, accepted in ((after, True), (before, False)):
        # On the way that led round the post the positions sent were clear of it.
        both.arm(Side.RIGHT).sent(detour, Setpoint(detour), None)
        assert both.arm(Side.RIGHT).accepts(robot, Setpoint(after), None) is accepted, both.arm(Side.RIGHT).limited
    assert "post" in str(both.arm(Side.RIGHT).limited)


def post_at(position: Joints) -> Obstacle:
    """A small box in the right arm's gripper."""
    tip = tool0_to_body(Side.RIGHT, position, Pose((0.0, 0.0, 0.12), UPRIGHT)).position
    return Obstacle("post", Pose(tip, UPRIGHT), (0.02, 0.02, 0.02))


@pytest.mark.parametrize(
    "drive", [to, lambda goal: at_speed(scaled_by(0.4, YUMI_LIMITS.velocity))], ids=["late", "fed forward"]
)
def test_robot_goes_where_it_was_compared_when_its_command_brakes(drive: Callable[[Joints], Drive]) -> None:
    arms = ApartArms(READY, obstacles=())
    for _ in range(40):
        arms.cycle({Side.RIGHT: drive(FORWARD[Side.RIGHT])})
    motion = motion_of(arms.both, Side.RIGHT)
    look_into().collisions_limit_distances(arms.both.arm_collisions_handle, 0)  # nothing is accepted
    postures = []
    for _ in range(150):
        arms.cycle({Side.RIGHT: drive(FORWARD[Side.RIGHT])})
        postures.append(arms.arms[Side.RIGHT].planned)
    assert dist(postures[0], postures[-1]) > 0.2
    assert Segments(motion).off(np.array(postures)) < 5e-3


def test_robot_whose_link_is_lost_goes_where_it_was_compared() -> None:
    """Speeds are fed forward to it; its link is lost now, or while its command brakes."""
    arms = ApartArms(READY, obstacles=())
    for _ in range(40):
        arms.cycle({Side.RIGHT: at_speed(scaled_by(0.3, YUMI_LIMITS.velocity))})
    motion = motion_of(arms.both, Side.RIGHT)
    braking, coasting = Segments(motion), Segments(motion, coasts=True)
    look_into().collisions_limit_distances(arms.both.arm_collisions_handle, 0)  # nothing is accepted
    postures = []
    for _ in range(30):
        postures += [each[Side.RIGHT].planned for each in arms.without_links()]
        arms.cycle({Side.RIGHT: at_speed(ZERO_JOINTS)})
    assert braking.off(np.array(postures)) > 0.2
    assert coasting.off(np.array(postures)) < 1e-2
    within = [Segments(motion, level, coasts=True).off(coasting.lines[:, 0]) for level in range(6)]
    assert max(within) < 1e-3
    assert coasting.covers(coasting.lines[:, 0])


@pytest.mark.parametrize("seed", range(4))
def test_halves_of_where_a_robot_may_coast_are_all_of_it(seed: int) -> None:
    """What is clear is not cut further: the way from here without a link is in one half of each segment that has it."""
    generator = np.random.default_rng(seed)
    for _ in range(5):
        sent, robot = moving(generator, Side.RIGHT), moving(generator, Side.RIGHT)
        robot = robot._replace(position=joints(list(sent.position + generator.normal(0.0, 0.1, 7))))
        motion = packed(robot.position, sent, robot)
        paths = [Segments(motion, level, coasts=True) for level in range(7)]
        for share in np.linspace(0.0, 1.0, 11):
            posture = np.array(robot.position) + share / plan_gain(EGM_GAIN) * np.array(robot.velocity)
            has_it = paths[0].have(posture)
            for path in paths[1:]:
                has_it = has_it.repeat(2) & path.have(posture)
                assert has_it.any()


def moving(generator: np.random.Generator, side: Side) -> Setpoint:
    """Somewhere between where the arms are free and where they meet, at up to half of the joints' limits."""
    share, top = generator.uniform(0.5, 1.0), np.array(YUMI_LIMITS.velocity)
    near = (1.0 - share) * np.array(GOALS[side]) + share * np.array(MEETING[side])
    position = np.clip(near + generator.normal(0.0, 0.1, 7), YUMI_LIMITS.lower, YUMI_LIMITS.upper)
    speed, rate = generator.uniform(0.0, 0.5) * top, 0.5 * np.array(YUMI_LIMITS.acceleration)
    ways = [generator.uniform(-1.0, 1.0, 7) * most for most in (speed, rate)]
    return Setpoint(*(joints(row.tolist()) for row in (position, *ways)))


@pytest.mark.parametrize("seed", range(2))
def test_what_is_clear_comes_no_nearer_than_its_margin_and_what_is_refused_comes_near(seed: int) -> None:
    """In postures sampled on both braking paths, and where the other robot still follows its command."""
    generator, is_clear = np.random.default_rng(seed), []
    both = CollisionLimiter(CollisionModel(SERVO_GRIPPERS, obstacles=(TABLE,)), YUMI_LIMITS, EGM_GAIN)
    is_right = np.isin(np.arange(len(both.model.names)), np.arange(both.model.arms[Side.RIGHT].stop))
    for _ in range(40):
        right, left = (moving(generator, side) for side in Side)
        planned = joints((np.array(left.position) - 0.02 * np.array(left.velocity)).tolist())
        both.arm(Side.LEFT).sent(planned, left, None)
        both.arm(Side.RIGHT).sent(ZERO_JOINTS, Setpoint(ZERO_JOINTS), None)
        is_clear.append(both.arm(Side.RIGHT).accepts(right.position, right, None))
        mine, theirs = braking_postures(right, 24), braking_postures(left, 24)
        lines = np.linspace(planned, left.position, 5)
        beyond = np.inf
        for posture in mine:
            for other in (*theirs, *lines):
                found = both.model.contacts(np.concatenate((posture, other)), COLLISION_MARGIN + 0.01)
                kept = both.margins[found["parts"][:, 0], found["parts"][:, 1]]
                beyond = min(beyond, (found["distance"] - kept).min(initial=np.inf))
            found = both.model.contacts(np.concatenate((posture, ZERO_JOINTS)), COLLISION_MARGIN + 0.01, Side.RIGHT)
            assert is_right[found["parts"][:, 0]].all()
            kept = both.margins[found["parts"][:, 0], found["parts"][:, 1]]
            beyond = min(beyond, (found["distance"] - kept).min(initial=np.inf))
            if not is_clear[-1] and beyond < 1e-3:
                break
        assert beyond > -6e-4 if is_clear[-1] else beyond < 1e-3
    assert 5 < sum(is_clear) < 35


class BesideArm:
    """The left arm with a trajectory controller; the right one stands where it is told."""

    def __init__(self) -> None:
        self.both = CollisionLimiter(CollisionModel(SERVO_GRIPPERS), YUMI_LIMITS, EGM_GAIN)
        self.right_stands(turned(Side.RIGHT, radians(80.0)))

        def loop(controller: JointTrajectoryController) -> VirtualArmRig:
            limiter = Limiter(YUMI_LIMITS, collisions=self.both.arm(Side.LEFT))
            arm = VirtualArmRig({NAME: controller}, side=Side.LEFT, limiter=limiter, position=FORWARD[Side.LEFT])
            arm.start()
            return arm

        self.arm = TrajectoryArm(loop, {})

    def right_stands(self, position: Joints) -> None:
        self.both.arm(Side.RIGHT).sent(position, Setpoint(position), None)

    def go_towards_it(self, tolerances: Tolerances | None = None) -> Joints:
        goal = turned(Side.LEFT, radians(-60.0))
        points = [TrajectoryPoint(0.0, FORWARD[Side.LEFT]), TrajectoryPoint(2.0, goal)]
        self.arm.follow(planned(points), tolerances=tolerances)
        return goal


def test_trajectory_of_an_arm_that_is_held_does_not_end_before_it_is_there() -> None:
    beside = BesideArm()
    goal = beside.go_towards_it()
    beside.arm.run(4.0)
    assert not beside.arm.ended
    assert abs(beside.arm.position[0] - goal[0]) > 0.06
    limited = beside.both.arm(Side.LEFT).limited
    assert limited is not None
    assert limited.part.startswith("left ")
    beside.right_stands(FORWARD[Side.RIGHT])
    assert beside.arm.end().outcome is TrajectoryOutcome.SUCCEEDED
    assert beside.arm.position == pytest.approx(goal, abs=0.05)


def test_arm_that_was_held_stays_when_its_trajectory_was_aborted_and_its_way_becomes_free() -> None:
    beside = BesideArm()
    beside.go_towards_it(Tolerances(goal_time=1.0))
    assert beside.arm.end().outcome is TrajectoryOutcome.ABORTED
    beside.arm.run(1.0)
    stood = beside.arm.position
    beside.right_stands(FORWARD[Side.RIGHT])
    beside.arm.run(1.0)
    assert beside.arm.position == pytest.approx(stood, abs=0.01)


def test_arms_that_were_led_into_each_other_come_back() -> None:
    """As the demonstration leads them: each joint on its own way, which is not the straight one."""
    arms = ApartArms(GOALS, obstacles=())
    for _ in range(500):
        arms.cycle({side: behind(goal) for side, goal in MEETING.items()})
    assert all(arms.both.arm(side).limited is not None for side in Side)
    for _ in range(500):
        arms.cycle({side: behind(goal) for side, goal in GOALS.items()})
    for side, goal in GOALS.items():
        assert arms.arms[side].position == pytest.approx(goal, abs=radians(0.1))


def pushed(drive: Callable[[Joints], Drive], noise: float = 0.0) -> ApartArms:
    """Both arms sent to where they meet, from shortly before, until no command has changed for 0.4 s.

    Until then robots that lag have caught up.
    """
    arms, generator = ApartArms(BEFORE_MEETING, obstacles=()), np.random.default_rng(1)

    def noisy(goal: Joints) -> Drive:
        return lambda *its: ArmCommand(
            joints(list(np.add(drive(goal)(*its).position, noise * generator.normal(size=7))))
        )

    drives = {side: noisy(goal) if noise else drive(goal) for side, goal in MEETING.items()}
    stood, before = 0, arms.commanded()
    for _ in range(1000):
        arms.cycle(drives)
        now = arms.commanded()
        stood, before = stood + 1 if now == before else 0, now
        if stood == 100:
            break
    else:
        raise AssertionError(f"The arms go on for ever, at {now}.")
    counts = {side: arms.limiters[side].counters.kept_apart for side in Side}
    for cycle in range(250):
        arms.cycle(drives)
        assert arms.commanded() == before
        for side in Side:
            assert arms.both.arm(side).limited is not None
            assert arms.limiters[side].counters.kept_apart == counts[side] + cycle + 1
    return arms


@pytest.mark.parametrize("drive", [to, behind], ids=["goal", "proportional"])
def test_arms_that_push_at_each_other_rest_until_one_retreats(drive: Callable[[Joints], Drive]) -> None:
    """The arm that is held then goes on by itself; and so does the other one when its goal changes."""
    arms = pushed(drive)
    stood = arms.commanded()
    for _ in range(600):
        arms.cycle({Side.RIGHT: drive(MEETING[Side.RIGHT]), Side.LEFT: drive(GOALS[Side.LEFT])})
    assert arms.sent[Side.LEFT].position == pytest.approx(GOALS[Side.LEFT], abs=2e-3)
    assert arms.sent[Side.RIGHT].position == pytest.approx(MEETING[Side.RIGHT], abs=2e-3)
    assert dist(stood[Side.RIGHT], MEETING[Side.RIGHT]) > 0.1


@pytest.mark.parametrize("drive", [to, behind], ids=["goal", "proportional"])
def test_noise_of_what_is_desired_does_not_move_arms_that_push_at_each_other(drive: Callable[[Joints], Drive]) -> None:
    pushed(drive, noise=5e-5)


def test_stream_along_a_boundary_is_not_held() -> None:
    arms = ApartArms({Side.RIGHT: FORWARD[Side.RIGHT], Side.LEFT: turned(Side.LEFT, radians(-80.0))}, obstacles=())
    goal, before = list(turned(Side.RIGHT, radians(70.0))), arms.commanded()[Side.RIGHT]
    for _ in range(400):
        goal[5] += 0.1 * CYCLE
        arms.cycle({Side.RIGHT: to(joints(goal))})
        assert arms.commanded()[Side.RIGHT] != before  # one that is held stands
        before = arms.commanded()[Side.RIGHT]
    assert arms.limiters[Side.RIGHT].counters.kept_apart > 100


def test_arm_that_is_held_goes_on_as_soon_as_the_parts_may_touch() -> None:
    arms = pushed(to)
    arms.both.permit(("right arm", "left arm"))
    for _ in range(300):
        arms.cycle({side: to(goal) for side, goal in MEETING.items()})
    assert arms.commanded() == MEETING


def test_every_cycle_in_which_an_arm_is_kept_apart_says_by_what() -> None:
    """Also while it brakes from speed, far from the boundary."""
    arms = ApartArms(FORWARD, obstacles=())
    goals = {side: turned(side, radians(sign * 168.0)) for side, sign in ((Side.RIGHT, 1.0), (Side.LEFT, -1.0))}
    before = dict.fromkeys(Side, 0)
    for _ in range(150):
        arms.cycle({side: to(goal) for side, goal in goals.items()})
        for side in Side:
            count = arms.limiters[side].counters.kept_apart
            assert count == before[side] or arms.both.arm(side).limited is not None
            before[side] = count
    assert min(before.values()) > 5


def test_control_process_without_a_garbage_collector_keeps_nothing_of_past_cycles() -> None:
    arms = ApartArms(READY)
    gc.collect()
    gc.disable()
    try:
        for cycle in range(200):
            arms.cycle({side: to(FORWARD[side]) for side in Side})
            if cycle == 100:
                before = len(gc.get_objects())
        assert len(gc.get_objects()) - before < 20
    finally:
        gc.enable()


def test_permitted_pairs_may_touch_and_no_others() -> None:
    arms = ApartArms(FORWARD, obstacles=())
    arms.both.permit(("right arm", "left arm"))
    goals = {side: turned(side, radians(sign * 168.0)) for side, sign in ((Side.RIGHT, 1.0), (Side.LEFT, -1.0))}
    lowest = np.inf
    for _ in range(300):
        arms.cycle({side: to(goal) for side, goal in goals.items()})
        lowest = min(lowest, between_arms(arms, arms.measured()))
    assert lowest < 0.0
    body = next(each for each in near(arms, arms.commanded()) if each.other == "body")
    assert body.distance >= BODY_MARGIN - ROUNDING


def test_gripper_is_all_that_is_fixed_to_the_tool_frame() -> None:
    """The pair that is allowed for handing over: the fingers are the first to meet."""
    arms = ApartArms(FORWARD, obstacles=())
    arms.both.permit(("right gripper", "left gripper"))
    goals = {side: turned(side, radians(sign * 168.0)) for side, sign in ((Side.RIGHT, 1.0), (Side.LEFT, -1.0))}
    fingers = np.inf
    for _ in range(300):
        arms.cycle({side: to(goal) for side, goal in goals.items()})
        pairs = near(arms, arms.commanded())
        between = (it.distance for it in pairs if (it.part, it.other) == ("right fingers", "left fingers"))
        fingers = min(fingers, *between, np.inf)
        hands = {f"{side.word} {part}" for side in Side for part in ("gripper", "fingers", "cup 1", "cup 2", "camera")}
        assert all(it.distance > BODY_MARGIN - ROUNDING for it in pairs if not {it.part, it.other} <= hands)
    assert fingers < 0.0


def test_a_box_named_as_a_part_is_none_of_the_arm() -> None:
    wall = Obstacle("right wall", Pose((0.0, -2.0, 0.0), UPRIGHT), (0.1, 0.1, 0.1))
    arms = ApartArms(FORWARD, obstacles=(wall,))
    without = ApartArms(FORWARD, obstacles=())
    assert arms.both.pairs_of("right arm", "left arm") == without.both.pairs_of("right arm", "left arm") > 0


def test_unknown_parts_are_no_pair() -> None:
    arms = ApartArms(READY, obstacles=(TABLE,))
    assert arms.both.pairs_of("right gripper", "table")
    assert not arms.both.pairs_of("right gripper", "shelf")


@pytest.mark.parametrize(
    ("name", "start", "share"),
    [("body", READY, 1.0), ("table", READY, 0.3), ("post", FORWARD, 0.3), ("other arm", FORWARD, 1.0)],
)
def test_arms_whose_links_are_lost_at_any_time_coast_into_nothing(
    name: str, start: dict[Side, Joints], share: float
) -> None:
    """A robot goes on by its speed over its gain, which is further than it would brake."""
    arms, least = ApartArms(start), np.inf
    group, still = (0, "") if name == "other arm" else (1, name)
    for cycle in range(60):
        if cycle % 10 == 0:  # the way there is another one meanwhile
            towards = {side: scaled_by(share, at_nearest(arms, side, group, name=still)) for side in Side}
        arms.cycle({side: at_speed(speeds) for side, speeds in towards.items()})
        if cycle % 3 == 0:
            least = min(least, arms.least_without_links())
    assert least > -COLLISION_PADDING


def test_planned_motion_that_ends_before_something_is_as_quick_and_the_robot_follows_later() -> None:
    """At full speed towards the left gripper, 20 mm from which it ends."""
    start = joints([0.433, -1.496, 0.125, -0.273, -0.806, 0.429, 0.551])
    goal = joints([0.32, -0.784, 0.738, 1.089, -1.354, 0.251, -0.934])
    left = joints([0.683, -1.222, 0.503, 0.244, 0.158, 0.222, 1.759])
    arms = ApartArms({Side.RIGHT: start, Side.LEFT: left})
    way, least, late = point_travel(Setpoint(start), goal, YUMI_LIMITS.slower(0.95, 0.9)), np.inf, 0.0

    def follow(these: ApartArms, side: Side) -> ArmCommand:
        now = way.setpoint(len(these.costs) * CYCLE)
        return ArmCommand(now.position, now.velocity)

    behind = (SERVO_CYCLES + 0.5) * CYCLE  # by which a position is sent later than its speed
    for cycle in range(450):
        arms.cycle({Side.RIGHT: follow})
        late = max(late, dist(arms.sent[Side.RIGHT].position, arms.arms[Side.RIGHT].planned))
        if cycle % 10 == 0 and cycle * CYCLE < way.duration:
            least = min(least, arms.least_without_links())
        sent = way.setpoint(max(0.0, len(arms.costs) * CYCLE - behind)).position
        assert arms.sent[Side.RIGHT].position == pytest.approx(sent, abs=0.02)
    assert arms.limiters[Side.RIGHT].counters.kept_apart == 0
    assert late > 0.1
    assert least > -COLLISION_PADDING
    assert arms.arms[Side.RIGHT].planned == pytest.approx(goal, abs=2e-3)


@pytest.mark.parametrize("seed", range(3))
def test_adversarial_cycles_never_break_the_margin(seed: int) -> None:
    generator = np.random.default_rng(seed)
    arms = ApartArms(READY)
    drives, left = {}, dict.fromkeys(Side, 0)
    for cycle in range(120):
        for side in Side:
            renew_drive(generator, arms, side, drives, left)
        arms.cycle(drives)
        if cycle % 4 == 0:
            assert least_kept(arms, arms.commanded())
            assert nearest(arms, arms.measured()) > -COLLISION_PADDING


def test_loop_reports_which_parts_limit_an_arm() -> None:
    """The left forearm, sent from home into the body."""
    model = CollisionModel(SERVO_GRIPPERS)
    both, goals = CollisionLimiter(model, YUMI_LIMITS, EGM_GAIN), MemoryBuffer()
    both.arm(Side.RIGHT).sent(home(Side.RIGHT), Setpoint(home(Side.RIGHT)), None)
    limiter = Limiter(YUMI_LIMITS, collisions=both.arm(Side.LEFT))
    arm = VirtualArmRig({"controller": JointPositionController(goals)}, side=Side.LEFT, limiter=limiter)
    arm.start()
    arm.switch_to("controller")
    goal = joints([value + 0.3 for value in home(Side.LEFT)])
    write_goal(goals, arm.snapshot.session, goal)
    arm.run(2.0)
    (event, *_) = [event for event in arm.events if isinstance(event, KeptApart)]
    assert event.said == message("motion_limited", arm="left", limited=event.limited.said)
    assert event.limited.part.startswith("left ")
    assert event.limited.other == "body"
    assert arm.snapshot.limiter.kept_apart > 0
    assert max(abs(a - b) for a, b in zip(arm.snapshot.position, goal, strict=True)) > 0.1
    shapes = CollisionModel(SERVO_GRIPPERS)
    now = {Side.RIGHT: home(Side.RIGHT), Side.LEFT: arm.snapshot.position}
    assert shapes.nearest(now)[0].distance > BODY_MARGIN - ROUNDING


def test_arm_is_not_limited_by_what_has_left() -> None:
    """Its goal is 4 mm too near to the other arm, which comes, wobbles and goes."""
    *_, goal, left = at_boundary(SHAPES)
    arms = ApartArms({Side.RIGHT: FORWARD[Side.RIGHT], Side.LEFT: left}, obstacles=())
    limited = 0
    for cycle in range(700):
        wobble = left[0] - radians(1.5) * (1.0 - np.cos(cycle / 12.0))
        arms.cycle({Side.RIGHT: to(goal), Side.LEFT: to(turned(Side.LEFT, wobble))})
        limited += arms.both.arm(Side.RIGHT).limited is not None
    for _ in range(600):
        arms.cycle({Side.RIGHT: to(goal), Side.LEFT: to(FORWARD[Side.LEFT])})
    assert limited
    assert arms.both.arm(Side.RIGHT).limited is None
    assert arms.sent[Side.RIGHT].position == pytest.approx(goal, abs=1e-6)


@pytest.mark.parametrize("nearer", [0.00005, 0.00015, 0.00025, 0.00035])
def test_arm_that_begins_again_a_little_nearer_within_its_margin_may_leave(nearer: float) -> None:
    tip = tool0_to_body(Side.RIGHT, FORWARD[Side.RIGHT], Pose((0.0, 0.0, 0.155), UPRIGHT)).position
    box = Obstacle("box", Pose(tip, UPRIGHT), (0.03, 0.03, 0.03))
    arms = ApartArms(FORWARD, obstacles=(box,))
    for _ in range(30):
        arms.cycle({Side.RIGHT: at_speed(scaled_by(0.1, at_nearest(arms, Side.RIGHT, 1.0, name="box")))})
    start, inwards = np.array(arms.sent[Side.RIGHT].position), np.array(at_nearest(arms, Side.RIGHT, 1.0, name="box"))

    def distance(share: float) -> float:
        positions = {**arms.commanded(), Side.RIGHT: joints((start + share * inwards).tolist())}
        return arms.shapes.nearest(positions)[0].distance

    low, high, least = 0.0, 0.05, distance(0.0) - nearer
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if distance(middle) > least else (low, middle)
    there = joints((start + low * inwards).tolist())
    both, away = arms.both.arm(Side.RIGHT), joints((start - 0.2 * inwards).tolist())
    arms.limiters[Side.RIGHT].note_interruption()
    limiter = ReportedLimiter(YUMI_LIMITS, collisions=both)
    robot = VirtualArm(Side.RIGHT, there, ArmModel(supervises_load=False))
    robot.switch_motors_on()
    robot.start_egm(EgmMotionParameters(bandwidth=0.0, max_speed=10.0))
    for cycle in range(400):
        state = ArmState(
            1e3 + cycle * CYCLE, CYCLE if cycle else 0.0, 1, robot.position, ZERO_JOINTS, robot.planned, True
        )
        command = limiter.limit(state, ArmCommand(away) if cycle else None)
        robot.set_reference(*command)
        limiter.observe(state)
        robot.advance(CYCLE)
    assert dist(command.position, there) > 0.9 * dist(away, there)


def test_command_that_is_no_number_is_refused_beside_a_boundary_too() -> None:
    arms = ApartArms(FORWARD, obstacles=())
    for cycle in range(600):
        arms.cycle({side: to(turned(side, radians(168.0 if side is Side.RIGHT else -168.0))) for side in Side})
        if cycle > 300 and arms.both.arm(Side.RIGHT).limited:  # not in every cycle: it goes nearer by small steps
            break
    assert arms.both.arm(Side.RIGHT).limited
    before = arms.limiters[Side.RIGHT].counters.refused
    arms.cycle({Side.RIGHT: to((inf,) * 7)})
    assert arms.limiters[Side.RIGHT].counters.refused == before + 1


def test_arm_that_is_heard_again_coasts_no_further_though_it_is_sent_the_same() -> None:
    both = CollisionLimiter(CollisionModel(SERVO_GRIPPERS), YUMI_LIMITS, EGM_GAIN)
    arm, (stands, _, too_near, left) = both.arm(Side.RIGHT), at_boundary(both.model)
    both.arm(Side.LEFT).sent(left, Setpoint(left), None)
    arm.sent(stands, Setpoint(stands), None)
    Limiter(YUMI_LIMITS, collisions=arm).note_interruption()
    *_, coasts, j1, j2, j3, j4, j5, j6, j7 = MOTION_STRUCT.unpack(motion_of(both, Side.RIGHT))
    assert coasts
    assert (j1, j2, j3, j4, j5, j6, j7) == stands
    assert not arm.accepts(stands, Setpoint(too_near), None)
    arm.sent(stands, Setpoint(stands), None)
    assert not MOTION_STRUCT.unpack(motion_of(both, Side.RIGHT))[-8]
