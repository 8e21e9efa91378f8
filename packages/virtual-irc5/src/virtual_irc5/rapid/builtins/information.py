"""RAPID's questions to the system: clocks, names, tasks, kinds of data, events to log, text tables, configuration."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime

from virtual_irc5.rapid.ast import Storage
from virtual_irc5.rapid.builtins.data import DATA
from virtual_irc5.rapid.call import Call, Wait, whole_argument
from virtual_irc5.rapid.devices import ConfigurationDevice
from virtual_irc5.rapid.rapid_library import Library
from virtual_irc5.rapid.states import Execution, Severity
from virtual_irc5.rapid.task import task_named, task_of
from virtual_irc5.rapid.types import (
    BOOL,
    LONGEST_STRING,
    DatumPart,
    RapidRuntimeError,
    Variable,
    is_numeric,
    raised_as,
    resolved_type,
)

INFORMATION = Library(DATA)

# Clocks -----------------------------------------------------------------------------------------------------------


def _clock(call: Call) -> datetime:
    """The controller's date and time, of this machine's time zone."""
    return datetime.fromtimestamp(call.task.host.devices.time())


@INFORMATION.function("CTime", "", "string")
@INFORMATION.function("CDate", "", "string")
def _time_text(call: Call) -> str:
    return _clock(call).strftime("%H:%M:%S" if call.name == "CTime" else "%Y-%m-%d")


_TIMES = {"WDay": "%u", "Year": "%Y", "Month": "%m", "MDay": "%d", "Hour": "%H", "Min": "%M", "Sec": "%S"}


@INFORMATION.function("GetTime", " | ".join(rf"\switch {name}" for name in _TIMES), "num")
def _part_of_time(call: Call) -> float:
    """The second where none is asked for."""
    return float(_clock(call).strftime(next((code for name, code in _TIMES.items() if call.present(name)), "%S")))


@dataclass(slots=True)
class RapidClock:
    """A stopwatch: seconds counted until the last stop, and since when it runs (None: it stands)."""

    counted: float = 0.0
    since: float | None = None

    def read(self, now: float) -> float:
        return self.counted + (0.0 if self.since is None else now - self.since)


INFORMATION.object_type("clock", RapidClock)


@INFORMATION.instruction("ClkReset", "VAR clock Clock")
def _reset_clock(call: Call) -> None:
    clock: RapidClock = call["Clock"]
    clock.counted, clock.since = 0.0, None


@INFORMATION.instruction("ClkStart", "VAR clock Clock")
def _start_clock(call: Call) -> None:
    clock: RapidClock = call["Clock"]
    if clock.since is None:
        clock.since = call.task.elapsed


@INFORMATION.instruction("ClkStop", "VAR clock Clock")
def _stop_clock(call: Call) -> None:
    clock: RapidClock = call["Clock"]
    clock.counted, clock.since = clock.read(call.task.elapsed), None


@INFORMATION.function("ClkRead", r"VAR clock Clock, \switch HighRes", "num")
def _read_clock(call: Call) -> float:
    clock: RapidClock = call["Clock"]
    return clock.read(call.task.elapsed)


# Names and versions -----------------------------------------------------------------------------------------------

_FACTS = ("SerialNo", "SWVersion", "SWVersionName", "RobotType", "CtrlId", "LanIp", "CtrlLang", "SystemName")


@INFORMATION.function("GetSysInfo", " | ".join(rf"\switch {fact}" for fact in _FACTS), "string")
def _system_information(call: Call) -> str:
    facts = call.task.host.devices.facts
    return next((facts.get(name, "") for name in _FACTS if call.present(name)), "")


@INFORMATION.function("IsSysId", "string SystemId", "bool")
def _is_system(call: Call) -> bool:
    return bool(call["SystemId"] == call.task.host.devices.facts.get("SystemId"))


@INFORMATION.function("GetUASUserName", "", "string")
def _user_name(call: Call) -> str:
    return call.task.host.devices.facts.get("UserName", "Default User")


@INFORMATION.function("ProgMemFree", "", "num")
def _free_memory(call: Call) -> float:
    """Bytes for modules: what they may have together without what they have."""
    return float(2_000_000 - sum(len(module.text) for module in task_of(call).modules))


@INFORMATION.function("RobOS", "", "bool")
def _is_real_robot(call: Call) -> bool:
    return not call.task.host.is_virtual()


@INFORMATION.function("OpMode", "", "symnum")
def _operating_mode(call: Call) -> float:
    return task_of(call).operating_mode()


@INFORMATION.function("RunMode", r"\switch Main", "symnum")
def _run_mode(call: Call) -> float:
    return 1.0  # RUN_CONT_CYCLE: a controller in automatic mode knows no other


@INFORMATION.function("NonMotionMode", r"\switch Main", "bool")
@INFORMATION.function("PFRestart", r"\switch Base | \switch Irpt", "bool")
@INFORMATION.function("IsBrakeCheckActive", "", "bool")
def _is_never(call: Call) -> bool:
    """What never happens here: execution without motion, a power failure, a brake check."""
    return False


# Tasks ------------------------------------------------------------------------------------------------------------

OF_TASK = r"\taskid TaskRef | \string TaskName"


@INFORMATION.function("GetTaskName", r"\VAR num TaskNo | \VAR num MecTaskNo", "string")
def _task_name(call: Call) -> str:
    """The task's name; its number counts from 1 in the order of the configuration."""
    names = [name.lower() for name in call.task.host.devices.tasks()]
    for argument in ("TaskNo", "MecTaskNo"):
        if call.present(argument) and call.task.name.lower() in names:
            call[argument] = names.index(call.task.name.lower()) + 1
    return call.task.name


