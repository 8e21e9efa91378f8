"""All instructions, types and data that a RAPID task of one arm finds on the virtual controller."""

from __future__ import annotations

from collections.abc import Sequence

from yumi.rapid.builtins.standard import InstructionSet
from yumi.rapid.library import Library
from yumi.virtual.controller.events import EventLog
from yumi.virtual.controller.signals import Configuration
from yumi.virtual.controller.units import ArmUnit, MechanicalUnit, SyncPoints
from yumi.virtual.instructions.data import add_data
from yumi.virtual.instructions.egm import add_egm
from yumi.virtual.instructions.gripper import add_gripper
from yumi.virtual.instructions.motion import SpeedRatio, add_motion
from yumi.virtual.instructions.system import add_system


def robot_library(
    unit: ArmUnit,
    *,
    configuration: Configuration,
    events: EventLog,
    speed_ratio: SpeedRatio,
    units: Sequence[MechanicalUnit],
    sync_points: SyncPoints,
) -> Library:
    """RAPID's own instructions with those of one arm on top."""
    library = InstructionSet()
    add_data(library, unit.side.unit)
    add_motion(library, unit, speed_ratio)
    add_egm(library, unit, configuration, events)
    add_gripper(library, unit.gripper, events)
    add_system(library, unit, units, configuration, sync_points)
    return library
