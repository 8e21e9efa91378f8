"""The virtual controller as a system: what is installed, its identity, own settings and jobs, its tasks and backups.

The robots are data, each with system parameters of its own (``stock``). The modules are ours (the state machine of
`yumi.controller_files`), a user's own RAPID files, or those of a backup as a controller or RobotStudio writes it:
``BACKINFO``, ``SYSPAR``, ``RAPID/TASKn/PROGMOD``, ``RAPID/TASKn/SYSMOD`` and ``HOME``. The virtual controller writes
and restores such backups, too. A backup is one of the jobs, which take their time.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime, timezone
from enum import Enum
from operator import itemgetter
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import yumi.controller_files
import yumi.virtual.controller
from yumi.errors import SettingsError, YumiError
from yumi.rapid.program import SystemEvent
from yumi.robot.arm_kinematics import Arm
from yumi.robot.irb120 import irb120
from yumi.robot.joints import Side
from yumi.robot.yumi_arms import irb14050, yumi_arm
from yumi.virtual.controller.events import Refusal, Refused
from yumi.virtual.controller.files import DEVICES, ENCODING, decoded
from yumi.virtual.controller.signals import Configuration, Instance
from yumi.virtual.controller.units import NO_UNIT, YUMI_UNITS, MechanicalUnit

if TYPE_CHECKING:
    from yumi.virtual.controller.controller import Irc5

# What is installed ------------------------------------------------------------------------------------------------

ROBOTWARE_6 = "6.13.00.00"

# The strings clients compare with are exact; without 604-1 they take the two arms for one group.
YUMI_OPTIONS = (
    "RobotWare Base",
    "English",
    "623-1 Multitasking",
    "604-1 MultiMove Coordinated",
    "709-1 DeviceNet Master/Slave",
    "617-1 FlexPendant Interface",
    "616-1 PC Interface",
    "841-1 EtherNet/IP Scanner/Adapter",
    "613-1 Collision Detection",
    "611-1 Path Recovery",
    "612-1 Path Offset",
    "988-1 RW Add-In Prepared",
    "Leadthrough",
    "689-1 Externally Guided Motion (EGM)",
    "UDPUC Driver",
    "Drive System IRB 14000",
    "Hall Sensor Calibration",
    "IRB 14000-0.5/0.5",
    "SmartGripper",
    "StateMachine Core",
)

_STOCK = Path(next(iter(yumi.virtual.controller.__path__)))
_OPTIONS = (
    "RobotWare Base",
    "English",
    "623-1 Multitasking",
    "709-1 DeviceNet Master/Slave",
    "617-1 FlexPendant Interface",
    "616-1 PC Interface",
    "608-1 World Zones",
    "611-1 Path Recovery",
    "612-1 Path Offset",
    "689-1 Externally Guided Motion (EGM)",
    "UDPUC Driver",
)


@dataclass(frozen=True, slots=True)
class Robot:
    """A robot and what its controller is delivered with.

    Attributes:
        name: as `yumi controller --robot` has it.
        title: ABB's name.
        system_name: of the RobotWare system and the controller where none is given.
        arms: kinematics of each arm; a robot with one arm has the right one's place.
        units: its mechanical units, the first of each arm being the robot itself.
        options: of the controller.
        stock: directory of its system parameters.
        is_yumi: whether it has grippers, and runs the state machine of this package.
    """

    name: str
    title: str
    system_name: str
    arms: Mapping[Side, Callable[[], Arm]]
    units: tuple[MechanicalUnit, ...]
    options: tuple[str, ...]
    stock: Path
    is_yumi: bool = False

    @property
    def type_name(self) -> str:
        """What GetSysInfo calls it, such as 120-3/0.6."""
        return self.title.removeprefix("IRB ")

    @property
    def serial_number(self) -> str:
        """Of the robot: the number of its model, and one of ours."""
        return f"{self.type_name.partition('-')[0]}-500000"

    def unit_of(self, side: Side) -> str:
        """Name of the mechanical unit of an arm."""
        return next(unit.name for unit in self.units if unit.side is side)


YUMI = Robot(
    "yumi",
    "IRB 14000-0.5/0.5",
    "YuMi",
    {side: lambda side=side: yumi_arm(side) for side in Side},  # type: ignore[misc]
    YUMI_UNITS,
    YUMI_OPTIONS,
    _STOCK / "stock",
    is_yumi=True,
)
ROBOTS: Mapping[str, Robot] = {
    robot.name: robot
    for robot in (
        YUMI,
        Robot(
            "irb14050",
            "IRB 14050-0.5/0.5",
            "IRB_14050",
            {Side.RIGHT: irb14050},
            (
                MechanicalUnit("ROB_1", Side.RIGHT, "TCPRobot", 6, 7, NO_UNIT, "ROB_1_7", motion_task="T_ROB1"),
                MechanicalUnit("ROB_1_7", Side.RIGHT, "Single", 1, 1, "ROB_1", NO_UNIT, motion_task="T_ROB1"),
            ),
            (*_OPTIONS, "Leadthrough", "Drive System IRB 14050", "Hall Sensor Calibration", "IRB 14050-0.5/0.5"),
            _STOCK / "stock_irb14050",
        ),
        Robot(
            "irb120",
            "IRB 120-3/0.6",
            "IRB_120",
            {Side.RIGHT: irb120},
            (MechanicalUnit("ROB_1", Side.RIGHT, "TCPRobot", 6, 6, NO_UNIT, NO_UNIT, motion_task="T_ROB1"),),
            (*_OPTIONS, "Drive System IRB 120", "IRB 120-3/0.6"),
            _STOCK / "stock_irb120",
        ),
    )
}
"""By name."""


USER_MODULE = "HOME:/user.sys"
"""The module that a stock controller's CAB_TASK_MODULES lists for all tasks: registers and a stopwatch.

