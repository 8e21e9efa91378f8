"""The robot as a script sees it: both arms, their common motions, and what is done to the robot as a whole."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, SupportsFloat, TypeVar

from abb_protocols.catalogue import message, quoted
from abb_protocols.errors import CommandRefused, RobotNotReady, YumiError
from abb_protocols.robot.joints import Pose, Side, by_side
from abb_runtime.rws.client import RwsClient
from yumi.api.chunks import ChunkFollower
from yumi.api.connection import Connection
from yumi.api.gripper import Gripper
from yumi.api.joint_positions import Position, TimedPosition, checked_goal
from yumi.api.motion_executor import RETREAT_SPEED_SCALE, MotionExecutor
from yumi.api.motion_registry import Motion
from yumi.api.obstacles import boxes_from
from yumi.api.poses import PoseFrames, PoseLike, poses_from, waypoints_from
from yumi.api.robot_arm import Arm
from yumi.control.chunk_commands import MOST_JUMP
from yumi.control.goals import GoalTracking, stream_delay
from yumi.control.hand_over import Commander
from yumi.driver import gripper as driver
from yumi.driver.gripper_follower import closed_of
from yumi.driver.initial_controllers import Controllers
from yumi.driver.robot_state import RobotState
from yumi.driver.settings import Settings
from yumi.planning.tool_path import TOOL_SPEED, TOOL_TURNING, TOOL_ZONE, ToolMotion

if TYPE_CHECKING:
    from yumi.planning.planner import Plan, Planner

_log = logging.getLogger(__name__)

_T = TypeVar("_T")


class Robot:
    """A YuMi, real or virtual; built by :func:`yumi.connect`, connected by ``with`` or :meth:`open`.

    Args:
        settings: where it is, and how it moves.
        controllers: what runs on each arm.
        arms: those on which EGM runs; the others stand still.
        on_step: given each step of what is done to the robot.

    Attributes:
        right: the right arm.
        left: the left arm.
    """

    def __init__(
        self,
        settings: Settings,
        controllers: Controllers,
        arms: tuple[Side, ...] = tuple(Side),
        on_step: Callable[[str], None] = lambda step: None,
    ) -> None:
        self._connection = Connection(settings, controllers, arms, on_step)
        self._address = settings.robot.host_and_port
        self._is_connected = False
        self._modules = {side: settings.gripper.modules(side) for side in Side}
        self._collision = settings.collision
        self._planner: Planner | None = None  # made when the first motion is planned
        self._frames = PoseFrames()
        force, picked = settings.gripper.force, settings.gripper.picked_pressure
        self.right, self.left = (
            Arm(
                side,
                lambda: self.executor,
                Gripper(
                    side,
                    partial(self._gripper, side),
                    force,
                    picked,
                    partial(self._check_gripper, side),
                    partial(self._calibrate, side),
                ),
                partial(self._datagram, side),
                self._frames,
                partial(self._tcp, side),
            )
            for side in (Side.RIGHT, Side.LEFT)
        )

    def __enter__(self) -> Robot:
        return self.open()

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<yumi.Robot at {self._address}, {'' if self._is_connected else 'not '}connected>"

    def open(self, confirm: str = "") -> Robot:
        """Connect, bring the robot to ready where that is named, and start EGM; a notebook's ``with``.

        See ``bringup`` of :func:`yumi.connect`. A person who confirms a stop has the robot brought to ready, too.

        Args:
            confirm: the stop that a person has looked at and confirms: ``stop`` of the error of an earlier attempt.

        Returns:
            This robot.

        Raises:
            StopNotConfirmed: an emergency stop, a guard stop or a collision waits for a person's confirmation.
            NoConnection: nothing answers, or an EGM port is taken.
            LoginRefused: user or password are wrong.
            RobotNotReady: the robot cannot be brought to where it may move, or another program drives it.
        """
        if not self._is_connected:
            try:
                self._connection.open(confirm)
            except YumiError as error:  # without what other libraries have raised: the sentence is all there is to know
                raise error.with_traceback(None) from None
            self._is_connected = True
        return self

    def close(self) -> None:
        """Let the arms come to rest, end EGM and disconnect; does nothing when that is done."""
        self._is_connected = False
        self._connection.close()

    @property
    def is_connected(self) -> bool:
        """Whether it was opened and not closed."""
        return self._is_connected

    def move_to(
        self,
        *,
        right: Position | None = None,
        left: Position | None = None,
        wait: bool = True,
        timeout: float | None = None,
        speed_scale: float | None = None,
        acceleration: float | None = None,
    ) -> tuple[Motion, ...]:
        """Move both arms, beginning in the same cycle; either both move or none.

        Each arm arrives in its own time. An arm that is stopped on its way stops the other.

        Arguments and errors are those of :meth:`Arm.move_to`, with a position of each arm [rad], (7,); None leaves it
        alone. It is refused, too, when no arm is named; where one motion ended elsewhere, both arms hold.

        Returns:
            The motions; over, unless ``wait`` is False.
        """
        goals: dict[Side, Position] = _named(right, left)
        executor = self.executor
        return executor.awaited(executor.move(goals, speed_scale, acceleration), wait=wait, timeout=timeout)

    def follow(
        self,
        *,
        right: Sequence[TimedPosition] | None = None,
        left: Sequence[TimedPosition] | None = None,
        wait: bool = True,
        timeout: float | None = None,
    ) -> tuple[Motion, ...]:
        """Have both arms follow trajectories that begin at the same moment, 0.1 s after the call; or none.

        An arm that is stopped on its way stops the other while the call waits for them.

        Arguments and errors are those of :meth:`Arm.follow`, with a trajectory of each arm.

        Returns:
            The motions; over, unless ``wait`` is False.
        """
        trajectories = _named(right, left)
        executor = self.executor
        return executor.awaited(executor.follow(trajectories), wait=wait, timeout=timeout)

    def follow_chunks(self, arms: Sequence[str] | None = None, *, jump: float = MOST_JUMP) -> ChunkFollower:
        """Have arms follow the chunks of a policy, each of which replaces what has not been executed yet.

        ::

            with robot.follow_chunks() as chunks:
                while True:
                    observed = time.monotonic()
                    actions = infer(observe())
                    chunks.send(yumi.Chunk(period=0.02, start=chunks.start_for(observed), right=actions))

        Position, velocity and acceleration of the command are continuous at every seam. Where the points are exhausted
        the arms brake from the same cycle on, within their limits, and hold until the next chunk. At the end of the
        block they come to rest.

        Args:
            arms: ``"right"``, ``"left"`` or both; None: those on which EGM runs. They come to rest before the block.
            jump: a chunk that is further from where its arm is commanded to be is refused [rad], above 0 up to 1.

        Raises:
            CommandRefused: an argument is impossible.
            RobotNotReady: the robot is not connected; on entering, also: an arm does not follow.
        """
        executor, words = self.executor, {side.word: side for side in Side}
        given = tuple(side.word for side in executor.arms) if arms is None else tuple(arms)
        if not given or len(set(given)) != len(given) or not set(given) <= set(words):
            raise CommandRefused(message("connect_arms_unknown", given=repr(arms)))
        if not 0.0 < jump <= 1.0:
            raise CommandRefused(message("goal_scale_out_of_range", name="jump", value=jump))
        sides = tuple(words[word] for word in given)
        grippers = {side: self._connected.followers[side] for side in sides}
        return ChunkFollower(executor, sides, executor.limits, grippers, jump)

    def stream(
        self,
        *,
        right: Position | None = None,
        left: Position | None = None,
        velocities: Mapping[str, Sequence[SupportsFloat]] | None = None,
        grippers: Mapping[str, SupportsFloat] | None = None,
        time: SupportsFloat | None = None,
        tracking: GoalTracking = "feed_forward",
        delay: float | None = None,
        blend: SupportsFloat | None = None,
    ) -> None:
        """Follow a stream with both arms and the grippers, of which this is the next point; returns at once.

        ::

            while True:
                action = policy(observe())  # 30 times a second
                robot.stream(right=action.right, left=action.left, grippers={"right": action.width})

        Both arms get the point for the same time, or none does. Arguments and errors are those of :meth:`Arm.stream`.

        Args:
            right: joint positions of the right arm [rad], (7,); None leaves the arm alone.
            left: of the left arm.
            velocities: of the stream at this point [rad/s], (7,), by ``"right"`` and ``"left"``.
            grippers: widths [m] by ``"right"`` and ``"left"``, from 0, which grips, to 0.05. A gripper goes to the
                newest one as soon as it has done the one before; one that cannot is said in the log.
            time: as for :meth:`Arm.stream`; so are ``tracking``, ``delay`` and ``blend``.
            tracking: see ``time``.
            delay: see ``time``.
            blend: see ``time``.
        """
        goals: dict[Side, Position] = by_side(right, left)
        closed = {_side(arm): closed_of(arm, width) for arm, width in (grippers or {}).items()}
        if not goals and not closed:
            raise CommandRefused(message("stream_empty"))
        speeds = {_side(arm): velocity for arm, velocity in (velocities or {}).items()}
        self.executor.control.hand_over.check_all(closed, Commander.STREAM)
        self.executor.stream(goals, speeds, time, stream_delay(tracking, delay), blend)
        if closed:
            self._connected.follow_with_grippers(closed)

    def plan_to(
        self,
        *,
        right: Position | Pose | None = None,
        left: Position | Pose | None = None,
        boxes: Mapping[str, tuple[PoseLike, Sequence[SupportsFloat]]] | None = None,
        timeout: float = 30.0,
        speed_scale: float = 1.0,
        seed: int = 0,
    ) -> Plan:
        """Plan a motion around the robot itself and boxes; nothing moves before :meth:`execute`.

        Args:
            right: goal of the right arm: joint positions [rad] as for :meth:`move_to`, or the pose of tool0 in the body
                frame, which is reached in a posture near the present one; None lets it stand.
            left: the same for the left arm.
            boxes: what stands around the robot, beside ``collision.boxes`` of ``yumi.yaml``: by name, the pose of a
                box's centre in the body frame, and its edges [m].
            timeout: how long to look for a path [s]; a straight one is found in any case.
            speed_scale: share of the joints' speeds, above 0 up to 1.
            seed: of the random numbers; the same one finds the same path.

        Raises:
            MissingPrerequisite: RoboPlan is not installed.
            CommandRefused: a goal, or where an arm is now, is impossible or too near to something.
            PlanNotFound: no path was found; ``why`` says whether time was up or there is none.
        """
        from yumi.planning.planner import Planner  # noqa: PLC0415 - an extra; nothing else needs it

        start = {side: arm.position for side, arm in by_side(self.right, self.left).items()}
        goals: dict[Side, Position | Pose] = _named(right, left)
        obstacles = (*self._collision.obstacles(), *boxes_from(boxes or {}))
        limits = self.executor.limits  # what EGM leaves of the joints' speeds
        if self._planner is None or (self._planner.obstacles, self._planner.limits) != (obstacles, limits):
            self._planner = Planner(self._modules, tools=self._collision.tools(), obstacles=obstacles, limits=limits)
        return self._planner.plan(
            start,
            {
                side: goal if isinstance(goal, Pose) else checked_goal(side, goal, start[side])
                for side, goal in goals.items()
            },
            timeout=timeout,
            speed_scale=speed_scale,
            seed=seed,
        )

    def retreat(
        self, *, wait: bool = True, timeout: float | None = None, speed_scale: float = RETREAT_SPEED_SCALE
    ) -> tuple[Motion, ...]:
        """Lead both arms home on a planned path, slowly: out of where the limiter has stopped them at each other.

        Nothing calls this by itself. What was not declared is not known: look that the arms hold nothing that is in the
        way, and that no person is near.

        Args:
            wait: return when the arms stand at home; else at once.
            timeout: arms that take longer than this are stopped [s]; None lets them take their time.
            speed_scale: share of the joints' speeds, above 0 up to 1.

        Returns:
            The motions; over, unless ``wait`` is False.

        Raises:
            MissingPrerequisite: RoboPlan is not installed.
            CommandRefused: where an arm is now is too near to something; nothing was changed.
            PlanNotFound: no path was found; nothing was changed.
            RobotNotReady: as for :meth:`Arm.move_to`.
            GoalNotReached: a motion ended elsewhere; the arms hold.
        """
        return self.execute(
            self.plan_to(right="home", left="home", speed_scale=speed_scale), wait=wait, timeout=timeout
        )

    def execute(self, plan: Plan, *, wait: bool = True, timeout: float | None = None) -> tuple[Motion, ...]:
        """Have the arms follow a plan; both must be where they were when it was made, see :meth:`plan_to`.

        Arguments ``wait`` and ``timeout``, the errors and what is returned are those of :meth:`follow`.
        """
        executor = self.executor
        return executor.awaited(executor.follow(plan.points, plan.start), wait=wait, timeout=timeout)

    def move_to_pose(
        self,
        *,
        right: PoseLike | None = None,
        left: PoseLike | None = None,
        wait: bool = True,
        timeout: float | None = None,
        speed_scale: float | None = None,
        acceleration: float | None = None,
    ) -> tuple[Motion, ...]:
        """Move the tools of both arms to poses, beginning in the same cycle; either both move or none.

        Arguments and errors are those of :meth:`Arm.move_to_pose`, with each arm's own tool.
        """
        arms = by_side(self.right, self.left)
        given: dict[Side, PoseLike] = _named(right, left)
        goals = {side: arms[side]._posture(pose) for side, pose in given.items()}
        return self.move_to(
            right=goals.get(Side.RIGHT),
            left=goals.get(Side.LEFT),
            wait=wait,
            timeout=timeout,
            speed_scale=speed_scale,
            acceleration=acceleration,
        )

    def move_linear(
        self,
        *,
        right: PoseLike | Sequence[PoseLike] | None = None,
        left: PoseLike | Sequence[PoseLike] | None = None,
        work_object: PoseLike | str | None = None,
        zone: float = TOOL_ZONE,
        wait: bool = True,
        timeout: float | None = None,
        speed: float = TOOL_SPEED,
        turning: float = TOOL_TURNING,
        acceleration: float = 1.0,
    ) -> tuple[Motion, ...]:
        """Move the tools of both arms on straight lines, as one motion: they begin and end together, or none moves.

        A list of poses is a path as of :meth:`Arm.move_through`. Arguments and errors are those of
        :meth:`Arm.move_linear`, with each arm's own tool; an arm that is stopped on its way stops the other while the
        call waits for them.
        """
        arms, executor = by_side(self.right, self.left), self.executor
        poses: dict[Side, PoseLike | Sequence[PoseLike]] = _named(right, left)
        paths = {
            side: ToolMotion(
                arms[side]._tool(None),
                waypoints_from(self._frames, poses_from(given), work_object, None),
                speed,
                turning,
                zone,
                acceleration,
            )
            for side, given in poses.items()
        }
        return executor.awaited(executor.follow_path(paths), wait=wait, timeout=timeout)

    def allow_collision(self, part: str, other: str, *, seconds: float = 10.0) -> ExitStack:
        """Let two parts touch for a while: handing over, gripping between both arms, placing on a declared table.

        ::

            with robot.allow_collision("right gripper", "left gripper", seconds=20.0):
                robot.move_linear(right=..., left=..., speed=0.02)

        They are kept apart again at the end of the ``with`` block, or after the time. Until then both arms have a tenth
        of their speed, and all other parts are kept apart as ever. Parts that touch then may only move apart.

        Args:
            part: a part as the log names it (``right forearm``), an arm as a whole (``right arm``), or its gripper with
                fingers, cups, camera and declared tools (``right gripper``).
            other: a part of the other arm, ``body``, or a declared box (``table``).
            seconds: for how long, up to 60 s; called again for the same parts, the time begins anew.

        Returns:
            What ends it, by ``with`` or by ``close()``.

        Raises:
            CommandRefused: ``collision.enabled`` is false, there are no such parts, the time is out of range, or an arm
                moves or is held before its goal; nothing was changed.
            RobotNotReady: the robot is not connected, or the control process has ended.
        """
        manager, end = self._connected.manager, ExitStack()
        _log.info("%s", manager.allow_collision(part, other, float(seconds)))

        def keep_apart() -> None:
            with suppress(RobotNotReady):  # the control process has ended, and nothing is allowed any more
                manager.end_allowed_collision(part, other)

        end.callback(keep_apart)
        return end

    def record(self, file: Path | str) -> ExitStack:
        """Record every cycle of both arms, as sent and as measured, to an MCAP file.

        ::

            with robot.record("motion.mcap"):
                robot.right.move_to(...)

        ``yumi record``, ``yumi view`` and ``yumi compare`` read it.

        Args:
            file: where to; its folder is made, a file of that name is replaced.

        Returns:
            What ends the recording, by ``with`` or by ``close()``.

        Raises:
            RobotNotReady: the robot is not connected.
            SettingsError: the file cannot be written.
            MissingPrerequisite: mcap is not installed.
        """
        return self._connected.record(Path(file))

    def stop(self) -> None:
        """Bring both arms to rest as fast as their joints may, and return when they stand.

        Raises:
            RobotNotReady: the robot is not connected.
            GoalNotReached: an arm did not come to rest.
        """
        executor = self.executor
        executor.awaited(executor.stop(executor.arms))

    def give_back(self) -> tuple[str, ...]:
        """Let this program command arms again that a person has let go; for a person to call, or to agree to.

        A person who has teleoperated or jogged an arm leaves it reserved: programs' motions are refused until then.

        Returns:
            The arms that were reserved.

        Raises:
            CommandRefused: a person commands one of the arms at this moment; nothing was changed.
        """
        return tuple(side.word for side in self.executor.control.hand_over.give_back(tuple(Side)))

    def recover(self, confirm: str = "") -> None:
        """Bring the robot back to where it may move, after an emergency stop, a lost connection, or any other fault.

        Nothing moves by itself: the arms hold where they are until they get their next goal. After an emergency stop, a
        guard stop or a collision a person has to look at the robot first and confirm that stop::

            try:
                robot.recover()
            except abb_protocols.errors.StopNotConfirmed as error:
                if input(f"{error} Type yes when no person is near the robot: ") == "yes":
                    robot.recover(confirm=error.stop)

        Args:
            confirm: the stop that a person has looked at and confirms: ``stop`` of an error, or
                :attr:`stop_to_confirm`.

        Raises:
            StopNotConfirmed: a stop waits for a person's confirmation, or another one; nothing was changed.
            YumiError: a step failed; the message says which and what to do.
        """
        try:
            self._connected.recover(confirm)
        except YumiError as error:
            raise error.with_traceback(None) from None

    @property
    def stop_to_confirm(self) -> str:
        """Id of the stop that a person must confirm before anything moves again; empty where there is none.

        Raises:
            RobotNotReady: the robot is not connected.
        """
        return self._connected.manager.state().stop

    @property
    def speed_scale(self) -> float:
        """The factor on the speed of every controller, which holds now; a motion at 0.1 takes ten times as long.

        It is 0.1 at first for a robot that is not on this machine, unless :func:`yumi.connect` or the settings say
        otherwise. Setting it changes motions under way, too, gradually. The robot's own limit follows when EGM starts:
        it cannot be raised above what EGM was started with before ``robot.close()`` and ``robot.open()``.

        Raises:
            CommandRefused: a value that is set is not from 0.01 to 1; nothing was changed.
            RobotNotReady: the robot is not connected.
        """
        return self._connected.manager.speed.in_force

    @speed_scale.setter
    def speed_scale(self, value: float) -> None:
        _log.info(self._connected.manager.speed.set(value))

    @property
    def state(self) -> RobotState:
        """Mode, motors, RAPID program and EGM of the robot, why it does not move and what stopped it.

        Raises:
            RobotNotReady: the robot is not connected.
        """
        return self._connected.manager.state()

    def describe(self) -> str:
        """Mode, motors, RAPID program and EGM of the robot in one line.

        Raises:
            YumiError: the controller does not answer.
        """
        return self._connected.manager.describe()

    @property
    def controller(self) -> RwsClient:
        """The robot's controller over Robot Web Services: signals, RAPID data, files, configuration, event log.

        It is the driver's own session. What it starts, stops or switches, the driver finds out by itself.

        Raises:
            RobotNotReady: the robot is not connected.
        """
        return self._connected.client

    @property
    def executor(self) -> MotionExecutor:
        """What the arms' methods are made of; raises RobotNotReady when the robot is not connected."""
        return self._connected.executor

    @property
    def tools(self) -> dict[str, PoseLike]:
        """Tools by name: frames in tool0, RAPID's ``tframe``. Add your own: ``robot.tools["pen"] = yumi.pose(…)``."""
        return self._frames.tools

    @property
    def work_objects(self) -> dict[str, PoseLike]:
        """Work objects by name: frames in the robot's body, in which poses may be given. Add your own."""
        return self._frames.work_objects

    def _tcp(self, side: Side) -> Pose:
        return self._connected.manager.tcp(side)

    def _check_gripper(self, side: Side) -> None:
        self._connected.manager.check_gripper(side)

    def _calibrate(self, side: Side) -> None:
        self._connected.calibrate(side)

    def _datagram(self, side: Side) -> bytes:
        return self._connected.datagram(side)

    def _gripper(self, side: Side) -> driver.RwsGripper:
        return self._connected.grippers[side]

    @property
    def _connected(self) -> Connection:
        if not self._is_connected:
            raise RobotNotReady(message("script_not_connected"))
        return self._connection


def _side(arm: str) -> Side:
    for side in Side:
        if side.word == arm:
            return side
    raise CommandRefused(message("arm_name_unknown", given=quoted(arm)))


def _named(right: _T | None, left: _T | None) -> dict[Side, _T]:
    """What was given for each arm."""
    given = by_side(right, left)
    if not given:
        raise CommandRefused(message("no_arm_has_goal"))
    return given
