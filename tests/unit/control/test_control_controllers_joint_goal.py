from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace
from math import nan, radians

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ZERO_JOINTS, ArmCommand, ArmState, Joints, Side, home, joints
from refusals import assert_says, refused
from yumi.control.controllers.joint_goal import GoalEnded, GoalOutcome, JointGoal, JointGoalController, StopMotion
from yumi.control.goals import MemoryBuffer, write_goal

HOME = home(Side.RIGHT)
REACHED = GoalEnded(1, GoalOutcome.REACHED, message("goal_reached"))


def moved(position: Joints, *steps_deg: float) -> Joints:
    steps = (*steps_deg, *([0.0] * (7 - len(steps_deg))))
    return joints([value + radians(step) for value, step in zip(position, steps, strict=True)])


class VirtualArmRig:
    """A controller and an arm that is one cycle behind what it is told; ``stuck`` holds it fast."""

    def __init__(self) -> None:
        self.goals = MemoryBuffer()
        self.controller = JointGoalController(self.goals)
        self.told: list[ArmCommand] = []
        self.notices: list[object] = []
        self.stuck = False
        self.state = ArmState(0.0, CYCLE, 1, HOME, ZERO_JOINTS, HOME, is_running=True)
        self.controller.activate(self.state)
        while self.controller.update(self.state) is None:
            continue

    def cycle(self) -> ArmCommand:
        command = self.controller.update(self.state)
        assert command is not None
        self.told.append(command)
        if not self.stuck:
            self.state = self.state._replace(position=command.position, velocity=command.velocity)
        self.state = self.state._replace(planned=command.position)
        self.notices += self.controller.take_reports()
        return command

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / CYCLE)):
            self.cycle()

    def until(self, is_so: Callable[[], bool]) -> None:
        for _ in range(5000):
            if is_so():
                return
            self.cycle()
        raise AssertionError("did not happen within 20 s")

    def order(self, message: object) -> None:
        self.controller.receive(message, self.state)

    def values(self, **values: float) -> None:
        defaults = {parameter.name: parameter.default for parameter in self.controller.parameters(())}
        self.controller.configure({**defaults, **values})


@pytest.fixture
def arm() -> VirtualArmRig:
    return VirtualArmRig()


def test_goal_controller_stays_where_it_was_activated(arm: VirtualArmRig) -> None:
    arm.run(0.1)
    assert arm.told[-1] == ArmCommand(HOME)
    assert arm.controller.reference == HOME


def test_goal_controller_reaches_its_goal_and_says_so_once(arm: VirtualArmRig) -> None:
    goal = moved(HOME, 10.0, 5.0, -20.0)
    arm.order(JointGoal(goal, 1))
    assert arm.controller.reference == goal
    arm.run(3.0)
    assert arm.state.position == goal
    assert arm.notices == [REACHED]


def test_goal_controller_feeds_the_speed_of_its_way_forward(arm: VirtualArmRig) -> None:
    arm.order(JointGoal(moved(HOME, 30.0)))
    arm.run(0.3)
    (before, _), (now, speed) = arm.told[-2:]
    assert speed[0] == pytest.approx((now[0] - before[0]) / CYCLE, abs=0.1)
    assert speed[0] > 0.5


@pytest.mark.parametrize("share", [0.2, 0.5, 1.0])
def test_goal_controller_keeps_its_share_of_the_speed(arm: VirtualArmRig, share: float) -> None:
    arm.values(speed_scale=share, acceleration_scale=1.0)
    arm.order(JointGoal(moved(HOME, 150.0, 1)))
    arm.until(lambda: bool(arm.notices))
    fastest = max(command.velocity[0] for command in arm.told)
    assert fastest == pytest.approx(share * YUMI_LIMITS.velocity[0], rel=1e-5)


def test_goal_controller_plans_no_joint_faster_than_egm_moves_it(arm: VirtualArmRig) -> None:
    arm.values(speed_scale=1.0, acceleration_scale=1.0, top_speed=2.0)
    arm.order(JointGoal((*HOME[:6], 3.0)))
    arm.until(lambda: bool(arm.notices))
    assert max(command.velocity[6] for command in arm.told) == pytest.approx(2.0)


