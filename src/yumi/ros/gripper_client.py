"""A client of everything that one hand offers; what is refused is raised, in the driver's words where it has any."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from action_msgs.msg import GoalStatus
from control_msgs.action import GripperCommand, ParallelGripperCommand
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.action import ActionClient
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger

from yumi.errors import CommandRefused, GoalNotReached, RobotNotReady
from yumi.robot.gripper import TRAVEL, Outcome, outcome_of
from yumi.robot.joints import Side
from yumi.ros.gripper_topics import FAILURE, FAILURES
from yumi.ros.service_calls import ServiceCalls
from yumi.ros.spinner import Spinner

_ANSWER = 30.0  # [s]; calibration takes some seconds
_ACCEPTANCE = 10.0  # [s]
_REASON = 1.0  # [s]
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


@dataclass(frozen=True, slots=True)
class Grip:
    """How a gripper command ended.

    Attributes:
        position: finger position [m].
        effort: holding force [N]; 0 when nothing is held.
        outcome: what became of it.
    """

    position: float
    effort: float
    outcome: Outcome

    @property
    def word(self) -> str:
        """``holding``, ``open``, ``closed``, ``in place`` or ``stalled``."""
        return self.outcome.value


class GripperClient:
    """The actions and services of one hand.

    What moves the fingers with a goal raises CommandRefused when the driver refuses it, and GoalNotReached when it
    could not carry it out or was cancelled. Every service raises RobotNotReady when it was refused or failed. All of
    them say why.

    Args:
        spinner: spins the node it belongs to.
        side: which hand.
    """

    def __init__(self, spinner: Spinner, side: Side) -> None:
        self._spinner = spinner
        self._side = side
        self._name = f"{side.value}/gripper"
        self._services = ServiceCalls(spinner, self._name)
        self._actions: dict[str, Any] = {}
        self._goal: Any = None
        self._failures = (0, "")  # how many goals failed, and why the last one did
        spinner.node.create_subscription(DiagnosticStatus, f"{self._name}/state", self._take_state, _LATCHED)
        self._action(GripperCommand, "gripper_cmd")  # finding it takes a moment

    # Goals

    def begin(self, position: float, effort: float = 0.0) -> Callable[[], Grip]:
        """Send the fingers to ``position`` [m] with ``effort`` [N]; returns what waits for the result."""
        goal = GripperCommand.Goal()
        goal.command.position, goal.command.max_effort = position, effort
        wait = self._begin(GripperCommand, "gripper_cmd", goal)

        def result() -> Grip:
            ended = wait()
            return _grip(ended.position, ended.effort, ended)

        return result

    def begin_at_speed(self, position: float, speed: float, effort: float = 0.0) -> Callable[[], Grip]:
        """The same with ``parallel_gripper_cmd``, at ``speed`` of each finger [m/s]."""
        command = JointState(position=[position], velocity=[speed], effort=[effort])
        goal = ParallelGripperCommand.Goal(command=command)
        wait = self._begin(ParallelGripperCommand, "parallel_gripper_cmd", goal)

        def result() -> Grip:
            ended = wait()
            return _grip(ended.state.position[0], ended.state.effort[0], ended)

        return result

    def move_to(self, position: float, speed: float = 0.0) -> Grip:
        """Send the fingers to ``position`` [m]; ``speed`` 0 is the configured one [m/s]."""
        return self.begin_at_speed(position, speed)()

    def grip_inwards(self, force: float = 0.0) -> Grip:
        """Close on what is between the fingers with ``force`` [N]; 0 is the configured one."""
        return self.begin(0.0, force)()

    def grip_outwards(self, force: float) -> Grip:
        """Open inside something hollow with ``force`` [N]."""
        return self.begin(TRAVEL, force)()

    def cancel(self) -> None:
        """Stop the fingers on their way to the newest goal, whose wait then raises GoalNotReached."""
        if self._goal is not None:
            asked = self._goal.cancel_goal_async()
            self._spinner.until(asked.done, _ACCEPTANCE, f"The end of the {self._side.word} gripper's goal")

    # Services

    def calibrate(self) -> str:
        """Close the fingers and call that zero."""
        return self._demand(Trigger, "calibrate")

    def jog_open(self) -> str:
        """Open slowly until :meth:`stop`, calibrated or not."""
        return self._demand(Trigger, "jog_open")

    def jog_close(self) -> str:
        """Close slowly until :meth:`stop`, calibrated or not."""
        return self._demand(Trigger, "jog_close")

    def stop(self) -> str:
        """Stop the fingers; what they hold is let go."""
        return self._demand(Trigger, "stop")

    def clear_error(self) -> str:
        """Acknowledge the hand's error."""
        return self._demand(Trigger, "clear_error")

    def switch_vacuum(self, channel: int, *, is_on: bool) -> str:
        """Switch the vacuum of module 1 or 2; its blow-off ends."""
        return self._demand(SetBool, f"vacuum_{channel}", data=is_on)

    def switch_blow(self, channel: int, *, is_on: bool) -> str:
        """Switch the blow-off of module 1 or 2; its vacuum ends."""
        return self._demand(SetBool, f"blow_{channel}", data=is_on)

    # How

    def _demand(self, kind: Any, service: str, **fields: object) -> str:
        return str(self._services.demand(kind, service, _ANSWER, **fields).message)

    def _action(self, kind: Any, name: str) -> Any:
        if name not in self._actions:
            self._actions[name] = ActionClient(self._spinner.node, kind, f"{self._name}/{name}")
        return self._actions[name]

    def _begin(self, kind: Any, name: str, goal: Any) -> Callable[[], Any]:
        action, side = self._action(kind, name), self._side.word
        self._spinner.until(action.server_is_ready, _ACCEPTANCE, f"The {side} gripper's action: its appearance")
        before = self._failures[0]
        sent = action.send_goal_async(goal)
        self._spinner.until(sent.done, _ACCEPTANCE, f"The answer of the {side} gripper")
        handle = sent.result()
        if not handle.accepted:
            raise CommandRefused(f"The {side} gripper refused the goal: {self._why_failed(before)}")
        self._goal = handle
        return lambda: self._result(handle, before)

    def _result(self, handle: Any, before: int) -> Any:
        future = handle.get_result_async()
        self._spinner.until(future.done, _ANSWER, f"The end of the {self._side.word} gripper's motion")
        if self._goal is handle:
            self._goal = None
        status = future.result().status
        if status == GoalStatus.STATUS_CANCELED:
            raise GoalNotReached(f"The {self._side.word} gripper's goal was cancelled; its fingers stand.")
        if status != GoalStatus.STATUS_SUCCEEDED:
            raise GoalNotReached(self._why_failed(before))
        return future.result().result

    def _why_failed(self, before: int) -> str:
        """The driver's words for a goal that failed after ``before`` others; they come on another topic."""
        with suppress(RobotNotReady):
            self._spinner.until(lambda: self._failures[0] > before, _REASON, "The reason")
            return self._failures[1]
        return f"The {self._side.word} gripper did not do it; the driver's log says why."

    def _take_state(self, status: Any) -> None:
        values = {each.key: each.value for each in status.values}
        self._failures = (int(values.get(FAILURES, 0)), values.get(FAILURE, ""))


def _grip(position: float, effort: float, result: Any) -> Grip:
    outcome = outcome_of(position, effort, stalled=result.stalled, reached_goal=result.reached_goal)
    return Grip(position=position, effort=effort, outcome=outcome)
