"""EGM on the robot and the controllers on top of it: started and stopped together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from abb_protocols.catalogue import Message, clause, headline, message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import Side
from abb_runtime.clock import Clock, wait_until
from yumi.control.hand_over import HandOver, requested_by
from yumi.control.loop_commands import CommandPort, Commands
from yumi.control.loop_events import (
    ControllersLate,
    Event,
    ImplausibleFeedback,
    ReferencesIgnored,
    RobotStoppedFollowing,
    SessionLost,
    SessionStarted,
)
from yumi.control.shared_state import ARM_PROBLEM_CODES, ArmProblem, Snapshots
from yumi.driver.bringup import Bringup
from yumi.driver.robot_state import arms_in_words
from yumi.driver.state_machine import MachineState
from yumi.driver.watchdog import Watchdog

_FIRST_DATAGRAM = 5.0
"""How long the arms may take from the start signal until they follow [s]."""

_EGM_END_TIMEOUT = 1.0
"""How long after its program has stopped an arm may still report that EGM runs [s]; the arm is silent 0.1 s later."""


class ArmControl(CommandPort, Snapshots, Protocol):
    """What is needed of the control process."""

    hand_over: HandOver

    def check(self) -> None:
        """See that it runs; raises RobotNotReady."""

    def revive(self) -> bool:
        """Start it again if it has ended; returns whether it had."""


class EgmControl:
    """EGM and controllers of both arms.

    Args:
        bringup: works over RWS.
        control: the control process.
        clock: for waiting.
        default: name of the controller that commands an arm after EGM has started, unless another one did before EGM
            ended by itself.
        watchdog: on the robot.

    Attributes:
        desired: the arms on which EGM is to run, whether or not it does.
    """

    def __init__(self, bringup: Bringup, control: ArmControl, clock: Clock, default: str, watchdog: Watchdog) -> None:
        self.desired: tuple[Side, ...] = ()
        self._bringup = bringup
        self._control = control
        self._clock = clock
        self._default = default
        self._watchdog = watchdog
        self._deactivated: dict[Side, tuple[str, ...]] = {}

    def is_running(self, arms: Sequence[Side]) -> bool:
        """Whether EGM runs on all of ``arms``, and nothing makes one hold whatever it is commanded to do."""
        return all(self._control.snapshot(side).is_running for side in arms) and not self._problems(arms)

    def note(self, event: Event) -> None:
        """Remember which controllers were deactivated without being asked for."""
        ends = (
            SessionLost
            | SessionStarted
            | RobotStoppedFollowing
            | ReferencesIgnored
            | ImplausibleFeedback
            | ControllersLate
        )
        if isinstance(event, ends) and event.deactivated:
            self._deactivated[event.side] = event.deactivated

    def start(self, arms: tuple[Side, ...]) -> str:
        """EGM and controllers on exactly these arms; returns what was done in a sentence.

        EGM that another program has started is ended first: it has other settings, and no watchdog that knows us. So is
        EGM on an arm that ignores its references, or reports impossible positions: only a new session shows whether
        that is over. That the references arrive again shows with the first motion.

        Raises:
            YumiError: a step failed; the message says which.
        """
        self._control.check()
        if not self._bringup.panel.is_running:
            self._wait_for_egm_end()
        ours = arms if self.desired else ()
        problems = self._problems(arms)
        for side, problem in problems.items():
            self._bringup.step(f"start EGM again: {clause(_problem(side, problem))}")
        if problems or any(self._control.snapshot(side).is_running for side in Side if side not in ours):
            deactivated = dict(self._deactivated)
            self.stop()  # the signal that ends EGM ends it on both
            self._deactivated.update(deactivated)
        self.desired = arms
        if not self.is_running(arms):
            self._start_motion(arms)
        for side in arms:
            if not self._control.snapshot(side).is_commanded:
                self._activate(side)
            self._deactivated.pop(side, None)
        return headline(message("egm_runs", arms=arms_in_words(arms)))

    def stop(self) -> None:
        """Deactivate what commands the arms and stop EGM; they come to rest.

        Raises:
            YumiError: a step failed; the message says which.
        """
        self.desired = ()
        self._deactivated.clear()
        try:
            self.hold()
        finally:
            self._bringup.stop_egm()  # even if the control process has died
            self._watchdog.disarm()

    def stop_if_running(self) -> None:
        """The same, if the robot is in EGM; where it has ended by itself, the watchdog still has to be disarmed."""
        self.desired = ()
        if any(self._bringup.machines.state(side) is MachineState.RUN_EGM_ROUTINE for side in Side):
            self.stop()
        else:
            self._watchdog.disarm()

    def hold(self) -> None:
        """Deactivate whatever commands the arms: they come to rest and hold, their goals are dropped."""
        for side in Side:
            if self._control.snapshot(side).is_commanded:
                self._control.call(Commands.hold, side)

    def _start_motion(self, arms: tuple[Side, ...]) -> None:
        # Where EGM runs on one arm and only the other one has to start, that one goes on.
        machines = {side: self._bringup.machines.state(side) for side in Side}
        missing = [side for side in arms if not self._control.snapshot(side).is_running]
        if len(missing) == len(arms) or any(machines[side] is not MachineState.IDLE for side in missing):
            self.hold()
            self._bringup.make_ready()
        self._watchdog.is_armed = False  # a program that was started anew has disarmed it
        remark = self._watchdog.arm()
        if remark:
            self._bringup.step(remark)
        self._bringup.start_egm(arms)
        wait_until(self._clock, lambda: self.is_running(arms), _FIRST_DATAGRAM, lambda: self._why_not_running(arms))

    def _wait_for_egm_end(self) -> None:
        """Wait until both arms report that EGM has ended; the last datagrams before a stop still say that EGM runs."""

        def has_ended() -> bool:
            return not any(self._control.snapshot(side).is_running for side in Side)

        wait_until(self._clock, has_ended, _EGM_END_TIMEOUT, message("egm_does_not_end"))

    def _activate(self, side: Side) -> None:
        """Activate what commanded the arm before it was deactivated unasked, if it still can, or the default."""
        default = (self._default,)
        names = self._deactivated.get(side, default)
        self._bringup.step(f"activate {', '.join(names)} on the {side.word} arm")
        with requested_by(only_holds=True):  # an arm that is reserved for a person may have its session back
            try:
                self._control.call(Commands.switch_controllers, side, names)
            except CommandRefused as error:
                if names == default:
                    raise
                self._bringup.step(f"activate {self._default} instead: {error}")
                self._control.call(Commands.switch_controllers, side, default)

    def _why_not_running(self, arms: tuple[Side, ...]) -> Message:
        for side, problem in self._problems(arms).items():
            return message("egm_started_but_holds", problem=_problem(side, problem))
        silent = [side for side in arms if not self._control.snapshot(side).is_streaming]
        known = [self._bringup.misdirected[side] for side in silent if side in self._bringup.misdirected]
        if known:
            return message("no_datagram_came_misdirected", why=tuple(known))
        if silent:
            return message(
                "no_datagram_came",
                arms=tuple(side.word for side in silent),
                devices=tuple(side.unit for side in silent),
            )
        words = tuple(side.word for side in arms if not self._control.snapshot(side).is_running)
        return message("robot_does_not_follow", arms=words)

    def _problems(self, arms: Sequence[Side]) -> dict[Side, ArmProblem]:
        snapshots = {side: self._control.snapshot(side) for side in arms}
        return {
            side: it.problem for side, it in snapshots.items() if it.problem is not ArmProblem.NONE and it.is_running
        }


def _problem(side: Side, problem: ArmProblem) -> Message:
    return message(ARM_PROBLEM_CODES[problem], arm=side.word)