def test_goal_controller_takes_the_scales_of_a_goal_before_its_own(arm: VirtualArmRig) -> None:
    arm.order(JointGoal(moved(HOME, 90.0), speed_scale=0.1, acceleration_scale=0.3))
    arm.until(lambda: bool(arm.notices))
    assert max(command.velocity[0] for command in arm.told) == pytest.approx(0.1 * YUMI_LIMITS.velocity[0])


def test_goal_controller_bends_into_a_new_goal_without_a_jump(arm: VirtualArmRig) -> None:
    arm.order(JointGoal(moved(HOME, 60.0), 1))
    arm.run(0.4)
    arm.order(JointGoal(moved(HOME, -20.0, 10.0), 2))
    arm.until(lambda: len(arm.notices) == 2)
    assert arm.notices == [
        GoalEnded(1, GoalOutcome.REPLACED, message("goal_replaced")),
        replace(REACHED, identity=2),
    ]
    steps = [new.velocity[0] - old.velocity[0] for old, new in itertools.pairwise(arm.told)]
    assert max(map(abs, steps)) <= YUMI_LIMITS.acceleration[0] * CYCLE * 1.001


def test_goal_controller_decelerates_when_it_is_told_to_stop(arm: VirtualArmRig) -> None:
    arm.order(JointGoal(moved(HOME, 90.0), 1))
    arm.run(0.5)
    begun = len(arm.told)
    arm.order(StopMotion(2))
    arm.until(lambda: len(arm.notices) == 2)
    assert arm.notices == [
        GoalEnded(1, GoalOutcome.STOPPED, message("motion_stopped")),
        replace(REACHED, identity=2),
    ]
    speeds = [command.velocity[0] for command in arm.told[begun:]]
    assert all(old - new <= YUMI_LIMITS.acceleration[0] * CYCLE * 1.001 for old, new in itertools.pairwise(speeds))
    assert arm.told[-1].velocity is ZERO_JOINTS


def test_goal_controller_brakes_harder_rather_than_leave_the_range(arm: VirtualArmRig) -> None:
    near_the_end = (YUMI_LIMITS.upper[0] - 0.02, *HOME[1:])
    arm.order(JointGoal(near_the_end, 1, 1.0, 1.0))
    arm.until(lambda: arm.state.velocity[0] > 2.5)
    arm.order(JointGoal(HOME, 2, 1.0, 0.05))
    arm.until(lambda: len(arm.notices) == 2)
    assert max(command.position[0] for command in arm.told) <= YUMI_LIMITS.upper[0]
    assert arm.state.position == HOME


@pytest.mark.parametrize("what", ["planned", "velocity"])
def test_goal_controller_holds_an_arm_until_it_stands(arm: VirtualArmRig, what: str) -> None:
    arm.controller.activate(arm.state)
    for step in range(20):
        moving = {"planned": moved(HOME, 0.1 * step), "velocity": moved(ZERO_JOINTS, 0.1 * 57.0)}
        assert arm.controller.update(arm.state._replace(**{what: moving[what]})) is None
    calm = arm.state._replace(position=moved(HOME, 1.9), planned=moved(HOME, 1.9 + 1e-3))
    commands = [arm.controller.update(calm) for _ in range(12)]
    assert commands[-1] == ArmCommand(calm.position)  # a load may keep it off its plan
    assert 9 <= commands.count(None) <= 11


def test_goal_controller_does_not_wait_for_ever_for_an_arm_that_trembles(arm: VirtualArmRig) -> None:
    arm.controller.activate(arm.state)
    trembling = arm.state._replace(velocity=moved(ZERO_JOINTS, 10.0))
    commands = [arm.controller.update(trembling) for _ in range(260)]
    assert commands.index(ArmCommand(HOME)) == pytest.approx(1.0 / CYCLE, abs=2)


def test_goal_controller_begins_an_order_that_came_too_early_once_the_arm_stands(arm: VirtualArmRig) -> None:
    arm.controller.activate(arm.state)
    goal = moved(HOME, 5.0)
    arm.order(JointGoal(goal, 1))
    assert arm.controller.update(arm.state) is None
    while arm.controller.update(arm.state) is None:
        assert arm.controller.take_reports() == []
    arm.run(1.0)
    assert arm.state.position == goal
    assert arm.notices == [REACHED]


