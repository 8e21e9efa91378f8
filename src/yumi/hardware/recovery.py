"""Recovery: says what stopped the robot, clears what may be cleared, and brings it back; no process is restarted."""

from __future__ import annotations

from collections.abc import Callable

from yumi.clock import Clock
from yumi.errors import ControllerRefused, NoConnection, ProtocolError, RobotNotReady, YumiError
from yumi.hardware.arm_guidance import ArmGuidance, FastLines
from yumi.hardware.bringup import Bringup
from yumi.hardware.event_texts import cause_among, explain
from yumi.hardware.manager_state import Report
from yumi.hardware.waiting import GLANCE
from yumi.links.http import AnswerTimeout
from yumi.rws.replies import Event

RESTART = 120.0
"""Longest wait for a controller that is starting [s]."""

HUNG = 5.0
"""Longest wait for one that takes connections but ends no answer [s]: one that is starting takes none."""

WAITING = "wait for the controller, which does not answer"

_ATTEMPT = 1.0  # [s] between two
_STARTING = 503
_EVENTS = 50


class Recovery:
    """Gets one robot back on its feet.

    Args:
        bringup: what is done over RWS.
        guidance: EGM and controllers.
        fast_lines: where the controllers live.
        clock: where waiting time comes from.
    """

    def __init__(self, bringup: Bringup, guidance: ArmGuidance, fast_lines: FastLines, clock: Clock) -> None:
        self._bringup = bringup
        self._client = bringup.client
        self._guidance = guidance
        self._fast_lines = fast_lines
        self._clock = clock
        self._seen = 0  # number of the newest event that was told already

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

    def run(self, *, is_new: bool) -> str:
        """Bring a robot that answers back to ready, and to EGM with its controllers if it was to be in EGM.

        Args:
            is_new: whether its controller had to be waited for, and has to be looked at as a whole again.

        Returns:
            What had stopped it, and what it does now.

        Raises:
            RobotNotReady: somebody has to do something at the robot first; the message says what stopped it and what.
        """
        for side in self._fast_lines.revive():
            self._bringup.report(f"start the fast-line process of the {side.word} arm again")
        why = self._why_stopped()
        self._bringup.report(why)
        try:
            told = self._get_up(is_new=is_new)
        except YumiError as error:
            raise RobotNotReady(f"{why}. {error}") from error
        self._seen = self._newest_number()
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
        cause = cause_among(event for event in self._events() if event.number > self._seen)
        return f"The robot was stopped by {explain(cause)}" if cause else "The event log names nothing that stopped it"

    def _newest_number(self) -> int:
        return max((event.number for event in self._events()), default=0)

    def _events(self) -> tuple[Event, ...]:
        return self._client.events(count=_EVENTS)

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
