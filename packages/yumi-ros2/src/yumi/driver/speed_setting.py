"""The setting ``speed_scale``: what was asked for, and what each arm's control loop gets of it.

An arm gets it within the robot's own limit, with which EGM was started there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from threading import Lock

from abb_protocols.catalogue import Message, message, quoted
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import Side
from yumi.control.goals import Buffer
from yumi.control.speed_scale import FULL_SPEED, SpeedFactor

LOWEST_SPEED_SCALE = 0.01
"""Slower than this, joints creep: a full turn would take hours."""

FIRST_SPEED_SCALE = 0.1
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
        value: float = FULL_SPEED,
        buffers: Mapping[Side, Buffer[SpeedFactor]] | None = None,
        is_in_egm: Callable[[Side], bool] = lambda side: False,
    ) -> None:
        self._lock = Lock()
        self._buffers = buffers or {}
        self.is_in_egm = is_in_egm
        self._started_with = dict.fromkeys(Side, FULL_SPEED)
        self._value = _checked_speed_scale(value)
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
            self._value = _checked_speed_scale(value)
            self._write()
        return str(self)

    def note_start(self, arms: Iterable[Side], value: float) -> None:
        """EGM has started on ``arms`` with the robot's own limit lowered to ``value``."""
        with self._lock:
            self._started_with.update(dict.fromkeys(arms, value))
            self._write()

    @property
    def said(self) -> Message:
        """What was asked for, and what holds."""
        if self.in_force < self._value:
            return message("speed_scale_waits_for_egm", value=self._value, in_force=self.in_force)
        return message("speed_scale_in_force", value=self._value)

    def __str__(self) -> str:
        return str(self.said)

    def _of_arm(self, side: Side) -> float:
        return min(self._value, self._started_with[side]) if self.is_in_egm(side) else self._value

    def _write(self) -> None:
        for side, buffer in self._buffers.items():
            buffer.write(SpeedFactor(self._of_arm(side)))


def _checked_speed_scale(value: float) -> float:
    """``value`` as a plain number; raises CommandRefused when it is none, or out of range."""
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        no_number = message("speed_scale_no_number", value=quoted(value), lowest=LOWEST_SPEED_SCALE, highest=FULL_SPEED)
        raise CommandRefused(no_number) from error
    if not LOWEST_SPEED_SCALE <= number <= FULL_SPEED:
        raise CommandRefused(
            message("speed_scale_out_of_range", value=number, lowest=LOWEST_SPEED_SCALE, highest=FULL_SPEED)
        )
    return number
