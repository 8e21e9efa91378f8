"""EGM with its controllers and its watchdog: started and stopped together, and brought back after a stop.

:class:`EgmControl` starts and stops EGM on the robot and the controllers on top of it. The :class:`Watchdog` sends a
heartbeat to the robot, which stops its program without one (``controller_files/TRobWatchdog.mod``). A driver whose
control process has died sends no heartbeat either: nothing controls the arm then.

:class:`Recovery` says what stopped the robot, clears what may be cleared, and brings it back; no process is restarted.
:class:`AutomaticRecovery` does that without a person, where no person was involved in the stop: a setting, off by
default. It does nothing after a stop that a person must confirm, nor where the cause is not certain: a program stop
without another cause may have been the stop button of the FlexPendant.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from threading import Event as Flag
from typing import Protocol

from yumi.catalogue import Message, clause, message
from yumi.clock import Clock, wait_until
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
from yumi.control.shared_state import PROBLEMS, Problem, Snapshot
from yumi.driver.bringup import Bringup
from yumi.driver.robot_state import Report, arms_in_words
from yumi.driver.state_machine import EXTERNAL_STATUS, WATCHDOG, MachineState
from yumi.driver.stops import StopLog, explain
from yumi.errors import (
    CommandRefused,
    ControllerRefused,
    NoConnection,
    ProtocolError,
    RobotNotReady,
    StopNotConfirmed,
    YumiError,
)
from yumi.process.supervision import SupervisedThread
from yumi.robot.joints import Side
from yumi.rws import types as rapid_values
from yumi.rws.client import RwsClient
from yumi.rws.transport import AnswerTimeout
from yumi.settings import bounded

POSITION_CONTROLLER = "joint_position_controller"
"""What commands an arm after EGM has started, unless another controller is named."""

FIRST_DATAGRAM = 5.0
"""How long the arms may take from the start signal until they follow [s]."""

EGM_END_TIMEOUT = 1.0
"""How long after its program has stopped an arm may still report that EGM runs [s]; the arm is silent 0.1 s later."""

BEATS_PER_TIMEOUT = 5
"""So many heartbeats come within the time after which the robot stops."""

_LONGEST_RESTART = 120.0
"""Longest wait for a controller that is starting [s]."""

_LONGEST_HANG = 5.0
"""Longest wait for one that takes connections but ends no reply [s]: one that is starting takes none."""

WAITING = "wait for the controller, which does not answer"

ATTEMPTS = 10
"""So often it is tried to recover automatically, for one loss of EGM."""

_ATTEMPT_PERIOD = 1.0  # [s] between two attempts to reach a controller that is starting
_RECOVERY_POLL = 1.0  # [s] between two looks whether EGM was lost
_STARTING = 503  # status of HTTP that a controller answers while it starts


@dataclass(frozen=True, slots=True)
class WatchdogSettings:
    """The watchdog on the robot.

    Attributes:
        enabled: whether the robot stops when the driver sends no heartbeat while EGM runs.
        timeout: after this time [s].
    """

    enabled: bool = True
    timeout: float = bounded(5.0, 1.0, 60.0, "s")


@dataclass(frozen=True, slots=True)
class RecoverySettings:
    """Recovery from stops in which no person was involved.

    Attributes:
        automatic: whether EGM is started again by itself after a lost link, EGM's time-out, the robot's watchdog or a
            restart of the controller.
    """

    automatic: bool = False


class ArmControl(CommandPort, Protocol):
    """What is needed of the control process."""

    def check(self) -> None:
        """See that it runs; raises RobotNotReady."""

    def revive(self) -> bool:
        """Start it again if it has ended; returns whether it had."""

    def snapshot(self, side: Side) -> Snapshot:
        """An arm after its last cycle."""


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
        return f"EGM runs on {arms_in_words(arms)}, the controllers are active"

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
        if any(self._bringup.state(side) is MachineState.RUN_EGM_ROUTINE for side in Side):
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
        machines = {side: self._bringup.state(side) for side in Side}
        missing = [side for side in arms if not self._control.snapshot(side).is_running]
        if len(missing) == len(arms) or any(machines[side] is not MachineState.IDLE for side in missing):
            self.hold()
            self._bringup.make_ready()
        self._watchdog.is_armed = False  # a program that was started anew has disarmed it
        remark = self._watchdog.arm()
        if remark:
            self._bringup.step(remark)
        self._bringup.start_egm(arms)
        wait_until(self._clock, lambda: self.is_running(arms), FIRST_DATAGRAM, lambda: self._why_not_running(arms))

    def _wait_for_egm_end(self) -> None:
        """Wait until both arms report that EGM has ended; the last datagrams before a stop still say that EGM runs."""

        def has_ended() -> bool:
            return not any(self._control.snapshot(side).is_running for side in Side)

        wait_until(self._clock, has_ended, EGM_END_TIMEOUT, message("egm_does_not_end"))

    def _activate(self, side: Side) -> None:
        """Activate what commanded the arm before it was deactivated unasked, if it still can, or the default."""
        default = (self._default,)
        names = self._deactivated.get(side, default)
        self._bringup.step(f"activate {', '.join(names)} on the {side.word} arm")
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

    def _problems(self, arms: Sequence[Side]) -> dict[Side, Problem]:
        snapshots = {side: self._control.snapshot(side) for side in arms}
        return {side: it.problem for side, it in snapshots.items() if it.problem is not Problem.NONE and it.is_running}


def _problem(side: Side, problem: Problem) -> Message:
    return message(PROBLEMS[problem], arm=side.word)


class Watchdog:
    """Arms the robot's watchdog, and sends it heartbeats.

    Args:
        client: a connected client.
        check: sees that the control loop runs; raises RobotNotReady.
        settings: whether, and how.

    Attributes:
        is_armed: whether the robot stops without heartbeats.
    """

    def __init__(self, client: RwsClient, check: Callable[[], None], settings: WatchdogSettings) -> None:
        self.is_armed = False
        self._client = client
        self._check = check
        self._settings = settings
        self._is_over = Flag()
        self._thread: SupervisedThread | None = None

    def start(self) -> None:
        """Send heartbeats whenever it is armed; nothing to do when it is switched off."""
        if self._settings.enabled:
            self._is_over.clear()
            thread = SupervisedThread("watchdog", self._run, self._is_over)
            thread.start()
            self._thread = thread

    def stop(self) -> None:
        self._is_over.set()
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def arm(self) -> str:
        """Arm it, if a thread sends heartbeats; returns a remark where the robot has no watchdog, else nothing."""
        if self._thread is None or self.is_armed:
            return ""
        try:
            self.arm_robot()
        except ControllerRefused as error:
            return f"no watchdog, the robot will not notice when this program dies: {error}"
        return ""

    def arm_robot(self) -> None:
        """Arm it, whatever sends the heartbeats; raises ControllerRefused when the robot has no watchdog."""
        for level in (0, 1):  # a beat that met a stopped program was not taken back, and no other would be an edge
            self._client.set_signal(EXTERNAL_STATUS, level)
        for side in Side:
            self._write(side, "external_timeout", self._settings.timeout)
            self._write(side, "check_external_status", True)
            self._write(side, "active", True)
        self.is_armed = True

    def take_over(self) -> None:
        """Disarm what an earlier driver has armed: it would stop a program that has no EGM."""
        self.is_armed = False
        with suppress(ControllerRefused):  # the robot has none
            for side in Side:
                self._write(side, "active", False)

    def disarm(self) -> None:
        """Disarm it; a robot whose program ended has disarmed it by itself."""
        if self.is_armed:
            self.is_armed = False
            for side in Side:
                self._write(side, "active", False)

    def beat(self) -> None:
        """Send one heartbeat, if the control loop runs, too; where one is lost, the next one follows."""
        try:
            self._check()
            self._client.set_signal(EXTERNAL_STATUS, 1)
        except YumiError:
            return

    def _run(self) -> None:
        while not self._is_over.wait(self._settings.timeout / BEATS_PER_TIMEOUT):
            if self.is_armed:
                self.beat()

    def _write(self, side: Side, name: str, value: rapid_values.RapidValue) -> None:
        self._client.set_symbol(side.task, WATCHDOG, name, rapid_values.encode(value))


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
                self._bringup.note(WAITING)
                report(WAITING)
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
        return "The robot is ready"


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
