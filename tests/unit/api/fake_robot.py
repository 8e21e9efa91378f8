"""A robot without a robot: it notes what it is asked, and its motions end when the test says so."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from yumi.api.motion import GOAL_CONTROLLER, STREAM_CONTROLLER, TRAJECTORY_CONTROLLER, MotionExecutor, MotionRegistry
from yumi.clock import ManualClock
from yumi.control.commands import MemoryMailbox
from yumi.control.controller import ControllerInfo, State
from yumi.control.controllers.joint_goal import GoalEnded, GoalOutcome, StopMotion
from yumi.control.requests import (
    ControllerNotice,
    Done,
    ListControllers,
    Order,
    Request,
    SendOrders,
    SwitchControllers,
)
from yumi.control.shared_state import Snapshot
from yumi.errors import CommandRefused
from yumi.robot.joints import YUMI_LIMITS, Side, home

NAMES = (GOAL_CONTROLLER, STREAM_CONTROLLER, TRAJECTORY_CONTROLLER)


class FakeLoop:
    """Both arms stand at home and follow."""

    def __init__(self) -> None:
        self.orders: list[Order] = []
        self.switches: list[SwitchControllers] = []
        self.refuses = False
        self.on_order: Callable[[Order], None] = lambda order: None
        self.snapshots = {
            side: Snapshot(session=1, is_streaming=True, is_running=True, activation=1, position=home(side))
            for side in Side
        }
        self._active = dict.fromkeys(Side, GOAL_CONTROLLER)

    def snapshot(self, side: Side) -> Snapshot:
        return self.snapshots[side]

    def ask(self, request: Request) -> Done:
        if isinstance(request, ListControllers):
            return Done(controllers=tuple(self._info(name, request.side) for name in NAMES))
        if isinstance(request, SwitchControllers):
            self._switch(request)
        if isinstance(request, SendOrders):
            if self.refuses:
                raise CommandRefused("Not now.")
            self.orders += request.orders
            for order in request.orders:
                self.on_order(order)
        return Done()

    def _info(self, name: str, side: Side) -> ControllerInfo:
        is_active = self._active[side] == name
        claimed = ("joint/position",) if is_active else ()
        return ControllerInfo(name, "kind", State.ACTIVE if is_active else State.INACTIVE, ("joint/position",), claimed)

    def _switch(self, request: SwitchControllers) -> None:
        self.switches.append(request)
        (self._active[request.side],) = request.activate
        before = self.snapshots[request.side]
        self.snapshots[request.side] = replace(before, activation=before.activation + 1)


class FakeRobot:
    """An executor with a fake control loop."""

    def __init__(self, arms: tuple[Side, ...] = tuple(Side)) -> None:
        self.loop = FakeLoop()
        self.goals = {side: MemoryMailbox() for side in Side}
        self.motions = MotionRegistry()
        self.executor = MotionExecutor(self.loop, self.goals, self.motions, arms, YUMI_LIMITS, ManualClock(100.0))

    def rest(self, order: Order) -> None:
        """For ``on_order``: an arm that is told to stop does."""
        if isinstance(order.message, StopMotion):
            self.end(order)

    def end(self, order: Order, outcome: GoalOutcome = GoalOutcome.REACHED, sentence: str = "so") -> None:
        """The control loop reports how an order has ended."""
        identity = order.message.identity  # type: ignore[attr-defined]
        self.motions.note(ControllerNotice(order.side, order.controller, GoalEnded(identity, outcome, sentence)))
