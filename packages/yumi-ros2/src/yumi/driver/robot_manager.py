"""The robot manager: owns the robot's state over RWS, brings it to named modes with the controllers on top."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from threading import Lock

from abb_protocols.catalogue import Message, headline, message
from abb_protocols.errors import CommandRefused, RobotNotReady, YumiError
from abb_protocols.robot.description import Mass
from abb_protocols.robot.gripper_values import ServoCommand
from abb_protocols.robot.joints import Pose, Side
from abb_protocols.robot.load import Tool
from abb_protocols.rws.values import ControllerState
from abb_runtime.clock import Clock
from yumi.control.hand_over import is_person_requesting
from yumi.control.loop_commands import Commands
from yumi.control.loop_events import (
    AllowedCollisionsChanged,
    ControlProcessEnded,
    Event,
    RobotStoppedFollowing,
    SessionLost,
)
from yumi.driver.bringup import STOP_PROGRAM, Bringup
from yumi.driver.controller_names import STREAM_CONTROLLER
from yumi.driver.egm_control import ArmControl, EgmControl
from yumi.driver.gripper import RwsGripper
from yumi.driver.monitor import MOTORS_OFF_CHANGE, PROGRAM_STOPPED_CHANGE, RobotMonitor
from yumi.driver.rapid_motion_check import RapidMotionCheck
from yumi.driver.rapid_routines import RapidRoutines
from yumi.driver.recovery import AutomaticRecovery, Recovery, RecoverySettings
from yumi.driver.robot_state import Report, RobotMode, RobotState
from yumi.driver.speed_setting import FIRST_SPEED_SCALE
from yumi.driver.state_machine import MAIN_MODULE, RAPID_MODULE, ROUTINE_NAME_SYMBOL, RUN_RAPID_SIGNAL
from yumi.driver.stops import StopLog
from yumi.driver.watchdog import Watchdog, WatchdogSettings

_NO_CHANGES: frozenset[str] = frozenset()
_MOTORS_OFF = frozenset({MOTORS_OFF_CHANGE, PROGRAM_STOPPED_CHANGE})
_ROUTINE_POLL = 0.1  # [s] a stop that waits for its turn ends a routine that runs meanwhile


class RobotManager:
    """Brings the robot to ready, starts and stops EGM with the controllers on top.

    Every method that changes something waits until it is so, one at a time: the robot has one state. Whatever cannot
    be done raises a YumiError whose sentence says why and what to do. What may set the robot in motion raises
    StopNotConfirmed while a stop waits for a person's confirmation.

    Args:
        bringup: works over RWS.
        control: the control process.
        clock: for waiting.
        default: name of the controller that commands an arm after EGM has started.
        arms: the arms on which EGM runs unless others are named; the others stand still.
        watchdog: whether the robot stops when this program is silent, and when.
        stops: what stopped the robot, where an earlier connection knows it already.
        recovery: whether it recovers by itself where no person was involved.
        is_real: asks whether the robot moves nothing, its fingers included, that no call names; asked each time that it
            matters, since another controller may answer by then.
        begins_as_real: whether the factor on speeds is named, or begins as for a real robot; else a robot that turns
            out to be real is slowed down.
        rapid_check: of motions by RAPID; None: they are not checked.

    Attributes:
        monitor: what is known of the robot.
        panel: the controller's motors, program, signals and variables; what may move the robot goes through the
            methods here instead.
        watchdog: on the robot, and our heartbeats to it.
        is_real: as above.
        has_acted: whether it was asked to change anything on the robot; before, it has only read.
        is_unattended: whether it recovers without having been asked: a gripper does not close its fingers then.
        grippers: of both arms; their jogs end when a stop comes.
        speed: the factor on the speed of every controller, see :mod:`yumi.driver.state_machine`.
    """

    def __init__(
        self,
        bringup: Bringup,
        control: ArmControl,
        clock: Clock,
        default: str = STREAM_CONTROLLER,
        arms: tuple[Side, ...] = tuple(Side),
        watchdog: WatchdogSettings = WatchdogSettings(),  # noqa: B008 - it is frozen
        stops: StopLog | None = None,
        recovery: RecoverySettings = RecoverySettings(),  # noqa: B008 - it is frozen
        *,
        is_real: Callable[[], bool] = lambda: False,
        begins_as_real: bool = True,
        rapid_check: RapidMotionCheck | None = None,
    ) -> None:
        client = bringup.client
        self.is_real = is_real
        self._brings_up: bool | None = None  # as a start says
        self._was_real, self._kind_asked = begins_as_real, 0  # in the session of this number
        self.speed, self.panel = bringup.speed, bringup.panel
        self.watchdog = Watchdog(client, control.check, watchdog)
        self._stops = stops or StopLog(clock)
        self.monitor = RobotMonitor(client, control, clock, self._stops, self.speed)
        self._client = client
        self._bringup = bringup
        self._rapid_check = rapid_check
        self._routines = RapidRoutines(client, bringup.panel, bringup.machines, clock, rapid_check)
        self._egm = EgmControl(bringup, control, clock, default, self.watchdog)
        self._recovery = Recovery(bringup, self._egm, control, clock, self._stops)
        self.automatic_recovery = AutomaticRecovery(self, self._log, recovery)
        self._control, self._clock = control, clock
        self._arms = arms
        self._lost_link: set[Side] = set()  # arms whose datagrams ended without a word of the robot
        self._turn = Lock()  # one change at a time; the robot has one state
        self._stop_requests = 0  # how many there were
        self.has_acted = self.is_unattended = False
        self.grippers: tuple[RwsGripper, ...] = ()
        self.monitor.on_stop = self._end_jogs

    def start(self) -> None:
        """Monitor the robot, and send it heartbeats while EGM runs, until :meth:`stop`."""
        self.monitor.start()
        try:
            self.watchdog.start()
            self.automatic_recovery.start()
        except YumiError:  # the operating system permits no thread for it
            self.stop()
            raise

    def stop(self) -> None:
        """End the threads; to be called after :meth:`end_motion`."""
        self.automatic_recovery.stop()
        self.watchdog.stop()
        self.monitor.stop()

    @property
    def may_calibrate(self) -> bool:
        """Whether grippers that need it may be calibrated when the robot becomes ready."""
        return not self.is_real() if self._brings_up is None else self._brings_up

    @property
    def session_count(self) -> int:
        """How often the controller has let us in; since it last grew, another one may answer."""
        return self._client.login_count

    def when_ready(self, prepare: Callable[[], None]) -> None:
        """Have ``prepare`` called each time the robot has become ready, with the program running and no EGM.

        It calls :meth:`step` before each thing it does to the robot.
        """
        self._bringup.when_ready = prepare

    @contextmanager
    def starting(self, *, brings_up: bool) -> Iterator[None]:
        """The start of a driver: within, a robot is brought to ready with calibrated grippers, or must be ready.

        Args:
            brings_up: whether the call, or the settings, name bring-up. Without, what would have to be done is refused.
        """
        self._brings_up, self._bringup.only_if_ready = brings_up, not brings_up
        try:
            yield
        finally:
            self._brings_up, self._bringup.only_if_ready = None, False

    def step(self, name: str) -> None:
        """Report what is done to the robot next, within :meth:`when_ready`.

        Raises:
            YumiError: it must not be done any more: a stop was requested, or has come, or the request was cancelled.
        """
        self._bringup.step(name)

    # What is known

    def state(self) -> RobotState:
        """All that is known of the robot: at once while the monitor keeps it fresh, else read from the controller."""
        return self.monitor.state() if self.monitor.is_running else self.monitor.read()

    def note(self, event: Event) -> None:
        """Take an event of the control process."""
        self._egm.note(event)
        if isinstance(event, AllowedCollisionsChanged):
            self.monitor.allowed_collisions = tuple(f"{part} - {other}" for part, other in event.pairs)
        elif isinstance(event, ControlProcessEnded):
            self.monitor.allowed_collisions = ()
        if isinstance(event, SessionLost) and event.deactivated and not event.stood_still:
            self._lost_link.add(event.side)
        elif isinstance(event, RobotStoppedFollowing) and event.deactivated:
            self._lost_link.discard(event.side)
        self.monitor.request_poll()

    def check_ready(self) -> str:
        """Whether EGM can be started, or runs.

        Raises:
            RobotNotReady: it cannot; the message says why.
        """
        self._control.check()
        if self._egm.is_running(self._arms):
            return "ready, EGM runs"
        state = self.state()
        if state.reasons:
            if state.causes and state.causes != state.reasons:
                said = message("not_ready_after_stop", reasons=state.reasons, causes=state.causes)
            else:
                said = message("not_ready", reasons=state.reasons)
            raise RobotNotReady(said, state.stop)
        return "ready"

    def check_not_stopped(self) -> None:
        """See that no stop waits for a person's confirmation, as far as that is known; raises RobotNotReady."""
        self._stops.check_none_open()

    def check_gripper(self, side: Side) -> None:
        """See that the requester may move a gripper; any person may.

        Raises:
            RobotNotReady: a stop waits for a person's confirmation.
            CommandRefused: a program requests, and a person commands the arm or has not given it back.
        """
        self.check_not_stopped()
        command = self._control.hand_over.of(side)
        if command.is_of_person and not command.is_own and not is_person_requesting():
            raise CommandRefused(message("gripper_reserved_for_person", gripper=side.word))

    def describe(self) -> str:
        """The robot's state in one line."""
        return str(self.state())

    def steps_to_ready(self) -> list[str]:
        """What :meth:`make_ready` will do to the robot as it is now, in words. Raises YumiError."""
        is_refused = self._stops.stop is not None
        return [] if self._is_ours or is_refused else self._bringup.steps_to_ready()

    def report_remarks(self) -> None:
        """Warn of what the check of the controller has found to be odd, once each."""
        self._bringup.report_remarks()

    @property
    def _is_ours(self) -> bool:
        """Whether EGM runs, and this driver has started it."""
        return bool(self._egm.desired) and self._egm.is_running(self._arms)

    @property
    def egm_arms(self) -> tuple[Side, ...]:
        """The arms on which EGM is to run, and on which recovery starts it again."""
        return self._egm.desired

    # Modes

    def make_ready(self, confirmed: str = "") -> str:
        """Motors on, program running, state machines idle; nothing when it is ready or this driver's EGM runs.

        What an earlier driver has left behind comes to an end.

        Args:
            confirmed: id of the stop that a person has confirmed; empty where none has.

        Raises:
            YumiError: a step failed; the message says which.
        """
        with self._moving(confirmed):
            if not self._is_ours:
                self._bringup.check_named()  # before anything is changed
                self.watchdog.take_over()
                self._bringup.make_ready()
            if confirmed:
                self._stops.check_unchanged(self._client, confirmed)
                self._stops.close(confirmed)
        return headline(message("robot_is_ready"))

    def start_egm(
        self,
        arms: Sequence[Side] | None = None,
        report: Report = lambda step: None,
        check: Callable[[], None] = lambda: None,
    ) -> str:
        """Start EGM and activate what commands the arms; makes the robot ready first if need be.

        Args:
            arms: which arms; None takes all that are configured. The others stand still.
            report: gets each step before it is done; raises where it must not be done any more.
            check: called once nothing else is done to the robot; raises where this is not wanted any more.

        Raises:
            YumiError: a step failed; the message says which.
        """
        with self._moving(), self._bringup.reporting(report):
            check()
            return self._start_egm(tuple(arms) if arms else self._arms)

    def _start_egm(self, arms: tuple[Side, ...]) -> str:
        done = self._egm.start(arms)
        with suppress(YumiError):  # EGM runs all the same; the monitor reports a controller that does not answer
            self._stops.settle_egm(self._client)
        return done

    def stop_egm(self) -> str:
        """Deactivate what commands the arms and stop EGM; they come to rest. Raises YumiError."""
        with self._stopping():
            self._egm.stop()
        return headline(message("egm_has_ended"))

    def go_to(self, mode: RobotMode, report: Report, check: Callable[[], None] = lambda: None) -> str:
        """Bring the robot to a mode; ``report`` and ``check`` as of :meth:`start_egm`.

        Raises:
            YumiError: a step failed; the message says which and what to do.
        """
        if mode is RobotMode.MOTORS_OFF:
            return self.motors_off(report, check)
        with self._moving(), self._bringup.reporting(report):
            check()
            if mode.arms:
                return self._start_egm(mode.arms)
            self._egm.stop_if_running()
            self._bringup.make_ready()
            return headline(message("robot_is_ready_without_egm"))

    def recover(self, report: Report, check: Callable[[], None] = lambda: None, confirmed: str = "") -> str:
        """Say what stopped the robot and bring it back, to EGM with its controllers if EGM was to run.

        A controller that does not answer is waited for out of turn: a stop request comes at once, and ends the waiting.

        Args:
            report: as of :meth:`start_egm`.
            check: the same, and ends the waiting for a controller that does not answer.
            confirmed: id of the stop that a person has confirmed, as in :attr:`RobotState.stop`; needed after an
                emergency stop, a guard stop or a collision.

        Raises:
            StopNotConfirmed: a stop waits for a person's confirmation, or for another one; nothing was changed.
            YumiError: something has to be done at the robot first; the message says what stopped it and what.
        """
        requests = self._stop_requests

        def check_all() -> None:
            self._check_no_stop_since(requests)
            check()

        is_new = self._recovery.reach(report, check_all)
        with self._moving(confirmed, is_checked=True, requests=requests), self._bringup.reporting(report):
            check()
            return self._recovery.run(is_new=is_new, confirmed=confirmed)

    @property
    def has_lost_egm(self) -> bool:
        """Whether EGM is to run, and does not."""
        snapshots = {side: self._control.snapshot(side) for side in self._egm.desired}
        self._lost_link.difference_update(side for side, each in snapshots.items() if each.is_commanded)
        return any(not each.is_running or side in self._lost_link for side, each in snapshots.items())

    def recover_automatically(self) -> str | None:
        """Recover where it is certain that no person was involved in the stop.

        Returns:
            What had stopped the robot and what it does now; None where nothing was done, as a person has to decide.

        Raises:
            YumiError: a step failed; the message says which.
        """
        stops = self._stops
        with self._moving(is_checked=True):
            if not self.has_lost_egm:
                return None
            state, _ = stops.read(self._client)
            lost = [side for side in self._egm.desired if not self._control.snapshot(side).is_commanded]
            is_running = state is ControllerState.MOTORS_ON and self.panel.is_running
            is_link = is_running and stops.cause is None and self._lost_link.issuperset(lost)
            if not stops.is_without_person or not (stops.cause is not None or is_link):
                return None
            self.is_unattended = True
            try:
                return self._recovery.run(is_new=True)
            finally:
                self.is_unattended = False

    def interrupt(self) -> None:
        """End what is being done to the robot before its next step."""
        self._stop_requests += 1

    def end_motion(self) -> None:
        """Hold, and end EGM if the robot is in it: the last thing a driver does. Raises YumiError."""
        with self._stopping():
            self._egm.stop_if_running()

    # Single steps

    def motors_on(self) -> str:
        """Motors on. Raises YumiError."""
        with self._moving():
            self.panel.switch_motors_on()
        return headline(message("motors_switched_on"))

    def motors_off(self, report: Report = lambda step: None, check: Callable[[], None] = lambda: None) -> str:
        """Motors off; EGM is ended before, so that the arms come to rest gently where they can.

        Arguments as of :meth:`start_egm`; raises YumiError.
        """
        with self._stopping(_MOTORS_OFF), self._bringup.reporting(report):
            check()
            self._come_to_rest()
            self._bringup.step("motors off")
            self.panel.switch_motors_off()
        return headline(message("motors_switched_off"))

    def start_rapid(self) -> str:
        """Start the program where its pointers are; a real robot's, where that moves nothing. Raises YumiError."""
        with self._moving():
            if self._rapid_check is not None:
                self._rapid_check.check_start()
            self.panel.start_rapid()
        return headline(message("rapid_runs"))

    def stop_rapid(self) -> str:
        """Stop the program; EGM is ended before, so that the arms come to rest gently if they can. Raises YumiError."""
        with self._stopping(frozenset({PROGRAM_STOPPED_CHANGE})):
            self._come_to_rest()
            self.panel.stop_rapid()
        return headline(message("rapid_is_stopped"))

    def pp_to_main(self) -> str:
        """Program pointers to main; the program must be stopped. Raises YumiError."""
        with self._changing():
            self.panel.move_pp_to_main()
        return headline(message("pointers_at_main"))

    def set_speed_ratio(self, percent: int) -> str:
        """Override of the speeds of RAPID motions, 0 to 100 %; it does not change EGM motions. Raises YumiError.

        It waits for no routine that runs, whose motions it is for: it needs no mastership.
        """
        try:
            self.panel.set_speed_ratio(percent)
        finally:
            self.monitor.refresh()
        return headline(message("speed_ratio_is", percent=percent))

    def run_routine(self, side: Side, name: str, *, is_unchecked: bool = False) -> str:
        """Run a RAPID routine in one arm's task and wait for its end, see :meth:`RapidRoutines.run`."""
        with self._moving():
            self._routines.run(side, name, is_unchecked=is_unchecked, step=self._bringup.step)
        return headline(message("routine_has_run", routine=name, task=side.task))

    def load_module(self, side: Side, file_name: str, text: str) -> str:
        """Write a RAPID module onto the controller and load it, see :meth:`RapidRoutines.load_module`."""
        with self._changing():
            self._routines.load_module(side, file_name, text)
        return headline(message("module_is_loaded", task=side.task, file=file_name))

    def run_module(self, side: Side, file_name: str, text: str, routine: str, *, is_unchecked: bool = False) -> str:
        """Load a module and run one of its routines; both may raise."""
        self.load_module(side, file_name, text)
        return self.run_routine(side, routine, is_unchecked=is_unchecked)

    def set_tool(self, side: Side, tcp: Pose, load: Mass) -> str:
        """Have the next EGM motion of an arm use a tool. Raises YumiError."""
        return self._write_tool(side, lambda tool: Tool(tcp, load, tool.payload) if tool else Tool(tcp, load))

    def set_payload(self, side: Side, payload: Mass) -> str:
        """Have the next EGM motion of an arm carry a payload beside its tool.

        Raises:
            YumiError: neither :meth:`set_tool` nor the settings have named the tool, or it was not done.
        """

        def change(tool: Tool | None) -> Tool:
            if tool is None:
                raise CommandRefused(message("tool_unknown", arm=side.word))
            return replace(tool, payload=payload)

        return self._write_tool(side, change)

    def _write_tool(self, side: Side, change: Callable[[Tool | None], Tool]) -> str:
        with self._changing():
            self.panel.check_automatic()
            machines = self._bringup.machines
            tool = change(machines.tool(side))
            machines.set_tool(side, tool)
        centre = ", ".join(f"{1e3 * value:.1f}" for value in tool.total.centre)
        masses = {"total": tool.total.mass, "tool": tool.load.mass, "payload": tool.payload.mass}
        return headline(message("tool_is_set", arm=side.word, centre=centre, **masses))

    def allow_collision(self, part: str, other: str, seconds: float) -> str:
        """Let two parts touch for a time [s], slowly: see :meth:`yumi.api.robot.Robot.allow_collision`.

        Raises:
            CommandRefused: the limiter is off, there are no such parts, the time is out of range, or an arm moves
                or is held before its goal.
            RobotNotReady: the control process has ended.
        """
        self._control.call(Commands.allow_collision, part, other, seconds)
        return headline(message("contact_allowed", part=part, other=other, duration=seconds))

    def end_allowed_collision(self, part: str, other: str) -> str:
        """Keep two parts apart again; nothing where they are. Raises CommandRefused for no parts, RobotNotReady."""
        self._control.call(Commands.end_allowed_collision, part, other)
        return headline(message("contact_ended", part=part, other=other))

    def tcp(self, side: Side) -> Pose:
        """The frame of an arm's tool in tool0 [m], by :meth:`set_tool` or the settings."""
        return self._bringup.machines.tcp(side)

    def signals(self) -> Mapping[str, float]:
        """All I/O signals of the controller by name; raises YumiError."""
        return self._client.signals()

    def calibrate(self, *grippers: RwsGripper, check: Callable[[], None] = lambda: None) -> None:
        """Close the fingers of these grippers and call that zero, at the same time; ``check`` as of :meth:`start_egm`.

        Raises:
            RobotNotReady: EGM runs on an arm, a stop was requested meanwhile, or one did not become calibrated.
        """
        with self._moving():
            requests = self._stop_requests

            def check_stops() -> None:
                self._check_no_stop_since(requests)
                self.check_not_stopped()

            check()
            grippers[0].calibrate(*grippers[1:], check=check_stops)

    def write_signal(self, name: str, value: str | float) -> None:
        """Set an I/O signal. Raises YumiError; nothing was changed then.

        What starts a motion of the robot's program, or moves fingers, is refused while a stop waits for a person's
        confirmation. Stopping fingers is not. The signal that runs a RAPID routine is not written at a real robot: what
        :meth:`run_routine` checks would be left out.
        """
        signal = name.rpartition("/")[
            2
        ].upper()  # also written as network/device/signal; RAPID_MODULE's names know no case
        is_finger_stop = signal.startswith("HAND_CMDGRIPPER") and str(value) == str(int(ServoCommand.GO_TO_READY))
        if signal.startswith(("EGM_START", "RUN_", "HAND_CMD")) and not is_finger_stop:
            self._stops.check_confirmed(self._client, "")
        if signal == RUN_RAPID_SIGNAL and self.is_real():
            raise CommandRefused(message("rapid_signal_not_written", signal=signal))
        self.panel.write_signal(name, value)

    def write_variable(self, task: str, module: str, name: str, value: str) -> None:
        """Write a RAPID variable. Raises YumiError; nothing was changed then.

        What the state machine on the robot acts on is not written at a real robot, since its routines would start
        without the checks of :meth:`run_routine`. Inputs of a routine wait for one that is checked or runs.
        """
        within, variable = module.upper(), name.upper()
        if within not in {MAIN_MODULE.upper(), RAPID_MODULE.upper()}:
            self.panel.write_variable(task, module, name, value)
            return
        if (within == MAIN_MODULE.upper() or variable == ROUTINE_NAME_SYMBOL.upper()) and self.is_real():
            raise CommandRefused(message("rapid_variable_not_written", module=module, variable=name))
        with self._moving():
            self.panel.write_variable(task, module, name, value)

    # Turns

    @contextmanager
    def _changing(
        self,
        changes: frozenset[str] = _NO_CHANGES,
        *,
        check: Report = lambda step: None,
        requests: int | None = None,
    ) -> Iterator[None]:
        """One change at a time; the state is read anew afterwards.

        Args:
            changes: of the robot's state that this makes, for the log.
            check: called before each step, raises where it must not be done any more.
            requests: stop requests when this was asked for; one that came since, while this waited for its turn or
                between two steps, ends it.
        """
        known = self._stop_requests if requests is None else requests

        def before_step(step: str) -> None:
            self._check_no_stop_since(known)
            check(step)

        with self._turn, self.monitor.log.requested(changes):
            self._check_no_stop_since(known)
            self.has_acted = True
            self._bringup.before_step = before_step
            try:
                yield
            finally:
                self._bringup.before_step = lambda step: None
                self.monitor.refresh()

    @contextmanager
    def _moving(self, confirmed: str = "", *, is_checked: bool = False, requests: int | None = None) -> Iterator[None]:
        """The same for what may set the robot in motion: not while a stop waits for a person's confirmation.

        Args:
            confirmed: id of the stop that a person has confirmed; another one that comes before the last step ends it.
            is_checked: whether the first check is left to what is done within.
            requests: as of :meth:`_changing`.
        """

        def check(step: str) -> None:
            if step == STOP_PROGRAM:
                self.monitor.log.request(frozenset({PROGRAM_STOPPED_CHANGE}))
            self._stops.check_unchanged(self._client, confirmed)

        with self._changing(check=check, requests=requests):
            if not is_checked:
                self._stops.check_confirmed(self._client, confirmed)
            self._settle_kind()
            yield

    def _settle_kind(self) -> None:
        """A real robot that answers where a virtual one was expected begins as slowly as any real one."""
        if (session := self.session_count) == self._kind_asked:
            return
        was_real, self._kind_asked, self._was_real = self._was_real, session, self.is_real()
        if self._was_real and not was_real:
            self.speed.set(min(self.speed.value, FIRST_SPEED_SCALE))
            self._log(logging.WARNING, message("real_robot_answers", value=self.speed.value))

    @contextmanager
    def _stopping(self, changes: frozenset[str] = _NO_CHANGES) -> Iterator[None]:
        """What stops the robot: the arms hold at once, also where the controller does not answer.

        The rest waits for no routine, which may take minutes, and for one step of anything else.
        """
        self._stop_requests += 1
        with suppress(YumiError):  # a control process that has ended: the rest is done all the same
            self._egm.hold()
        while not self._turn.acquire(timeout=_ROUTINE_POLL):
            if self._routines.is_running:
                self.panel.stop_rapid()
        try:
            with self.monitor.log.requested(changes):
                yield
        finally:
            self._turn.release()
            self.monitor.refresh()

    def _check_no_stop_since(self, requests: int) -> None:
        if self._stop_requests != requests:
            raise RobotNotReady(message("stop_requested_meanwhile"))

    def _come_to_rest(self) -> None:
        """Gently where that is possible; the stop that was requested follows in any case."""
        try:
            self._egm.stop_if_running()
        except YumiError as error:
            self._bringup.step(f"the arms do not come to rest gently: {error}")

    def _end_jogs(self) -> None:
        for gripper in self.grippers:
            try:
                gripper.end_jog()
            except YumiError as error:  # not every robot has two grippers
                self._log(logging.INFO, f"A jog of the {gripper.side.word} gripper could not be ended: {error}")

    def _log(self, level: int, said: Message | str) -> None:
        self.monitor.log.report(level, said)
