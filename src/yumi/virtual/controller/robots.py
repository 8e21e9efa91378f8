"""The robots that the virtual controller knows: data, each with a set of system parameters of its own (``stock``)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import yumi.virtual.controller
from yumi.robot.arms import Arm, irb120, irb14050, yumi_arm
from yumi.robot.joints import Side
from yumi.virtual.controller.units import NO_UNIT, YUMI_OPTIONS, YUMI_UNITS, MechanicalUnit

_STOCK = Path(next(iter(yumi.virtual.controller.__path__)))
_OPTIONS = (
    "RobotWare Base",
    "English",
    "623-1 Multitasking",
    "709-1 DeviceNet Master/Slave",
    "617-1 FlexPendant Interface",
    "616-1 PC Interface",
    "608-1 World Zones",
    "611-1 Path Recovery",
    "612-1 Path Offset",
    "689-1 Externally Guided Motion (EGM)",
    "UDPUC Driver",
)


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot and what its controller is delivered with.

    Attributes:
        name: as `yumi controller --robot` has it.
        title: ABB's name.
        arms: kinematics of each arm; a robot with one arm has the right one's place.
        units: its mechanical units, the first of each arm being the robot itself.
        options: of the controller.
        stock: directory of its system parameters.
        is_yumi: whether it has grippers, and runs the state machine of this package.
    """

    name: str
    title: str
    arms: Mapping[Side, Callable[[], Arm]]
    units: tuple[MechanicalUnit, ...]
    options: tuple[str, ...]
    stock: Path
    is_yumi: bool = False

    def unit_of(self, side: Side) -> str:
        """Name of the mechanical unit of an arm."""
        return next(unit.name for unit in self.units if unit.side is side)


YUMI = Robot(
    "yumi",
    "IRB 14000-0.5/0.5",
    {side: lambda side=side: yumi_arm(side) for side in Side},  # type: ignore[misc]
    YUMI_UNITS,
    YUMI_OPTIONS,
    _STOCK / "stock",
    is_yumi=True,
)
ROBOTS: Mapping[str, Robot] = {
    robot.name: robot
    for robot in (
        YUMI,
        Robot(
            "irb14050",
            "IRB 14050-0.5/0.5",
            {Side.RIGHT: irb14050},
            (
                MechanicalUnit("ROB_1", Side.RIGHT, "TCPRobot", 6, 7, NO_UNIT, "ROB_1_7", motion_task="T_ROB1"),
                MechanicalUnit("ROB_1_7", Side.RIGHT, "Single", 1, 1, "ROB_1", NO_UNIT, motion_task="T_ROB1"),
            ),
            (*_OPTIONS, "Drive System IRB 14050", "IRB 14050-0.5/0.5"),
            _STOCK / "stock_irb14050",
        ),
        Robot(
            "irb120",
            "IRB 120-3/0.6",
            {Side.RIGHT: irb120},
            (MechanicalUnit("ROB_1", Side.RIGHT, "TCPRobot", 6, 6, NO_UNIT, NO_UNIT, motion_task="T_ROB1"),),
            (*_OPTIONS, "Drive System IRB 120", "IRB 120-3/0.6"),
            _STOCK / "stock_irb120",
        ),
    )
}
"""By name."""
