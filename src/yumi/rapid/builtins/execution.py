"""RAPID's instructions about execution: interrupts, conditions, cycles, retries, modules; what is not there.

Instructions and functions of options that this controller does not have may be used all the same: those that need a
device fail as where it does not answer or is not set up, so that error handlers are tried; those that change nothing
here are executed and nothing happens.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from yumi.errors import RobotNotReady
from yumi.rapid.ast import Module
from yumi.rapid.builtins.data import CONSTANTS
from yumi.rapid.builtins.information import OF_TASK, task_meant
from yumi.rapid.library import Call, Library, Wait
from yumi.rapid.machine import ChangeOrder, Edge, SignalOrder, TimerOrder
from yumi.rapid.parser import parse_module
from yumi.rapid.program import EventKind
from yumi.rapid.task import CyclicBool, StackEntry, Task
from yumi.rapid.types import (
    ABSENT,
    Part,
    ProgramTooLarge,
    RapidReferenceError,
    RapidRuntimeError,
    RapidSyntaxError,
    Reference,
    UnknownSymbol,
    Variable,
)

EXECUTION = Library(CONSTANTS)


# Interrupts -------------------------------------------------------------------------------------------------------

SHORTEST_TIMER_S = 0.1  # of a repeated ITimer; single ones may be shorter


def _order_signal(call: Call) -> None:
    value = call.get("TriggValue", Edge.BOTH.value)  # a group signal's interrupt comes with any change
    if value not in (edge.value for edge in Edge):
        sentence = f"{call.name} takes low (0), high (1) or edge (2), not {value:g}."
        raise RapidRuntimeError("ERR_ARGVALERR", sentence)
    is_single = call.present("Single") or call.present("SingleSafe")
    call.task.interrupts.order(int(call["Interrupt"]), SignalOrder(call["Signal"].name, Edge(value), is_single))


for _name, _type, _edge in (
    ("ISignalDI", "signaldi", "dionum TriggValue, "),
    ("ISignalDO", "signaldo", "dionum TriggValue, "),
    ("ISignalGI", "signalgi", ""),
    ("ISignalGO", "signalgo", ""),
):
    _signature = rf"\switch Single | \switch SingleSafe, VAR {_type} Signal, {_edge}VAR intnum Interrupt"
    EXECUTION.instruction(_name, _signature)(_order_signal)


@EXECUTION.instruction("ITimer", r"\switch Single | \switch SingleSafe, anynum Time, VAR intnum Interrupt")
def order_timer(call: Call) -> None:
    is_single = call.present("Single") or call.present("SingleSafe")
    period: float = call["Time"]
    if period <= 0.0 or (period < SHORTEST_TIMER_S and not is_single):
        sentence = f"ITimer takes at least {SHORTEST_TIMER_S:g} s, single ones more than 0, not {period:g} s."
        raise RapidRuntimeError("ERR_ARGVALERR", sentence)
    order = TimerOrder(call.task.now + period, period, is_single)
    call.task.interrupts.order(int(call["Interrupt"]), order)


@EXECUTION.instruction("IDelete", "VAR intnum Interrupt")
def delete_interrupt(call: Call) -> None:
    call.task.interrupts.delete(int(call["Interrupt"]))


@EXECUTION.instruction("ISleep", "VAR intnum Interrupt")
def put_interrupt_to_sleep(call: Call) -> None:
    call.task.interrupts.sleep(int(call["Interrupt"]))


@EXECUTION.instruction("IWatch", "VAR intnum Interrupt")
def watch_interrupt(call: Call) -> None:
    call.task.interrupts.watch(int(call["Interrupt"]))


@EXECUTION.instruction("IDisable")
def disable_interrupts(call: Call) -> None:
    call.task.interrupts.is_disabled = True


@EXECUTION.instruction("IEnable")
def enable_interrupts(call: Call) -> None:
    call.task.interrupts.is_disabled = False


@EXECUTION.instruction("IPers", r"\switch Single | \switch SingleSafe, PERS anytype Name, VAR intnum Interrupt")
def order_change(call: Call) -> None:
    """An interrupt whenever the value of a persistent changes, whichever task writes it."""
    task, number = call.task, int(call["Interrupt"])
    variable: Any = call.reference("Name")
    while isinstance(variable, Part):
        variable = variable.whole
    if not isinstance(variable, Variable):
        raise RapidRuntimeError("ERR_ARGNOTPER", "IPers takes a persistent.")
    order = ChangeOrder(call.present("Single") or call.present("SingleSafe"))
    task.interrupts.order(number, order)

    def changed() -> None:
        if not task.interrupts.is_ordered(number, order):
            variable.watchers.remove(changed)
        elif task.is_running:
            task.interrupts.occurred(number)

    variable.watch(changed)


@dataclass(slots=True)
class AnalogChange:
    """When an analog signal orders its interrupt: it fulfils the condition and has changed by more than `delta`.

    Technical reference manual, ISignalAI: the change counts from the value at the order, then from each interrupt.
    """

    condition: str
    high: float
    low: float
    delta: float
    direction: int
    reference: float

    def is_in(self, old: float, new: float) -> bool:
        """Whether a change to `new` is such a one."""
        is_fulfilled = {
            "AIO_ABOVE_HIGH": new > self.high,
            "AIO_BELOW_HIGH": new < self.high,
            "AIO_ABOVE_LOW": new > self.low,
            "AIO_BELOW_LOW": new < self.low,
            "AIO_BETWEEN": self.low <= new <= self.high,
            "AIO_OUTSIDE": not self.low <= new <= self.high,
            "AIO_ALWAYS": True,
        }[self.condition]
        change = new - self.reference
        is_far = abs(change) > self.delta and (self.direction == 0 or change * self.direction > 0)
        if is_fulfilled and is_far:
            self.reference = new
        return is_fulfilled and is_far


def _order_analog(call: Call) -> None:
    names = CONSTANTS_OF_CONDITIONS.get(call["Condition"])
    if names is None:
        raise RapidRuntimeError("ERR_ARGVALERR", f"{call.name} takes AIO_ABOVE_HIGH and the like as condition.")
    signal = call["Signal"].name
    change = AnalogChange(
        names,
        call["HighValue"],
        call["LowValue"],
        call["DeltaValue"],
        1 if call.present("DPos") else -1 if call.present("DNeg") else 0,
        call.task.read_signal(signal),
    )
    is_single = call.present("Single") or call.present("SingleSafe")
    call.task.interrupts.order(int(call["Interrupt"]), SignalOrder(signal, change, is_single))


_CONDITIONS = ("ABOVE_HIGH", "BELOW_HIGH", "ABOVE_LOW", "BELOW_LOW", "BETWEEN", "OUTSIDE", "ALWAYS")
CONSTANTS_OF_CONDITIONS = {
    datum.value: f"AIO_{name}" for name in _CONDITIONS if (datum := CONSTANTS.datum(f"AIO_{name}")) is not None
}
for _name, _type in (("ISignalAI", "signalai"), ("ISignalAO", "signalao")):
    EXECUTION.instruction(
        _name,
        rf"\switch Single | \switch SingleSafe, VAR {_type} Signal, aiotrigg Condition, num HighValue, num LowValue, "
        r"num DeltaValue, \switch DPos | \switch DNeg, VAR intnum Interrupt",
    )(_order_analog)


# Flags that follow conditions -------------------------------------------------------------------------------------

MOST_CYCLIC_BOOLS = 60
CYCLE_OF_BOOLS = 0.012  # [s]


def _cyclic_flag(call: Call) -> tuple[str, Reference]:
    reference = call.reference("Flag")
    if not isinstance(reference, Variable):
        raise RapidRuntimeError("ERR_ARGNOTPER", f"{call.name} takes a whole persistent, not a part of one.")
    return reference.name.lower(), reference


@EXECUTION.instruction("SetupCyclicBool", "PERS bool Flag, bool Cond")
def follow_condition(call: Call) -> Callable[[Callable[[], bool]], None]:
    """Let a persistent have the value of a condition from now on, which the compiler passes to what is returned."""
    task, (name, flag) = call.task, _cyclic_flag(call)
    if name not in task.cyclic_bools and len(task.cyclic_bools) >= MOST_CYCLIC_BOOLS:
        raise RapidRuntimeError("ERR_EXECPHR", f"{MOST_CYCLIC_BOOLS} conditions are computed cyclically already.")

    def setup(condition: Callable[[], bool]) -> None:
        if not task.has_flag_timer:
            task.later(0.0, lambda: _update_flags(task))
            task.has_flag_timer = True
        task.cyclic_bools[name] = CyclicBool(flag, condition)

    return setup


def _update_flags(task: Task) -> None:
    """Compute all flags now and, as long as there are any, every 12 ms.

    A condition that fails stops the task once, not in each cycle, and keeps no other flag from following its own.
    """
    task.has_flag_timer = bool(task.cyclic_bools)
    if task.has_flag_timer:
        task.later(CYCLE_OF_BOOLS, lambda: _update_flags(task))
    new: list[Exception] = []
    for each in list(task.cyclic_bools.values()):
        try:
            value = each.condition()
        except Exception as error:  # what the task makes of it, its timers say
            if not each.has_failed:
                new.append(error)
            each.has_failed = True
            continue
        each.has_failed = False
        if value != each.flag.value:
            each.flag.value = value
    if new:
        raise new[0]


@EXECUTION.instruction("RemoveCyclicBool", "PERS bool Flag")
def leave_condition(call: Call) -> None:
    call.task.cyclic_bools.pop(_cyclic_flag(call)[0], None)


@EXECUTION.instruction("RemoveAllCyclicBool", r"\switch AllTasks")
def leave_conditions(call: Call) -> None:
    tasks = call.task.host.devices.tasks().values() if call.present("AllTasks") else [call.task]
    for task in tasks:
        task.cyclic_bools.clear()


@EXECUTION.function("IsCyclicBool", "PERS bool Flag", "bool")
def follows_condition(call: Call) -> bool:
    return _cyclic_flag(call)[0] in call.task.cyclic_bools


@EXECUTION.function("GetNextCyclicBool", "INOUT num ListNumber, INOUT string Name", "bool")
def next_flag(call: Call) -> bool:
    """The name of the flag at the list number, which begins with 0 and moves on; FALSE behind the last one."""
    index, flags = int(call["ListNumber"]), list(call.task.cyclic_bools.values())
    if not 0 <= index < len(flags):
        return False
    call["ListNumber"], call["Name"] = index + 1, flags[index].flag.name
    return True


EXECUTION.function("GetNumberOfCyclicBool", "", "num")(lambda call: len(call.task.cyclic_bools))
EXECUTION.formula("GetMaxNumberOfCyclicBool", "", "num", lambda: MOST_CYCLIC_BOOLS)


# Where execution is -----------------------------------------------------------------------------------------------


@EXECUTION.instruction("ExitCycle")
def exit_cycle(call: Call) -> None:
    """The program goes on with main, in run mode "once" when it is started again."""
    call.task.exit_cycle()


@EXECUTION.function("RemainingRetries", "", "num")
def remaining_retries(call: Call) -> float:
    return call.task.remaining_retries()


@EXECUTION.instruction("ResetRetryCount")
def reset_retries(call: Call) -> None:
    call.task.reset_retries()


@EXECUTION.function("ExecHandler", "", "handler_type")
def executing_handler(call: Call) -> float:
    return _constant(f"HANDLER_{call.task.clause}")


@EXECUTION.function("ExecLevel", "", "exec_level")
def execution_level(call: Call) -> float:
    level = "LEVEL_SERVICE" if call.task.event else "LEVEL_TRAP" if call.task.is_in_trap else "LEVEL_NORMAL"
    return _constant(level)


@EXECUTION.function("EventType", "", "event_type")
def event_type(call: Call) -> float:
    """The system event whose event routine is being executed."""
    event = call.task.event
    return _constant("EVENT_NONE") if event is None else event.value


def _constant(name: str) -> float:
    datum = CONSTANTS.datum(name)
    assert datum is not None
    value: float = datum.value
    return value


@EXECUTION.function("ArgName", r"INOUT anytype Parameter, \VAR errnum ErrorNumber", "string")
def argument_name(call: Call) -> str:
    """The name of the datum that the caller has passed for a parameter, at whatever depth."""
    reference = call.reference("Parameter")
    if reference is ABSENT:
        raise RapidRuntimeError("ERR_ARGNAME", "ArgName is given a parameter that is not present.")
    return reference.name


@EXECUTION.instruction("Break")
def break_execution(call: Call) -> None:
    """Stop the program at once, for debugging; it goes on with the next instruction."""
    call.task.stopped_by_program(EventKind.STOP)


@EXECUTION.function("IsStopStateEvent", r"\switch PPMoved | \switch PPToMain", "bool")
def was_pointer_moved(call: Call) -> bool:
    """Whether the program pointer was moved before the program was started the last time."""
    where = call.task.stop_event
    return where == "main" if call.present("PPToMain") else bool(where)


@EXECUTION.function("PPMovedInManMode", "", "bool")
def was_pointer_moved_by_hand(call: Call) -> bool:
    """Whether the program pointer was moved in manual mode since ResetPPMoved."""
    return call.task.pp_moved_in_manual


@EXECUTION.instruction("ResetPPMoved")
def forget_moved_pointer(call: Call) -> None:
    call.task.pp_moved_in_manual = False


MOST_RECORDED = 10_000  # instructions


@EXECUTION.instruction("SpyStart", "string File")
def record_execution(call: Call) -> None:
    """Record each instruction of the task with the time it begins and ends [ms], for SpyStop to write."""
    task, start, lines = call.task, call.task.now, ["TASK INSTR IN CODE OUT"]
    begun: list[tuple[str, int]] = []
    path = call["File"]

    def now_ms() -> int:
        return round((task.now - start) * 1e3)

    def finish() -> None:
        if begun and len(lines) <= MOST_RECORDED:
            text, at = begun.pop()
            lines.append(f"{task.name}: {text} {at} READY {now_ms()}")

    def watch(entry: StackEntry) -> None:
        finish()
        text = task.program.modules[entry.module.lower()].syntax.text.splitlines()
        begun[:] = [(text[entry.line - 1].strip() if entry.line <= len(text) else "", now_ms())]

    def write() -> None:
        finish()
        try:
            task.host.devices.disk.write(path, "\n".join([*lines, ""]).encode("latin-1", "replace"))
        except OSError as error:
            raise RapidRuntimeError("ERR_FILEOPEN", f"SpyStop: '{path}' cannot be written: {error}") from error

    task.spy, task.end_of_spy = watch, write
    task.watch_statements()


@EXECUTION.instruction("SpyStop")
def end_recording(call: Call) -> None:
    task = call.task
    if task.spy is not None:
        task.spy = None
        task.watch_statements()
        task.end_of_spy()


# Modules ----------------------------------------------------------------------------------------------------------


def _path_argument(call: Call, path: str = "FilePath", file: str = "File") -> str:
    given: str = call[path]
    return f"{given.rstrip('/')}/{call[file]}" if call.present(file) else given


@EXECUTION.instruction("CallByVar", "string Name, num Number")
def call_by_variable(call: Call) -> None:
    call.task.call_procedure(f"{call['Name']}{int(call['Number'])}")


@EXECUTION.instruction("Load", r"\switch Dynamic, string FilePath, \string File, \switch CheckRef")
def load_module(call: Call) -> Wait:
    task, path = call.task, _path_argument(call)
    text = _module_text(task, path)
    yield from _load(task, text, path)


@EXECUTION.instruction("UnLoad", r"\switch ErrIfChanged | \switch Save, string FilePath, \string File")
def unload_module(call: Call) -> None:
    task, path = call.task, _path_argument(call)
    found = next((m for m in task.modules if m.filename == path), None)
    if found is None:
        raise RapidRuntimeError("ERR_UNLOAD", f"No module was loaded from '{path}'.")
    try:
        task.unload(found.name)
    except RobotNotReady as error:
        raise RapidRuntimeError("ERR_UNLOAD", str(error)) from error


def _module_text(task: Task, path: str) -> str:
    """The text of a module's file; raises ERR_FILNOTFND."""
    try:
        return task.host.read_file(path)
    except OSError as error:
        raise RapidRuntimeError("ERR_FILNOTFND", f"The file '{path}' cannot be read: {error}") from error


