"""The robot and its arms, as a script sees them: ``with yumi.connect(address) as robot``."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from functools import partial
from math import nan
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, SupportsFloat, TypeVar

import numpy as np
from numpy.typing import NDArray

from yumi.api.connection import Connection
from yumi.api.motion import (
    RETREAT_SPEED_SCALE,
    Motion,
    MotionExecutor,
    Position,
    TimedPosition,
    checked_goal,
    in_degrees,
    wait_for,
)
from yumi.api.tool import (
    TOOL0,
    Frames,
    Gripper,
    PoseLike,
    ToolMotion,
    ToolPose,
    boxes_from,
    checked_angle,
    numbers_from,
    pose_from,
    poses_from,
    posture_for,
    postures_of,
    tool_planner,
    waypoints_from,
)
from yumi.catalogue import message
from yumi.control.controllers.cartesian import check_twist, pose_goal, twist_goal
from yumi.control.shared_state import Snapshot
from yumi.control.tool_path import SPEED, TURNING, ZONE
from yumi.driver import gripper as driver
from yumi.driver.reports import ArmMode, ArmReport, arm_report
from yumi.driver.robot_state import RobotState
from yumi.driver.settings import Settings
from yumi.driver.wiring import Controllers
from yumi.errors import CommandRefused, RobotNotReady, YumiError
from yumi.robot.inverse_kinematics import arm_angle, jacobian
from yumi.robot.joints import JOINT_COUNT, POSES, YUMI_LIMITS, Joints, Pose, Side, abb_from_chain, joint_names, joints
from yumi.robot.kinematics import compose, inverse, tool0_to_body
from yumi.rws.client import RwsClient

if TYPE_CHECKING:
    from yumi.planning.planner import Plan, Planner

log = logging.getLogger(__name__)


class Arm:
    """One arm of a connected robot. Joints are in chain order: axes 1, 2, 7, 3, 4, 5, 6, from body to flange.

    Args:
        side: which one.
        executor: the robot's, while it is connected; raises when it is not.
        gripper: on its flange.
        datagram: the newest one of its robot.
        frames: the robot's tools and work objects.
        tcp: the tool in use, as the driver knows it.

    Attributes:
        side: which arm.
        gripper: on its flange.
        tool: what poses are poses of: the name of one of the robot's ``tools``, its frame in tool0, or None for the
            tool in use (``set_tool``; tool0 where none was set).
    """

    def __init__(
        self,
        side: Side,
        executor: Callable[[], MotionExecutor],
        gripper: Gripper,
        datagram: Callable[[], bytes] = lambda: b"",
        frames: Frames | None = None,
        tcp: Callable[[], Pose] = lambda: TOOL0,
    ) -> None:
        self.side = side
        self.gripper = gripper
        self.tool: PoseLike | str | None = None
        self._frames = frames or Frames()
        self._tcp = tcp
        self._executor = executor
        self._datagram = datagram

    def __repr__(self) -> str:
        try:
            state = self.state
        except RobotNotReady:
            return f"<yumi.Arm {self.side.word}, not connected>"
        if state.position is None:
            return f"<yumi.Arm {self.side.word}, {state.mode.value}>"
        axes, axis_7 = abb_from_chain(in_degrees(state.position))
        shown = "  ".join(f"j{axis} {angle:.1f}°" for axis, angle in enumerate((*axes, axis_7), 1))
        return f"<yumi.Arm {self.side.word}, {state.mode.value}: {shown}>"

    @property
    def executor(self) -> MotionExecutor:
        """What the arm's methods are made of; raises RobotNotReady when the robot is not connected."""
        return self._executor()

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of all positions, as ROS has them."""
        return joint_names(self.side)

    @property
    def poses(self) -> Mapping[str, Joints]:
        """Positions that have a name, which :meth:`move_to` takes in their place [rad]."""
        return {name: pose(self.side) for name, pose in POSES.items()}

    @property
    def position(self) -> Joints:
        """Measured joint positions, not older than a few milliseconds [rad], (7,).

        Raises:
            RobotNotReady: the robot is not connected, or silent.
        """
        return self._snapshot().position

    @property
    def velocity(self) -> Joints:
        """Measured joint velocities [rad/s], (7,); raises as :attr:`position`."""
        return self._snapshot().velocity

    @property
    def pose(self) -> Pose:
        """Pose of the tool in the robot's base frame, from the measured joints [m], quaternion w first.

        It is exact forward kinematics, and is shown with the name of the tool; the web page shows the fingertips.
        ``robot.right.pose.moved(z=0.02)`` is 20 mm higher. Raises as :attr:`position`.
        """
        at, tool = self.position, self._tool(None)
        if isinstance(self.tool, str):
            name = self.tool
        elif tool == TOOL0:
            name = "tool0"
        else:
            name = "the tool in use" if self.tool is None else "a tool of your own"
        pose = tool0_to_body(self.side, at, tool)
        return ToolPose(pose.position, pose.orientation, name, self.side)

    @property
    def arm_angle(self) -> float:
        """How far the elbow is turned about the line from shoulder to wrist, RAPID's ``eax_a`` of a robtarget [rad]."""
        return arm_angle(self.side, self.position)

    def _tool(self, given: PoseLike | str | None) -> Pose:
        chosen = self.tool if given is None else given
        return self._tcp() if chosen is None else self._frames.tool(chosen)

    def _tool0(self, pose: PoseLike, tool: PoseLike | str | None, work_object: PoseLike | str | None) -> Pose:
        """Where tool0 is in the body frame when the tool is at a pose of a work object."""
        return compose(compose(self._frames.work_object(work_object), pose_from(pose)), inverse(self._tool(tool)))

    def inverse_kinematics(
        self,
        pose: PoseLike,
        *,
        arm_angle: float | None = None,
        tool: PoseLike | str | None = None,
        work_object: PoseLike | str | None = None,
    ) -> tuple[Joints, ...]:
        """All postures within the joints' ranges that bring the tool to a pose; takes about 0.1 s.

        Args:
            pose: of the tool: :func:`yumi.pose`, or seven numbers x, y, z [m], quaternion w, x, y, z.
            arm_angle: how far the elbow is turned [rad]; None takes the present arm angle.
            tool: the name of a tool or its frame in tool0; None takes :attr:`tool`.
            work_object: what the pose is seen from, by name or as a frame in the body; None is the body.

        Returns:
            Joint positions [rad], (7,) each, the one nearest to the present position first; none where the pose is out
            of reach with this arm angle.

        Raises:
            CommandRefused: the pose is none, or a name is not known.
            RobotNotReady: as for :attr:`position`.
        """
        tool0 = self._tool0(pose, tool, work_object)
        return postures_of(self.side, tool0, arm_angle, self.position, YUMI_LIMITS)

    def jacobian(self, position: Joints | None = None, *, tool: PoseLike | str | None = None) -> NDArray[np.float64]:
        """How the tool moves with the joints, at ``position`` [rad] or where the arm is, (6, 7).

        Rows: velocity x, y, z [m/s] and angular velocity x, y, z [rad/s] in the body frame; columns: joints in chain
        order. Raises CommandRefused where these are no seven finite numbers, and as :attr:`position`.
        """
        given = self.position if position is None else joints(numbers_from(position, JOINT_COUNT, "position"))
        return jacobian(self.side, given, self._tool(tool))

    @property
    def degrees(self) -> dict[str, float]:
        """Measured joint positions as the FlexPendant shows them, ``j1`` to ``j7`` [°]; raises as :attr:`position`."""
        axes, axis_7 = abb_from_chain(in_degrees(self.position))
        return {f"j{axis}": angle for axis, angle in enumerate((*axes, axis_7), 1)}

    @property
    def mode(self) -> ArmMode:
        """What the arm does now; raises as :attr:`state`."""
        return self.state.mode

    @property
    def state(self) -> ArmReport:
        """All that is known of the arm now: measured and planned joints, what EGM reports beside, its cycles.

        Raises:
            RobotNotReady: the robot is not connected, or EGM is not started on this arm.
        """
        executor = self.executor
        is_fault = executor.fault(self.side) is not None
        return arm_report(self.side, executor.snapshot(self.side), self._datagram(), is_fault=is_fault)

    def move_to(
        self,
        position: Position,
        *,
        wait: bool = True,
        timeout: float | None = None,
        speed_scale: float | None = None,
        acceleration: float | None = None,
    ) -> Motion:
        """Move to ``position``, all joints together; a motion under way bends into the new one without a stop.

        Args:
            position: joint positions [rad], (7,) in chain order; see :func:`yumi.degrees` and, for the FlexPendant's
                order, :func:`yumi.abb_degrees`. Or some joints by name, ``{"j1": 0.1}``; the others stay where they
                were sent last. Or the name of a pose, see :attr:`poses`.
            wait: return when the arm stands at the goal; else at once.
            timeout: an arm that takes longer than this is stopped [s]; None lets it take its time.
            speed_scale: share of the joints' highest speeds, above 0 up to 1; None takes that of ``connect``.
            acceleration: the same for accelerations and jerks.

        Returns:
            The motion; over, unless ``wait`` is False.

        Raises:
            CommandRefused: the position is impossible (length, names, NaN, range), or a share is; nothing was changed.
            RobotNotReady: not connected, EGM not running, or stopped by a fault; nothing was changed.
            GoalNotReached: the motion ended elsewhere; the arm holds.
        """
        executor = self.executor
        (motion,) = executor.move({self.side: position}, speed_scale, acceleration)
        if wait:
            wait_for((motion,), timeout, executor)
        return motion

    def follow(self, trajectory: Sequence[TimedPosition], *, wait: bool = True, timeout: float | None = None) -> Motion:
        """Follow a trajectory: splines through points that are due at times.

        ::

            robot.right.follow([(1.0, q1), (2.0, q2), (3.5, q1)])

        Between two points the way is straight if they have positions only, cubic with velocities, quintic with
        accelerations. What moves when it is called comes to rest first; a point at time 0 must be where the arm is.

        Args:
            trajectory: points ``(time, position)``, ``(time, position, velocity)`` or ``(time, position, velocity,
                acceleration)``: the time since the begin [s], then (7,) each in [rad], [rad/s] and [rad/s²]; or by
                joint name.
            wait: return when the arm stands at the last point; else at once.
            timeout: an arm that takes longer than this is stopped [s]; None lets it take its time.

        Returns:
            The motion; over, unless ``wait`` is False.

        Raises:
            CommandRefused: the trajectory is impossible: its points, their order, or more than the joints may do.
            RobotNotReady: as for :meth:`move_to`.
            GoalNotReached: the motion ended elsewhere; the arm holds.
        """
        executor = self.executor
        (motion,) = executor.follow({self.side: trajectory})
        if wait:
            wait_for((motion,), timeout, executor)
        return motion

    def stop(self) -> None:
        """Come to rest as fast as the joints may, and return when the arm stands.

        Raises:
            RobotNotReady: the robot is not connected.
            GoalNotReached: the arm did not come to rest.
        """
        executor = self.executor
        wait_for(executor.stop((self.side,)), None, executor)

    def move_to_pose(
        self,
        pose: PoseLike,
        *,
        arm_angle: float | None = None,
        configuration: Sequence[int] | None = None,
        tool: PoseLike | str | None = None,
        work_object: PoseLike | str | None = None,
        wait: bool = True,
        timeout: float | None = None,
        speed_scale: float | None = None,
        acceleration: float | None = None,
    ) -> Motion:
        """Move the tool to a pose, all joints together as :meth:`move_to`: RAPID's MoveJ. Its way is not a line.

        Args:
            pose: as for :meth:`inverse_kinematics`; so are ``tool`` and ``work_object``.
            arm_angle: how far the elbow is turned then [rad]; None keeps the present one where that is possible.
            configuration: ``(cf1, cf4, cf6, cfx)`` of a robtarget; None takes the posture that is nearest.
            tool: see ``pose``.
            work_object: see ``pose``.
            wait: return when the arm stands at the goal; else at once.
            timeout: an arm that takes longer than this is stopped [s]; None lets it take its time.
            speed_scale: share of the joints' highest speeds, above 0 up to 1; None takes that of ``connect``.
            acceleration: the same for accelerations and jerks.

        Returns:
            The motion; over, unless ``wait`` is False.

        Raises:
            Unreachable: no posture has the pose; ``nearest`` is the posture that comes nearest to it. Nothing was
                changed.
            CommandRefused: the pose is none, or a name is not known; nothing was changed.
            RobotNotReady: as for :meth:`move_to`.
            GoalNotReached: the motion ended elsewhere; the arm holds.
        """
        goal = self._posture(pose, arm_angle, configuration, tool, work_object)
        return self.move_to(goal, wait=wait, timeout=timeout, speed_scale=speed_scale, acceleration=acceleration)

    def _posture(
        self,
        pose: PoseLike,
        arm_angle: float | None = None,
        configuration: Sequence[int] | None = None,
        tool: PoseLike | str | None = None,
        work_object: PoseLike | str | None = None,
    ) -> Joints:
        now = self.executor.snapshot(self.side).sent
        return posture_for(self.side, self._tool0(pose, tool, work_object), arm_angle, configuration, now, YUMI_LIMITS)

    def move_linear(
        self,
        pose: PoseLike,
        *,
        arm_angle: float | None = None,
        tool: PoseLike | str | None = None,
        work_object: PoseLike | str | None = None,
        wait: bool = True,
        timeout: float | None = None,
        speed: float = SPEED,
        turning: float = TURNING,
        acceleration: float = 1.0,
    ) -> Motion:
        """Move the tool to a pose on a straight line, its orientation along the shortest turn: RAPID's MoveL.

        The arm comes to rest first, and at the end. Near singularities it slows down, so that no joint is too fast.

        Args:
            pose: as for :meth:`inverse_kinematics`; so are ``tool`` and ``work_object``.
            arm_angle: how far the elbow is turned at the end [rad]; it turns evenly on the way. None keeps the present
                one, and turns the elbow only where the line cannot be followed otherwise.
            tool: see ``pose``.
            work_object: see ``pose``.
            wait: return when the arm stands at the goal; else at once.
            timeout: an arm that takes longer than this is stopped [s]; None lets it take its time.
            speed: of the tool at most [m/s], up to 1.5.
            turning: of its orientation and of the elbow at most [rad/s].
            acceleration: share of the highest accelerations and jerks of joints and tool, up to 1.

        Returns:
            The motion; over, unless ``wait`` is False.

        Raises:
            Unreachable: the arm cannot follow the line; the message says from where on. Nothing has moved.
            CommandRefused: the pose is none, or a value is out of bounds; nothing has moved.
            RobotNotReady: as for :meth:`move_to`.
            GoalNotReached: the motion ended elsewhere; the arm holds.
        """
        return self.move_through(
            [pose],
            arm_angle=arm_angle,
            tool=tool,
            work_object=work_object,
            wait=wait,
            timeout=timeout,
            speed=speed,
            turning=turning,
            acceleration=acceleration,
        )

    def move_through(
        self,
        poses: Sequence[PoseLike],
        *,
        zone: float = ZONE,
        arm_angle: float | None = None,
        tool: PoseLike | str | None = None,
        work_object: PoseLike | str | None = None,
        wait: bool = True,
        timeout: float | None = None,
        speed: float = SPEED,
        turning: float = TURNING,
        acceleration: float = 1.0,
    ) -> Motion:
        """Move the tool on straight lines from pose to pose, without a stop: corners are rounded within a zone.

        Args:
            poses: in their order; all else as for :meth:`move_linear`, with the arm angle of the last.
            zone: a corner is left from so far before it to so far behind it [m], as RAPID's zones.
            arm_angle: see :meth:`move_linear`, as for all that follow.
            tool: see there.
            work_object: see there.
            wait: see there.
            timeout: see there.
            speed: see there.
            turning: see there.
            acceleration: see there.

        Returns:
            The motion; over, unless ``wait`` is False. Raises as :meth:`move_linear`.
        """
        executor = self.executor
        points = waypoints_from(self._frames, poses, work_object, arm_angle)
        path = ToolMotion(self._tool(tool), points, speed, turning, zone, acceleration)
        plan = tool_planner({self.side: path}, executor.limits, executor.tool_limits)
        (motion,) = executor.follow_path((self.side,), plan)
        if wait:
            wait_for((motion,), timeout, executor)
        return motion

    def servo_pose(
        self,
        pose: PoseLike,
        *,
        arm_angle: float | None = None,
        tool: PoseLike | str | None = None,
        work_object: PoseLike | str | None = None,
    ) -> None:
        """Follow a stream of poses of the tool, of which this is the next; returns at once.

        It may be called up to 500 times a second. The tool keeps its limits (``cartesian_controller`` in
        controllers.yaml) and those of the joints, and stays at the last pose.

        Args:
            pose: as for :meth:`inverse_kinematics`; so are ``tool`` and ``work_object``.
            arm_angle: how far the elbow is turned there [rad]; None keeps what it is.
            tool: see ``pose``.
            work_object: see ``pose``.

        Raises:
            CommandRefused: the pose is none; the arm keeps the one before.
            RobotNotReady: as for :meth:`move_to`.
        """
        target = compose(self._frames.work_object(work_object), pose_from(pose))
        angle = nan if arm_angle is None else checked_angle(arm_angle)
        frame = self._tool(tool)
        self.executor.stream_tool(self.side, lambda session: pose_goal(session, target, frame, angle))

    def servo_twist(
        self,
        linear: Sequence[float] = (0.0, 0.0, 0.0),
        angular: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        elbow: float = 0.0,
        frame: str = "base",
        tool: PoseLike | str | None = None,
    ) -> None:
        """Follow a stream of velocities of the tool, of which this is the next; returns at once.

        Without a new one for 0.1 s (``twist.timeout``) the tool stops.

        Args:
            linear: velocity x, y, z [m/s].
            angular: angular velocity about x, y, z [rad/s].
            elbow: speed of the arm angle [rad/s].
            frame: ``"base"``: seen from the robot's body; ``"tool"``: seen from the tool.
            tool: whose velocity it is: a name or a frame in tool0; None takes :attr:`tool`.

        Raises:
            CommandRefused: a value is not finite, or the frame another one; the arm keeps the velocity before.
            RobotNotReady: as for :meth:`move_to`.
        """
        if frame not in ("base", "tool"):
            raise CommandRefused(message("twist_frame_unknown", frame=frame))
        try:
            twist = joints([*linear, *angular, elbow])
        except (TypeError, ValueError) as error:
            raise CommandRefused(message("twist_malformed")) from error
        check_twist(twist)
        of = self._tool(tool)
        self.executor.stream_tool(self.side, lambda session: twist_goal(session, twist, of, is_in_tool=frame == "tool"))

    def stream(self, position: Position) -> None:
        """Follow a stream of positions, of which this is the next; returns at once.

        It may be called up to 250 times a second. The arm keeps the joints' limits on the way and stays at the last
        position; :meth:`move_to` or :meth:`stop` end the stream. A motion under way ends before the stream begins.

        Args:
            position: joint positions [rad], as for :meth:`move_to`.

        Raises:
            CommandRefused: the position is impossible; the arm keeps the one before.
            RobotNotReady: as for :meth:`move_to`.
        """
        self.executor.stream(self.side, position)

    def _snapshot(self) -> Snapshot:
        snapshot = self.executor.snapshot(self.side)
        if not snapshot.is_streaming:
            raise RobotNotReady(message("arm_sends_no_positions", arm=self.side.word))
        return snapshot


