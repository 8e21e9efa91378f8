"""The library of one task: RAPID's own instructions, with those of its robot and its controller on top."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from virtual_irc5.controller_log import ControllerEventLog
from virtual_irc5.instructions.calibration import CALIBRATION, CalibrationInstructions
from virtual_irc5.instructions.egm_instructions import EGM, EgmInstructions
from virtual_irc5.instructions.measurements import MEASUREMENTS, MeasurementInstructions
from virtual_irc5.instructions.mechanical_units import UNITS, UnitInstructions
from virtual_irc5.instructions.motion_settings import SETTINGS, MotionSettingInstructions
from virtual_irc5.instructions.moves import (
    MOVES,
    MOVING,
    SYNCHRONIZED_MOVES,
    MoveInstructions,
    SpeedRatio,
    refuse_motion,
)
from virtual_irc5.instructions.multimove import MULTIMOVE, MultiMoveInstructions, SyncPoints
from virtual_irc5.instructions.path_corrections import CORRECTIONS, PathCorrections
from virtual_irc5.instructions.path_recorder import RECORDER, PathRecorder
from virtual_irc5.instructions.poses import POSES
from virtual_irc5.instructions.robot_data import ROBOT_DATA
from virtual_irc5.instructions.smart_gripper import GRIPPER, GripperInstructions
from virtual_irc5.instructions.triggers import TRIGGERS, TriggerInstructions
from virtual_irc5.instructions.world_zones import ZONES, WorldZoneInstructions
from virtual_irc5.mechanics.units import ArmUnit, MechanicalUnit
from virtual_irc5.rapid import InstructionSet, Library
from virtual_irc5.system_parameters import SystemConfiguration


def robot_library(
    unit: ArmUnit,
    *,
    configuration: SystemConfiguration,
    events: ControllerEventLog,
    speed_ratio: SpeedRatio,
    units: Sequence[MechanicalUnit],
    sync_points: SyncPoints,
    is_motion_task: bool,
    robots: Sequence[ArmUnit],
    units_of_tasks: Mapping[str, ArmUnit],
) -> Library:
    """The library of a task that moves an arm; a task without motion may read where the arm is.

    Args:
        unit: the arm.
        configuration: the system parameters.
        events: the controller's event log.
        speed_ratio: the speed override of the controller [%].
        units: all mechanical units of the controller.
        sync_points: where tasks wait for one another.
        is_motion_task: whether the task may move the arm.
        robots: the arms of all tasks.
        units_of_tasks: the arms of all motion tasks by name, whose positions the task reads too.
    """
    moves = MoveInstructions(unit, speed_ratio, events, units_of_tasks)
    settings = MotionSettingInstructions(moves, robots, is_motion_task=is_motion_task)
    corrections = PathCorrections(unit, events)
    moves.program_offset = corrections.total
    multimove = MultiMoveInstructions(unit, sync_points)
    library = InstructionSet()
    library.include(ROBOT_DATA)
    library.include(POSES)
    library.include(MOVES, moves)
    library.include(SETTINGS, settings)
    library.include(TRIGGERS, TriggerInstructions(moves))
    library.include(ZONES, WorldZoneInstructions(unit))
    library.include(MEASUREMENTS, MeasurementInstructions(unit, robots))
    library.include(CALIBRATION, CalibrationInstructions(moves))
    library.include(RECORDER, PathRecorder(moves))
    library.include(CORRECTIONS, corrections)
    library.include(UNITS, UnitInstructions(unit, units))
    library.include(MULTIMOVE, multimove)
    if is_motion_task:
        library.include(EGM, EgmInstructions(moves, corrections, configuration))
        library.wrap(SYNCHRONIZED_MOVES, multimove.synchronized)
        if unit.arm.kinematics.is_of_yumi:
            library.include(GRIPPER, GripperInstructions(unit.gripper, events))
    else:
        library.wrap(MOVING, lambda _: refuse_motion)
    library.object_type("mecunit", lambda: units[0])
    for each in units:
        library.data(each.name, "mecunit", each)
        if each.name == unit.mechanical_unit:
            library.data("ROB_ID", "mecunit", each)
    library.live_data("C_MOTSET", "motsetdata", settings.motion_settings)
    library.live_data("C_PROGDISP", "progdisp", settings.displacements)
    return library
