"""One hand, as a script sees it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from yumi.errors import CommandRefused, GoalNotReached
from yumi.hardware.gripper import Gripper as Hand
from yumi.robot.gripper import TRAVEL, Outcome
from yumi.robot.joints import Side

WIDTH_TOLERANCE = 0.003
"""By how much what is grasped may be wider or narrower than expected [m]."""


@dataclass(frozen=True, slots=True)
class Grip:
    """How a gripper command ended.

    Attributes:
        outcome: open, closed, in place, holding or stalled.
        width: distance between the fingers [m].
    """

    outcome: Outcome
    width: float


class Gripper:
    """The hand of one arm; its motions do not disturb the arm's.

    Args:
        side: which arm carries it.
        hand: the robot's, while it is connected; raises when it is not.
        force: holding force where a call names none [N].

    Attributes:
        side: which arm carries it.
    """

    def __init__(self, side: Side, hand: Callable[[], Hand], force: float) -> None:
        self.side = side
        self._hand = hand
        self._force = force

    @property
    def position(self) -> float:
        """Measured distance of each finger from the middle [m], 0 to 0.025; half of :attr:`width`.

        Raises:
            RobotNotReady: the robot is not connected, or has no such gripper.
        """
        return self._hand().position()

    @property
    def width(self) -> float:
        """Measured distance between the fingers [m], 0 to 0.05; raises as :attr:`position`."""
        return 2.0 * self.position

    @property
    def is_holding(self) -> bool:
        """Whether the hand holds something now, by its own account; raises as :attr:`position`."""
        return self._hand().is_holding()

    def open(self, width: float = 2.0 * TRAVEL) -> Grip:
        """Open the fingers, and return when they stand.

        Args:
            width: distance between them [m], above 0 up to 0.05.

        Raises:
            CommandRefused: the width is impossible; nothing was changed.
            RobotNotReady: the gripper is not calibrated, or reports an error.
            GoalNotReached: something is in the way.
        """
        if not 0.0 < width <= 2.0 * TRAVEL:  # NaN too
            raise CommandRefused(f"Gripper width {width} m is out of range; allowed is above 0 to {2.0 * TRAVEL} m.")
        grip = self._command(width / 2.0, self._force)
        if grip.outcome is Outcome.STALLED:
            raise GoalNotReached(
                f"The {self.side.word} gripper stopped at {_mm(grip.width)} instead of {_mm(width)}; look what is in "
                "the way."
            )
        return grip

    def close(self) -> Grip:
        """Close the fingers with the usual force, on whatever is between them, and return when they stand.

        Raises:
            RobotNotReady: as for :meth:`open`.
        """
        return self._command(0.0, self._force)

    def grasp(self, force: float | None = None, width: float | None = None) -> Grip:
        """Close the fingers on an object and hold it.

        Args:
            force: to hold it with, above 0 up to 20 [N]; None takes the usual one.
            width: of the object [m], above 0 up to 0.05; None takes any.

        Raises:
            CommandRefused: the force or width is impossible; nothing was changed.
            RobotNotReady: as for :meth:`open`.
            GoalNotReached: nothing is held, or something wider or narrower by more than 3 mm; it is still held.
        """
        if width is not None and not 0.0 < width <= 2.0 * TRAVEL:
            raise CommandRefused(f"Object width {width} m is out of range; allowed is above 0 to {2.0 * TRAVEL} m.")
        grip = self._command(0.0, self._force if force is None else force)
        if grip.outcome is not Outcome.HOLDING:
            raise GoalNotReached(f"The {self.side.word} gripper holds nothing: it is {grip.outcome.value}.")
        if width is not None and abs(grip.width - width) > WIDTH_TOLERANCE:
            raise GoalNotReached(
                f"The {self.side.word} gripper holds something {_mm(grip.width)} wide, not {_mm(width)}; it holds on."
            )
        return grip

    def _command(self, position: float, force: float) -> Grip:
        hand = self._hand()
        hand.begin(position, force)
        outcome = hand.wait(position, lambda now_at: None)
        return Grip(outcome, 2.0 * hand.last_position)


def _mm(width: float) -> str:
    return f"{width * 1e3:.1f} mm"
