"""The installation of this package on a controller: the difference to what it has is installed, removed, rolled back.

Everything, configuration, files and the RAPID modules in both tasks, is one operation: read what is there, compare it
with what is wanted, change the rest, read again. What was there before the first installation is kept in a record on
this machine, so that it can be wanted again. Nothing that is not named in what is wanted is ever touched.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import datetime
from importlib.resources import files
from math import isclose
from pathlib import Path, PurePosixPath
from typing import NamedTuple

from yumi.catalogue import Message, message, quoted
from yumi.driver.bringup import GRIPPER_PRODUCT, OLDEST_ROBOTWARE, REQUIRED_OPTIONS, EgmAddress
from yumi.errors import CommandRefused, ControllerRefused, NoConnection, ProtocolError, RobotNotReady, SettingsError
from yumi.robot.joints import Side
from yumi.rws.client import RwsClient
from yumi.rws.documents import SystemInfo
from yumi.rws.session import OnProgress
from yumi.rws.types import FLAG, CfgFile, Code, ExecutionState, Grant, OperatingMode, read_cfg, stated, write_cfg

GRIPPER_MODULE = "TRobSG"
"""The module that needs the product SmartGripper."""

OWN_MODULE = "TRobSystem"
"""The module that is the user's to edit: it is loaded where there is none, and never replaced."""

NEWEST_ROBOTWARE = 6
"""RobotWare 7 has Robot Web Services 2, another protocol."""

FOLDER = "HOME:/yumi/"
"""Where the modules are on the controller."""

ADD_INS = ("StateMachine Core", "StateMachine", "StateMachine Add-In")
"""Names of ABB's StateMachine Add-In among the options: it has the same interface and modules of the same names."""

MASTERSHIPS = ("cfg", "rapid")
"""Domains in which a client may hold the right to change something: a restart would take what it works on."""

_CODE = re.compile(r'(?:"[^"]*"|[^"!])*')
"""A line up to its comment."""

_PERSISTENT = re.compile(r"\b(pers\s+\w+\s+\w+(?:\{[^}]*\})?)\s*:=[^;]*;", re.IGNORECASE)
_MAIN = re.compile(r"(?im)^\s*proc\s+main\s*\(")

_KEYS = {"CAB_TASK_MODULES": "File", "SYSSIG_OUT": "Signal"}
"""What distinguishes instances of a type without names."""

_OUR_FILES = {f"{FOLDER}{each.name}" for each in files("yumi.controller_files").iterdir()}
_INTO = ("Task", "Shared", "AllTask", "AllMotionTask")
"""Into which tasks a line of CAB_TASK_MODULES loads its file: of another's files, several lines may name the same."""

_HEADERS = {
    "EIO": "EIO:CFG_1.0:6:1::",
    "MOC": "MOC:CFG_1.0:6:0::",
    "SIO": "SIO:CFG_1.0:6:1::",
    "SYS": "SYS:CFG_1.0:6:0::",
}
_SAME = 1e-4  # relative difference of two numbers that are the same: the controller rounds
_SET = {"true", "yes", "1"}  # a flag in a file, and what controllers make of it
_BACKUP_INFO = "BACKINFO/"
_TEMPORARY = "TEMP:/yumi_install"
_NOT_FOUND = (400, 404)  # which of the two a directory that is not there gives, differs by version
_NO_TYPE = (Code.CFG_TYPE_INVALID, Code.CFG_INSTANCE_INVALID)
_GRANTS = {
    Grant.FTP_READ: "read files",
    Grant.FTP_WRITE: "write files",
    Grant.CFG_WRITE: "load configuration",
    Grant.RAPID_LOADPROGRAM: "load modules",
    Grant.RAPID_DEBUG: "ask for write access",
    Grant.REMOTE_WARMSTART: "restart",
}
_BACKUP_GRANT = {Grant.BACKUP: "make a backup, or say --no-backup"}


def missing_grants(client: RwsClient, needed: Mapping[Grant, str]) -> list[str]:
    """What the user may not do of what is needed; nothing on a controller that does not say it in ABB's words."""
    grants = set(client.grants())
    if Grant.FULL_ACCESS.value in grants or not any(name.startswith("UAS_") for name in grants):
        return []
    return [f"{each.value} ({what})" for each, what in needed.items() if each.value not in grants]


