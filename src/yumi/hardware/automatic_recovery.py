"""Recovery without a person, where no person was involved in the stop: a setting, off by default.

Nothing is done after a stop that a person must confirm, nor where the cause is not certain: a program stop without
another cause may have been the stop button of the FlexPendant.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from threading import Event as Flag
from typing import Protocol

from yumi.errors import YumiError
from yumi.links.supervision import SupervisedThread

PERIOD = 1.0
"""Time between two looks [s]."""

ATTEMPTS = 10
"""So often it is tried, for one loss of EGM."""


@dataclass(frozen=True, slots=True)
class RecoverySettings:
    """Recovery from stops in which no person was involved.

    Attributes:
        automatic: whether EGM is begun again by itself after a lost link, EGM's time-out, the robot's watchdog or a
            restart of the controller.
    """

    automatic: bool = False


class Recoverable(Protocol):
    """What is needed of the robot manager."""

    @property
    def has_lost_egm(self) -> bool:
        """Whether EGM was to run, and does not."""

    def recover_automatically(self) -> str | None:
        """Recover where no person was involved; what was done, None where it is left to a person. Raises YumiError."""


class AutomaticRecovery:
    """Looks once a second whether EGM was lost without a person, and has it begun again.

    Args:
        manager: what recovers.
        report: takes a level of :mod:`logging` and a sentence.
        settings: whether it does so at all.
    """

    def __init__(self, manager: Recoverable, report: Callable[[int, str], None], settings: RecoverySettings) -> None:
        self._manager = manager
        self._report = report
        self._settings = settings
        self._attempts = 0
        self._is_over = Flag()
        self._thread: SupervisedThread | None = None

    def start(self) -> None:
        """Look from now on; nothing to do when it is switched off."""
        if self._settings.automatic:
            self._is_over.clear()
            self._thread = SupervisedThread("automatic-recovery", self._run, self._is_over)
            self._thread.start()

    def stop(self) -> None:
        """Look no longer."""
        self._is_over.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def step(self) -> None:
        """Look once, and recover where that is right."""
        if not self._manager.has_lost_egm:
            self._attempts = 0
        elif self._attempts < ATTEMPTS:
            try:
                told = self._manager.recover_automatically()
            except YumiError as error:
                self._attempts += 1
                self._report(logging.WARNING, f"Recovery by itself, attempt {self._attempts} of {ATTEMPTS}: {error}")
            else:
                if told is not None:
                    self._report(logging.WARNING, f"Recovered by itself (recovery.automatic): {told}")

    def _run(self) -> None:
        while not self._is_over.wait(PERIOD):
            self.step()
