"""Whatever drives them, the arms keep apart from each other and from what stands around them."""

from __future__ import annotations

from math import radians

import numpy as np
import pytest

from apart_arms import TABLE, UPRIGHT, ApartArms, at_nearest, at_speed, behind, random_drive, scaled_by, standing, to
from yumi.control.collisions import BODY_MARGIN, MARGIN, ArmMotion, CollisionLimiter
from yumi.control.controller import MemoryBuffer, write_goal
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.events import KeptApart
from yumi.control.limiter import Limiter
from yumi.control.motion import EGM_GAIN, Setpoint, stop
from yumi.robot.collision import PADDING, Array, BallModel, CollisionModel, Distance, Obstacle, SweptArm
from yumi.robot.description import SERVO_GRIPPERS
from yumi.robot.joints import YUMI_LIMITS, ArmCommand, Joints, Pose, Side, home, joints, named_pose
from yumi.robot.kinematics import tool0_to_body
from yumi_evaluation.virtual_rig import VirtualArmRig

READY = {side: named_pose(side, "ready") for side in Side}
ROUNDING = 1e-3


def forward(side: Side) -> Joints:
    """The forearms lifted and turned outwards, with room on all sides."""
    sign = 1.0 if side is Side.RIGHT else -1.0
    return joints([radians(angle) for angle in (-sign * 40.0, -90.0, -sign * 135.0, 30.0, 0.0, 40.0, 0.0)])


FORWARD = {side: forward(side) for side in Side}


def turned(side: Side, joint_1: float) -> Joints:
    return joints([joint_1, *FORWARD[side][1:]])


def nearest(arms: ApartArms, positions: dict[Side, Joints]) -> Distance:
    return arms.shapes.nearest(positions)[0]


def between_arms(arms: ApartArms, positions: dict[Side, Joints]) -> float:
    """The smallest distance, but of the shoulders, which are as near to the other arm as to the body [m]."""
    right, left = (standing(arms.model, side, positions[side]) for side in Side)
    moving = [np.flatnonzero(arm.part_frames > 0) for arm in arms.model.arms.values()]
    pairs = [index.ravel() for index in np.meshgrid(*moving, indexing="ij")]
    within = np.full(len(pairs[0]), 0.1)
    return float(arms.model.between(Side.RIGHT, right, left, (pairs[0], pairs[1]), within).distances.min())


def least_kept(arms: ApartArms, positions: dict[Side, Joints]) -> bool:
    """Whether all but the body is beyond the margin, and the body as far as it has to be."""
    near = arms.shapes.nearest(positions, 100)

    def least(each: Distance) -> float:
        return BODY_MARGIN if each.other == "body" or "shoulder" in each.part + each.other else MARGIN

    return all(each.distance >= least(each) - ROUNDING for each in near)


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
        names |= {limited.other for side in Side if (limited := arms.both.limited(side))}
    assert MARGIN - ROUNDING <= lowest <= MARGIN + 0.01
    assert "left fingers" in names


def test_arm_that_starts_within_the_margin_may_leave_it_and_comes_no_nearer() -> None:
    tip = tool0_to_body(Side.RIGHT, FORWARD[Side.RIGHT], Pose((0.0, 0.0, 0.155), UPRIGHT)).position
    arms = ApartArms(FORWARD, obstacles=(Obstacle("box", Pose(tip, UPRIGHT), (0.03, 0.03, 0.03)),))
    first = nearest(arms, FORWARD).distance
    assert first < MARGIN - ROUNDING
    for _ in range(50):
        arms.cycle({Side.RIGHT: at_speed(scaled_by(0.1, at_nearest(arms, Side.RIGHT, 1, name="box")))})
    assert nearest(arms, arms.commanded()).distance >= first - 1e-4
    for _ in range(50):
        arms.cycle({Side.RIGHT: at_speed(scaled_by(0.1, at_nearest(arms, Side.RIGHT, 1, 1.0, "box")))})
    assert nearest(arms, arms.commanded()).distance > MARGIN


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
        if min(nearest(arms, way).distance for way in ways) < 0.01:
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
        names |= {limited.other for limited in [arms.both.limited(Side.RIGHT)] if limited}
    assert lowest >= MARGIN - ROUNDING
    # Nothing tells the limiter where RAPID or a hand has moved it since: the log says what it is based on.
    assert names
    assert all(name.startswith("left ") and name.endswith(" where EGM reported it last") for name in names)


