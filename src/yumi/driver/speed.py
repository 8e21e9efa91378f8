"""The setting ``speed_scale``: its value, what each arm's control loop gets of it, and the robot's own limit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from threading import Lock

from yumi.control.commands import Buffer
from yumi.control.limiter import FULL
from yumi.control.shared_state import Factor
from yumi.errors import CommandRefused
from yumi.robot.joints import Side

LOWEST = 0.01
"""Slower than this, joints creep: a full turn would take hours."""

FIRST_CONTACT = 0.1
"""What holds at a robot that is not on this machine, until it is raised."""


class SpeedSetting:
    """The factor on the speed of every controller of both arms; safe from any thread.

    The robot's own limit, EGM's MaxSpeedDeviation, is lowered with it when EGM starts, and cannot be changed before the
    next start; until then an arm gets no more than it was started with.

    Args:
        value: to begin with.
        buffers: from which each arm's control loop reads it.
        is_in_egm: whether EGM runs on an arm.

    Raises:
        CommandRefused: the value is out of range.
    """

    def __init__(
        self,
        value: float = FULL,
        buffers: Mapping[Side, Buffer[Factor]] | None = None,
        is_in_egm: Callable[[Side], bool] = lambda side: False,
    ) -> None:
        self._lock = Lock()
        self._buffers = buffers or {}
        self.is_in_egm = is_in_egm
        self._started_with = dict.fromkeys(Side, FULL)
        self._value = checked(value)
        self._write()

    @property
    def value(self) -> float:
        """What was asked for."""
        return self._value

    @property
    def in_force(self) -> float:
        """What holds now, on the slower arm."""
        return min(map(self._of_arm, Side))

    def set(self, value: float) -> str:
        """Change it, for motions under way, too; returns a sentence.

        Raises:
            CommandRefused: the value is out of range; nothing was changed.
        """
        with self._lock:
            self._value = checked(value)
            self._write()
        return str(self)

    def note_start(self, arms: Iterable[Side], value: float) -> None:
        """EGM has started on ``arms`` with the robot's own limit lowered to ``value``."""
        with self._lock:
            self._started_with.update(dict.fromkeys(arms, value))
            self._write()

    def __str__(self) -> str:
        """In a sentence."""
        if self.in_force < self._value:
            return (
                f"speed_scale is {self._value:g}, but EGM was started with {self.in_force:g}, which the robot's own "
                "limit (MaxSpeedDeviation) keeps until EGM is started again: stop_egm, then start_egm."
            )
        return f"speed_scale is {self._value:g}: every controller moves with at most {self._value:.0%} of its speeds."

    def _of_arm(self, side: Side) -> float:
        return min(self._value, self._started_with[side]) if self.is_in_egm(side) else self._value

    def _write(self) -> None:
        for side, buffer in self._buffers.items():
            buffer.write(Factor(self._of_arm(side)))


def checked(value: float) -> float:
    """``value`` as a plain number; raises CommandRefused when it is none, or out of range."""
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        raise CommandRefused(f"speed_scale is {value!r}; give a number from {LOWEST:g} to 1.") from error
    if not LOWEST <= number <= FULL:
        raise CommandRefused(f"speed_scale is {number:g}; allowed is {LOWEST:g} to 1.")
    return number
