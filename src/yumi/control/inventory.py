"""What one arm has: its controllers, its hardware component and its interfaces, as they are told to the outside."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from yumi.control.lifecycle import State
from yumi.control.parameter import Parameter, Value
from yumi.control.statistics import Statistics


@dataclass(frozen=True, slots=True)
class ControllerInfo:
    """One controller as the manager knows it.

    Attributes:
        name: its name, unique on this arm.
        kind: ros2_control's type string.
        state: where it is in its life.
        required: the command interfaces it needs when active.
        claimed: the command interfaces it holds now.
        required_state: the state interfaces it needs when active.
        execution_time: how long its updates took since it was activated last [s].
    """

    name: str
    kind: str
    state: State
    required: tuple[str, ...]
    claimed: tuple[str, ...]
    required_state: tuple[str, ...] = ()
    execution_time: Statistics = field(default_factory=Statistics)


class InterfaceInfo(NamedTuple):
    """One command or state interface; a tuple, since there are many in each answer.

    Attributes:
        name: ``<joint>/<kind>``.
        is_available: whether its component offers it now.
        is_claimed: whether an active controller holds it; state interfaces are never claimed.
    """

    name: str
    is_available: bool
    is_claimed: bool = False


@dataclass(frozen=True, slots=True)
class HardwareInfo:
    """The hardware component of one arm.

    Attributes:
        name: its name.
        state: where it is in its life.
        command_interfaces: what can be commanded.
        state_interfaces: what is measured.
        read_time: how long reading the arm took, cycle by cycle [s].
        write_time: how long answering it took [s].
        period: time between two cycles [s].
    """

    name: str
    state: State
    command_interfaces: tuple[InterfaceInfo, ...]
    state_interfaces: tuple[InterfaceInfo, ...]
    read_time: Statistics = field(default_factory=Statistics)
    write_time: Statistics = field(default_factory=Statistics)
    period: Statistics = field(default_factory=Statistics)


@dataclass(frozen=True, slots=True)
class ParameterInfo:
    """A parameter of a controller and what it holds.

    Attributes:
        parameter: what may be set.
        value: what is set.
    """

    parameter: Parameter
    value: Value
