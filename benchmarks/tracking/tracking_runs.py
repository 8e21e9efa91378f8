"""How closely a virtual arm follows a streamed reference or a known trajectory: runs, their figures, and a picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from math import inf, radians
from pathlib import Path
from random import Random

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Side
from abb_runtime.parameters import Values
from yumi.control.limiter import Limiter
from yumi_evaluation.experiments import AXIS_6, Mode, Sine, Step
from yumi_evaluation.metrics import minimum
from yumi_evaluation.virtual_time import PlannedSine, StreamedArm, follow_planned


@dataclass(frozen=True, slots=True)
class Tracking:
    """How closely a known trajectory was followed.

    Attributes:
        max_error_deg: largest difference of the measured from the planned position [°].
        mean_lag: by how much it was late on average, in the sense of least squares [s].
        slowed: cycles in which the limiter changed the command.
    """

    max_error_deg: float
    mean_lag: float
    slowed: int


def follow_sine(sine: PlannedSine, parameters: Values | None = None) -> Tracking:
    """The figures of axis 6 following ``sine`` as a trajectory."""
    path = follow_planned(sine, parameters)
    planned = np.array([sine.at(time) for time in path.measured[:, 0]])
    errors, speeds = path.measured[:, 1] - planned[:, 0], planned[:, 1]
    return Tracking(float(np.degrees(np.abs(errors).max())), float(-(errors @ speeds) / (speeds @ speeds)), path.slowed)


@dataclass(frozen=True, slots=True)
class Stream:
    """How goals are sent.

    Attributes:
        rate: goals per second [Hz].
        lateness: mean of the time by which they arrive late, exponentially distributed, in order [s].
        until: no goal is sent after that [s].
    """

    rate: float = 500.0
    lateness: float = 0.0
    until: float = inf

    def arrivals(self, duration: float) -> list[tuple[float, float]]:
        """When a goal arrives and when it was sent [s], the first at 0; the same every time."""
        chance, last, found = Random(1), 0.0, list[tuple[float, float]]()
        while (sent := len(found) / self.rate) <= min(self.until, duration + CYCLE):
            late = chance.expovariate(1.0 / self.lateness) if self.lateness > 0.0 else 0.0
            last = max(last, sent + late)
            found.append((last, sent))
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """An arm that followed a streamed reference; arrays with a value for each cycle.

    Attributes:
        reference: what was streamed.
        times: since the first goal [s].
        measured: angle from where the joint began [rad].
        speeds: that the robot planned [rad/s].
        slowed: cycles in which the limiter changed the command.
    """

    reference: Step | Sine
    times: NDArray[np.float64]
    measured: NDArray[np.float64]
    speeds: NDArray[np.float64]
    slowed: int
    errors: NDArray[np.float64] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "errors", self.measured - self._reference(self.times))

    def after(self, begin: float) -> Run:
        """The part of it from ``begin`` [s] on."""
        is_later = self.times >= begin
        return replace(self, times=self.times[is_later], measured=self.measured[is_later], speeds=self.speeds[is_later])

    @property
    def max_error_deg(self) -> float:
        """Largest difference of the measured position from the reference of the same moment [°]."""
        return float(np.degrees(np.abs(self.errors).max()))

    @property
    def overshoot_deg(self) -> float:
        """By how much the measured position went past the end of the reference [°]."""
        end = self.reference(self.times[-1])
        return float(np.degrees((np.sign(end or 1.0) * (self.measured - end)).max()))

    @property
    def max_acceleration(self) -> float:
        """Largest acceleration the robot planned [rad/s²]."""
        return float(np.abs(np.diff(self.speeds)).max() / CYCLE)

    @property
    def lag(self) -> float:
        """The delay of the reference with which it comes closest to the measured positions [s]."""
        times, measured = self.times[::4], self.measured[::4]
        return minimum(lambda late: float(((measured - self._reference(times - late)) ** 2).sum()), -0.02, 0.38)

    def settling_time(self, band_deg: float) -> float:
        """Since when the measured position has been as close as that to the reference [s]."""
        outside = self.times[np.degrees(np.abs(self.errors)) > band_deg]
        return float(outside[-1]) + CYCLE if outside.size else 0.0

    def _reference(self, times: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([self.reference(time) for time in times])


FULL_SPEED_LIMITS = YUMI_LIMITS.slowed_to(radians(Mode.FULLSPEED.value.max_speed_deviation))
"""What the robot lets the joints do at full-speed settings."""


def follow(reference: Step | Sine, duration: float, values: Values | None = None, stream: Stream | None = None) -> Run:
    """Have axis 6 of the virtual left arm follow a reference that is streamed, so that its future is unknown.

    Args:
        reference: what is streamed.
        duration: how long [s].
        values: parameters of the joint position controller.
        stream: how it is streamed.
    """
    rig = StreamedArm(FULL_SPEED_LIMITS, values or {}, Mode.FULLSPEED, Side.LEFT, Limiter(FULL_SPEED_LIMITS))
    rig.stream(reference, (AXIS_6,), (stream or Stream()).arrivals(duration), duration)
    measured = rig.measured(AXIS_6)
    speeds = np.array([each[AXIS_6] for each in rig.speeds])
    return Run(reference, measured[:, 0], measured[:, 1], speeds, rig.slowed)


def draw_runs(runs: Sequence[tuple[str, Run]], file: Path) -> None:
    """Draw each named run in a column of its own, the errors below, and save the picture as ``file``."""
    figure = Figure(figsize=(4.5 * len(runs), 6.0), layout="constrained")
    panels = figure.subplots(2, len(runs), sharex="col", squeeze=False, height_ratios=(2, 1))
    for (name, run), upper, lower in zip(runs, panels[0], panels[1], strict=True):
        upper.plot(run.times, np.degrees(run.measured - run.errors), label="reference", linewidth=3.0, alpha=0.4)
        upper.plot(run.times, np.degrees(run.measured), label="measured")
        lower.plot(run.times, np.degrees(run.errors))
        upper.set_title(name)
        lower.set_xlabel("time [s]")
        for panel in (upper, lower):
            panel.grid(alpha=0.3)
    panels[0][0].set_ylabel("angle [°]")
    panels[1][0].set_ylabel("error [°]")
    figure.legend(*panels[0][0].get_legend_handles_labels(), loc="outside upper right", ncols=2, frameon=False)
    figure.savefig(file, dpi=150)
