"""The same robot for asyncio, derived from :mod:`yumi.api.robot`: each method is awaited, nothing is decided here."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Mapping, Sequence
from functools import partial, wraps
from inspect import signature
from types import TracebackType
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

from yumi.api.cartesian import PoseLike
from yumi.api.gripper import Gripper
from yumi.api.motion import Motion, MotionExecutor, Position, check_ended, halt
from yumi.api.robot import Arm, Robot
from yumi.driver.endpoint import ArmMode, ArmReport
from yumi.driver.readiness import RobotState
from yumi.robot.joints import Joints, Pose
from yumi.rws.client import RwsClient

P = ParamSpec("P")
T = TypeVar("T")


async def _in_thread(call: Callable[[], T]) -> T:
    """The result of ``call``; a task that is cancelled meanwhile waits for its end: a request cannot be half done."""
    task = asyncio.ensure_future(asyncio.to_thread(call))
    try:
        return await asyncio.shield(task)
    except asyncio.CancelledError:
        await asyncio.wait([task])
        raise


def awaited(method: Callable[Concatenate[Any, P], T]) -> Callable[Concatenate[Any, P], Coroutine[Any, Any, T]]:
    """The asyncio twin of ``method``: the same arguments and errors, run in a thread on the twin's ``sync`` object.

    A method with an argument ``wait`` begins motions. They are awaited without a thread; a task that is cancelled, or
    whose time is up, stops them.
    """

    async def in_thread(twin: Any, *args: Any, **options: Any) -> Any:
        return await _in_thread(partial(getattr(twin.sync, method.__name__), *args, **options))

    async def moving(
        twin: Any, *args: Any, wait: bool = True, timeout: float | None = None, **options: Any
    ) -> Motion | Sequence[Motion]:
        begin = getattr(twin.sync, method.__name__)
        begun: list[Motion | Sequence[Motion]] = []
        executor: MotionExecutor = twin.sync.executor
        try:
            await _in_thread(lambda: begun.append(begin(*args, wait=False, **options)))
            if wait:
                await _ended(_motions(begun), timeout)
                check_ended(_motions(begun), timeout)
        except BaseException:  # CancelledError too
            await _in_thread(lambda: halt(_motions(begun), executor))
            raise
        return begun[0]

    return wraps(method)(moving if "wait" in signature(method).parameters else in_thread)


def at_once(method: Callable[Concatenate[Any, P], T]) -> Callable[Concatenate[Any, P], T]:
    """The twin of a ``method`` that returns at once: the same on the twin's ``sync`` object, not awaited."""

    @wraps(method)
    def forwarded(twin: Any, *args: P.args, **options: P.kwargs) -> T:
        return cast("T", getattr(twin.sync, method.__name__)(*args, **options))

    return cast("Callable[Concatenate[Any, P], T]", forwarded)


def _motions(begun: Sequence[Motion | Sequence[Motion]]) -> Sequence[Motion]:
    """What a method returns that begins one motion, or several; empty where it was refused."""
    return [motion for each in begun for motion in ([each] if isinstance(each, Motion) else each)]


async def _ended(motions: Sequence[Motion], timeout: float | None) -> None:
    futures = [asyncio.wrap_future(motion.future) for motion in motions]
    try:
        if futures:
            await asyncio.wait(futures, timeout=timeout, return_when=asyncio.FIRST_EXCEPTION)
    finally:
        for future in futures:  # the motions go on; these are read no more
            future.cancel() or future.exception()


class AsyncGripper:
    """A gripper, as :class:`yumi.api.gripper.Gripper`; measured values are awaited, too."""

    def __init__(self, gripper: Gripper) -> None:
        self.sync = gripper
        self.side = gripper.side

    def __repr__(self) -> str:
        return repr(self.sync).replace("yumi.Gripper", "yumi.AsyncGripper")

    async def position(self) -> float:
        """Measured distance of each finger from the middle [m], 0 to 0.025."""
        return await _in_thread(lambda: self.sync.position)

    async def width(self) -> float:
        """Measured distance between the fingers [m], 0 to 0.05."""
        return await _in_thread(lambda: self.sync.width)

    async def is_holding(self) -> bool:
        """Whether the gripper holds something now."""
        return await _in_thread(lambda: self.sync.is_holding)

    open = awaited(Gripper.open)
    close = awaited(Gripper.close)
    grasp = awaited(Gripper.grasp)
    release = awaited(Gripper.release)
    calibrate = awaited(Gripper.calibrate)
    clear_error = awaited(Gripper.clear_error)
    pressure = awaited(Gripper.pressure)
    has_picked = awaited(Gripper.has_picked)
    pick = awaited(Gripper.pick)
    drop = awaited(Gripper.drop)


