"""Arms of the virtual robot that meet: motion supervision stops them, wherever the motion comes from."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from math import degrees, radians

import pytest

from abb_protocols.robot.description import SERVO_GRIPPERS
from abb_protocols.robot.joints import ZERO_JOINTS, Joints, Side, abb_from_chain, home, joints
from virtual_irc5.mechanics.contacts import ContactDetector
from virtual_irc5.world import World, WorldSettings

APART: dict[Side, Joints] = {
    Side.RIGHT: joints([radians(each) for each in (75, -114, -83, 42, -155, 81, -54)]),
    Side.LEFT: joints([radians(each) for each in (-76, -104, 79, 24, 102, 102, 94)]),
}
TOGETHER: dict[Side, Joints] = {
    Side.RIGHT: joints([radians(each) for each in (107, -111, -76, 39, -166, 113, -128)]),
    Side.LEFT: joints([radians(each) for each in (-106, -105, 78, 38, 161, 111, 124)]),
}


def cycle(world: World, seconds: float) -> None:
    for _ in range(round(seconds / world.cycle_time)):
        world.cycle({})


def collisions(world: World) -> list[str]:
    return [event.arguments[0] for event in world.controller.events.entries() if event.code == 50204]


def depth(world: World) -> float:
    """How deep parts overlap at most [m]."""
    positions = {side: arm.position for side, arm in world.arms.items()}
    detector = ContactDetector(SERVO_GRIPPERS, APART)
    return max(detector._overlaps(positions, dict.fromkeys(Side, 0.0)).values(), default=0.0)


@pytest.fixture
def world() -> World:
    world = World(WorldSettings(positions=APART))
    world.controller.set_motors(True)
    return world


def jointtarget(position: Joints) -> str:
    robax, eax_a = abb_from_chain(position)
    return f"[[{','.join(f'{degrees(each):.4f}' for each in robax)}],[{degrees(eax_a):.4f},9E9,9E9,9E9,9E9,9E9]]"


def run(world: World, lines: Mapping[Side, str]) -> None:
    world.controller.execution.stop("Another program is loaded.")
    for side in Side:
        task = world.controller.tasks[f"T_ROB_{side.name[0]}"]
        task.lose_pp()
        for module in task.modules:
            task.unload(module.name)
        task.load(f"MODULE Own\nPROC main()\n{lines.get(side, '')}\nWaitTime 100;\nENDPROC\nENDMODULE\n", "own.mod")
    world.controller.execution.move_pp_to_main()
    world.controller.start_rapid()


def move(goals: Mapping[Side, Joints], before: str = "") -> dict[Side, str]:
    return {side: f"{before}\nMoveAbsJ {jointtarget(goal)},v500,fine,tool0;" for side, goal in goals.items()}


def test_programs_whose_arms_meet_stop_with_the_event_of_motion_supervision(world: World) -> None:
    run(world, move(TOGETHER))
    while world.controller.is_running:
        world.cycle({})
    assert set(collisions(world)) <= {"ROB_R", "ROB_L"}
    assert collisions(world)
    assert any("has met the" in event.description for event in world.controller.events.entries() if event.code == 50204)
    assert world.controller.controller_state.value == "motoron"
    cycle(world, 2.0)
    assert all(arm.is_stationary for arm in world.arms.values())
    assert len(collisions(world)) <= 2  # nothing more while they brake
    assert depth(world) == 0.0


def test_arms_leave_a_contact_and_collide_when_they_go_deeper(world: World) -> None:
    run(world, move(TOGETHER))
    cycle(world, 4.0)
    before = len(collisions(world))
    run(world, move(APART))
    cycle(world, 3.0)
    assert world.controller.is_running
    assert len(collisions(world)) == before
    assert depth(world) == 0.0
    run(world, move(TOGETHER))
    cycle(world, 4.0)
    assert not world.controller.is_running
    assert len(collisions(world)) > before
    again = len(collisions(world))
    run(world, move(TOGETHER))
    cycle(world, 1.0)
    assert len(collisions(world)) > again


def test_program_that_switches_motion_supervision_off_goes_on(world: World) -> None:
    run(world, move(TOGETHER, r"MotionSup \Off;"))
    cycle(world, 5.0)
    assert world.controller.is_running
    assert depth(world) > 0.03
    assert not collisions(world)


def test_jogged_arm_that_meets_the_other_one_stops(world: World) -> None:
    world.arms[Side.LEFT].move_to(TOGETHER[Side.LEFT], tool_speed=0.25)
    world.arms[Side.RIGHT].move_to(TOGETHER[Side.RIGHT], tool_speed=0.25)
    cycle(world, 6.0)
    assert collisions(world)
    assert all(arm.is_stationary for arm in world.arms.values())
    assert depth(world) == 0.0


def test_arm_that_is_pushed_against_the_other_one_collides_once(world: World) -> None:
    run(world, move(TOGETHER))
    while world.controller.is_running:
        world.cycle({})
    before = len(collisions(world))
    world.arms[Side.LEFT].push(radians(20.0))
    world.arms[Side.RIGHT].push(radians(20.0))
    cycle(world, 2.0)
    assert before < len(collisions(world)) <= before + 2


def test_arm_that_moves_into_the_body_names_it(world: World) -> None:
    inside = joints([*home(Side.RIGHT)[:3], radians(75.0), *home(Side.RIGHT)[4:]])
    run(world, {Side.RIGHT: move({Side.RIGHT: home(Side.RIGHT)})[Side.RIGHT] + move({Side.RIGHT: inside})[Side.RIGHT]})
    cycle(world, 8.0)
    (event,) = [event for event in world.controller.events.entries() if event.code == 50204]
    assert "has met the robot's body" in event.description


@pytest.mark.parametrize("side", Side)
def test_one_arm_at_zero_and_both_at_home_touch_nothing(side: Side) -> None:
    detector = ContactDetector(SERVO_GRIPPERS, APART)
    for positions in ({each: home(each) for each in Side}, {side: ZERO_JOINTS, side.other: home(side.other)}):
        assert detector.touched(positions, dict.fromkeys(Side, 0.0), Side) == {}


def test_slow_approach_touches_as_early_as_a_quick_one() -> None:
    def touched_at(steps: int) -> int:
        detector = ContactDetector(SERVO_GRIPPERS, APART)
        for step in range(steps + 1):
            share = step / steps
            positions = {
                side: joints([a + share * (b - a) for a, b in zip(APART[side], TOGETHER[side], strict=True)])
                for side in Side
            }
            if detector.touched(positions, dict.fromkeys(Side, 0.0), Side):
                return step
        raise AssertionError("nothing was touched")

    shares = [touched_at(steps) / steps for steps in (200, 2000, 20000)]
    assert max(abs(a - b) for a, b in pairwise(shares)) < 0.01


def test_arm_into_which_fingers_have_opened_may_leave() -> None:
    positions = {
        Side.RIGHT: joints([radians(each) for each in (45, -90, -135, 30, 0, 40, 0)]),
        Side.LEFT: joints([radians(each) for each in (-90, -90, 135, 30, 0, 40, 0)]),
    }
    detector, opened = ContactDetector(SERVO_GRIPPERS, positions), {Side.RIGHT: 0.025, Side.LEFT: 0.0}
    assert not detector._overlaps(positions, dict.fromkeys(Side, 0.0))
    assert max(detector._overlaps(positions, opened).values()) > 0.01
    assert detector.touched(positions, opened, Side) == {}
    for step in range(200):
        away = joints([radians(45 - 0.1 * step), *positions[Side.RIGHT][1:]])
        assert detector.touched({**positions, Side.RIGHT: away}, opened, Side) == {}