Read in a backup of a RobotWare 6.14 controller: the line of SYS.cfg, and the module in SYSMOD.
"""

DELIVERED_FILES: Mapping[str, bytes] = {USER_MODULE: (_STOCK / "user.sys").read_bytes()}
"""What HOME has on a new controller, by path."""

DOMAINS = ("EIO", "MMC", "MOC", "PROC", "SIO", "SYS")
"""Of system parameters; each has a cfg file in a backup."""

_HOME = "HOME:/"
_INFO = "BACKINFO/backinfo.txt"
_SUFFIXES = (".mod", ".sys", ".modx", ".sysx", ".prg")
_TASK_OF_BACKUP = re.compile(r">>(TASK\d+):\s*\(\s*(\w+)", re.IGNORECASE)  # >>TASK1: (T_ROB1,,)
_REPLACED = ("CAB_TASKS", "CAB_TASK_MODULES", "MECHANICAL_UNIT_GROUP")  # where a backup has them
_LARGEST_FILE = 8 * 1024 * 1024  # bytes
_USER = re.compile(r"^\s*MODULE\s+user\b", re.IGNORECASE | re.MULTILINE)


@dataclass(frozen=True, slots=True)
class System:
    """What is installed.

    Attributes:
        parameters: texts of cfg files; an instance of a later one takes the place of one of the same name.
        restored: of a backup, loaded before; its tasks take the place of a stock controller's.
        files: contents of files by their path on the controller, such as ``HOME:/yumi/TRobMain.mod``.
        robot: what the controller moves.
        modules: by task, in capitals, the paths of its modules; tasks that are left out have those of CAB_TASK_MODULES.
        is_factory: whether nothing but a stock YuMi's parameters are there, as when a robot is delivered.
    """

    parameters: tuple[str, ...]
    files: Mapping[str, bytes]
    restored: tuple[str, ...] = ()
    modules: Mapping[str, tuple[str, ...]] | None = None
    is_factory: bool = False
    robot: Robot = YUMI

    def configuration(self) -> Configuration:
        """A stock robot's parameters, then these; raises SettingsError."""
        configuration = Configuration(
            path.read_text(encoding="ascii") for path in sorted(self.robot.stock.glob("*.cfg"))
        )
        for text in self.restored:
            configuration.load(text, _REPLACED)
        for text in self.parameters:
            configuration.load(text)
        return configuration