class CfgKey(NamedTuple):
    """One instance of the configuration; the name, or what distinguishes it in a type without names."""

    domain: str
    type: str
    name: str


class ModuleKey(NamedTuple):
    """A RAPID module in a task."""

    task: str
    name: str


@dataclass(frozen=True, slots=True)
class Contents:
    """A part of what is on a controller; None for what is not there.

    Attributes:
        files: texts by path; a directory ends in a slash and has the text "".
        cfg: attributes of instances.
        modules: texts of loaded modules.
    """

    files: Mapping[str, str | None] = field(default_factory=dict)
    cfg: Mapping[CfgKey, Mapping[str, str] | None] = field(default_factory=dict)
    modules: Mapping[ModuleKey, str | None] = field(default_factory=dict)

    def absent(self) -> Contents:
        """The same things, none of them there."""
        return Contents(dict.fromkeys(self.files), dict.fromkeys(self.cfg), dict.fromkeys(self.modules))

    def completed_from(self, other: Contents) -> Contents:
        """This, and what only the other has."""
        return Contents({**other.files, **self.files}, {**other.cfg, **self.cfg}, {**other.modules, **self.modules})

    def as_json(self) -> dict[str, object]:
        """For a record."""
        return {
            "files": dict(self.files),
            "cfg": [[*key, attributes and dict(attributes)] for key, attributes in self.cfg.items()],
            "modules": [[*key, text] for key, text in self.modules.items()],
        }

    @classmethod
    def of_json(cls, value: Mapping[str, object]) -> Contents:
        """Out of a record."""
        texts, cfg, modules = value["files"], value["cfg"], value["modules"]
        assert isinstance(texts, dict)
        assert isinstance(cfg, list)
        assert isinstance(modules, list)
        return cls(
            texts,
            {CfgKey(domain, type, name): attributes for domain, type, name, attributes in cfg},
            {ModuleKey(task, name): text for task, name, text in modules},
        )


@dataclass(frozen=True, slots=True)
class Change:
    """One line of a plan.

    Attributes:
        sign: ``+`` what comes, ``-`` what goes, ``~`` what becomes different.
        place: what it is, and where.
        what: how it changes, where it is there before and after.
    """

    sign: str
    place: str
    what: str = ""

    def __str__(self) -> str:
        return f"{self.sign} {self.place}{f': {self.what}' if self.what else ''}"


def differences(present: Contents, wanted: Contents) -> tuple[Change, ...]:
    """What has to change, in the order of cfg, files and modules; attributes that are not wanted do not count."""
    changes = []
    for key, attributes in wanted.cfg.items():
        now, place = present.cfg.get(key), f"{key.domain} {key.type} {key.name}"
        if attributes is None and now is not None:
            changes.append(Change("-", place))
        elif attributes is not None and now is None:
            shown = (f"{name} {value}" for name, value in attributes.items() if value not in ("", key.name))
            changes.append(Change("+", place, ", ".join(shown)))
        elif attributes is not None and now is not None and (changed := _changed(now, attributes)):
            shown = (f"{name} {now.get(name, '')!r} becomes {value!r}" for name, value in changed.items())
            changes.append(Change("~", place, ", ".join(shown)))
    for path, text in wanted.files.items():
        if (was := present.files.get(path)) != text:
            changes.append(_change(f"{'directory' if path.endswith('/') else 'file'} {path}", was, text))
    for module, text in wanted.modules.items():
        if not _is_same_module(was := present.modules.get(module), text):
            changes.append(_change(f"module {module.name} in {module.task}", was, text))
    return tuple(changes)


def _change(place: str, before: str | None, after: str | None) -> Change:
    if before is None or after is None:
        return Change("+" if before is None else "-", place)
    was, becomes = before.splitlines(), after.splitlines()
    return Change("~", place, f"{len({*becomes} - {*was})} new lines, {len({*was} - {*becomes})} gone")


def _changed(now: Mapping[str, str], wanted: Mapping[str, str]) -> dict[str, str]:
    return {name: value for name, value in wanted.items() if not _is_same_value(now.get(name, ""), value)}


def _is_same_value(one: str, other: str) -> bool:
    try:
        return isclose(float(one), float(other), rel_tol=_SAME)
    except ValueError:
        words = {one.strip().lower(), other.strip().lower()}
        return len(words) == 1 or words <= _SET


