"""The node ``controller_manager`` of one arm: it waits for a robot description, then serves the arm's controllers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import rclpy
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import Executor

from yumi.clock import Clock
from yumi.control.requests import ControllerNotice, Event, FastLineEnded, is_fault
from yumi.errors import YumiError
from yumi.hardware.stops import Cause, explained
from yumi.links.ticker import Ticker
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import Side
from yumi.ros.activity_topic import ActivityTopic
from yumi.ros.arm_controllers import ArmControllers
from yumi.ros.arm_hardware import ArmHardware
from yumi.ros.controller_manager import ControllerManagerServices
from yumi.ros.controller_nodes import ControllerNodes, Line, MakeInterface
from yumi.ros.description_topic import DescriptionWait
from yumi.ros.manager_diagnostics import ManagerDiagnostics
from yumi.ros.manager_parameters import ManagerParameters
from yumi.ros.repeats import Repeats
from yumi.settings import ControllerSettings

Explain = Callable[[Callable[[Cause], None]], None]

RATE = round(1.0 / CYCLE)
"""``update_rate`` [Hz]: the robot's own, 4.032 ms a cycle."""


class ArmManager:
    """One arm's controller manager on the ROS side.

    Args:
        side: which arm.
        line: where the controllers live.
        known: the controllers of ``controllers.yaml``, loaded or not.
        executor: what spins this node and those of the controllers.
        interfaces: what controllers of a kind offer besides parameters.
        clock: the machine's clock.
        ticker: for what has to be asked of the fast line.
        on_look: called whenever the arm's activity is looked at.
    """

    def __init__(
        self,
        side: Side,
        line: Line,
        known: Iterable[ControllerSettings],
        executor: Executor,
        interfaces: Mapping[str, MakeInterface],
        clock: Clock,
        ticker: Ticker,
        on_look: Callable[[], None] = lambda: None,
    ) -> None:
        self.node: Any = rclpy.create_node(
            "controller_manager", namespace=side.value, allow_undeclared_parameters=True, enable_logger_service=True
        )
        self._on_look = on_look
        self._repeats = Repeats(clock)
        self._parameters = ManagerParameters(self.node, RATE, self._repeats.forget)
        self._nodes = ControllerNodes(side, line, executor, interfaces, RATE)
        self._controllers = ArmControllers(side, line, self._nodes, self._parameters, known, self.node.get_logger())
        self._hardware = ArmHardware(side, line)
        self._activity = ActivityTopic(self.node, self._controllers.list, self._hardware.info)
        self._news = self.node.create_guard_condition(self._look, MutuallyExclusiveCallbackGroup())
        executor.add_node(self.node)
        self._wait = DescriptionWait(self.node, side, self._serve)
        self._diagnostics = ManagerDiagnostics(
            self.node,
            self._controllers,
            self._hardware,
            lambda: not self._wait.is_over,
            self._parameters.threshold,
            RATE,
            ticker,
        )

    def tell(self, event: Event, explain: Explain | None = None) -> None:
        """Log what happened in the fast line and look at who is in which state; from any thread.

        Args:
            event: what happened.
            explain: calls back with what stopped the robot, once that is known; a fault is logged with it then.
        """
        if isinstance(event, ControllerNotice):
            self._nodes.tell(event.controller, event.notice)
            return
        if isinstance(event, FastLineEnded):
            self._nodes.tell_all(event)
        log = self.node.get_logger()
        if not is_fault(event):
            log.info(str(event))
        elif explain is None:
            log.error(str(event))
        else:
            explain(lambda cause: log.error(explained(event, cause)))
        self.look()

    def look(self) -> None:
        """Have the executor look whether the activity has changed; from any thread."""
        self._repeats.forget()
        self._news.trigger()

    def destroy(self) -> None:
        """When nothing spins any more."""
        self._nodes.destroy()
        self.node.destroy_node()

    def _look(self) -> None:
        if self._wait.is_over:
            self._update()

    def _update(self) -> None:
        self._activity.update()
        self._on_look()

    def _serve(self) -> None:
        try:
            self._controllers.begin()
        except YumiError as error:
            self.node.get_logger().error(f"The controllers cannot be served: {error}")
            return
        self._services = ControllerManagerServices(
            self.node, self._controllers, self._hardware, self._repeats, RATE, self._update
        )
        self._update()
