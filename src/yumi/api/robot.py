"""The robot, as a script sees it: ``with yumi.connect(address) as robot``.

One arm, as a script sees it.

A connection to a robot: what is opened for a script, in this order, and closed in the other.
"""

from __future__ import annotations

import atexit
import logging
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, suppress
from enum import Enum
from functools import partial
from math import radians
from types import TracebackType
from typing import TypeVar

from yumi.api.gripper import Gripper
from yumi.api.motion import GOAL_CONTROLLER, LAST_STOP, Guidance, Motion, MotionBook, Position, TimedPosition, wait_for
from yumi.clock import SystemClock
from yumi.control.events import Event
from yumi.control.limiter import FULL
from yumi.control.motion import STANDING, slower
from yumi.control.shared_state import Snapshot
from yumi.driver.bringup import ANNOUNCEMENT
from yumi.driver.gripper import Gripper as GripperGripper
from yumi.driver.gripper import Gripper as Hand
from yumi.driver.gripper import GripperSetup, close_as_test
from yumi.driver.robot_manager import RobotManager
from yumi.driver.settings import CalibrateWhen, Settings
from yumi.driver.speed import SpeedSetting
from yumi.driver.stops import StopLog
from yumi.driver.wiring import Controllers, make_parts, only_at_robot
from yumi.errors import CommandRefused, RobotNotReady, YumiError
from yumi.robot.joints import YUMI_LIMITS, Joints, Pose, Side, joint_names
from yumi.robot.kinematics import tool0_to_body


class ArmMode(Enum):
    """What an arm does, for ``arm.state``."""

    SILENT = "silent"
    """The robot sends no datagrams for it: EGM is not running."""

    IDLE = "idle"
    """The robot sends where it is, but does not follow: motors off, or RAPID stopped."""

    HOLDING = "holding"
    """It follows, and stands."""

    MOVING = "moving"
    """It follows, and moves."""

    FAULT = "fault"
    """Something stopped it; ``robot.recover()`` brings it back, the last error says what it was."""