def _is_same_module(one: str | None, other: str | None) -> bool:
    if one is None or other is None:
        return one is other
    return essence(one) == essence(other)


def delivered_modules() -> dict[str, str]:
    """The RAPID modules of this package by name."""
    folder = files("yumi.controller_files")
    paths = sorted(each.name for each in folder.iterdir() if each.name.endswith((".mod", ".sys")))
    return {Path(path).stem: (folder / path).read_text(encoding="latin-1") for path in paths}


def essence(text: str) -> str:
    """A RAPID text to compare: without comments, spaces, letter case and the present values of PERS data."""
    code = "\n".join(match[0] for line in text.splitlines() if (match := _CODE.match(line)))
    return "".join(_PERSISTENT.sub(r"\1;", code).split()).lower()


def has_main(text: str) -> bool:
    """Whether a module declares the procedure a program begins with."""
    return _MAIN.search(text) is not None


def foreign_mains(client: RwsClient, side: Side) -> Iterator[tuple[str, str]]:
    """Name and text of each module in an arm's task that is not one of this package and has a ``main``."""
    ours = {name.lower() for name in delivered_modules()}
    for module in client.modules(side.task):
        if module.name.lower() in ours:
            continue
        try:
            text = client.module_text(side.task, module.name)
        except (ControllerRefused, ProtocolError):  # hidden and encoded modules of ABB, which have no main
            continue
        if has_main(text):
            yield module.name, text


def delivered(addresses: Mapping[Side, EgmAddress], *, has_grippers: bool = True, has_add_in: bool = False) -> Contents:
    """What this package wants on a controller.

    Args:
        addresses: where each arm's datagrams are awaited; the robot sends them there.
        has_grippers: whether the controller has the SmartGripper product, which one module needs.
        has_add_in: whether ABB's Add-In is installed: then only the destinations of the datagrams are ours.
    """
    modules = {name: text for name, text in delivered_modules().items() if has_grippers or name != GRIPPER_MODULE}
    suffixes = {OWN_MODULE: ".sys"}
    paths = {name: f"{FOLDER}{name}{suffixes.get(name, '.mod')}" for name in modules}
    cfg: dict[CfgKey, Mapping[str, str] | None] = {}
    for file in _delivered_cfg():
        for type_name, attributes in file.instances:
            key = CfgKey(file.domain, type_name, _name_of(type_name, attributes))
            if type_name == "COM_TRP":
                side = next(side for side in Side if side.unit == key.name)
                host, port = addresses[side].host, str(addresses[side].port)
                cfg[key] = {**attributes, "RemoteAdress": host, "RemotePortNumber": port}
            elif not has_add_in and (type_name != "CAB_TASK_MODULES" or key.name in paths.values()):
                cfg[key] = attributes
    if has_add_in:
        return Contents(cfg=cfg)
    return Contents(
        files={FOLDER: "", **{paths[name]: text for name, text in modules.items()}},
        cfg=cfg,
        modules={ModuleKey(side.task, name): text for side in Side for name, text in modules.items()},
    )


def _add_in_of(system: SystemInfo) -> str | None:
    return next((name for name in ADD_INS if name in system.options), None)


def _with_own_routines(present: Contents, wanted: Contents) -> Contents:
    """What is wanted, but the user's own module as it is, where it is there already."""
    file, modules = _own(wanted)
    if not modules:
        return wanted
    text = present.files.get(file) or next(filter(None, map(present.modules.get, modules)), None) or wanted.files[file]
    own = Contents({file: text}, modules={key: present.modules.get(key) or text for key in modules})
    return own.completed_from(wanted)


def _without_loss(present: Contents, before: Contents) -> tuple[Contents, list[Message]]:
    """What was there before, but what others have changed since as it is now; with notes of that.

    The user's own module stays as a file, and goes from the tasks, as it may name what goes, too. A program of another
    that is loaded stays as it is.
    """
    ours = delivered_modules()
    file, own = _own(before)
    texts = [present.files.get(file), *map(present.modules.get, own)]
    edited = next((text for text in texts if text is not None and not _is_same_module(text, ours[OWN_MODULE])), None)
    kept, notes = Contents(), []
    if edited is not None and file in before.files and before.files[file] is None:
        kept = Contents({file: edited, FOLDER: ""})
        notes.append(message("own_file_stays", file=file))
    names = {name.lower() for name in ours}
    for module, text in before.modules.items():
        now = present.modules.get(module)
        if now is not None and module.name.lower() not in names and not _is_same_module(now, text):
            kept = Contents(modules={module: now}).completed_from(kept)
            notes.append(message("module_loaded_since_stays", module=module.name, task=module.task))
    return kept.completed_from(before), notes


