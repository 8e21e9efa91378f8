"""``yumi.connect``: the functions that give a script its robot with its address and options, and the twin for asyncio.

The classes for asyncio are derived from :mod:`yumi.api.robot`: each method is awaited, nothing is decided here.
"""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Callable, Coroutine, Mapping, Sequence
from dataclasses import replace
from functools import partial, wraps
from inspect import signature
from math import radians
from pathlib import Path
from typing import Any, Concatenate, NoReturn, ParamSpec, Protocol, TypeVar, cast

from abb_protocols.catalogue import message
from abb_protocols.errors import SettingsError
from abb_protocols.robot.joints import Side
from abb_runtime.parameters import ParameterFileEntry
from abb_runtime.rws.login import password_of_environment
from yumi.api.arm_access import check_ended, halt
from yumi.api.gripper import Gripper
from yumi.api.motion_executor import MotionExecutor
from yumi.api.motion_registry import Motion
from yumi.api.poses import PoseLike
from yumi.api.robot import Robot
from yumi.api.robot_arm import Arm
from yumi.driver.controller_names import GOAL_CONTROLLER, STREAM_CONTROLLER, TRAJECTORY_CONTROLLER
from yumi.driver.initial_controllers import Controllers
from yumi.driver.settings import (
    ControllerSettings,
    Settings,
    address_values,
    override,
    read_controllers,
    read_settings,
)

_P = ParamSpec("_P")
_T = TypeVar("_T")
_T_co = TypeVar("_T_co", covariant=True)

_Given = Mapping[str, Any]
"""Settings of one group by name; None where nothing was given."""


def connect(
    address: str | None = None,
    *,
    arms: str | Sequence[str] = ("right", "left"),
    default_speed_scale: float = 0.5,
    acceleration: float = 0.5,
    speed_scale: float | None = None,
    bringup: bool | None = None,
    rws_port: int | None = None,
    left_egm_port: int | None = None,
    right_egm_port: int | None = None,
    user: str | None = None,
    password: str | None = None,
    config: Path | str | None = None,
    controllers: Path | str | None = None,
    on_step: Callable[[str], None] | None = None,
) -> Robot:
    """A robot at ``address``, to be connected by ``with``.

    ::

        with yumi.connect("192.168.125.1", bringup=True) as robot:
            robot.right.move_to(yumi.degrees(0, -130, -135, 30, 0, 40, 0))
            robot.left.gripper.open()
            robot.left.gripper.grasp(force=10.0)

    On entry the robot is brought to ready where ``bringup`` says so: motors on, RAPID program running, grippers
    calibrated. Then EGM starts, and the arms hold. On exit, also after an error or Ctrl-C, the arms come to rest first,
    then EGM ends.

    Args:
        address: the controller's, ``host`` or ``host:port``; None takes the settings'. Without a port it is 80, on this
            machine 8080, where ``yumi controller`` serves.
        arms: on which EGM runs; the other one stands still.
        default_speed_scale: share of the joints' highest speeds, above 0 up to 1, of a motion that gives no
            ``speed_scale``.
        acceleration: the same for accelerations and jerks.
        speed_scale: factor on the speed of every motion, 0.01 to 1; None takes the settings': 1 for a robot on this
            machine, 0.1 for any other. See :attr:`yumi.api.robot.Robot.speed_scale`.
        bringup: whether the robot is brought to ready; without, one that is not ready is refused, with what it lacks,
            and nothing is changed. None takes the settings': only a robot on this machine.
        rws_port: HTTP port of Robot Web Services.
        left_egm_port: UDP port where the left arm's datagrams arrive; and the right arm's:
        right_egm_port: as above.
        user: on the controller; ABB's default unless given.
        password: unless given the one in the environment variable ``YUMI_PASSWORD``, or the settings'.
        config: settings instead of the delivered ``yumi.yaml``.
        controllers: controllers instead of the delivered ``controllers.yaml``.
        on_step: given each step of what is done to the robot; None prints them where standard error is a terminal.

    Raises:
        SettingsError: a value is wrong; nothing was connected.
    """
    where = {"left_port": left_egm_port, "right_port": right_egm_port}
    password = password_of_environment() if password is None else password
    robot = {"user": user, "password": password, "speed_scale": speed_scale}
    settings = settings_for(address, rws_port, robot, where, config, bringup)
    return Robot(
        settings,
        controllers_for(settings, default_speed_scale, acceleration, controllers),
        _sides(arms),
        on_step or print_step,
    )