def _load(task: Task, text: str, path: str) -> Wait:
    """Load a module's text; raises ERR_SYNTAX, ERR_PRGMEMFULL or ERR_LOADED."""
    try:
        yield from task.loading(text, path)
    except RapidSyntaxError as error:
        raise RapidRuntimeError("ERR_SYNTAX", str(error)) from error
    except ProgramTooLarge as error:
        raise RapidRuntimeError("ERR_PRGMEMFULL", str(error)) from error
    except RapidReferenceError as error:
        raise RapidRuntimeError("ERR_LOADED", str(error)) from error


@EXECUTION.function("ModExist", "string ModuleName", "bool")
def module_exists(call: Call) -> bool:
    return call["ModuleName"].lower() in call.task.program.modules


@EXECUTION.instruction("EraseModule", "string ModuleName")
def erase_module(call: Call) -> None:
    try:
        call.task.unload(call["ModuleName"])
    except (UnknownSymbol, RobotNotReady) as error:
        raise RapidRuntimeError("ERR_MODULE", str(error)) from error


@EXECUTION.instruction("CheckProgRef")
def check_references(call: Call) -> None:
    faults = call.task.faults()
    if faults:
        raise RapidRuntimeError("ERR_LINKREF", str(faults[0]))


@dataclass(eq=False, slots=True)
class LoadSession:
    """What a loadsession stands for: a module that is being read in the background."""

    path: str = ""
    text: str = ""
    work: Future[Module] | None = None