def delivered_system() -> System:
    """The state machine in both tasks."""
    folder = Path(next(iter(yumi.controller_files.__path__)))
    modules = sorted([*folder.glob("*.mod"), *folder.glob("*.sys")])
    cfg = [path.read_text(encoding="ascii") for path in sorted(folder.glob("*.cfg"))]
    return System(tuple(cfg), {f"{_HOME}yumi/{path.name}": path.read_bytes() for path in modules})


def factory_system(robot: Robot = YUMI) -> System:
    """A robot as it is delivered: no program, signals or devices of this package."""
    return System((), {}, is_factory=True, robot=robot)


def with_programs(system: System, programs: Mapping[str, Sequence[Path]], cfg: Sequence[Path] = ()) -> System:
    """A system with a user's programs and parameters.

    Args:
        system: what they are added to.
        programs: by task, its modules or program files (.pgf), which take the place of what the task has; `user` stays
            where none of them is that module.
        cfg: files of system parameters.

    Raises:
        SettingsError: a file cannot be read or is not what it should be, or there is no such task.
    """
    system = replace(system, parameters=(*system.parameters, *(decoded(_read(path)) for path in cfg)))
    configuration = system.configuration()
    tasks = {settings.name.upper(): settings for settings in task_settings(configuration)}
    files, modules = {**DELIVERED_FILES, **system.files}, dict(system.modules or {})
    for task, paths in programs.items():
        if task.upper() not in tasks:
            raise SettingsError(
                f"there is no task {task}; there are {', '.join(sorted(tasks))}. A task is added in CAB_TASKS of a "
                "SYS.cfg, which --cfg loads."
            )
        found = []
        for path in (each for given in paths for each in _modules_of(given)):
            place = f"{_HOME}{path.name}"
            content = _read(path)
            if files.setdefault(place, content) != content:  # two files of one name
                place = f"{_HOME}{task.lower()}/{path.name}"
                files[place] = content
            found.append(place)
        if not _bring_user(found, files):
            before = modules_of(tasks[task.upper()], system, configuration)
            found = [*(path for path in before if path == USER_MODULE), *found]
        modules[task.upper()] = tuple(found)
    return replace(system, files=files, modules=modules)


def is_user_module(text: str) -> bool:
    """Whether a text is a module `user`, which takes the place of the one a controller is delivered with."""
    return _USER.search(text) is not None


def _bring_user(paths: Sequence[str], files: Mapping[str, bytes]) -> bool:
    """Whether one of the modules of a task takes the place of `user`."""
    return any(is_user_module(decoded(files[path])) for path in paths)


def read_backup(folder: Path, robot: Robot = YUMI) -> System:
    """What a backup of a robot's controller has.

    Raises:
        SettingsError: it is not a backup, or a file of it cannot be read.
    """
    if not folder.is_dir():
        raise SettingsError(f"{folder} is not a directory: --system takes the directory of a backup.")
    rapid, parameters = _inside(folder, "RAPID"), _inside(folder, "SYSPAR")
    if rapid is None and parameters is None:
        raise SettingsError(
            f"{folder} is not a backup of a controller: it has neither RAPID nor SYSPAR. RobotStudio and the "
            "FlexPendant write one with BACKINFO, HOME, RAPID and SYSPAR in it."
        )
    cfg = sorted(parameters.glob("*.[cC][fF][gG]")) if parameters else []
    home = _inside(folder, "HOME")
    inside = [path for path in sorted(home.rglob("*")) if path.is_file()] if home else []
    files = {f"{_HOME}{path.relative_to(home).as_posix()}": _read(path) for path in inside if home}
    system = System((), files, tuple(decoded(_read(path)) for path in cfg), robot=robot)
    # Which task TASK1 is stands in BACKINFO; without it the tasks are in the order of their declarations.
    information = _inside(folder, "BACKINFO")
    texts = [decoded(_read(path)) for path in sorted(information.glob("*.[tT][xX][tT]"))] if information else []
    names = {key.upper(): name for text in texts for key, name in _TASK_OF_BACKUP.findall(text)}
    declared = [settings.name for settings in task_settings(system.configuration())]
    modules: dict[str, list[str]] = {}
    shared: list[str] = []
    for place in sorted(rapid.iterdir() if rapid else (), key=lambda path: (len(path.name), path.name)):
        number = place.name.upper().removeprefix("TASK")
        if not place.is_dir() or not number.isdecimal():
            continue
        name = names.get(place.name.upper())
        if name is None and 1 <= int(number) <= len(declared):
            name = declared[int(number) - 1]
        if name is None and int(number) != 0:  # TASK0 has the modules that all tasks share
            raise SettingsError(f"{place} is no task of the system: neither BACKINFO nor CAB_TASKS of SYSPAR names it.")
        sources = []
        for kind in ("SYSMOD", "PROGMOD"):
            inner = _inside(place, kind)
            sources += [path for path in sorted(inner.iterdir()) if path.suffix.lower() in _SUFFIXES] if inner else []
        for path in sources:
            files[f"{_HOME}RAPID/{place.name}/{path.name}"] = _read(path)
        found = [f"{_HOME}RAPID/{place.name}/{path.name}" for path in sources]
        if name is None:
            shared += found
        else:
            modules[name.upper()] = found
    return _with_modules_of_tasks(replace(system, files=files), shared, modules)


