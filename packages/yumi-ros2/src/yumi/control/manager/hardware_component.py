"""The hardware component of one arm: which interfaces may be used, and how long a cycle takes."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import inf

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from yumi.control.controller import State
from yumi.control.controller_info import HardwareInfo, InterfaceInfo, Statistics
from yumi.control.stage_times import CYCLE_BEGIN, DECODE_STAGE, LIMIT_STAGE, SEND_STAGE, RunningStatistics

_INTERFACE_KINDS = ("position", "velocity")
"""What each joint offers, both as command and as state."""

STATISTICS_WINDOW = 5.0
"""Times of the hardware are those of the last whole window [s]: what was long ago says nothing of the arm now."""

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
        self.interfaces = tuple(f"{joint}/{kind}" for joint in joint_names for kind in _INTERFACE_KINDS)
        self._read_time, self._write_time, self._period = self._times = [RunningStatistics() for _ in range(3)]
        self._recent: tuple[Statistics, ...] = ()
        self._begin = -inf
        self._last: tuple[int, float] | None = None

    @property
    def is_available(self) -> bool:
        """Whether its interfaces exist."""
        return self.state is not State.UNCONFIGURED

    def check_state(self, state: State) -> None:
        """Whether it may be led to ``state``.

        Raises:
            CommandRefused: it may not.
        """
        if state not in _ALLOWED:
            choices = tuple(choice.value for choice in _ALLOWED)
            raise CommandRefused(
                message("hardware_state_not_allowed", component=self.name, state=state.value, allowed=choices)
            )

    def check_interfaces(self, controller: str, required: Sequence[str], required_state: Sequence[str]) -> None:
        """Whether a controller may begin to use these interfaces.

        Raises:
            CommandRefused: one does not exist, or the component's state forbids it.
        """
        for interface in (*required, *required_state):
            if interface not in self.interfaces:
                raise CommandRefused(
                    message(
                        "interface_missing",
                        controller=controller,
                        interface=interface,
                        interfaces=tuple(self.interfaces),
                    )
                )
        if not self.is_available or (required and self.state is not State.ACTIVE):
            raise CommandRefused(
                message("hardware_not_active", controller=controller, component=self.name, state=self.state.value)
            )

    def note(self, session: int, now: float, marks: Sequence[float]) -> None:
        """After a reply: how long reading and answering took.

        Args:
            session: EGM session of the cycle.
            now: when the datagram arrived [s].
            marks: of the cycle's stages, see :class:`yumi.control.stage_times.StageClock`.
        """
        is_new = self._last is None or self._last[0] != session
        if is_new or now - self._begin > STATISTICS_WINDOW:
            self._recent = () if is_new else tuple([times.result() for times in self._times])
            self._begin = now
            for times in self._times:
                times.reset()
        self._read_time.add(marks[DECODE_STAGE] - marks[CYCLE_BEGIN])
        self._write_time.add(max(0.0, marks[SEND_STAGE] - marks[LIMIT_STAGE]))
        if self._last is not None and self._last[0] == session:
            self._period.add(now - self._last[1])
        self._last = (session, now)

    def info(self, claimed: Collection[str]) -> HardwareInfo:
        """The component as the outside sees it.

        Args:
            claimed: names of the command interfaces that are held by controllers.
        """
        available = self.is_available
        read_time, write_time, period = self._recent or [times.result() for times in self._times]
        return HardwareInfo(
            name=self.name,
            state=self.state,
            command_interfaces=tuple(InterfaceInfo(name, available, name in claimed) for name in self.interfaces),
            state_interfaces=tuple(InterfaceInfo(name, available) for name in self.interfaces),
            read_time=read_time,
            write_time=write_time,
            period=period,
        )
