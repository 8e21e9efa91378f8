"""Late binding: `%"name"% arguments;`, the procedure looked up each time the statement runs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from yumi.rapid import syntax as s
from yumi.rapid.calls import Calls, entering
from yumi.rapid.code import Evaluate, Step
from yumi.rapid.errors import RapidReferenceError, RapidRuntimeError
from yumi.rapid.library import LibraryRoutine
from yumi.rapid.scope import UserRoutine

if TYPE_CHECKING:
    from yumi.rapid.frame import Frame
    from yumi.rapid.machine import Machine


def late_call(calls: Calls, name: Evaluate, node: s.LateCall) -> Step:
    """The step that calls whatever procedure `name` gives."""
    scope = calls.scope
    if any(a.value is not None and calls.expressions.runs_routine(a.value) for a in node.arguments):
        scope.blame(node.line, "the arguments of a late-binding call cannot call routines; use a variable")
    known = dict(scope.locals)

    def call(machine: Machine, frame: Frame) -> None:
        called = name(frame)
        found = scope.program.find(called, scope.module)
        if not isinstance(found, (UserRoutine, LibraryRoutine)):
            raise RapidRuntimeError("ERR_REFUNKPRC", f"There is no procedure '{called}' to call.")
        scope.locals, calls.expressions.count = known, 0
        try:
            arguments = calls.arguments(found, node.arguments, node.line)
        except RapidReferenceError as error:
            raise RapidRuntimeError("ERR_CALLPROC", str(error)) from error
        entering(found, arguments, None)(machine, frame)

    return call
