from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from inspect import iscoroutinefunction, signature
from threading import Lock
from typing import cast

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, GoalNotReached
from abb_protocols.robot.gripper_values import GripOutcome, GripperGoal
from abb_protocols.robot.joints import Side, home
from fake_robot import FakeRobot
from refusals import refused
from yumi.api.connect import AsyncArm, AsyncGripper, AsyncRobot
from yumi.api.gripper import Gripper
from yumi.api.motion_registry import Motion
from yumi.api.robot import Robot
from yumi.api.robot_arm import Arm
from yumi.control.controllers.joint_goal import GoalOutcome, JointGoal, StopMotion
from yumi.driver import gripper as driver

RIGHT = home(Side.RIGHT)


class FakeGripper:
    side = Side.LEFT
    last_position = 0.01
    alone = driver.RwsGripper.alone

    def __init__(self) -> None:
        self.busy = Lock()

    def begin(self, order: GripperGoal, check: Callable[[], None]) -> None: ...

    def wait(self, order: GripperGoal) -> GripOutcome:
        return GripOutcome.HOLDING


class FakeConnected:
    """A robot that is always connected; its arms come to rest when they are told to."""

    def __init__(self) -> None:
        self.fake = FakeRobot()
        self.executor = self.fake.executor
        self.fake.control.on_command = self.fake.rest
        gripper = Gripper(Side.RIGHT, lambda: cast("driver.Gripper", FakeGripper()), 10.0)
        self.arm = AsyncArm(Arm(Side.RIGHT, lambda: self.executor, gripper))

    @property
    def stops(self) -> int:
        return sum(isinstance(order.message, StopMotion) for order in self.fake.control.commands)

    async def ordered(self) -> None:
        """Until the first goal is on its way."""
        while not any(isinstance(order.message, JointGoal) for order in self.fake.control.commands):
            await asyncio.sleep(0)


@pytest.fixture
def robot() -> FakeConnected:
    return FakeConnected()


def run(script: Coroutine[None, None, None]) -> None:
    asyncio.run(asyncio.wait_for(script, 30.0))


def test_awaited_motion_is_over(robot: FakeConnected) -> None:
    async def script() -> None:
        robot.fake.control.on_command = robot.fake.end
        assert (await robot.arm.move_to(RIGHT)).is_done

    run(script())


def test_motion_ends_elsewhere_with_its_reason(robot: FakeConnected) -> None:
    async def script() -> None:
        robot.fake.control.on_command = lambda order: robot.fake.end(order, GoalOutcome.ABORTED, "axis 2 was held")
        with refused(GoalNotReached, "goal_not_reached", reason=message("text", text="axis 2 was held")):
            await robot.arm.move_to(RIGHT)

    run(script())


def test_cancelled_task_stops_its_arm(robot: FakeConnected) -> None:
    async def script() -> None:
        task = asyncio.create_task(robot.arm.move_to(RIGHT))
        await robot.ordered()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    run(script())
    assert robot.stops == 1


def test_motion_that_takes_too_long_is_stopped(robot: FakeConnected) -> None:
    async def script() -> None:
        with refused(GoalNotReached, "goal_not_reached_in_time", arms=("right",), timeout=0.01):
            await robot.arm.move_to(RIGHT, timeout=0.01)

    run(script())
    assert robot.stops == 1


def test_motion_that_no_one_awaits_goes_on(robot: FakeConnected) -> None:
    async def script() -> Motion:
        return await robot.arm.move_to(RIGHT, wait=False)

    assert not asyncio.run(script()).is_done
    assert robot.stops == 0


def test_refusal_reaches_who_awaits(robot: FakeConnected) -> None:
    async def script() -> None:
        with refused(CommandRefused, "goal_joint_count_of_arm", count=2, joints=7):
            await robot.arm.move_to([0.0, 0.0])

    run(script())
    assert robot.stops == 0


def test_gripper_is_awaited(robot: FakeConnected) -> None:
    async def script() -> None:
        assert (await robot.arm.gripper.grasp(width=0.02)).outcome is GripOutcome.HOLDING

    run(script())


def test_measured_values_are_known_at_once(robot: FakeConnected) -> None:
    assert robot.arm.position == RIGHT
    assert robot.arm.side is Side.RIGHT


class SlowRobot:
    """Connecting takes until the test lets it."""

    right = left = None

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self.began = asyncio.Event()
        self.is_closed = False
        self._loop = loop

    def open(self, confirm: str) -> None:
        self._loop.call_soon_threadsafe(self.began.set)

    def close(self) -> None:
        self.is_closed = True


def test_cancelled_connection_is_closed_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("yumi.api.connect.AsyncArm", lambda arm: None)

    async def script() -> None:
        slow = SlowRobot(asyncio.get_running_loop())
        task = asyncio.create_task(AsyncRobot(cast("Robot", slow)).open())
        await slow.began.wait()
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert slow.is_closed

    run(script())


@pytest.mark.parametrize(("twin", "original"), [(AsyncRobot, Robot), (AsyncArm, Arm), (AsyncGripper, Gripper)])
def test_twin_has_all_methods_of_the_original_with_their_arguments(twin: type, original: type) -> None:
    for name in (each for each in vars(original) if not each.startswith("_") and each != "executor"):
        method = getattr(original, name)
        assert hasattr(twin, name), name
        if callable(method) and name != "stream":  # which returns at once
            assert list(signature(getattr(twin, name)).parameters) == list(signature(method).parameters)
            is_at_once = name in {"servo_pose", "servo_twist", "jacobian", "follow_chunks"}
            assert iscoroutinefunction(getattr(twin, name)) is not is_at_once
