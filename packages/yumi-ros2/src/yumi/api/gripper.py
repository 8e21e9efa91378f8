"""The gripper of one arm as a script commands it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, GoalNotReached, YumiError
from abb_protocols.robot.gripper_values import (
    FINGER_TRAVEL,
    GripDirection,
    GripOutcome,
    GripperGoal,
    finger_position_goal,
    grip,
)
from abb_protocols.robot.joints import Side

if TYPE_CHECKING:  # yumi.pose takes no more than poses need
    from yumi.driver import gripper as driver


_PICKED_PRESSURE = 70_000.0
"""The usual pressure below which a cup holds something [Pa]."""

_WIDTH_TOLERANCE = 0.003
"""By how much what is grasped may be wider or narrower than expected [m]."""


@dataclass(frozen=True, slots=True)
class Grip:
    """How a gripper command ended.

    Attributes:
        outcome: open, closed, in place, holding or stalled.
        width: distance between the fingers [m].
    """

    outcome: GripOutcome
    width: float


class Gripper:
    """The gripper of one arm; its motions do not disturb the arm's.

    Args:
        side: which arm carries it.
        gripper: the robot's, while it is connected; raises when it is not.
        force: holding force where a call names none [N].
        picked_pressure: a vacuum module whose pressure is not above this has picked something [Pa].
        calibrate: calibrates it, whatever its arm does; None where EGM does not run on the arm.
        check: raises RobotNotReady while a stop waits for a person's confirmation, and CommandRefused while one has the
            arm.

    Attributes:
        side: which arm carries it.
    """

    def __init__(
        self,
        side: Side,
        gripper: Callable[[], driver.RwsGripper],
        force: float,
        picked_pressure: float = _PICKED_PRESSURE,
        check: Callable[[], None] = lambda: None,
        calibrate: Callable[[], None] | None = None,
    ) -> None:
        self._check = check
        self.side = side
        self._gripper = gripper
        self._force = force
        self._picked_pressure = picked_pressure
        self._calibrate = calibrate or (lambda: gripper().calibrate())
        self._direction = GripDirection.INWARDS  # of the last grip

    def __repr__(self) -> str:
        try:
            width, holding = self.width, self.is_holding
        except YumiError:
            return f"<yumi.Gripper {self.side.word}, not connected>"
        return f"<yumi.Gripper {self.side.word}, {_mm(width)} wide{', holding' if holding else ''}>"

    @property
    def position(self) -> float:
        """Measured distance of each finger from the middle [m], 0 to 0.025; raises RobotNotReady if there is none."""
        return self._gripper().position()

    @property
    def width(self) -> float:
        """Measured distance between the fingers [m], 0 to 0.05; raises as :attr:`position`."""
        return 2.0 * self.position

    @property
    def is_holding(self) -> bool:
        """Whether the gripper holds something now, by its own signals; raises as :attr:`position`."""
        return self._gripper().is_holding()

    def open(self, width: float = 2.0 * FINGER_TRAVEL) -> Grip:
        """Open the fingers, and return when they stand.

        Args:
            width: distance between them [m], above 0 up to 0.05.

        Raises:
            CommandRefused: the width is impossible, or a person has the arm; nothing was changed.
            RobotNotReady: the gripper is not calibrated, or reports an error.
            GoalNotReached: something is in the way.
        """
        if not 0.0 < width <= 2.0 * FINGER_TRAVEL:  # NaN too
            raise CommandRefused(message("gripper_width_out_of_range", width=width, most=2.0 * FINGER_TRAVEL))
        result = self._command(finger_position_goal(width / 2.0))
        if result.outcome is GripOutcome.STALLED:
            raise GoalNotReached(
                message("gripper_stopped_short", gripper=self.side.word, width=result.width, wanted=width)
            )
        return result

    def close(self) -> Grip:
        """Close the fingers with the usual force, on whatever is between them; returns and raises as :meth:`open`."""
        return self._command(grip(GripDirection.INWARDS, self._force))

    def grasp(self, force: float | None = None, width: float | None = None, *, outwards: bool = False) -> Grip:
        """Close the fingers on an object and hold it, or open them inside a hollow one.

        Args:
            force: to hold it with, above 0 up to 20 [N]; None takes the usual one.
            width: of the object [m], above 0 up to 0.05; None takes any.
            outwards: whether the object is held from inside.

        Raises:
            CommandRefused: the force or width is impossible, or a person has the arm; nothing was changed.
            RobotNotReady: as for :meth:`open`.
            GoalNotReached: nothing is held, or something wider or narrower by more than 3 mm; it is still held.
        """
        if width is not None and not 0.0 < width <= 2.0 * FINGER_TRAVEL:
            raise CommandRefused(message("object_width_out_of_range", width=width, most=2.0 * FINGER_TRAVEL))
        self._direction = GripDirection.OUTWARDS if outwards else GripDirection.INWARDS
        result = self._command(grip(self._direction, self._force if force is None else force))
        if result.outcome is not GripOutcome.HOLDING:
            raise GoalNotReached(message("gripper_holds_nothing", gripper=self.side.word, outcome=result.outcome.value))
        if width is not None and abs(result.width - width) > _WIDTH_TOLERANCE:
            raise GoalNotReached(
                message("gripper_holds_other_width", gripper=self.side.word, width=result.width, wanted=width)
            )
        return result

    def release(self) -> Grip:
        """Let go of what is held: open the fingers, or close them after a grasp outwards.

        Raises:
            RobotNotReady: as for :meth:`open`.
            GoalNotReached: something is in the way.
        """
        if self._direction is GripDirection.INWARDS:
            return self.open()
        result = self._command(finger_position_goal(0.0))
        if result.outcome is GripOutcome.STALLED:
            raise GoalNotReached(
                message("gripper_stopped_short", gripper=self.side.word, width=result.width, wanted=0.0)
            )
        return result

    def calibrate(self) -> None:
        """Close the fingers and call that zero; connecting and recovering do it where it is needed.

        The arm comes to rest, and EGM on it pauses meanwhile; ``robot.recover()`` starts it again where this fails.

        Raises:
            CommandRefused: a person has an arm that would come to rest.
            RobotNotReady: the gripper did not become calibrated.
        """
        self._check()
        with self._gripper().alone():
            self._calibrate()

    def clear_error(self) -> None:
        """Acknowledge the gripper's error; raises RobotNotReady when it still reports one."""
        self._gripper().clear_error()

    def pressure(self, channel: int = 1) -> float:
        """Absolute pressure in the cup of a vacuum module [Pa]; raises CommandRefused when there is no such module."""
        return self._gripper().vacuum(channel).pressure

    def has_picked(self, channel: int = 1) -> bool:
        """Whether a vacuum module sucks and something closes its cup; raises as :meth:`pressure`."""
        return self._gripper().vacuum(channel).has_picked(self._picked_pressure)

    def pick(self, channel: int = 1, timeout: float = 1.0) -> None:
        """Switch a vacuum module on and wait until it has picked something.

        Args:
            channel: 1 or 2.
            timeout: longest wait for the pressure [s].

        Raises:
            CommandRefused: the gripper has no such module, or a person has the arm.
            RobotNotReady: the gripper is not calibrated, did not switch, or a stop waits for a person's confirmation.
            GoalNotReached: nothing was picked; the vacuum stays on.
        """
        gripper = self._gripper()
        self._check()
        gripper.switch_vacuum(channel, is_on=True)
        if not gripper.wait_until_picked(channel, self._picked_pressure, timeout):
            raise GoalNotReached(
                message(
                    "vacuum_picked_nothing",
                    channel=channel,
                    gripper=self.side.word,
                    pressure=self.pressure(channel),
                    timeout=timeout,
                    needed=self._picked_pressure,
                )
            )

    def drop(self, channel: int = 1) -> None:
        """Blow off what a vacuum module holds, and switch it off; raises as :meth:`pick`."""
        self._check()
        self._gripper().drop(channel)

    def _command(self, goal: GripperGoal) -> Grip:
        gripper = self._gripper()
        with gripper.alone():
            gripper.begin(goal, self._check)
            outcome = gripper.wait(goal)
        assert outcome is not None, "it is not cancelled"
        return Grip(outcome, 2.0 * gripper.last_position)


def _mm(width: float) -> str:
    return f"{width * 1e3:.1f} mm"
