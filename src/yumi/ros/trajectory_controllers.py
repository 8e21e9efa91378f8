"""The trajectory actions of the driver: one on the node of each trajectory controller, and one for both arms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from yumi.clock import Clock
from yumi.control.mailbox import Mailbox
from yumi.controllers.dual_arm_trajectory import DualArmTrajectoryController
from yumi.controllers.joint_trajectory import JointTrajectoryController
from yumi.links.ticker import Ticker
from yumi.robot.joints import Side
from yumi.robot.limits import JointLimits
from yumi.ros.controller_nodes import MakeInterface
from yumi.ros.trajectory_action import Ask, Causes, TrajectoryAction

DUAL_ARM = "dual_arm_trajectory_controller"
"""Name of the controllers that follow one trajectory together, and of the node with their action."""


class TrajectoryControllers:
    """Makes the actions, and brings them what their controllers tell.

    Args:
        dual_node: for the action of both arms.
        single: where each arm's trajectory controller lets others see how it follows.
        dual: the same of the dual-arm controller's halves.
        ask: has a request served by the fast line.
        clock: the machine's clock.
        limits: what the joints may do.
        ticker: has feedback passed on.
        causes: knows what stopped the robot.

    Attributes:
        interfaces: what controllers of a kind offer on their nodes.
    """

    def __init__(
        self,
        dual_node: Any,
        single: Mapping[Side, Mailbox],
        dual: Mapping[Side, Mailbox],
        ask: Ask,
        clock: Clock,
        limits: JointLimits,
        ticker: Ticker,
        causes: Causes | None = None,
    ) -> None:
        both = TrajectoryAction(dual_node, DUAL_ARM, dual, ask, clock, limits, ticker, causes)

        def of_one_arm(node: Any, side: Side, name: str) -> TrajectoryAction:
            return TrajectoryAction(node, name, {side: single[side]}, ask, clock, limits, ticker, causes)

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

    def tell(self, notice: Any) -> None:
        self._both.take_notice(self._side, notice)

    def destroy(self) -> None:
        """Nothing of its own."""
