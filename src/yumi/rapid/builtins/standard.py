"""The instructions a host builds on: what RAPID provides here, and the names of what RobotWare 6 base has besides."""

from __future__ import annotations

from yumi.rapid.builtins.constants import CONSTANTS
from yumi.rapid.builtins.data import DATA, MATHS
from yumi.rapid.builtins.dialogs import DIALOGS
from yumi.rapid.builtins.execution import EXECUTION
from yumi.rapid.builtins.files import FILES
from yumi.rapid.builtins.information import INFORMATION
from yumi.rapid.builtins.matrices import MATRICES
from yumi.rapid.builtins.names import CONSTANTS as NAMES_OF_CONSTANTS
from yumi.rapid.builtins.names import FUNCTIONS, INSTRUCTIONS, TYPES
from yumi.rapid.builtins.options import OPTIONS
from yumi.rapid.builtins.queues import QUEUES
from yumi.rapid.builtins.rawbytes import RAWBYTES
from yumi.rapid.builtins.signals import SIGNALS
from yumi.rapid.builtins.sockets import SOCKETS
from yumi.rapid.builtins.strings import STRINGS
from yumi.rapid.builtins.symbols import SYMBOLS
from yumi.rapid.builtins.system import SYSTEM
from yumi.rapid.library import Library

STANDARD = Library(DATA)
for _part in (
    *(
        CONSTANTS,
        MATHS,
        STRINGS,
        SIGNALS,
        SYSTEM,
        RAWBYTES,
        SOCKETS,
        FILES,
        DIALOGS,
        INFORMATION,
        SYMBOLS,
        QUEUES,
        EXECUTION,
        MATRICES,
        OPTIONS,
    ),
):
    STANDARD.include(_part)
STANDARD.missing(*INSTRUCTIONS, *FUNCTIONS, *TYPES, *NAMES_OF_CONSTANTS)  # except those that are provided


class InstructionSet(Library):
    """The names every module of a task sees: RAPID's own, and what the host registers on top of them."""

    def __init__(self, base: Library = STANDARD) -> None:
        super().__init__(base)
