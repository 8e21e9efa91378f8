"""The same robot for asyncio: motions are awaited where they end, what takes a request waits in a thread.

Nothing is decided here; each object hands on to the one of the same name in :mod:`yumi.api.robot`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from functools import partial
from types import TracebackType
from typing import TypeVar

from yumi.api.gripper import Grip, Gripper
from yumi.api.motion import Motion, Position, TimedPosition, check_ended, halt
from yumi.api.robot import Arm, ArmMode, Robot
from yumi.robot.gripper import TRAVEL
from yumi.robot.joints import Joints, Pose, Side

T = TypeVar("T")


class AsyncGripper:
    """A hand, as :class:`yumi.api.gripper.Gripper`; all methods raise what its methods raise."""

    def __init__(self, gripper: Gripper) -> None:
        self._gripper = gripper
        self.side = gripper.side

    def __repr__(self) -> str:
        return f"<yumi.AsyncGripper {self.side.word}>"

    async def position(self) -> float:
        """Measured distance of each finger from the middle [m], 0 to 0.025."""
        return await _in_thread(lambda: self._gripper.position)

    async def width(self) -> float:
        """Measured distance between the fingers [m], 0 to 0.05."""
        return await _in_thread(lambda: self._gripper.width)

    async def is_holding(self) -> bool:
        """Whether the hand holds something now."""
        return await _in_thread(lambda: self._gripper.is_holding)

    async def open(self, width: float = 2.0 * TRAVEL) -> Grip:
        """Open the fingers to ``width`` [m]; done when they stand."""
        return await _in_thread(partial(self._gripper.open, width))

    async def close(self) -> Grip:
        """Close the fingers; done when they stand."""
        return await _in_thread(self._gripper.close)

    async def grasp(self, force: float | None = None, width: float | None = None, *, outwards: bool = False) -> Grip:
        """Close the fingers on an object ``width`` [m] wide and hold it with ``force`` [N]."""
        return await _in_thread(partial(self._gripper.grasp, force, width, outwards=outwards))

    async def release(self) -> Grip:
        """Let go of what is held."""
        return await _in_thread(self._gripper.release)

    async def calibrate(self) -> None:
        """Close the fingers and call that zero."""
        await _in_thread(self._gripper.calibrate)

    async def clear_error(self) -> None:
        """Acknowledge the hand's error."""
        await _in_thread(self._gripper.clear_error)

    async def pressure(self, channel: int = 1) -> float:
        """Absolute pressure in the cup of a vacuum module [Pa]."""
        return await _in_thread(partial(self._gripper.pressure, channel))

    async def has_picked(self, channel: int = 1) -> bool:
        """Whether a vacuum module has picked something."""
        return await _in_thread(partial(self._gripper.has_picked, channel))

    async def pick(self, channel: int = 1, timeout: float = 1.0) -> None:
        """Switch a vacuum module on and wait until it has picked something."""
        await _in_thread(partial(self._gripper.pick, channel, timeout))

    async def drop(self, channel: int = 1) -> None:
        """Blow off what a vacuum module holds."""
        await _in_thread(partial(self._gripper.drop, channel))


class AsyncArm:
    """An arm, as :class:`yumi.api.robot.Arm`; what is measured is known at once, what moves is awaited."""

    def __init__(self, robot: Robot, arm: Arm) -> None:
        self._robot = robot
        self._arm = arm
        self.side: Side = arm.side
        self.gripper = AsyncGripper(arm.gripper)

    def __repr__(self) -> str:
        return f"<yumi.AsyncArm {self.side.word}>"

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of all positions."""
        return self._arm.joint_names

    @property
    def position(self) -> Joints:
        """Measured joint positions [rad], (7,)."""
        return self._arm.position

    @property
    def velocity(self) -> Joints:
        """Measured joint velocities [rad/s], (7,)."""
        return self._arm.velocity

    @property
    def pose(self) -> Pose:
        """Pose of tool0 in the frame of the robot's body [m], quaternion w first."""
        return self._arm.pose

    @property
    def state(self) -> ArmMode:
        """What the arm does now."""
        return self._arm.state

    async def move_to(
        self,
        position: Position,
        *,
        wait: bool = True,
        timeout: float | None = None,
        speed: float | None = None,
        acceleration: float | None = None,
    ) -> Motion:
        """Move to ``position`` [rad], (7,), as :meth:`Arm.move_to` does; cancelling the task stops the arm."""
        begin = partial(self._robot.guidance.move, {self.side: position}, speed, acceleration)
        (motion,) = await _moved(begin, self._robot, wait, timeout)
        return motion

    async def follow(
        self, trajectory: Sequence[TimedPosition], *, wait: bool = True, timeout: float | None = None
    ) -> Motion:
        """Follow points with times, as :meth:`yumi.api.robot.Arm.follow`; cancelling the task stops the arm."""
        begin = partial(self._robot.guidance.follow, {self.side: trajectory})
        (motion,) = await _moved(begin, self._robot, wait, timeout)
        return motion

    async def stop(self) -> None:
        """Come to rest as fast as the joints may; done when the arm stands."""
        await _moved(partial(self._robot.guidance.stop, (self.side,)), self._robot, True, None)

    def stream(self, position: Position) -> None:
        """Follow a stream of positions [rad], (7,), of which this is the next; returns at once."""
        self._arm.stream(position)


