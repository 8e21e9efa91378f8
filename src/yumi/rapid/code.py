"""Code: a routine as the machine executes it, a list of small steps that know their statement."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from yumi.rapid.frame import Frame
    from yumi.rapid.machine import Machine

Step = Callable[["Machine", "Frame"], None]
Evaluate = Callable[["Frame"], Any]


@dataclass(eq=False, slots=True)
class Span:
    """The steps of one statement: RETRY goes back to `start`, TRYNEXT on to `end`."""

    line: int
    start: int
    end: int = 0


@dataclass(eq=False, slots=True)
class Target:
    """A place in the code that steps jump to, known once the code has got there."""

    step: int = -1


@dataclass(eq=False, slots=True)
class HandlerCode:
    """The ERROR clause: where it starts and which error numbers it lists (none: all)."""

    start: int
    numbers: tuple[Evaluate, ...]


@dataclass(eq=False, slots=True)
class Code:
    """A compiled routine.

    Attributes:
        spans: for each step, the statement it belongs to.
        slots: how many places a frame needs for parameters, data and intermediate results.
        value_count: how many values the routine's data hold.
    """

    steps: list[Step] = field(default_factory=list)
    spans: list[Span] = field(default_factory=list)
    slots: int = 0
    value_count: int = 0
    handler: HandlerCode | None = None


class CodeBuilder:
    """Puts steps one after another, each under the statement that is being compiled."""

    def __init__(self, line: int) -> None:
        self.code = Code()
        self._span = Span(line, 0)

    @contextmanager
    def statement(self, line: int) -> Iterator[Span]:
        """Everything added inside belongs to a statement that begins here."""
        outer, self._span = self._span, Span(line, len(self.code.steps))
        yield self._span
        self._span.end = len(self.code.steps)
        self._span = outer

    def add(self, step: Step) -> None:
        self.code.steps.append(step)
        self.code.spans.append(self._span)

    def new_slot(self) -> int:
        self.code.slots += 1
        return self.code.slots - 1

    def mark(self, target: Target) -> None:
        """Let `target` be the next step."""
        target.step = len(self.code.steps)

    def here(self) -> Target:
        return Target(len(self.code.steps))

    def jump(self, target: Target) -> None:
        def jump(machine: Machine, frame: Frame) -> None:
            frame.step = target.step

        self.add(jump)

    def jump_unless(self, condition: Evaluate, target: Target) -> None:
        def jump_unless(machine: Machine, frame: Frame) -> None:
            if not condition(frame):
                frame.step = target.step

        self.add(jump_unless)

    def jump_if(self, condition: Evaluate, target: Target) -> None:
        def jump_if(machine: Machine, frame: Frame) -> None:
            if condition(frame):
                frame.step = target.step

        self.add(jump_if)

    def store(self, evaluate: Evaluate, slot: int | None = None) -> int:
        """Keep an intermediate result in a slot of its own."""
        place = self.new_slot() if slot is None else slot

        def store(machine: Machine, frame: Frame) -> None:
            frame.slots[place] = evaluate(frame)

        self.add(store)
        return place
