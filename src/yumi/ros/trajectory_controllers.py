"""The trajectory actions of the driver: one on the node of each trajectory controller, and one for both arms."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from yumi.clock import Clock
from yumi.control.mailbox import Mailbox
from yumi.controllers.dual_arm_trajectory import DualArmTrajectoryController
from yumi.controllers.joint_trajectory import JointTrajectoryController
from yumi.robot.joints import Side
from yumi.robot.limits import JointLimits
from yumi.ros.controller_nodes import MakeInterface
from yumi.ros.trajectory_action import Ask, TrajectoryAction

DUAL_ARM = "dual_arm_trajectory_controller"
"""Name of the controllers that follow one trajectory together, of their node and of their action's."""


@dataclass(frozen=True, slots=True)
class Part:
    """An arm's controller's part of an action.

    Attributes:
        action: its own, or the common one of both arms.
        side: the arm.
    """

    action: TrajectoryAction
    side: Side

    def tell(self, notice: object) -> None:
        """Pass on what the controller told; from any thread."""
        self.action.take_notice(self.side, notice)

    def destroy(self) -> None:
        """End the action when it is the controller's own."""
        if not self.action.is_common:
            self.action.destroy()


class TrajectoryControllers:
    """The actions by the kind of their controllers.

    Args:
        node: of the action for both arms.
        single: where each arm's trajectory controller lets others see how it follows.
        dual: the same of the dual-arm controller's halves.
        ask: has a request served by the fast line.
        clock: the machine's clock.
        limits: what the joints may do.
    """

    def __init__(
        self,
        node: Any,
        single: Mapping[Side, Mailbox],
        dual: Mapping[Side, Mailbox],
        ask: Ask,
        clock: Clock,
        limits: JointLimits,
    ) -> None:
        self._single = single
        self._with = (ask, clock, limits)
        self._dual = TrajectoryAction(node, DUAL_ARM, dual, *self._with)

    @property
    def interfaces(self) -> Mapping[str, MakeInterface]:
        """What controllers of a kind offer on their nodes."""
        return {JointTrajectoryController.kind: self._make, DualArmTrajectoryController.kind: self._halve}

    def destroy(self) -> None:
        """End the action for both arms; goals that are open are aborted."""
        self._dual.destroy()

    def _make(self, node: Any, side: Side, name: str) -> Part:
        return Part(TrajectoryAction(node, name, {side: self._single[side]}, *self._with), side)

    def _halve(self, node: Any, side: Side, name: str) -> Part:
        return Part(self._dual, side)