def test_arm_that_stands_at_a_boundary_may_go_on_when_the_other_one_has_left() -> None:
    both = CollisionLimiter(BallModel(CollisionModel(SERVO_GRIPPERS)), YUMI_LIMITS, EGM_GAIN)
    # Both forearms towards each other: 1 mm is left, then 4 mm would be missing.
    before, stands, goal = (turned(Side.RIGHT, radians(angle)) for angle in (34.0, 34.5, 36.1))
    left = turned(Side.LEFT, radians(-80.0))
    for side, position in ((Side.LEFT, left), (Side.RIGHT, before)):
        both.sent(side, position, Setpoint(position), None)
    assert both.accepts(Side.RIGHT, stands, Setpoint(stands), None)
    for _ in range(3):
        assert both.steered(Side.RIGHT, ArmCommand(goal)) != ArmCommand(goal)
        assert both.accepts(Side.RIGHT, stands, Setpoint(stands), None)
    both.sent(Side.LEFT, FORWARD[Side.LEFT], Setpoint(FORWARD[Side.LEFT]), None)
    assert both.accepts(Side.RIGHT, stands, Setpoint(stands), None)
    assert both.steered(Side.RIGHT, ArmCommand(goal)) == ArmCommand(goal)
    assert both.limited(Side.RIGHT) is None


def test_arm_that_stands_at_a_boundary_may_go_on_when_the_parts_may_touch() -> None:
    both = CollisionLimiter(BallModel(CollisionModel(SERVO_GRIPPERS)), YUMI_LIMITS, EGM_GAIN)
    before, stands, goal = (turned(Side.RIGHT, radians(angle)) for angle in (34.0, 34.5, 36.1))
    left = turned(Side.LEFT, radians(-80.0))
    for side, position in ((Side.LEFT, left), (Side.RIGHT, before)):
        both.sent(side, position, Setpoint(position), None)
    assert both.accepts(Side.RIGHT, stands, Setpoint(stands), None)
    both.permit(("right arm", "left arm"))
    assert both.steered(Side.RIGHT, ArmCommand(goal)) == ArmCommand(goal)


def out_of(model: BallModel, way: SweptArm, postures: Array) -> float:
    """By how much a ball is out of where the arm may come, in one of these postures (n, 7) [rad], at most [m]."""
    arm, at = model.arms[Side.RIGHT], np.arange(len(postures))
    still = arm.sweep(postures, at, at, np.zeros_like(postures))
    balls, lines = (index.ravel() for index in np.indices((len(arm.radii), len(way.starts))))
    middles, halves = arm.lines(way, balls, lines)
    excess = way.excess[arm.part_of[balls], lines]
    worst = -np.inf
    for posture in at:
        places, _ = arm.lines(still, balls, np.full(len(balls), posture))
        apart = places - middles
        shares = np.einsum("nx,nx->n", apart, halves) / np.maximum(np.einsum("nx,nx->n", halves, halves), 1e-18)
        apart -= np.clip(shares, -1.0, 1.0)[:, None] * halves
        out = np.linalg.norm(apart, axis=1) - excess
        worst = max(worst, float(out.reshape(len(arm.radii), -1).min(1).max()))
    return worst


def ways_to_rest(planned: Joints, sent: Setpoint, count: int = 40) -> Array:
    """Where the position sent comes when it brakes, and where a robot comes that follows it late, (n, 7) [rad]."""
    braking = stop(sent, YUMI_LIMITS)
    steps = 20 * count
    step = (braking.duration + 1.0 / EGM_GAIN) / steps
    robot, postures = np.array(planned), []
    for index in range(steps):
        middle = np.array(braking.at((index + 0.5) * step).position)
        robot = middle + (robot - middle) * np.exp(-EGM_GAIN * step)
        if index % 20 == 0:
            postures += [np.array(braking.at(index * step).position), robot]
    return np.array(postures)


def test_joint_that_turns_round_stays_in_its_swept_way() -> None:
    """It goes 7.4 mrad forward, then rests 0.2 mrad behind where it began."""
    model, start = BallModel(CollisionModel(SERVO_GRIPPERS)), READY[Side.RIGHT]
    sent = Setpoint(start, joints([0.5, *[0.0] * 6]), joints([-20.0, *[0.0] * 6]))
    way = ArmMotion(start, sent, None, YUMI_LIMITS, EGM_GAIN).way(Side.RIGHT, model)
    assert out_of(model, way, ways_to_rest(start, sent)) < 1e-5