T = TypeVar("T")


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
        self._address = f"{settings.robot.address}:{settings.robot.rws_port}"
        self._is_connected = False
        self._modules = {side: settings.gripper.modules(side) for side in Side}
        self._collision = settings.collision
        self._planner: Planner | None = None  # made when the first motion is planned
        self._frames = Frames()
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
                    self._check_not_stopped,
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

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<yumi.Robot at {self._address}, {'' if self._is_connected else 'not '}connected>"

    def open(self, confirm: str = "") -> Robot:
        """Connect, switch the motors on, start EGM and calibrate grippers that need it; a notebook's ``with``.

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
        motions = executor.move(goals, speed_scale, acceleration)
        if wait:
            wait_for(motions, timeout, executor)
        return motions

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
        motions = executor.follow(trajectories)
        if wait:
            wait_for(motions, timeout, executor)
        return motions

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

        start = {side: arm.position for side, arm in ((Side.RIGHT, self.right), (Side.LEFT, self.left))}
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
        motions = executor.follow(plan.points, plan.start)
        if wait:
            wait_for(motions, timeout, executor)
        return motions

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
        arms = {Side.RIGHT: self.right, Side.LEFT: self.left}
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
        zone: float = ZONE,
        wait: bool = True,
        timeout: float | None = None,
        speed: float = SPEED,
        turning: float = TURNING,
        acceleration: float = 1.0,
    ) -> tuple[Motion, ...]:
        """Move the tools of both arms on straight lines, as one motion: they begin and end together, or none moves.

        A list of poses is a path as of :meth:`Arm.move_through`. Arguments and errors are those of
        :meth:`Arm.move_linear`, with each arm's own tool; an arm that is stopped on its way stops the other while the
        call waits for them.
        """
        arms, executor = {Side.RIGHT: self.right, Side.LEFT: self.left}, self.executor
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
        motions = executor.follow_path(tuple(paths), tool_planner(paths, executor.limits, executor.tool_limits))
        if wait:
            wait_for(motions, timeout, executor)
        return motions

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
        log.info("%s", manager.allow_collision(part, other, float(seconds)))

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
        wait_for(executor.stop(executor.arms), None, executor)

    def recover(self, confirm: str = "") -> None:
        """Bring the robot back to where it may move, after an emergency stop, a lost connection, or any other fault.

        Nothing moves by itself: the arms hold where they are until they get their next goal. After an emergency stop, a
        guard stop or a collision a person has to look at the robot first and confirm that stop::

            try:
                robot.recover()
            except yumi.errors.StopNotConfirmed as error:
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
        log.info(self._connected.manager.speed.set(value))

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

    def _check_not_stopped(self) -> None:
        self._connected.manager.check_not_stopped()

    def _calibrate(self, side: Side) -> None:
        self._connected.calibrate(side)

    def _datagram(self, side: Side) -> bytes:
        return self._connected.datagram(side)

    def _gripper(self, side: Side) -> driver.Gripper:
        return self._connected.grippers[side]

    @property
    def _connected(self) -> Connection:
        if not self._is_connected:
            raise RobotNotReady(message("script_not_connected"))
        return self._connection


def _named(right: T | None, left: T | None) -> dict[Side, T]:
    """What was given for each arm."""
    given = {side: value for side, value in ((Side.RIGHT, right), (Side.LEFT, left)) if value is not None}
    if not given:
        raise CommandRefused(message("no_arm_has_goal"))
    return given