def _own(contents: Contents) -> tuple[str, list[ModuleKey]]:
    """The file and the loaded modules that are the user's to edit."""
    return f"{FOLDER}{OWN_MODULE}.sys", [key for key in contents.modules if key.name == OWN_MODULE]


def _delivered_cfg() -> Iterator[CfgFile]:
    folder = files("yumi.controller_files")
    for name in sorted(each.name for each in folder.iterdir() if each.name.endswith(".cfg")):
        yield read_cfg((folder / name).read_text(encoding="latin-1"))


def _folder(path: str) -> str:
    """The directory of a file or of a directory, with a slash at its end."""
    return path.rstrip("/").rpartition("/")[0] + "/"


def _name_of(type_name: str, attributes: Mapping[str, str]) -> str:
    key = _KEYS.get(type_name)
    name = attributes.get(key, "") if key else attributes.get("Name") or attributes.get("name") or ""
    if type_name != "CAB_TASK_MODULES" or name in _OUR_FILES:
        return name
    given = stated(attributes)
    into = (each if given[each] == FLAG else given[each] for each in _INTO if each in given)
    return f"{name} in {', '.join(into) or 'no task'}"


@dataclass(slots=True)
class Record:
    """What was there before the first installation on a controller, on this machine's disk.

    Attributes:
        path: of the file; the backup is beside it.
        before: what was there; None where nothing was installed.
        is_restart_due: whether cfg was changed, and the controller was not seen to restart since.
        backups: names of the backups on the controller, the newest last.
    """

    path: Path
    before: Contents | None = None
    is_restart_due: bool = False
    backups: tuple[str, ...] = ()

    @classmethod
    def of(cls, controller: str, folder: Path | None = None) -> Record:
        """The record of a controller, by its name and serial number.

        Raises:
            SettingsError: the file cannot be read.
        """
        state = folder or Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state") / "yumi"
        record = cls(state / "installations" / re.sub(r"[^\w.-]+", "_", controller) / "record.json")
        if record.path.is_file():
            try:
                value = json.loads(record.path.read_text(encoding="utf-8"))
                record.before = Contents.of_json(value["before"])
                record.is_restart_due, record.backups = bool(value["is_restart_due"]), tuple(value["backups"])
            except (OSError, ValueError, KeyError, TypeError, AssertionError) as error:
                raise SettingsError(
                    message("record_unreadable", file=str(record.path), reason=quoted(error))
                ) from error
        return record

    def check_writable(self) -> None:
        """Refuse a folder that no record can be written to.

        Raises:
            SettingsError: it cannot; ``XDG_STATE_HOME`` chooses another one.
        """
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            trial = self.path.with_suffix(".new")
            trial.write_bytes(b"")
            trial.unlink()
        except OSError as error:
            raise SettingsError(
                message("record_folder_not_writable", folder=str(self.path.parent), reason=error.strerror)
            ) from error

    def save(self) -> None:
        """Write it, so that it is there whatever happens next.

        Raises:
            SettingsError: it cannot be written.
        """
        assert self.before is not None, "a record of nothing is not saved"
        value = {
            "before": self.before.as_json(),
            "is_restart_due": self.is_restart_due,
            "backups": self.backups,
        }
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            new = self.path.with_suffix(".new")
            with new.open("w", encoding="utf-8") as opened:
                json.dump(value, opened, indent=1)
                opened.flush()
                os.fsync(opened.fileno())
            new.replace(self.path)
        except OSError as error:
            raise SettingsError(message("record_not_writable", file=str(self.path), reason=error.strerror)) from error

    def close(self) -> None:
        """Everything is as before: keep the record under another name, so that nothing is rolled back twice."""
        self.path.replace(self.path.with_name(f"rolled_back_{datetime.now():%Y%m%d_%H%M%S}.json"))
        self.before, self.is_restart_due = None, False


