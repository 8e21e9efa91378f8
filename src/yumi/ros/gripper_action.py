"""The action ``gripper_cmd`` of one hand: its result comes from what the gripper measures, never from elapsed time."""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite
from typing import Any

from control_msgs.action import GripperCommand
from rclpy.action import ActionServer, CancelResponse, GoalResponse

from yumi.errors import YumiError
from yumi.hardware.gripper import Gripper
from yumi.robot.gripper import MAX_FORCE, TRAVEL, Outcome


class GripperAction:
    """Serves ``~/gripper_cmd``; positions are those of one finger joint [m], 0 is closed, 0.025 open.

    Args:
        node: the gripper's node.
        gripper: the hand.
        force: holding force where a goal names none (``max_effort`` 0) [N].
        group: callback group that lets a goal run while others are refused.
        why_not: why no goal is taken now; None when they are.
    """

    def __init__(
        self,
        node: Any,
        gripper: Gripper,
        force: float,
        group: Any,
        why_not: Callable[[], str | None] = lambda: None,
    ) -> None:
        self._log = node.get_logger()
        self._gripper = gripper
        self._force = force
        self._why_not_now = why_not
        self._is_busy = False
        self._server = ActionServer(
            node,
            GripperCommand,
            "~/gripper_cmd",
            execute_callback=self._execute,
            goal_callback=self._consider,
            cancel_callback=self._consider_cancel,
            callback_group=group,
        )

    def destroy(self) -> None:
        self._server.destroy()

    def _consider(self, goal: Any) -> Any:
        reason = self._why_not(goal.command.position, goal.command.max_effort)
        if reason is None:
            self._is_busy = True
            return GoalResponse.ACCEPT
        self._log.warning(f"Gripper goal refused: {reason}")
        return GoalResponse.REJECT

    def _why_not(self, position: float, effort: float) -> str | None:
        if not (isfinite(position) and 0.0 <= position <= TRAVEL):
            return f"position {position} m; each finger travels 0 to {TRAVEL} m."
        if not (isfinite(effort) and 0.0 <= effort <= MAX_FORCE):
            return f"max_effort {effort} N; allowed is 0 (the configured force) to {MAX_FORCE:g} N."
        if self._is_busy:
            return "another goal is being carried out; wait for its result."
        return self._why_not_now()

    def _consider_cancel(self, _: Any) -> Any:
        self._log.warning(
            "Gripper goals cannot be cancelled: the hand ends a grip by itself; send another goal instead."
        )
        return CancelResponse.REJECT

    def _execute(self, handle: Any) -> Any:
        command = handle.request.command
        force = command.max_effort or self._force
        try:
            outcome = self._carry_out(handle, command.position, force)
        except YumiError as error:
            self._log.error(f"Gripper goal failed: {error}")
            handle.abort()
            return self._result(None, force)
        finally:
            self._is_busy = False
        handle.succeed()
        return self._result(outcome, force)

    def _carry_out(self, handle: Any, position: float, force: float) -> Outcome:
        self._gripper.begin(position, force)
        return self._gripper.wait(
            position, lambda now_at: handle.publish_feedback(GripperCommand.Feedback(position=now_at))
        )

    def _result(self, outcome: Outcome | None, force: float) -> Any:
        return GripperCommand.Result(
            position=self._gripper.last_position,
            effort=force if outcome is Outcome.HOLDING else 0.0,
            stalled=outcome in {Outcome.HOLDING, Outcome.STALLED},
            reached_goal=outcome in {Outcome.OPEN, Outcome.CLOSED, Outcome.IN_PLACE},
        )
