"""A connection to a robot: what is opened for a script, in this order, and closed in the other."""

from __future__ import annotations

import atexit
import logging
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from functools import partial
from math import radians

from yumi.api.guidance import GOAL_CONTROLLER, Guidance
from yumi.api.motions import LAST_STOP, MotionBook
from yumi.app import Controllers, make_parts, only_at_robot
from yumi.clock import SystemClock
from yumi.control.point_motion import slower
from yumi.control.requests import Event
from yumi.control.speed_scale import FULL
from yumi.errors import RobotNotReady, YumiError
from yumi.hardware.bringup import ANNOUNCEMENT
from yumi.hardware.gripper import Gripper
from yumi.hardware.hand_setup import GripperSetup, close_as_test
from yumi.hardware.robot_manager import RobotManager
from yumi.hardware.speed_setting import SpeedSetting
from yumi.hardware.stops import StopLog
from yumi.robot.joints import Side
from yumi.robot.limits import YUMI_LIMITS
from yumi.settings import CalibrateWhen, Settings

log = logging.getLogger(__name__)


class Connection:
    """A robot that is connected, ready and guided, from :meth:`open` to :meth:`close`.

    Args:
        settings: where the robot is, and how it shall move.
        controllers: what runs on each arm.
        arms: those that are guided; the others stand still.

    Attributes:
        guidance: orders for the arms.
        grippers: the hands of all arms.
        manager: the robot's readiness.
    """

    guidance: Guidance
    grippers: Mapping[Side, Gripper]
    manager: RobotManager

    def __init__(self, settings: Settings, controllers: Controllers, arms: tuple[Side, ...]) -> None:
        self._settings = settings
        self._controllers = controllers
        self._arms = arms
        self._book = MotionBook()
        self._stack = ExitStack()
        self._were_tested = False
        self._stops = StopLog(SystemClock())  # a stop that kept it from being opened is confirmed when it is opened
        self._speed: SpeedSetting | None = None

    def open(self, confirm: str = "") -> None:
        """Connect, bring the robot to ready, calibrate hands that need it and start EGM on its arms.

        Args:
            confirm: id of the stop that a person has confirmed.

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
            stack.callback(self._end_motion)
            self._announce()
            self.manager.make_ready(confirm)
            self._test_grippers()  # not while arms are guided
            self.manager.start_egm()
            self._stack = stack.pop_all()

    def recover(self, confirm: str = "") -> None:
        """Bring the robot back to where it may move, after whatever stopped it.

        Args:
            confirm: id of the stop that a person has confirmed.

        Raises:
            StopNotConfirmed: a stop waits for a person's confirmation; nothing was changed.
            YumiError: a step failed; the message says which and what to do.
        """
        try:
            self._fast_lines.check()
        except RobotNotReady:
            self.close()
            self.open(confirm)
        else:
            self._come_to_rest()
            log.info(self.manager.recover(partial(log.info, "%s"), confirmed=confirm))
            self.manager.start_egm()  # also where EGM had been ended by close(), or had not begun
        self._book.clear_faults()

    def close(self) -> None:
        """Let the arms come to rest, end EGM and give everything back; does nothing when that is done."""
        stack, self._stack = self._stack, ExitStack()
        stack.close()

    def _announce(self) -> None:
        """Report what will be done to the robot; as a warning, which a script without logging shows, too."""
        steps = [*self.manager.steps_to_ready(), *self._gripper_setup.steps(is_tested=self._is_test_due)]
        whom = "both arms" if len(self._arms) > 1 else f"the {self._arms[0].word} arm"
        log.warning("%s%s.", ANNOUNCEMENT, ", ".join([*steps, f"start EGM on {whom} (to hold where they are)"]))

    @property
    def _is_test_due(self) -> bool:
        return self._settings.gripper.test_at_start and not self._were_tested

    def calibrate(self, side: Side) -> None:
        """Close the fingers of a hand and call that zero; EGM on its arm, during which that is impossible, is paused.

        It stays so where that fails: what made it fail may have stopped the robot, and :meth:`recover` is the way back.

        Raises:
            RobotNotReady: the hand did not become calibrated, or EGM did not start again.
        """
        is_guided = side in self.manager.wanted
        if is_guided:
            self._end_motion()
        self.manager.calibrate(self.grippers[side])
        if is_guided:
            self.manager.start_egm()

    def _test_grippers(self) -> None:
        if self._is_test_due:
            self._were_tested = True
            close_as_test(self.grippers, log.info, log.warning)

    def _start(self, stack: ExitStack) -> None:
        settings, report, warn = self._settings, partial(log.info, "%s"), partial(log.warning, "%s")
        parts = make_parts(
            settings, self._controllers, self._on_event, report, GOAL_CONTROLLER, self._arms, warn, self._stops
        )
        self._fast_lines, self.manager, self.grippers = parts.fast_lines, parts.manager, parts.grippers
        is_wanted = settings.gripper.calibrate is CalibrateWhen.AT_START
        self._gripper_setup = GripperSetup(
            parts.grippers,
            parts.manager.report_step,
            log.warning,
            is_wanted=is_wanted,
            is_confirmed=lambda: not parts.manager.is_unattended,
        )
        parts.manager.when_ready(self._gripper_setup.run)
        if self._speed is not None:  # what was set before the connection was opened anew
            self.manager.speed.set(self._speed.value)
        self._speed = self.manager.speed
        if self._speed.value < FULL:
            log.warning("%s Raise it with robot.speed_scale or connect(speed_scale=...).", self._speed)
        stack.callback(parts.client.close)
        parts.client.connect()
        parts.bringup.check_controller(parts.plan.addresses)
        parts.fast_lines.start()
        stack.callback(parts.fast_lines.stop)
        stack.callback(parts.signals.close)
        try:
            parts.signals.keep_open()
        except YumiError as error:  # the hands are asked instead
            log.info("The controller does not tell of the grippers by itself: %s", error)
        self.manager.watch.reports.report = log.log
        self._book.explain = self.manager.watch.explain
        self.manager.start()
        stack.callback(self.manager.stop)
        goals = {side: boxes.goals for side, boxes in parts.fast_lines.boxes.items()}
        limits = slower(YUMI_LIMITS, top_speed=radians(settings.egm_motion.max_speed_deviation))
        self.guidance = Guidance(parts.fast_lines, goals, self._book, self._arms, limits, SystemClock())

    def _on_event(self, event: Event) -> None:
        self.manager.note(event)
        self._book.tell(event)

    def _end_motion(self) -> None:
        self._come_to_rest()
        try:
            self.manager.end_motion()
        except YumiError as error:
            log.warning("The robot could not be told to end EGM: %s", error)

    def _come_to_rest(self) -> None:
        with suppress(YumiError):  # an arm that cannot be stopped by its controller is held by the guard
            for motion in self.guidance.stop(self._arms):
                motion.wait(LAST_STOP)