def print_step(step: str) -> None:
    """Show on a terminal what is done, and nothing elsewhere: connecting takes seconds."""
    if sys.stderr.isatty():
        sys.stderr.write(f"yumi: {step}\n")


def _asynchronous(build: Callable[_P, Robot]) -> Callable[_P, AsyncRobot]:
    def connect_async(*args: _P.args, **options: _P.kwargs) -> AsyncRobot:
        """The same robot for asyncio: ``async with yumi.connect_async(address) as robot``; see :func:`connect`."""
        return AsyncRobot(build(*args, **options))

    connect_async.__signature__ = signature(build)  # type: ignore[attr-defined]
    return connect_async


connect_async = _asynchronous(connect)


def settings_for(
    address: str | None,
    rws_port: int | None = None,
    login: _Given | None = None,
    egm: _Given | None = None,
    config: Path | str | None = None,
    bringup: bool | None = None,
) -> Settings:
    """The settings with what was given to ``connect`` on top; None leaves a value as it is.

    Raises:
        SettingsError: a value is wrong.
    """
    values: dict[str, _Given] = {"robot": {**_address(address, rws_port), **(login or {})}, "egm": egm or {}}
    values["ros"] = {"bringup": bringup}
    given = {
        group: {key: value for key, value in entries.items() if value is not None} for group, entries in values.items()
    }
    return override(read_settings(Path(config) if config else None), given, "connect")


def controllers_for(
    settings: Settings, default_speed_scale: float, acceleration: float, file: Path | str | None = None
) -> Controllers:
    """The controllers, those for single points with these fractions of the joints' limits and the robot's top speed.

    Raises:
        SettingsError: a value is wrong, or a controller is missing.
    """
    for name, value in (("default_speed_scale", default_speed_scale), ("acceleration", acceleration)):
        if not 0.0 < value <= 1.0:  # NaN too
            raise SettingsError(
                message(
                    "setting_refused",
                    place="connect",
                    reason=message("fraction_out_of_range", parameter=name, value=value),
                )
            )
    scales = {
        "speed_scale": float(default_speed_scale),
        "acceleration_scale": float(acceleration),
        "top_speed": radians(settings.egm_motion.max_speed_deviation),
    }
    extra = {name: ParameterFileEntry(value, "connect", is_general=False) for name, value in scales.items()}
    chosen: dict[Side, tuple[ControllerSettings, ...]] = {}
    for side in Side:
        entries = read_controllers(side, Path(file) if file else None)
        missing = {GOAL_CONTROLLER, STREAM_CONTROLLER, TRAJECTORY_CONTROLLER} - {entry.name for entry in entries}
        if missing:
            raise SettingsError(message("controllers_missing", arm=side.word, missing=tuple(sorted(missing))))
        chosen[side] = tuple(
            replace(entry, entries={**entry.entries, **extra}) if entry.name == GOAL_CONTROLLER else entry
            for entry in entries
        )
    return chosen


def _address(address: str | None, rws_port: int | None) -> _Given:
    if address is None:
        return {"rws_port": rws_port}
    if ":" in address and rws_port is not None:
        raise SettingsError(
            message(
                "setting_refused", place="connect", reason=message("connect_port_twice", address=address, port=rws_port)
            )
        )
    return address_values(address) | ({} if rws_port is None else {"rws_port": rws_port})


def _sides(arms: str | Sequence[str]) -> tuple[Side, ...]:
    words = (arms,) if isinstance(arms, str) else tuple(arms)
    known = {side.word: side for side in Side}
    if not words or any(word not in known for word in words) or len(set(words)) != len(words):
        raise SettingsError(
            message("setting_refused", place="connect", reason=message("connect_arms_unknown", given=repr(arms)))
        )
    return tuple(known[word] for word in words)


# ---- the same for asyncio


async def _in_thread(call: Callable[[], _T]) -> _T:
    """The result of ``call``; a task that is cancelled meanwhile waits for its end: a request cannot be half done."""
    task = asyncio.ensure_future(asyncio.to_thread(call))
    try:
        return await asyncio.shield(task)
    except asyncio.CancelledError:
        await asyncio.wait([task])
        raise


def _awaited(method: Callable[Concatenate[Any, _P], _T]) -> Callable[Concatenate[Any, _P], Coroutine[Any, Any, _T]]:
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


def _at_once(method: Callable[Concatenate[Any, _P], _T]) -> Callable[Concatenate[Any, _P], _T]:
    """The twin of a ``method`` that returns at once: the same on the twin's ``sync`` object, not awaited."""

    @wraps(method)
    def forwarded(twin: Any, *args: _P.args, **options: _P.kwargs) -> _T:
        return cast("_T", getattr(twin.sync, method.__name__)(*args, **options))

    return cast("Callable[Concatenate[Any, _P], _T]", forwarded)


