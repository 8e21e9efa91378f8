"""Actions that move tools on straight lines: MoveLinear of one arm, and MoveBothLinear of both as one motion.

``…/move_linear`` is on the node of each Cartesian controller, ``dual_arm_cartesian_controller/move_linear`` on one of
both. The tool is the one in use, or what ``tool_frame`` names; poses are in frames as those of
:mod:`yumi.ros.tool_topics`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from math import inf
from threading import Event as Flag
from threading import Lock
from time import monotonic
from typing import Any

from geometry_msgs.msg import PoseStamped
from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from yumi_interfaces.action import MoveBothLinear, MoveLinear

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, RobotNotReady, YumiError
from abb_protocols.robot.joints import Joints, Pose, Side
from abb_protocols.robot.kinematics import tool0_to_body
from abb_runtime.clock import SystemClock
from yumi.control.hand_over import Commander
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.loop_events import ControlProcessEnded, ReportsDropped
from yumi.control.shared_state import Snapshot
from yumi.control.trajectory_commands import (
    ArmPlan,
    CancelTrajectory,
    FollowTrajectory,
    TrajectoryEnded,
    TrajectoryOutcome,
)
from yumi.driver.control_process import PROCESS_ENDED, ControlProcess
from yumi.driver.controller_names import CARTESIAN_CONTROLLER
from yumi.planning.common_time import ended_together, started_together
from yumi.ros.frames import RobotFrames
from yumi.ros.messages import fill_pose, say_why
from yumi.ros.nodes import is_cancelled
from yumi.ros.tool_topics import LineGoal, TargetPoseTopic, line_numbers, target_refused

_FEEDBACK_PERIOD = 0.1  # [s]
_STANDS_FOR = 0.02  # [s] an arm whose command does not change for so long stands
_LAST_STOP = 5.0  # [s] an arm has come to rest by then; it takes a tenth of it

_REPORTED_WITHIN = 1.0  # [s] the end of a line is reported by then, if at all


class _Line:
    """A goal of the action that has not ended.

    Attributes:
        number: of its motion.
        is_over: set when it has ended, or must.
        is_cancelled: whether its client wants no more of it.
        ends: how the controllers ended it, as far as they have.
        reason: why it has ended, where they have not reported it.
        sides: the arms that follow it.
        tools: what is moved, in tool0, where that is not the tool in use.
    """

    def __init__(self) -> None:
        self.number = next(line_numbers)
        self.is_over = Flag()
        self.is_cancelled = False
        self.ends: dict[Side, TrajectoryEnded] = {}
        self.reason = message("line_ended_unloaded")
        self.sides: frozenset[Side] = frozenset()
        self.tools: Mapping[Side, Pose] = {}


class _Cancelled(Exception):
    """The client has cancelled the goal before anything moved."""


class LineAction(ABC):
    """Serves an action that moves tools on straight lines.

    A goal that cannot be met is not rejected, since a rejection has no text: it is aborted at once, with the reason. A
    newer goal takes the place of one that is under way. Tools of both arms begin and end together; where one ends
    elsewhere, the other one stops.

    Args:
        node: where it is.
        name: of the action.
        control: the control process.
        now: the time of its clock [s].
        targets: plan the lines of each arm; may change.
        frames: of the robot.
        base: the name of its base on ``/tf``.
    """

    type: Any

    def __init__(
        self,
        node: Any,
        name: str,
        control: ControlProcess,
        now: Callable[[], float],
        targets: Mapping[Side, TargetPoseTopic],
        frames: RobotFrames,
        base: str,
    ) -> None:
        self._targets, self._frames, self._base = targets, frames, base
        self._control, self._now = control, now
        self._ros_clock, self._log = node.get_clock(), node.get_logger()
        self._lock = Lock()
        self._open: dict[Any, _Line] = {}  # by the goal's id
        self._server = ActionServer(
            node,
            self.type,
            name,
            execute_callback=self._execute,
            cancel_callback=self._cancel,
            callback_group=ReentrantCallbackGroup(),
        )

    @abstractmethod
    def _goals(self, request: Any) -> Mapping[Side, LineGoal]:
        """What each arm does; raises CommandRefused."""

    @abstractmethod
    def _fill(self, message: Any, line: _Line) -> None:
        """Put the tools' poses into a result or feedback."""

    def _tool(self, side: Side, frame: str) -> Pose | None:
        """The frame that a goal names in tool0; None for the tool in use. Raises CommandRefused."""
        try:
            return self._frames.tool(side, frame) if frame else None
        except CommandRefused as error:
            raise target_refused(error.said) from error

    def on_arm_event(self, side: Side, event: object) -> bool:
        """An event of an arm's controller; whether it was about a goal of the action."""
        with self._lock:
            if isinstance(event, ControlProcessEnded | ReportsDropped):
                for line in self._open.values():
                    if line.sides:  # else what it asks for is refused, with the reason
                        line.reason = PROCESS_ENDED if isinstance(event, ControlProcessEnded) else event.said
                        line.is_over.set()
            if not isinstance(event, TrajectoryEnded):
                return False
            for line in self._open.values():
                if line.number == event.goal:
                    line.ends[side] = event
                    if line.sides <= set(line.ends) or event.outcome is not TrajectoryOutcome.SUCCEEDED:
                        line.is_over.set()
                    return True
        return False

    def destroy(self) -> None:
        """End; goals that are open are aborted."""
        self.end_open_goals()
        self._server.destroy()

    def end_open_goals(self) -> None:
        """No controller will report their end any more."""
        with self._lock:
            for line in self._open.values():
                line.is_over.set()

    def _cancel(self, handle: Any) -> Any:
        line = self._line(handle)  # also of a goal that was accepted and is not executed yet
        line.is_cancelled = True
        self._stop(line)
        return CancelResponse.ACCEPT

    def _line(self, handle: Any) -> _Line:
        with self._lock:
            return self._open.setdefault(bytes(handle.goal_id.uuid), _Line())

    def _stop(self, line: _Line) -> None:
        """Have its arms come to rest; arms that have another goal meanwhile go on with that."""
        for side in line.sides:
            try:
                self._targets[side].command(CancelTrajectory(line.number))
            except (YumiError, KeyError) as error:  # it ends as the arm does
                self._log.info(f"The line of the {side.word} arm could not be cancelled: {error}")

    def _execute(self, handle: Any) -> Any:
        line = self._line(handle)
        result = self.type.Result()
        try:
            with ExitStack() as turns:
                plans, epochs = self._begin(handle, line, turns)
            while not line.is_over.wait(_FEEDBACK_PERIOD):
                if any(self._control.snapshot(side).command_epoch != epoch for side, epoch in epochs.items()):
                    self._end_unreported(line, epochs)
                self._report(handle, line, max(plan.spline.end for plan in plans.values()))
            self._finish(handle, line, result)
        except _Cancelled:
            result.message = "Cancelled before the arm moved."
            self._end_cancelled(handle)
        except YumiError as error:
            say_why(result, error)
            self._log.warning(result.message)
            handle.abort()
        finally:
            with self._lock:
                del self._open[bytes(handle.goal_id.uuid)]
        self._fill(result, line)
        return result

    def _begin(
        self, handle: Any, line: _Line, turns: ExitStack
    ) -> tuple[Mapping[Side, ArmPlan], Mapping[Side, tuple[int, int]]]:
        """Plan a goal from where the arms come to rest, and have it followed; with their session and activation."""
        goals = self._goals(handle.request)
        for goal in goals.values():
            goal.check()
        line.tools = {side: goal.tool for side, goal in goals.items() if goal.tool is not None}
        try:
            targets = {side: self._targets[side] for side in sorted(goals, key=lambda side: side.value)}
        except KeyError as error:
            reason = message("controller_not_loaded", arm=error.args[0].word, controller=CARTESIAN_CONTROLLER)
            raise target_refused(reason) from error
        # Its turn and planning take a while: a stop meanwhile drops the goal, also where the arms follow again.
        snapshots = {side: target.check() for side, target in targets.items()}
        for target in targets.values():
            turns.enter_context(target.turn)
        if line.is_cancelled:  # while it waited for its turn
            raise _Cancelled
        self._bring_to_rest(line, targets, snapshots)
        plans = ended_together({side: target.plan(goals[side]) for side, target in targets.items()})
        if line.is_cancelled:
            raise _Cancelled
        plans = started_together(plans, self._now())
        line.sides = frozenset(targets)
        self._control.call(
            Commands.send_commands,
            *(
                ControllerCommand(
                    side, target.controller, FollowTrajectory(plans[side], line.number), snapshots[side].activation
                )
                for side, target in targets.items()
            ),
        )
        if line.is_cancelled:  # between the two
            self._stop(line)
        return plans, {side: snapshot.command_epoch for side, snapshot in snapshots.items()}

    def _bring_to_rest(
        self, line: _Line, targets: Mapping[Side, TargetPoseTopic], snapshots: Mapping[Side, Snapshot]
    ) -> None:
        """Raises CommandRefused where an arm goes on moving, or is commanded by another client."""

        def commanded() -> Mapping[Side, Joints]:
            return {side: target.commanded() for side, target in targets.items()}

        hand_over = self._control.hand_over
        hand_over.check_all(targets, Commander.TRAJECTORY)
        deadline, before = monotonic() + _LAST_STOP, commanded()
        while line.is_over.wait(_STANDS_FOR) or before != (now := commanded()):
            if line.is_cancelled:  # what others have asked for goes on
                raise _Cancelled
            if line.is_over.is_set() or monotonic() > deadline:
                raise target_refused(message("arm_not_at_rest", arms=tuple(side.word for side in targets)))
            hand_over.check_all(targets, Commander.TRAJECTORY)  # a cancel is open to all: it would brake another client
            for side, target in targets.items():
                target.command(CancelTrajectory(), snapshots[side].activation)
            before = now

    def _end_unreported(self, line: _Line, epochs: Mapping[Side, tuple[int, int]]) -> None:
        """Another session or activation ends a line, and events can be dropped: its goal must end all the same.

        Raises:
            RobotNotReady: its end was not reported.
        """
        is_over = line.is_over.wait(_REPORTED_WITHIN)
        others = [side for side, epoch in epochs.items() if self._control.snapshot(side).command_epoch != epoch]
        if is_over or not others:
            return
        self._stop(line)  # nothing is known of it: it must not go on
        raise RobotNotReady(message("line_ended_unreported", arms=tuple(side.word for side in others)))

    def _report(self, handle: Any, line: _Line, duration: float) -> None:
        newest = [self._control.buffers[side].tool_path.read() for side in line.sides]
        ways = [each[1] for each in newest if each is not None and each[1].goal == line.number]
        if len(ways) < len(newest) or not handle.is_active:
            return
        time = min(max(min(way.progress for way in ways), 0.0), duration)
        scale = min(way.scale for way in ways)
        feedback = self.type.Feedback(progress=time / duration if duration else 1.0)
        feedback.remaining = (duration - time) / scale if scale > 0.0 else inf
        self._fill(feedback, line)
        handle.publish_feedback(feedback)

    def _finish(self, handle: Any, line: _Line, result: Any) -> None:
        failed = [(side, end) for side, end in line.ends.items() if end.outcome is not TrajectoryOutcome.SUCCEEDED]
        if not failed and not line.sides <= set(line.ends):
            raise RobotNotReady(line.reason)
        if not failed:
            result.message, result.success = str(next(iter(line.ends.values())).said), True
            handle.succeed()
            return
        if len(line.sides) > 1:
            self._stop(line)
        side, end = failed[0]
        said, held = end.said, self._control.snapshot(side).limited
        if held is not None:
            said = message("goal_not_reached_limited", arm=side.word, reason=end.said, limited=held.said)
        elif len(line.sides) > 1:
            said = message("goal_not_reached", arm=side.word, reason=end.said)
        result.message, result.code = str(said), said.code
        if end.outcome is TrajectoryOutcome.CANCELED and line.is_cancelled:
            self._end_cancelled(handle)
        else:
            handle.abort()

    def _end_cancelled(self, handle: Any) -> None:
        (handle.canceled if is_cancelled(handle, SystemClock()) else handle.abort)()

    def _pose(self, side: Side, line: _Line) -> Any:
        """Of what is moved, in the robot's base; empty where it is not known."""
        message, state = PoseStamped(), self._frames.measured(side)
        if state is not None:
            message.header.frame_id, message.header.stamp = self._base, self._ros_clock.now().to_msg()
            pose = tool0_to_body(side, state.position, line.tools.get(side) or self._frames.tcp(side))
            fill_pose(message.pose.position, message.pose.orientation, pose)
        return message


