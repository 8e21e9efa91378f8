"""Recovery: says what stopped the robot, clears what may be cleared, and brings it back; no process is restarted.

Recovery without a person, where no person was involved in the stop: a setting, off by default.

Nothing is done after a stop that a person must confirm, nor where the cause is not certain: a program stop without
another cause may have been the stop button of the FlexPendant.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from threading import Event as Flag
from typing import Protocol

from yumi.clock import GLANCE, Clock
from yumi.driver.bringup import Bringup
from yumi.driver.egm_control import ArmControl, ArmGuidance
from yumi.driver.state import Report
from yumi.driver.stops import StopLog, demand_confirmation, explain
from yumi.errors import ControllerRefused, NoConnection, ProtocolError, RobotNotReady, StopNotConfirmed, YumiError
from yumi.process.supervision import SupervisedThread
from yumi.rws.http import AnswerTimeout

RESTART = 120.0
"""Longest wait for a controller that is starting [s]."""

HUNG = 5.0
"""Longest wait for one that takes connections but ends no answer [s]: one that is starting takes none."""

WAITING = "wait for the controller, which does not answer"

_ATTEMPT = 1.0  # [s] between two
_STARTING = 503


class Recovery:
    """Gets one robot back on its feet.

    Args:
        bringup: what is done over RWS.
        guidance: EGM and controllers.
        control: the control process.
        clock: where waiting time comes from.
        stops: what stopped the robot.
    """

    def __init__(
        self, bringup: Bringup, guidance: ArmGuidance, control: ArmControl, clock: Clock, stops: StopLog
    ) -> None:
        self._bringup = bringup
        self._client = bringup.client
        self._guidance = guidance
        self._control = control
        self._clock = clock
        self._stops = stops

    def reach(self, report: Report, check: Callable[[], None]) -> bool:
        """Wait for a controller that is starting: it refuses everything, then has no tasks for some seconds.

        Nothing is changed here, so that whatever stops the robot need not wait for this.

        Args:
            report: told what is waited for, if anything is.
            check: raises when there is no use in waiting any more; called twenty times a second.

        Returns:
            Whether it had to be waited for.

        Raises:
            RobotNotReady: the controller does not come, or hangs.
        """
        begin, is_told = self._clock.now(), False
        while not self._answers(begin + HUNG):
            if self._clock.now() >= begin + RESTART:
                raise RobotNotReady(
                    f"The controller at {self._client.address} has not answered for {RESTART:g} s; check its power and "
                    "the network cable."
                )
            if not is_told:
                self._bringup.note(WAITING)
                report(WAITING)
                is_told = True
            self._pause(check)
        return is_told

    def _pause(self, check: Callable[[], None]) -> None:
        """Between two attempts."""
        end = self._clock.now() + _ATTEMPT
        while self._clock.now() < end:
            check()
            self._clock.wait(GLANCE)

    def run(self, *, is_new: bool, confirmed: str = "") -> str:
        """Bring a robot that answers back to ready, and to EGM with its controllers if it was to be in EGM.

        The arms stand afterwards until they get a new goal: those from before the stop are dropped.

        Args:
            is_new: whether its controller had to be waited for, and has to be looked at as a whole again.
            confirmed: id of the stop that a person has confirmed.

        Returns:
            What had stopped it, and what it does now.

        Raises:
            StopNotConfirmed: a person has to confirm the stop first; nothing was changed.
            RobotNotReady: somebody has to do something at the robot first; the message says what stopped it and what.
        """
        self._stops.check_confirmed(self._client, confirmed)
        if self._control.revive():
            self._bringup.report("start the control process again")
        why = self._why_stopped()
        self._bringup.report(why)
        try:
            if confirmed:
                self._guidance.hold()
            told = self._get_up(is_new=is_new)
            self._stops.check_unchanged(self._client, confirmed)
        except StopNotConfirmed:
            raise
        except YumiError as error:
            with suppress(NoConnection, ControllerRefused, ProtocolError):  # it cannot be asked: what is known counts
                self._stops.check_unchanged(self._client, confirmed)
            stop = self._stops.stop
            if stop is None:
                raise RobotNotReady(f"{why}. {error}") from error
            if stop.id != confirmed:
                why = f"The robot was stopped by {stop.cause}"
            raise RobotNotReady(f"{why}. {error}{demand_confirmation(stop.id)}", stop.id) from error
        self._stops.close(confirmed)
        return f"{why}. {told}."

    def _get_up(self, *, is_new: bool) -> str:
        wanted = self._guidance.wanted
        if is_new:
            self._bringup.check_controller()  # it may be another one, or have another configuration
        else:
            self._bringup.check_program()
        if wanted:
            return self._guidance.begin(wanted)
        self._guidance.end_if_begun()
        self._bringup.make_ready()
        return "The robot is ready"

    def _why_stopped(self) -> str:
        stop, event = self._stops.stop, self._stops.cause
        if stop is not None:
            return f"The robot was stopped by {stop.cause}"
        return f"The robot was stopped by {explain(event)}" if event else "No stop cause found in the event log"

    def _answers(self, patience: float) -> bool:
        """Whether it does; raises RobotNotReady when it still hangs after the time ``patience`` [s]."""
        try:
            return bool(self._client.tasks())
        except AnswerTimeout as error:
            if self._clock.now() < patience:
                return False
            raise RobotNotReady(
                f"{error} The web service of the controller hangs, or the network is too slow for it; check the "
                "network, or restart the controller, and call recover again."
            ) from error
        except (NoConnection, ProtocolError):
            return False
        except ControllerRefused as error:
            if error.status != _STARTING:
                raise
            return False


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
