"""FollowJointTrajectory and its topics for one arm or both: what upstream's joint trajectory controller offers.

There is one on the node of each trajectory controller, and one for both arms. A goal is accepted when the controller
has accepted it; one that is inactive is activated for it where no other controller commands the arm. A trajectory with
a fault is rejected with the reason in the log; where the arm cannot follow now, the goal is accepted and aborted at
once, so that the reason is in its result. The controller reports the end of each motion, whatever ends
it, and the goal ends with it: a newer goal, a trajectory on the topic, a cancel, a deactivation.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import replace
from itertools import count
from threading import Event as Flag
from threading import Lock
from typing import Any

from control_msgs.action import FollowJointTrajectory
from control_msgs.msg import JointTrajectoryControllerState, SpeedScalingFactor
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from abb_protocols.errors import YumiError
from abb_protocols.robot.joints import CYCLE, ZERO_JOINTS, JointLimits, Side, joint_names
from abb_runtime.clock import Clock
from abb_runtime.parameters import number
from yumi.control.chunk_commands import ChunksExhausted
from yumi.control.controller import State
from yumi.control.controllers.dual_arm_trajectory import DualArmTrajectoryController
from yumi.control.controllers.joint_trajectory import JointTrajectoryController
from yumi.control.goals import Buffer
from yumi.control.loop_commands import CommandPort, Commands, ControllerCommand
from yumi.control.loop_events import ControlProcessEnded, ReportsDropped
from yumi.control.motion.setpoint import Setpoint
from yumi.control.shared_state import TrajectoryFeedback
from yumi.control.trajectory_commands import (
    CancelTrajectory,
    FollowTrajectory,
    ResultCode,
    ScaleSpeed,
    Tolerances,
    TrajectoryEnded,
    TrajectoryOutcome,
)
from yumi.driver.control_process import PROCESS_ENDED
from yumi.driver.controller_names import DUAL_ARM_CONTROLLER
from yumi.driver.monitor import RobotMonitor
from yumi.driver.stops import because
from yumi.planning.trajectory_request import JointTrajectory as Trajectory
from yumi.planning.trajectory_request import plan_trajectory, timed_trajectory
from yumi.ros.chunk_topic import ChunkTopic
from yumi.ros.controller_manager_node import MakeInterface
from yumi.ros.messages import LATCHED_QOS, Stamps, how_to_activate
from yumi.ros.nodes import TimerThread, is_cancelled
from yumi.ros.topic_refusals import check_wait, waited_for
from yumi.ros.trajectory_messages import feedback_message, stamp_of, state_message, tolerances_of, trajectory_of
from yumi.ros.trajectory_query import FRESH_TRAJECTORY_FEEDBACK, TrajectoryQuery

_FIRST_NUMBER = 2**40  # of these goals, beside the motions of scripts and commands, which count from 1

_POLL_PERIOD = 0.01  # [s] the controllers' state is published at most so often


class _OpenGoal:
    """A goal of the action that has not ended.

    Attributes:
        request: as received; it identifies the action server's handle.
        handle: the action's; None until it has one.
        ends: each arm's report of its end.
        is_over: set when it has ended.
        reason: why, where the arms have not reported it.
        feedback_due: when the next feedback is given [s].
    """

    def __init__(self, request: Any) -> None:
        self.request = request
        self.handle: Any = None
        self.ends: dict[Side, TrajectoryEnded] = {}
        self.is_over = Flag()
        self.reason = str(PROCESS_ENDED)
        self.feedback_due = 0.0

    @property
    def end(self) -> TrajectoryEnded:
        """The result of both arms: a failure, and of several the one that caused the others."""
        return min(self.ends.values(), key=lambda end: (end.outcome is TrajectoryOutcome.SUCCEEDED, end.code))


class TrajectoryAction:
    """Serves all topics, services and actions that a trajectory controller has.

    ``~/follow_joint_trajectory``, ``~/joint_trajectory``, ``~/speed_scaling_input``, ``~/controller_state``,
    ``~/query_state``; ``~/chunks`` and ``~/chunk_state``, see :class:`yumi.ros.chunk_topic.ChunkTopic`.

    For both arms also ``~/inter_arm_skew``: time between the arms' first cycles, and largest difference of the times
    on the trajectory that they were sent to [s].

    Args:
        node: the controller's node.
        name: the controller's name on each arm.
        feedback: by arm, in the order of the joints; where the controllers write their feedback.
        control: where the controllers are commanded.
        clock: the machine's clock.
        limits: what the joints may do.
        timers: publish what the controllers report.
        monitor: knows what stopped the robot; that is added to refusals and results.
        frame: of the robot's base, for the headers.
        on_switch: called when a goal has activated the controller.
    """

    def __init__(
        self,
        node: Any,
        name: str,
        feedback: Mapping[Side, Buffer[TrajectoryFeedback]],
        control: CommandPort,
        clock: Clock,
        limits: JointLimits,
        timers: TimerThread,
        monitor: RobotMonitor,
        frame: str = "",
        on_switch: Callable[[], None] = lambda: None,
    ) -> None:
        self._monitor = monitor
        self._on_switch = on_switch
        self._frame = frame
        self._log = node.get_logger()
        self._ros_clock = node.get_clock()
        self._stamps = Stamps.of(node, clock)
        self._name = name
        self._namespace = node.get_namespace().rstrip("/")
        self._feedback = feedback
        self._sides = tuple(feedback)
        self._control = control
        self._clock = clock
        self._limits = limits
        self._numbers = count(_FIRST_NUMBER)
        self._lock = Lock()
        self._open: dict[int, _OpenGoal] = {}
        self._seen: dict[Side, int] = dict.fromkeys(feedback, 0)
        group = ReentrantCallbackGroup()
        self._server = ActionServer(
            node,
            FollowJointTrajectory,
            "~/follow_joint_trajectory",
            execute_callback=self._execute,
            goal_callback=self._consider,
            cancel_callback=self._cancel,
            callback_group=group,
        )
        commands = MutuallyExclusiveCallbackGroup()
        node.create_subscription(JointTrajectory, "~/joint_trajectory", self._take, 1, callback_group=commands)
        node.create_subscription(
            SpeedScalingFactor, "~/speed_scaling_input", self._scale, LATCHED_QOS, callback_group=commands
        )
        self._chunks = ChunkTopic(node, commands, name, self._sides, control, clock, limits)
        self._query = TrajectoryQuery(node, feedback, clock)
        self._skews = node.create_publisher(Float64MultiArray, "~/inter_arm_skew", 1) if len(feedback) > 1 else None
        self._states = node.create_publisher(JointTrajectoryControllerState, "~/controller_state", 1)
        self._end_feedback = timers.every(_POLL_PERIOD, f"The feedback of {name}", self._pass_on)

    def on_event(self, event: Any) -> None:
        """An event of the only arm's controller; from any thread."""
        self.on_arm_event(self._sides[0], event)

    def on_arm_event(self, side: Side, event: object) -> None:
        """An event of one arm's controller; from any thread."""
        if isinstance(event, ControlProcessEnded):
            self._end_open_goals()
        elif isinstance(event, ReportsDropped):
            self._end_open_goals(str(event))
        if isinstance(event, ChunksExhausted) and side is self._sides[0]:
            self._log.info(str(event), throttle_duration_sec=1.0)
        if not isinstance(event, TrajectoryEnded):
            return
        with self._lock:
            goal = self._open.get(event.goal)
            if goal is None:
                self._log.info(str(event.said))
                return
            goal.ends[side] = event
            self._query.forget(event.goal)
            if len(goal.ends) == len(self._sides) or event.outcome is not TrajectoryOutcome.SUCCEEDED:
                goal.is_over.set()

    def destroy(self) -> None:
        """End; goals that are open are aborted."""
        self._end_open_goals()
        self._end_feedback()
        self._server.destroy()

    def _end_open_goals(self, reason: str = str(PROCESS_ENDED)) -> None:
        """No controller will report their end any more."""
        with self._lock:
            for goal in self._open.values():
                goal.reason = reason
                goal.is_over.set()

    def _consider(self, request: Any) -> Any:
        goal = _OpenGoal(request)
        try:
            activations = self._check_free(takes_over=True)
        except YumiError as error:  # a goal that is rejected has no result, where a client could read the reason
            goal.reason = self._reason(error)
            self._log.warning(goal.reason)
            goal.is_over.set()
            with self._lock:
                self._open[next(self._numbers)] = goal
            return GoalResponse.ACCEPT
        try:
            tolerances, reason = tolerances_of(request, self._sides)
            if reason:
                self._log.warning(f"The goal's tolerances are ignored, the controller's own apply: {reason}.")
            self._send(request.trajectory, tolerances, goal, activations)
        except YumiError as error:
            self._log.warning(self._reason(error))
            return GoalResponse.REJECT
        return GoalResponse.ACCEPT

    def _check_free(self, *, takes_over: bool) -> Mapping[Side, int]:
        """The activations of the arms' controllers; raises YumiError where a goal could not be followed now."""
        checks = self._commands(dict.fromkeys(self._sides, CancelTrajectory()), takes_over=takes_over)
        return self._control.call(Commands.check_commands, *checks)

    def _reason(self, error: YumiError) -> str:
        """Why a goal is refused, what stopped the robot, and what to do."""
        return f"{because(error.said, self._monitor.cause())}{self._advice()}"

    def _advice(self) -> str:
        """How to activate what is not active, as a sentence with a blank before it; empty where all is."""
        ways = []
        with suppress(YumiError):  # without the control process nothing is known
            for side in self._sides:
                infos = {info.name: info for info in self._control.call(Commands.list_controllers, side)}
                own = infos.get(self._name)
                if own is not None and own.state is State.INACTIVE:
                    rivals = [name for name, info in infos.items() if set(info.claimed) & set(own.required)]
                    namespace = self._namespace if len(self._sides) == 1 else f"{self._namespace}/{side.value}"
                    ways.append(how_to_activate(namespace, side, self._name, rivals))
        return f" To activate: {'; '.join(ways)}." if ways else ""

    def _send(
        self,
        message: Any,
        tolerances: Mapping[Side, Tolerances],
        goal: _OpenGoal | None,
        activations: Mapping[Side, int],
    ) -> None:
        """Have every arm accept its part of a trajectory, or none; for a goal, inactive controllers are activated.

        Raises:
            YumiError: the trajectory has a fault, a controller refuses it, or the control process has ended.
        """
        names = {name for side in self._sides for name in joint_names(side)}
        held = (
            None
            if names <= set(message.joint_names)
            else self._control.call(Commands.commanded_positions, *self._sides)
        )
        trajectory, smoothed_from = self._smoothed(trajectory_of(message))
        plans = plan_trajectory(trajectory, self._sides, self._limits, held, smoothed_from)
        number, stamped, start = next(self._numbers), stamp_of(message), None  # None is at once
        if stamped:  # on the monotonic clock as it is now: to plan a long trajectory takes time
            start = self._clock.now() + (stamped - int(self._ros_clock.now().nanoseconds)) * 1e-9
        commands = {
            side: FollowTrajectory(replace(plans[side], start=start), number, tolerances[side]) for side in self._sides
        }
        if goal is not None:
            with self._lock:
                self._open[number] = goal  # its end may be reported before the answer comes
        try:
            # To plan may take seconds: a stop meanwhile has dropped the goal.
            self._command(commands, activations, takes_over=goal is not None)
        except YumiError:
            with self._lock:
                self._open.pop(number, None)
            raise
        self._query.note(number, plans)

    def _smoothed(self, trajectory: Trajectory) -> tuple[Trajectory, Mapping[Side, Setpoint] | None]:
        """A trajectory with positions alone as ``positions_upsampling`` has it: its times, and where it begins.

        Upstream's parameters: a chunk of a policy begins at the speed the arm is commanded now, and ends at rest.
        """
        if any(each.velocity or each.acceleration for each in trajectory.points):
            return trajectory, None
        infos = self._control.call(Commands.list_parameters, self._sides[0], self._name)
        values = {info.parameter.name: info.value for info in infos}
        if not values["positions_upsampling.enable"]:
            return trajectory, None
        now, starts = self._clock.now(), {}
        positions = self._control.call(Commands.commanded_positions, *self._sides)
        for side, buffer in self._feedback.items():
            newest = buffer.read()
            is_known = newest is not None and newest[1].goal and now - newest[1].time < FRESH_TRAJECTORY_FEEDBACK
            starts[side] = Setpoint(positions[side], newest[1].output_velocity if newest and is_known else ZERO_JOINTS)
        return timed_trajectory(trajectory, number(values, "positions_upsampling.policy_frequency")), starts

    def _command(
        self,
        messages: Mapping[Side, object],
        activations: Mapping[Side, int] | None = None,
        *,
        takes_over: bool = False,
    ) -> None:
        commands = self._commands(messages, activations, takes_over=takes_over)
        replaced = self._control.call(Commands.send_commands, *commands)
        for side, names in replaced.items():
            instead = f", in place of {', '.join(names)}" if names else ""
            self._log.info(f"{self._name} was activated on the {side.word} arm for a goal{instead}.")
        if replaced:
            self._on_switch()

    def _commands(
        self,
        messages: Mapping[Side, object],
        activations: Mapping[Side, int] | None = None,
        *,
        takes_over: bool = False,
    ) -> tuple[ControllerCommand, ...]:
        known = activations or {}
        return tuple(
            ControllerCommand(side, self._name, message, known.get(side, 0), takes_over)
            for side, message in messages.items()
        )

    def _cancel(self, handle: Any) -> Any:
        found = self._find(handle)
        if found is None:
            return CancelResponse.REJECT  # it has just ended
        self._try(lambda: self._command({side: CancelTrajectory(found[0]) for side in self._sides}))
        return CancelResponse.ACCEPT

    def _find(self, handle: Any) -> tuple[int, _OpenGoal] | None:
        with self._lock:
            return next((item for item in self._open.items() if item[1].request is handle.request), None)

    def _execute(self, handle: Any) -> Any:
        found = self._find(handle)
        assert found is not None  # it was added before it was accepted
        number, goal = found
        goal.handle = handle
        try:
            goal.is_over.wait()
            return self._finish(handle, goal)
        finally:
            with self._lock:
                del self._open[number]

    def _finish(self, handle: Any, goal: _OpenGoal) -> Any:
        result = FollowJointTrajectory.Result()
        # One arm's success says nothing of the other arm, whose end will not be reported any more.
        if not goal.ends or (goal.end.outcome is TrajectoryOutcome.SUCCEEDED and len(goal.ends) < len(self._sides)):
            result.error_code = int(ResultCode.INVALID_GOAL)
            result.error_string = goal.reason
            handle.abort()
            return result
        end = goal.end
        result.error_code, result.error_string = int(end.code), str(end.said)
        if end.outcome is TrajectoryOutcome.ABORTED and end.code is ResultCode.INVALID_GOAL:  # EGM may have ended
            result.error_string = str(because(end.said, self._monitor.wait_for_cause()))
        if end.outcome is TrajectoryOutcome.SUCCEEDED:
            handle.succeed()
        elif end.outcome is TrajectoryOutcome.CANCELED and is_cancelled(handle, self._clock):
            handle.canceled()
        else:
            handle.abort()
        return result

    def _take(self, message: Any, info: Mapping[str, Any]) -> None:
        """A trajectory without a result; the goal whose motion it replaces ends as preempted."""
        own = {side: Tolerances() for side in self._sides}

        def send() -> None:
            check_wait("Trajectory", waited_for(info))
            self._send(message, own, None, self._check_free(takes_over=False))

        self._try(send)

    def _scale(self, message: Any) -> None:
        self._try(lambda: self._command({side: ScaleSpeed(float(message.factor)) for side in self._sides}))

    def _try(self, call: Callable[[], object]) -> None:
        try:
            call()
        except YumiError as error:
            self._log.warning(f"{error}{self._advice()}", throttle_duration_sec=1.0)

    def _pass_on(self) -> None:
        """Publish what is new of all arms, as the controller's state and as feedback of the goal it is about."""
        newest = {side: buffer.read() for side, buffer in self._feedback.items()}
        news = {side: each for side, each in newest.items() if each and each[0] != self._seen[side]}
        if len(news) < len(newest):
            return
        self._seen = {side: number for side, (number, _) in news.items()}
        feedbacks = {side: feedback for side, (_, feedback) in news.items()}
        time_ns = self._stamps.at(min(each.time for each in feedbacks.values()))
        self._states.publish(state_message(feedbacks, time_ns, self._frame))
        if self._skews is not None:
            self._skews.publish(Float64MultiArray(data=feedbacks[self._sides[0]].skew))
        numbers = {feedback.goal for feedback in feedbacks.values()}
        goal = self._open.get(numbers.pop()) if len(numbers) == 1 else None
        first = feedbacks[self._sides[0]]
        if goal is None or first.time < goal.feedback_due:
            return
        if goal.handle is not None and goal.handle.is_active and not goal.is_over.is_set():
            goal.feedback_due = first.time + first.monitor_period - 0.5 * CYCLE
            goal.handle.publish_feedback(feedback_message(feedbacks, time_ns, self._frame))