@INFORMATION.function("TaskIsActive", "string TaskName", "bool")
@INFORMATION.function("TaskIsExecuting", "string TaskName", "bool")
def _is_task_running(call: Call) -> bool:
    task = task_named(call, call["TaskName"])
    return call.name == "TaskIsActive" or task.execution is Execution.STARTED


@INFORMATION.function("ModTime", r"string Object, \num StrDig", "num")
@INFORMATION.function("ModTimeDnum", "string Object", "dnum")
def _module_time(call: Call) -> float:
    """When the file of a module was written, seconds since 1970."""
    module = task_of(call).program.modules.get(call["Object"].lower())
    if module is None:
        raise call.error("ERR_MOD_NOTLOADED", f"there is no module '{call['Object']}'.")
    with raised_as("ERR_FILNOTFND", OSError, before=f"{call.name}: "):
        return float(int(call.task.host.devices.disk.entry(module.syntax.filename).changed))


# Data -------------------------------------------------------------------------------------------------------------


@INFORMATION.function("IsPers", "INOUT anytype DatObj", "bool")
@INFORMATION.function("IsVar", "INOUT anytype DatObj", "bool")
def _is_stored_so(call: Call) -> bool:
    """Whether a datum, or the one it is a part of, is a persistent or a variable."""
    datum = call.reference("DatObj")
    while isinstance(datum, DatumPart):
        datum = datum.whole
    return isinstance(datum, Variable) and datum.storage is (Storage.PERS if call.name == "IsPers" else Storage.VAR)


@INFORMATION.function("Type", r"anytype Data, \switch BaseName", "string")
def _type_name(call: Call) -> str:
    type_ = call.reference("Data").type
    return resolved_type(type_).name if call.present("BaseName") else type_.name


@INFORMATION.instruction("TryInt", "anynum DataObj, \\dnum DataObj2")
def _try_integer(call: Call) -> None:
    value: float = call["DataObj"]
    if value != int(value):
        raise RapidRuntimeError("ERR_INT_NOTVAL", f"{value:g} is not an integer.")


# Errors and events ------------------------------------------------------------------------------------------------

INFORMATION.alias("errstr", "string")
_ARGUMENTS = "errstr Argument1, errstr Argument2, errstr Argument3, errstr Argument4, errstr Argument5"
_LARGEST_OWN_EVENT = 9999  # what programs log has the numbers 80 0001 to 80 9999 on the controller


