"""Calls: arguments matched to parameters, and the steps that enter a routine or run an instruction."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from typing import TYPE_CHECKING

from yumi.rapid import syntax as s
from yumi.rapid.code import Evaluate, Step
from yumi.rapid.data import ABSENT, Part, Place, Variable
from yumi.rapid.expressions import Compiled, Expressions
from yumi.rapid.library import Call, FormalParameter, LibraryRoutine
from yumi.rapid.scope import Local, UserRoutine
from yumi.rapid.types import SWITCH, ObjectType, Signal, SignalType, Type, is_assignable, one, resolved

if TYPE_CHECKING:
    from yumi.rapid.frame import Frame
    from yumi.rapid.machine import Machine

GetPlace = Callable[["Frame"], Place]
Routine = UserRoutine | LibraryRoutine


class Places:
    """Compiles references to data that are written to."""

    def __init__(self, expressions: Expressions) -> None:
        self.expressions = expressions
        self.scope = expressions.scope

    def writable(self, node: s.Reference, storage: Sequence[s.Storage]) -> tuple[GetPlace, Type]:
        """Where the reference leads; raises RapidReferenceError when it may not be written to."""
        root = node
        while not isinstance(root, s.Name):
            root = root.base
        found = self.scope.find(root.name, root.line)
        if isinstance(found, Local):
            is_writable = not found.is_constant
        else:
            is_writable = isinstance(found, Variable) and found.storage in storage
        if not is_writable:
            self.scope.blame(root.line, f"'{root.name}' cannot be changed here")
        return self.place(node)

    def place(self, node: s.Reference) -> tuple[GetPlace, Type]:
        """Where the reference leads, and its type."""
        if isinstance(node, s.Name):
            return self._entire(node)
        get_whole, type_ = self.place(node.base)
        if isinstance(node, s.Field):
            index, component = self.expressions.component(type_, node)
            return lambda frame: Part(get_whole(frame), (index,), component), component
        path, element = self.expressions.index(type_, node)

        def element_place(frame: Frame) -> Place:
            whole = get_whole(frame)
            return Part(whole, path(frame, whole.value), element)

        return element_place, element

    def _entire(self, node: s.Name) -> tuple[GetPlace, Type]:
        found = self.scope.find(node.name, node.line)
        if isinstance(found, Local):
            slot = found.slot
            return lambda frame: frame.slots[slot], found.type
        if isinstance(found, Variable):
            return lambda frame: found, found.type
        self.scope.blame(node.line, f"'{node.name}' is not a variable")


WRITABLE = {
    s.Mode.VAR: (s.Storage.VAR,),
    s.Mode.PERS: (s.Storage.PERS,),
    s.Mode.INOUT: (s.Storage.VAR, s.Storage.PERS),
}


class Calls:
    """Compiles the calls of one scope."""

    def __init__(self, expressions: Expressions) -> None:
        self.expressions = expressions
        self.scope = expressions.scope
        self.places = Places(expressions)

    def function(self, routine: Routine, node: s.FunctionCall) -> Compiled:
        """The value of a function call; what takes steps of its own runs before the statement goes on."""
        arguments = self.arguments(routine, node.arguments, node.line)
        returns = routine.returns
        if returns is None:
            self.scope.blame(node.line, f"'{node.name}' is a procedure and gives no value")
        if isinstance(routine, LibraryRoutine) and not routine.may_wait:
            return Compiled(_immediate(routine, arguments), returns)
        builder = self.expressions.builder(node.line)
        slot = builder.new_slot()
        builder.add(entering(routine, arguments, slot))
        return Compiled(lambda frame: frame.slots[slot], returns)

    def procedure(self, routine: Routine, arguments: Sequence[s.Argument], line: int) -> None:
        """Add the steps of a procedure call or instruction."""
        places = self.arguments(routine, arguments, line)
        if routine.returns is not None or _is_trap(routine):
            self.scope.blame(line, f"'{routine.name}' cannot be called as a procedure")
        self.expressions.builder(line).add(entering(routine, places, None))

    @staticmethod
    def caller(routine: LibraryRoutine, arguments: Sequence[GetPlace]) -> Callable[[Frame], Call]:
        """How to make the `Call` that an instruction receives."""
        named = [(p.key, get_place) for p, get_place in zip(routine.parameters, arguments, strict=True)]
        name = routine.name

        def call(frame: Frame) -> Call:
            frame.task.instruction_used()
            return Call(frame.task, name, {key: get_place(frame) for key, get_place in named})

        return call

    # Arguments ----------------------------------------------------------------------------------------------------

    def arguments(self, routine: Routine, given: Sequence[s.Argument], line: int) -> list[GetPlace]:
        """For each parameter, how to get what is passed for it."""
        parameters = self._parameters(routine)
        matched = self._matched(routine.name, parameters, given, line)
        last_step = max((i for i, p in enumerate(parameters) if self._runs(matched.get(p.key))), default=-1)
        places = []
        for index, parameter in enumerate(parameters):
            place = self._argument(parameter, matched.get(parameter.key), line)
            places.append(self._kept(place) if index < last_step else place)
        return places

    def _parameters(self, routine: Routine) -> tuple[FormalParameter, ...]:
        if isinstance(routine, UserRoutine):
            return self.scope.program.link_routine(routine)
        return routine.parameters

    def _runs(self, argument: s.Argument | None) -> bool:
        return argument is not None and argument.value is not None and self.expressions.runs_routine(argument.value)

    def _kept(self, get_place: GetPlace) -> GetPlace:
        """The argument taken now, for use after a later one has run a routine."""
        assert self.scope.builder is not None
        slot = self.scope.builder.store(get_place)
        return lambda frame: frame.slots[slot]

    def _matched(
        self, name: str, parameters: Sequence[FormalParameter], given: Sequence[s.Argument], line: int
    ) -> dict[str, s.Argument]:
        """Arguments by parameter: positions for required ones, names for optional ones, alternatives once."""
        required = [p for p in parameters if p.group is None]
        matched: dict[str, s.Argument] = {}
        for argument in given:
            parameter = self._parameter_for(name, argument, required, parameters)
            if parameter.key in matched:
                self.scope.blame(line, f"'{parameter.name}' is given twice to '{name}'")
            matched[parameter.key] = argument
        if required:
            self.scope.blame(line, f"'{name}' lacks the argument '{required[0].name}'")
        self._check_alternatives(name, parameters, matched, line)
        return matched

    def _parameter_for(
        self, name: str, argument: s.Argument, required: list[FormalParameter], parameters: Sequence[FormalParameter]
    ) -> FormalParameter:
        if not argument.is_optional:
            if not required:
                self.scope.blame(argument.line, f"'{name}' has too many arguments")
            parameter = required.pop(0)
            if argument.name is not None and argument.name.lower() != parameter.key:
                self.scope.blame(argument.line, f"'{name}' needs '{parameter.name}' before '{argument.name}'")
            return parameter
        key = (argument.name or "").lower()
        found = next((p for p in parameters if p.group is not None and p.key == key), None)
        if found is None:
            self.scope.blame(argument.line, f"'{name}' has no optional argument '\\{argument.name}'")
        return found

    def _check_alternatives(
        self, name: str, parameters: Sequence[FormalParameter], matched: dict[str, s.Argument], line: int
    ) -> None:
        groups = [p.group for p in parameters if p.group is not None and self._is_certain(matched.get(p.key))]
        if len(groups) != len(set(groups)):
            self.scope.blame(line, f"'{name}' is given two arguments that exclude each other")

    @staticmethod
    def _is_certain(argument: s.Argument | None) -> bool:
        return argument is not None and argument.condition is None

    def _argument(self, parameter: FormalParameter, argument: s.Argument | None, line: int) -> GetPlace:
        if argument is None:
            return lambda frame: ABSENT
        if argument.condition is not None:
            return self._conditional(parameter, argument)
        if parameter.type == SWITCH:
            return self._switch(parameter, argument)
        if argument.value is None:
            self.scope.blame(argument.line, f"'\\{parameter.name}' needs a value: '\\{parameter.name}:=...'")
        if parameter.mode is s.Mode.VALUE:
            return self._by_value(parameter, argument.value)
        return self._by_reference(parameter, argument.value, line)

    def _switch(self, parameter: FormalParameter, argument: s.Argument) -> GetPlace:
        if argument.value is not None:
            self.scope.blame(argument.line, f"the switch '\\{parameter.name}' takes no value")
        present = Variable(parameter.name, SWITCH, True)
        return lambda frame: present

    def _conditional(self, parameter: FormalParameter, argument: s.Argument) -> GetPlace:
        name = argument.condition or ""
        local = self.scope.locals.get(name.lower())
        if local is None or not local.is_optional:
            self.scope.blame(argument.line, f"'{name}' is not an optional parameter of this routine")
        if not is_assignable(parameter.type, local.type):
            self.scope.blame(argument.line, f"'{name}' is not {one(parameter.type)}")
        slot, is_copy = local.slot, parameter.mode is s.Mode.VALUE

        def conditional(frame: Frame) -> Place:
            place: Place = frame.slots[slot]
            return Variable(place.name, place.type, place.value) if is_copy and place is not ABSENT else place

        return conditional

    def _by_value(self, parameter: FormalParameter, node: s.Expression) -> GetPlace:
        compiled = self.expressions.value(node, parameter.type)
        name, type_, evaluate = parameter.name, compiled.type, compiled.evaluate
        convert = parameter.type.convert
        return lambda frame: Variable(name, type_, convert(evaluate(frame)))

    def _by_reference(self, parameter: FormalParameter, node: s.Expression, line: int) -> GetPlace:
        if not isinstance(node, (s.Name, s.Element, s.Field)):
            self.scope.blame(line, f"'{parameter.name}' needs a datum, not an expression")
        if isinstance(resolved(parameter.type), (SignalType, ObjectType)):
            return self._handle(parameter, node)
        get_place, type_ = self.places.writable(node, WRITABLE[parameter.mode])
        if not is_assignable(parameter.type, type_):
            self.scope.blame(line, f"'{parameter.name}' needs {one(parameter.type)}, not {one(type_)}")
        return get_place

    def _handle(self, parameter: FormalParameter, node: s.Reference) -> GetPlace:
        """A signal or an object such as a mechanical unit; predefined ones count as variables."""
        compiled = self.expressions.value(node, parameter.type)
        if isinstance(node, s.Name) and isinstance(self.scope.find(node.name, node.line), Signal):
            name, type_, evaluate = parameter.name, compiled.type, compiled.evaluate
            return lambda frame: Variable(name, type_, evaluate(frame))
        return self.places.place(node)[0]


def _is_trap(routine: Routine) -> bool:
    return isinstance(routine, UserRoutine) and routine.syntax.kind is s.RoutineKind.TRAP


def _immediate(routine: LibraryRoutine, arguments: Sequence[GetPlace]) -> Evaluate:
    """A function of the library that gives its value at once."""
    assert routine.returns is not None
    call, implementation = Calls.caller(routine, arguments), routine.implementation
    convert = routine.returns.convert
    return lambda frame: convert(implementation(call(frame)))


def entering(routine: Routine, arguments: Sequence[GetPlace], slot: int | None) -> Step:
    """The step that calls a routine; a function's value goes into `slot`."""
    if isinstance(routine, UserRoutine):
        return _entering_user_routine(routine, arguments, slot)
    call, implementation = Calls.caller(routine, arguments), routine.implementation
    convert = routine.returns.convert if routine.returns is not None else None

    def execute(machine: Machine, frame: Frame) -> None:
        outcome = implementation(call(frame))
        if isinstance(outcome, Generator):
            frame.begin_wait(outcome, slot, convert)

    return execute


def _entering_user_routine(routine: UserRoutine, arguments: Sequence[GetPlace], slot: int | None) -> Step:
    def enter(machine: Machine, frame: Frame) -> None:
        machine.enter(routine, [get_place(frame) for get_place in arguments], slot)

    return enter
