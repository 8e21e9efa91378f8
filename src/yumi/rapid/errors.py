"""The errors of the RAPID language, and the error numbers a RAPID program can meet in ERRNO.

::

    RapidError
    ├── RapidSyntaxError     the text is not RAPID: mend the module
    ├── RapidReferenceError  a name, type or argument does not fit: mend the module, or load what it refers to
    │   ├── ModuleNameTaken      there is a module of that name: unload it first, or replace it
    │   └── ProgramTooLarge      there is no memory for it: make it smaller, or unload others
    ├── RapidRuntimeError    an execution error with an error number, which an ERROR handler may catch
    ├── UnknownSymbol        no such module or symbol
    └── RapidValueError      a literal does not fit the symbol it was written to
"""

from __future__ import annotations

from yumi.errors import RapidError


class RapidSyntaxError(RapidError):
    """The text is not RAPID; the sentence says where, what was found and what would be allowed."""

    def __init__(self, sentence: str, *, filename: str, line: int, column: int) -> None:
        super().__init__(f"{filename}:{line}:{column}: {sentence}")
        self.filename = filename
        self.line = line
        self.column = column


class RapidReferenceError(RapidError):
    """A name is unknown or used as what it is not; the sentence begins with module and line."""


class ModuleNameTaken(RapidReferenceError):
    """The task has a module of that name already."""


class ProgramTooLarge(RapidReferenceError):
    """The task has no memory for it."""


class UnknownSymbol(RapidError):
    """The task has no such module, or the module no such symbol."""


class RapidValueError(RapidError):
    """A literal is not a value of the type it should have; nothing was changed."""


class RapidRuntimeError(RapidError):
    """An execution error; instructions raise it to start RAPID's error handling.

    Attributes:
        name: the error's name, such as "ERR_UDPUC_COMM", or "" for a number raised by the program itself. A name that
            is not registered is fatal: no handler can take it.
        number: the value of ERRNO, or None until the task has looked the name up.
    """

    def __init__(self, name: str, sentence: str, *, number: float | None = None) -> None:
        super().__init__(sentence)
        self.name = name
        self.number = number
