"""The servo of one arm: a first-order lag and a transport delay between planned and measured positions."""

from __future__ import annotations

from collections import deque
from math import exp
from typing import cast

from yumi.robot.joints import Joints
from yumi.virtual.arm_model import ArmModel

_SLEWING = 0.5  # how fast the delay may change [s/s]: below 1, so the past never runs backwards


class Servo:
    """Follows the planned position late and smoothly; exact for a plan that is straight within each step.

    Args:
        position: where the arm stands [rad], (7,).
        model: its delay and lag.
    """

    def __init__(self, position: Joints, model: ArmModel) -> None:
        self._model = model
        self._planned = position
        self._lagged = position
        self._time = 0.0
        self._delay = model.delay
        self._past = deque([(0.0, position)])
        self.wanted_delay = model.delay
        self.position = position

    def advance(self, planned: Joints, dt: float) -> None:
        """Follow the plan on its straight way to ``planned`` [rad] for ``dt`` [s] > 0."""
        self._lagged = self._follow(planned, dt)
        self._planned = planned
        self._time += dt
        self._past.append((self._time, self._lagged))
        change = self.wanted_delay - self._delay
        self._delay += max(-_SLEWING * dt, min(_SLEWING * dt, change))
        self.position = self._at(self._time - self._delay)

    def _follow(self, planned: Joints, dt: float) -> Joints:
        """The lag's exact answer to a ramp from the last plan to this one."""
        lag, left = self._model.lag, exp(-dt / self._model.lag) if self._model.lag > 0.0 else 0.0
        ramp = lag / dt
        # Per joint: u - a·τ + (y - u_before + a·τ)·e^(-dt/τ) with the slope a = (u - u_before)/dt.
        answer = tuple(
            now - (now - before) * ramp + (lagged - before + (now - before) * ramp) * left
            for now, before, lagged in zip(planned, self._planned, self._lagged, strict=True)
        )
        return cast("Joints", answer)

    def _at(self, time: float) -> Joints:
        past = self._past
        while len(past) > 1 and past[1][0] <= time:
            past.popleft()
        start, before = past[0]
        if time <= start or len(past) == 1:
            return before
        end, after = past[1]
        share = (time - start) / (end - start)
        between = tuple(a + (b - a) * share for a, b in zip(before, after, strict=True))
        return cast("Joints", between)
