"""The driver that another program runs, as a script sees it: ``with yumi.attach() as driver``.

It looks and asks over the driver's local endpoint, and drives nothing. Whatever a script may ask for is a command of
:mod:`yumi.driver.commands`; the methods are those that people use most.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from math import isfinite
from typing import TYPE_CHECKING, Literal, TypeVar

import msgspec

from abb_protocols.catalogue import message, quoted
from abb_protocols.errors import CommandRefused, YumiError
from abb_protocols.robot.joints import JOINT_COUNT, Pose, Side, by_side, joints
from yumi.api.joint_positions import Position, checked_goal
from yumi.api.motion_executor import RETREAT_SPEED_SCALE
from yumi.control.goals import GoalTracking
from yumi.driver.command import ArmName, Command, Lane, SentPosition
from yumi.driver.commands import (
    AllowCollision,
    Calibrate,
    GetControllers,
    GetState,
    GetSurroundings,
    GiveBack,
    Grip,
    Recover,
    SetMode,
    SetSpeedScale,
    StartEgm,
    StopEgm,
    SwitchControllers,
)
from yumi.driver.endpoint import ENDPOINT_ANSWER_TIME, EndpointClient, find_driver
from yumi.driver.motion_commands import Follow, Jog, JogTool, Move, Stream
from yumi.driver.reports import ControllerStatus, DriverState, GripReport, MotionReport
from yumi.driver.robot_state import ModeName
from yumi.driver.surroundings import Surroundings, limits_of, shapes_of

if TYPE_CHECKING:
    from yumi.planning.planner import Plan, Planner

_R = TypeVar("_R")
_Arms = ArmName | Sequence[ArmName]


def attach(robot: str = "", *, on_step: Callable[[str], None] = lambda step: None) -> RunningDriver:
    """The driver that runs on this machine, of ``yumi up`` or of a script's ``yumi.connect``.

    ::

        with yumi.attach() as driver:
            print(driver.state.arms["right"].position)
            driver.move_to(right="home")

    Args:
        robot: its robot's address or its namespace, where several drivers run.
        on_step: given each step of what the driver does for this program.

    Raises:
        RobotNotReady: no driver runs, or several do; the message says what to do.
    """
    try:
        return RunningDriver(EndpointClient(find_driver(robot)), on_step)
    except YumiError as error:
        raise error.with_traceback(None) from None


class RunningDriver:
    """A running driver as another program sees it; one request at a time.

    Every method returns when it is done, and raises what the driver raised: a YumiError with its sentence.

    Args:
        client: the connection to it.
        on_step: given each step of what it does.
    """

    def __init__(self, client: EndpointClient, on_step: Callable[[str], None] = lambda step: None) -> None:
        self._client = client
        self._on_step = on_step
        self._planner: tuple[Surroundings, Planner] | None = None  # of the last plan, and what it was made for

    def __enter__(self) -> RunningDriver:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<yumi.RunningDriver {self._client.path.stem}>"

    def close(self) -> None:
        """Disconnect; a motion that this program has asked for is stopped."""
        self._client.close()

    def call(
        self, command: Command[_R], on_motion: Callable[[dict[str, MotionReport]], None] = lambda motions: None
    ) -> _R:
        """Have the driver carry out a command, such as ``driver.call(yumi.driver.commands.StopEgm())``; its result.

        Args:
            command: with its arguments.
            on_motion: given how far motions are, ten times a second.
        """
        timeout = ENDPOINT_ANSWER_TIME if command.lane is Lane.READ else None
        return self._client.call(command, self._on_step, on_motion, timeout)

    @property
    def state(self) -> DriverState:
        """All that the driver knows: robot, arms, controllers, grippers, the newest events."""
        return self.call(GetState())

    def watch(self, rate: float = 30.0) -> Iterator[DriverState]:
        """The state ``rate`` times a second (0.1 to 60), with the events since the one before.

        A connection that watches asks for nothing else: attach once more for that.
        """
        return self._client.watch(rate)

    @property
    def controllers(self) -> Mapping[str, tuple[ControllerStatus, ...]]:
        """The controllers of each arm."""
        return self.call(GetControllers())

    @property
    def speed_scale(self) -> float:
        """The factor on the speed of every controller; it can be set, 0.01 to 1."""
        return self.state.speed_scale

    @speed_scale.setter
    def speed_scale(self, value: float) -> None:
        self.call(SetSpeedScale(speed_scale=float(value)))

    def start_egm(self, arms: _Arms = ()) -> str:
        """Start EGM on ``"right"``, ``"left"`` or the arms that are configured, with the controllers on top."""
        return self.call(StartEgm(arms=_arms(arms)))

    def stop_egm(self) -> str:
        """Bring the arms to rest and end EGM; waits for nothing else that the driver does."""
        return self.call(StopEgm())

    def set_mode(self, mode: ModeName) -> str:
        """Bring the robot to ``motors_off``, ``ready``, ``egm_left``, ``egm_right`` or ``egm_both``."""
        return self.call(SetMode(mode=mode))

    def recover(self, confirm: str = "") -> str:
        """Bring the robot back after a stop; ``confirm`` is ``state.stop``, after a person has looked at the robot."""
        return self.call(Recover(confirm=confirm))

    def give_back(self, arms: _Arms = ("right", "left")) -> str:
        """Let programs command arms again that a person has let go; for a person to call, or to agree to.

        Raises:
            CommandRefused: a person commands one of the arms at this moment; nothing was changed.
        """
        return self.call(GiveBack(arms=_arms(arms)))

    def calibrate(self, arms: _Arms = ("right", "left")) -> str:
        """Close the fingers of grippers and call that zero."""
        return self.call(Calibrate(arms=_arms(arms)))

    def open_gripper(self, arm: ArmName, width: float | None = None) -> GripReport:
        """Open a gripper to ``width`` [m], or as far as it goes."""
        return self.call(Grip(arm=arm, action="open", width=width))

    def close_gripper(self, arm: ArmName, force: float | None = None) -> GripReport:
        """Close a gripper and hold what is there with ``force`` [N]."""
        return self.call(Grip(arm=arm, action="close", force=force))

    def switch(self, arm: ArmName, activate: Sequence[str] = (), deactivate: Sequence[str] = ()) -> str:
        """Activate and deactivate controllers of one arm in one step."""
        return self.call(SwitchControllers(arm=arm, activate=tuple(activate), deactivate=tuple(deactivate)))

    def move_to(
        self,
        *,
        right: Position | None = None,
        left: Position | None = None,
        speed_scale: float | None = None,
        acceleration: float | None = None,
        timeout: float | None = None,
        is_pose: bool = False,
        is_linear: bool = False,
        speed: float | None = None,
        on_motion: Callable[[dict[str, MotionReport]], None] = lambda motions: None,
    ) -> str:
        """Move arms, and return when they stand at their goals; the controllers that commanded them do so again then.

        A program that ends meanwhile, also by Ctrl-C, stops them.

        Args:
            right: joint positions [rad], (7,) in chain order; the name of a pose; or some joints by name, the others
                stay.
            left: the same of the left arm.
            speed_scale: factor on the joints' highest speeds, on top of the driver's, above 0 up to 1; None takes the
                controller's.
            acceleration: the same for accelerations and jerks.
            timeout: arms that take longer are stopped [s].
            is_pose: positions are poses of the tools in use instead: x, y, z [m], and w, x, y, z, or the orientation
                stays.
            is_linear: the tools move there on straight lines.
            speed: of the tools on lines, at most [m/s].
            on_motion: given how far the motions are, ten times a second.

        Raises:
            CommandRefused: a position is impossible, an arm moves already, or another program moves it.
            RobotNotReady: EGM does not run on the arm.
            GoalNotReached: a motion ended elsewhere.
        """
        request = Move(
            right=None if right is None else _as_sent(right),
            left=None if left is None else _as_sent(left),
            speed_scale=speed_scale,
            acceleration=acceleration,
            timeout=timeout,
            is_pose=is_pose,
            is_linear=is_linear,
            speed=speed,
        )
        return self.call(request, on_motion)

    def plan_to(
        self,
        *,
        right: Position | Pose | None = None,
        left: Position | Pose | None = None,
        timeout: float = 30.0,
        speed_scale: float = 1.0,
        seed: int = 0,
    ) -> Plan:
        """Plan a motion around the robot itself and the driver's boxes, in this program; nothing moves.

        Arguments and errors are those of :meth:`yumi.api.robot.Robot.plan_to`.
        """
        from yumi.planning.planner import Planner  # noqa: PLC0415 - an extra; nothing else needs it

        start = self.state.planning_start()
        surroundings = self.call(GetSurroundings())
        if self._planner is None or self._planner[0] != surroundings:
            grippers, tools, obstacles = shapes_of(surroundings)
            planner = Planner(grippers, tools=tools, obstacles=obstacles, limits=limits_of(surroundings))
            self._planner = surroundings, planner
        asked: Mapping[Side, Position | Pose] = by_side(right, left)
        goals = {
            side: goal if isinstance(goal, Pose) else checked_goal(side, goal, start[side])
            for side, goal in asked.items()
        }
        return self._planner[1].plan(start, goals, timeout=timeout, speed_scale=speed_scale, seed=seed)

    def execute(
        self, plan: Plan, *, on_motion: Callable[[dict[str, MotionReport]], None] = lambda motions: None
    ) -> str:
        """Have the arms follow a plan, and return when they stand at its end; raises as :meth:`move_to`.

        Both arms must be where they were when it was made.
        """
        paths = {side.word: tuple(map(tuple, points)) for side, points in plan.points.items()}
        start = {side.word: position for side, position in plan.start.items()}
        request = msgspec.convert({"method": "follow", "start": start, **paths}, Follow)
        return self.call(request, on_motion)

    def retreat(
        self,
        *,
        speed_scale: float = RETREAT_SPEED_SCALE,
        on_motion: Callable[[dict[str, MotionReport]], None] = lambda motions: None,
    ) -> str:
        """Lead both arms home on a planned path, slowly, as :meth:`yumi.api.robot.Robot.retreat`."""
        self._on_step("plan a path of both arms home")
        plan = self.plan_to(right="home", left="home", speed_scale=speed_scale)
        self._on_step(f"follow it, {plan.duration:.1f} s")
        return self.execute(plan, on_motion=on_motion)

    def allow_collision(self, part: str, other: str, *, seconds: float = 10.0) -> ExitStack:
        """Let two parts touch for a while, as :meth:`yumi.api.robot.Robot.allow_collision`, which raises the same.

        They are kept apart again, too, when this program disconnects or ends.
        """
        self.call(AllowCollision(part=part, other=other, seconds=float(seconds)))
        end = ExitStack()
        end.callback(lambda: self.call(AllowCollision(part=part, other=other, seconds=0.0)))
        return end

    def jog(self, arm: ArmName, speeds: Sequence[float]) -> None:
        """Move an arm with joint speeds [rad/s], (7,) in chain order, for 0.06 s; call it again while it is to move.

        Raises:
            CommandRefused: the speeds are no seven finite numbers, or another client or motion moves the arm.
            RobotNotReady: EGM does not run on the arm.
        """
        values = _as_sent(speeds)
        if not isinstance(values, tuple) or len(values) != JOINT_COUNT:
            raise CommandRefused(message("jog_speeds_malformed", count=JOINT_COUNT, given=quoted(speeds)))
        self.call(Jog(arm=arm, speeds=joints(values)))

    def jog_tool(
        self,
        arm: ArmName,
        *,
        linear: Sequence[float] = (0.0, 0.0, 0.0),
        angular: Sequence[float] = (0.0, 0.0, 0.0),
        elbow: float = 0.0,
        frame: Literal["base", "tool"] = "base",
    ) -> None:
        """Move the fingertips of an arm with a velocity for 0.06 s; as :meth:`jog`, which raises the same.

        Args:
            arm: which.
            linear: velocity x, y, z [m/s].
            angular: angular velocity about x, y, z [rad/s].
            elbow: speed of the arm angle [rad/s].
            frame: from where they are seen: the robot's base, or the tool.
        """
        values = _as_sent([*linear, *angular, elbow])
        if not isinstance(values, tuple) or len(values) != JOINT_COUNT:
            raise CommandRefused(message("twist_malformed"))
        x, y, z, about_x, about_y, about_z, turn = values
        request = JogTool(arm=arm, linear=(x, y, z), angular=(about_x, about_y, about_z), elbow=turn, frame=frame)
        self.call(request)

    def stream(
        self,
        *,
        right: Position | None = None,
        left: Position | None = None,
        velocities: Mapping[ArmName, Sequence[float]] | None = None,
        grippers: Mapping[ArmName, float] | None = None,
        time: float | None = None,
        tracking: GoalTracking = "feed_forward",
        delay: float | None = None,
        blend: float | None = None,
    ) -> None:
        """Follow a stream with both arms and the grippers, of which this is the next point.

        Arguments and errors are those of :meth:`yumi.api.robot.Robot.stream`. The arms brake and hold when this program
        disconnects or ends.
        """
        speeds = {}
        for arm, velocity in (velocities or {}).items():
            values = _as_sent(velocity)
            if not isinstance(values, tuple) or len(values) != JOINT_COUNT:
                raise CommandRefused(message("stream_velocity_malformed", arm=arm, count=JOINT_COUNT))
            speeds[arm] = joints(values)
        request = Stream(
            right=None if right is None else _as_sent(right),
            left=None if left is None else _as_sent(left),
            velocities=speeds,
            grippers={arm: float(width) for arm, width in (grippers or {}).items()},
            time=time,
            tracking=tracking,
            delay=delay,
            blend=blend,
        )
        self.call(request)


def _arms(arms: _Arms) -> tuple[ArmName, ...]:
    return (arms,) if isinstance(arms, str) else tuple(arms)


def _as_sent(position: Position) -> SentPosition:
    """A position as it is sent. JSON has finite numbers only; all else is for the driver, which knows its joints."""
    if isinstance(position, str):
        return position
    try:
        pairs = position.items() if isinstance(position, Mapping) else enumerate(position, 1)
        values = {name: float(value) for name, value in pairs}
    except (TypeError, ValueError) as error:
        raise CommandRefused(message("goal_not_angles", given=quoted(position))) from error
    for name, value in values.items():
        if not isfinite(value):
            raise CommandRefused(message("goal_position_not_finite", position=name, value=str(value)))
    return {str(name): it for name, it in values.items()} if isinstance(position, Mapping) else tuple(values.values())