EXECUTION.object_type("loadsession", LoadSession)


@EXECUTION.instruction("StartLoad", r"\switch Dynamic, string FilePath, \string File, VAR loadsession LoadNo")
def start_load(call: Call) -> None:
    session, path = call["LoadNo"], _path_argument(call)
    if session.work is not None:
        raise RapidRuntimeError("ERR_LOADNO_INUSE", f"{call.reference('LoadNo').name} is loading {session.path}.")
    session.text = _module_text(call.task, path)
    session.path = path
    session.work = call.task.background(lambda: parse_module(session.text, path))


@EXECUTION.instruction("WaitLoad", r"\string UnloadPath, \string UnloadFile, VAR loadsession LoadNo, \switch CheckRef")
def wait_load(call: Call) -> Wait:
    session, task = call["LoadNo"], call.task
    if session.work is None:
        raise RapidRuntimeError("ERR_LOADNO_NOUSE", f"{call.reference('LoadNo').name} is not loading anything.")
    while not session.work.done():
        yield None
    if call.present("UnloadPath"):
        path = _path_argument(call, "UnloadPath", "UnloadFile")
        old = next((module for module in task.modules if module.filename == path), None)
        try:
            task.unload(old.name if old else "")
        except (UnknownSymbol, RobotNotReady) as error:
            session.work = None
            raise RapidRuntimeError("ERR_UNLOAD", f"'{path}' cannot be unloaded: {error}") from error
    session.work = None
    yield from _load(task, session.text, session.path)
    if call.present("CheckRef"):
        check_references(call)


