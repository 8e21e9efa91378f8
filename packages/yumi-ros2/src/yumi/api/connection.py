"""The connection of a script to a robot that the script drives itself.

The parts of the driver are opened in one order, and closed in the other.
"""

from __future__ import annotations

import atexit
import logging
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

import msgspec

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import RobotNotReady, SettingsError, YumiError
from abb_protocols.robot.joints import Side
from abb_runtime.clock import SystemClock
from abb_runtime.process.supervision import ThreadFailures
from yumi.api.motion_executor import MotionExecutor
from yumi.api.motion_registry import MotionRegistry
from yumi.control.loop_events import Event
from yumi.control.speed_scale import FULL_SPEED
from yumi.driver.bringup import BRINGUP_ANNOUNCEMENT
from yumi.driver.command import CommandedRobot
from yumi.driver.controller_names import GOAL_CONTROLLER
from yumi.driver.endpoint_server import EndpointServer
from yumi.driver.gripper import RwsGripper
from yumi.driver.gripper_follower import GripperFollower
from yumi.driver.gripper_setup import close_as_test, set_up_grippers
from yumi.driver.gripper_signals import GripperSignals
from yumi.driver.initial_controllers import Controllers
from yumi.driver.robot_manager import RobotManager
from yumi.driver.robot_state import Report, arms_in_words
from yumi.driver.settings import Settings
from yumi.driver.speed_setting import SpeedSetting
from yumi.driver.stops import StopLog
from yumi.driver.surroundings import surroundings_of
from yumi.driver.teleoperation import Elsewhere
from yumi.driver.wiring import DriverParts, make_parts, only_at_robot
from yumi.recording.message_types import STATE_TOPIC
from yumi.recording.recorder import FullRecorder, Source, Sources

_log = logging.getLogger(__name__)


def recorded_sources(manager: RobotManager, signals: GripperSignals) -> Sources:
    """What a recording of a session has beside the cycles: state, grippers, tools, and the arms without EGM."""
    manager.monitor.read_joints()
    values: dict[str, Source] = {STATE_TOPIC: manager.monitor.state}
    values |= {f"{side.value}/gripper": partial(signals.state, side) for side in Side}
    return Sources(values, manager.monitor.joints, manager.tcp)


def motion_executor(
    parts: DriverParts, settings: Settings, motions: MotionRegistry, arms: tuple[Side, ...]
) -> MotionExecutor:
    """What gives the arms of a driver their goals; ``motions`` end with the cause that the driver finds."""
    motions.explain, motions.cause = parts.manager.monitor.explain, parts.manager.monitor.cause
    return MotionExecutor(
        parts.control,
        motions,
        arms,
        parts.plan.limits,
        SystemClock(),
        lambda: parts.manager.speed.in_force,
        settings.tool_limits.limits,
    )


def commanded_robot(parts: DriverParts, settings: Settings, executor: MotionExecutor) -> CommandedRobot:
    """The robot of a driver as commands reach it, moved by ``executor``."""
    manager, buffers = parts.manager, parts.control.buffers
    return CommandedRobot(
        address=settings.robot.host_and_port,
        manager=manager,
        control=parts.control,
        datagram=lambda side: buffers[side].datagram.read(),
        grippers=parts.grippers,
        gripper_state=parts.signals.state,
        force=settings.gripper.force,
        mover=executor,
        recover=manager.recover,
        calibrate=lambda sides, check: manager.calibrate(*(parts.grippers[side] for side in sides), check=check),
        surroundings=msgspec.structs.replace(surroundings_of(settings), velocity=executor.limits.velocity),
        joints=manager.monitor.joints,
        on_subscription=manager.monitor.read_joints,
    )