class TrajectoryControllers:
    """Makes the actions of each arm's trajectory controllers and of both.

    Attributes:
        interfaces: what controllers of a kind offer on their nodes.
    """

    def __init__(
        self,
        dual_node: Any,
        single: Mapping[Side, Buffer[TrajectoryFeedback]],
        dual: Mapping[Side, Buffer[TrajectoryFeedback]],
        control: CommandPort,
        clock: Clock,
        limits: JointLimits,
        timers: TimerThread,
        monitor: RobotMonitor,
        frame: str = "",
        on_switch: Callable[[], None] = lambda: None,
    ) -> None:
        shared = (control, clock, limits, timers, monitor, frame, on_switch)
        both = TrajectoryAction(dual_node, DUAL_ARM_CONTROLLER, dual, *shared)

        def of_one_arm(node: Any, side: Side, name: str) -> TrajectoryAction:
            return TrajectoryAction(node, name, {side: single[side]}, *shared)

        self._both = both
        self.interfaces: Mapping[str, MakeInterface] = {
            JointTrajectoryController.kind: of_one_arm,
            DualArmTrajectoryController.kind: lambda node, side, name: _Half(both, side),
        }

    def destroy(self) -> None:
        """End the action of both arms; the others go with their controllers."""
        self._both.destroy()


class _Half:
    """One arm's half of the dual-arm controller; its action is on the node of both."""

    def __init__(self, both: TrajectoryAction, side: Side) -> None:
        self._both = both
        self._side = side

    def on_event(self, event: Any) -> None:
        self._both.on_arm_event(self._side, event)

    def destroy(self) -> None:
        """Nothing of its own."""
