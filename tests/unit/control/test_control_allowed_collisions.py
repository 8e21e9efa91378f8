"""Parts that may touch for a while: who may allow it, how slow the arms are, and when it ends."""

from __future__ import annotations

from math import degrees, nan
from typing import cast

import pytest

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.description import SERVO_GRIPPERS
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, home, joints
from abb_runtime.clock import ManualClock
from refusals import assert_says, refused
from yumi.control.allowed_collisions import CONTACT_SPEED_SCALE, AllowedCollisions
from yumi.control.collisions import CollisionLimiter
from yumi.control.controllers.joint_goal import JointGoal, JointGoalController
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.goals import MemoryBuffer, write_goal
from yumi.control.limiter import Limiter
from yumi.control.loop import ArmLoop
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.control.motion.setpoint import Setpoint
from yumi.control.speed_scale import SpeedFactor, SpeedScale
from yumi.core.collision import CollisionModel
from yumi_evaluation.virtual_time import VirtualArmRig

RIGHT, LEFT, TABLE = "right gripper", "left gripper", "table"


class Arm:
    is_moving, is_fast, is_running = False, False, True
    highest = speed_scale = 1.0

    def check_stands(self) -> None:
        if self.is_moving:
            raise CommandRefused(message("arm_moves", arm="right"))

    def cap_speed(self, highest: float) -> None:
        self.highest = highest
        if not self.is_fast:
            self.speed_scale = highest


class Collisions:
    """Notes what may touch."""

    permitted: tuple[tuple[str, str], ...] = ()

    def pairs_of(self, part: str, other: str) -> int:
        return int({part, other} <= {RIGHT, LEFT, TABLE})

    def permit(self, *pairs: tuple[str, str]) -> None:
        self.permitted = pairs


class Bench:
    def __init__(self) -> None:
        self.clock, self.arms, self.collisions = ManualClock(), (Arm(), Arm()), Collisions()
        limiter, arms = cast("CollisionLimiter", self.collisions), cast("tuple[ArmLoop, ...]", self.arms)
        self.allowed = AllowedCollisions(arms, limiter, self.clock.now)

    @property
    def state(self) -> tuple[tuple[tuple[str, str], ...], tuple[float, ...], list[Message]]:
        """What may touch, the arms' speeds, and what was reported."""
        events = [event.said for event in self.allowed.take_events()]
        return self.collisions.permitted, tuple(arm.highest for arm in self.arms), events


@pytest.fixture
def bench() -> Bench:
    return Bench()


SLOW, FULL = (CONTACT_SPEED_SCALE,) * 2, (1.0, 1.0)
OVER = message("all_kept_apart")


def test_parts_touch_slowly_until_it_is_ended(bench: Bench) -> None:
    bench.allowed.allow(RIGHT, LEFT, 10.0)
    assert bench.state == (((LEFT, RIGHT),), SLOW, [message("may_touch", pairs=("left gripper - right gripper",))])
    bench.allowed.end(LEFT, RIGHT)  # whichever is named first
    assert bench.state == ((), FULL, [OVER])
    bench.allowed.end(LEFT, RIGHT)
    assert bench.state == ((), FULL, [])


def test_the_end_of_parts_that_do_not_exist_is_refused(bench: Bench) -> None:
    bench.allowed.allow(RIGHT, LEFT, 10.0)
    with refused(CommandRefused, "no_such_parts", part="right gripper", other="shelf"):
        bench.allowed.end(RIGHT, "shelf")
    assert bench.state[0] == ((LEFT, RIGHT),)


def test_each_pair_has_its_own_time(bench: Bench) -> None:
    bench.allowed.allow(RIGHT, LEFT, 2.0)
    bench.allowed.allow(RIGHT, TABLE, 5.0)
    assert len(bench.state[0]) == 2
    bench.clock.advance(1.9)
    assert len(bench.state[0]) == 2
    bench.clock.advance(0.1)
    assert bench.state == (((RIGHT, TABLE),), SLOW, [message("may_touch", pairs=("right gripper - table",))])
    bench.clock.advance(3.0)
    assert bench.state == ((), FULL, [OVER])