class Arm:
    """One arm of a connected robot. Joints are in chain order: axes 1, 2, 7, 3, 4, 5, 6, from body to flange.

    Args:
        side: which one.
        guidance: the robot's, while it is connected; raises when it is not.
        gripper: its hand.

    Attributes:
        side: which one.
        gripper: its hand.
    """

    def __init__(self, side: Side, guidance: Callable[[], Guidance], gripper: Gripper) -> None:
        self.side = side
        self.gripper = gripper
        self._guidance = guidance

    def __repr__(self) -> str:
        return f"<yumi.Arm {self.side.word}>"

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of all positions, as ROS has them."""
        return joint_names(self.side)

    @property
    def position(self) -> Joints:
        """Measured joint positions, not older than a few milliseconds [rad], (7,).

        Raises:
            RobotNotReady: the robot is not connected, or silent.
        """
        return self._snapshot().position

    @property
    def velocity(self) -> Joints:
        """Measured joint velocities [rad/s], (7,); raises as :attr:`position`."""
        return self._snapshot().velocity

    @property
    def pose(self) -> Pose:
        """Pose of tool0 in the frame of the robot's body, from the measured joints [m], quaternion w first.

        It is exact forward kinematics; raises as :attr:`position`.
        """
        return tool0_to_body(self.side, self.position)

    @property
    def state(self) -> ArmMode:
        """What the arm does now.

        Raises:
            RobotNotReady: the robot is not connected, or does not guide this arm.
        """
        guidance = self._guidance()
        mode = _mode(guidance.snapshot(self.side))
        return ArmMode.FAULT if guidance.fault(self.side) else mode

    def move_to(
        self,
        position: Position,
        *,
        wait: bool = True,
        timeout: float | None = None,
        speed: float | None = None,
        acceleration: float | None = None,
    ) -> Motion:
        """Move to ``position``, all joints together; a motion under way bends into the new one without a stop.

        Args:
            position: joint positions [rad], (7,) in chain order, or by joint name; see :func:`yumi.degrees` and, for
                the FlexPendant's order, :func:`yumi.abb_degrees`.
            wait: return when the arm stands at the goal; else at once.
            timeout: an arm that takes longer than this is stopped [s]; None lets it take its time.
            speed: share of the joints' highest speeds, above 0 up to 1; None takes that of ``connect``.
            acceleration: the same for accelerations and jerks.

        Returns:
            The motion; over, unless ``wait`` is False.

        Raises:
            CommandRefused: the position is impossible (length, names, NaN, range), or a share is; nothing was changed.
            RobotNotReady: not connected, EGM not running, or stopped by a fault; nothing was changed.
            GoalNotReached: the motion ended elsewhere; the arm holds.
        """
        guidance = self._guidance()
        (motion,) = guidance.move({self.side: position}, speed, acceleration)
        if wait:
            wait_for((motion,), timeout, guidance)
        return motion

    def follow(self, trajectory: Sequence[TimedPosition], *, wait: bool = True, timeout: float | None = None) -> Motion:
        """Follow a trajectory: splines through points that are due at times.

        ::

            robot.right.follow([(1.0, q1), (2.0, q2), (3.5, q1)])

        Between two points the way is straight if they have positions only, cubic with velocities, quintic with
        accelerations. What moves when it is called comes to rest first; a point at time 0 must be where the arm is.

        Args:
            trajectory: points ``(time, position)``, ``(time, position, velocity)`` or ``(time, position, velocity,
                acceleration)``: the time since the begin [s], then (7,) each in [rad], [rad/s] and [rad/s²]; or by
                joint name.
            wait: return when the arm stands at the last point; else at once.
            timeout: an arm that takes longer than this is stopped [s]; None lets it take its time.

        Returns:
            The motion; over, unless ``wait`` is False.

        Raises:
            CommandRefused: the trajectory is impossible: its points, their order, or more than the joints may do.
            RobotNotReady: as for :meth:`move_to`.
            GoalNotReached: the motion ended elsewhere; the arm holds.
        """
        guidance = self._guidance()
        (motion,) = guidance.follow({self.side: trajectory})
        if wait:
            wait_for((motion,), timeout, guidance)
        return motion

    def stop(self) -> None:
        """Come to rest as fast as the joints may, and return when the arm stands.

        Raises:
            RobotNotReady: the robot is not connected.
            GoalNotReached: the arm did not come to rest.
        """
        guidance = self._guidance()
        wait_for(guidance.stop((self.side,)), None, guidance)

    def stream(self, position: Position) -> None:
        """Follow a stream of positions, of which this is the next; returns at once.

        It may be called up to 250 times a second. The arm keeps the joints' limits on the way and stays at the last
        position; :meth:`move_to` or :meth:`stop` end the stream. A motion under way ends before the stream begins.

        Args:
            position: joint positions [rad], (7,) in chain order, or by joint name.

        Raises:
            CommandRefused: the position is impossible; the arm keeps the one before.
            RobotNotReady: as for :meth:`move_to`.
        """
        self._guidance().stream(self.side, position)

    def _snapshot(self) -> Snapshot:
        snapshot = self._guidance().snapshot(self.side)
        if not snapshot.is_streaming:
            raise RobotNotReady(
                f"The robot sends no positions of its {self.side.word} arm: EGM is not running; call robot.recover()."
            )
        return snapshot


def _mode(snapshot: Snapshot) -> ArmMode:
    if not snapshot.is_streaming:
        return ArmMode.SILENT
    if not snapshot.is_running:
        return ArmMode.IDLE
    return ArmMode.MOVING if max(map(abs, snapshot.velocity)) > STANDING else ArmMode.HOLDING


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
    grippers: Mapping[Side, GripperGripper]
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
            self._control.check()
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
        self._control, self.manager, self.grippers = parts.control, parts.manager, parts.grippers
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
        parts.control.start()
        stack.callback(parts.control.stop)
        stack.callback(parts.signals.close)
        try:
            parts.signals.keep_open()
        except YumiError as error:  # the hands are asked instead
            log.info("The controller does not tell of the grippers by itself: %s", error)
        self.manager.watch.reports.report = log.log
        self._book.explain = self.manager.watch.explain
        self.manager.start()
        stack.callback(self.manager.stop)
        goals = {side: boxes.goals for side, boxes in parts.control.buffers.items()}
        limits = slower(YUMI_LIMITS, top_speed=radians(settings.egm_motion.max_speed_deviation))
        self.guidance = Guidance(parts.control, goals, self._book, self._arms, limits, SystemClock())

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


T = TypeVar("T")


class Robot:
    """A YuMi, real or virtual; built by :func:`yumi.connect`, connected by ``with`` or :meth:`open`.

    Args:
        settings: where it is, and how it shall move.
        controllers: what runs on each arm.
        arms: those that are guided; the others stand still.

    Attributes:
        right: the right arm.
        left: the left arm.
    """

    def __init__(self, settings: Settings, controllers: Controllers, arms: tuple[Side, ...] = tuple(Side)) -> None:
        self._connection = Connection(settings, controllers, arms)
        self._address = f"{settings.robot.address}:{settings.robot.rws_port}"
        self._is_connected = False
        force, picked = settings.gripper.force, settings.gripper.picked_pressure
        self.right, self.left = (
            Arm(
                side,
                lambda: self.guidance,
                Gripper(
                    side,
                    partial(self._hand, side),
                    force,
                    picked,
                    self._check_not_stopped,
                    partial(self._calibrate, side),
                ),
            )
            for side in (Side.RIGHT, Side.LEFT)
        )

    def __enter__(self) -> Robot:
        return self.open()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<yumi.Robot at {self._address}, {'' if self._is_connected else 'not '}connected>"

    def open(self, confirm: str = "") -> Robot:
        """Connect, switch the motors on, start EGM and calibrate hands that need it; a notebook's ``with``.

        Args:
            confirm: the stop that a person has looked at and confirms: ``stop`` of the error of an earlier attempt.

        Returns:
            This robot.

        Raises:
            StopNotConfirmed: an emergency stop, a guard stop or a collision waits for a person's confirmation.
            NoConnection: nothing answers, or an EGM port is taken.
            LoginRefused: user or password are wrong.
            RobotNotReady: the robot cannot be brought to where it may move, or another program drives it.
        """
        if not self._is_connected:
            self._connection.open(confirm)
            self._is_connected = True
        return self

    def close(self) -> None:
        """Let the arms come to rest, end EGM and disconnect; does nothing when that is done."""
        self._is_connected = False
        self._connection.close()

    @property
    def is_connected(self) -> bool:
        """Whether it was opened and not closed."""
        return self._is_connected

    def move_to(
        self,
        *,
        right: Position | None = None,
        left: Position | None = None,
        wait: bool = True,
        timeout: float | None = None,
        speed: float | None = None,
        acceleration: float | None = None,
    ) -> tuple[Motion, ...]:
        """Move both arms, beginning in the same cycle; either both move or none.

        Each arm arrives in its own time. An arm that is stopped on its way stops the other.

        Args:
            right: joint positions of the right arm [rad], (7,); None leaves it alone.
            left: joint positions of the left arm [rad], (7,).
            wait: return when the arms stand at their goals; else at once.
            timeout: arms that take longer than this are stopped [s]; None lets them take their time.
            speed: share of the joints' highest speeds, above 0 up to 1; None takes that of ``connect``.
            acceleration: the same for accelerations and jerks.

        Returns:
            The motions; over, unless ``wait`` is False.

        Raises:
            CommandRefused: no arm is named, or a position or share is impossible; nothing was changed.
            RobotNotReady: not connected, EGM not running, or stopped by a fault; nothing was changed.
            GoalNotReached: a motion ended elsewhere; both arms hold.
        """
        goals: dict[Side, Position] = _named(right, left)
        guidance = self.guidance
        motions = guidance.move(goals, speed, acceleration)
        if wait:
            wait_for(motions, timeout, guidance)
        return motions

    def follow(
        self,
        *,
        right: Sequence[TimedPosition] | None = None,
        left: Sequence[TimedPosition] | None = None,
        wait: bool = True,
        timeout: float | None = None,
    ) -> tuple[Motion, ...]:
        """Have both arms follow trajectories that begin at the same moment, 0.1 s after the call; or none.

        An arm that is stopped on its way stops the other while somebody waits for them.

        Args:
            right: of the right arm, see :meth:`yumi.api.robot.Arm.follow`; None leaves it alone.
            left: of the left arm.
            wait: return when the arms stand at their last points; else at once.
            timeout: arms that take longer than this are stopped [s]; None lets them take their time.

        Returns:
            The motions; over, unless ``wait`` is False.

        Raises:
            CommandRefused: no arm is named, or a trajectory is impossible.
            RobotNotReady: as for :meth:`move_to`.
            GoalNotReached: a motion ended elsewhere; both arms hold.
        """
        trajectories = _named(right, left)
        guidance = self.guidance
        motions = guidance.follow(trajectories)
        if wait:
            wait_for(motions, timeout, guidance)
        return motions

    def stop(self) -> None:
        """Bring both arms to rest as fast as their joints may, and return when they stand.

        Raises:
            RobotNotReady: the robot is not connected.
            GoalNotReached: an arm did not come to rest.
        """
        guidance = self.guidance
        wait_for(guidance.stop(guidance.arms), None, guidance)

    def recover(self, confirm: str = "") -> None:
        """Bring the robot back to where it may move, after an emergency stop, a lost connection, or any other fault.

        Nothing moves by itself: the arms hold where they are until they get their next goal. After an emergency stop, a
        guard stop or a collision a person has to look at the robot first and confirm that stop::

            try:
                robot.recover()
            except yumi.errors.StopNotConfirmed as error:
                if input(f"{error} Type yes when nobody is near the robot: ") == "yes":
                    robot.recover(confirm=error.stop)

        Args:
            confirm: the stop that a person has looked at and confirms: ``stop`` of an error, or
                :attr:`stop_to_confirm`.

        Raises:
            StopNotConfirmed: a stop waits for a person's confirmation, or another one; nothing was changed.
            YumiError: a step failed; the message says which and what to do.
        """
        self._check_connected()
        self._connection.recover(confirm)

    @property
    def stop_to_confirm(self) -> str:
        """Id of the stop that a person must confirm before anything moves again; empty where there is none.

        Raises:
            RobotNotReady: the robot is not connected.
        """
        self._check_connected()
        return self._connection.manager.state().stop

    @property
    def speed_scale(self) -> float:
        """The factor on the speed of every controller, which holds now; a motion at 0.1 takes ten times as long.

        It is 0.1 at first for a robot that is not on this machine, unless :func:`yumi.connect` or the settings say
        otherwise. Setting it changes motions under way, too, gradually. The robot's own limit follows when EGM starts:
        it cannot be raised above what EGM was started with before ``robot.close()`` and ``robot.open()``.

        Raises:
            CommandRefused: a value that is set is not from 0.01 to 1; nothing was changed.
            RobotNotReady: the robot is not connected.
        """
        self._check_connected()
        return self._connection.manager.speed.in_force

    @speed_scale.setter
    def speed_scale(self, value: float) -> None:
        self._check_connected()
        log.info(self._connection.manager.speed.set(value))

    def describe(self) -> str:
        """Mode, motors, RAPID program and EGM of the robot in one line.

        Raises:
            YumiError: the controller does not answer.
        """
        self._check_connected()
        return self._connection.manager.describe()

    @property
    def guidance(self) -> Guidance:
        """What the arms' methods are made of.

        Raises:
            RobotNotReady: the robot is not connected.
        """
        self._check_connected()
        return self._connection.guidance

    def _hand(self, side: Side) -> Hand:
        self._check_connected()
        return self._connection.grippers[side]

    def _calibrate(self, side: Side) -> None:
        self._check_connected()
        self._connection.calibrate(side)

    def _check_not_stopped(self) -> None:
        self._check_connected()
        self._connection.manager.check_not_stopped()

    def _check_connected(self) -> None:
        if not self._is_connected:
            raise RobotNotReady("The robot is not connected; write `with yumi.connect(...) as robot`, or call open().")


def _named(right: T | None, left: T | None) -> dict[Side, T]:
    """What was given for each arm."""
    given = {side: value for side, value in ((Side.RIGHT, right), (Side.LEFT, left)) if value is not None}
    if not given:
        raise CommandRefused("No arm has a goal; give right=, left= or both.")
    return given