def _with_modules_of_tasks(system: System, shared: Sequence[str], modules: Mapping[str, Sequence[str]]) -> System:
    """A backup's system with the modules of each task: shared ones, its own, and those of its configuration in HOME."""
    configuration = system.configuration()
    of_tasks = {}
    for settings in task_settings(configuration):
        paths = [*shared, *modules.get(settings.name.upper(), ())]
        stems = {PurePosixPath(path).stem.lower() for path in paths}
        there = {*system.files, *DELIVERED_FILES}
        configured = (path for path in modules_of(settings, system, configuration) if path in there)
        missing = [path for path in configured if PurePosixPath(path).stem.lower() not in stems]
        if USER_MODULE in missing and _bring_user(paths, system.files):
            missing.remove(USER_MODULE)
        of_tasks[settings.name.upper()] = (*missing, *paths)
    return replace(system, modules=of_tasks)


def _modules_of(path: Path) -> Iterator[Path]:
    """A module's file itself, or those that a program file lists."""
    if path.suffix.lower() != ".pgf":
        if path.suffix.lower() not in _SUFFIXES:
            kinds = ", ".join((*_SUFFIXES, ".pgf"))
            raise SettingsError(f"{path} is not a RAPID file: its name has to end in {kinds}.")
        yield path
        return
    try:
        program = ElementTree.fromstring(_read(path))
    except (ElementTree.ParseError, LookupError, ValueError) as error:
        raise SettingsError(f"{path} is not a program file: {error}.") from error
    for module in program.iter("Module"):
        name = (module.text or "").strip().replace("\\", "/")
        yield _inside(path.parent, name) or path.parent / name


def _inside(folder: Path, name: str) -> Path | None:
    """What has the name in a directory, in any letter case."""
    found = folder / name
    if found.exists():
        return found
    return next((path for path in folder.iterdir() if path.name.lower() == name.lower()), None)


def _read(path: Path) -> bytes:
    try:
        content = path.read_bytes() if path.stat().st_size <= _LARGEST_FILE else None
    except OSError as error:
        raise SettingsError(f"{path} cannot be read: {error.strerror or error}.") from error
    if content is None:
        raise SettingsError(f"{path} is larger than {_LARGEST_FILE} bytes, which is no file of a RAPID program.")
    return content


# Identity, settings and jobs --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Identity:
    """Who the controller is.

    Attributes:
        system_name: name of the RobotWare system.
        controller_name: name of the controller, usually its serial number.
        robotware: version name; clients want three groups of digits with a dot behind, and at least 6.09
            for EGM with seven axes.
        options: RobotWare options, in the order they are listed.
        is_virtual: what the controller calls itself; ours claims to be real, since its gripper is there.
        system_id: identifier of the system.
    """

    system_name: str = "YuMi"
    controller_name: str = "14000-500000"
    robotware: str = ROBOTWARE_6
    options: tuple[str, ...] = YUMI_OPTIONS
    is_virtual: bool = False
    system_id: str = "{6B6F9A2E-3B1D-4B5C-9A64-9E0D2C1F7A11}"


