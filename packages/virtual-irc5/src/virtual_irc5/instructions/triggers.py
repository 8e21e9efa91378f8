r"""RAPID's moves that do something on the way: MoveLDO and its like, TriggL with TriggIO, SearchL.

What happens at a place on the path is done when the arm passes it, later than the plan by the servo's delay, in the
middle of its corner where the place is rounded, whatever the program is doing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from virtual_irc5.instructions.moves import FATAL, MOVE_FRAMES, MOVES, MoveInstructions
from virtual_irc5.mechanics.contacts import Contact
from virtual_irc5.mechanics.path import Passage, PathTrigger
from virtual_irc5.rapid import Call, Library, Wait
from virtual_irc5.rapid.builtins.strings import RELATIONS
from virtual_irc5.rapid.types import ArrayType, RapidRuntimeError, RapidSignalType, resolved_type

_MOST_TRIGGERS = 8
_ZERO_CYCLES = 100  # 0.4 s after a stop process signals are set to zero
_PASSED = object()
_INSTANT = 1e-4  # [s] over which the tool's speed is measured


@dataclass(frozen=True, slots=True)
class TriggerEvent:
    """What a triggdata describes.

    Attributes:
        action: what happens; it gets the task's call.
        distance: from the end of the move, or from its start [mm].
        is_from_start: which of them.
        time: before the end instead of a distance [s].
        lead: how much earlier it happens [s].
    """

    action: Callable[[Call], None]
    distance: float = 0.0
    is_from_start: bool = False
    time: float = 0.0
    lead: float = 0.0


@dataclass(eq=False, slots=True)
class TriggData:
    """A triggdata: empty, or what happens where."""

    events: tuple[TriggerEvent, ...] = ()


@dataclass(slots=True)
class StopSupervision:
    """What TriggStopProc has seen.

    Attributes:
        before: values of the process signals while the program was running.
        shadow_before: of the shadow signal.
        shadow: its last value.
        was_running, is_stopping: whether the program runs, whether it was stopped and the arm may still move.
        stops_on_path: whether something was ahead of the arm when the program stopped.
        cycles: since then.
        flanks: changes of the shadow signal since then.
    """

    before: dict[str, float]
    shadow_before: float
    shadow: float = 0.0
    was_running: bool = True
    is_stopping: bool = False
    stops_on_path: bool = False
    cycles: int = 0
    flanks: int = 0


TRIGGERS = Library(MOVES)
TRIGGERS.object_type("triggdata", TriggData)
_PLACE = {"used": "bool", "distance": "num", "start": "bool", "equiplag": "num", "signalname": "string"}
for _name, _type in (("triggios", "num"), ("triggstrgo", "stringdig"), ("triggiosdnum", "dnum")):
    TRIGGERS.record(_name, {**_PLACE, "setvalue": _type, "xxx": "num"})
_DATA = "VAR triggdata TriggData, num Distance"
_OUTPUTS = r"\VAR signaldo DOp | \VAR signalgo GOp | \VAR signalao AOp | \num ProcID, anynum SetValue"
_WHERE = r"\switch Start | \switch Time"
_TO, _THROUGH = "robtarget ToPoint", "robtarget CirPoint, robtarget ToPoint"
_WITH_TRIGGERS = (
    r"speeddata Speed, \num T, anytype Trigg_1"
    + "".join(rf", \triggdata T{number}" for number in range(2, _MOST_TRIGGERS + 1))
    + rf", zonedata Zone, \stoppointdata Inpos, {MOVE_FRAMES}"
)
_WITH_OUTPUTS = (
    r"\identno ID, speeddata Speed, \num T, \triggios TriggData1{*}, \triggstrgo TriggData2{*}, "
    rf"\triggiosdnum TriggData3{{*}}, zonedata Zone, \stoppointdata Inpos, {MOVE_FRAMES}"
)
_SEARCH = (
    r"\switch Stop | \switch PStop | \switch SStop | \switch Sup, PERS signaldi_or_bool Signal, "
    r"\switch Flanks | \switch PosFlank | \switch NegFlank | \switch HighLevel | \switch LowLevel"
)
_SEARCHING = rf"\identno ID, speeddata Speed, \num V | \num T, {MOVE_FRAMES}"


class TriggerInstructions:
    """The moves with triggers of one task."""

    def __init__(self, motion: MoveInstructions) -> None:
        self._motion = motion

    # What happens -------------------------------------------------------------------------------------------------

    @TRIGGERS.instruction("TriggIO", rf"{_DATA}, {_WHERE}, {_OUTPUTS}, \num DODelay")
    @TRIGGERS.instruction("TriggEquip", rf"{_DATA}, \switch Start, num EquipLag, {_OUTPUTS}, \PERS bool Inhib")
    def define_output(self, call: Call) -> None:
        """An output is set."""
        name = next((call[each].name for each in ("DOp", "GOp", "AOp") if call.present(each)), None)
        if name is None:
            raise RapidRuntimeError(FATAL, rf"{call.name} needs one of \DOp, \GOp and \AOp.")
        value, delay = call["SetValue"], call.get("DODelay", 0.0)
        if call.present("DOp"):
            value = 1.0 if value else 0.0
        inhibits = _inhibits(call)

        def act(move: Call) -> None:
            wanted = 0.0 if inhibits() else value
            if delay > 0.0:
                move.task.later(delay, lambda: move.task.write_signal(name, wanted))
            else:
                move.task.write_signal(name, wanted)

        self._define(call, TriggerEvent(act))

    @TRIGGERS.instruction("TriggInt", rf"{_DATA}, {_WHERE}, VAR intnum Interrupt")
    def define_interrupt(self, call: Call) -> None:
        """An interrupt occurs."""
        number = int(call["Interrupt"])
        self._define(call, TriggerEvent(lambda move: move.task.interrupts.occur(number)))

    @TRIGGERS.instruction(
        "TriggCheckIO",
        rf"{_DATA}, {_WHERE}, VAR signal Signal, opnum Relation, anynum CheckValue, \switch StopMove, "
        "VAR intnum Interrupt",
    )
    def define_check(self, call: Call) -> None:
        r"""An interrupt occurs where a signal is not as it should be; with \StopMove the arm stops."""
        name, relation, wanted = call["Signal"].name, call["Relation"], call["CheckValue"]
        number, stops = int(call["Interrupt"]), call.present("StopMove")
        if relation not in RELATIONS:
            raise call.error("ERR_ARGVALERR", f"{relation:g} is no relation; use LT to NOTEQ.")

        def act(move: Call) -> None:
            if not RELATIONS[relation](move.task.read_signal(name), wanted):
                if stops:
                    self._motion.arm.path.hold("StopMove")
                move.task.interrupts.occur(number)

        self._define(call, TriggerEvent(act))

    @TRIGGERS.instruction(
        "TriggStopProc",
        r"PERS restartdata RestartRef, \VAR signaldo DO1, \VAR signalgo GO1, \VAR signalgo GO2, "
        r"\VAR signalgo GO3, \VAR signalgo GO4, VAR signaldo ShadowDO",
    )
    def supervise_stops(self, call: Call) -> None:
        """At each stop of the program, store process signals in restart data and set them to zero.

        Technical reference manual: values just before the stop, those when the arm stands, and how often the shadow
        signal has changed between; -1 of a signal that is not given.
        """
        task, unit, restart = call.task, self._motion.unit, call.reference("RestartRef")
        signals = {name: call[name].name for name in ("DO1", "GO1", "GO2", "GO3", "GO4") if call.present(name)}
        shadow = call["ShadowDO"].name
        values = {name: task.read_signal(signal) for name, signal in signals.items()}
        state = StopSupervision(values, task.read_signal(shadow))

        def observe() -> None:
            now = task.read_signal(shadow)
            if task.is_running and not state.is_stopping:
                state.before = {name: task.read_signal(signal) for name, signal in signals.items()}
                state.shadow_before, state.was_running, state.flanks = now, True, 0
                return
            if state.was_running:
                state.was_running, state.is_stopping = False, True
                state.stops_on_path, state.cycles, state.shadow = not unit.arm.path.is_empty, 0, state.shadow_before
            if not state.is_stopping:
                return
            state.flanks += now != state.shadow
            state.shadow, state.cycles = now, state.cycles + 1
            if not unit.arm.is_stationary or state.cycles < _ZERO_CYCLES:
                return
            state.is_stopping = False
            after = {name: task.read_signal(signal) for name, signal in signals.items()}
            stored = {f"pre{name.lower()}val": value for name, value in state.before.items()}
            stored |= {f"post{name.lower()}val": value for name, value in after.items()}
            absent = {
                f"{when}{name}val": -1.0 for name in ("do1", "go1", "go2", "go3", "go4") for when in ("pre", "post")
            }
            shadows = {"preshadowval": state.shadow_before, "shadowflanks": state.flanks, "postshadowval": now}
            data = {**absent, **stored, **shadows, "restartstop": True, "stoponpath": state.stops_on_path}
            restart.value = restart.type.convert(restart.value._replace(**data))
            for signal in (*signals.values(), shadow):
                task.write_signal(signal, 0.0)

        name = f"process signals at stops of {task.name}"

        def end() -> None:
            unit.observers.pop(name, None)

        unit.observers[name] = observe
        unit.beginnings[name] = end

    @TRIGGERS.instruction(
        "TriggSpeed",
        rf"{_DATA}, \switch Start, num ScaleLag, VAR signalao AOp, num ScaleValue, \num DipLag, "
        r"\VAR signaldo ErrDO, \PERS bool Inhib",
    )
    def define_speed(self, call: Call) -> None:
        """An analog output follows the tool's speed from a place on, times a factor."""
        name, scale, inhibits = call["AOp"].name, call["ScaleValue"], _inhibits(call)

        def act(move: Call) -> None:
            path, frames = self._motion.arm.path, self._motion.read_frames(move)

            def follow() -> None:
                joints = np.array([path.state.position, path.state.position])
                joints[1] += np.array(path.state.velocity) * _INSTANT
                points, _ = frames.tip(*self._motion.arm.kinematics.forward(joints))
                speed = float(np.linalg.norm(points[1] - points[0])) / _INSTANT  # [m/s]
                move.task.write_signal(name, 0.0 if inhibits() else speed * scale)
                if not path.is_finished:
                    move.task.later(0.012, follow)

            follow()

        self._define(call, TriggerEvent(act, lead=call["ScaleLag"]))

    @TRIGGERS.instruction(
        "TriggRampAO",
        rf"{_DATA}, \switch Start, num EquipLag, VAR signalao AOutput, num SetValue, num RampLength, \switch Time",
    )
    def define_ramp(self, call: Call) -> None:
        r"""An analog output goes evenly to a value, over a length or with \Time a time."""
        name, value, length = call["AOutput"].name, call["SetValue"], call["RampLength"]
        steps = 20
        begins: list[float] = []

        def act(share: float) -> Callable[[Call], None]:
            def set_part(move: Call) -> None:
                if share == 0.0:
                    begins[:] = [move.task.read_signal(name)]
                start = begins[0] if begins else 0.0
                move.task.write_signal(name, start + (value - start) * share)

            return set_part

        def ramp(move: Call) -> None:
            act(0.0)(move)
            for step in range(1, steps + 1):
                share = step / steps
                move.task.later(length * share, lambda share=share: act(share)(move))  # type: ignore[misc]

        if call.present("Time"):
            self._define(call, TriggerEvent(ramp))
            return
        self._define(call, TriggerEvent(act(0.0)))
        (event,) = call["TriggData"].events
        sign = 1.0 if event.is_from_start else -1.0
        call["TriggData"].events = tuple(
            replace(event, action=act(step / steps), distance=event.distance + sign * length * step / steps)
            for step in range(steps + 1)
        )

    def _define(self, call: Call, event: TriggerEvent) -> None:
        is_time = call.name.lower() != "triggrampao" and bool(call.get("Time", False))
        distance = call["Distance"]
        if distance < 0.0:
            raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name} takes no negative distance, not {distance:g}.")
        call["TriggData"].events = (
            replace(
                event,
                distance=0.0 if is_time else distance,
                time=distance if is_time else 0.0,
                is_from_start=call.present("Start"),
                lead=event.lead + call.get("EquipLag", 0.0),
            ),
        )

    @TRIGGERS.instruction("TriggDataCopy", "VAR triggdata SourceTriggData, VAR triggdata DestinationTriggData")
    def copy(self, call: Call) -> None:
        call["DestinationTriggData"].events = call["SourceTriggData"].events

    @TRIGGERS.instruction("TriggDataReset", "VAR triggdata TriggData")
    def reset(self, call: Call) -> None:
        call["TriggData"].events = ()

    @TRIGGERS.function("TriggDataValid", "VAR triggdata TriggData", "bool")
    def is_defined(self, call: Call) -> bool:
        return bool(call["TriggData"].events)

    # Moves --------------------------------------------------------------------------------------------------------

    @TRIGGERS.instruction("TriggLIOs", rf"\switch Conc, {_TO}, {_WITH_OUTPUTS}")
    @TRIGGERS.instruction("TriggJIOs", rf"\switch Conc, {_TO}, {_WITH_OUTPUTS}")
    def move_with_outputs(self, call: Call) -> Wait:
        """A move with outputs of arrays of records (triggios, triggstrgo, triggiosdnum), those with used TRUE."""
        events: list[TriggerEvent] = []
        for number in range(1, 4):
            for row in call.get(f"TriggData{number}", ()):
                if not row.used:
                    continue
                # A group may have more bits than a num has digits: its value is then a text.
                value = float(row.setvalue) if isinstance(row.setvalue, str) else row.setvalue
                name = row.signalname
                call.task.read_signal(name)  # whether there is such

                def act(move: Call, name: str = name, value: float = value) -> None:
                    move.task.write_signal(name, value)

                events.append(
                    TriggerEvent(act, distance=row.distance, is_from_start=bool(row.start), lead=row.equiplag)
                )
        yield from self._acting(call, events)

    @TRIGGERS.instruction("TriggL", rf"\switch Conc, {_TO}, \identno ID, {_WITH_TRIGGERS}")
    @TRIGGERS.instruction("TriggJ", rf"\switch Conc, {_TO}, \identno ID, {_WITH_TRIGGERS}")
    @TRIGGERS.instruction("TriggC", rf"\switch Conc, {_THROUGH}, \identno ID, {_WITH_TRIGGERS}")
    @TRIGGERS.instruction(
        "TriggAbsJ", rf"\switch Conc, jointtarget ToJointPos, \identno ID, \switch NoEOffs, {_WITH_TRIGGERS}"
    )
    def move_with_triggers(self, call: Call) -> Wait:
        first = call.reference("Trigg_1")
        is_array = isinstance(resolved_type(first.type), ArrayType)
        data = list(first.value) if is_array else [first.value]
        data += [call[f"T{number}"] for number in range(2, _MOST_TRIGGERS + 1) if call.present(f"T{number}")]
        if not all(isinstance(each, TriggData) and (is_array or each.events) for each in data):
            raise call.error(FATAL, "a triggdata has to be defined, by TriggIO or its like.")
        events = [event for each in data for event in each.events]
        yield from self._acting(call, events)

    def _attach(self, call: Call, passage: Passage, events: list[TriggerEvent]) -> None:
        """Add what happens to the run; a distance longer than the move is its other end."""
        leg, run = passage.leg, passage.run
        total = float(leg.piece.way[-1]) * 1e3
        for event in events:
            share = min(event.distance / total, 1.0) if total > 0.0 else 0.0
            at = share if event.is_from_start else 1.0 - share
            action = event.action
            if passage.run.length == 0.0:
                action(call)
                continue
            happens = partial(call.task.attempt, partial(action, call))
            run.triggers.append(PathTrigger(passage, at, event.lead + event.time, happens))

    def set_at_end(self, call: Call) -> Wait:
        """A signal is set at the end of a move, in the middle of a corner there."""
        value, name = call.get("DValue", call.get("Value", 0.0)), call["Signal"].name
        if call.name.upper().endswith("DO"):
            value = 1.0 if value else 0.0
        yield from self._acting(call, [TriggerEvent(lambda _: call.task.write_signal(name, value))])

    def call_at_end(self, call: Call) -> Wait:
        """A procedure is called at the end of a move, as a trap routine is."""
        number = call.task.interrupt_of(call["ProcName"])
        yield from self._acting(call, [TriggerEvent(lambda _: call.task.interrupts.occur(number))])

    def _acting(self, call: Call, events: list[TriggerEvent]) -> Wait:
        added: Callable[[Passage], None] = lambda passage: self._attach(call, passage, events)  # noqa: E731
        yield from self._motion.passed(call, self._motion.build(call), added)

    @TRIGGERS.instruction(
        "ContactL",
        rf"\num DesiredTorque, {_TO}, \identno ID, speeddata Speed, \num V | \num T, \zonedata Zone, \num Z, "
        rf"\stoppointdata Inpos, {MOVE_FRAMES}",
    )
    def seek_contact(self, call: Call) -> Wait:
        r"""A line on which contact is sought where \DesiredTorque is given; the arm stays where it touches.

        No forces are modelled: any contact is strong enough. Without \DesiredTorque it only raises the level at which
        motion supervision stops the program, so that it is a MoveL. The error ERR_CONTACTL for a line without contact
        follows from its name.
        """
        motion, unit = self._motion, self._motion.unit
        passages: list[Passage] = []
        moving = motion.passed(call, motion.build(call), passages.append)
        if not call.present("DesiredTorque"):
            yield from moving
            return
        unit.contact = Contact.SOUGHT
        try:
            while unit.contact is Contact.SOUGHT:
                if next(moving, _PASSED) is _PASSED and motion.is_there(passages[0]):  # also with a zone
                    raise call.error("ERR_CONTACTL", f"the {unit.arm.kinematics.name} has touched nothing on the way.")
                yield None
            moving.close()
            unit.arm.path.restart_at(unit.arm.planned)
        except GeneratorExit:
            moving.close()
            raise
        finally:
            unit.contact = None

    # Searches -----------------------------------------------------------------------------------------------------

    @TRIGGERS.instruction("SearchL", f"{_SEARCH}, INOUT robtarget SearchPoint, {_TO}, {_SEARCHING}")
    @TRIGGERS.instruction("SearchC", f"{_SEARCH}, INOUT robtarget SearchPoint, {_THROUGH}, {_SEARCHING}")
    @TRIGGERS.instruction(
        "SearchExtJ",
        rf"{_SEARCH}, INOUT jointtarget SearchJointPos, jointtarget ToJointPos, \switch UseEOffs, "
        r"speeddata Speed, \num T",
    )
    def search(self, call: Call) -> Wait:
        """Move to a stop point; the place where what is watched changes is kept, and the arm stops there if wanted.

        Technical reference manual: a digital input, or a persistent bool.
        """
        motion, arm = self._motion, self._motion.arm
        name, error, read = _watched(call)
        is_external = call.name.lower() == "searchextj"
        frames = motion.read_frames(call) if is_external else motion.frames(call["Tool"], call.get("WObj"))
        level = 0.0 if call.present("LowLevel") or call.present("NegFlank") else 1.0
        by_level = call.present("HighLevel") or call.present("LowLevel")
        both = call.present("Flanks")
        before = read()
        if not by_level and not both and before == level and not call.present("PosFlank"):
            raise call.error(error, f"{name} is set already where the search begins.")
        stops = any(call.present(each) for each in ("Stop", "PStop", "SStop"))
        is_found = False
        moving = motion.passed(call, motion.build(call))
        try:
            for due in moving:
                now = read()
                hit = (both and now != before) or (not both and now == level and (by_level or before != level))
                before = now
                if hit and is_found and call.present("Sup"):
                    raise call.error(error, f"{name} has changed more than once.")
                if hit and not is_found:
                    is_found = True
                    if is_external:
                        call["SearchJointPos"] = motion.joint_target(call)
                    else:
                        call["SearchPoint"] = motion.robtarget(arm.position, frames)
                    if stops:
                        moving.close()
                        while not arm.is_stationary or arm.path.is_abandoned:
                            yield None
                        return
                yield due
        except GeneratorExit:
            moving.close()
            raise
        if not is_found:
            raise call.error("ERR_WHLSEARCH", f"{name} has not changed on the way.")


