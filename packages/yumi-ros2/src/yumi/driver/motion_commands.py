"""The commands that move arms: to positions and poses, to follow plans, to stream, to jog and to teleoperate."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import FIRST_EXCEPTION
from concurrent.futures import wait as wait_for_futures
from contextlib import suppress
from functools import partial
from typing import Annotated, Literal

import msgspec

from abb_protocols.catalogue import headline, message
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused, GoalNotReached, YumiError
from abb_protocols.robot.description import FINGERTIPS
from abb_protocols.robot.joints import ZERO_JOINTS, Joints, Side, by_side
from yumi.control.goals import GoalTracking, stream_delay
from yumi.control.hand_over import MOTION_BEGINS, Commander
from yumi.control.loop_commands import Commands
from yumi.driver.command import (
    ArmName,
    Caller,
    Command,
    CommandedRobot,
    Lane,
    RunningMotion,
    Scale,
    SentPosition,
    TimedPoint,
    side_of,
)
from yumi.driver.device_frame import DeviceFrame, TeleoperationReport
from yumi.driver.gripper_follower import closed_of
from yumi.driver.reports import MotionReport

JOG_HOLDS = 0.06
"""A jog moves an arm for so long, unless the next one comes [s]: braking from the page's highest speed takes 0.12 s."""

_LAST_STOP = 5.0
"""The move of a program from which a person takes an arm has ended within this time [s]."""

_SCRIPT = frozenset({FrontEnd.SCRIPT})
_POLL_PERIOD = 0.1  # [s] between two looks at motions


class Move(Command[str], frozen=True):
    """Move arms to positions; the answer comes when they stand there.

    A client that goes away meanwhile stops them, as does ``timeout`` [s]. ``speed_scale`` is a factor on the joints'
    highest speeds, on top of the driver's.

    With ``is_pose`` a position is a pose of the tool in use in the robot's body: x, y, z [m] and, where the orientation
    does not stay, the quaternion w, x, y, z. With ``is_linear``, too, the tool moves there on a straight line, at most
    with ``speed`` [m/s].
    """

    front_ends = frozenset({FrontEnd.SCRIPT, FrontEnd.SHELL, FrontEnd.PAGE})

    right: SentPosition | None = None
    left: SentPosition | None = None
    speed_scale: Scale | None = None
    acceleration: Scale | None = None
    timeout: Annotated[float, msgspec.Meta(gt=0.0)] | None = None
    is_pose: bool = False
    is_linear: bool = False
    speed: Annotated[float, msgspec.Meta(gt=0.0)] | None = None

    @property
    def goals(self) -> Mapping[Side, SentPosition]:
        """The positions of the arms that have one."""
        return by_side(self.right, self.left)

    def check(self) -> None:
        if self.is_pose and self.speed is not None and not self.is_linear:
            raise CommandRefused(message("tool_speed_without_line"))
        if not self.is_pose and (self.is_linear or self.speed is not None):
            raise CommandRefused(message("line_without_pose"))

    def needed_arms(self, robot: CommandedRobot) -> Sequence[Side]:
        return tuple(self.goals)

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        goals = self.goals

        def begin() -> Sequence[RunningMotion]:
            if not self.is_pose:
                return robot.mover.move(goals, self.speed_scale, self.acceleration, check=caller.check)
            tools = {side: robot.manager.tcp(side) for side in goals}
            return robot.mover.move_tools(
                goals,
                tools,
                self.speed_scale,
                self.acceleration,
                self.speed,
                is_linear=self.is_linear,
                check=caller.check,
            )

        return _move(robot, tuple(goals), begin, self.timeout, caller)


