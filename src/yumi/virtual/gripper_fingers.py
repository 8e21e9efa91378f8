"""The mechanics of the gripper: two fingers on one motor, and the workpiece they may meet."""

from __future__ import annotations

from dataclasses import dataclass

from yumi.robot.gripper import TRAVEL

FORCE_RATE = 100.0
"""How fast the motor builds up force against something that does not give way [N/s]."""

FINGER_LENGTH = 0.020
"""How far something slides between the fingers until it is out [m]."""

GRAVITY = 9.81
"""[m/s²]"""


@dataclass(frozen=True, slots=True)
class Workpiece:
    """Something the fingers may hold: between them or, when it is hollow, from inside.

    It lies in place all the time; the fingers meet it when they come from the right side.

    Attributes:
        width: distance of the two faces that the fingers touch [m], above 0, at most 0.05.
        is_hollow: whether the fingers press outward from inside.
        mass: what hangs between the fingers [kg].
        friction: coefficient between fingers and faces.
    """

    width: float
    is_hollow: bool = False
    mass: float = 0.050
    friction: float = 0.5

    def __post_init__(self) -> None:
        if not 0.0 < self.width <= 2.0 * TRAVEL:
            raise ValueError(f"a workpiece of {self.width} m: widths above 0 and up to {2.0 * TRAVEL} m are allowed")
        if self.mass < 0.0 or self.friction <= 0.0:
            raise ValueError(f"a workpiece of {self.mass} kg and friction {self.friction}: both are positive")

    def slide(self, force: float) -> float:
        """Acceleration with which it slides out of fingers that press with ``force`` [N]; 0 when it is held [m/s²]."""
        if self.mass == 0.0:
            return 0.0
        return max(0.0, GRAVITY - 2.0 * self.friction * force / self.mass)


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
        self._slid = self._sliding = 0.0  # [m], [m/s]

    def rest(self) -> None:
        """The motor lets go."""
        self.speed = self.force = self._slid = self._sliding = 0.0

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
        if self.force >= force > 0.0:
            self._let_slide(left)
        return left

    def _let_slide(self, dt: float) -> None:
        """The motor presses as it shall: what is too heavy for that slides out and is gone."""
        acceleration = 0.0 if self.workpiece is None else self.workpiece.slide(self.force)
        if acceleration == 0.0:
            self._slid = self._sliding = 0.0
            return
        self._slid += self._sliding * dt + acceleration * dt**2 / 2.0
        self._sliding += acceleration * dt
        if self._slid >= FINGER_LENGTH:
            self.workpiece = None

    def _stop_on_the_way_to(self, target: float) -> float:
        """The target, or the face of the workpiece where it is in the way."""
        if self.workpiece is None:
            return target
        face = self.workpiece.width / 2.0
        if self.workpiece.is_hollow:
            return face if self.opening <= face < target else target
        return face if target < face <= self.opening else target