@EXECUTION.instruction("CancelLoad", "VAR loadsession LoadNo")
def cancel_load(call: Call) -> None:
    session = call["LoadNo"]
    if session.work is None:
        raise RapidRuntimeError("ERR_LOADNO_NOUSE", f"{call.reference('LoadNo').name} is not loading anything.")
    session.work = None


@EXECUTION.instruction("Save", rf"{OF_TASK}, string ModuleName, \string FilePath, \string File")
def save_module(call: Call) -> None:
    """A module's text into a file, its persistents with the values they have now."""
    task = task_meant(call)
    module = task.program.modules.get(call["ModuleName"].lower())
    if module is None:
        raise RapidRuntimeError("ERR_MODULE", f"The task {task.name} has no module '{call['ModuleName']}'.")
    path = _path_argument(call) if call.present("FilePath") else module.syntax.filename
    try:
        task.host.devices.disk.write(path, task.saved_text(module).encode("latin-1", "replace"))
    except OSError as error:
        raise RapidRuntimeError("ERR_IOERROR", f"'{path}' cannot be written: {error}") from error


# Options that this controller does not have -------------------------------------------------------------------------

OPTIONS = Library(CONSTANTS)

OPTIONS.record("sensor", {"id": "num", "error": "num", "state": "sensorstate"})

