"""The data types and predefined data of the robot's instructions, beside RAPID's own."""

from __future__ import annotations

from dataclasses import dataclass

from yumi.rapid.library import Library
from yumi.virtual.egm_adapter import EgmState
from yumi.virtual.egm_settings import StopMode
from yumi.virtual.mechanical_units import YUMI_UNITS

_FRAME_TYPES = ("BASE", "TOOL", "WOBJ", "WORLD", "JOINT")


@dataclass(eq=False, slots=True)
class EgmIdentity:
    """What an egmident stands for; the station knows by the variable's name which ones are reserved."""


@dataclass(eq=False, slots=True)
class SyncPoint:
    """What a syncident stands for: tasks meet at its name, so it holds nothing."""


def add_data(library: Library, own_unit: str) -> None:
    """Register types and data; ``ROB_ID`` is the arm of the task."""
    library.object_type("egmident", EgmIdentity)
    library.object_type("syncident", SyncPoint)
    library.object_type("mecunit", lambda: YUMI_UNITS[0])
    for name in ("egmstate", "egmstopmode", "egmframetype"):
        library.alias(name, "num")
    library.record("egm_minmax", {"min": "num", "max": "num"})
    library.record("tasks", {"taskname": "string"})
    _add_egm(library)
    for unit in YUMI_UNITS:
        library.data(unit.name, "mecunit", unit)
        if unit.name == own_unit:
            library.data("ROB_ID", "mecunit", unit)


def _add_egm(library: Library) -> None:
    for state in EgmState:
        library.data(f"EGM_STATE_{state.name}", "egmstate", float(state))
    for mode in StopMode:
        library.data(f"EGM_STOP_{mode.name}", "egmstopmode", float(mode.value))
    for number, name in enumerate(_FRAME_TYPES):
        library.data(f"EGM_FRAME_{name}", "egmframetype", float(number))