@dataclass(frozen=True, slots=True)
class Plan:
    """What an installation would do.

    Attributes:
        changes: line by line; empty when all is there.
        wanted: what will be there.
        present: what is there of it now.
        refusals: why it cannot be done now, each with what to do; empty when it can.
        notes: what is worth knowing.
        is_restart_due: whether the controller has not restarted since an earlier change of its configuration.
    """

    changes: tuple[Change, ...]
    wanted: Contents
    present: Contents
    refusals: tuple[Message, ...] = ()
    notes: tuple[Message, ...] = ()
    is_restart_due: bool = False

    @property
    def is_empty(self) -> bool:
        """Whether nothing is to be done."""
        return not self.changes and not self.is_restart_due

    @property
    def needs_restart(self) -> bool:
        return self.is_restart_due or any(change.place.split()[0] in _HEADERS for change in self.changes)


class Installation:
    """Installs on one controller, and takes away again.

    Args:
        client: a connected client.
        record: of this controller.
        on_progress: gets each step and how far it is.
    """

    def __init__(self, client: RwsClient, record: Record, on_progress: OnProgress = lambda text: None) -> None:
        self._client = client
        self._record = record
        self._report = on_progress

    @property
    def can_roll_back(self) -> bool:
        """Whether there is a record of what was there before."""
        return self._record.before is not None

    # Plans

    def plan(
        self,
        system: SystemInfo,
        addresses: Mapping[Side, EgmAddress],
        *,
        replaces_main: bool = False,
        makes_backup: bool = True,
    ) -> Plan:
        """What is to be installed.

        Args:
            system: of the controller.
            addresses: where each arm's datagrams are awaited.
            replaces_main: whether modules of others that have a ``main`` are unloaded; they come back with a roll back.
            makes_backup: whether the controller makes a backup first, for which the user needs a grant.
        """
        add_in = _add_in_of(system)
        has_grippers = GRIPPER_PRODUCT in system.options
        wanted = delivered(addresses, has_grippers=has_grippers, has_add_in=add_in is not None)
        grants = {**_GRANTS, **(_BACKUP_GRANT if makes_backup else {})}
        refusals = [*self._unsuitable(system), *self._ungranted(grants), *self._busy()]
        notes = []
        if add_in is not None:
            notes.append(message("add_in_keeps_modules", add_in=add_in))
        if not has_grippers:
            notes.append(message("module_left_out", product=GRIPPER_PRODUCT, module=GRIPPER_MODULE))
        for removal, found in self._foreign_mains(wanted) if add_in is None else ():
            if replaces_main:
                wanted = removal.completed_from(wanted)
                notes.append(message("other_main_goes", program=found))
            else:
                refusals.append(message("other_main_in_task", program=found))
        present = self.read(wanted)
        wanted = _with_own_routines(present, wanted)
        for key, attributes in wanted.cfg.items():
            now = present.cfg.get(key)
            for name in ("SignalType", "Type", "Device"):
                if attributes and now and now.get(name, "") != attributes.get(name, ""):
                    refusals.append(
                        message(
                            "configured_name_taken",
                            type=f"{key.domain} {key.type}",
                            name=key.name,
                            attribute=name,
                            value=now.get(name, ""),
                            needed=attributes.get(name, ""),
                        )
                    )
        return self._plan(present, wanted, refusals, notes)

    def _plan(self, present: Contents, wanted: Contents, refusals: Iterable[Message], notes: Iterable[Message]) -> Plan:
        is_due = self._record.is_restart_due
        if is_due:
            notes = (*notes, message("restart_is_due"))
        return Plan(differences(present, wanted), wanted, present, tuple(refusals), tuple(notes), is_due)

    def plan_roll_back(self) -> Plan:
        """How everything becomes as the record says.

        Raises:
            CommandRefused: this machine has no record.
        """
        before = self._record.before
        if before is None:
            raise CommandRefused(message("nothing_to_roll_back", file=str(self._record.path)))
        present = self.read(before)
        wanted, notes = _without_loss(present, before)
        return self._plan(present, wanted, (*self._ungranted(_GRANTS), *self._busy()), notes)

    def plan_removal(self, system: SystemInfo, addresses: Mapping[Side, EgmAddress]) -> Plan:
        """What is to be taken away: everything becomes as the record says, or, without one, what is ours goes."""
        if self._record.before is not None:
            return self.plan_roll_back()
        add_in = _add_in_of(system)
        if add_in is not None:
            refusal = message("names_are_of_add_in", add_in=add_in)
            return Plan((), Contents(), Contents(), (refusal, *self._busy()))
        ours = delivered(addresses)
        present = self.read(ours.absent())
        wanted, kept = _without_loss(present, ours.absent())
        notes = [message("removed_by_name"), *kept]
        for module, text in present.modules.items():
            if text is not None and module.name != OWN_MODULE and not _is_same_module(text, ours.modules.get(module)):
                notes.append(message("change_of_module_lost", module=module.name, task=module.task))
        return self._plan(present, wanted, (*self._ungranted(_GRANTS), *self._busy()), notes)

    def _unsuitable(self, system: SystemInfo) -> Iterator[Message]:
        version = ".".join(map(str, system.robotware))
        if tuple(system.robotware[:2]) < OLDEST_ROBOTWARE:
            yield message("robotware_without_egm", version=version)
        elif system.robotware[0] > NEWEST_ROBOTWARE:
            yield message("robotware_too_new", version=version)
        for option, loss in REQUIRED_OPTIONS.items():
            if option not in system.options:
                yield message("option_missing", option=option, loss=loss)
        tasks = {task.name for task in self._client.tasks()}
        for side in Side:
            if side.task not in tasks:
                yield message("no_task", task=side.task)

    def _busy(self) -> Iterator[Message]:
        mode = self._client.operating_mode()
        if mode is not OperatingMode.AUTO:
            yield message("not_in_auto", mode=mode.value)
        if self._client.execution() is ExecutionState.RUNNING:
            yield message("program_runs_on_controller")
        for domain in MASTERSHIPS:
            if holder := self._client.mastership(domain):
                yield message("mastership_held", holder=holder, domain=domain)

    def _ungranted(self, needed: Mapping[Grant, str]) -> Iterator[Message]:
        if missing := missing_grants(self._client, needed):
            yield message("grants_missing", grants=tuple(missing))

    def _foreign_mains(self, wanted: Contents) -> Iterator[tuple[Contents, Message]]:
        """What has a ``main`` and is not of this package: its removal, and what it is."""
        for side in Side:
            for name, text in foreign_mains(self._client, side):
                found = message("module_with_main", task=side.task, module=name, lines=len(text.splitlines()))
                yield Contents(modules={ModuleKey(side.task, name): None}), found
        tasks = {side.task.lower() for side in Side}
        for name, (_, attributes) in self._instances("SYS", "CAB_TASK_MODULES").items():
            key = CfgKey("SYS", "CAB_TASK_MODULES", name)
            assert attributes is not None, "they are of what is there"
            task = attributes.get("Task", "").lower()
            if key in wanted.cfg or (task and task not in tasks):
                continue
            try:
                text = self._client.download(attributes.get("File", ""))
            except ControllerRefused as error:
                if error.status not in _NOT_FOUND:
                    raise
                continue  # what is not there is not loaded
            if has_main(text):
                yield Contents(cfg={key: None}), message("configured_module_with_main", file=name)

    def read(self, wanted: Contents) -> Contents:
        """What is there of all that is named in ``wanted``."""
        types = {
            place: self._instances(*place) for place in dict.fromkeys((key.domain, key.type) for key in wanted.cfg)
        }
        cfg = {key: types[key.domain, key.type].get(key.name, ("", None))[1] for key in wanted.cfg}
        folders = {_folder(path) for path in wanted.files}
        listed = {folder: self._listed(folder) for folder in sorted(folders)}
        texts: dict[str, str | None] = {}
        for path in wanted.files:
            is_there = path.rstrip("/").lower() in listed[_folder(path)]
            texts[path] = None if not is_there else "" if path.endswith("/") else self._client.download(path)
        loaded = {
            task: {module.name.lower(): module.name for module in self._client.modules(task)}
            for task in dict.fromkeys(module.task for module in wanted.modules)
        }
        modules = {
            module: self._client.module_text(module.task, loaded[module.task][module.name.lower()])
            if module.name.lower() in loaded[module.task]
            else None
            for module in wanted.modules
        }
        return Contents(texts, cfg, modules)

    def _instances(self, domain: str, type_name: str) -> dict[str, tuple[str, Mapping[str, str] | None]]:
        """Titles and attributes of the instances by name, or by what distinguishes those without."""
        try:
            found = self._client.cfg(domain, type_name)
        except ControllerRefused as error:
            if error.code not in _NO_TYPE:
                raise
            return {}  # there is none yet
        return {_name_of(type_name, each.attributes): (each.name, each.attributes) for each in found}

    def _listed(self, folder: str) -> set[str]:
        try:
            return {f"{folder}{entry.name}".lower() for entry in self._client.files(folder)}
        except ControllerRefused as error:
            if error.status not in _NOT_FOUND:
                raise
            return set()

    # Doing it

    def install(self, plan: Plan, *, makes_backup: bool = True) -> None:
        """Carry out a plan; afterwards everything that is wanted is there, as was read back.

        Raises:
            RobotNotReady: the plan has refusals, or what was read back is not what is wanted.
            YumiError: the controller refused a step, or it is gone; ``undo`` is possible then.
        """
        for refusal in (*plan.refusals, *self._busy()):  # it may have been started since the plan was made
            raise RobotNotReady(message("nothing_changed", reason=refusal))
        if plan.is_empty:
            return
        self._record.check_writable()  # before the controller works for minutes, or is changed
        if makes_backup and plan.changes:
            self._back_up()
            for refusal in self._busy():  # a backup takes minutes
                raise RobotNotReady(message("nothing_changed", reason=refusal))
        self._keep(plan.wanted)
        self._apply(plan.wanted)

    def _back_up(self) -> None:
        """Have the controller make a backup, and download it beside the record.

        Raises:
            RobotNotReady: what was downloaded is not a backup.
        """
        name = f"yumi_{datetime.now():%Y%m%d_%H%M%S}"
        self._report(f"backup {name}")
        where = self._client.backup(name, lambda state: self._report(f"backup {name}: {state}"))
        tree = self._client.read_tree(where, lambda each: self._report(f"download {each}"))
        if not any(path.upper().startswith(_BACKUP_INFO) for path in tree):
            raise RobotNotReady(
                message("nothing_changed", reason=message("no_backup", folder=where, needed=_BACKUP_INFO))
            )
        folder = self._record.path.parent
        try:
            for path, content in tree.items():
                local = folder / name / PurePosixPath(path)
                local.parent.mkdir(parents=True, exist_ok=True)
                local.write_bytes(content)
        except OSError as error:
            raise SettingsError(
                message("backup_not_writable", folder=str(folder / name), reason=error.strerror)
            ) from error
        self._record.backups += (name,)

    def _keep(self, wanted: Contents) -> None:
        """Record what is there now; what an earlier record has of the same is older, and was before us.

        A program of another that is there now is as its owner wants it, whatever an earlier record has of it.
        """
        present, recorded = self.read(wanted), self._record.before
        removed = {
            key: stated(now)  # as a file is what brings it back
            for key, now in present.cfg.items()
            if now is not None and wanted.cfg[key] is None
        }
        present = Contents(cfg=removed).completed_from(present)
        if recorded is not None:
            others = {key: text for key, text in present.modules.items() if text and wanted.modules[key] is None}
            present = Contents(modules=others).completed_from(recorded.completed_from(present))
        self._record.before = present
        self._record.save()

    def undo(self, plan: Plan) -> None:
        """Carry out a plan of ``plan_roll_back`` or ``plan_removal``, from wherever an earlier one was interrupted.

        Raises:
            RobotNotReady: the plan has refusals, a program runs, or what was read back is not what was wanted.
        """
        for refusal in (*plan.refusals, *self._busy()):
            raise RobotNotReady(message("nothing_changed", reason=refusal))
        if self._record.before is None:
            if not plan.changes:
                return
            self._record.before = plan.wanted  # so that one that is interrupted goes on
            self._record.save()
        before = self._record.before
        wanted, _ = _without_loss(self.read(before), before)  # which may have changed since the plan was made
        self._apply(wanted)
        self._record.close()

    def _apply(self, wanted: Contents) -> None:
        """Change what differs from ``wanted``: it goes on from wherever an earlier one was interrupted."""
        present = self.read(wanted)
        self._write_files(present, wanted)  # first: what cfg and tasks load has to be there
        for module, text in wanted.modules.items():
            if text is None and present.modules[module] is not None:
                self._report(f"unload {module.name} from {module.task}")
                self._client.unload_module(module.task, module.name)
        self._apply_cfg(present, wanted)
        if self._record.is_restart_due:
            for refusal in self._busy():  # a user may have begun to work with it
                raise RobotNotReady(message("not_restarted", reason=refusal))
            self._client.wait_for_restart(self._report)
            self._record.is_restart_due = False
            self._record.save()
        self._load_modules(wanted)
        self._remove_files(present, wanted)
        left = [
            change
            for change in differences(self.read(wanted), wanted)
            if not (change.sign == "-" and change.place.startswith("directory "))
        ]
        if left:
            raise RobotNotReady(message("changes_not_read_back", count=len(left), first=str(left[0])))

    def _write_files(self, present: Contents, wanted: Contents) -> None:
        for path, text in sorted(wanted.files.items()):  # a directory before what is in it
            if text is None or present.files[path] == text:
                continue
            self._report(f"write {path}")
            if path.endswith("/"):
                self._client.make_directory(path)
            else:
                self._client.upload(path, text)

    def _load_modules(self, wanted: Contents) -> None:
        """Those that a restart has not loaded, or not in this text."""
        present = self.read(Contents(modules={key: text for key, text in wanted.modules.items() if text is not None}))
        for module, now in present.modules.items():
            text = wanted.modules[module]
            assert text is not None, "others were not read"
            if _is_same_module(now, text):
                self._report(f"verified {module.name} in {module.task}")
                continue
            self._report(f"load {module.name} into {module.task}")
            file = next((path for path, each in wanted.files.items() if each == text), None)
            if file is not None:
                self._client.load_module(module.task, file)
            else:
                with self._temporary(f"{module.name}.mod", text) as path:
                    self._client.load_module(module.task, path)

    def _remove_files(self, present: Contents, wanted: Contents) -> None:
        for path, text in sorted(wanted.files.items(), reverse=True):  # what is in a directory before the directory
            if text is not None or present.files[path] is None:
                continue
            if path.endswith("/") and self._listed(path):
                self._report(f"{path} stays: there is more in it")
                continue
            self._report(f"remove {path}")
            self._client.delete_file(path.rstrip("/"))

    def _apply_cfg(self, present: Contents, wanted: Contents) -> None:
        client = self._client
        added: dict[str, list[tuple[str, Mapping[str, str]]]] = {}
        for key, attributes in reversed(list(wanted.cfg.items())):  # what names a signal goes before the signal
            now = present.cfg[key]
            if attributes is not None and now is None:
                self._note_restart()
                added.setdefault(key.domain, []).append((key.type, attributes))
            elif attributes is None and now is not None:
                self._note_restart()
                self._report(f"remove {key.domain} {key.type} {key.name}")
                client.remove_cfg(key.domain, key.type, self._title(key))
            elif attributes is not None and now is not None and (changed := _changed(now, attributes)):
                self._note_restart()
                self._report(f"change {key.domain} {key.type} {key.name}")
                client.set_cfg(key.domain, key.type, self._title(key), changed)
        for domain, instances in reversed(added.items()):
            self._report(f"load {len(instances)} instances of {domain}")
            with self._temporary(f"{domain}.cfg", write_cfg(_HEADERS[domain], reversed(instances))) as path:
                client.load_cfg(path)

    @contextmanager
    def _temporary(self, name: str, text: str) -> Iterator[str]:
        """A file on the controller for the time of the block; its path."""
        path = f"{_TEMPORARY}_{name}"
        self._client.upload(path, text)
        try:
            yield path
        finally:
            with suppress(ControllerRefused, NoConnection):  # what failed before says more
                self._client.delete_file(path)

    def _title(self, key: CfgKey) -> str:
        """What the controller calls an instance now; in a type without names that may change with each removal."""
        return self._instances(key.domain, key.type)[key.name][0] if key.type in _KEYS else key.name

    def _note_restart(self) -> None:
        if not self._record.is_restart_due:
            self._record.is_restart_due = True
            self._record.save()