# The FlexPendant, diagnostics, brakes.
for _name, _signature in (
    ("TPShow", "tpnum Window"),
    ("BrakeCheck", ""),
    ("CyclicBrakeCheck", ""),
    ("ResetTorqueMargin", ""),
    ("HollowWristReset", ""),
):
    OPTIONS.accepted(_name, _signature)

OPTIONS.refused(
    "UIShow",
    r"string AssemblyName, string TypeName, \string InitCmd, \VAR uishownum InstanceID, \VAR num Status, "
    r"\switch NoCloseBtn",
    "ERR_UISHOW_FATAL",
    "there is no FlexPendant on which an application could run.",
)

# Sensor Interface.
_NO_SENSOR = "no sensor is connected to this controller."
for _name, _signature in (
    ("SiConnect", r"INOUT sensor Sensor, \switch NoStop"),
    ("SiClose", "INOUT sensor Sensor"),
    ("SiGetCyclic", "INOUT sensor Sensor, anytype Data, num Rate"),
    ("SiSetCyclic", "INOUT sensor Sensor, anytype Data, num Rate"),
    ("SenDevice", "string device"),
    ("ReadBlock", r"string device, num BlockNo, string FileName, \num TaskName"),
    ("WriteBlock", r"string device, num BlockNo, string FileName, \num TaskName"),
    ("WriteVar", r"string device, num VarNo, num VarData, \num TaskName"),
    (
        "IVarValue",
        r"string device, num VarNo, INOUT num Value, VAR intnum Interrupt, \num Unit, \num DeadBand, "
        r"\switch ReportAtTool",
    ),
):
    OPTIONS.refused(_name, _signature, "ERR_COMM_INIT", _NO_SENSOR)