@dataclass(slots=True)
class OwnSettings:
    """Settings of the controller that are not system parameters.

    Attributes:
        language: of the FlexPendant, such as ``en``.
        timezone: name in the tz database; empty for that of this machine.
        timeserver: address of the time server; empty for none.
        address, mask, gateway, method: of the network connection; it is not this machine's.
        dns: address of the name server; empty for none.
        routes: gateway by destination.
        mode_lock: ``unlocked``, ``locked`` or ``permlocked``: whether the operating mode may be changed.
        pin: that unlocks it.
        backup_state: in the words of RWS.
    """

    language: str = "en"
    timezone: str = ""
    timeserver: str = ""
    address: str = "192.168.125.1"
    mask: str = "255.255.255.0"
    gateway: str = ""
    method: str = "fixip"
    dns: str = ""
    routes: dict[str, str] = field(default_factory=dict)
    mode_lock: str = "unlocked"
    pin: str = ""
    backup_state: str = "None"


_JOBS_REMEMBERED = 50


@dataclass(slots=True)
class Job:
    """Work that takes its time, such as a backup; a client reads how far it is at ``/progress/{number}``.

    Attributes:
        number: as in its address.
        work: done at its end; what it raises is the failure.
        left: time until then [s].
        is_done: whether it has ended.
        failure: why it has failed; empty as long as it has not.
    """

    number: int
    work: Callable[[], None]
    left: float
    is_done: bool = False
    failure: str = ""


class Jobs:
    """The jobs of a controller; it remembers the latest ones after their end."""

    def __init__(self) -> None:
        self._jobs: dict[int, Job] = {}
        self._begun = 0
        self._later: list[tuple[float, Callable[[], None]]] = []

    def begin(self, work: Callable[[], None], duration: float) -> Job:
        """Do ``work`` in ``duration`` [s]."""
        self._begun += 1
        job = self._jobs[self._begun] = Job(self._begun, work, duration)
        for number in [each for each, known in self._jobs.items() if known.is_done][:-_JOBS_REMEMBERED]:
            del self._jobs[number]
        return job

    def find(self, number: str) -> Job | None:
        """The job of that number, or None."""
        return next((job for job in self._jobs.values() if str(job.number) == number), None)

    def later(self, delay: float, work: Callable[[], None]) -> None:
        """Do something of the controller's own in ``delay`` [s], such as the end of a pulse."""
        self._later.append((delay, work))

    def advance(self, dt: float) -> None:
        """Let ``dt`` [s] pass."""
        for job in tuple(self._jobs.values()) if self._jobs else ():
            if job.is_done:
                continue
            job.left -= dt
            if job.left <= 0.0:
                job.is_done = True
                try:
                    job.work()
                except YumiError as error:
                    job.failure = str(error)
        if self._later:
            waiting, self._later = [(left - dt, work) for left, work in self._later], []
            for left, work in waiting:
                if left > 0.0:
                    self._later.append((left, work))
                else:
                    work()


# Tasks ------------------------------------------------------------------------------------------------------------


class TaskType(Enum):
    """How a task is started; the values are those of RWS.

    NORMAL tasks are started and stopped by users. STATIC and SEMISTATIC ones run whenever the controller does, the
    latter from their beginning after each restart (technical reference manual, system parameters: topic Controller).
    """

    NORMAL = "norm"
    STATIC = "stat"
    SEMISTATIC = "semi"


class TrustLevel(Enum):
    """What an error in a STATIC or SEMISTATIC task stops; the values are those of the system parameter."""

    SYS_FAIL = "SysFail"
    SYS_HALT = "SysHalt"
    SYS_STOP = "SysStop"
    NO_SAFETY = "NoSafety"  # "None" in the cfg files of controllers