class Follow(Command[str], frozen=True):
    """Follow trajectories that were planned, beginning at the same moment; ended as :class:`Move`.

    ``start`` is where both arms have to be [rad]. Points are a time [s], and the positions [rad], velocities [rad/s]
    and accelerations [rad/s²] then, each (7,) in chain order.
    """

    front_ends = _SCRIPT

    start: dict[ArmName, Joints]
    right: tuple[TimedPoint, ...] | None = None
    left: tuple[TimedPoint, ...] | None = None

    @property
    def trajectories(self) -> Mapping[Side, tuple[TimedPoint, ...]]:
        """The points of the arms that have some."""
        return by_side(self.right, self.left)

    def needed_arms(self, robot: CommandedRobot) -> Sequence[Side]:
        return tuple(self.trajectories)

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        trajectories = self.trajectories
        start = {side: self.start[side.word] for side in Side if side.word in self.start}
        return _move(
            robot, tuple(trajectories), lambda: robot.mover.follow(trajectories, start, caller.check), None, caller
        )


class Jog(Command[str], frozen=True):
    """Move an arm with joint speeds [rad/s], (7,) in chain order, for 0.06 s.

    It is asked for again and again while the arm moves, such as 50 times a second. The first one only takes the arm
    over from standstill; the next one moves it. The driver stops the arm when its client goes away, or asks no more,
    whatever timeouts its controllers have. An arm that one client jogs is not jogged by another one.

    ``time`` [s] is when a person asked for it, by ``time.monotonic()`` of the driver's machine; without it that is when
    the driver takes it. What was asked for more than 0.1 s ago is refused, unless it is that the arm stands.
    """

    lane = Lane.JOG
    front_ends = _SCRIPT

    arm: ArmName
    speeds: Joints
    time: float | None = None

    def needed_arms(self, robot: CommandedRobot) -> Sequence[Side]:
        return (side_of(self.arm),)

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        side = side_of(self.arm)

        def jog(speeds: Joints) -> bool:
            return robot.mover.jog(side, speeds, caller.client, self.time)

        return _jog(robot, caller, side, self.speeds, self.time, jog)


class JogTool(Command[str], frozen=True):
    """Move the fingertips of an arm with a velocity for 0.06 s, as :class:`Jog` moves the joints.

    ``linear`` [m/s] and ``angular`` [rad/s] are seen from the robot's base or from the tool; ``elbow`` [rad/s] turns
    the arm angle.
    """

    lane = Lane.JOG
    front_ends = _SCRIPT

    arm: ArmName
    linear: tuple[float, float, float] = (0.0, 0.0, 0.0)
    angular: tuple[float, float, float] = (0.0, 0.0, 0.0)
    elbow: float = 0.0
    frame: Literal["base", "tool"] = "base"
    time: float | None = None

    def needed_arms(self, robot: CommandedRobot) -> Sequence[Side]:
        return (side_of(self.arm),)

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        side = side_of(self.arm)
        is_in_tool = self.frame == "tool"

        def jog(twist: Joints) -> bool:
            return robot.mover.jog_tool(side, twist, FINGERTIPS, caller.client, self.time, is_in_tool=is_in_tool)

        return _jog(robot, caller, side, (*self.linear, *self.angular, self.elbow), self.time, jog)


