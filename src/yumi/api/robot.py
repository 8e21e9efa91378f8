"""The robot, as a script sees it: ``with yumi.connect(address) as robot``."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from functools import partial
from types import TracebackType
from typing import TypeVar

from yumi.api.arm import Arm
from yumi.api.connection import Connection
from yumi.api.gripper import Gripper
from yumi.api.guidance import Guidance, Position, TimedPosition
from yumi.api.motions import Motion
from yumi.api.waiting import wait_for
from yumi.app import Controllers
from yumi.errors import CommandRefused, RobotNotReady
from yumi.hardware.gripper import Gripper as Hand
from yumi.robot.joints import Side
from yumi.settings import Settings

T = TypeVar("T")
log = logging.getLogger(__name__)


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
            right: of the right arm, see :meth:`yumi.api.arm.Arm.follow`; None leaves it alone.
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
