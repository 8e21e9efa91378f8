"""The builder of a routine's code: puts steps one after another, each under the statement that is being compiled."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from virtual_irc5.rapid.frame import Code, Evaluate, RoutineFrame, Span, Stack, Step, Target


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

    def replace(self, span: Span, step: Step) -> None:
        """A step in the place of all that a statement has got so far."""
        del self.code.steps[span.start :], self.code.spans[span.start :]
        self.add(step)

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
        def jump(stack: Stack, frame: RoutineFrame) -> None:
            frame.step = target.step

        self.add(jump)

    def jump_if(self, condition: Evaluate, target: Target) -> None:
        def jump_if(stack: Stack, frame: RoutineFrame) -> None:
            if condition(frame):
                frame.step = target.step

        self.add(jump_if)

    def jump_unless(self, condition: Evaluate, target: Target) -> None:
        def jump_unless(stack: Stack, frame: RoutineFrame) -> None:
            if not condition(frame):
                frame.step = target.step

        self.add(jump_unless)

    def store(self, evaluate: Evaluate, slot: int | None = None) -> int:
        """Keep an intermediate result in a slot of its own; returns the slot."""
        index = self.new_slot() if slot is None else slot

        def store(stack: Stack, frame: RoutineFrame) -> None:
            frame.slots[index] = evaluate(frame)

        self.add(store)
        return index
