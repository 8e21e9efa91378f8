"""Descriptions of an arm's controllers, their parameters and the hardware, as others get them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from abb_runtime.parameters import Parameter, Value
from yumi.control.controller import State


@dataclass(frozen=True, slots=True)
class Statistics:
    """A series of values; all zero without any.

    Attributes:
        count: how many values.
        current: the last one.
        mean: their mean.
        minimum: the smallest.
        maximum: the largest.
        deviation: their standard deviation.
    """

    count: int = 0
    current: float = 0.0
    mean: float = 0.0
    minimum: float = 0.0
    maximum: float = 0.0
    deviation: float = 0.0


@dataclass(frozen=True, slots=True)
class ControllerInfo:
    """One controller as the manager knows it.

    Attributes:
        name: its name, unique on this arm.
        kind: ros2_control's type string.
        state: its lifecycle state.
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
        state: its lifecycle state.
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


class ParameterInfo(NamedTuple):
    """A parameter of a controller and what it holds.

    Attributes:
        parameter: what may be set.
        value: what is set.
    """

    parameter: Parameter
    value: Value
