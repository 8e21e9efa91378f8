"""Backups that the controller makes and restores, as a controller or RobotStudio writes them."""

from __future__ import annotations

from datetime import datetime, timezone

from virtual_irc5.controller.file_store import FILE_ENCODING
from virtual_irc5.controller.installed_system import PARAMETER_DOMAINS, SYSTEM_BACKUP_INFO, SYSTEM_HOME
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.controller_log import RefusalReason, Refused
from virtual_irc5.system_parameters import SystemConfiguration


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
    content = {SYSTEM_BACKUP_INFO: "\n".join(lines) + "\n"}
    for domain in PARAMETER_DOMAINS:
        content[f"SYSPAR/{domain}.cfg"] = controller.configuration.text(domain)
    for number, task in enumerate(controller.tasks.values(), 1):
        for module in task.modules:
            folder, suffix = ("SYSMOD", "sys") if module.is_system else ("PROGMOD", "mod")
            content[f"RAPID/TASK{number}/{folder}/{module.name}.{suffix}"] = module.text
    home = [files.get_file(each) for each in tuple(files) if each.upper().startswith(SYSTEM_HOME)]
    for name, text in content.items():
        files.write(f"{path}/{name}", text.encode(FILE_ENCODING, "replace"))
    for file in home:
        files.write(f"{path}/HOME{file.path[len('HOME:') :]}", file.content or b"")


def check_backup(controller: Irc5, path: str) -> str:
    """Refuse what cannot be restored; the name of the system it is of.

    Raises:
        Refused: NO_FILE where there is no backup.
    """
    text = controller.files.get(f"{path}/{SYSTEM_BACKUP_INFO}")
    if text is None:
        raise Refused(RefusalReason.NO_FILE, f"{path} is not a backup: it has no {SYSTEM_BACKUP_INFO}.")
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
            (file.content or b"").decode(FILE_ENCODING)
            for name, file in inside.items()
            if name.upper().startswith("SYSPAR/")
        ]
        restored = SystemConfiguration(texts)
        controller.configuration.become(restored)
    if modules:
        for each in [each for each in tuple(files) if each.upper().startswith(SYSTEM_HOME)]:
            files.remove(each)
        for name, file in inside.items():
            if name.upper().startswith("HOME/"):
                files.write(f"HOME:/{name[len('HOME/') :]}", file.content or b"")
        for number, task in enumerate(controller.tasks.values(), 1):
            texts = [
                (file.content or b"").decode(FILE_ENCODING)
                for name, file in inside.items()
                if name.upper().startswith(f"RAPID/TASK{number}/")
            ]
            task.lose_pp()
            for module in task.modules:
                task.unload(module.name)
            for text in texts:
                task.load(text, f"TASK{number}")