class AsyncRobot:
    """A YuMi for asyncio, as :class:`yumi.api.robot.Robot`; connected by ``async with`` or :meth:`open`.

    Args:
        robot: what it hands on to.

    Attributes:
        right: the right arm.
        left: the left arm.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self.right, self.left = (AsyncArm(robot, arm) for arm in (robot.right, robot.left))

    def __repr__(self) -> str:
        return repr(self._robot).replace("yumi.Robot", "yumi.AsyncRobot")

    async def __aenter__(self) -> AsyncRobot:
        return await self.open()

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def open(self, confirm: str = "") -> AsyncRobot:
        """Connect and bring the robot to ready; a task that is cancelled meanwhile leaves it disconnected."""
        try:
            await _in_thread(partial(self._robot.open, confirm))
        except asyncio.CancelledError:
            await self.close()
            raise
        return self

    async def close(self) -> None:
        """Let the arms come to rest, end EGM and disconnect."""
        await _in_thread(self._robot.close)

    @property
    def is_connected(self) -> bool:
        """Whether it was opened and not closed."""
        return self._robot.is_connected

    async def move_to(
        self,
        *,
        right: Position | None = None,
        left: Position | None = None,
        wait: bool = True,
        timeout: float | None = None,
        speed: float | None = None,
        acceleration: float | None = None,
    ) -> Sequence[Motion]:
        """Move both arms, as :meth:`yumi.api.robot.Robot.move_to`; cancelling the task stops them."""
        scales = {"speed": speed, "acceleration": acceleration}
        begin = partial(self._robot.move_to, right=right, left=left, wait=False, **scales)
        return await _moved(begin, self._robot, wait, timeout)

    async def follow(
        self,
        *,
        right: Sequence[TimedPosition] | None = None,
        left: Sequence[TimedPosition] | None = None,
        wait: bool = True,
        timeout: float | None = None,
    ) -> Sequence[Motion]:
        """Have both arms follow points with times, as :meth:`yumi.api.robot.Robot.follow`."""
        begin = partial(self._robot.follow, right=right, left=left, wait=False)
        return await _moved(begin, self._robot, wait, timeout)

    async def stop(self) -> None:
        """Bring both arms to rest as fast as their joints may; done when they stand."""
        guidance = self._robot.guidance
        await _moved(partial(guidance.stop, guidance.arms), self._robot, True, None)

    async def recover(self, confirm: str = "") -> None:
        """Bring the robot back to where it may move, after a fault, as :meth:`yumi.api.robot.Robot.recover`."""
        await _in_thread(partial(self._robot.recover, confirm))

    @property
    def stop_to_confirm(self) -> str:
        """Id of the stop that a person must confirm before anything moves again; empty where there is none."""
        return self._robot.stop_to_confirm

    @property
    def speed_scale(self) -> float:
        """The factor on the speed of every controller, as :attr:`yumi.api.robot.Robot.speed_scale`; set at once."""
        return self._robot.speed_scale

    @speed_scale.setter
    def speed_scale(self, value: float) -> None:
        self._robot.speed_scale = value

    async def describe(self) -> str:
        """Mode, motors, RAPID program and EGM of the robot in one line."""
        return await _in_thread(self._robot.describe)


async def _in_thread(call: Callable[[], T]) -> T:
    """The result of ``call``; a task that is cancelled meanwhile waits for its end: a request cannot be half done."""
    task = asyncio.ensure_future(asyncio.to_thread(call))
    try:
        return await asyncio.shield(task)
    except asyncio.CancelledError:
        await asyncio.wait([task])
        raise


async def _moved(
    begin: Callable[[], Sequence[Motion]], robot: Robot, wait: bool, timeout: float | None
) -> Sequence[Motion]:
    """The motions that ``begin`` begins, over if ``wait``; on any other way out those that still move are stopped."""
    motions: list[Motion] = []
    try:
        await _in_thread(lambda: motions.extend(begin()))
        if wait:
            await _ended(motions, timeout)
            check_ended(motions, timeout)
    except BaseException:  # CancelledError too
        await _in_thread(lambda: halt(motions, robot.guidance))
        raise
    return motions


async def _ended(motions: Sequence[Motion], timeout: float | None) -> None:
    futures = [asyncio.wrap_future(motion.future) for motion in motions]
    try:
        if futures:
            await asyncio.wait(futures, timeout=timeout, return_when=asyncio.FIRST_EXCEPTION)
    finally:
        for future in futures:  # the motions go on; these are looked at no more
            future.cancel() or future.exception()