class _Twin(Protocol[_T_co]):
    """A property of the twin's ``sync`` object."""

    def __get__(self, twin: Any, owner: Any = None) -> _T_co: ...

    def __set__(self, twin: Any, value: NoReturn) -> None: ...


def _same(attribute: Callable[[Any], _T]) -> _Twin[_T]:
    """The twin of a property that is only read: the same of the twin's ``sync`` object, at once."""
    own = cast("property", attribute)
    return cast("_Twin[_T]", property(lambda twin: own.__get__(twin.sync), doc=own.__doc__))


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

    async def __aexit__(self, *_: object) -> None:
        await self.close()

    async def open(self, confirm: str = "") -> AsyncRobot:
        """Connect and bring the robot to ready; a task that is cancelled meanwhile leaves it disconnected."""
        try:
            await _in_thread(partial(self.sync.open, confirm))
        except asyncio.CancelledError:
            await self.close()
            raise
        return self

    is_connected = _same(Robot.is_connected)
    stop_to_confirm = _same(Robot.stop_to_confirm)
    state = _same(Robot.state)
    controller = _same(Robot.controller)

    @property
    def speed_scale(self) -> float:
        """The factor on the speed of every controller, as :attr:`yumi.api.robot.Robot.speed_scale`; set at once."""
        return self.sync.speed_scale

    @speed_scale.setter
    def speed_scale(self, value: float) -> None:
        self.sync.speed_scale = value

    close = _awaited(Robot.close)

    tools = _same(Robot.tools)
    work_objects = _same(Robot.work_objects)

    stream = _at_once(Robot.stream)
    move_to = _awaited(Robot.move_to)
    move_to_pose = _awaited(Robot.move_to_pose)
    move_linear = _awaited(Robot.move_linear)
    follow = _awaited(Robot.follow)
    follow_chunks = _at_once(Robot.follow_chunks)
    plan_to = _awaited(Robot.plan_to)
    execute = _awaited(Robot.execute)
    retreat = _awaited(Robot.retreat)
    stop = _awaited(Robot.stop)
    allow_collision = _awaited(Robot.allow_collision)
    record = _awaited(Robot.record)
    recover = _awaited(Robot.recover)
    give_back = _awaited(Robot.give_back)
    describe = _awaited(Robot.describe)


class AsyncArm:
    """An arm, as :class:`yumi.api.robot_arm.Arm`; what is measured is known at once, what moves is awaited."""

    def __init__(self, arm: Arm) -> None:
        self.sync = arm
        self.side = arm.side
        self.gripper = AsyncGripper(arm.gripper)

    def __repr__(self) -> str:
        return repr(self.sync).replace("yumi.Arm", "yumi.AsyncArm")

    joint_names = _same(Arm.joint_names)
    position = _same(Arm.position)
    velocity = _same(Arm.velocity)
    pose = _same(Arm.pose)
    arm_angle = _same(Arm.arm_angle)

    @property
    def tool(self) -> PoseLike | str | None:
        """What poses are poses of, as :attr:`yumi.api.robot_arm.Arm.tool`; it can be set."""
        return self.sync.tool

    @tool.setter
    def tool(self, value: PoseLike | str | None) -> None:
        self.sync.tool = value

    poses = _same(Arm.poses)
    degrees = _same(Arm.degrees)
    mode = _same(Arm.mode)
    state = _same(Arm.state)

    stream = _at_once(Arm.stream)
    servo_pose = _at_once(Arm.servo_pose)
    servo_twist = _at_once(Arm.servo_twist)
    jacobian = _at_once(Arm.jacobian)
    inverse_kinematics = _awaited(Arm.inverse_kinematics)
    move_to = _awaited(Arm.move_to)
    move_to_pose = _awaited(Arm.move_to_pose)
    move_linear = _awaited(Arm.move_linear)
    move_through = _awaited(Arm.move_through)
    follow = _awaited(Arm.follow)
    stop = _awaited(Arm.stop)


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

    open = _awaited(Gripper.open)
    close = _awaited(Gripper.close)
    grasp = _awaited(Gripper.grasp)
    release = _awaited(Gripper.release)
    calibrate = _awaited(Gripper.calibrate)
    clear_error = _awaited(Gripper.clear_error)
    pressure = _awaited(Gripper.pressure)
    has_picked = _awaited(Gripper.has_picked)
    pick = _awaited(Gripper.pick)
    drop = _awaited(Gripper.drop)
