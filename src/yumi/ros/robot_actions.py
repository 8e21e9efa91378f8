"""The robot manager's actions ``set_mode`` and ``recover``: one at a time, with a sentence of feedback for each step.

A goal that cannot be met is not rejected, which would tell nobody why: it is aborted at once, with the reason.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from threading import Lock
from typing import Any

from rclpy.action import ActionServer, CancelResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from yumi_interfaces.action import Recover, SetMode

from yumi.errors import CommandRefused, RobotNotReady, YumiError
from yumi.hardware.robot_manager import RobotManager
from yumi.ros.managed_node import demand
from yumi.ros.permission import Permission
from yumi.ros.robot_messages import mode_of, robot_state


class _Cancelled(Exception):
    """Somebody has cancelled the goal; the step that was to come has not begun. Nobody explains it as a failure."""


class _Steps:
    """Tells a goal's client each step, unless the goal has been cancelled or nothing may move any more."""

    def __init__(self, handle: Any, kind: Any, permission: Permission) -> None:
        self._handle = handle
        self._kind = kind
        self._permission = permission

    def __call__(self, step: str) -> None:
        self.check(f"before: {step}")
        self._handle.publish_feedback(self._kind.Feedback(step=step))

    def check(self, when: str) -> None:
        """Raise when the goal shall end here; ``when`` says where that is."""
        if self._handle.is_cancel_requested:
            raise _Cancelled(f"Cancelled {when}.")
        reason = self._permission.to_move()
        if reason is not None:
            raise RobotNotReady(f"Given up {when}; {reason}")


class RobotManagerActions:
    """Serves them on the robot manager's node.

    Args:
        node: the robot manager's node.
        manager: what carries them out.
        permission: who must be active.
        on_change: called after each, since controllers and EGM may have changed.
    """

    def __init__(self, node: Any, manager: RobotManager, permission: Permission, on_change: Callable[[], None]) -> None:
        self._log = node.get_logger()
        self._clock = node.get_clock()
        self._manager = manager
        self._permission = permission
        self._on_change = on_change
        self._busy = Lock()
        self._servers = [
            ActionServer(
                node,
                kind,
                f"~/{name}",
                execute_callback=self._executing(name, kind, carry),
                cancel_callback=lambda _: CancelResponse.ACCEPT,
                callback_group=ReentrantCallbackGroup(),
            )
            for name, kind, carry in (("set_mode", SetMode, self._set_mode), ("recover", Recover, self._recover))
        ]

    def destroy(self) -> None:
        for server in self._servers:
            server.destroy()

    def _set_mode(self, goal: Any, report: _Steps) -> str:
        mode = mode_of(goal.mode)
        demand(self._permission.to_move(mode.arms))
        return self._manager.go_to(mode, report)

    def _recover(self, goal: Any, report: _Steps) -> str:
        demand(self._permission.to_move(self._manager.wanted))
        check = partial(report.check, "while the controller did not answer")
        return self._manager.recover(report, check, goal.confirm_stop.strip())

    def _executing(self, name: str, kind: Any, carry: Callable[[Any, _Steps], str]) -> Callable[[Any], Any]:
        def execute(handle: Any) -> Any:
            result = kind.Result()
            try:
                result.message = self._alone(lambda: carry(handle.request, _Steps(handle, kind, self._permission)))
                result.success = True
                handle.succeed()
            except _Cancelled as cancelled:
                result.message = str(cancelled)
                handle.canceled()
            except YumiError as error:
                result.message = str(error)
                self._log.error(f"{name}: {error}")
                handle.abort()
            result.state = robot_state(self._manager.watch.state(), self._clock.now().nanoseconds)
            self._on_change()
            return result

        return execute

    def _alone(self, carry: Callable[[], str]) -> str:
        if not self._busy.acquire(blocking=False):
            raise CommandRefused("Another set_mode or recover is being carried out; wait for its result or cancel it.")
        try:
            return carry()
        finally:
            self._busy.release()
