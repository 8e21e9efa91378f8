"""Streams of positions, speeds and tool motions that arms follow, and jogs, which are streams of a person."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping, Sequence
from contextlib import suppress
from math import inf, isfinite, nan
from threading import Lock
from typing import Any, NamedTuple, SupportsFloat

from abb_protocols.catalogue import message, quoted
from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.robot.description import FINGERTIPS
from abb_protocols.robot.joints import JOINT_COUNT, ZERO_JOINTS, Joints, Pose, Side, joints
from abb_runtime.clock import Clock
from yumi.api.arm_access import ArmAccess
from yumi.api.joint_positions import Position, checked_goal
from yumi.api.motion_registry import MotionRegistry
from yumi.control.controller import CONTROLLER_IDLE_TIME
from yumi.control.goals import (
    CONFIGURED_DELAY,
    NEWEST_POINT,
    OLDEST_POINT,
    UNKNOWN_JOINTS,
    Buffer,
    write_goal,
    write_speeds,
)
from yumi.control.hand_over import Commander, is_person_requesting, requested_by
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.motion.setpoint import largest_difference
from yumi.control.motion.stream_begin import FARTHEST_STREAM_BEGIN, StreamBegin
from yumi.control.shared_state import SharedDeadline
from yumi.control.tool_goal import ToolGoal, check_tool_near, check_twist, pose_goal, twist_goal
from yumi.control.trajectory_commands import CancelTrajectory
from yumi.driver.control_process import ControlProcess
from yumi.driver.controller_names import CARTESIAN_CONTROLLER, JOG_CONTROLLER, STREAM_CONTROLLER
from yumi.driver.teleoperated_arm import DEVICE_LINK_LOST, JointsGoal, MotionGoal, PoseGoal, TeleoperationFollower

_LONGEST_BLEND = 10.0
"""So long may it take until a stream that begins elsewhere is followed as it is [s]."""

OLDEST_JOG = 0.1
"""A jog that was asked for longer ago than this moves nothing [s]: so long do controllers take a velocity for new."""

_JOG_GAP = 0.3  # [s] jogs that follow each other within this time belong to one press of a key


class _Jog(NamedTuple):
    """The last jog of an arm.

    Attributes:
        controller: that carries it out.
        time: when it was asked for [s].
        number: of its message in the buffer.
        buffer: of the controller.
        write: writes a message for an EGM session, which was asked for at a time [s].
        owner: who asked for it; None once it was ended.
    """

    controller: str
    time: float
    number: int
    buffer: Buffer[Any]
    write: Callable[[int, Joints, float], None]
    owner: object


class _Begun(NamedTuple):
    """How a stream of positions began.

    Attributes:
        time: when its first point was for, or was taken, if that was later [s].
        blend: from where the arm was sent then.
        client: whose stream it is.
    """

    time: float
    blend: StreamBegin
    client: Hashable


class ArmStreams(ArmAccess):
    """Arms that follow streams."""

    def __init__(self, control: ControlProcess, motions: MotionRegistry, arms: tuple[Side, ...], clock: Clock) -> None:
        super().__init__(control, motions, arms, clock)
        self._jogs: dict[Side, _Jog] = {}
        self._begun: dict[Side, _Begun] = {}
        self._followed: dict[Side, int] = {}  # the number of the last message of an arm that follows a device
        self._jog_locks = {side: Lock() for side in Side}  # held briefly: the end of a jog waits for it

    def stream(
        self,
        goals: Mapping[Side, Position],
        velocities: Mapping[Side, Sequence[SupportsFloat]] | None = None,
        time: SupportsFloat | None = None,
        delay: float = CONFIGURED_DELAY,
        blend: SupportsFloat | None = None,
    ) -> bool:
        """Have arms follow a stream of positions, of which these are the next point; all of them, or none.

        A stream begins near where the arms are sent. One that begins elsewhere needs ``blend``. What comes more than
        :data:`.IDLE` after the last point begins a stream, too.

        Args:
            goals: positions [rad], (7,), of each arm.
            velocities: those of the stream then [rad/s], (7,); an arm that is left out has them estimated.
            time: when the point is for, by the driver's clock [s]; None: now.
            delay: as :func:`yumi.control.goals.stream_delay` has it.
            blend: so long it takes until the arms follow the stream as it is, without a step [s].

        Returns:
            Whether controllers were switched for it.

        Raises:
            CommandRefused: the point is impossible, a stream would begin too far away, or another client commands an
                arm; the arms keep the point before.
            RobotNotReady: an arm does not follow.
            GoalNotReached: an arm that moved did not come to rest.
        """
        velocities = velocities or {}
        positions = {side: checked_goal(side, goal, self.snapshot(side).sent) for side, goal in goals.items()}
        for side in velocities:
            if side not in goals:
                raise CommandRefused(message("stream_velocity_without_position", arm=side.word))
        speeds = {
            side: _checked_velocity(side, velocities[side]) if side in velocities else UNKNOWN_JOINTS for side in goals
        }
        self._check_time(time)
        duration = _checked_blend(blend)
        begins = [side for side in goals if not self._is_streamed(side)]
        for side in begins:
            self.check_follows(side)
            self.control.hand_over.check(side, Commander.STREAM)
            distance = largest_difference(positions[side], self.snapshot(side).sent)
            if duration is None and distance > FARTHEST_STREAM_BEGIN:
                raise CommandRefused(
                    message("stream_begins_elsewhere", arm=side.word, distance=distance, most=FARTHEST_STREAM_BEGIN)
                )
        begun = self._begin_streams(tuple(goals), STREAM_CONTROLLER)
        now = self.clock.now()  # not before: to take an arm over may last seconds
        stamp = now if time is None else float(time)
        with self.control.hand_over.writing(goals, Commander.STREAM):
            for side, (_, is_new) in begun.items():
                if is_new or side in begins:
                    blended = StreamBegin(self.control.snapshot(side).sent, positions[side], duration or 0.0)
                    self._begun[side] = _Begun(max(now, stamp), blended, self.control.hand_over.of(side).client)
            for side, position in positions.items():
                begin = self._begun[side]
                point, speed = begin.blend.at(position, stamp - begin.time, speeds[side])
                write_goal(self.control.buffers[side].goals, begun[side][0], point, speed, stamp, delay)
        return any(is_new for _, is_new in begun.values())

    def _is_streamed(self, side: Side) -> bool:
        """Whether an arm follows a stream of who asks, which is not over."""
        snapshot = self.snapshot(side)
        known = (STREAM_CONTROLLER, snapshot.session, snapshot.activation)
        return self.streaming.get(side) == known and self.control.hand_over.is_own(side)

    def _check_time(self, time: SupportsFloat | None) -> None:
        if time is None:
            return
        try:
            away = float(time) - self.clock.now()
        except (TypeError, ValueError):
            away = nan
        if not isfinite(away):
            raise CommandRefused(message("stream_time_malformed", given=quoted(time)))
        if not -OLDEST_POINT <= away <= NEWEST_POINT:
            raise CommandRefused(message("stream_time_far", away=away, oldest=-OLDEST_POINT, newest=NEWEST_POINT))

    def end_stream(self, side: Side, owner: Hashable) -> None:
        """Have an arm brake and hold that follows the stream of ``owner``; what another one commands is left alone."""
        snapshot, begun = self.control.snapshot(side), self._begun.get(side)
        is_known = self.streaming.get(side) == (STREAM_CONTROLLER, snapshot.session, snapshot.activation)
        if begun is None or begun.client != owner or not is_known:
            return
        with requested_by(client=owner):
            self.stop_own((side,))
            self.control.hand_over.let_go(side)

    def jog(self, side: Side, speeds: Sequence[float], owner: object, time: float | None = None) -> bool:
        """Have an arm move with joint speeds [rad/s], (7,), until its controller's timeout or :meth:`end_jog`.

        The first call only takes the arm over, which may last seconds; the next one moves it, if it still comes. Until
        the jogs of one ``owner`` end, or have not come for 0.3 s, those of another one are refused.

        Args:
            side: the arm.
            speeds: of its joints.
            owner: who jogs.
            time: when it was asked for, by the driver's clock [s]; None: now.

        Returns:
            Whether its controllers were switched for it.

        Raises:
            CommandRefused: the speeds are no seven finite numbers, they were asked for too long ago, or another owner
                or motion moves the arm.
            RobotNotReady: the arm does not follow.
        """
        if len(speeds) != JOINT_COUNT or not all(map(isfinite, speeds)):
            raise CommandRefused(message("jog_speeds_malformed", count=JOINT_COUNT, given=str(list(speeds)[:8])))
        buffer = self.control.buffers[side].speeds

        def write(session: int, values: Joints, asked: float) -> None:
            write_speeds(buffer, session, values, asked)

        return self._jog(side, JOG_CONTROLLER, buffer, write, joints(speeds), owner, time)

    def jog_tool(
        self,
        side: Side,
        twist: Sequence[float],
        tool: Pose,
        owner: object,
        time: float | None = None,
        *,
        is_in_tool: bool,
    ) -> bool:
        """Have a tool move with a velocity until its controller's timeout or :meth:`end_jog`, as :meth:`jog`.

        Args:
            side: the arm.
            twist: velocity [m/s], angular velocity and that of the arm angle [rad/s], (7,).
            tool: its frame in tool0.
            owner: who jogs.
            time: as of :meth:`jog`.
            is_in_tool: whether it is seen from the tool, else from the body.
        """
        if len(twist) != JOINT_COUNT:
            raise CommandRefused(message("jog_twist_malformed", count=JOINT_COUNT, given=str(list(twist)[:8])))
        check_twist(twist)
        buffer = self.control.buffers[side].tool_goals

        def write(session: int, values: Joints, asked: float) -> None:
            buffer.write(twist_goal(session, values, tool, is_in_tool=is_in_tool, time=asked))

        return self._jog(side, CARTESIAN_CONTROLLER, buffer, write, joints(twist), owner, time)

    def _jog(
        self,
        side: Side,
        controller: str,
        buffer: Buffer[Any],
        write: Callable[[int, Joints, float], None],
        values: Joints,
        owner: object,
        time: float | None,
    ) -> bool:
        self.check_jog_recent(values, time)
        self._check_owner(side, owner)
        stream = self.streaming.get(side)
        session, is_new = self._begin_stream(side, controller, is_jog=True)  # may last seconds, so without the lock
        with self._jog_locks[side]:
            self._check_owner(side, owner)
            last = self._jogs.get(side)
            is_first = is_new or last is None or last.controller != controller
            if last is not None and not is_first:
                if _number(buffer) != last.number:  # a ROS topic: two streams must not alternate
                    self.forget_stream(side, stream)
                    raise CommandRefused(message("jog_streamed_by_another", controller=controller, arm=side.word))
                with self.control.hand_over.writing((side,), Commander.STREAM, _JOG_GAP):
                    self.check_jog_recent(values, time)  # until here it may have waited
                    now = self.clock.now()
                    write(session, values, now if time is None or values == ZERO_JOINTS else min(time, now))
            self._jogs[side] = _Jog(controller, self.clock.now(), _number(buffer), buffer, write, owner)
        return is_first

    def check_jog_recent(self, values: Sequence[float], time: float | None) -> None:
        """Refuse a jog that was asked for too long ago; that the arm stands is never asked for too late.

        Args:
            values: the speeds, or the velocity of the tool, (7,).
            time: as of :meth:`jog`.

        Raises:
            CommandRefused: it is too old.
        """
        age = 0.0 if time is None or tuple(values) == ZERO_JOINTS else self.clock.now() - time
        if not age <= OLDEST_JOG:  # NaN too
            raise CommandRefused(message("jog_too_old", age=age, oldest=OLDEST_JOG))

    def _check_owner(self, side: Side, owner: object) -> None:
        if is_person_requesting():  # a person takes an arm from a program that jogs it
            self.control.hand_over.check(side, Commander.STREAM)
            return
        last = self._jogs.get(side)
        if last is None or last.owner in (None, owner) or self.clock.now() - last.time >= _JOG_GAP:
            return
        raise CommandRefused(message("jogged_by_another", arm=side.word))

    def end_jog(self, side: Side, owner: object) -> None:
        """Have an arm stop that ``owner`` jogged last; one that something else commands meanwhile is left alone."""
        with self._jog_locks[side]:
            last = self._jogs.get(side)
            if last is None or last.owner is not owner:
                return
            last = self._jogs[side] = last._replace(owner=None)
            with requested_by(client=owner):
                # A person's next press of a key may follow at once: the arm is let go when none has.
                if not self.control.hand_over.of(side).who.is_person:
                    self.control.hand_over.let_go(side)
            snapshot, known = self.control.snapshot(side), self.streaming.get(side)
            is_commanding = known == (last.controller, snapshot.session, snapshot.activation)
            if is_commanding and _number(last.buffer) == last.number:
                if last.controller == CARTESIAN_CONTROLLER:
                    with suppress(RobotNotReady):  # then a velocity of zero ends the stream
                        self._end_tool_stream(side, snapshot.activation)
                        return
                last.write(snapshot.session, ZERO_JOINTS, self.clock.now())
                self._jogs[side] = last._replace(number=_number(last.buffer))

    def _end_tool_stream(self, side: Side, activation: int) -> None:
        """End a tool's stream of an activation by joints: along its line it takes longer, and braking begins anew."""
        stop = ControllerCommand(side, CARTESIAN_CONTROLLER, CancelTrajectory(), activation)
        with suppress(CommandRefused):  # who has taken the arm over meanwhile goes on
            self.control.call(Commands.send_commands, stop)

    def _begin_stream(
        self, side: Side, controller: str, *, is_jog: bool = False, kind: Commander = Commander.STREAM
    ) -> tuple[int, bool]:
        """The session of an arm that ``controller`` commands, taken over from standstill; whether it is newly so."""
        return self._begin_streams((side,), controller, is_jog=is_jog, kind=kind)[side]

    def _begin_streams(
        self, sides: Sequence[Side], controller: str, *, is_jog: bool = False, kind: Commander = Commander.STREAM
    ) -> dict[Side, tuple[int, bool]]:
        """As :meth:`_begin_stream`; all arms can be taken over, or none is."""
        hand_over, known, new = self.control.hand_over, dict[Side, tuple[str, int, int]](), set[Side]()
        for side in sides:
            snapshot = self.snapshot(side)
            known[side] = (controller, snapshot.session, snapshot.activation)
            if is_jog and self.motions.is_open(side) and not hand_over.is_foreign(side):
                self.check_follows(side)
                raise _other_motion(side)
            if self.streaming.get(side) != known[side] or not snapshot.is_commanded:
                if controller == CARTESIAN_CONTROLLER:
                    self.check_has(side, controller)
                self.check_follows(side)
                new.add(side)
        lasts = _JOG_GAP if is_jog else CONTROLLER_IDLE_TIME if kind is Commander.STREAM else DEVICE_LINK_LOST
        last = {side: self.streaming.get(side, ("", 0, 0)) for side in sides}
        handed_over = hand_over.take_all(sides, kind, lasts)
        for side in handed_over:
            self.forget_stream(side, last[side])  # one that cannot be switched now begins anew later
        switched = [side for side in sides if side in new or side in handed_over]
        for side in switched if is_jog else ():
            self._check_jog_begins(side, known[side], last[side], is_handed_over=side in handed_over)
        self.take_over(switched, controller, anew=handed_over)
        with hand_over.switching(switched):  # who has taken an arm since then has a stream of it
            for side in switched:
                snapshot = self.control.snapshot(side)
                known[side] = self.streaming[side] = (controller, snapshot.session, snapshot.activation)
        return {side: (known[side][1], side in switched) for side in sides}

    def _check_jog_begins(
        self, side: Side, known: tuple[str, int, int], last: tuple[str, int, int], *, is_handed_over: bool
    ) -> None:
        """See that a jog interrupts nothing else of who jogs; ``last`` is the stream that the arm followed last."""
        jog = self._jogs.get(side)
        is_recent = jog is not None and self.clock.now() - jog.time < _JOG_GAP
        if jog is not None and is_recent and last[0] == jog.controller and last[1:] != known[1:]:
            self.forget_stream(side, last)  # the next press of a key may take the arm back
            raise CommandRefused(message("jog_switched_by_another", arm=side.word))
        is_jogged = last[0] in (JOG_CONTROLLER, CARTESIAN_CONTROLLER) and last[1:] == known[1:]
        if not is_jogged and not is_handed_over and self.is_moving(side):
            raise _other_motion(side)

    def stream_tool(self, side: Side, goal: Callable[[int], ToolGoal]) -> None:
        """Have an arm's tool follow a stream, of which ``goal`` of the EGM session is the next message.

        Raises:
            CommandRefused: the driver has no Cartesian controller, or a pose is too far away at which the stream would
                go on after a person or another client has led the arm.
            RobotNotReady: the arm does not follow.
            GoalNotReached: an arm that moved did not come to rest.
        """
        snapshot, hand_over = self.snapshot(side), self.control.hand_over
        hand_over.check(side, Commander.STREAM)
        if not hand_over.is_own(side) and hand_over.was_of_another(side):
            self.check_follows(side)  # else where it was sent is of before
            check_tool_near(side, snapshot.sent, goal(snapshot.session))
        session, _ = self._begin_stream(side, CARTESIAN_CONTROLLER)
        with self.control.hand_over.writing((side,), Commander.STREAM):
            self.control.buffers[side].tool_goals.write(goal(session))

    # ---- devices of people

    def begin_following(self, side: Side, follower: TeleoperationFollower) -> None:
        """Have an arm follow the goals of a device, from standstill, which may last seconds.

        Args:
            side: the arm.
            follower: what of it follows.

        Raises:
            CommandRefused: the driver has no such controller.
            RobotNotReady: the arm does not follow.
            GoalNotReached: an arm that moved did not come to rest.
        """
        controller = CARTESIAN_CONTROLLER if follower is TeleoperationFollower.TOOL else STREAM_CONTROLLER
        self._begin_stream(side, controller, kind=Commander.DEVICE)
        self._followed[side] = _number(self._stream_of(side)[1])

    def follow_device(self, side: Side, goal: MotionGoal, time: float, until: float) -> None:
        """Give an arm that follows a device the next goal; it was made at ``time`` [s].

        The control process has the arm come to rest when no next one has come ``until`` then [s].
        """
        (_, session, activation), buffer = self._stream_of(side)
        if isinstance(goal, JointsGoal):
            write_goal(buffer, session, goal.position, time=time)
        else:
            if isinstance(goal, PoseGoal):
                desired = pose_goal(session, goal.pose, FINGERTIPS, goal.angle, time)
            else:
                desired = twist_goal(session, goal.twist, FINGERTIPS, is_in_tool=goal.is_in_tool, time=time)
            buffer.write(desired._replace(speed=goal.speed, turning=goal.turning))
        self._followed[side] = _number(buffer)
        self.control.buffers[side].deadline.write(
            SharedDeadline(until - DEVICE_LINK_LOST, DEVICE_LINK_LOST, activation)
        )

    def is_following(self, side: Side) -> bool:
        """Whether an arm follows the goals of its device, and nothing else has given it any."""
        snapshot, (stream, buffer) = self.control.snapshot(side), self._stream_of(side)
        return (
            stream == (stream[0], snapshot.session, snapshot.activation)
            and snapshot.is_running
            and snapshot.is_commanded
            and self.motions.fault(side) is None
            and _number(buffer) == self._followed.get(side)
        )

    def end_following(self, side: Side) -> None:
        """Have an arm brake and hold that follows a device; one that something else commands is left alone."""
        (controller, _, activation), _ = self._stream_of(side)
        if not self.is_following(side):
            return
        if controller == CARTESIAN_CONTROLLER:
            self._end_tool_stream(side, activation)
            self.control.buffers[side].deadline.write(SharedDeadline(self.clock.now(), inf, activation))
        else:
            self.stop_own((side,))

    def _stream_of(self, side: Side) -> tuple[tuple[str, int, int], Buffer[Any]]:
        """The stream of an arm, and where its messages go."""
        stream, buffers = self.streaming.get(side, ("", 0, 0)), self.control.buffers[side]
        return stream, buffers.tool_goals if stream[0] == CARTESIAN_CONTROLLER else buffers.goals


def _checked_blend(blend: SupportsFloat | None) -> float | None:
    try:
        duration = None if blend is None else float(blend)
    except (TypeError, ValueError):
        duration = nan
    if duration is not None and not 0.0 < duration <= _LONGEST_BLEND:
        raise CommandRefused(message("blend_out_of_range", given=quoted(blend), longest=_LONGEST_BLEND))
    return duration


def _checked_velocity(side: Side, velocity: Sequence[SupportsFloat]) -> Joints:
    try:
        values = joints([float(value) for value in velocity])
    except (TypeError, ValueError) as error:
        raise CommandRefused(message("stream_velocity_malformed", arm=side.word, count=JOINT_COUNT)) from error
    if not all(map(isfinite, values)):
        raise CommandRefused(message("stream_velocity_malformed", arm=side.word, count=JOINT_COUNT))
    return values


def _number(buffer: Buffer[Any]) -> int:
    newest = buffer.read()
    return newest[0] if newest else 0


def _other_motion(side: Side) -> CommandRefused:
    return CommandRefused(message("jog_while_moving", arm=side.word))
