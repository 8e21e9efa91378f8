"""The trajectory actions of the driver: one on the node of each trajectory controller, and one for both arms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from yumi.clock import Clock
from yumi.control.mailbox import Mailbox
from yumi.control.requests import ControllerNotice
from yumi.controllers.joint_trajectory import JointTrajectoryController
from yumi.robot.joints import Side
from yumi.robot.limits import JointLimits
from yumi.ros.controller_nodes import MakeInterface
from yumi.ros.trajectory_action import Ask, TrajectoryAction

DUAL_ARM = "dual_arm_trajectory_controller"
"""Name of the controllers that follow one trajectory together, of their node and of their action's."""


class TrajectoryControllers:
    """Makes the actions, and brings them what their controllers tell.

    Args:
        single: where each arm's trajectory controller lets others see how it follows.
        dual: the same of the dual-arm controller's halves.
        ask: has a request served by the fast line.
        clock: the machine's clock.
        limits: what the joints may do.
    """

    def __init__(
        self,
        single: Mapping[Side, Mailbox],
        dual: Mapping[Side, Mailbox],
        ask: Ask,
        clock: Clock,
        limits: JointLimits,
    ) -> None:
        self._single = single
        self._dual = dual
        self._with = (ask, clock, limits)
        self._actions: dict[tuple[Side, str], TrajectoryAction] = {}

    @property
    def interfaces(self) -> Mapping[str, MakeInterface]:
        """What controllers of a kind offer on their nodes."""
        return {JointTrajectoryController.kind: self._make}

    def offer_dual(self, node: Any) -> TrajectoryAction:
        """Serve trajectories for both arms on ``node``."""
        action = TrajectoryAction(node, DUAL_ARM, self._dual, *self._with)
        return self._known(action, tuple(self._dual), DUAL_ARM)

    def tell(self, event: ControllerNotice) -> None:
        """Pass on what a controller told; from any thread."""
        action = self._actions.get((event.side, event.controller))
        if action is not None:
            action.take_notice(event.side, event.notice)

    def _make(self, node: Any, side: Side, name: str) -> TrajectoryAction:
        action = TrajectoryAction(node, name, {side: self._single[side]}, *self._with)
        return self._known(action, (side,), name)

    def _known(self, action: TrajectoryAction, sides: Sequence[Side], name: str) -> TrajectoryAction:
        self._actions |= {(side, name): action for side in sides}
        return action