class Stream(Command[str], frozen=True):
    """Have arms follow a stream of joint positions, of which this is the next point, and grippers one of widths.

    It is asked for again and again, 10 to 500 times a second. Positions are as of :class:`Move`; ``velocities``
    [rad/s], (7,), are those of the stream. ``time`` [s] is when the point is for, by ``time.monotonic()`` of the
    driver's machine; without it that is now. ``grippers`` are widths [m], of which 0 grips. ``tracking`` and ``delay``
    [s] say how the stream is followed. The first one takes the arms over from standstill; a stream that does not begin
    where they are needs ``blend`` [s]. The arms brake when the client goes away.
    """

    lane = Lane.JOG
    front_ends = _SCRIPT

    right: SentPosition | None = None
    left: SentPosition | None = None
    velocities: dict[ArmName, Joints] | None = None
    grippers: dict[ArmName, float] | None = None
    time: float | None = None
    tracking: GoalTracking = "feed_forward"
    delay: float | None = None
    blend: float | None = None

    @property
    def goals(self) -> Mapping[Side, SentPosition]:
        """The positions of the arms that have one."""
        return by_side(self.right, self.left)

    def check(self) -> None:
        if not self.goals and not self.grippers:
            raise CommandRefused(message("stream_empty"))
        stream_delay(self.tracking, self.delay)

    def needed_arms(self, robot: CommandedRobot) -> Sequence[Side]:
        return tuple(self.goals)

    def run(self, robot: CommandedRobot, caller: Caller) -> str:
        closed = {side_of(arm): closed_of(arm, width) for arm, width in (self.grippers or {}).items()}
        velocities = {side_of(arm): velocity for arm, velocity in (self.velocities or {}).items()}
        delay = stream_delay(self.tracking, self.delay)
        if not robot.moving.acquire(timeout=MOTION_BEGINS):  # a jog of the other arm holds it for moments
            raise CommandRefused(message("another_move_under_way"))
        try:
            caller.check()
            robot.control.hand_over.check_all(closed, Commander.STREAM)
            if robot.mover.stream(self.goals, velocities, self.time, delay, self.blend):  # a controller was switched
                robot.on_change()
        finally:
            robot.moving.release()
            for side in self.goals:  # what has failed may have moved the arm all the same
                caller.hold(("stream", side), partial(robot.mover.end_stream, side, caller.client), None)
        robot.follow_with_grippers(closed, caller.elsewhere)
        return ""


class Teleoperate(Command[TeleoperationReport], frozen=True):
    """Have tools or joints follow a person's device, of which ``frame`` is the newest report.

    A device sends its frames again and again, such as 60 times a second, over one connection. An arm moves while its
    clutch is held. The driver brakes the arms when the newest frame is older than 0.2 s, or the connection ends; the
    clutch must then be released and pressed again. One device at a time moves the arms.
    """

    lane = Lane.JOG
    front_ends = _SCRIPT

    frame: DeviceFrame
    is_headset: bool = False

    def check(self) -> None:
        self.frame.check()

    def needed_arms(self, robot: CommandedRobot) -> Sequence[Side]:
        return tuple(side for side, hand in self.frame.by_arm.items() if hand.clutch)

    def run(self, robot: CommandedRobot, caller: Caller) -> TeleoperationReport:
        who = Commander.HEADSET if self.is_headset else Commander.DEVICE
        try:
            return robot.teleoperation.take(self.frame, caller.client, caller.elsewhere, who, caller.name)
        finally:
            teleoperation = robot.teleoperation
            caller.hold("teleoperation", lambda: teleoperation.lose(caller.client), teleoperation.lasts())


def _jog(
    robot: CommandedRobot,
    caller: Caller,
    side: Side,
    values: Joints,
    time: float | None,
    jog: Callable[[Joints], bool],
) -> str:
    """Move an arm for a moment, whatever timeouts its controllers have; ``values`` were asked for at a ``time`` [s].

    A move that is being carried out goes first, but a person takes the arm over from a program's, as the first jog does
    it: the next one moves the arm. Who jogs it already waits briefly for what others ask of the other arm.
    """
    holds = 0.0  # where this one is refused, what the one before began ends at once
    try:
        robot.mover.check_jog_recent(values, time)  # before anything is taken from a program
        is_own = robot.control.hand_over.is_own(side)
        if not robot.moving.acquire(timeout=MOTION_BEGINS if is_own else 0.0):
            if not _acquire_from_program(robot, caller, side):
                raise CommandRefused(message("another_move_under_way"))
            values = ZERO_JOINTS  # which is never too old: to wait for the arm may have taken seconds
        try:
            caller.check()
            if jog(values):  # a controller was switched
                if caller.commander is not None:
                    robot.followers[side].forget()  # what a stream has sent before, and waits for the gripper
                robot.on_change()
            holds = JOG_HOLDS
        finally:
            robot.moving.release()
    finally:  # what has failed may have moved the arm all the same
        caller.hold(side, lambda: robot.mover.end_jog(side, caller.client), holds)
    return ""


