"""The dual-arm move-and-grab application of the thesis (listing 3.4), in plain rclpy on the driver's ROS interface."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import dataclass, field
from functools import partial
from math import degrees, dist, inf, radians
from time import monotonic
from typing import Any, Protocol, TypeVar

import rclpy
from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Time
from control_msgs.action import GripperCommand
from controller_manager_msgs.srv import SwitchController
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import PoseStamped
from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger
from yumi_interfaces.action import Recover
from yumi_interfaces.msg import RobotState

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, GoalNotReached, RobotNotReady, StopNotConfirmed, YumiError
from abb_protocols.robot.gripper_values import GripOutcome, outcome_of
from abb_protocols.robot.joints import Joints, Side, joint_names, joints
from yumi.driver.controller_names import CARTESIAN_CONTROLLER, STREAM_CONTROLLER
from yumi.ros.gripper_actions import GRIPPER_FAILURE, GRIPPER_FAILURES
from yumi.ros.messages import LATCHED_QOS

_T = TypeVar("_T")

GRAB_GOALS: dict[Side, Joints] = {
    Side.RIGHT: joints([radians(value) for value in (42.1, -118.4, -92.1, 46.5, -143.6, 42.5, 36.1)]),
    Side.LEFT: joints([radians(value) for value in (-39.0, -104.1, 80.0, 8.0, 31.0, 93.0, 57.0)]),
}
"""Where the arms go, chain order [rad]."""

MEETING_OF_ARMS: dict[Side, Joints] = {
    Side.RIGHT: joints([radians(value) for value in (107, -111, -76, 39, -166, 113, -128)]),
    Side.LEFT: joints([radians(value) for value in (-106, -105, 78, 38, 161, 111, 124)]),
}
"""Both tools at the same place in front of the robot, chain order [rad]: no arm gets there beside the other one."""

MOVE_TOLERANCE = radians(0.1)
"""An arm has arrived when every joint is this near to its goal [rad]."""

_OPEN, _CLOSED = 0.025, 0.0
"""Finger positions [m]."""

GRAB_LIFT = 0.05
"""How far what was grabbed is lifted, on a straight line of the tool [m]."""

LIFTING_ARM = Side.LEFT
"""The arm that does; in the virtual robot something lies between its fingers."""

_MOVE_TIMEOUT = 30.0
"""Longest time for one motion at full speed [s]."""

_RECOVERIES = 3
"""How often each step of the task is repeated after a stop of the robot; a person confirms each stop."""

_THERE = 2e-4  # [m] from the end of a line
_STANDS = 0.01  # [rad/s] of an arm that has come to rest
_AGAIN = 1.0  # [s] after which a target is sent once more to an arm that stands elsewhere
_SPIN = 0.05  # [s]
_DISCOVERY = 10.0  # [s]
_ANSWER = 30.0  # [s]
_STATE = 5.0  # [s]
_RECOVERY = 120.0  # [s]; a controller that restarts does not answer for some twenty
_EXPLAINED = 1.5  # [s] after EGM's end the driver knows what stopped the robot
_FAILURE = 1.0  # [s] for the reason of a gripper's failure, which is on another topic than the result


class MoveAndGrabProgress(Protocol):
    """Shows a person the progress of the task."""

    def step(self, sentence: str) -> None:
        """A new step begins."""

    def error(self, side: Side, error_deg: float, share: float) -> None:
        """An arm has come nearer: the largest joint error, and the share of the way done, 0 to 1."""

    def note(self, sentence: str) -> None:
        """A step had a result."""


@dataclass(frozen=True, slots=True)
class MoveAndGrabGrip:
    """How a gripper command ended.

    Attributes:
        position: of one finger, from the middle [m].
        outcome: how.
    """

    position: float
    outcome: GripOutcome

    @property
    def word(self) -> str:
        """``holding``, ``open``, ``closed``, ``in place`` or ``stalled``."""
        return self.outcome.value

    @property
    def width(self) -> str:
        """Between both fingers, which move alike, with its unit."""
        return f"{2e3 * self.position:.1f} mm"


@dataclass(slots=True)
class MoveAndGrabArmReport:
    """The result of one arm's part of the task.

    Attributes:
        duration: from the goal until every joint was near enough [s].
        final_error: largest joint error at the end of the task [rad].
        missed: cycles of the robot without an answer during the task.
        grip: how closing the gripper ended.
        path: times [s] and positions [rad] of every joint state received.
    """

    duration: float = 0.0
    final_error: float = 0.0
    missed: int = 0
    grip: MoveAndGrabGrip | None = None
    path: list[tuple[float, Joints]] = field(default_factory=list)


class _Arm:
    """The topics and the gripper action of one arm.

    Attributes:
        position: of the newest joint state [rad].
        missed: cycles without an answer since the driver's start.
        is_commanded: whether EGM runs and a controller commands the arm.
        failures: how many gripper goals failed, and why the last one did.
        stands: whether no joint moves.
        pose: of the tool, the newest message.
        places: where the tool was, as often as it was heard [m].
    """

    def __init__(self, node: Any, side: Side, path: list[tuple[float, Joints]]) -> None:
        self.side = side
        self.position: Joints | None = None
        self.missed: int | None = None
        self.is_commanded = False
        self.failures = (0, "")
        self.stands = False
        self.pose: Any = None
        self.places: list[tuple[float, float, float]] = []
        self._path = path
        name = side.value
        self.goals = node.create_publisher(JointState, f"{name}/joint_commands", 10)
        self.gripper = ActionClient(node, GripperCommand, f"{name}/gripper/gripper_cmd")
        self.switch = node.create_client(SwitchController, f"{name}/controller_manager/switch_controller")
        self.targets = node.create_publisher(PoseStamped, f"{name}/{CARTESIAN_CONTROLLER}/target_pose", 10)
        node.create_subscription(PoseStamped, f"{name}/tcp_pose", self._take_pose, 10)
        node.create_subscription(JointState, f"{name}/joint_states", self._take_state, 100)
        node.create_subscription(DiagnosticStatus, f"{name}/egm_state", self._take_egm_state, 1)
        node.create_subscription(DiagnosticStatus, f"{name}/gripper/state", self._take_gripper_state, LATCHED_QOS)

    def has_states(self) -> bool:
        """Whether position and EGM state are known."""
        return self.position is not None and self.missed is not None

    def error(self) -> float:
        """Largest distance of a joint from its goal [rad]."""
        assert self.position is not None
        return max(abs(now - goal) for now, goal in zip(self.position, GRAB_GOALS[self.side], strict=True))

    def _take_pose(self, message: Any) -> None:
        self.pose, place = message, message.pose.position
        self.places.append((place.x, place.y, place.z))

    def _take_state(self, message: Any) -> None:
        self.position = joints(message.position)
        self.stands = max(map(abs, message.velocity), default=0.0) < _STANDS
        self._path.append((message.header.stamp.sec + message.header.stamp.nanosec * 1e-9, self.position))

    def _take_egm_state(self, message: Any) -> None:
        values = {pair.key: pair.value for pair in message.values}
        self.missed = int(values["missed"])
        self.is_commanded = values["running"] == values["commanded"] == str(True)

    def _take_gripper_state(self, message: Any) -> None:
        values = {pair.key: pair.value for pair in message.values}
        self.failures = (int(values.get(GRIPPER_FAILURES, 0)), values.get(GRIPPER_FAILURE, ""))


class MoveAndGrab:
    """The application; one node of its own.

    Args:
        progress: shows the steps.
        check: called again and again while waiting; raises when the task must end.
        confirm: asks a person who sees the robot whether it may go on after the stop of this sentence.
        approaches: whether the arms are sent into each other at the end, so that the driver holds them: for a virtual
            robot alone, whose driver keeps the arms apart (``collision.enabled``).
    """

    def __init__(
        self,
        progress: MoveAndGrabProgress,
        check: Callable[[], None],
        confirm: Callable[[str], bool] = lambda _: False,
        *,
        approaches: bool = False,
    ) -> None:
        self._approaches = approaches
        self.reports = {side: MoveAndGrabArmReport() for side in Side}
        self._progress = progress
        self._check = check
        self._confirm = confirm
        self._node: Any = rclpy.create_node("move_and_grab")
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._services = {
            name: self._node.create_client(Trigger, f"yumi_robot_manager/{name}")
            for name in ("robot_is_ready", "start_egm", "stop_egm")
        }
        self._recover_client = ActionClient(self._node, Recover, "yumi_robot_manager/recover")
        self._state: Any = None
        self._node.create_subscription(RobotState, "yumi_robot_manager/state", self._take_state, LATCHED_QOS)
        self._arms = {side: _Arm(self._node, side, self.reports[side].path) for side in Side}
        self._started_egm = False

    def close(self) -> None:
        """Destroy the node."""
        self._executor.remove_node(self._node)
        self._executor.shutdown()
        self._node.destroy_node()

    def run(self) -> None:
        """The whole task.

        Raises:
            YumiError: a step failed.
            Exception: whatever the check raises.
        """
        self._wait_until_ready()
        self._despite_stops(self._start_egm)
        missed = {side: arm.missed or 0 for side, arm in self._arms.items()}
        self._despite_stops(lambda: self._grip("open both grippers", _OPEN))
        for side in (Side.RIGHT, Side.LEFT):
            self._despite_stops(partial(self._move, side))
        grips = self._despite_stops(lambda: self._grip("close both grippers", _CLOSED))
        arm = self._arms[LIFTING_ARM]
        self._wait(
            lambda: arm.stands and arm.pose is not None, _STATE, f"A pose of the {LIFTING_ARM.word} tool at rest"
        )
        low = arm.pose
        self._despite_stops(lambda: self._lift(low))
        if self._approaches:
            self._despite_stops(self._approach)
        for side, report in self.reports.items():
            report.grip = grips[side]
            report.missed = (self._arms[side].missed or 0) - missed[side]
            report.final_error = self._arms[side].error()
        self._progress.step("stop EGM")
        self._request("stop_egm")
        self._started_egm = False

    def stop_motion(self) -> None:
        """End EGM if this application started it; for use after a cancel, so the check is no longer called."""
        if self._started_egm:
            self._check = lambda: None
            self._request("stop_egm")

    # The steps

    def _wait_until_ready(self) -> None:
        self._progress.step("wait until the robot is ready")
        answer: Any = None

        def is_ready() -> bool:
            nonlocal answer
            answer = self._call("robot_is_ready", _DISCOVERY)
            return answer.success or bool(self._state is not None and self._state.stop)

        try:
            self._wait(is_ready, 30.0, "Readiness of the robot")
        except RobotNotReady as error:
            if not answer:
                raise
            reason = message("text", text=str(answer.message))
            raise RobotNotReady(message("not_ready_in_time", error=error.said, answer=reason)) from error
        if not answer.success:  # an earlier stop has not been confirmed by a person
            self._recover(RobotNotReady(message("text", text=str(answer.message))))

    def _start_egm(self) -> None:
        self._progress.step("start EGM on both arms")
        self._started_egm = True
        self._progress.note(self._request("start_egm"))
        for arm in self._arms.values():
            self._wait(arm.has_states, _STATE, f"A joint state and an EGM state of the {arm.side.word} arm")
            try:
                self._wait(partial(getattr, arm, "is_commanded"), _STATE, "The activation of its controller")
            except RobotNotReady as error:
                raise GoalNotReached(message("arm_stopped_before_motion", arm=arm.side.word)) from error

    def _move(self, side: Side) -> None:
        arm = self._arms[side]
        self._progress.step(f"move the {side.word} arm")
        self._activate(arm, STREAM_CONTROLLER, CARTESIAN_CONTROLLER)
        self._wait(lambda: arm.goals.get_subscription_count() > 0, _DISCOVERY, f"A subscriber to {arm.goals.topic}")
        whole, begin = max(arm.error(), MOVE_TOLERANCE), monotonic()
        arm.goals.publish(JointState(name=list(joint_names(side)), position=list(GRAB_GOALS[side])))

        def has_arrived() -> bool:
            error = arm.error()
            self._progress.error(side, degrees(error), 1.0 if error < MOVE_TOLERANCE else 1.0 - error / whole)
            if error >= MOVE_TOLERANCE and not arm.is_commanded:
                raise GoalNotReached(message("arm_stopped_before_goal", arm=side.word, distance=error))
            return error < MOVE_TOLERANCE

        self._wait_for_motion(has_arrived, f"Arrival of the {side.word} arm within 0.1°")
        self.reports[side].duration = monotonic() - begin

    def _grip(self, sentence: str, position: float) -> dict[Side, MoveAndGrabGrip]:
        """Move both grippers at once; the first failure counts once both have ended."""
        self._progress.step(sentence)
        goal = GripperCommand.Goal()
        goal.command.position = position
        handles, failed_before = {}, {side: arm.failures[0] for side, arm in self._arms.items()}
        for side, arm in self._arms.items():
            self._wait(arm.gripper.server_is_ready, _DISCOVERY, f"The {side.word} gripper's action: its appearance")
            handles[side] = self._result(arm.gripper.send_goal_async(goal), f"The answer of the {side.word} gripper")
            if not handles[side].accepted:
                reason = self._why_failed(arm, failed_before[side])
                raise CommandRefused(message("gripper_refused_goal", arm=side.word, reason=reason))
        grips, failures = {}, []
        for side, handle in handles.items():
            ended = self._result(handle.get_result_async(), f"The end of the {side.word} gripper's motion")
            if ended.status == GoalStatus.STATUS_SUCCEEDED:
                result = ended.result
                outcome = outcome_of(
                    result.position, result.effort, stalled=result.stalled, reached_goal=result.reached_goal
                )
                grips[side] = MoveAndGrabGrip(result.position, outcome)
            elif ended.status == GoalStatus.STATUS_CANCELED:
                failures.append(f"The {side.word} gripper's goal was cancelled; its fingers stand.")
            else:
                failures.append(self._why_failed(self._arms[side], failed_before[side]))
        if failures:
            raise GoalNotReached(failures[0])
        self._progress.note(
            ", ".join(f"{side.word}: {grip.word}, {grip.width} between the fingers" for side, grip in grips.items())
        )
        return grips

    def _lift(self, low: Any) -> None:
        """Lift the tool from a pose and put it back, each on a straight line."""
        arm = self._arms[LIFTING_ARM]
        self._progress.step(
            f"lift the {LIFTING_ARM.word} tool by {GRAB_LIFT * 1e3:.0f} mm on a straight line, and put it back"
        )
        self._activate(arm, CARTESIAN_CONTROLLER, STREAM_CONTROLLER)
        begin = len(arm.places)
        for height in (GRAB_LIFT, 0.0):
            target = PoseStamped(pose=low.pose)
            target.header.frame_id, target.header.stamp = low.header.frame_id, Time()
            place = low.pose.position
            goal = (place.x, place.y, place.z + height)
            sent_at = -inf

            def has_arrived(target: Any = target, goal: tuple[float, float, float] = goal) -> bool:
                nonlocal sent_at
                if not arm.is_commanded:
                    raise GoalNotReached(message("arm_stopped_on_line", arm=LIFTING_ARM.word))
                if arm.stands and dist(arm.places[-1], goal) < _THERE:
                    return True
                if arm.stands and monotonic() - sent_at > _AGAIN:
                    again = deepcopy(target)
                    again.pose.position.z = goal[2]
                    arm.targets.publish(again)
                    sent_at = monotonic()
                return False

            self._wait_for_motion(has_arrived, f"Arrival of the {LIFTING_ARM.word} tool at the end of its line")
        x, y, _ = arm.places[begin]
        off = max(dist(place[:2], (x, y)) for place in arm.places[begin:])
        self._progress.note(f"the tool was at most {off * 1e3:.2f} mm off the line")
        self._activate(arm, STREAM_CONTROLLER, CARTESIAN_CONTROLLER)

    def _approach(self) -> None:
        """Send both arms towards the same place, see that they are held before they meet, and send them back."""
        self._progress.step("send both arms towards the same place: the driver holds them before they meet")
        both = [side.word for side in Side]

        def go_to(goals: Mapping[Side, Joints]) -> None:
            for side, arm in self._arms.items():
                arm.goals.publish(JointState(name=list(joint_names(side)), position=list(goals[side])))

        def pairs() -> list[str]:
            """Of parts of both arms, what limits them now."""
            return [pair for pair in self._state.limited_by if all(word in pair for word in both)]

        def check_commanded() -> None:
            for side, arm in self._arms.items():
                if not arm.is_commanded:
                    raise GoalNotReached(message("arm_stopped_on_way", arm=side.word))

        def are_held() -> bool:
            check_commanded()
            return bool(pairs()) and all(arm.stands for arm in self._arms.values())

        def are_back() -> bool:
            check_commanded()
            return all(arm.error() < MOVE_TOLERANCE for arm in self._arms.values())

        go_to(MEETING_OF_ARMS)
        self._wait_for_motion(are_held, "The driver's holding of the arms")
        for pair in pairs():
            self._progress.note(f"held: {pair}; the driver lets them no nearer (collision.margin)")
        go_to(GRAB_GOALS)
        self._wait_for_motion(are_back, "The arms' way back")

    def _activate(self, arm: _Arm, controller: str, other: str) -> None:
        """Have one controller command an arm in place of another; it may already."""
        self._wait(arm.switch.service_is_ready, _DISCOVERY, f"The service {arm.switch.srv_name}: its appearance")
        request = SwitchController.Request(activate_controllers=[controller], deactivate_controllers=[other])
        request.strictness = SwitchController.Request.BEST_EFFORT
        answer = self._result(arm.switch.call_async(request), "The answer of switch_controller")
        if not answer.ok:
            raise GoalNotReached(
                message("controller_not_activated", arm=arm.side.word, controller=controller, why=str(answer.message))
            )

    def _why_failed(self, arm: _Arm, failed_before: int) -> str:
        """The driver's reason for a gripper's failure; the action's result has no text."""
        try:
            self._wait(lambda: arm.failures[0] > failed_before, _FAILURE, "The reason")
        except RobotNotReady:
            return f"The {arm.side.word} gripper did not do it; the driver's log says why."
        return arm.failures[1]

    # After a stop

    def _despite_stops(self, step: Callable[[], _T]) -> _T:
        """The result of ``step``; where the robot has been stopped meanwhile, it recovers and ``step`` is repeated."""
        attempt = 0
        while True:
            try:
                return step()
            except YumiError as error:
                attempt += 1
                was_stopped = isinstance(error, GoalNotReached) or self._is_stopped()
                if not was_stopped or attempt > _RECOVERIES:
                    raise
                self._progress.step(f"{error} Recover, attempt {attempt} of {_RECOVERIES}")
                self._recover(error)
                self._start_egm()

    def _recover(self, error: YumiError) -> None:
        """Bring the robot back to ready. A person must confirm, unless no stop of the robot is known.

        Raises:
            RobotNotReady: not confirmed; the message says what stopped the robot.
        """
        try:
            self._wait(self._is_explained, _EXPLAINED, "A cause")
        except RobotNotReady:
            self._node.get_logger().info("No stop is known: the robot works, the connection was lost for a moment.")
        stop = ""
        if self._is_stopped():
            stop = str(self._state.stop)
            cause = message("text", text=str(self._state.cause))
            if not self._confirm(str(message("robot_stands", cause=cause))):
                raise RobotNotReady(message("robot_stands_unconfirmed", error=error.said, cause=cause), stop) from error
        while True:
            try:
                self._progress.note(self._request_recovery(stop))
                return
            except RobotNotReady as refusal:
                if not self._confirm(str(refusal)):
                    raise
                stop = refusal.stop

    def _request_recovery(self, confirmed_stop: str) -> str:
        """The action ``recover``; its message."""
        self._wait(self._recover_client.server_is_ready, _DISCOVERY, "The action recover: its appearance")
        sent = self._recover_client.send_goal_async(
            Recover.Goal(confirm_stop=confirmed_stop),
            feedback_callback=lambda message: self._progress.note(str(message.feedback.step)),
        )
        handle = self._result(sent, "The answer of recover")
        try:
            result = self._result(handle.get_result_async(), "The end of recover", _RECOVERY).result
        except BaseException:
            handle.cancel_goal_async()
            raise
        if result.success:
            return str(result.message)
        if result.stop:  # a stop that only the newer state has was not shown to a person
            raise StopNotConfirmed(str(result.message), str(result.stop))
        raise RobotNotReady(str(result.message))

    def _is_stopped(self) -> bool:
        """Whether something known keeps the robot stopped."""
        return self._state is not None and bool(self._state.stop or self._state.cause)

    def _is_explained(self) -> bool:
        """Whether the driver knows more than that the robot is stopped."""
        return self._is_stopped() and (bool(self._state.stop) or self._state.cause_codes != self._state.reason_codes)

    def _take_state(self, message: Any) -> None:
        self._state = message

    # Waiting

    def _wait(self, is_true: Callable[[], bool], timeout: float, what: str) -> None:
        """Spin the node until ``is_true``.

        Raises:
            RobotNotReady: it did not become so within ``timeout`` [s].
        """
        end = monotonic() + timeout
        while not is_true():
            self._check()
            if monotonic() > end:
                raise RobotNotReady(message("did_not_happen", what=what, longest=timeout))
            self._executor.spin_once(timeout_sec=_SPIN)

    def _wait_for_motion(self, is_true: Callable[[], bool], what: str) -> None:
        """The same for the end of a motion; with the parts that the driver keeps apart, where it fails."""
        try:
            self._wait(is_true, _MOVE_TIMEOUT / self._state.speed_scale, what)
        except RobotNotReady as error:
            pairs = "; ".join(self._state.limited_by)
            if not pairs:
                raise
            raise RobotNotReady(message("did_not_happen_kept_apart", error=error.said, pairs=pairs)) from error

    def _result(self, future: Any, what: str, timeout: float = _ANSWER) -> Any:
        self._wait(future.done, timeout, what)
        return future.result()

    def _call(self, name: str, timeout: float = _ANSWER) -> Any:
        client = self._services[name]
        self._wait(client.service_is_ready, timeout, f"The service {name} of the driver: its appearance")
        return self._result(client.call_async(Trigger.Request()), f"The answer of {name}", timeout)

    def _request(self, name: str) -> str:
        """The message of a service that must succeed; a refusal is raised with the driver's reason."""
        answer = self._call(name)
        if not answer.success:
            raise RobotNotReady(str(answer.message))
        return str(answer.message)
