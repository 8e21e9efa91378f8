"""The client's service for the system: RobotWare, options, licence, products, energy, return codes and hardware."""

from __future__ import annotations

from dataclasses import dataclass

from abb_protocols.rws import documents
from abb_protocols.rws.documents import Page, SystemInfo
from abb_protocols.rws.operations import system as table
from abb_protocols.rws.operations.system import ReturnCode
from abb_runtime.rws.services.service import Service


@dataclass(frozen=True, slots=True)
class Energy:
    """What the robot has consumed since ``reset_at`` [J]."""

    total: float
    reset_at: str


class SystemService(Service):
    """``/rw/system``, ``/rw/devices`` and ``/rw/retcode``."""

    def system(self) -> SystemInfo:
        """Name, RobotWare version and options."""
        return documents.read_system(self._shown("reading the system", table.SYSTEM))

    def options(self) -> tuple[str, ...]:
        """Names of the system's options."""
        page = self._shown("reading the options", table.OPTIONS)
        return tuple(child.text("option") for state in page.states for child in state.children)

    def robot_types(self) -> tuple[str, ...]:
        """Types of the robots, such as ``IRB 14000-0.5/0.5``."""
        return self._answers("reading the type", table.ROBOT_TYPE)

    def license(self) -> str:
        """The system's licence."""
        return self._answer("reading the licence", table.LICENSE)

    def products(self) -> dict[str, str]:
        """Versions of the installed products by name."""
        return {each.name: each.version for each in self._answers("reading the products", table.PRODUCTS)}

    def energy(self) -> Energy:
        """What the robot has consumed."""
        state = self._shown("reading the energy", table.ENERGY).one("sys-energy-state-li")
        return Energy(state.number("accumulated-energy"), state.text("reset-time"))

    def energy_change_count(self) -> int:
        """Rises with every change of what the robot has consumed."""
        return self._answer("reading the energy", table.ENERGY_CHANGES)

    def reset_energy(self) -> None:
        """Begin to count anew."""
        self._call("resetting the energy", table.RESET_ENERGY)

    def return_codes(self) -> tuple[ReturnCode, ...]:
        """All of the controller's return codes."""
        return self._answers("reading the return codes", table.CODES)

    def hardware(self, path: str = "") -> tuple[str, ...]:
        """Paths of the hardware below ``path``, such as ``HW_DEVICES/CONTROLLER``."""
        what, place = "reading the hardware", path.rstrip("/")
        page: Page = self._shown(what, table.DEVICE, place) if place else self._shown(what, table.DEVICES)
        return tuple(child.title for state in page.of_type("dev-id-li") for child in state.children)

    def hardware_properties(self, path: str) -> dict[str, str]:
        """Properties of a piece of hardware, with their units."""
        states = self._listed("reading the hardware", table.DEVICE, path)
        return {
            state.text("name"): f"{state.text('value')} {state.fields.get('unit', '')}".rstrip()
            for state in states
            if state.type.startswith("dev-prop")
        }