def test_goal_controller_says_which_joint_did_not_arrive(arm: VirtualArmRig) -> None:
    arm.order(JointGoal(moved(HOME, 0.0, 10.0), 1))
    arm.stuck = True
    arm.until(lambda: bool(arm.notices))
    (ended,) = arm.notices
    assert isinstance(ended, GoalEnded)
    assert (ended.identity, ended.outcome) == (1, GoalOutcome.ABORTED)
    assert_says(ended.said, "axis_off_goal", axis=2)
    assert ended.said.values["distance"] == pytest.approx(radians(10.0), abs=1e-3)


def test_goal_controller_gives_up_when_the_arm_falls_too_far_behind(arm: VirtualArmRig) -> None:
    arm.order(JointGoal(moved(HOME, 90.0), 1))
    arm.stuck = True
    arm.until(lambda: bool(arm.notices))
    (ended,) = arm.notices
    assert isinstance(ended, GoalEnded)
    assert ended.said.code == "axis_off_path"
    assert ended.said.values["distance"] > 0.5
    assert arm.controller.reference == pytest.approx(arm.state.planned, abs=0.02)


def test_goal_controller_forgets_its_goal_when_it_is_deactivated(arm: VirtualArmRig) -> None:
    arm.order(JointGoal(moved(HOME, 90.0), 1))
    arm.controller.deactivate()
    assert arm.controller.take_reports() == [GoalEnded(1, GoalOutcome.ABORTED, message("controller_deactivated"))]
    arm.controller.activate(arm.state)
    assert arm.controller.reference == HOME


def test_goal_controller_takes_goals_from_its_mailbox(arm: VirtualArmRig) -> None:
    goal = moved(HOME, 5.0)
    write_goal(arm.goals, 1, goal)
    arm.run(2.0)
    assert arm.state.position == goal


def test_goal_controller_ignores_goals_of_another_session(arm: VirtualArmRig) -> None:
    write_goal(arm.goals, 2, moved(HOME, 5.0))
    arm.run(1.0)
    assert arm.state.position == HOME


def test_goal_controller_tells_of_a_goal_in_its_mailbox_that_is_impossible(arm: VirtualArmRig) -> None:
    write_goal(arm.goals, 1, (4.0, *HOME[1:]))
    arm.run(0.1)
    (ended,) = arm.notices
    assert isinstance(ended, GoalEnded)
    assert (ended.identity, ended.outcome) == (0, GoalOutcome.ABORTED)
    bounds = {"lower": YUMI_LIMITS.lower[0], "upper": YUMI_LIMITS.upper[0]}
    assert_says(ended.said, "goal_joint_out_of_range", joint="axis 1", position=4.0, **bounds)


@pytest.mark.parametrize(
    ("command", "code", "values"),
    [
        (JointGoal((nan, *HOME[1:])), "goal_joint_not_finite", {"joint": "axis 1", "value": "nan"}),
        (
            JointGoal((0.0, 1.0, *HOME[2:])),
            "goal_joint_out_of_range",
            {
                "joint": "axis 2",
                "position": 1.0,
                "lower": YUMI_LIMITS.lower[1],
                "upper": YUMI_LIMITS.upper[1],
            },
        ),
        (JointGoal(HOME[:6]), "goal_joint_count", {"count": 6, "joints": 7}),  # type: ignore[arg-type]
        (JointGoal(HOME, speed_scale=0.0), "goal_scale_out_of_range", {"name": "speed_scale", "value": 0.0}),
        (JointGoal(HOME, speed_scale=nan), "goal_scale_out_of_range", {"name": "speed_scale"}),
        (
            JointGoal(HOME, acceleration_scale=1.5),
            "goal_scale_out_of_range",
            {"name": "acceleration_scale", "value": 1.5},
        ),
        ("home", "command_of_other_controller", {"allowed": ("JointGoal", "StopMotion"), "command": "str"}),
    ],
)
def test_goal_controller_refuses_and_goes_on_as_before(
    arm: VirtualArmRig, command: object, code: str, values: dict[str, object]
) -> None:
    goal = moved(HOME, 10.0)
    arm.order(JointGoal(goal, 1))
    for ask in (arm.controller.check, arm.controller.receive):
        with refused(CommandRefused, code, **values):
            ask(command, arm.state)
    arm.run(2.0)
    assert arm.state.position == goal
    assert arm.notices == [REACHED]
