"""The robot manager: owns the robot's state over RWS, brings it to named states with the controllers on top."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from threading import Lock

from yumi.clock import Clock
from yumi.control.events import Event, RobotStoppedFollowing, SessionLost
from yumi.driver.bringup import STOP_PROGRAM, Bringup
from yumi.driver.egm_control import ArmControl, ArmGuidance
from yumi.driver.gripper import Gripper
from yumi.driver.monitor import MOTORS_OFF, PROGRAM_STOPPED, RobotWatch
from yumi.driver.panel import ControllerData
from yumi.driver.rapid_routines import RapidRoutines
from yumi.driver.recovery import AutomaticRecovery, Recovery, RecoverySettings
from yumi.driver.state import Mode, Report, RobotState
from yumi.driver.stops import StopLog, check_not_stopped
from yumi.driver.watchdog import Watchdog, WatchdogSettings
from yumi.errors import RobotNotReady, YumiError
from yumi.robot.gripper import HandCommand
from yumi.robot.joints import Side
from yumi.rws.types import ControllerState

POSITION_CONTROLLER = "joint_position_controller"
"""What commands an arm after EGM has started, unless told otherwise."""

_MOTORS_OFF = frozenset({MOTORS_OFF, PROGRAM_STOPPED})
_GLANCE = 0.1  # [s] a stop that waits for its turn looks so often whether a routine runs meanwhile


class RobotManager:
    """Brings the robot to ready, starts and stops EGM with the controllers on top.

    Every method that changes something waits until it is so, one at a time: the robot has one state. Whatever cannot
    be done raises a YumiError whose sentence says why and what to do.

    Args:
        bringup: what is done over RWS.
        control: the control process.
        clock: where waiting time comes from.
        leading: name of the controller that commands an arm after EGM has started.
        arms: the arms that are guided unless told otherwise; the others stand still.
        watchdog: whether the robot shall stop when this program falls silent, and when.
        stops: what stopped the robot, where an earlier connection knows it already.
        recovery: whether it recovers by itself where no person was involved.

    Attributes:
        watch: what is known of the robot.
        watchdog: on the robot, and our signs of life to it.
        has_acted: whether it was asked to change anything on the robot; before, it has only read.
        is_unattended: whether it recovers without having been asked: a gripper does not close its fingers then.
        grippers: its hands; their jogs end when a stop comes.
        speed: the factor on the speed of every controller, see :mod:`yumi.driver.speed`.
    """

    def __init__(
        self,
        bringup: Bringup,
        control: ArmControl,
        clock: Clock,
        leading: str = POSITION_CONTROLLER,
        arms: tuple[Side, ...] = tuple(Side),
        watchdog: WatchdogSettings = WatchdogSettings(),  # noqa: B008 - it is frozen
        stops: StopLog | None = None,
        recovery: RecoverySettings = RecoverySettings(),  # noqa: B008 - it is frozen
    ) -> None:
        self.watchdog = Watchdog(bringup.client, control.check, watchdog)
        self._stop_log = stops or StopLog(clock)
        self.watch = RobotWatch(bringup.client, control, clock, self._stop_log)
        self.speed = self.watch.speed = bringup.speed
        self._bringup = bringup
        self._cabinet = bringup.cabinet
        self._data = ControllerData(bringup.client, bringup.cabinet)
        self._routines = RapidRoutines(bringup.client, bringup.cabinet, bringup.machines, clock)
        self._guidance = ArmGuidance(bringup, control, clock, leading, self.watchdog)
        self._recovery = Recovery(bringup, self._guidance, control, clock, self._stop_log)
        self.automatic_recovery = AutomaticRecovery(self, self._report, recovery)
        self._control = control
        self._arms = arms
        self._lost_link: set[Side] = set()  # arms whose datagrams ended without a word of the robot
        self._lock = Lock()  # one at a time; the robot has one state
        self._stops = 0  # how many were asked for
        self.has_acted = self.is_unattended = False
        self.grippers: tuple[Gripper, ...] = ()
        self.watch.on_stop = self._end_jogs

    def start(self) -> None:
        """Watch the robot, and have it watch us while EGM runs, until :meth:`stop`."""
        self.watch.start()
        try:
            self.watchdog.start()
            self.automatic_recovery.start()
        except YumiError:  # the operating system permits no thread for it
            self.stop()
            raise

    def report_step(self, step: str) -> None:
        """Report what is done to the robot next, within :meth:`when_ready`.

        Raises:
            YumiError: it must not be done any more: a stop was asked for, or has come, or the request was cancelled.
        """
        self._bringup.report(step)

    def when_ready(self, prepare: Callable[[], None]) -> None:
        """Have ``prepare`` called each time the robot has become ready, with the program running and no arm guided."""
        self._bringup.when_ready = prepare

    def stop(self) -> None:
        """Watch no longer; to be called after :meth:`end_motion`."""
        self.automatic_recovery.stop()
        self.watchdog.stop()
        self.watch.stop()

    # What is known

    def state(self) -> RobotState:
        """All that is known of the robot: at once while the watch keeps it fresh, else read from the controller."""
        return self.watch.state() if self.watch.is_running else self.watch.look()

    def note(self, event: Event) -> None:
        """Take note of what the control process reports."""
        self._guidance.note(event)
        if isinstance(event, SessionLost) and event.deactivated:
            self._lost_link.add(event.side)
        elif isinstance(event, RobotStoppedFollowing) and event.deactivated:
            self._lost_link.discard(event.side)
        self.watch.hint()

    def check_ready(self) -> str:
        """Whether EGM can be started, or runs.

        Raises:
            RobotNotReady: it cannot; the message says why.
        """
        self._control.check()
        if self._guidance.are_guided(self._arms):
            return "ready, EGM runs"
        state = self.state()
        reason = state.reason
        if reason:
            cause = f". {state.cause}" if state.cause and state.cause not in reason else ""
            raise RobotNotReady(f"not ready: {reason}{cause}", state.stop)
        return "ready"

    def check_not_stopped(self) -> None:
        """See that no stop waits for a person's confirmation, as far as that is known already.

        Raises:
            RobotNotReady: one does.
        """
        check_not_stopped(self._stop_log.stop)

    def describe(self) -> str:
        """The robot's state in one line."""
        return str(self.state())

    def steps_to_ready(self) -> list[str]:
        """What :meth:`make_ready` will do to the robot as it is now, in words. Raises YumiError."""
        is_ours = self._guidance.wanted and self._guidance.are_guided(self._arms)
        is_refused = self._stop_log.stop is not None
        return [] if is_ours or is_refused else self._bringup.steps_to_ready()

    def tell_remarks(self) -> None:
        """Warn of what the check of the controller has found to be odd, once each."""
        self._bringup.tell_remarks()

    # Named states

    def make_ready(self, confirmed: str = "") -> str:
        """Motors on, program running, state machines idle; nothing when it is ready or we guide it.

        What an earlier driver has left behind comes to an end.

        Args:
            confirmed: id of the stop that a person has confirmed; empty where none has.

        Raises:
            StopNotConfirmed: a stop waits for a person's confirmation.
            YumiError: a step failed; the message says which.
        """
        with self._moving(confirmed):
            if not (self._guidance.wanted and self._guidance.are_guided(self._arms)):
                self.watchdog.take_over()
                self._bringup.make_ready()
            if confirmed:
                self._stop_log.check_unchanged(self._bringup.client, confirmed)
                self._stop_log.close(confirmed)
        return "The robot is ready"

    def start_egm(self, arms: Sequence[Side] | None = None) -> str:
        """Start EGM and activate what commands the arms; makes the robot ready first if need be.

        Args:
            arms: which arms; None takes all that are configured. The others stand still.

        Raises:
            StopNotConfirmed: a stop waits for a person's confirmation.
            YumiError: a step failed; the message says which.
        """
        with self._moving():
            return self._guidance.begin(tuple(arms) if arms else self._arms)

    def stop_egm(self) -> str:
        """Deactivate what commands the arms and stop EGM; they come to rest.

        Raises:
            YumiError: a step failed; the message says which.
        """
        with self._stopping():
            self._guidance.end()
        return "EGM has ended on both arms"

    def go_to(self, mode: Mode, report: Report) -> str:
        """Bring the robot to a named state, step by step.

        Args:
            mode: the state.
            report: told each step.

        Raises:
            YumiError: a step failed; the message says which and what to do.
        """
        changing = self._changing(_MOTORS_OFF) if mode is Mode.MOTORS_OFF else self._moving()
        with changing, self._bringup.telling(self._until_stopped(report)):
            if mode.arms:
                return self._guidance.begin(mode.arms)
            if mode is Mode.READY:
                self._guidance.end_if_begun()
                self._bringup.make_ready()
                return "The robot is ready, EGM does not run"
            self._come_to_rest()
            self._switch_motors_off()
            return "The motors are off"

    def recover(self, report: Report, check: Callable[[], None] = lambda: None, confirmed: str = "") -> str:
        """Say what stopped the robot and bring it back, to EGM with its controllers if it was to be in EGM.

        A controller that does not answer is waited for out of turn: a stop comes at once, and ends the waiting.

        Args:
            report: told each step.
            check: raises when a controller that does not answer shall be waited for no longer.
            confirmed: id of the stop that a person has confirmed, as in :attr:`RobotState.stop`; needed after an
                emergency stop, a guard stop or a collision.

        Raises:
            StopNotConfirmed: a stop waits for a person's confirmation, or for another one; nothing was changed.
            YumiError: somebody has to do something at the robot first; the message says what stopped it and what.
        """
        told, stops = self._until_stopped(report), self._stops

        def check_all() -> None:
            self._check_not_stopped(stops)
            check()

        is_new = self._recovery.reach(told, check_all)
        with self._moving(confirmed, is_checked=True), self._bringup.telling(told):
            return self._recovery.run(is_new=is_new, confirmed=confirmed)

    @property
    def has_lost_egm(self) -> bool:
        """Whether EGM was to run, and does not."""
        snapshots = {side: self._control.snapshot(side) for side in self._guidance.wanted}
        self._lost_link.difference_update(side for side, each in snapshots.items() if each.is_commanded)
        return any(not each.is_running or side in self._lost_link for side, each in snapshots.items())

    def recover_automatically(self) -> str | None:
        """Recover where it is certain that no person was involved in the stop.

        Returns:
            What had stopped the robot and what it does now; None where nothing was done, as a person has to decide.

        Raises:
            YumiError: a step failed; the message says which.
        """
        client, log = self._bringup.client, self._stop_log
        with self._moving(is_checked=True):
            if not self.has_lost_egm:
                return None
            state, _ = log.look(client)
            lost = [side for side in self._guidance.wanted if not self._control.snapshot(side).is_commanded]
            is_running = state is ControllerState.MOTORS_ON and self._cabinet.is_running
            is_link = is_running and log.cause is None and self._lost_link.issuperset(lost)
            if not log.is_without_person or not (log.cause is not None or is_link):
                return None
            self.is_unattended = True
            try:
                return self._recovery.run(is_new=True)
            finally:
                self.is_unattended = False

    def give_way(self) -> None:
        """End what is being done to the robot at its next step."""
        self._stops += 1

    def end_motion(self) -> None:
        """Hold, and end EGM if the robot is in it: what the driver does before it goes.

        Raises:
            YumiError: the robot could not be told.
        """
        with self._stopping():
            self._guidance.end_if_begun()

    @property
    def wanted(self) -> tuple[Side, ...]:
        """The arms that recovery would guide."""
        return self._guidance.wanted

    # Single steps

    def motors_on(self) -> str:
        """Motors on. Raises RobotNotReady, also while a stop waits for a person's confirmation."""
        with self._moving():
            self._cabinet.switch_motors_on()
        return "The motors are on"

    def motors_off(self) -> str:
        """Motors off; EGM is ended before, so that the arms come to rest gently where they can. Raises YumiError."""
        with self._stopping(_MOTORS_OFF):
            self._come_to_rest()
            self._switch_motors_off()
        return "The motors are off"

    def start_rapid(self) -> str:
        """Start the program where its pointers are. Raises RobotNotReady as :meth:`motors_on`."""
        with self._moving():
            self._cabinet.start_rapid()
        return "The RAPID program runs"

    def stop_rapid(self) -> str:
        """Stop the program; EGM is ended before, so that the arms come to rest gently if they can. Raises YumiError."""
        with self._stopping(frozenset({PROGRAM_STOPPED})):
            self._come_to_rest()
            self._cabinet.stop_rapid()
        return "The RAPID program is stopped"

    def pp_to_main(self) -> str:
        """Program pointers to main; the program must be stopped. Raises RobotNotReady."""
        with self._changing():
            self._cabinet.move_pp_to_main()
        return "The program pointers are at main"

    def set_speed_ratio(self, percent: int) -> str:
        """Override of the speeds of RAPID motions, 0 to 100 %; EGM motions take no notice. Raises YumiError."""
        with self._changing():
            self._cabinet.set_speed_ratio(percent)
        return f"The speed ratio is {percent} %"

    def run_routine(self, side: Side, name: str) -> str:
        """Run a RAPID routine in one arm's task and wait for its end, see :meth:`RapidRoutines.run`."""
        with self._moving():
            self._routines.run(side, name)
        return f"Routine {name} of {side.task} has run"

    def load_module(self, side: Side, file_name: str, text: str) -> str:
        """Write a RAPID module onto the controller and load it, see :meth:`RapidRoutines.load_module`."""
        with self._changing():
            self._routines.load_module(side, file_name, text)
        return f"{side.task} has loaded HOME:/{file_name}"

    def run_module(self, side: Side, file_name: str, text: str, routine: str) -> str:
        """Load a module and run one of its routines; both may raise."""
        self.load_module(side, file_name, text)
        return self.run_routine(side, routine)

    def calibrate(self, *grippers: Gripper) -> None:
        """Close the fingers of these grippers and call that zero, at the same time.

        Raises:
            StopNotConfirmed: a stop waits for a person's confirmation.
            RobotNotReady: an arm is guided, a stop was asked for meanwhile, or one did not become calibrated.
        """
        with self._moving():
            stops = self._stops

            def check() -> None:
                self._check_not_stopped(stops)
                self.check_not_stopped()

            grippers[0].calibrate(*grippers[1:], check=check)

    # Data

    def read_signal(self, name: str) -> str:
        """Value of an I/O signal. Raises YumiError."""
        return self._data.read_signal(name)

    def write_signal(self, name: str, value: str | float) -> None:
        """Set an I/O signal. Raises YumiError; nothing was changed then.

        What starts a motion of the robot's program, or moves fingers, is refused while a stop waits for a person's
        confirmation. Stopping fingers is not.
        """
        signal = name.rpartition("/")[2].upper()  # also written as network/device/signal; RAPID's names know no case
        is_finger_stop = signal.startswith("HAND_CMDGRIPPER") and str(value) == str(int(HandCommand.GO_TO_READY))
        if signal.startswith(("EGM_START", "RUN_", "HAND_CMD")) and not is_finger_stop:
            self._stop_log.check_confirmed(self._bringup.client, "")
        self._data.write_signal(name, value)

    def read_variable(self, task: str, module: str, name: str) -> str:
        """Value of a RAPID variable as RAPID writes it. Raises YumiError."""
        return self._data.read_variable(task, module, name)

    def write_variable(self, task: str, module: str, name: str, value: str) -> None:
        """Write a RAPID variable, ``value`` as RAPID writes it. Raises YumiError; nothing was changed then."""
        self._data.write_variable(task, module, name, value)

    # How

    @contextmanager
    def _changing(self, changes: frozenset[str] = frozenset()) -> Iterator[None]:
        """One at a time; who looks afterwards sees what has changed. Who waited while a stop came loses his turn."""
        stops = self._stops
        with self._lock, self.watch.reports.requested(changes):
            self._check_not_stopped(stops)
            self.has_acted = True
            try:
                with self._bringup.telling(lambda _: self._check_not_stopped(stops)):
                    yield
            finally:
                self.watch.refresh()

    @contextmanager
    def _moving(self, confirmed: str = "", *, is_checked: bool = False) -> Iterator[None]:
        """The same for what may set the robot in motion: not while a stop waits for a person's confirmation.

        Args:
            confirmed: id of the stop that a person has confirmed; another one that comes before the last step ends it.
            is_checked: whether the first look is left to what is done within.
        """
        client = self._bringup.client

        def check(step: str) -> None:
            if step == STOP_PROGRAM:
                self.watch.reports.request(frozenset({PROGRAM_STOPPED}))
            self._stop_log.check_unchanged(client, confirmed)

        with self._changing():
            if not is_checked:
                self._stop_log.check_confirmed(client, confirmed)
            with self._bringup.telling(check):
                yield

    @contextmanager
    def _stopping(self, changes: frozenset[str] = frozenset()) -> Iterator[None]:
        """What stops the robot waits for no routine, and for no more than one step of anything else."""
        self._stops += 1
        while not self._lock.acquire(timeout=_GLANCE):
            self._stop_routine()
        try:
            with self.watch.reports.requested(changes):
                yield
        finally:
            self._lock.release()
            self.watch.refresh()

    def _until_stopped(self, report: Report) -> Report:
        """``report``, which ends what it is told of before its next step when a stop has come."""
        stops = self._stops

        def told(step: str) -> None:
            self._check_not_stopped(stops)
            report(step)

        return told

    def _check_not_stopped(self, stops: int) -> None:
        if self._stops != stops:
            raise RobotNotReady("A stop was asked for meanwhile; ask again if it shall be done all the same.")

    def _end_jogs(self) -> None:
        for gripper in self.grippers:
            try:
                gripper.end_jog()
            except YumiError as error:  # not every robot has two hands
                self._report(logging.INFO, f"A jog of the {gripper.side.word} gripper could not be ended: {error}")

    def _report(self, level: int, sentence: str) -> None:
        self.watch.reports.report(level, sentence)

    def _come_to_rest(self) -> None:
        """Gently where that goes; the stop that was asked for follows in any case."""
        try:
            self._guidance.end_if_begun()
        except YumiError as error:
            self._bringup.report(f"the arms do not come to rest gently: {error}")

    def _stop_routine(self) -> None:
        """A routine may take minutes; what stops the robot does not wait for its turn."""
        if self._routines.is_running:
            self._cabinet.stop_rapid()

    def _switch_motors_off(self) -> None:
        self._bringup.report("motors off")
        self._cabinet.switch_motors_off()
