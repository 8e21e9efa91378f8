"""WaitUntil: the one instruction whose argument is looked at again and again."""

from __future__ import annotations

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from yumi.rapid import syntax as s
from yumi.rapid.calls import Calls
from yumi.rapid.code import Evaluate, Step, Target
from yumi.rapid.errors import RapidRuntimeError
from yumi.rapid.library import Call, LibraryRoutine

if TYPE_CHECKING:
    from yumi.rapid.frame import Frame
    from yumi.rapid.machine import Machine

SIGNATURE = r"\switch InPos, bool Cond, \num MaxTime, \VAR bool TimeFlag, \num PollRate"
CONDITION = 1  # the place of Cond among the parameters


@dataclass(frozen=True, slots=True)
class Deadline:
    r"""The end of a wait with \MaxTime and \TimeFlag.

    Attributes:
        time: task time [s], infinite without \MaxTime.
    """

    call: Call
    time: float

    @staticmethod
    def of(call: Call) -> Deadline:
        return Deadline(call, call.task.now + call.get("MaxTime", math.inf))

    def is_over(self) -> bool:
        r"""Whether the time is up; sets \TimeFlag, or raises ERR_WAIT_MAXTIME without one."""
        if self.call.task.now < self.time:
            return False
        if not self.call.present("TimeFlag"):
            sentence = f"{self.call.name} has waited for {self.call['MaxTime']:g} s in vain."
            raise RapidRuntimeError("ERR_WAIT_MAXTIME", sentence)
        self.call["TimeFlag"] = True
        return True

    def met(self) -> None:
        """Note that what was waited for has come."""
        if self.call.present("TimeFlag"):
            self.call["TimeFlag"] = False

    @property
    def wake(self) -> float | None:
        return None if math.isinf(self.time) else self.time


def wait_until(calls: Calls, node: s.ProcedureCall) -> None:
    """Add the steps of WaitUntil: the condition, whatever it calls, is computed anew at each advance."""
    builder = calls.expressions.builder(node.line)
    library = calls.scope.program.library
    instruction = LibraryRoutine("WaitUntil", library.formal(SIGNATURE), None, lambda call: None, may_wait=False)
    conditions = [a for a in node.arguments if not a.is_optional and a.value is not None]
    if len(conditions) != 1 or conditions[0].value is None:
        calls.scope.blame(node.line, "WaitUntil needs one condition")
    placeholder = s.Argument(None, s.Literal(True, node.line), False, node.line)
    given = [placeholder if a is conditions[0] else a for a in node.arguments]
    call = calls.caller(instruction, calls.arguments(instruction, given, node.line))
    slot = builder.store(lambda frame: Deadline.of(call(frame)))
    again = builder.here()
    condition = calls.expressions.condition(conditions[0].value)
    builder.add(_deciding(condition, slot, again))


def _deciding(condition: Evaluate, slot: int, again: Target) -> Step:
    def decide(machine: Machine, frame: Frame) -> None:
        deadline: Deadline = frame.slots[slot]
        if deadline.call.task.is_settled(deadline.call) and condition(frame):
            deadline.met()
        elif not deadline.is_over():
            frame.begin_wait(_until_next_look(deadline), None, None)
            frame.step = again.step

    return decide


def _until_next_look(deadline: Deadline) -> Generator[float | None, None, None]:
    yield deadline.wake
