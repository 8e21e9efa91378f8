"""Whatever happens on the wire and at the controllers: no command ever jumps, and the robot is never overloaded."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints
from egm_loop import FULL_SPEED, EgmLoop
from yumi.control.controller import State
from yumi.control.cycle import Cycle

Action = Callable[[EgmLoop], None]

POSITIONS = st.tuples(*[st.floats(low, high) for low, high in zip(YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True)])
CYCLES = st.integers(1, 120)


def new_goal(goal: Joints) -> Action:
    return lambda loop: loop.go(goal)


def let_pass(cycles: int) -> Action:
    def act(loop: EgmLoop) -> None:
        for _ in range(cycles):
            loop.cycle()

    return act


def lose_datagrams(cycles: int) -> Action:
    """None arrives here for a while; with more than twenty the session is lost."""

    def act(loop: EgmLoop) -> None:
        loop.to_us = lambda datagram: ()
        let_pass(cycles)(loop)
        loop.to_us = lambda datagram: (datagram,)

    return act


def lose_replies(cycles: int) -> Action:
    def act(loop: EgmLoop) -> None:
        loop.to_robot = lambda datagram: ()
        let_pass(cycles)(loop)
        loop.to_robot = lambda datagram: (datagram,)

    return act


def disorder_datagrams(cycles: int) -> Action:
    """Every datagram comes twice, after the one that followed it."""

    def act(loop: EgmLoop) -> None:
        held: list[bytes] = []

        def swap(datagram: bytes) -> list[bytes]:
            held.append(datagram)
            return [held[-1], held[-1], *held[-3:-1]]

        loop.to_us = swap
        let_pass(cycles)(loop)
        loop.to_us = lambda datagram: (datagram,)

    return act


def restart_robot(loop: EgmLoop) -> None:
    if loop.robot.arm.motors_on:
        loop.robot.start(FULL_SPEED)


def switch_controller(loop: EgmLoop) -> None:
    (info,) = loop.manager.controllers()
    if info.state is State.ACTIVE:
        loop.deactivate()
    elif loop.line.state is not None and loop.line.state.is_running:
        loop.activate()


ACTIONS = st.one_of(
    POSITIONS.map(new_goal),
    CYCLES.map(let_pass),
    st.integers(1, 40).map(lose_datagrams),
    CYCLES.map(lose_replies),
    st.integers(1, 20).map(disorder_datagrams),
    st.just(restart_robot),
    st.just(switch_controller),
)


def assert_no_jump(before: Cycle, after: Cycle) -> None:
    is_new = after.state.session != before.state.session or not after.state.is_running
    if is_new and after.sent.position == after.state.position:
        return  # a robot that did not follow begins where it is; else it may follow, and the last command goes on
    room = min(after.state.dt, CYCLE)
    steps = zip(before.sent.position, after.sent.position, YUMI_LIMITS.velocity, strict=True)
    assert all(abs(new - old) <= speed * room * 1.001 + 1e-9 for old, new, speed in steps)


@given(actions=st.lists(ACTIONS, min_size=1, max_size=25))
def test_no_command_jumps_and_no_load_is_too_high_whatever_happens(actions: list[Action]) -> None:
    loop = EgmLoop()
    loop.begin()
    for action in actions:
        action(loop)
    assert loop.cycles[0].sent.position == loop.cycles[0].state.position
    for before, after in pairwise(loop.cycles):
        assert_no_jump(before, after)
    assert loop.robot.arm.overload is None


@pytest.mark.parametrize("gain", [1.2, 2.0])
def test_no_goal_in_range_overloads_the_robot_at_full_speed(gain: float) -> None:
    """All joints at once, from one end of their range to the other, turned around in the middle of the motion."""
    loop = EgmLoop()
    loop.manager.set_parameters("joint_position_controller", {"p": gain})
    loop.begin()
    for goal in (YUMI_LIMITS.upper, YUMI_LIMITS.lower) * 3:
        loop.go(goal)
        loop.run(0.8)
    assert loop.robot.arm.overload is None
    assert loop.snapshot.is_running
