"""Recovery: reports what stopped the robot, clears what may be cleared, and brings the robot back.

No process is restarted. :class:`AutomaticRecovery` does that without a person, where no person was involved in the
stop: a setting, off by default. It does nothing after a stop that a person must confirm, nor where the cause is not
certain: a program stop without another cause may have been the stop button of the FlexPendant.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from threading import Event as Flag
from typing import Protocol

from abb_protocols.catalogue import headline, message
from abb_protocols.errors import (
    ControllerRefused,
    NoConnection,
    ProtocolError,
    RobotNotReady,
    StopNotConfirmed,
    YumiError,
)
from abb_runtime.clock import Clock, wait_until
from abb_runtime.process.supervision import SupervisedThread
from abb_runtime.rws.transport import AnswerTimeout
from yumi.driver.bringup import Bringup
from yumi.driver.egm_control import ArmControl, EgmControl
from yumi.driver.robot_state import Report
from yumi.driver.stops import StopLog, explain

_LONGEST_RESTART = 120.0
"""Longest wait for a controller that is starting [s]."""

_LONGEST_HANG = 5.0
"""Longest wait for one that takes connections but ends no reply [s]: one that is starting takes none."""

_WAITING = "wait for the controller, which does not answer"

ATTEMPTS = 10
"""So often it is tried to recover automatically, for one loss of EGM."""

_ATTEMPT_PERIOD = 1.0  # [s] between two attempts to reach a controller that is starting
_RECOVERY_POLL = 1.0  # [s] between two looks whether EGM was lost
_STARTING = 503  # status of HTTP that a controller answers while it starts


@dataclass(frozen=True, slots=True)
class RecoverySettings:
    """Recovery from stops in which no person was involved.

    Attributes:
        automatic: whether EGM is started again by itself after a lost link, EGM's time-out, the robot's watchdog or a
            restart of the controller.
    """

    automatic: bool = False


class Recovery:
    """Brings one robot back after a stop.

    Args:
        bringup: works over RWS.
        egm: EGM and controllers.
        control: the control process.
        clock: for waiting.
        stops: what stopped the robot.
    """

    def __init__(self, bringup: Bringup, egm: EgmControl, control: ArmControl, clock: Clock, stops: StopLog) -> None:
        self._bringup = bringup
        self._client = bringup.client
        self._egm = egm
        self._control = control
        self._clock = clock
        self._stops = stops

    def reach(self, report: Report, check: Callable[[], None]) -> bool:
        """Wait for a controller that is starting: it refuses everything, then has no tasks for some seconds.

        Nothing is changed here, so that whatever stops the robot need not wait for this.

        Args:
            report: gets what is waited for, if anything is.
            check: called twenty times a second; raises when waiting must end.

        Returns:
            Whether it had to be waited for.

        Raises:
            RobotNotReady: the controller does not come, or hangs.
        """
        begin = next_attempt = self._clock.now()
        is_reported = False

        def answers() -> bool:
            nonlocal next_attempt, is_reported
            if self._clock.now() < next_attempt:
                return False
            if self._answers(begin + _LONGEST_HANG):
                return True
            next_attempt = self._clock.now() + _ATTEMPT_PERIOD
            if not is_reported:
                self._bringup.note(_WAITING)
                report(_WAITING)
                is_reported = True
            return False

        refusal = message("controller_is_gone", address=self._client.address, duration=_LONGEST_RESTART)
        wait_until(self._clock, answers, _LONGEST_RESTART, refusal, check=check)
        return is_reported

    def _answers(self, patience: float) -> bool:
        """Whether it does; raises RobotNotReady when it still hangs after the time ``patience`` [s]."""
        try:
            return bool(self._client.tasks())
        except AnswerTimeout as error:
            if self._clock.now() < patience:
                return False
            raise RobotNotReady(message("web_service_hangs", error=error.said)) from error
        except (NoConnection, ProtocolError):
            return False
        except ControllerRefused as error:
            if error.status != _STARTING:
                raise
            return False

    def run(self, *, is_new: bool, confirmed: str = "") -> str:
        """Bring a robot that answers back to ready, and to EGM with its controllers if EGM was to run.

        The arms stand afterwards until they get a new goal: those from before the stop are dropped.

        Args:
            is_new: whether its controller had to be waited for, and has to be checked as a whole again.
            confirmed: id of the stop that a person has confirmed.

        Returns:
            What had stopped it, and what it does now.

        Raises:
            StopNotConfirmed: a person has to confirm the stop first; nothing was changed.
            RobotNotReady: something has to be done at the robot first; the message says what stopped it and what.
        """
        self._stops.check_confirmed(self._client, confirmed)
        if self._control.revive():
            self._bringup.step("start the control process again")
        stop, event = self._stops.stop, self._stops.cause
        if stop is not None:
            why = message("was_stopped_by", causes=stop.causes)
        elif event is not None:
            why = message("was_stopped_by", causes=(explain(event),))
        else:
            why = message("no_stop_cause")
        self._bringup.step(str(why))
        try:
            if confirmed:
                self._egm.hold()
            done = self._bring_back(is_new=is_new)
            self._stops.check_unchanged(self._client, confirmed)
        except StopNotConfirmed:
            raise
        except YumiError as error:
            with suppress(NoConnection, ControllerRefused, ProtocolError):  # no answer: what is known counts
                self._stops.check_unchanged(self._client, confirmed)
            stop = self._stops.stop
            if stop is None:
                raise RobotNotReady(message("not_brought_back", why=why, error=error.said)) from error
            if stop.id != confirmed:
                why = message("was_stopped_by", causes=stop.causes)
            said = message("not_brought_back_after_stop", why=why, error=error.said, stop=stop.id)
            raise RobotNotReady(said, stop.id) from error
        self._stops.close(confirmed)
        events = tuple(f"{each.values['number']} {each.values['title']}" for each in why.values.get("causes", ()))
        return str(message("recovered_after", events=events, done=done) if events else message("recovered", done=done))

    def _bring_back(self, *, is_new: bool) -> str:
        desired = self._egm.desired
        if is_new:
            self._bringup.check_controller()  # it may be another one, or have another configuration
        else:
            self._bringup.check_program()
        if desired:
            return self._egm.start(desired)
        self._egm.stop_if_running()
        self._bringup.make_ready()
        return headline(message("robot_is_ready"))


class Recoverable(Protocol):
    """What is needed of the robot manager."""

    @property
    def has_lost_egm(self) -> bool: ...

    def recover_automatically(self) -> str | None: ...


class AutomaticRecovery:
    """Sees once a second whether EGM was lost without a person, and starts it again.

    Args:
        manager: recovers.
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
        """Poll from now on; nothing to do when it is switched off."""
        if self._settings.automatic:
            self._is_over.clear()
            self._thread = SupervisedThread("automatic-recovery", self._run, self._is_over)
            self._thread.start()

    def stop(self) -> None:
        self._is_over.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def step(self) -> None:
        """Poll once, and recover where that is right."""
        if not self._manager.has_lost_egm:
            self._attempts = 0
        elif self._attempts < ATTEMPTS:
            try:
                done = self._manager.recover_automatically()
            except YumiError as error:
                self._attempts += 1
                self._report(logging.WARNING, f"Automatic recovery, attempt {self._attempts} of {ATTEMPTS}: {error}")
            else:
                if done is not None:
                    self._report(logging.WARNING, f"Recovered automatically (recovery.automatic): {done}")

    def _run(self) -> None:
        while not self._is_over.wait(_RECOVERY_POLL):
            self.step()