def test_the_time_begins_anew_when_it_is_asked_for_again_while_the_arms_move(bench: Bench) -> None:
    bench.allowed.allow(RIGHT, LEFT, 2.0)
    bench.arms[0].is_moving = True
    bench.clock.advance(1.5)
    bench.allowed.allow(LEFT, RIGHT, 2.0)
    bench.clock.advance(1.5)
    assert bench.state[:2] == (((LEFT, RIGHT),), SLOW)
    bench.clock.advance(0.6)
    assert bench.state[:2] == ((), FULL)


@pytest.mark.parametrize(
    ("part", "other", "seconds", "said"),
    [
        (RIGHT, "shelf", 1.0, message("no_such_parts", part="right gripper", other="shelf")),
        (RIGHT, LEFT, 0.0, message("contact_time_out_of_range", time=0.0, longest=60.0)),
        (RIGHT, LEFT, -1.0, message("contact_time_out_of_range", time=-1.0, longest=60.0)),
        (RIGHT, LEFT, nan, message("contact_time_out_of_range", time=nan, longest=60.0)),
        (RIGHT, LEFT, 61.0, message("contact_time_out_of_range", time=61.0, longest=60.0)),
    ],
)
def test_what_cannot_be_allowed_is_refused_and_changes_nothing(
    bench: Bench, part: str, other: str, seconds: float, said: Message
) -> None:
    with pytest.raises(CommandRefused) as refusal:
        bench.allowed.allow(part, other, seconds)
    assert refusal.value.said == said
    assert bench.state == ((), FULL, [])


def test_it_is_refused_while_an_arm_moves(bench: Bench) -> None:
    bench.arms[1].is_moving = True
    with refused(CommandRefused, "contact_is_for_slow_motions", reason=message("arm_moves", arm="right")):
        bench.allowed.allow(RIGHT, LEFT, 1.0)
    assert bench.state == ((), FULL, [])


def test_it_ends_when_an_arm_stops_following(bench: Bench) -> None:
    bench.arms[0].is_running = False
    bench.allowed.allow(RIGHT, LEFT, 10.0)
    bench.arms[0].is_running = True
    assert bench.state[0] == ((LEFT, RIGHT),)
    bench.arms[0].is_running = False
    assert bench.state == ((), FULL, [OVER])
    bench.arms[0].is_running = True
    assert bench.state == ((), FULL, [])


def test_nothing_may_touch_before_both_arms_are_slow(bench: Bench) -> None:
    bench.arms[1].is_fast = True
    bench.allowed.allow(RIGHT, LEFT, 2.0)
    assert bench.state == ((), SLOW, [])
    bench.arms[1].speed_scale = CONTACT_SPEED_SCALE
    assert bench.state[0] == ((LEFT, RIGHT),)
    bench.arms[1].speed_scale = 1.0
    bench.allowed.end(RIGHT, LEFT)
    assert bench.state == ((), FULL, [OVER])
    bench.allowed.allow(RIGHT, LEFT, 2.0)
    bench.clock.advance(2.0)  # over before it began
    assert bench.state == ((), FULL, [])


class Driven:
    """The left arm, near the body, with a robot that follows."""

    def __init__(self) -> None:
        self.both, self.goals = CollisionLimiter(CollisionModel(SERVO_GRIPPERS), YUMI_LIMITS, EGM_GAIN), MemoryBuffer()
        right, speed = home(Side.RIGHT), SpeedScale()
        self.both.arm(Side.RIGHT).sent(right, Setpoint(right), None)
        limiter = Limiter(YUMI_LIMITS, collisions=self.both.arm(Side.LEFT))
        controllers = {
            "position": JointPositionController(self.goals, speed=speed),
            "goal": JointGoalController(MemoryBuffer(), speed=speed),
        }
        self.rig = VirtualArmRig(controllers, side=Side.LEFT, limiter=limiter, speed=speed)
        self.allowed = AllowedCollisions((self.rig.line,), self.both, self.rig.clock.now)
        self.rig.start()

    def allow(self) -> None:
        self.allowed.allow("left arm", "body", 10.0)

    def go(self, position: Joints) -> None:
        write_goal(self.goals, self.rig.snapshot.session, position)

    @property
    def sent(self) -> Joints:
        return self.rig.cycles[-1].sent.position

    def run(self, seconds: float) -> float:
        """Returns the highest speed of a joint as a share of its limit, from when parts may touch."""
        highest, may_touch = 0.0, False
        for _ in range(round(seconds / CYCLE)):
            self.rig.cycle()
            may_touch = bool(self.allowed.take_events()) or may_touch
            if may_touch:
                rows = zip(self.rig.cycles[-1].state.velocity, YUMI_LIMITS.velocity, strict=True)
                highest = max(highest, *(abs(speed) / most for speed, most in rows))
        assert may_touch
        return highest


