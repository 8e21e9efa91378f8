"""The mechanical units of the YuMi: two arms of six axes, each with a seventh that is a unit of its own."""

from __future__ import annotations

from dataclasses import dataclass

from yumi.robot.joints import Side

NO_UNIT = "NoIntegratedUnit"
"""ABB's word for "none" in the two integration fields."""


@dataclass(frozen=True, slots=True)
class MechanicalUnit:
    """What a client may read about a mechanical unit (reference/statemachine.md §9, reference/rws.md §8.2).

    Attributes:
        name: e.g. ``ROB_R`` or ``ROB_R_7``.
        side: the arm it belongs to.
        type: ``TCPRobot`` or ``Single``.
        axes: axes of its own.
        axes_total: axes with those of the unit integrated in it.
        is_integrated_unit: the unit this one is integrated in, or :data:`NO_UNIT`.
        has_integrated_unit: the unit that is integrated in this one, or :data:`NO_UNIT`.
        drive_module: number of its drive module.
        status, mode, tool, wobj, payload, total_payload, jog_mode, coord_system: what jogging would use.
    """

    name: str
    side: Side
    type: str
    axes: int
    axes_total: int
    is_integrated_unit: str
    has_integrated_unit: str
    drive_module: int = 1
    status: str = "Synchronized"
    mode: str = "Activated"
    tool: str = "tool0"
    wobj: str = "wobj0"
    payload: str = "load0"
    total_payload: str = "load0"
    jog_mode: str = "AxisGroup1"
    coord_system: str = "World"

    @property
    def task(self) -> str:
        """The RAPID task that moves it."""
        return self.side.task


def _arm(side: Side) -> MechanicalUnit:
    return MechanicalUnit(side.unit, side, "TCPRobot", 6, 7, NO_UNIT, f"{side.unit}_7")


def _seventh_axis(side: Side) -> MechanicalUnit:
    return MechanicalUnit(f"{side.unit}_7", side, "Single", 1, 1, side.unit, NO_UNIT)


YUMI_UNITS = (
    _arm(Side.RIGHT),
    _arm(Side.LEFT),
    _seventh_axis(Side.RIGHT),
    _seventh_axis(Side.LEFT),
)