def _watched(call: Call) -> tuple[str, str, Callable[[], float]]:
    """What a search watches: how it is called, the error of one that is set already, and its level."""
    watched = call.reference("Signal")
    if isinstance(resolved_type(watched.type), RapidSignalType):
        name = watched.value.name
        return f"the signal {name}", "ERR_SIGSUPSEARCH", lambda: call.task.read_signal(name)
    return f"the persistent {watched.name}", "ERR_PERSSUPSEARCH", lambda: float(watched.value)


def _inhibits(call: Call) -> Callable[[], bool]:
    r"""Whether \Inhib, a persistent that is read when the place is passed, lets the output be 0 instead."""
    if not call.present("Inhib"):
        return lambda: False
    flag = call.reference("Inhib")
    return lambda: bool(flag.value)


_MOVE = r"\identno ID, speeddata Speed, \num T, zonedata Zone, tooldata Tool, \wobjdata WObj"
for _letter, _target in (("L", _TO), ("J", _TO), ("C", _THROUGH)):
    for _kind, _what, _implementation in (
        ("DO", "VAR signaldo Signal, dionum Value", TriggerInstructions.set_at_end),
        ("AO", "VAR signalao Signal, num Value", TriggerInstructions.set_at_end),
        ("GO", r"VAR signalgo Signal, \num Value | \dnum DValue", TriggerInstructions.set_at_end),
        ("Sync", "string ProcName", TriggerInstructions.call_at_end),
    ):
        _signature = rf"{_target}, {_MOVE}, {_what}, \loaddata TLoad"
        TRIGGERS.instruction(f"Move{_letter}{_kind}", _signature)(_implementation)
