"""RAPID, the language of ABB's IRC5: parser and interpreter; knows no robot.

A host registers the robot's instructions in an `InstructionSet`, and lets a `Task` load modules and advance.
"""

from yumi.rapid.ast import Module
from yumi.rapid.builtins.execution import InstructionSet
from yumi.rapid.library import Call, Wait
from yumi.rapid.parser import parse_module
from yumi.rapid.program import EventKind, Execution, Host, TaskEvent
from yumi.rapid.task import ModuleInfo, Task
from yumi.rapid.types import (
    RapidReferenceError,
    RapidRuntimeError,
    RapidSyntaxError,
    RapidValueError,
    Signal,
    UnknownSymbol,
)

__all__ = [
    "Call",
    "EventKind",
    "Execution",
    "Host",
    "InstructionSet",
    "Module",
    "ModuleInfo",
    "RapidReferenceError",
    "RapidRuntimeError",
    "RapidSyntaxError",
    "RapidValueError",
    "Signal",
    "Task",
    "TaskEvent",
    "UnknownSymbol",
    "Wait",
    "parse_module",
]
