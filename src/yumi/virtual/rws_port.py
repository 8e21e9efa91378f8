"""What the RWS adapter asks of a controller; :class:`yumi.virtual.irc5.Irc5` is one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

from yumi.rapid.host import Execution
from yumi.rapid.task import ModuleInfo
from yumi.rws.states import CollisionState, ControllerState, OperatingMode
from yumi.virtual.configuration import Instance
from yumi.virtual.events import EventLog
from yumi.virtual.files import FileStore
from yumi.virtual.identity import Identity
from yumi.virtual.mechanical_units import MechanicalUnit
from yumi.virtual.signals import Signals


class RapidTask(Protocol):
    """A RAPID task; modules and symbols are found in any letter case."""

    @property
    def name(self) -> str: ...

    @property
    def modules(self) -> Sequence[ModuleInfo]: ...

    @property
    def execution(self) -> Execution: ...

    def type_of(self, module: str, name: str) -> str:
        """Name of a symbol's type; raises UnknownSymbol."""

    def kind_of(self, module: str, name: str) -> str:
        """How a symbol is stored, ``con``, ``var`` or ``per``; raises UnknownSymbol."""

    def dimensions_of(self, module: str, name: str) -> tuple[int, ...]:
        """Sizes of an array, empty for a single value; raises UnknownSymbol."""

    def read(self, module: str, name: str) -> str:
        """A symbol's value as a RAPID literal; raises UnknownSymbol."""

    def write(self, module: str, name: str, literal: str) -> None:
        """Give a symbol a value; raises UnknownSymbol or RapidValueError."""


class Controller(Protocol):
    """A controller as seen over the network; what it will not do it refuses with a reason and a sentence."""

    @property
    def identity(self) -> Identity: ...

    @property
    def mode(self) -> OperatingMode: ...

    @property
    def controller_state(self) -> ControllerState: ...

    @property
    def collision_state(self) -> CollisionState: ...

    @property
    def is_dark(self) -> bool:
        """Whether it is restarting: nothing answers."""

    @property
    def is_running(self) -> bool:
        """Whether RAPID runs."""

    @property
    def cycle(self) -> str: ...

    @property
    def tasks(self) -> Mapping[str, RapidTask]: ...

    @property
    def signals(self) -> Signals: ...

    @property
    def speed_ratio(self) -> int:
        """Override of all speeds [%]."""

    @property
    def time(self) -> float:
        """What its clock shows [s]; seconds since 1970 where people shall read it."""

    @property
    def events(self) -> EventLog: ...

    @property
    def files(self) -> FileStore: ...

    @property
    def units(self) -> Sequence[MechanicalUnit]: ...

    def set_motors(self, on: bool) -> None: ...

    def start_rapid(self) -> None: ...

    def stop_rapid(self) -> None: ...

    def move_pp_to_main(self) -> None: ...

    def load_module(self, task: str, path: str, *, replace: bool) -> None:
        """Load a file of the file store as a module of a task."""

    def unload_module(self, task: str, name: str) -> None: ...

    def acknowledge_collision(self) -> None: ...

    def restart(self) -> None:
        """Warm restart, soon."""

    def set_speed_ratio(self, percent: int) -> None: ...

    def joint_target(self, unit: str) -> tuple[Sequence[float], Sequence[float]]:
        """Axes 1-6 [deg] and the six external axes [deg], 9E9 where there is none."""

    def cfg(self, domain: str, type: str) -> Sequence[Instance]:
        """The instances of a configuration type; none when there is no such type."""

    def settle(self) -> None:
        """Run the interrupts that are due, so that the effects of a write show in the next answer."""
