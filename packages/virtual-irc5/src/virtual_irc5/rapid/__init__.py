"""RAPID, the language of ABB's IRC5: parser and interpreter, without any robot.

A host registers the robot's instructions in an `InstructionSet`, on top of those that RAPID provides here, and lets a
`Task` load modules and advance.
"""

from virtual_irc5.rapid.builtins.absent_options import OPTIONS
from virtual_irc5.rapid.builtins.data import DATA
from virtual_irc5.rapid.builtins.data_by_name import SYMBOLS
from virtual_irc5.rapid.builtins.disk_files import FILES
from virtual_irc5.rapid.builtins.execution import EXECUTION
from virtual_irc5.rapid.builtins.flexpendant import DIALOGS
from virtual_irc5.rapid.builtins.information import INFORMATION
from virtual_irc5.rapid.builtins.interrupt_instructions import INTERRUPTS
from virtual_irc5.rapid.builtins.io_signals import SIGNALS
from virtual_irc5.rapid.builtins.maths import MATHS
from virtual_irc5.rapid.builtins.message_queues import QUEUES
from virtual_irc5.rapid.builtins.module_loading import MODULES
from virtual_irc5.rapid.builtins.rawbytes import RAWBYTES
from virtual_irc5.rapid.builtins.sockets import SOCKETS
from virtual_irc5.rapid.builtins.strings import STRINGS
from virtual_irc5.rapid.call import Call, Wait
from virtual_irc5.rapid.rapid_library import ROBOTWARE_NAMES, Library
from virtual_irc5.rapid.types import RapidRuntimeError

__all__ = [
    "ROBOTWARE_NAMES",
    "STANDARD",
    "Call",
    "InstructionSet",
    "Library",
    "RapidRuntimeError",
    "Wait",
]

STANDARD = Library(DATA)
"""All instructions, functions, types and data that RAPID provides here."""
for _part in (
    MATHS,
    STRINGS,
    SIGNALS,
    RAWBYTES,
    SOCKETS,
    FILES,
    DIALOGS,
    INFORMATION,
    SYMBOLS,
    QUEUES,
    EXECUTION,
    INTERRUPTS,
    MODULES,
    OPTIONS,
):
    STANDARD.include(_part)


class InstructionSet(Library):
    """The names every module of a task sees: RAPID's own, and what the host registers on top of them."""

    def __init__(self) -> None:
        super().__init__(STANDARD)