class Connection:
    """A robot that is connected and ready, with EGM on its arms, from :meth:`open` to :meth:`close`.

    Args:
        settings: where the robot is, and how it moves.
        controllers: what runs on each arm.
        arms: those on which EGM runs; the others stand still.
        on_step: given each step of what is done to the robot.

    Attributes:
        executor: goals for the arms.
        grippers: of both arms.
        manager: the robot's readiness.
    """

    executor: MotionExecutor
    grippers: Mapping[Side, RwsGripper]
    manager: RobotManager
    _robot: CommandedRobot
    _elsewhere: Elsewhere

    def __init__(
        self,
        settings: Settings,
        controllers: Controllers,
        arms: tuple[Side, ...],
        on_step: Callable[[str], None] = lambda step: None,
    ) -> None:
        self._on_step = on_step
        self._settings = settings
        self._controllers = controllers
        self._arms = arms
        self._motions = MotionRegistry()
        self._stack = ExitStack()
        self._were_tested = False
        self._stops = StopLog(SystemClock())  # a stop that kept it from being opened is confirmed when it is opened
        self._speed: SpeedSetting | None = None
        self._note: Callable[[Event], None] = lambda event: None
        self._failures = ThreadFailures()

    def open(self, confirm: str = "", *, is_named: bool = False) -> None:
        """Connect, bring the robot to ready where that is named, and start EGM on its arms, which hold where they are.

        Args:
            confirm: id of the stop that a person has confirmed, who thereby has the robot brought to ready, too.
            is_named: whether bring-up is named here, whatever the settings say.

        Raises:
            StopNotConfirmed: a stop waits for a person's confirmation; everything is as before.
            YumiError: a step failed, the message says which; everything is as before.
        """
        with ExitStack() as stack:
            only = only_at_robot(self._settings)
            only.claim()
            stack.callback(only.release)
            self._start(stack)
            atexit.register(self.close)  # a notebook that is shut down ends its motions too
            stack.callback(atexit.unregister, self.close)
            # As a warning, which a script without logging shows, too.
            is_named = is_named or bool(confirm) or self._settings.ros.brings_up(is_real=self.manager.is_real())
            is_tested = is_named and self._settings.gripper.test_at_start and not self._were_tested
            with self.manager.starting(brings_up=is_named):
                if not is_named:
                    self.manager.make_ready()  # refused where there is anything to do
                steps = [*self.manager.steps_to_ready(), *self._gripper_setup.steps(is_tested=is_tested)]
                start = f"start EGM on {arms_in_words(self._arms)} (to hold where they are)"
                _log.warning("%s%s.", BRINGUP_ANNOUNCEMENT, ", ".join([*steps, start]))
                self.manager.make_ready(confirm)
                if is_tested:  # not while EGM runs
                    self._were_tested = True
                    close_as_test(self.grippers, _log.info, _log.warning)
                stack.callback(self._end_motion)
                self.manager.start_egm()
            stack.enter_context(self._endpoint())
            self._stack = stack.pop_all()

    @contextmanager
    def _endpoint(self) -> Iterator[None]:
        """Lets commands and other scripts see this robot, and ask for things."""
        server = EndpointServer(self._robot, _log.log)

        def report(level: int, said: Message | str) -> None:
            _log.log(level, said)
            server.note(level, said)

        self.manager.monitor.log.report = report
        self._note = server.note_event
        self._elsewhere = server.elsewhere
        server.start()
        try:
            yield
        finally:
            server.stop()

    def _recover_for_client(self, report: Report, check: Callable[[], None], confirm: str) -> str:
        self._control.check()  # another one can be started by the script alone, which has this endpoint, too
        return self.recover(confirm, report, check)

    def _calibrate_for_client(self, sides: Sequence[Side], check: Callable[[], None]) -> None:
        for side in sides:
            self.calibrate(side, check)

    @property
    def followers(self) -> Mapping[Side, GripperFollower]:
        """What gives grippers the goals of streams."""
        return self._robot.followers

    def follow_with_grippers(self, closed: Mapping[Side, float]) -> None:
        """The next goals of a stream for grippers, from 0, open, to 1, closed; returns at once."""
        self._robot.follow_with_grippers(closed, self._elsewhere)

    def datagram(self, side: Side) -> bytes:
        """The newest datagram of an arm's robot."""
        return self._control.buffers[side].datagram.read()

    def _start(self, stack: ExitStack) -> None:
        """Make the parts of the driver, connect and start its processes and threads."""
        settings, warn = self._settings, partial(_log.warning, "%s")

        def report(step: str) -> None:
            _log.info("%s", step)
            self._on_step(step)

        for remark in settings.collision.remarks:
            _log.info("%s", remark)
        parts = make_parts(
            settings, self._controllers, self._on_event, report, GOAL_CONTROLLER, self._arms, warn, self._stops
        )
        self.manager = manager = parts.manager
        self.grippers, self._control, self._gripper_signals = parts.grippers, parts.control, parts.signals
        self._gripper_setup = set_up_grippers(manager, parts.grippers, settings.gripper, _log.warning)
        if self._speed is not None:  # what was set before the connection was opened anew
            manager.speed.set(self._speed.value)
        self._speed = manager.speed
        if self._speed.value < FULL_SPEED:
            _log.warning("%s Raise it with robot.speed_scale or connect(speed_scale=...).", self._speed)
        self.client = parts.client
        stack.callback(parts.client.close)
        parts.control.launch()
        stack.callback(parts.control.stop)
        parts.client.connect()
        parts.bringup.check_controller(parts.plan.addresses)
        manager.is_real()  # asked now, since a virtual controller takes requests as fast as they come from then on
        parts.control.start()
        stack.callback(parts.signals.close)
        try:
            parts.signals.keep_open()
        except YumiError as error:
            _log.info("The controller grants no subscription to the grippers' signals, they are polled: %s", error)
        manager.monitor.log.report = _log.log
        manager.start()
        stack.callback(manager.stop)
        self.executor = motion_executor(parts, settings, self._motions, self._arms)
        robot = commanded_robot(parts, settings, self.executor)
        self._robot = replace(robot, recover=self._recover_for_client, calibrate=self._calibrate_for_client)

    def recover(self, confirm: str = "", report: Report | None = None, check: Callable[[], None] = lambda: None) -> str:
        """Bring the robot back to where it may move, after whatever stopped it.

        Args:
            confirm: id of the stop that a person has confirmed.
            report: gets each step before it is done.
            check: raises where it is not wanted any more.

        Returns:
            What had stopped it, and what it does now.

        Raises:
            StopNotConfirmed: a stop waits for a person's confirmation; nothing was changed.
            YumiError: a step failed; the message says which and what to do.
        """
        try:
            self._control.check()
        except RobotNotReady:
            self.close()
            self.open(confirm, is_named=True)
            done = "The robot was connected anew."
        else:
            self._come_to_rest()
            done = self.manager.recover(report or partial(_log.info, "%s"), check, confirmed=confirm)
            _log.info("%s", done)
            self.manager.start_egm(
                None, report or (lambda step: None), check
            )  # also where EGM had been ended by close(), or had not begun
        self._motions.clear_faults()
        return done

    def calibrate(self, side: Side, check: Callable[[], None] = lambda: None) -> None:
        """Close the fingers of a gripper and call that zero; EGM, during which that is impossible, is paused.

        It stays so where that fails: what made it fail may have stopped the robot, and :meth:`recover` is the way back.

        Raises:
            RobotNotReady: the gripper did not become calibrated, or EGM did not start again.
        """
        check()
        is_in_egm = side in self.manager.egm_arms
        if is_in_egm:
            for each in self.manager.egm_arms:  # all of them come to rest, also one that a person commands
                self.manager.check_gripper(each)
            self._end_motion()
        self.manager.calibrate(self.grippers[side], check=check)
        if is_in_egm:
            self.manager.start_egm()

    def record(self, file: Path) -> ExitStack:
        """Write every cycle of both arms, the grippers and the state to a file until what is returned is closed.

        Raises:
            SettingsError: the file cannot be written.
            MissingPrerequisite: mcap is not installed.
        """
        clock = SystemClock()
        begin, sources = time.time() - clock.now(), recorded_sources(self.manager, self._gripper_signals)
        try:
            recorder = FullRecorder(file, begin, self._control.recorders, partial(_log.info, "%s"), clock, sources)
        except OSError as error:
            raise SettingsError(
                message("recording_not_writable", file=str(file), reason=error.strerror or str(error))
            ) from error
        recorder.start()
        end = ExitStack()
        end.callback(recorder.close)
        return end

    def close(self) -> None:
        """Let the arms come to rest, end EGM and give everything back; does nothing when that is done."""
        stack, self._stack = self._stack, ExitStack()
        stack.close()

    def _on_event(self, event: Event) -> None:
        what = f"Handling {type(event).__name__} of the {event.side.word} arm"
        for listener in (self.manager.note, self._motions.note, self._note):
            self._failures.attempt(what, listener, event)

    def _end_motion(self) -> None:
        self._come_to_rest()
        try:
            self.manager.end_motion()
        except YumiError as error:
            _log.warning("EGM could not be ended on the robot: %s", error)

    def _come_to_rest(self) -> None:
        with suppress(YumiError):  # an arm that its controller cannot stop is held by the limiter
            self.executor.bring_to_rest(self._arms)