@INFORMATION.instruction(
    "ErrLog", rf"num ErrorID, \switch W | \switch I, errstr Title, errstr Description, {_ARGUMENTS}"
)
def log_event(call: Call) -> None:
    number = whole_argument(call, "ErrorID", 1, _LARGEST_OWN_EVENT)
    _log_event(call, number, call["Title"], (call["Description"], *_event_arguments(call)))


@INFORMATION.instruction("ErrRaise", f"string ErrorName, num ErrorId, {_ARGUMENTS}")
def _raise_event(call: Call) -> None:
    """Log a warning with the texts of table ErrorName's domain, and raise the error that BookErrNo gave the name."""
    number = whole_argument(call, "ErrorId", 1, _LARGEST_OWN_EVENT)
    _log_event(call, number, call["ErrorName"], _event_arguments(call), Severity.WARNING)
    error = RapidRuntimeError(call["ErrorName"], f"ErrRaise: {call['ErrorName']}.")
    error.number = call.task.library.error_number(call["ErrorName"]) or _booked_number(call)
    raise error


def _booked_number(call: Call) -> float:
    """The number a program has booked for the name."""
    found = task_of(call).program.find(call["ErrorName"], None)
    if not isinstance(found, Variable) or not is_numeric(found.type):
        raise RapidRuntimeError("ERR_ILLRAISE", f"ErrRaise: no errnum is called '{call['ErrorName']}'.")
    return float(found.value)


def _event_arguments(call: Call) -> tuple[str, ...]:
    return tuple(call[f"Argument{number}"] for number in range(1, 6))


def _log_event(
    call: Call, number: int, title: str, lines: tuple[str, ...], severity: Severity = Severity.ERROR
) -> None:
    severity = Severity.WARNING if call.get("W") else Severity.INFORMATION if call.get("I") else severity
    given = tuple(line for line in lines if line and line != "ERRSTR_UNUSED")
    call.task.host.devices.log(80_000 + number, title, ": ".join(given), severity, given)


for _name, _text in {"EMPTY": " ", "UNUSED": "ERRSTR_UNUSED", "TASK": "", "CONTEXT": ""}.items():
    INFORMATION.data(f"ERRSTR_{_name}", "errstr", _text)


@INFORMATION.instruction("SkipWarn")
def _skip_warning(call: Call) -> None:
    """The warning of the last error is not logged; handled errors never are on this controller."""


# Text tables ------------------------------------------------------------------------------------------------------

_TEXT_ELEMENT = re.compile(r'<text\s+name="(\d+)"\s*>(.*?)</text>', re.IGNORECASE | re.DOTALL)
_VALUE_ELEMENT = re.compile(r"<value>(.*?)</value>", re.IGNORECASE | re.DOTALL)
_TABLE_NAME = re.compile(r'<resource\s+name="([^"]+)"', re.IGNORECASE)


@INFORMATION.instruction("TextTabInstall", "string File")
def _install_text_table(call: Call) -> None:
    """Read an XML file of texts, <Resource Name="table"><Text Name="1"><Value>...</Value></Text></Resource>."""
    devices = call.task.host.devices
    with raised_as("ERR_FILEACC", OSError, before="TextTabInstall: "):
        text = devices.disk.read(call["File"]).decode("utf-8", "replace")
    name = _TABLE_NAME.search(text)
    if name is None:
        raise call.error("ERR_FILEACC", f"{call['File']} names no text table.")
    table = {
        int(number): (_VALUE_ELEMENT.search(body) or [body, body])[1].strip()
        for number, body in _TEXT_ELEMENT.findall(text)
    }
    devices.texts[name[1].lower()] = table


@INFORMATION.function("TextTabFreeToUse", "string TableName", "bool")
def _is_table_free(call: Call) -> bool:
    return call["TableName"].lower() not in call.task.host.devices.texts


@INFORMATION.function("TextTabGet", "string TableName", "num")
def _text_table(call: Call) -> float:
    """The number of a table, which TextGet takes."""
    names = list(call.task.host.devices.texts)
    if call["TableName"].lower() not in names:
        raise RapidRuntimeError("ERR_TXTNOEXIST", f"There is no text table '{call['TableName']}'.")
    return float(names.index(call["TableName"].lower()) + 1)