def _acquire_from_program(robot: CommandedRobot, caller: Caller, side: Side) -> bool:
    """Acquire ``robot.moving`` for a person who takes an arm over from a program's move, which ends; whether held.

    A program that commands no arm at this moment may be about to, or have just done so: it is waited for briefly.
    """
    hand_over = robot.control.hand_over
    commander = hand_over.of(side).who
    if caller.commander is None or commander.is_person:
        return False
    if commander is Commander.NONE:
        return robot.moving.acquire(timeout=MOTION_BEGINS)
    hand_over.take(side, caller.commander)
    wait_for_futures([motion.future for motion in robot.mover.stop((side,))], _LAST_STOP)
    return robot.moving.acquire(timeout=_LAST_STOP)


def _move(
    robot: CommandedRobot,
    sides: Sequence[Side],
    begin: Callable[[], Sequence[RunningMotion]],
    timeout: float | None,
    caller: Caller,
) -> str:
    """Move arms, wait until they stand, and give them back to the controllers that commanded them."""
    if not sides:
        raise CommandRefused(message("no_arm_has_goal"))
    is_free = robot.moving.acquire(blocking=False)
    if not is_free and not any(_acquire_from_program(robot, caller, side) for side in sides):
        raise CommandRefused(message("another_move_under_way"))
    try:
        before = {side: robot.mover.commanding(side) for side in sides}
        for side, names in before.items():
            if robot.control.hand_over.of(side).is_of_person:
                robot.control.hand_over.check(side, Commander.TRAJECTORY)
            is_taken_over = caller.commander is not None and robot.control.hand_over.is_foreign(side)
            if robot.mover.is_moving(side) and not is_taken_over:
                if not names:
                    raise CommandRefused(message("arm_moves_without_controller", arm=side.word))
                raise CommandRefused(message("arm_moves_commanded_by", arm=side.word, controllers=tuple(names)))
        try:
            motions = begin()
        except YumiError:  # refused: nothing has moved
            _give_back(robot, before)
            raise
        for side in sides if caller.commander is not None else ():
            robot.followers[side].forget()
        _wait(robot, motions, timeout, caller)
        _give_back(robot, before)
        for side in sides:  # the motion is over, although the arm may still settle: the next client need not wait
            robot.control.hand_over.let_go(side)
    finally:
        robot.moving.release()
    return headline(message("arms_at_goal") if len(sides) > 1 else message("arm_at_goal", arm=sides[0].word))


def _give_back(robot: CommandedRobot, commanding: Mapping[Side, tuple[str, ...]]) -> None:
    """Have these controllers command the arms again; not after a motion that was stopped: the arm holds then."""
    hand_over = robot.control.hand_over
    with hand_over.keeping(commanding):  # who has taken one meanwhile goes on with it
        for side in filter(hand_over.has_kept, commanding):
            names, now = commanding[side], robot.mover.commanding(side)
            if names and names != now and robot.control.snapshot(side).is_running:
                robot.control.call(Commands.switch_controllers, side, names, now)


def _wait(robot: CommandedRobot, motions: Sequence[RunningMotion], timeout: float | None, caller: Caller) -> None:
    """Until all arms stand at their goals; else those that still move are stopped, and GoalNotReached is raised."""
    deadline = None if timeout is None else time.monotonic() + timeout
    futures = [motion.future for motion in motions]
    try:
        while not all(future.done() for future in futures):
            done, _ = wait_for_futures(futures, _POLL_PERIOD, FIRST_EXCEPTION)
            for future in done:
                future.result()
            with suppress(YumiError):  # how far they are is only shown
                caller.show_motions({it.side.word: MotionReport(*it.way) for it in motions})
            if caller.is_gone():
                raise GoalNotReached(message("motion_stopped_asker_gone"))
            if deadline is not None and time.monotonic() > deadline:
                raise GoalNotReached(message("motion_took_too_long", longest=timeout))
        for future in futures:
            future.result()
    except BaseException:
        with suppress(YumiError):  # what ended the motion is what a person must read
            robot.mover.stop_own([motion.side for motion in motions if not motion.future.done()])
        raise