INTO_BODY = joints([value + 0.3 for value in home(Side.LEFT)])
AWAY = joints([home(Side.LEFT)[0] + 0.1, *home(Side.LEFT)[1:]])


@pytest.mark.parametrize("controller", ["position", "goal"])
def test_it_is_allowed_after_a_motion_whose_controller_stays_active(controller: str) -> None:
    arm = Driven()
    arm.rig.switch_to(controller)
    if controller == "goal":
        arm.rig.manager.receive("goal", JointGoal(AWAY), arm.rig.line.state)
    else:
        arm.go(AWAY)
    arm.rig.run(0.1)
    with refused(CommandRefused, "contact_is_for_slow_motions", reason=message("arm_moves", arm="left")):
        arm.allow()
    arm.rig.run(3.0)
    assert arm.sent == pytest.approx(AWAY, abs=1e-6)
    arm.allow()
    arm.run(1.0)


def test_arm_that_is_held_before_its_goal_is_refused_by_name() -> None:
    arm = Driven()
    arm.rig.switch_to("position")
    arm.go(INTO_BODY)
    arm.rig.run(3.0)
    with refused(CommandRefused, "contact_is_for_slow_motions") as refusal:
        arm.allow()
    reason = refusal.value.said.values["reason"]
    assert_says(reason, "arm_held_before_goal", arm="left")
    assert degrees(reason.values["distance"]) == pytest.approx(18.0, abs=0.05)
    arm.go(arm.sent)
    arm.rig.run(1.0)
    arm.allow()


@pytest.mark.parametrize("way", ["stopped", "not heard"])
def test_it_ends_when_the_robot_stops_or_is_not_heard(way: str) -> None:
    arm = Driven()
    arm.allow()
    assert arm.run(1.0) == 0.0
    assert arm.rig.snapshot.speed_cap == CONTACT_SPEED_SCALE
    if way == "stopped":
        arm.rig.robot.arm.stop_egm()
    else:
        arm.rig.to_us = lambda datagram: ()
    arm.rig.run(1.0)
    assert not arm.rig.snapshot.is_running
    (event,) = arm.allowed.take_events()
    assert event.said == OVER


def test_arm_that_sets_out_at_once_comes_into_contact_slowly() -> None:
    arm = Driven()
    arm.rig.switch_to("position")
    arm.go(INTO_BODY)
    arm.rig.run(3.0)
    arm.go(arm.sent)
    arm.rig.run(1.0)
    arm.allow()
    arm.go(INTO_BODY)
    assert 0.05 < arm.run(3.0) < 1.2 * CONTACT_SPEED_SCALE


def test_it_is_refused_where_nothing_keeps_the_arms_apart() -> None:
    with refused(CommandRefused, "nothing_to_allow"):
        AllowedCollisions((), None, ManualClock().now).allow(RIGHT, LEFT, 1.0)


def test_speed_scale_goes_down_gradually_to_its_cap_and_back_to_what_is_set() -> None:
    box = MemoryBuffer[SpeedFactor]()
    box.write(SpeedFactor(0.8))
    scale = SpeedScale(box)
    scale.highest = CONTACT_SPEED_SCALE
    assert scale.advance(0.004)
    assert 0.7 < scale.value < 0.8
    for _ in range(250):
        scale.advance(0.004)
    assert scale.value == CONTACT_SPEED_SCALE
    box.write(SpeedFactor(0.05))
    for _ in range(250):
        scale.advance(0.004)
    assert scale.value == 0.05
    box.write(SpeedFactor(0.8))
    scale.highest = 1.0
    for _ in range(250):
        scale.advance(0.004)
    assert scale.value == 0.8
