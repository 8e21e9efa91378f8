"""The delivery to a controller: the modules and settings that this package needs there, and what is the user's own."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from importlib.resources import files
from pathlib import Path

from abb_protocols.catalogue import Message, message
from abb_protocols.robot.joints import Side
from abb_protocols.rws.cfg_files import CFG_FLAG, CfgFile, read_cfg, stated_attributes
from yumi.driver.commissioning.contents import CfgKey, Contents, ModuleKey, is_same_module
from yumi.driver.launch_checks import EgmAddress

GRIPPER_MODULE = "TRobSG"
"""The module that needs the product SmartGripper."""

OWN_MODULE = "TRobSystem"
"""The module that is the user's to edit: it is loaded where there is none, and never replaced."""

_FOLDER = "HOME:/yumi/"
"""Where the modules are on the controller."""

STATE_MACHINE_ADD_INS = ("StateMachine Core", "StateMachine", "StateMachine Add-In")
"""Names of ABB's StateMachine Add-In among the options: it has the same interface and modules of the same names."""
_MAIN = re.compile(r"(?im)^\s*proc\s+main\s*\(")

INSTANCE_KEYS = {"CAB_TASK_MODULES": "File", "SYSSIG_OUT": "Signal"}
"""What distinguishes instances of a type without names."""

_OUR_FILES = {f"{_FOLDER}{each.name}" for each in files("abb_protocols.controller_files").iterdir()}
_INTO = ("Task", "Shared", "AllTask", "AllMotionTask")
"""Into which tasks a line of CAB_TASK_MODULES loads its file: of another's files, several lines may name the same."""


def delivered_modules() -> dict[str, str]:
    """The RAPID modules of this package by name."""
    folder = files("abb_protocols.controller_files")
    paths = sorted(each.name for each in folder.iterdir() if each.name.endswith((".mod", ".sys")))
    return {Path(path).stem: (folder / path).read_text(encoding="latin-1") for path in paths}


def has_main(text: str) -> bool:
    """Whether a module declares the procedure a program begins with."""
    return _MAIN.search(text) is not None


def delivered(addresses: Mapping[Side, EgmAddress], *, has_grippers: bool = True, has_add_in: bool = False) -> Contents:
    """What this package wants on a controller.

    Args:
        addresses: where each arm's datagrams are awaited; the robot sends them there.
        has_grippers: whether the controller has the SmartGripper product, which one module needs.
        has_add_in: whether ABB's Add-In is installed: then only the destinations of the datagrams are ours.
    """
    modules = {name: text for name, text in delivered_modules().items() if has_grippers or name != GRIPPER_MODULE}
    suffixes = {OWN_MODULE: ".sys"}
    paths = {name: f"{_FOLDER}{name}{suffixes.get(name, '.mod')}" for name in modules}
    cfg: dict[CfgKey, Mapping[str, str] | None] = {}
    for file in _delivered_cfg():
        for type_name, attributes in file.instances:
            key = CfgKey(file.domain, type_name, delivered_name_of(type_name, attributes))
            if type_name == "COM_TRP":
                side = next(side for side in Side if side.unit == key.name)
                host, port = addresses[side].host, str(addresses[side].port)
                cfg[key] = {**attributes, "RemoteAdress": host, "RemotePortNumber": port}
            elif not has_add_in and (type_name != "CAB_TASK_MODULES" or key.name in paths.values()):
                cfg[key] = attributes
    if has_add_in:
        return Contents(cfg=cfg)
    return Contents(
        files={_FOLDER: "", **{paths[name]: text for name, text in modules.items()}},
        cfg=cfg,
        modules={ModuleKey(side.task, name): text for side in Side for name, text in modules.items()},
    )


def with_own_routines(present: Contents, wanted: Contents) -> Contents:
    """What is wanted, but the user's own module as it is, where it is there already."""
    file, modules = _own(wanted)
    if not modules:
        return wanted
    text = present.files.get(file) or next(filter(None, map(present.modules.get, modules)), None) or wanted.files[file]
    own = Contents({file: text}, modules={key: present.modules.get(key) or text for key in modules})
    return own.completed_from(wanted)


def without_loss(present: Contents, before: Contents) -> tuple[Contents, list[Message]]:
    """What was there before, but what others have changed since as it is now; with notes of that.

    The user's own module stays as a file, and goes from the tasks, as it may name what goes, too. A program of another
    that is loaded stays as it is.
    """
    ours = delivered_modules()
    file, own = _own(before)
    texts = [present.files.get(file), *map(present.modules.get, own)]
    edited = next((text for text in texts if text is not None and not is_same_module(text, ours[OWN_MODULE])), None)
    kept, notes = Contents(), []
    if edited is not None and file in before.files and before.files[file] is None:
        kept = Contents({file: edited, _FOLDER: ""})
        notes.append(message("own_file_stays", file=file))
    names = {name.lower() for name in ours}
    for module, text in before.modules.items():
        now = present.modules.get(module)
        if now is not None and module.name.lower() not in names and not is_same_module(now, text):
            kept = Contents(modules={module: now}).completed_from(kept)
            notes.append(message("module_loaded_since_stays", module=module.name, task=module.task))
    return kept.completed_from(before), notes


def _own(contents: Contents) -> tuple[str, list[ModuleKey]]:
    """The file and the loaded modules that are the user's to edit."""
    return f"{_FOLDER}{OWN_MODULE}.sys", [key for key in contents.modules if key.name == OWN_MODULE]


def _delivered_cfg() -> Iterator[CfgFile]:
    folder = files("abb_protocols.controller_files")
    for name in sorted(each.name for each in folder.iterdir() if each.name.endswith(".cfg")):
        yield read_cfg((folder / name).read_text(encoding="latin-1"))


def delivered_name_of(type_name: str, attributes: Mapping[str, str]) -> str:
    key = INSTANCE_KEYS.get(type_name)
    name = attributes.get(key, "") if key else attributes.get("Name") or attributes.get("name") or ""
    if type_name != "CAB_TASK_MODULES" or name in _OUR_FILES:
        return name
    given = stated_attributes(attributes)
    into = (each if given[each] == CFG_FLAG else given[each] for each in _INTO if each in given)
    return f"{name} in {', '.join(into) or 'no task'}"
