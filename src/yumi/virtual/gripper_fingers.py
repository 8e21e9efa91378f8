"""The mechanics of the gripper: two fingers on one motor, and the workpiece they may meet."""

from __future__ import annotations

from dataclasses import dataclass

from yumi.robot.gripper import TRAVEL

FORCE_RATE = 100.0
"""How fast the motor builds up force against something that does not give way [N/s]."""


@dataclass(frozen=True, slots=True)
class Workpiece:
    """Something the fingers may hold: between them or, when it is hollow, from inside.

    It lies in place all the time; the fingers meet it when they come from the right side.

    Attributes:
        width: distance of the two faces that the fingers touch [m], above 0, at most 0.05.
        is_hollow: whether the fingers press outward from inside.
    """

    width: float
    is_hollow: bool = False

    def __post_init__(self) -> None:
        if not 0.0 < self.width <= 2.0 * TRAVEL:
            raise ValueError(f"a workpiece of {self.width} m: widths above 0 and up to {2.0 * TRAVEL} m are allowed")


class Fingers:
    """Position, speed and force of the fingers; the motor keeps both at the same distance from the middle.

    Attributes:
        opening: of each finger from the closed position [m].
        speed: of each finger, positive when opening [m/s].
        force: what they press with [N].
        workpiece: what they may meet; None is nothing.
    """

    def __init__(self, workpiece: Workpiece | None) -> None:
        self.opening = 0.0
        self.speed = 0.0
        self.force = 0.0
        self.workpiece = workpiece

    def rest(self) -> None:
        """The motor lets go."""
        self.speed = self.force = 0.0

    def drive(self, target: float, speed: float, force: float, dt: float) -> float:
        """Move towards ``target`` [m] with ``speed`` [m/s]; against an obstacle build up at most ``force`` [N].

        Returns:
            What was left of ``dt`` [s] when the fingers stood, at the target or at an obstacle.
        """
        stop = self._stop_on_the_way_to(target)
        needed = abs(stop - self.opening) / speed
        if needed > dt:
            self.speed = speed if stop > self.opening else -speed
            self.opening += self.speed * dt
            self.force = 0.0
            return 0.0
        self.opening, self.speed = stop, 0.0
        left = dt - needed
        self.force = 0.0 if stop == target else min(force, self.force + FORCE_RATE * left)
        return left

    def _stop_on_the_way_to(self, target: float) -> float:
        """The target, or the face of the workpiece where it is in the way."""
        if self.workpiece is None:
            return target
        face = self.workpiece.width / 2.0
        if self.workpiece.is_hollow:
            return face if self.opening <= face < target else target
        return face if target < face <= self.opening else target
