"""A vacuum module of the gripper: an ejector, a cup, and what lies under it; advances by dt."""

from __future__ import annotations

from dataclasses import dataclass
from math import exp

from yumi.robot.gripper import ATMOSPHERE

DEEPEST = 25_000.0
"""Pressure under a cup that is tight [Pa]."""

OPEN = 90_000.0
"""Pressure in a cup that sucks air [Pa]."""

EVACUATION = 0.12
"""Time constant of evacuating a cup [s]."""

VENTING = 0.25
"""Time constant of a cup that is left to itself, through the ejector [s]."""

BLOW_OFF = 0.02
"""Time constant of a cup that is blown off [s]."""


@dataclass(frozen=True, slots=True)
class CupObject:
    """Something under a cup.

    Attributes:
        leak: how much air comes through or past it: 0 is tight, 1 as if it were not there.
    """

    leak: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.leak <= 1.0:
            raise ValueError(f"a leak of {self.leak}: 0 (tight) to 1 (open) are allowed")


class VacuumCup:
    """One cup; its ejector either sucks or blows.

    Attributes:
        sucks: ``hand_StatusVacuum``.
        blows: ``hand_StatusBlowoff``.
        pressure: absolute, in the cup [Pa].
        under: what lies under it; None is nothing.
    """

    def __init__(self, under: CupObject | None = None) -> None:
        self.sucks = False
        self.blows = False
        self.pressure = ATMOSPHERE
        self.under = under

    def suck(self, *, is_on: bool) -> None:
        """Switch the vacuum; a cup that sucks does not blow."""
        self.sucks = is_on
        self.blows = self.blows and not is_on

    def blow(self, *, is_on: bool) -> None:
        """Switch the blow-off; a cup that blows does not suck."""
        self.blows = is_on
        self.sucks = self.sucks and not is_on

    def advance(self, dt: float) -> None:
        """Let ``dt`` [s] pass."""
        final, time_constant = self._tendency()
        self.pressure = final + (self.pressure - final) * exp(-dt / time_constant)

    def _tendency(self) -> tuple[float, float]:
        if self.sucks:
            leak = 1.0 if self.under is None else self.under.leak
            return DEEPEST + leak * (OPEN - DEEPEST), EVACUATION
        return ATMOSPHERE, BLOW_OFF if self.blows else VENTING