@INFORMATION.function("TextGet", "num Table, num Index", "string")
def _table_text(call: Call) -> str:
    tables: list[Mapping[int, str]] = list(call.task.host.devices.texts.values())
    number, index = int(call["Table"]), int(call["Index"])
    if not 1 <= number <= len(tables) or index not in tables[number - 1]:
        raise RapidRuntimeError("ERR_TXTNOEXIST", f"The text table {number} has no text {index}.")
    return tables[number - 1][index][:LONGEST_STRING]


# Configuration ----------------------------------------------------------------------------------------------------


@contextmanager
def _attribute(call: Call) -> Iterator[tuple[ConfigurationDevice, str, str]]:
    """The system parameters, and where in them the call's attribute is; raises ERR_CFG_NOTFND."""
    path, attribute, found = call["InstancePath"], call["Attribute"], call.task.host.devices.configuration
    try:
        if found is None:
            raise KeyError(path)
        yield found, path, attribute
    except KeyError as error:
        sentence = f"The configuration has no {attribute} at {path}."
        raise RapidRuntimeError("ERR_CFG_NOTFND", sentence) from error


@INFORMATION.instruction("ReadCfgData", r"string InstancePath, string Attribute, INOUT anytype CfgData, \num ListNo")
def _read_configuration(call: Call) -> None:
    """One attribute of one instance, as number, text or truth value."""
    with _attribute(call) as (configuration, path, attribute):
        text = configuration.read(path, attribute)
    type_ = resolved_type(call.reference("CfgData").type)
    try:
        call["CfgData"] = float(text) if is_numeric(type_) else text.upper() == "TRUE" if type_ == BOOL else text
    except ValueError as error:
        raise RapidRuntimeError("ERR_CFG_ILLTYPE", f"{attribute} is '{text}', not a number.") from error


@INFORMATION.instruction("WriteCfgData", r"string InstancePath, string Attribute, anytype CfgData, \num ListNo")
def _write_configuration(call: Call) -> None:
    type_, value = resolved_type(call.reference("CfgData").type), call["CfgData"]
    text = f"{value:.15g}" if is_numeric(type_) else str(value).upper() if type_ == BOOL else str(value)
    with _attribute(call) as (configuration, path, attribute):
        configuration.write(path, attribute, text)


_DOMAINS = ("EIO", "MMC", "MOC", "PROC", "SIO", "SYS")
INFORMATION.alias("cfgdomain", "string")
INFORMATION.data("ALL_DOMAINS", "cfgdomain", "ALL")
for _domain in _DOMAINS:
    INFORMATION.data(f"{_domain}_DOMAIN", "cfgdomain", _domain)


@INFORMATION.instruction("SaveCfgData", r"string FilePath, \string File, cfgdomain Domain")
def _save_configuration(call: Call) -> None:
    devices, domain = call.task.host.devices, call["Domain"]
    path = f"{call['FilePath'].rstrip('/')}/{call['File']}" if call.present("File") else call["FilePath"]
    for name in _DOMAINS if domain == "ALL" else (domain,):
        try:
            if devices.configuration is None:
                raise KeyError(name)
            text = devices.configuration.save(name)
        except KeyError as error:
            if domain == "ALL":
                continue
            raise RapidRuntimeError("ERR_CFG_ILL_DOMAIN", f"There is no domain '{name}'.") from error
        target = f"{path.rstrip('/')}/{name}.cfg" if domain == "ALL" else path
        with raised_as("ERR_CFG_WRITEFILE", OSError, before="SaveCfgData: "):
            devices.disk.write(target, text.encode("latin-1", "replace"))


@INFORMATION.instruction("WarmStart")
def _warm_start(call: Call) -> Wait:
    """Restart the controller; the program does not get any further."""
    restart = call.task.host.devices.restart
    if restart is None:
        raise call.error("ERR_EXECPHR", "this controller cannot be restarted.")
    restart()
    while True:
        yield None
