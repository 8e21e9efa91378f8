"""The hardware component of one arm: which interfaces it offers, and in which state (reference/ros2_control.md §2).

Its state decides who may use what; it never moves the arm. While it is inactive nobody may command the arm, which
holds; while it is unconfigured nobody may read its interfaces either. The robot gets its answers in any state.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from yumi.control.inventory import HardwareInfo, InterfaceInfo
from yumi.control.lifecycle import State
from yumi.control.stations import ADMIT, BEGIN, DECODE, SEND
from yumi.control.statistics import RunningStatistics
from yumi.errors import CommandRefused

INTERFACE_KINDS = ("position", "velocity")
"""What each joint offers, both as command and as state."""

_ALLOWED = (State.UNCONFIGURED, State.INACTIVE, State.ACTIVE)


class HardwareComponent:
    """The component of one arm; active from the start.

    Attributes:
        name: its name.
        state: unconfigured, inactive or active.
        interfaces: names of its interfaces, each both a command and a state interface.

    Args:
        joint_names: the arm's joints, chain order.
    """

    def __init__(self, name: str, joint_names: tuple[str, ...]) -> None:
        self.name = name
        self.state = State.ACTIVE
        self.interfaces = tuple(f"{joint}/{kind}" for joint in joint_names for kind in INTERFACE_KINDS)
        self._read_time = RunningStatistics()
        self._write_time = RunningStatistics()
        self._period = RunningStatistics()
        self._last: tuple[int, float] | None = None

    @property
    def is_available(self) -> bool:
        """Whether its interfaces exist for anybody."""
        return self.state is not State.UNCONFIGURED

    def check_state(self, state: State) -> None:
        """Whether it may be led to ``state``.

        Raises:
            CommandRefused: it may not.
        """
        if state not in _ALLOWED:
            choices = ", ".join(choice.value for choice in _ALLOWED)
            raise CommandRefused(
                f"Hardware component {self.name!r} cannot become {state.value} while the driver runs; "
                f"choose from: {choices}."
            )

    def check_interfaces(self, controller: str, required: Sequence[str], required_state: Sequence[str]) -> None:
        """Whether a controller may begin to use these interfaces.

        Raises:
            CommandRefused: one does not exist, or the component's state forbids it.
        """
        for interface in (*required, *required_state):
            if interface not in self.interfaces:
                raise CommandRefused(
                    f"Controller {controller!r} needs {interface}, which this arm does not have; "
                    f"it has: {', '.join(self.interfaces)}."
                )
        if not self.is_available or (required and self.state is not State.ACTIVE):
            raise CommandRefused(
                f"Controller {controller!r} cannot start: hardware component {self.name!r} is {self.state.value}; "
                "make it active first."
            )

    def note(self, session: int, now: float, marks: Sequence[float]) -> None:
        """After a reply: how long reading and answering took.

        Args:
            session: EGM session of the cycle.
            now: when the datagram arrived [s].
            marks: of the cycle's stations, see :class:`yumi.control.stations.StationClock`.
        """
        self._read_time.add(marks[DECODE] - marks[BEGIN])
        self._write_time.add(max(0.0, marks[SEND] - marks[ADMIT]))
        if self._last is not None and self._last[0] == session:
            self._period.add(now - self._last[1])
        self._last = (session, now)

    def info(self, claimed: Collection[str]) -> HardwareInfo:
        """The component as the outside sees it.

        Args:
            claimed: names of the command interfaces that are held by controllers.
        """
        available = self.is_available
        return HardwareInfo(
            name=self.name,
            state=self.state,
            command_interfaces=tuple(InterfaceInfo(name, available, name in claimed) for name in self.interfaces),
            state_interfaces=tuple(InterfaceInfo(name, available) for name in self.interfaces),
            read_time=self._read_time.result(),
            write_time=self._write_time.result(),
            period=self._period.result(),
        )
