"""The installation of this package on a controller: the difference to what it has is installed, removed, rolled back.

Everything, configuration, files and the RAPID modules in both tasks, is one operation: read what is there, compare it
with what is wanted, change the rest, read again. What was there before the first installation is kept in a record on
this machine, so that it can be wanted again. Nothing that is not named in what is wanted is ever touched.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import PurePosixPath

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import (
    CommandRefused,
    ControllerRefused,
    NoConnection,
    ProtocolError,
    RobotNotReady,
    SettingsError,
)
from abb_protocols.robot.joints import Side
from abb_protocols.rws.cfg_files import stated_attributes, write_cfg
from abb_protocols.rws.operations.service import OnProgress
from abb_protocols.rws.operations.system import SystemInfo
from abb_protocols.rws.values import ExecutionState, Grant, OperatingMode, RwsCode
from abb_runtime.rws.client import RwsClient
from yumi.driver.commissioning.contents import (
    CfgKey,
    Contents,
    ContentsChange,
    ModuleKey,
    changed,
    differences,
    is_same_module,
)
from yumi.driver.commissioning.delivery import (
    GRIPPER_MODULE,
    INSTANCE_KEYS,
    OWN_MODULE,
    STATE_MACHINE_ADD_INS,
    delivered,
    delivered_modules,
    delivered_name_of,
    has_main,
    with_own_routines,
    without_loss,
)
from yumi.driver.commissioning.installation_record import InstallationRecord
from yumi.driver.launch_checks import GRIPPER_PRODUCT, OLDEST_ROBOTWARE, REQUIRED_OPTIONS, EgmAddress

NEWEST_ROBOTWARE = 6
"""RobotWare 7 has Robot Web Services 2, another protocol."""

MASTERSHIPS = ("cfg", "rapid")
"""Domains in which a client may hold the right to change something: a restart would take what it works on."""

_HEADERS = {
    "EIO": "EIO:CFG_1.0:6:1::",
    "MOC": "MOC:CFG_1.0:6:0::",
    "SIO": "SIO:CFG_1.0:6:1::",
    "SYS": "SYS:CFG_1.0:6:0::",
}
_BACKUP_INFO = "BACKINFO/"
_TEMPORARY = "TEMP:/yumi_install"
_NOT_FOUND = (400, 404)  # which of the two a directory that is not there gives, differs by version
_NO_TYPE = (RwsCode.CFG_TYPE_INVALID, RwsCode.CFG_INSTANCE_INVALID)
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


def _add_in_of(system: SystemInfo) -> str | None:
    return next((name for name in STATE_MACHINE_ADD_INS if name in system.options), None)


def _folder(path: str) -> str:
    """The directory of a file or of a directory, with a slash at its end."""
    return path.rstrip("/").rpartition("/")[0] + "/"


@dataclass(frozen=True, slots=True)
class InstallationPlan:
    """What an installation would do.

    Attributes:
        changes: line by line; empty when all is there.
        wanted: what will be there.
        present: what is there of it now.
        refusals: why it cannot be done now, each with what to do; empty when it can.
        notes: what is worth knowing.
        is_restart_due: whether the controller has not restarted since an earlier change of its configuration.
    """

    changes: tuple[ContentsChange, ...]
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

    def __init__(
        self, client: RwsClient, record: InstallationRecord, on_progress: OnProgress = lambda text: None
    ) -> None:
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
    ) -> InstallationPlan:
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
        wanted = with_own_routines(present, wanted)
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

    def _plan(
        self, present: Contents, wanted: Contents, refusals: Iterable[Message], notes: Iterable[Message]
    ) -> InstallationPlan:
        is_due = self._record.is_restart_due
        if is_due:
            notes = (*notes, message("restart_is_due"))
        return InstallationPlan(differences(present, wanted), wanted, present, tuple(refusals), tuple(notes), is_due)

    def plan_roll_back(self) -> InstallationPlan:
        """How everything becomes as the record says.

        Raises:
            CommandRefused: this machine has no record.
        """
        before = self._record.before
        if before is None:
            raise CommandRefused(message("nothing_to_roll_back", file=str(self._record.path)))
        present = self.read(before)
        wanted, notes = without_loss(present, before)
        return self._plan(present, wanted, (*self._ungranted(_GRANTS), *self._busy()), notes)

    def plan_removal(self, system: SystemInfo, addresses: Mapping[Side, EgmAddress]) -> InstallationPlan:
        """What is to be taken away: everything becomes as the record says, or, without one, what is ours goes."""
        if self._record.before is not None:
            return self.plan_roll_back()
        add_in = _add_in_of(system)
        if add_in is not None:
            refusal = message("names_are_of_add_in", add_in=add_in)
            return InstallationPlan((), Contents(), Contents(), (refusal, *self._busy()))
        ours = delivered(addresses)
        present = self.read(ours.absent())
        wanted, kept = without_loss(present, ours.absent())
        notes = [message("removed_by_name"), *kept]
        for module, text in present.modules.items():
            if text is not None and module.name != OWN_MODULE and not is_same_module(text, ours.modules.get(module)):
                notes.append(message("change_of_module_lost", module=module.name, task=module.task))
        return self._plan(present, wanted, (*self._ungranted(_GRANTS), *self._busy()), notes)

    def _unsuitable(self, system: SystemInfo) -> Iterator[Message]:
        if tuple(system.robotware[:2]) < OLDEST_ROBOTWARE:
            yield message("robotware_without_egm", version=system.version)
        elif system.robotware[0] > NEWEST_ROBOTWARE:
            yield message("robotware_too_new", version=system.version)
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
        return {delivered_name_of(type_name, each.attributes): (each.name, each.attributes) for each in found}

    def _listed(self, folder: str) -> set[str]:
        try:
            return {f"{folder}{entry.name}".lower() for entry in self._client.files(folder)}
        except ControllerRefused as error:
            if error.status not in _NOT_FOUND:
                raise
            return set()

    # Doing it

    def install(self, plan: InstallationPlan, *, makes_backup: bool = True) -> None:
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
            key: stated_attributes(now)  # as a file is what brings it back
            for key, now in present.cfg.items()
            if now is not None and wanted.cfg[key] is None
        }
        present = Contents(cfg=removed).completed_from(present)
        if recorded is not None:
            others = {key: text for key, text in present.modules.items() if text and wanted.modules[key] is None}
            present = Contents(modules=others).completed_from(recorded.completed_from(present))
        self._record.before = present
        self._record.save()

    def undo(self, plan: InstallationPlan) -> None:
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
        wanted, _ = without_loss(self.read(before), before)  # which may have changed since the plan was made
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
            if is_same_module(now, text):
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
            elif attributes is not None and now is not None and (new := changed(now, attributes)):
                self._note_restart()
                self._report(f"change {key.domain} {key.type} {key.name}")
                client.set_cfg(key.domain, key.type, self._title(key), new)
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
        return self._instances(key.domain, key.type)[key.name][0] if key.type in INSTANCE_KEYS else key.name

    def _note_restart(self) -> None:
        if not self._record.is_restart_due:
            self._record.is_restart_due = True
            self._record.save()
