"""The servo of one arm, which follows the planned position late and smoothly."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from math import exp
from typing import NamedTuple

from abb_protocols.robot.joints import CYCLE, Joints
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_motion import EgmMotion, EgmMotionParameters

_SLEWING = 0.5  # how fast the delay may change [s/s]: below 1, so the past never runs backwards


class Servo:
    """Follows the planned position late and smoothly; exact for a plan that is straight within each step."""

    def __init__(self, position: Joints, model: ArmModel) -> None:
        self._model = model
        self._planned = position
        self._lagged = position
        self._time = 0.0
        self._delay = model.delay
        self._past = deque([(0.0, position)])
        self._lags: tuple[float, ...] = ()  # of the joints, where they are not all that of the model [s]
        self.target_delay = model.delay
        self.position = position

    def rest_at(self, position: Joints) -> None:
        """Stand at a position [rad], (7,), whatever motion it was following."""
        self._planned = self._lagged = self.position = position
        self._past = deque([(self._time, position)])

    def tune(self, gains: Mapping[int, float]) -> None:
        """Follow with other gains of position control, 1 being the usual one, by index of the joint."""
        lag = self._model.lag
        self._lags = tuple(lag / gains.get(index, 1.0) for index in range(len(self.position))) if gains else ()

    def advance(self, planned: Joints, dt: float) -> None:
        """Follow the plan in a straight line to ``planned`` [rad] for ``dt`` [s] > 0."""
        lag, left = self._model.lag, exp(-dt / self._model.lag) if self._model.lag > 0.0 else 0.0
        ramp = lag / dt
        # The lag's exact answer to a ramp from the last plan to this one, per joint:
        # u - a·τ + (y - u_before + a·τ)·e^(-dt/τ) with the slope a = (u - u_before)/dt. Of an arm that stands, u.
        if self._lags and not planned == self._planned == self._lagged:
            tuned = []
            for now, before, lagged, own in zip(planned, self._planned, self._lagged, self._lags, strict=True):
                behind = (now - before) * own / dt
                tuned.append(now - behind + (lagged - before + behind) * (exp(-dt / own) if own > 0.0 else 0.0))
            self._lagged = tuple(tuned)
        elif not planned == self._planned == self._lagged:
            answer = [
                now - (now - before) * ramp + (lagged - before + (now - before) * ramp) * left
                for now, before, lagged in zip(planned, self._planned, self._lagged, strict=True)
            ]
            self._lagged = tuple(answer)
        self._planned = planned
        self._time += dt
        self._past.append((self._time, self._lagged))
        change = self.target_delay - self._delay
        self._delay += max(-_SLEWING * dt, min(_SLEWING * dt, change))
        # The lagged position at a time in the past, interpolated; what lies before it is forgotten.
        shown, past = self._time - self._delay, self._past
        while len(past) > 1 and past[1][0] <= shown:
            past.popleft()
        start, self.position = past[0]
        if shown > start and len(past) > 1:
            end, after = past[1]
            self.position = between(self.position, after, (shown - start) / (end - start))


class ServoAnswer(NamedTuple):
    """What an arm under EGM reports in a cycle: its measured and its planned position [rad]."""

    measured: Joints
    planned: Joints


def follow_references(
    references: Sequence[Joints],
    start: Joints,
    model: ArmModel,
    settings: EgmMotionParameters,
    *,
    cycle: float = CYCLE,
    speeds: Sequence[Joints] | None = None,
) -> list[ServoAnswer]:
    """How an arm follows references without anything else of a robot: what it reports and plans, cycle by cycle.

    EGM takes reference ``n`` in cycle ``n``, after the datagram of that cycle: the answer to a datagram, which arrives
    a cycle after that datagram, comes one place later.

    Args:
        references: positions [rad], one a cycle, as many joints as ``start`` has.
        start: where the arm stands [rad].
        model: its dynamics; its limits are of as many joints.
        settings: of EGM.
        cycle: [s].
        speeds: fed forward with the references [rad/s]; none without them.

    Returns:
        For each reference what the datagram of the cycle reports: the measured position, the planned position.
    """
    servo, motion = Servo(start, model), EgmMotion(start, settings, model)
    servo.target_delay = model.egm_delay(settings.level)
    answer = []
    fed = [motion.state.velocity] * len(references) if speeds is None else speeds
    for reference, velocity in zip(references, fed, strict=True):
        answer.append(ServoAnswer(servo.position, motion.state.position))
        motion.reference, motion.reference_velocity, motion.reported = reference, velocity, servo.position
        motion.advance(cycle)
        servo.advance(motion.state.position, cycle)
    return answer


def between(start: Joints, end: Joints, fraction: float) -> Joints:
    """Joint positions on the way from one posture to another."""
    if start == end:  # as of an arm that stands
        return start
    return tuple([x + (y - x) * fraction for x, y in zip(start, end, strict=True)])
