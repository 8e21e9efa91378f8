"""RAPID's instructions of modules: loading, unloading, checking and saving them, and calling their routines by name."""

from __future__ import annotations

from concurrent.futures import Future
from dataclasses import dataclass

from abb_protocols.errors import RobotNotReady
from virtual_irc5.rapid.ast import Module
from virtual_irc5.rapid.builtins.data import DATA
from virtual_irc5.rapid.builtins.information import OF_TASK
from virtual_irc5.rapid.call import Call, Wait
from virtual_irc5.rapid.loading import saved_text
from virtual_irc5.rapid.parser import parse_module
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.task import Task, task_of, task_of_argument
from virtual_irc5.rapid.types import (
    ProgramTooLarge,
    RapidReferenceError,
    RapidRuntimeError,
    RapidSyntaxError,
    UnknownSymbol,
    raised_as,
)

MODULES = Library(DATA)


def _path_argument(call: Call, path: str = "FilePath", file: str = "File") -> str:
    given: str = call[path]
    return f"{given.rstrip('/')}/{call[file]}" if call.present(file) else given


@MODULES.instruction("CallByVar", "string Name, num Number")
def _call_by_variable(call: Call) -> None:
    task_of(call).call_procedure(f"{call['Name']}{int(call['Number'])}")


@MODULES.instruction("Load", r"\switch Dynamic, string FilePath, \string File, \switch CheckRef")
def _load_module(call: Call) -> Wait:
    task, path = task_of(call), _path_argument(call)
    text = _module_text(task, path)
    yield from _load(task, text, path)


@MODULES.instruction("UnLoad", r"\switch ErrIfChanged | \switch Save, string FilePath, \string File")
def _unload_module(call: Call) -> None:
    task, path = task_of(call), _path_argument(call)
    found = next((m for m in task.modules if m.filename == path), None)
    if found is None:
        raise RapidRuntimeError("ERR_UNLOAD", f"No module was loaded from '{path}'.")
    with raised_as("ERR_UNLOAD", RobotNotReady):
        task.unload(found.name)


def _module_text(task: Task, path: str) -> str:
    """The text of a module's file; raises ERR_FILNOTFND."""
    with raised_as("ERR_FILNOTFND", OSError, before=f"The file '{path}' cannot be read: "):
        return task.host.read_file(path)


def _load(task: Task, text: str, path: str) -> Wait:
    """Load a module's text; raises ERR_SYNTAX, ERR_PRGMEMFULL or ERR_LOADED."""
    with (
        raised_as("ERR_LOADED", RapidReferenceError),
        raised_as("ERR_PRGMEMFULL", ProgramTooLarge),
        raised_as("ERR_SYNTAX", RapidSyntaxError),
    ):
        yield from task.loading(text, path)


@MODULES.function("ModExist", "string ModuleName", "bool")
def _module_exists(call: Call) -> bool:
    return call["ModuleName"].lower() in task_of(call).program.modules


@MODULES.instruction("EraseModule", "string ModuleName")
def _erase_module(call: Call) -> None:
    with raised_as("ERR_MODULE", UnknownSymbol, RobotNotReady):
        task_of(call).unload(call["ModuleName"])


@MODULES.instruction("CheckProgRef")
def _check_references(call: Call) -> None:
    faults = task_of(call).faults()
    if faults:
        raise RapidRuntimeError("ERR_LINKREF", str(faults[0]))


@dataclass(eq=False, slots=True)
class LoadSession:
    """What a loadsession stands for: a module that is being read in the background."""

    path: str = ""
    text: str = ""
    work: Future[Module] | None = None


MODULES.object_type("loadsession", LoadSession)


@MODULES.instruction("StartLoad", r"\switch Dynamic, string FilePath, \string File, VAR loadsession LoadNo")
def _start_load(call: Call) -> None:
    session, path = call["LoadNo"], _path_argument(call)
    if session.work is not None:
        raise RapidRuntimeError("ERR_LOADNO_INUSE", f"{call.reference('LoadNo').name} is loading {session.path}.")
    session.text = _module_text(task_of(call), path)
    session.path = path
    session.work = call.task.background(lambda: parse_module(session.text, path))


@MODULES.instruction("WaitLoad", r"\string UnloadPath, \string UnloadFile, VAR loadsession LoadNo, \switch CheckRef")
def _wait_load(call: Call) -> Wait:
    session, task = call["LoadNo"], task_of(call)
    if session.work is None:
        raise RapidRuntimeError("ERR_LOADNO_NOUSE", f"{call.reference('LoadNo').name} is not loading anything.")
    while not session.work.done():
        yield None
    session.work = None
    if call.present("UnloadPath"):
        path = _path_argument(call, "UnloadPath", "UnloadFile")
        old = next((module for module in task.modules if module.filename == path), None)
        with raised_as("ERR_UNLOAD", UnknownSymbol, RobotNotReady, before=f"'{path}' cannot be unloaded: "):
            task.unload(old.name if old else "")
    yield from _load(task, session.text, session.path)
    if call.present("CheckRef"):
        _check_references(call)


@MODULES.instruction("CancelLoad", "VAR loadsession LoadNo")
def _cancel_load(call: Call) -> None:
    session = call["LoadNo"]
    if session.work is None:
        raise RapidRuntimeError("ERR_LOADNO_NOUSE", f"{call.reference('LoadNo').name} is not loading anything.")
    session.work = None


@MODULES.instruction("Save", rf"{OF_TASK}, string ModuleName, \string FilePath, \string File")
def _save_module(call: Call) -> None:
    """A module's text into a file, its persistents with the values they have now."""
    task = task_of_argument(call)
    module = task.program.modules.get(call["ModuleName"].lower())
    if module is None:
        raise RapidRuntimeError("ERR_MODULE", f"The task {task.name} has no module '{call['ModuleName']}'.")
    path = _path_argument(call) if call.present("FilePath") else module.syntax.filename
    with raised_as("ERR_IOERROR", OSError, before=f"'{path}' cannot be written: "):
        task.host.devices.disk.write(path, saved_text(module).encode("latin-1", "replace"))
