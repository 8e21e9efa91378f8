"""Operations on system parameters (``/rw/cfg``), and the client's calls of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

from abb_protocols.rws.documents import RwsState
from abb_protocols.rws.operations.files import file_path
from abb_protocols.rws.operations.operation import delete, get, post
from abb_protocols.rws.operations.operation_answer import flag, pair, record
from abb_protocols.rws.operations.service import Service
from abb_protocols.rws.values import Grant

_TYPE = "/rw/cfg/{domain}/{type}"
_DOMAIN = "/rw/cfg/{domain}"


@dataclass(frozen=True, slots=True)
class CfgInstance:
    """One instance of a configuration type, its attributes as text."""

    name: str
    attributes: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class CfgAttribute:
    """An attribute of a type.

    Attributes:
        name: of it.
        type: such as ``string`` or ``float``.
        count: number of values.
        lowest, highest: limits of its value, or of its length.
        initial: value of a new instance.
        is_mandatory: whether an instance must have it.
    """

    name: str
    type: str
    count: Annotated[str, "numbers"] = "1"
    lowest: Annotated[str, "mini"] = ""
    highest: Annotated[str, "max"] = ""
    initial: Annotated[str, "init"] = ""
    is_mandatory: Annotated[bool, "mandatory", flag("true", "false")] = False


CFG_DOMAINS = get("/rw/cfg")
LOAD_CFG_FILE = post(
    "/rw/cfg", "load", "filepath, action-type=add|replace|add-with-reset", needs="cfg", grant=Grant.CFG_WRITE
)
VALIDATE_CFG_FILE = post("/rw/cfg", "validate", "filepath, action-type=add|replace|add-with-reset", status=200)
VALIDATE_CFG_REMOVAL = post("/rw/cfg", "validate-inst-at-del", "name")
VALIDATE_CFG_INSTANCES = post(
    "/rw/cfg", "validate-instances", "operation=0|1, cfgdomain, cfgtype, instances, instancescount"
)
KEYLESS = post("/rw/cfg", "keyless", "state=run", status=403)
CFG_TYPES = get(_DOMAIN, "start, limit")
SAVE_CFG_DOMAIN = post(_DOMAIN, "saveas", "filepath, save-mode", grant=Grant.BACKUP)
RESET_CFG_DOMAIN = post(_DOMAIN, "reset", needs="cfg", grant=Grant.CFG_WRITE, status=200)
CFG_TYPE = get(_TYPE).shows(pair("cfg-dt", "cfg-no-of-attributes", "cfg-no-of-instances"))
CFG_ATTRIBUTES = get(f"{_TYPE}/attributes").shows(record("cfg-dt-attribute-li", CfgAttribute))
CFG_INSTANCES = get(f"{_TYPE}/instances", "start, limit")
RESET_CFG_INSTANCES = post(f"{_TYPE}/instances", "reset", needs="cfg", grant=Grant.CFG_WRITE)
CREATE_CFG_INSTANCE = post(
    f"{_TYPE}/instances", "create-default", "name", needs="cfg", grant=Grant.CFG_WRITE, status=201
)
CFG_INSTANCE = get(f"{_TYPE}/instances/{{instance}}")
SET_CFG_INSTANCE = post(f"{_TYPE}/instances/{{instance}}", "set", needs="cfg", grant=Grant.CFG_WRITE)
REMOVE_CFG_INSTANCE = delete(f"{_TYPE}/instances/{{instance}}", needs="cfg", grant=Grant.CFG_WRITE)


def _cfg_instance_of(state: RwsState) -> CfgInstance:
    """An instance with the attributes in its list."""
    return CfgInstance(state.title, {each.title: each.fields.get("value", "") for each in state.children})


class ConfigurationService(Service):
    """``/rw/cfg``."""

    def cfg(self, domain: str, type: str) -> tuple[CfgInstance, ...]:
        """All instances of a configuration type, such as ``SIO`` and ``COM_TRP``."""
        states = self._listed(f"reading the configuration {domain}/{type}", CFG_INSTANCES, domain, type)
        return tuple(_cfg_instance_of(state) for state in states if state.type == "cfg-dt-instance-li")

    def set_cfg(self, domain: str, type: str, name: str, attributes: Mapping[str, str]) -> None:
        """Change attributes of an instance of the configuration; they act after the next restart."""
        changed = replace(SET_CFG_INSTANCE.request(domain, type, name), form=tuple(attributes.items()))
        self._sent(f"changing {domain}/{type}/{name}", SET_CFG_INSTANCE, changed)

    def create_cfg(self, domain: str, type: str, name: str) -> None:
        """Add an instance with default values to the configuration; it acts after the next restart."""
        self._call(f"adding {domain}/{type}/{name}", CREATE_CFG_INSTANCE, domain, type, name=name)

    def remove_cfg(self, domain: str, type: str, name: str) -> None:
        """Remove an instance of the configuration; it is gone after the next restart."""
        self._call(f"removing {domain}/{type}/{name}", REMOVE_CFG_INSTANCE, domain, type, name)

    def load_cfg(self, path: str, *, replace: bool = False) -> None:
        """Load a cfg file of the controller such as ``HOME:/SIO.cfg``; it acts after the next restart.

        Args:
            path: the file as RAPID names it.
            replace: whether its instances take the place of those of the same names, which are an error otherwise.
        """
        how = "replace" if replace else "add"
        self._call(f"loading {path}", LOAD_CFG_FILE, filepath=file_path(path), action_type=how)

    def save_cfg(self, domain: str, path: str) -> None:
        """Write a domain of the configuration, such as ``SIO``, to a file of the controller."""
        self._call(f"saving {domain} to {path}", SAVE_CFG_DOMAIN, domain, filepath=file_path(path))

    def cfg_domains(self) -> tuple[str, ...]:
        """The domains: ``EIO``, ``MMC``, ``MOC``, ``PROC``, ``SIO``, ``SYS``."""
        return tuple(state.title for state in self._listed("reading the domains", CFG_DOMAINS))

    def cfg_types(self, domain: str) -> tuple[str, ...]:
        """The types of a domain."""
        return tuple(state.title for state in self._listed(f"reading the types of {domain}", CFG_TYPES, domain))

    def cfg_size(self, domain: str, type: str) -> tuple[int, int]:
        """Number of attributes and of instances of a type."""
        return self._answer(f"reading {domain}/{type}", CFG_TYPE, domain, type)

    def cfg_attributes(self, domain: str, type: str) -> tuple[CfgAttribute, ...]:
        """The attributes of a type."""
        return self._answers(f"reading the attributes of {domain}/{type}", CFG_ATTRIBUTES, domain, type)

    def cfg_instance(self, domain: str, type: str, name: str) -> CfgInstance:
        """One instance."""
        page = self._shown(f"reading {domain}/{type}/{name}", CFG_INSTANCE, domain, type, name)
        return _cfg_instance_of(page.one("cfg-dt-instance"))

    def check_cfg_file(self, path: str, *, replace: bool = False) -> bool:
        """Whether a cfg file of the controller can be loaded."""
        how = "replace" if replace else "add"
        return self._is_valid(f"checking {path}", VALIDATE_CFG_FILE, filepath=file_path(path), action_type=how)

    def can_change_cfg(self, domain: str, type: str, names: Sequence[str]) -> bool:
        """Whether instances may be changed."""
        asked = {"cfgdomain": domain, "cfgtype": type, "instances": ",".join(names), "instancescount": len(names)}
        return self._is_valid(f"checking {domain}/{type}", VALIDATE_CFG_INSTANCES, **asked, operation=1)

    def can_remove_cfg(self, name: str) -> bool:
        """Whether an instance may be removed, as no other one names it."""
        return self._is_valid(f"checking {name}", VALIDATE_CFG_REMOVAL, name=name)

    def reset_cfg(self, domain: str, type: str = "") -> None:
        """Make a domain, or one type of it, as a new system has it; it acts after the next restart."""
        what = f"resetting {domain} {type}".rstrip()
        if type:
            self._call(what, RESET_CFG_INSTANCES, domain, type)
        else:
            self._call(what, RESET_CFG_DOMAIN, domain)