class AsyncArm:
    """An arm, as :class:`yumi.api.robot.Arm`; what is measured is known at once, what moves is awaited."""

    def __init__(self, arm: Arm) -> None:
        self.sync = arm
        self.side = arm.side
        self.gripper = AsyncGripper(arm.gripper)

    def __repr__(self) -> str:
        return repr(self.sync).replace("yumi.Arm", "yumi.AsyncArm")

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of all positions."""
        return self.sync.joint_names

    @property
    def position(self) -> Joints:
        """Measured joint positions [rad], (7,)."""
        return self.sync.position

    @property
    def velocity(self) -> Joints:
        """Measured joint velocities [rad/s], (7,)."""
        return self.sync.velocity

    @property
    def pose(self) -> Pose:
        """Pose of the tool in the frame of the robot's body [m], quaternion w first."""
        return self.sync.pose

    @property
    def arm_angle(self) -> float:
        """How far the elbow is turned about the line from shoulder to wrist [rad]."""
        return self.sync.arm_angle

    @property
    def tool(self) -> PoseLike | str | None:
        """What poses are poses of, as :attr:`yumi.api.robot.Arm.tool`; it can be set."""
        return self.sync.tool

    @tool.setter
    def tool(self, value: PoseLike | str | None) -> None:
        self.sync.tool = value

    @property
    def poses(self) -> Mapping[str, Joints]:
        """Positions that have a name [rad]."""
        return self.sync.poses

    @property
    def degrees(self) -> dict[str, float]:
        """Measured joint positions as the FlexPendant shows them, ``j1`` to ``j7`` [°]."""
        return self.sync.degrees

    @property
    def mode(self) -> ArmMode:
        """What the arm does now."""
        return self.sync.mode

    @property
    def state(self) -> ArmReport:
        """All that is known of the arm now."""
        return self.sync.state

    def stream(self, position: Position) -> None:
        """Follow a stream of positions [rad], (7,), of which this is the next; returns at once."""
        self.sync.stream(position)

    servo_pose = at_once(Arm.servo_pose)
    servo_twist = at_once(Arm.servo_twist)
    jacobian = at_once(Arm.jacobian)
    inverse_kinematics = awaited(Arm.inverse_kinematics)
    move_to = awaited(Arm.move_to)
    move_to_pose = awaited(Arm.move_to_pose)
    move_linear = awaited(Arm.move_linear)
    move_through = awaited(Arm.move_through)
    follow = awaited(Arm.follow)
    stop = awaited(Arm.stop)


class AsyncRobot:
    """A YuMi for asyncio, as :class:`yumi.api.robot.Robot`; connected by ``async with`` or :meth:`open`.

    Attributes:
        sync: the same robot without asyncio.
        right: the right arm.
        left: the left arm.
    """

    def __init__(self, robot: Robot) -> None:
        self.sync = robot
        self.right, self.left = AsyncArm(robot.right), AsyncArm(robot.left)

    def __repr__(self) -> str:
        return repr(self.sync).replace("yumi.Robot", "yumi.AsyncRobot")

    async def __aenter__(self) -> AsyncRobot:
        return await self.open()

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def open(self, confirm: str = "") -> AsyncRobot:
        """Connect and bring the robot to ready; a task that is cancelled meanwhile leaves it disconnected."""
        try:
            await _in_thread(partial(self.sync.open, confirm))
        except asyncio.CancelledError:
            await self.close()
            raise
        return self

    @property
    def is_connected(self) -> bool:
        """Whether it was opened and not closed."""
        return self.sync.is_connected

    @property
    def stop_to_confirm(self) -> str:
        """Id of the stop that a person must confirm before anything moves again; empty where there is none."""
        return self.sync.stop_to_confirm

    @property
    def state(self) -> RobotState:
        """Mode, motors, RAPID program and EGM of the robot, why it does not move and what stopped it."""
        return self.sync.state

    @property
    def controller(self) -> RwsClient:
        """As :attr:`yumi.api.robot.Robot.controller`; its calls wait for the controller, so await them in a thread."""
        return self.sync.controller

    @property
    def speed_scale(self) -> float:
        """The factor on the speed of every controller, as :attr:`yumi.api.robot.Robot.speed_scale`; set at once."""
        return self.sync.speed_scale

    @speed_scale.setter
    def speed_scale(self, value: float) -> None:
        self.sync.speed_scale = value

    close = awaited(Robot.close)

    @property
    def tools(self) -> dict[str, PoseLike]:
        """Tools by name, as :attr:`yumi.api.robot.Robot.tools`."""
        return self.sync.tools

    @property
    def work_objects(self) -> dict[str, PoseLike]:
        """Work objects by name, as :attr:`yumi.api.robot.Robot.work_objects`."""
        return self.sync.work_objects

    move_to = awaited(Robot.move_to)
    move_to_pose = awaited(Robot.move_to_pose)
    move_linear = awaited(Robot.move_linear)
    follow = awaited(Robot.follow)
    plan_to = awaited(Robot.plan_to)
    execute = awaited(Robot.execute)
    stop = awaited(Robot.stop)
    allow_collision = awaited(Robot.allow_collision)
    recover = awaited(Robot.recover)
    describe = awaited(Robot.describe)