OPTIONS.refused("ReadVar", r"string device, num VarNo, \num TaskName", "ERR_COMM_INIT", _NO_SENSOR, "num")

# Servo tools.
_NO_GUN = "no servo tool is defined on this controller."
for _name, _signature in (
    ("STOpen", r"string ToolName, \switch WaitZeroSpeed, \switch Conc"),
    ("STClose", r"string ToolName, num TipForce, num Thickness, \VAR num RetThickness, \switch Conc"),
    ("STCalib", r"string ToolName, \switch ToolChg | \switch TipChg | \switch TipWear, \VAR num RetTipWear"),
    ("STIndGun", "string ToolName, num GunPos"),
    ("STIndGunReset", "string ToolName"),
    ("STTune", r"anytype MecUnit, num TuneValue, num Type"),
    ("STTuneReset", "anytype MecUnit"),
):
    OPTIONS.refused(_name, _signature, "ERR_NO_SGUN", _NO_GUN)
for _name, _signature, _returns in (
    ("STCalcForce", "string ToolName, num MotorTorque", "num"),
    ("STCalcTorque", "string ToolName, num TipForce", "num"),
    ("STIsCalib", r"string ToolName, \switch sguninit | \switch sgunsynch", "bool"),
    ("STIsClosed", r"string ToolName, \VAR num RetThickness", "bool"),
    ("STIsIndGun", "string ToolName", "bool"),
    ("STIsOpen", r"string ToolName, \VAR num RetTipWear, \VAR num RetThickness", "bool"),
):
    OPTIONS.refused(_name, _signature, "ERR_NO_SGUN", _NO_GUN, _returns)

