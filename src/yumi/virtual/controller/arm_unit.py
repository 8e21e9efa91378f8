"""One arm of the virtual robot with its EGM client and gripper, as its RAPID task sees it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from yumi.robot.joints import Side
from yumi.virtual.controller.egm import EgmClient
from yumi.virtual.mechanics.arm import VirtualArm
from yumi.virtual.mechanics.gripper import VirtualGripper


@dataclass(slots=True)
class ArmUnit:
    """What the instructions of one task act on.

    Attributes:
        arm: the arm.
        egm: its EGM client.
        gripper: its gripper.
        has_moved: whether a RAPID motion has run since the controller started; EGM wants that before its first run.
        egm_identities: names of the variables that hold an EGM identity.
        egm_device: name of the UDPUC device EGMSetupUC chose last.
        tool, wobj: RAPID values of the last motion's tool and work object; None until there was one.
    """

    arm: VirtualArm
    egm: EgmClient
    gripper: VirtualGripper
    has_moved: bool = False
    egm_identities: set[str] = field(default_factory=set)
    egm_device: str = ""
    tool: Any = None
    wobj: Any = None

    def __post_init__(self) -> None:
        self.egm_device = self.egm_device or self.arm.side.unit

    def forget_egm(self) -> None:
        """The controller restarts: all state of EGM is lost."""
        self.egm.power_down()
        self.egm_identities.clear()
        self.has_moved = False

    @property
    def side(self) -> Side:
        return self.arm.side