class MoveLinearAction(LineAction):
    """Serves ``<controller>/move_linear`` of one arm; the arguments as above, and ``side``, which arm."""

    type = MoveLinear

    def __init__(self, side: Side, *args: Any) -> None:
        self._side = side
        super().__init__(*args)

    def _goals(self, request: Any) -> Mapping[Side, LineGoal]:
        poses = [*request.through, request.target_pose]
        angle = request.arm_angle if request.turn_elbow else None
        tool = self._tool(self._side, request.tool_frame)
        return {self._side: LineGoal(poses, request.speed, angle, request.zone, tool)}

    def _fill(self, message: Any, line: _Line) -> None:
        message.pose = self._pose(self._side, line)


class MoveBothLinearAction(LineAction):
    """Serves ``dual_arm_cartesian_controller/move_linear`` of both arms."""

    type = MoveBothLinear

    def _goals(self, request: Any) -> Mapping[Side, LineGoal]:
        if not (len(request.right) and len(request.left)):
            raise target_refused(message("one_arm_without_pose", controller=CARTESIAN_CONTROLLER))
        return {
            side: LineGoal(poses, request.speed, None, request.zone, self._tool(side, frame))
            for side, poses, frame in (
                (Side.RIGHT, request.right, request.right_tool_frame),
                (Side.LEFT, request.left, request.left_tool_frame),
            )
        }

    def _fill(self, message: Any, line: _Line) -> None:
        message.right, message.left = self._pose(Side.RIGHT, line), self._pose(Side.LEFT, line)