# Cameras: they answer as one that is not connected does.
OPTIONS.object_type("cameradev", object)
OPTIONS.record(
    "cameratarget",
    {
        "name": "string",
        "cframe": "pose",
        **{f"val{number}": "num" for number in range(1, 6)},
        "string1": "string",
        "string2": "string",
        "type": "num",
        "cameraname": "string",
        "sceneid": "num",
    },
)
_NO_CAMERA = "ERR_CAM_COM_TIMEOUT", "no camera is connected to this controller."
OPTIONS.refused("AliasCamera", "string CameraName, string CameraAlias", "ERR_NAME_INVALID", _NO_CAMERA[1])
for _name, _signature in (
    ("CamFlush", ""),
    ("CamGetParameter", r", string ParName, \VAR num NumVar | \VAR bool BoolVar | \VAR string StrVar"),
    ("CamGetResult", r", INOUT cameratarget CamTarget, \num SceneId, \num MaxTime"),
    ("CamLoadJob", r", string JobName, \switch KeepTargets, \num MaxTime"),
    ("CamReqImage", r", \num SceneId, \switch KeepTargets, \switch AwaitComplete"),
    ("CamSetExposure", r", \num ExposureTime, \num Brightness, \num Contrast"),
    ("CamSetParameter", r", string ParName, \num NumVal | \bool BoolVal | \string StrVal"),
    ("CamSetProgramMode", ""),
    ("CamSetRunMode", ""),
    ("CamStartLoadJob", r", string Name, \switch KeepTargets"),
    ("CamWaitLoadJob", ""),
):
    OPTIONS.refused(_name, f"VAR cameradev Camera{_signature}", *_NO_CAMERA)
for _name, _signature, _returns in (
    ("CamGetExposure", r", \switch ExposureTime | \switch Brightness | \switch Contrast", "num"),
    ("CamGetLoadedJob", "", "string"),
    ("CamGetMode", "", "num"),
    ("CamGetName", "", "string"),
    ("CamNumberOfResults", r", \num SceneId", "num"),
):
    OPTIONS.refused(_name, f"VAR cameradev Camera{_signature}", *_NO_CAMERA, _returns)

# Axes and movements of robots this one is not.
_MOVED = r"anytype MecUnit, num Axis, num Position, num Speed, \num Ramp"
_REFERENCE = r"\num RefPos | \num RefNum, \switch Short | \switch Fwd | \switch Bwd"
_NOT_INDEPENDENT = "no axis of this robot can be independent."
for _name, _signature in (
    ("IndAMove", _MOVED),
    ("IndDMove", _MOVED),
    ("IndRMove", r"anytype MecUnit, num Axis, \num ToRelPos | \num ToRelNum | \num ToRelDelta, num Speed"),
    ("IndCMove", r"anytype MecUnit, num Axis, num Speed, \num Ramp"),
    ("IndReset", rf"anytype MecUnit, num Axis, {_REFERENCE}"),
):
    OPTIONS.refused(_name, _signature, "ERR_AXIS_IND", _NOT_INDEPENDENT)
for _name, _signature in (
    ("IndInpos", "anytype MecUnit, num Axis"),
    ("IndSpeed", r"anytype MecUnit, num Axis, \switch InPos"),
):
    OPTIONS.refused(_name, _signature, "ERR_AXIS_IND", _NOT_INDEPENDENT, "bool")
for _name in ("SupSyncSensorOn", "SupSyncSensorOff", "SyncToSensor", "WaitSensor", "DropSensor"):
    _signature = r"anytype MechUnit, \num RelDist, \num PredTime, \num MaxSync, \switch On | \switch Off"
    OPTIONS.refused(_name, _signature, "ERR_CNV_NOT_ACT", "no sensor or conveyor is active.")
for _name in ("FricIdInit", "FricIdEvaluate", "FricIdSetFricLevels"):
    _signature = "" if _name == "FricIdInit" else "anytype FricLevels"
    OPTIONS.refused(_name, _signature, "ERR_FRICTUNE_FATAL", "the friction of this robot cannot be identified.")
for _name in ("SafetyControllerGetChecksum", "SafetyControllerGetSWVersion", "SafetyControllerGetUserChecksum"):
    OPTIONS.refused(_name, "", "ERR_NOTPRES", "this controller has no safety controller.", "string")
OPTIONS.refused("SafetyControllerGetOpModePinCode", "", "ERR_NOTPRES", "it has no safety controller.", "string")
OPTIONS.refused("SafetyControllerSyncRequest", "", "ERR_NOTPRES", "this controller has no safety controller.")
OPTIONS.refused("SCWrite", r"\string ToNode, anytype Variable", "ERR_SC_WRITE", "no superior computer is connected.")
