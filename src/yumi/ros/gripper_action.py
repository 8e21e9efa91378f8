"""The actions of one hand: their results come from what the gripper measures, never from elapsed time."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from threading import Lock
from typing import Any

from control_msgs.action import GripperCommand, ParallelGripperCommand
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from sensor_msgs.msg import JointState

from yumi.errors import CommandRefused, RobotNotReady, YumiError
from yumi.hardware.gripper import Gripper
from yumi.robot.gripper import Outcome
from yumi.robot.hand import HandOrder, order_of
from yumi.robot.joints import finger_names


class HandTurn:
    """Whose turn a hand's fingers are: one goal or service at a time; safe from any thread.

    It remembers why the last goal was refused or failed, too: the results of ROS's gripper actions have no text.

    Attributes:
        failures: how many goals were refused or failed, and why the last one was.
    """

    def __init__(self) -> None:
        self.failures = (0, "")
        self._lock = Lock()
        self._is_taken = False

    def take(self) -> bool:
        """Take it; False when somebody else has it."""
        with self._lock:
            was_taken, self._is_taken = self._is_taken, True
        return not was_taken

    def give_back(self) -> None:
        self._is_taken = False

    def fail(self, reason: str) -> None:
        """A goal was refused or failed."""
        with self._lock:
            self.failures = (self.failures[0] + 1, reason)


class HandAction(ABC):
    """Serves one action of a hand.

    Args:
        node: the gripper's node.
        gripper: the hand.
        force: holding force where a goal names none [N].
        group: callback group that lets a goal run while others are refused.
        why_not: why no goal is taken now; None when they are.
        turn: shared by all that moves the fingers.
    """

    kind: Any
    name: str

    def __init__(
        self,
        node: Any,
        gripper: Gripper,
        force: float,
        group: Any,
        why_not: Callable[[], str | None] = lambda: None,
        turn: HandTurn | None = None,
    ) -> None:
        self._log = node.get_logger()
        self._gripper = gripper
        self._force = force
        self._why_not_now = why_not
        self._turn = turn or HandTurn()
        self._server = ActionServer(
            node,
            self.kind,
            self.name,
            execute_callback=self._execute,
            goal_callback=self._consider,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=group,
        )

    def destroy(self) -> None:
        self._server.destroy()

    @abstractmethod
    def order(self, goal: Any) -> HandOrder:
        """What a goal asks for.

        Raises:
            CommandRefused: it asks for what the hand cannot do.
        """

    @abstractmethod
    def feedback(self, position: float) -> Any:
        """The feedback while the fingers are at ``position`` [m]."""

    @abstractmethod
    def result(self, position: float, effort: float, *, stalled: bool, reached_goal: bool) -> Any:
        """The result when the fingers came to rest at ``position`` [m] and hold something with ``effort`` [N]."""

    def _consider(self, goal: Any) -> Any:
        reason = self._why_not(goal)
        if reason is None:
            return GoalResponse.ACCEPT
        self._turn.fail(reason)
        self._log.warning(f"Gripper goal refused: {reason}")
        return GoalResponse.REJECT

    def _why_not(self, goal: Any) -> str | None:
        """Why a goal is refused, or None; it then has its turn."""
        try:
            self.order(goal)
        except CommandRefused as error:
            return str(error)
        reason = self._why_not_now()
        if reason is None and not self._turn.take():
            return "another goal is being carried out; wait for its result, or cancel it."
        return reason

    def _execute(self, handle: Any) -> Any:
        order = self.order(handle.request)
        try:
            outcome = self._carry_out(handle, order)
        except YumiError as error:
            stopped = self._why_not_now()  # the robot may have been stopped meanwhile
            cause = f" {stopped}" if stopped and stopped not in str(error) else ""
            self._turn.fail(f"{error}{cause}")
            self._log.error(f"Gripper goal failed: {error}{cause}")
            handle.abort()
            return self._result_of(order, None)
        finally:
            self._turn.give_back()
        if outcome is None:
            handle.canceled()
        else:
            handle.succeed()
        return self._result_of(order, outcome)

    def _carry_out(self, handle: Any, order: HandOrder) -> Outcome | None:
        self._gripper.begin(order, self._check)
        return self._gripper.wait(
            order,
            lambda position: handle.publish_feedback(self.feedback(position)),
            lambda: bool(handle.is_cancel_requested),
        )

    def _check(self) -> None:
        reason = self._why_not_now()
        if reason is not None:
            raise RobotNotReady(reason)

    def _result_of(self, order: HandOrder, outcome: Outcome | None) -> Any:
        return self.result(
            self._gripper.last_position,
            order.force if outcome is Outcome.HOLDING else 0.0,
            stalled=outcome in {Outcome.HOLDING, Outcome.STALLED},
            reached_goal=outcome in {Outcome.OPEN, Outcome.CLOSED, Outcome.IN_PLACE},
        )


class GripperAction(HandAction):
    """``~/gripper_cmd``: the position of one finger joint [m], 0 is closed, 0.025 open; see ``order_of``."""

    kind = GripperCommand
    name = "~/gripper_cmd"

    def order(self, goal: Any) -> HandOrder:
        return order_of(goal.command.position, goal.command.max_effort, self._force)

    def feedback(self, position: float) -> Any:
        return GripperCommand.Feedback(position=position)

    def result(self, position: float, effort: float, *, stalled: bool, reached_goal: bool) -> Any:
        return GripperCommand.Result(position=position, effort=effort, stalled=stalled, reached_goal=reached_goal)


class ParallelGripperAction(HandAction):
    """``~/parallel_gripper_cmd``: position, and where wanted speed and effort, of one finger joint or both."""

    kind = ParallelGripperCommand
    name = "~/parallel_gripper_cmd"

    def order(self, goal: Any) -> HandOrder:
        command, names = goal.command, finger_names(self._gripper.side)
        unknown = [name for name in command.name if name not in names]
        if unknown:
            raise CommandRefused(f"{unknown[0]!r} is no finger of this hand; name {' or '.join(names)}, or none.")
        if not command.position:
            raise CommandRefused("The goal has no position; give that of a finger [m].")
        position, speed = _one("position", command.position), _one("velocity", command.velocity)
        return order_of(position, _one("effort", command.effort), self._force, speed or None)

    def feedback(self, position: float) -> Any:
        return ParallelGripperCommand.Feedback(state=self._state(position, 0.0))

    def result(self, position: float, effort: float, *, stalled: bool, reached_goal: bool) -> Any:
        state = self._state(position, effort)
        return ParallelGripperCommand.Result(state=state, stalled=stalled, reached_goal=reached_goal)

    def _state(self, position: float, effort: float) -> Any:
        names = list(finger_names(self._gripper.side))
        return JointState(name=names, position=[position] * len(names), effort=[effort] * len(names))


def _one(what: str, values: Sequence[float]) -> float:
    """The value that the fingers share, since one motor moves them; 0 when there is none."""
    if any(value != values[0] for value in values[1:]):
        raise CommandRefused(f"The fingers cannot have different values of {what}: one motor moves both.")
    return float(values[0]) if values else 0.0


def hand_actions(
    node: Any,
    gripper: Gripper,
    force: float,
    group: Any,
    why_not: Callable[[], str | None] = lambda: None,
    turn: HandTurn | None = None,
) -> tuple[HandAction, ...]:
    """All actions of a hand; arguments as of :class:`HandAction`."""
    shared = turn or HandTurn()
    kinds: tuple[type[HandAction], ...] = (GripperAction, ParallelGripperAction)
    return tuple(kind(node, gripper, force, group, why_not, shared) for kind in kinds)