@dataclass(frozen=True, slots=True)
class TaskSettings:
    """One instance of CAB_TASKS.

    Attributes:
        name: of the task.
        type: how it is started.
        is_motion_task: whether its instructions may move a robot.
        robot: name of the robot of its mechanical unit group, ``ROB_L``; empty without one.
        entry: the procedure it begins with.
        trust: what an error in it stops; NORMAL tasks stop together in any case.
        foreground: the task it waits for: it executes while that one is idle only; empty without one.
    """

    name: str
    type: TaskType = TaskType.NORMAL
    is_motion_task: bool = False
    robot: str = ""
    entry: str = "main"
    trust: TrustLevel = TrustLevel.SYS_FAIL
    foreground: str = ""


def task_settings(configuration: Configuration) -> tuple[TaskSettings, ...]:
    """The tasks of a configuration in their order; raises SettingsError."""
    tasks = []
    for instance in configuration.instances("SYS", "CAB_TASKS"):
        given = {name.lower(): value for name, value in instance.attributes.items()}
        is_motion_task = given.get("motiontask", "").lower() in ("true", "yes", "1")
        group = configuration.find("SYS", "MECHANICAL_UNIT_GROUP", given.get("usemechanicalunitgroup", ""))
        # "Task in foreground" of the system parameters; its name in cfg files differs between RobotWare's releases.
        behind = (value for name, value in given.items() if name.replace("_", "").startswith("taskinfor"))
        trust = given.get("trustlevel", "").lower().replace("none", TrustLevel.NO_SAFETY.value.lower())
        tasks.append(
            TaskSettings(
                instance.name,
                _task_type(instance),
                is_motion_task,
                group.attributes.get("Robot", "") if group else "",
                given.get("entry") or "main",
                next((each for each in TrustLevel if each.value.lower() == trust), TrustLevel.SYS_FAIL),
                next(behind, "").removeprefix("-1"),
            )
        )
    return tuple(tasks)


def _task_type(instance: Instance) -> TaskType:
    given = {name.lower(): value for name, value in instance.attributes.items()}.get("type", "SEMISTATIC")
    try:
        return TaskType[given.upper().replace("-", "").replace("_", "")]
    except KeyError:
        allowed = ", ".join(each.name for each in TaskType)
        raise SettingsError(f"the task {instance.name} has the type {given!r}; there are {allowed}.") from None


_TRUE = ("TRUE", "YES", "1", "")  # an attribute without a value is set


def event_routines(configuration: Configuration, task: TaskSettings) -> Mapping[SystemEvent, tuple[str, ...]]:
    """The event routines of a task in the order of their sequence numbers (CAB_EXEC_HOOKS)."""
    found: dict[SystemEvent, list[tuple[int, str]]] = {}
    for instance in configuration.instances("SYS", "CAB_EXEC_HOOKS"):
        given = {name.lower(): value for name, value in instance.attributes.items()}
        event = next((each for each in SystemEvent if each.name == given.get("shelf", "").upper()), None)
        of_all = given.get("alltask", given.get("alltasks", "no")).upper() in _TRUE
        of_motion = given.get("allmotiontask", given.get("allmotiontasks", "no")).upper() in _TRUE
        is_here = of_all or (of_motion and task.is_motion_task) or given.get("task", "").upper() == task.name.upper()
        if event is None or not given.get("routine") or not is_here:
            continue
        number = given.get("seqno", given.get("sequenceno", "0"))
        found.setdefault(event, []).append((int(number) if number.isdecimal() else 0, given["routine"]))
    return {event: tuple(name for _, name in sorted(each, key=itemgetter(0))) for event, each in found.items()}


