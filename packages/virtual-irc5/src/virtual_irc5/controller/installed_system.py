"""The installed system of the virtual controller: RobotWare, options, parameters, files, modules; also of a backup.

The robots are data, each with system parameters of its own (``stock``). The modules are ours (the state machine of
`abb_protocols.controller_files`), a user's own RAPID files, or those of a backup as a controller or RobotStudio writes
it: ``BACKINFO``, ``SYSPAR``, ``RAPID/TASKn/PROGMOD``, ``RAPID/TASKn/SYSMOD`` and ``HOME``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from xml.etree import ElementTree

import abb_protocols.controller_files
import virtual_irc5.controller
from abb_protocols.errors import SettingsError
from abb_protocols.robot.arm_kinematics import KinematicArm
from abb_protocols.robot.irb120 import irb120
from abb_protocols.robot.joints import Side
from abb_protocols.robot.yumi_arms import irb14050, yumi_arm
from virtual_irc5.controller.file_store import DISK_DEVICES, decoded_file_text
from virtual_irc5.controller.task_settings import TaskSettings, task_settings
from virtual_irc5.mechanics.units import YUMI_UNITS, MechanicalUnit, mechanical_unit, seven_axis_units
from virtual_irc5.system_parameters import SystemConfiguration

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

_STOCK = Path(next(iter(virtual_irc5.controller.__path__)))
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
class InstalledRobot:
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
    arms: Mapping[Side, Callable[[], KinematicArm]]
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


_YUMI = InstalledRobot(
    "yumi",
    "IRB 14000-0.5/0.5",
    "YuMi",
    {side: lambda side=side: yumi_arm(side) for side in Side},  # type: ignore[misc]
    YUMI_UNITS,
    YUMI_OPTIONS,
    _STOCK / "stock",
    is_yumi=True,
)
ROBOTS: Mapping[str, InstalledRobot] = {
    robot.name: robot
    for robot in (
        _YUMI,
        InstalledRobot(
            "irb14050",
            "IRB 14050-0.5/0.5",
            "IRB_14050",
            {Side.RIGHT: irb14050},
            seven_axis_units("ROB_1", Side.RIGHT, "T_ROB1"),
            (*_OPTIONS, "Leadthrough", "Drive System IRB 14050", "Hall Sensor Calibration", "IRB 14050-0.5/0.5"),
            _STOCK / "stock_irb14050",
        ),
        InstalledRobot(
            "irb120",
            "IRB 120-3/0.6",
            "IRB_120",
            {Side.RIGHT: irb120},
            (mechanical_unit("ROB_1", Side.RIGHT, "T_ROB1", total_axes=6),),
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

PARAMETER_DOMAINS = ("EIO", "MMC", "MOC", "PROC", "SIO", "SYS")
"""Of system parameters; each has a cfg file in a backup."""

SYSTEM_HOME = "HOME:/"
SYSTEM_BACKUP_INFO = "BACKINFO/backinfo.txt"
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
    robot: InstalledRobot = _YUMI

    def configuration(self) -> SystemConfiguration:
        """A stock robot's parameters, then these; raises SettingsError."""
        configuration = SystemConfiguration(
            path.read_text(encoding="ascii") for path in sorted(self.robot.stock.glob("*.cfg"))
        )
        for text in self.restored:
            configuration.load(text, _REPLACED)
        for text in self.parameters:
            configuration.load(text)
        return configuration


def delivered_system(robot: InstalledRobot = _YUMI) -> System:
    """The state machine in both tasks of a YuMi; any other robot as it leaves the factory."""
    if not robot.is_yumi:
        return factory_system(robot)
    folder = Path(next(iter(abb_protocols.controller_files.__path__)))
    modules = sorted([*folder.glob("*.mod"), *folder.glob("*.sys")])
    cfg = [path.read_text(encoding="ascii") for path in sorted(folder.glob("*.cfg"))]
    return System(tuple(cfg), {f"{SYSTEM_HOME}yumi/{path.name}": path.read_bytes() for path in modules})


def factory_system(robot: InstalledRobot = _YUMI) -> System:
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
    system = replace(system, parameters=(*system.parameters, *(decoded_file_text(_read(path)) for path in cfg)))
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
            place = f"{SYSTEM_HOME}{path.name}"
            content = _read(path)
            if files.setdefault(place, content) != content:  # two files of one name
                place = f"{SYSTEM_HOME}{task.lower()}/{path.name}"
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
    return any(is_user_module(decoded_file_text(files[path])) for path in paths)


def read_backup(folder: Path, robot: InstalledRobot = _YUMI) -> System:
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
    files = {f"{SYSTEM_HOME}{path.relative_to(home).as_posix()}": _read(path) for path in inside if home}
    system = System((), files, tuple(decoded_file_text(_read(path)) for path in cfg), robot=robot)
    # Which task TASK1 is stands in BACKINFO; without it the tasks are in the order of their declarations.
    information = _inside(folder, "BACKINFO")
    texts = (
        [decoded_file_text(_read(path)) for path in sorted(information.glob("*.[tT][xX][tT]"))] if information else []
    )
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
            files[f"{SYSTEM_HOME}RAPID/{place.name}/{path.name}"] = _read(path)
        found = [f"{SYSTEM_HOME}RAPID/{place.name}/{path.name}" for path in sources]
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


def modules_of(task: TaskSettings, system: System, configuration: SystemConfiguration) -> tuple[str, ...]:
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
            if path.partition(":")[0].upper() in DISK_DEVICES:
                paths.append(path)
    return tuple(paths)
