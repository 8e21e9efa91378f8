"""Guidance: EGM on the robot and the controllers on top of it, begun and ended together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from yumi.clock import Clock, wait_until
from yumi.control.events import (
    Event,
    ImplausibleFeedback,
    ReferencesIgnored,
    RobotStoppedFollowing,
    SessionLost,
    SessionStarted,
)
from yumi.control.loop import CommandPort, Commands
from yumi.control.shared_state import CAUSES, Problem, Snapshot
from yumi.driver.bringup import Bringup
from yumi.driver.state_machine import MachineState
from yumi.driver.watchdog import Watchdog
from yumi.errors import CommandRefused
from yumi.robot.joints import Side

FIRST_DATAGRAM = 5.0
"""How long the arms may take from the start signal until they follow [s]."""


class ArmControl(CommandPort, Protocol):
    """What is needed of the control process."""

    def check(self) -> None:
        """See that it runs; raises RobotNotReady."""

    def revive(self) -> bool:
        """Start it again if it has ended; returns whether it had."""

    def snapshot(self, side: Side) -> Snapshot:
        """What is known of an arm."""


class ArmGuidance:
    """EGM and controllers of both arms.

    Args:
        bringup: what is done over RWS.
        control: the control process.
        clock: where waiting time comes from.
        leading: name of the controller that commands an arm after EGM has started, unless another one did before EGM
            ended by itself.
        watchdog: on the robot.

    Attributes:
        wanted: the arms that shall be guided, whether or not they are.
    """

    def __init__(self, bringup: Bringup, control: ArmControl, clock: Clock, leading: str, watchdog: Watchdog) -> None:
        self.wanted: tuple[Side, ...] = ()
        self._bringup = bringup
        self._control = control
        self._clock = clock
        self._leading = leading
        self._watchdog = watchdog
        self._fallen: dict[Side, tuple[str, ...]] = {}

    def are_guided(self, arms: Sequence[Side]) -> bool:
        """Whether EGM guides all of ``arms``, and nothing makes one hold whatever it is asked to do."""
        return all(self._snapshot(side).is_running for side in arms) and not self._problems(arms)

    def note(self, event: Event) -> None:
        """Remember which controllers EGM's end has deactivated."""
        ends = SessionLost | SessionStarted | RobotStoppedFollowing | ReferencesIgnored | ImplausibleFeedback
        if isinstance(event, ends) and event.deactivated:
            self._fallen[event.side] = event.deactivated

    def begin(self, arms: tuple[Side, ...]) -> str:
        """EGM and controllers on exactly these arms; tells in a sentence what commands them.

        EGM that somebody else has begun, an earlier driver or another program, is ended first: it has other settings,
        and no watchdog that knows us. So is EGM on an arm that ignores its references, or is not where it can be: only
        a new session tells whether that is over. That the references arrive again shows with the first motion.

        Raises:
            YumiError: a step failed; the message says which.
        """
        self._control.check()
        ours = arms if self.wanted else ()
        problems = self._problems(arms)
        for side, problem in problems.items():
            self._bringup.report(f"start EGM again: {side.word} arm: {CAUSES[problem]}")
        if problems or any(self._snapshot(side).is_running for side in Side if side not in ours):
            fallen = dict(self._fallen)
            self.end()  # the signal that ends EGM ends it on both
            self._fallen.update(fallen)
        self.wanted = arms
        if not self.are_guided(arms):
            self._start_egm(arms)
        for side in arms:
            if not self._snapshot(side).is_commanded:
                self._activate(side)
            self._fallen.pop(side, None)
        whom = "both arms" if len(arms) > 1 else f"the {arms[0].word} arm"
        return f"EGM runs on {whom}, the controllers are active"

    def end(self) -> None:
        """Deactivate what commands the arms and stop EGM; they come to rest.

        Raises:
            YumiError: a step failed; the message says which.
        """
        self.wanted = ()
        self._fallen.clear()
        try:
            self.hold()
        finally:
            self._bringup.stop_egm()  # whatever became of the control process
            self._watchdog.disarm()

    def end_if_begun(self) -> None:
        """The same, if the robot is in EGM; where it has ended by itself, the watchdog still has to be told."""
        self.wanted = ()
        if any(self._bringup.state(side) is MachineState.RUN_EGM_ROUTINE for side in Side):
            self.end()
        else:
            self._watchdog.disarm()

    def hold(self) -> None:
        """Deactivate whatever commands the arms: they come to rest and hold, their goals are dropped."""
        for side in Side:
            if self._snapshot(side).is_commanded:
                self._control.call(Commands.hold, side)

    def _start_egm(self, arms: tuple[Side, ...]) -> None:
        """An arm that EGM guides goes on where only the other one has to begin."""
        machines = {side: self._bringup.state(side) for side in Side}
        is_going_on = any(self._snapshot(side).is_running for side in arms)
        missing = [side for side in arms if not self._snapshot(side).is_running]
        if not (is_going_on and all(machines[side] is MachineState.IDLE for side in missing)):
            self.hold()
            self._bringup.make_ready()
        self._arm_watchdog()
        self._bringup.start_egm(arms)
        wait_until(self._clock, lambda: self.are_guided(arms), FIRST_DATAGRAM, lambda: self._why_not_guided(arms))

    def _arm_watchdog(self) -> None:
        """A program that began anew has forgotten that it shall watch."""
        self._watchdog.is_armed = False
        remark = self._watchdog.arm()
        if remark:
            self._bringup.report(remark)

    def _activate(self, side: Side) -> None:
        """What commanded the arm before EGM ended by itself, if it still can, or what leads."""
        leading = (self._leading,)
        names = self._fallen.get(side, leading)
        self._bringup.report(f"activate {', '.join(names)} on the {side.word} arm")
        try:
            self._control.call(Commands.switch_controllers, side, names)
        except CommandRefused as error:
            if names == leading:
                raise
            self._bringup.report(f"activate {self._leading} instead: {error}")
            self._control.call(Commands.switch_controllers, side, leading)

    def _why_not_guided(self, arms: tuple[Side, ...]) -> str:
        silent = [side for side in arms if not self._snapshot(side).is_streaming]
        for side, problem in self._problems(arms).items():
            return f"EGM started but the {side.word} arm holds: {CAUSES[problem]}."
        if not silent:
            words = " and ".join(side.word for side in arms if not self._snapshot(side).is_running)
            return (
                f"EGM started but the robot does not follow on the {words} arm; look at the event log on the pendant."
            )
        words = " and ".join(side.word for side in silent)
        devices = ", ".join(side.unit for side in silent)
        return (
            f"EGM started on the robot but no datagram came for the {words} arm; check the remote address and port of "
            f"the controller's UDPUC device {devices} and this machine's firewall."
        )

    def _problems(self, arms: Sequence[Side]) -> dict[Side, Problem]:
        problems = {side: self._snapshot(side).problem for side in arms}
        return {side: it for side, it in problems.items() if it is not Problem.NONE and self._snapshot(side).is_running}

    def _snapshot(self, side: Side) -> Snapshot:
        return self._control.snapshot(side)