def modules_of(task: TaskSettings, system: System, configuration: Configuration) -> tuple[str, ...]:
    """The paths of the modules that a task begins with."""
    given = (system.modules or {}).get(task.name.upper())
    if given is not None:
        return given
    paths = []
    for instance in configuration.instances("SYS", "CAB_TASK_MODULES"):
        attributes = {name.lower(): value for name, value in instance.attributes.items()}
        of_all = any(attributes.get(name, "").upper() in ("TRUE", "YES", "1") for name in ("alltask", "shared"))
        of_motion = attributes.get("allmotiontask", "").upper() in ("TRUE", "YES", "1") and task.is_motion_task
        if of_all or of_motion or attributes.get("task", "").upper() == task.name.upper():
            path = attributes.get("file", "")
            # ABB's own modules (RELEASE:, INTERNAL:) are what the library provides.
            if path.partition(":")[0].upper() in DEVICES:
                paths.append(path)
    return tuple(paths)


# Backups that the controller makes and restores -------------------------------------------------------------------


def write_backup(controller: Irc5, path: str) -> None:
    """Make a backup in a directory, over what is there.

    Raises:
        Refused: NO_SPACE.
    """
    files, identity = controller.files, controller.identity
    when = datetime.fromtimestamp(controller.time, timezone.utc).strftime("%Y-%m-%d %H:%M:%S")
    lines = [
        f">>SYSTEM: {identity.system_name}",
        f">>SYSTEM_ID: {identity.system_id}",
        f">>ROBOTWARE: {identity.robotware}",
        f">>DATE: {when}",
        *(f">>OPTION: {option}" for option in identity.options),
        *(f">>TASK{number}: ({name},,)" for number, name in enumerate(controller.tasks, 1)),
    ]
    content = {_INFO: "\n".join(lines) + "\n"}
    for domain in DOMAINS:
        content[f"SYSPAR/{domain}.cfg"] = controller.configuration.text(domain)
    for number, task in enumerate(controller.tasks.values(), 1):
        for module in task.modules:
            folder, suffix = ("SYSMOD", "sys") if module.is_system else ("PROGMOD", "mod")
            content[f"RAPID/TASK{number}/{folder}/{module.name}.{suffix}"] = module.text
    home = [files.get_file(each) for each in tuple(files) if each.upper().startswith(_HOME)]
    for name, text in content.items():
        files.write(f"{path}/{name}", text.encode(ENCODING, "replace"))
    for file in home:
        files.write(f"{path}/HOME{file.path[len('HOME:') :]}", file.content or b"")


def check_backup(controller: Irc5, path: str) -> str:
    """Refuse what cannot be restored; the name of the system it is of.

    Raises:
        Refused: NO_FILE where there is no backup.
    """
    text = controller.files.get(f"{path}/{_INFO}")
    if text is None:
        raise Refused(Refusal.NO_FILE, f"{path} is not a backup: it has no {_INFO}.")
    return next((line.partition(":")[2].strip() for line in text.splitlines() if line.startswith(">>SYSTEM:")), "")


def restore_backup(controller: Irc5, path: str, *, cfg: bool = True, modules: bool = True) -> None:
    """Become as in a backup: system parameters, HOME and programs; a restart brings it into effect.

    Raises:
        Refused: NO_FILE where there is no backup, BAD_PROGRAM where it has something that is not RAPID.
        SettingsError: its system parameters cannot be read.
    """
    check_backup(controller, path)
    files = controller.files
    folder = f"{path.lower()}/"
    inside = {each[len(folder) :]: files.get_file(each) for each in tuple(files) if each.lower().startswith(folder)}
    if cfg:
        texts = [
            (file.content or b"").decode(ENCODING)
            for name, file in inside.items()
            if name.upper().startswith("SYSPAR/")
        ]
        restored = Configuration(texts)
        controller.configuration.become(restored)
    if modules:
        for each in [each for each in tuple(files) if each.upper().startswith(_HOME)]:
            files.remove(each)
        for name, file in inside.items():
            if name.upper().startswith("HOME/"):
                files.write(f"HOME:/{name[len('HOME/') :]}", file.content or b"")
        for number, task in enumerate(controller.tasks.values(), 1):
            texts = [
                (file.content or b"").decode(ENCODING)
                for name, file in inside.items()
                if name.upper().startswith(f"RAPID/TASK{number}/")
            ]
            task.lose_pp()
            for module in task.modules:
                task.unload(module.name)
            for text in texts:
                task.load(text, f"TASK{number}")
