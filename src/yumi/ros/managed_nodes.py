"""The managed nodes of the driver: ``yumi_robot``, ``r/arm``, ``r/gripper`` (and both for l), led up in this order.

The robot manager's own node is none of them: its ``get_state`` is the thesis's, and a managed node's has another type.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from yumi.robot.joints import Side
from yumi.ros.arm_hardware import ArmHardware
from yumi.ros.controller_nodes import Line
from yumi.ros.lives import ArmLife, Connection, Fingers, GripperLife, RobotLife, Stopping
from yumi.ros.managed_node import ManagedNode
from yumi.ros.permission import Permission

ROBOT = "yumi_robot"
ARM = "arm"
GRIPPER = "gripper"


class ManagedNodes:
    """All of them.

    Args:
        connection: the way to the controller.
        manager: what stops the robot.
        line: where the arms' hardware components live.
        grippers: both hands.
        on_change: called after each transition.

    Attributes:
        permission: what they permit together.
        grippers: those of the hands, which have the hands' actions.
    """

    def __init__(
        self,
        connection: Connection,
        manager: Stopping,
        line: Line,
        grippers: Mapping[Side, Fingers],
        on_change: Callable[[], None],
    ) -> None:
        self._robot = ManagedNode(ROBOT, RobotLife(connection, manager, line, grippers.values()), on_change)
        self._hardware = {side: ArmHardware(side, line) for side in Side}
        self._arms = {
            side: ManagedNode(ARM, ArmLife(side, hardware), on_change, side.value)
            for side, hardware in self._hardware.items()
        }
        self.grippers = {
            side: ManagedNode(GRIPPER, GripperLife(side, gripper), on_change, side.value)
            for side, gripper in grippers.items()
        }
        self.permission = Permission(self._robot, self._arms)

    @property
    def all(self) -> list[Any]:
        """Every node, in the order in which they are led up."""
        return [self._robot, *self._arms.values(), *self.grippers.values()]

    @property
    def is_connected(self) -> bool:
        """Whether the robot may be asked."""
        return self._robot.why_not_configured() is None

    def bring_up(self) -> None:
        """Configure and activate all, as far as that goes; the log says why one does not."""
        for node in self.all:
            node.bring_up()

    def follow_hardware(self, side: Side) -> None:
        """Lead an arm's node where its hardware component has been led by a controller manager's service."""
        self._arms[side].follow(lambda: self._hardware[side].state)

    def may_ask_hand(self, side: Side) -> bool:
        """Whether a hand may be asked."""
        return self.is_connected and self.grippers[side].why_not_configured() is None

    def why_no_grip(self, side: Side) -> str | None:
        """Why a hand takes no goals; None when it does."""
        return self.permission.to_move() or self.grippers[side].why_not_active()

    def destroy(self) -> None:
        """When nothing spins any more."""
        for node in self.all:
            node.destroy_node()
