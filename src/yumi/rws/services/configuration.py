"""The configuration: domains, types, instances and their attributes, cfg files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from yumi.errors import ControllerRefused
from yumi.rws import replies
from yumi.rws.documents import Pairs
from yumi.rws.replies import CfgInstance
from yumi.rws.session import Request, Requests, file_path, get, given, post

_REFUSED = 400


@dataclass(frozen=True, slots=True)
class CfgAttribute:
    """An attribute of a type.

    Attributes:
        name: of it.
        type: such as ``string`` or ``float``.
        lowest, highest: limits of its value, or of its length.
        initial: value of a new instance.
        is_mandatory: whether an instance must have it.
    """

    name: str
    type: str
    lowest: str
    highest: str
    initial: str
    is_mandatory: bool


class Configuration(Requests):
    """``/rw/cfg``."""

    def cfg(self, domain: str, type: str) -> tuple[CfgInstance, ...]:
        """All instances of a configuration type, such as ``SIO`` and ``COM_TRP``."""
        found: tuple[CfgInstance, ...] = ()
        query: Pairs | None = ()
        while query is not None:
            request = get(f"/rw/cfg/{domain}/{type}/instances", *query)
            page = self._page(self._session.exchange(request), f"reading the configuration {domain}/{type}")
            found += replies.cfg(page)
            query = page.next_query if page.states else None
        return found

    def set_cfg(self, domain: str, type: str, name: str, attributes: Mapping[str, str]) -> None:
        """Change attributes of an instance of the configuration; they act after the next restart."""
        with self.holding("cfg"):
            request = post(f"/rw/cfg/{domain}/{type}/instances/{name}", "set", *attributes.items())
            self._do(request, f"changing {domain}/{type}/{name}")

    def create_cfg(self, domain: str, type: str, name: str) -> None:
        """Add an instance with default values to the configuration; it acts after the next restart."""
        with self.holding("cfg"):
            request = post(f"/rw/cfg/{domain}/{type}/instances", "create-default", ("name", name))
            self._do(request, f"adding {domain}/{type}/{name}")

    def remove_cfg(self, domain: str, type: str, name: str) -> None:
        """Remove an instance of the configuration; it is gone after the next restart."""
        with self.holding("cfg"):
            request = Request("DELETE", f"/rw/cfg/{domain}/{type}/instances/{name}")
            self._do(request, f"removing {domain}/{type}/{name}")

    def load_cfg(self, path: str, *, replace: bool = False) -> None:
        """Load a cfg file of the controller such as ``HOME:/SIO.cfg``; it acts after the next restart.

        Args:
            path: the file as RAPID names it.
            replace: whether its instances take the place of those of the same names, which are an error otherwise.
        """
        form = (("filepath", file_path(path)), ("action-type", "replace" if replace else "add"))
        with self.holding("cfg"):
            self._do(post("/rw/cfg", "load", *form), f"loading {path}")

    def save_cfg(self, domain: str, path: str) -> None:
        """Write a domain of the configuration, such as ``SIO``, to a file of the controller."""
        self._do(post(f"/rw/cfg/{domain}", "saveas", ("filepath", file_path(path))), f"saving {domain} to {path}")

    def cfg_domains(self) -> tuple[str, ...]:
        """The domains: ``EIO``, ``MMC``, ``MOC``, ``PROC``, ``SIO``, ``SYS``."""
        return tuple(state.title for state in self._states("reading the domains", "/rw/cfg"))

    def cfg_types(self, domain: str) -> tuple[str, ...]:
        """The types of a domain."""
        return tuple(state.title for state in self._states(f"reading the types of {domain}", f"/rw/cfg/{domain}"))

    def cfg_size(self, domain: str, type: str) -> tuple[int, int]:
        """Number of attributes and of instances of a type."""
        state = self._state(f"reading {domain}/{type}", f"/rw/cfg/{domain}/{type}", "cfg-dt")
        return state.whole("cfg-no-of-attributes"), state.whole("cfg-no-of-instances")

    def cfg_attributes(self, domain: str, type: str) -> tuple[CfgAttribute, ...]:
        """The attributes of a type."""
        states = self._states(f"reading the attributes of {domain}/{type}", f"/rw/cfg/{domain}/{type}/attributes")
        return tuple(
            CfgAttribute(
                name=state.text("name"),
                type=state.text("type"),
                lowest=state.fields.get("mini", ""),
                highest=state.fields.get("max", ""),
                initial=state.fields.get("init", ""),
                is_mandatory=state.flag("mandatory"),
            )
            for state in states
        )

    def cfg_instance(self, domain: str, type: str, name: str) -> CfgInstance:
        """One instance."""
        path = f"/rw/cfg/{domain}/{type}/instances/{name}"
        state = self._state(f"reading {domain}/{type}/{name}", path, "cfg-dt-instance")
        return CfgInstance(state.title, {each.title: each.fields.get("value", "") for each in state.children})

    def check_cfg_file(self, path: str, *, replace: bool = False) -> bool:
        """Whether a cfg file of the controller can be loaded."""
        form = (("filepath", file_path(path)), ("action-type", "replace" if replace else "add"))
        return self._is_valid(post("/rw/cfg", "validate", *form), f"checking {path}")

    def can_change_cfg(self, domain: str, type: str, names: Sequence[str]) -> bool:
        """Whether instances may be changed."""
        form = given(cfgdomain=domain, cfgtype=type, instances=",".join(names), instancescount=len(names), operation=1)
        return self._is_valid(post("/rw/cfg", "validate-instances", *form), f"checking {domain}/{type}")

    def can_remove_cfg(self, name: str) -> bool:
        """Whether an instance may be removed, as no other one names it."""
        return self._is_valid(post("/rw/cfg", "validate-inst-at-del", ("name", name)), f"checking {name}")

    def _is_valid(self, request: Request, what: str) -> bool:
        try:
            self._do(request, what)
        except ControllerRefused as error:
            if error.status != _REFUSED:
                raise
            return False
        return True

    def reset_cfg(self, domain: str, type: str = "") -> None:
        """Make a domain, or one type of it, as a new system has it; it acts after the next restart."""
        path = f"/rw/cfg/{domain}/{type}/instances" if type else f"/rw/cfg/{domain}"
        with self.holding("cfg"):
            self._do(post(path, "reset"), f"resetting {domain} {type}".rstrip())
