"""One arm's controllers as ROS sees them: they live in the fast line, their nodes and parameters here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from concurrent.futures import TimeoutError as Overdue
from typing import Any

from yumi.control.inventory import ControllerInfo
from yumi.control.lifecycle import State
from yumi.control.requests import (
    CleanupController,
    ConfigureController,
    ListControllerKinds,
    ListControllers,
    LoadController,
    Strictness,
    SwitchControllers,
    UnloadController,
)
from yumi.errors import CommandRefused, RobotNotReady
from yumi.robot.joints import Side
from yumi.ros.controller_nodes import ControllerNodes, Line
from yumi.ros.controller_parameters import Presets
from yumi.ros.manager_parameters import ManagerParameters
from yumi.settings import ControllerSettings

_SWITCH_TIMEOUT = 1.0  # [s], ros2_control's own where a request says 0


class ArmControllers:
    """Loads, configures, switches and unloads, and keeps the controllers' nodes in step.

    Args:
        side: which arm.
        line: where the controllers live.
        nodes: their nodes.
        parameters: those of the controller manager, which say what to load and from which files.
        known: those of ``controllers.yaml``, loaded or not.
        log: where what is not wrong enough to be refused is told.
    """

    def __init__(
        self,
        side: Side,
        line: Line,
        nodes: ControllerNodes,
        parameters: ManagerParameters,
        known: Iterable[ControllerSettings],
        log: Any,
    ) -> None:
        self._side = side
        self._line = line
        self._nodes = nodes
        self._parameters = parameters
        self._known = {settings.name: settings for settings in known}
        self._log = log

    def begin(self) -> None:
        """Make the nodes of the controllers that were loaded from the start.

        Raises:
            YumiError: the fast line is gone.
        """
        for settings in self._known.values():
            self._parameters.note_type(settings.name, settings.kind)
        for info in self.list():
            self._nodes.add(info)

    def list(self) -> tuple[ControllerInfo, ...]:
        """All loaded controllers."""
        return self._line.ask(ListControllers(self._side)).controllers

    def kinds(self) -> tuple[str, ...]:
        """The types that can be loaded."""
        return self._line.ask(ListControllerKinds(self._side)).kinds

    def load(self, name: str) -> None:
        """Load the controller of the type that the parameter ``<name>.type`` says, with its parameter files.

        Raises:
            YumiError: no or an unknown type, the name is taken, or a value in a file is not allowed.
        """
        kind, arguments = self._parameters.type_of(name), self._parameters.arguments_of(name)
        self._line.ask(LoadController(self._side, name, kind))
        try:
            self._nodes.add(self._info(name), arguments, self._presets(name, kind))
        except Exception:
            self._line.ask(UnloadController(self._side, name))
            raise

    def configure(self, name: str) -> None:
        """Make a controller inactive; an inactive one is cleaned up first."""
        self._line.ask(ConfigureController(self._side, name))

    def cleanup(self, name: str) -> None:
        """Make an inactive controller unconfigured; an unconfigured one stays as it is."""
        if self._info(name).state is not State.UNCONFIGURED:
            self._line.ask(CleanupController(self._side, name))

    def unload(self, name: str) -> None:
        """Forget a controller that is not active, and its node."""
        self._line.ask(UnloadController(self._side, name))
        self._nodes.remove(name)

    def switch(self, activate: Sequence[str], deactivate: Sequence[str], strictness: int, timeout: float) -> str:
        """Switch between two cycles; what was done as a sentence.

        Args:
            activate: names of controllers to activate.
            deactivate: names of controllers to deactivate.
            strictness: one of the wire's numbers, 0 for the default.
            timeout: how long to wait for the fast line [s]; 0 for the default.

        Raises:
            RobotNotReady: it took longer; the switch may still be carried out.
            YumiError: a rule stands against it; nothing was changed.
        """
        chosen, timeout = self._strictness(strictness), timeout if timeout > 0.0 else _SWITCH_TIMEOUT
        request = SwitchControllers(self._side, tuple(activate), tuple(deactivate), chosen)
        thread = ThreadPoolExecutor(1, f"switch-{self._side.value}")
        waiting = thread.submit(self._line.ask, request)
        thread.shutdown(wait=False)  # it ends with the answer
        try:
            return waiting.result(timeout).sentence
        except Overdue as error:
            raise RobotNotReady(f"Switch controller timed out after {timeout:g} seconds!") from error

    def reload(self, is_forced: bool) -> None:
        """Unload all controllers; there are no libraries to load again.

        Raises:
            YumiError: one is active and it is not forced.
        """
        controllers = self.list()
        active = [info.name for info in controllers if info.state is State.ACTIVE]
        if active and not is_forced:
            raise CommandRefused(f"Controllers are active: {', '.join(active)}; deactivate them first, or force it.")
        if active:
            self._line.ask(SwitchControllers(self._side, deactivate=tuple(active)))
        for info in controllers:
            self.unload(info.name)

    def _presets(self, name: str, kind: str) -> Presets:
        settings = self._known.get(name)
        return settings.entries if settings is not None and settings.kind == kind else {}

    def _info(self, name: str) -> ControllerInfo:
        controllers = self.list()
        for info in controllers:
            if info.name == name:
                return info
        loaded = ", ".join(info.name for info in controllers) or "none"
        raise CommandRefused(f"There is no controller {name!r}; loaded are: {loaded}.")

    def _strictness(self, number: int) -> Strictness:
        if number == 0:
            return self._parameters.strictness
        if number in {Strictness.AUTO, Strictness.FORCE_AUTO}:
            self._log.warning(f"Strictness {Strictness(number).name} is treated as BEST_EFFORT, as ros2_control does.")
            return Strictness.BEST_EFFORT
        try:
            return Strictness(number)
        except ValueError as error:
            raise CommandRefused(f"Strictness {number} is none; choose 1 (best effort) or 2 (strict).") from error
