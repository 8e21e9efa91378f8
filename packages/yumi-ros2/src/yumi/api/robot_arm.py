"""One arm as a script sees it: where it is, and its motions in joints and of its tool."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import nan
from typing import SupportsFloat

import numpy as np
from numpy.typing import NDArray

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.robot.inverse_kinematics import arm_angle, jacobian
from abb_protocols.robot.joints import (
    JOINT_COUNT,
    POSES,
    YUMI_LIMITS,
    Joints,
    Pose,
    Side,
    abb_from_chain,
    joint_names,
    joints,
)
from abb_protocols.robot.kinematics import compose_poses, inverse_pose, tool0_to_body
from yumi.api.gripper import Gripper
from yumi.api.joint_positions import Position, TimedPosition, in_degrees
from yumi.api.motion_executor import MotionExecutor
from yumi.api.motion_registry import Motion
from yumi.api.poses import TOOL0, PoseFrames, PoseLike, ToolPose, checked_angle, numbers_from, pose_from, waypoints_from
from yumi.api.postures import posture_for, postures_of
from yumi.control.goals import GoalTracking, stream_delay
from yumi.control.shared_state import Snapshot
from yumi.control.tool_goal import check_twist, pose_goal, twist_goal
from yumi.driver.reports import ArmMode, ArmReport, arm_report
from yumi.planning.tool_path import TOOL_SPEED, TOOL_TURNING, TOOL_ZONE, ToolMotion


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
        frames: PoseFrames | None = None,
        tcp: Callable[[], Pose] = lambda: TOOL0,
    ) -> None:
        self.side = side
        self.gripper = gripper
        self.tool: PoseLike | str | None = None
        self._frames = frames or PoseFrames()
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
        return compose_poses(
            compose_poses(self._frames.work_object(work_object), pose_from(pose)), inverse_pose(self._tool(tool))
        )

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
        return arm_report(
            self.side,
            executor.snapshot(self.side),
            self._datagram(),
            executor.control.hand_over.of(self.side),
            is_fault=is_fault,
        )

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
        motions = executor.move({self.side: position}, speed_scale, acceleration)
        return executor.awaited(motions, wait=wait, timeout=timeout)[0]

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
        return executor.awaited(executor.follow({self.side: trajectory}), wait=wait, timeout=timeout)[0]

    def stop(self) -> None:
        """Come to rest as fast as the joints may, and return when the arm stands.

        Raises:
            RobotNotReady: the robot is not connected.
            GoalNotReached: the arm did not come to rest.
        """
        executor = self.executor
        executor.awaited(executor.stop((self.side,)))

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
        speed: float = TOOL_SPEED,
        turning: float = TOOL_TURNING,
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
        zone: float = TOOL_ZONE,
        arm_angle: float | None = None,
        tool: PoseLike | str | None = None,
        work_object: PoseLike | str | None = None,
        wait: bool = True,
        timeout: float | None = None,
        speed: float = TOOL_SPEED,
        turning: float = TOOL_TURNING,
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
        motion = ToolMotion(self._tool(tool), points, speed, turning, zone, acceleration)
        return executor.awaited(executor.follow_path({self.side: motion}), wait=wait, timeout=timeout)[0]

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
        controllers.yaml) and those of the joints, and stays at the last pose, or where something holds it back.

        Args:
            pose: as for :meth:`inverse_kinematics`; so are ``tool`` and ``work_object``.
            arm_angle: how far the elbow is turned there [rad]; None keeps what it is.
            tool: see ``pose``.
            work_object: see ``pose``.

        Raises:
            CommandRefused: the pose is none; the arm keeps the one before.
            RobotNotReady: as for :meth:`move_to`.
        """
        target = compose_poses(self._frames.work_object(work_object), pose_from(pose))
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
        of, now = self._tool(tool), self.executor.clock.now
        self.executor.stream_tool(
            self.side, lambda session: twist_goal(session, twist, of, is_in_tool=frame == "tool", time=now())
        )

    def stream(
        self,
        position: Position,
        *,
        velocity: Sequence[SupportsFloat] | None = None,
        time: SupportsFloat | None = None,
        tracking: GoalTracking = "feed_forward",
        delay: float | None = None,
        blend: SupportsFloat | None = None,
    ) -> None:
        """Follow a stream of positions, of which this is the next point; returns at once.

        It is called 10 to 500 times a second. The arm follows one period of the stream and 26 ms late, within the
        joints' limits. Where no point comes, it goes on for three periods of the stream, 0.25 s at most, then brakes
        and holds; a stream that had come to rest has the arm at its last point. A point that comes more than a second
        after the last one begins a stream, too. :meth:`move_to` or :meth:`stop` end the stream. A motion under way ends
        before it begins.

        Args:
            position: joint positions [rad], as for :meth:`move_to`.
            velocity: of the stream at this point [rad/s], (7,); None has it estimated from the points.
            time: when the point is for, by ``time.monotonic()`` of the driver's machine [s]: from 5 s ago to 1 s
                ahead; None is the moment of the call.
            tracking: ``"feed_forward"``, or ``"gains"``: each point is gone to by the controller's gains, some 0.2 s
                late and without regard to ``time``.
            delay: how far the arm is behind the times of the points [s], 0 to 1; less than a period and 26 ms predicts,
                which follows sooner and amplifies noise, more lets points arrive later. None is that sum.
            blend: a stream that begins more than 0.1 rad from where the arm is sent is followed as it is after this
                time [s], above 0 to 10; without it such a stream is refused.

        Raises:
            CommandRefused: the position or another argument is impossible, the stream begins elsewhere, or another
                client commands the arm; the arm keeps the point before.
            RobotNotReady: as for :meth:`move_to`.
        """
        velocities = {} if velocity is None else {self.side: velocity}
        self.executor.stream({self.side: position}, velocities, time, stream_delay(tracking, delay), blend)

    def _snapshot(self) -> Snapshot:
        snapshot = self.executor.snapshot(self.side)
        if not snapshot.is_streaming:
            raise RobotNotReady(message("arm_sends_no_positions", arm=self.side.word))
        return snapshot