@pytest.mark.parametrize("seed", range(6))
def test_ways_to_rest_stay_in_what_is_swept(seed: int) -> None:
    """Speeds and accelerations of opposite signs; the robot is behind, also to the side of where it goes."""
    model, generator = BallModel(CollisionModel(SERVO_GRIPPERS)), np.random.default_rng(seed)
    top, jerk = np.array(YUMI_LIMITS.acceleration), np.array(YUMI_LIMITS.jerk)
    for moving in (1, 1, 1, 2, 2, 7):
        which = np.isin(np.arange(7), generator.permutation(7)[:moving])
        acceleration = which * generator.uniform(-1.0, 1.0, 7) * top
        # Below this speed a joint turns round before it rests.
        turning = acceleration * np.abs(acceleration) / (2.0 * jerk)
        velocity = -turning * generator.uniform(0.0, 1.5, 7) * generator.choice([1.0, 4.0])
        lead = 0.15 * velocity + generator.normal(0.0, 0.05, 7) * generator.integers(2)
        sent = Setpoint(READY[Side.RIGHT], joints(list(velocity)), joints(list(acceleration)))
        planned = joints(list(np.array(sent.position) - lead))
        way = ArmMotion(planned, sent, None, YUMI_LIMITS, EGM_GAIN).way(Side.RIGHT, model)
        assert out_of(model, way, ways_to_rest(planned, sent)) < 1e-5


def test_permitted_pairs_may_touch_and_no_others() -> None:
    arms = ApartArms(FORWARD, obstacles=())
    arms.both.permit(("right arm", "left arm"))
    goals = {side: turned(side, radians(sign * 168.0)) for side, sign in ((Side.RIGHT, 1.0), (Side.LEFT, -1.0))}
    lowest = np.inf
    for _ in range(300):
        arms.cycle({side: to(goal) for side, goal in goals.items()})
        lowest = min(lowest, between_arms(arms, arms.measured()))
    assert lowest < 0.0
    body = next(each for each in arms.shapes.nearest(arms.commanded(), 500) if each.other == "body")
    assert body.distance >= BODY_MARGIN - ROUNDING


def test_unknown_parts_are_no_pair() -> None:
    arms = ApartArms(READY, obstacles=(TABLE,))
    assert arms.both.pairs_of("right gripper", "table")
    assert not arms.both.pairs_of("right gripper", "shelf")


@pytest.mark.parametrize("seed", range(3))
def test_adversarial_cycles_never_break_the_margin(seed: int) -> None:
    generator = np.random.default_rng(seed)
    arms = ApartArms(READY)
    drives, left = {}, dict.fromkeys(Side, 0)
    for cycle in range(120):
        for side in Side:
            left[side] -= 1
            if left[side] < 0:
                left[side] = int(generator.integers(5, 120))
                drives[side] = random_drive(generator, arms, side) or (lambda *_: None)
        arms.cycle(drives)
        if cycle % 4 == 0:
            assert least_kept(arms, arms.commanded())
            assert nearest(arms, arms.measured()).distance > -PADDING


def test_loop_reports_which_parts_limit_an_arm() -> None:
    """The left forearm, sent from home into the body."""
    model = BallModel(CollisionModel(SERVO_GRIPPERS))
    both, goals = CollisionLimiter(model, YUMI_LIMITS, EGM_GAIN), MemoryBuffer()
    both.sent(Side.RIGHT, home(Side.RIGHT), Setpoint(home(Side.RIGHT)), None)
    limiter = Limiter(YUMI_LIMITS, collisions=both.arm(Side.LEFT))
    arm = VirtualArmRig({"controller": JointPositionController(goals)}, side=Side.LEFT, limiter=limiter)
    arm.start()
    arm.switch_to("controller")
    goal = joints([value + 0.3 for value in home(Side.LEFT)])
    write_goal(goals, arm.snapshot.session, goal)
    arm.run(2.0)
    (event, *_) = [event for event in arm.events if isinstance(event, KeptApart)]
    assert str(event).startswith("Left arm: motion limited by left ")
    assert event.limited.other == "body"
    assert arm.snapshot.kept_apart > 0
    assert max(abs(a - b) for a, b in zip(arm.snapshot.position, goal, strict=True)) > 0.1
    shapes = CollisionModel(SERVO_GRIPPERS)
    now = {Side.RIGHT: home(Side.RIGHT), Side.LEFT: arm.snapshot.position}
    assert shapes.nearest(now)[0].distance > BODY_MARGIN - ROUNDING
