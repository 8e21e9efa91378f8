"""Which experiments there are: the publication's, those of the better control laws, and those of all joints."""

from __future__ import annotations

from dataclasses import replace

from yumi.evaluation.experiment import (
    FEED_FORWARD_ONLY,
    LOOK_AHEAD,
    PREDICTION,
    Experiment,
    Mode,
    Published,
    proportional,
    sine,
    step,
)
from yumi.robot.joints import JOINT_COUNT, Side

PUBLISHED_OSCILLATION = 2.0
"""The gain around which the publication saw oscillation begin."""

OTHER_FREQUENCIES = (0.1, 0.15)
"""At which the lags are predicted too, to show what the unknown frequency does to them [Hz]."""

_REDUCED = Mode.REDUCED


def published_experiments() -> tuple[Experiment, ...]:
    """Chapter 5 of the publication, with the numbers of its figures and what it says."""
    return (
        _as(step(proportional(1.2)), "5.1a", Published(settling=0.8)),
        _as(step(proportional(1.6)), "5.1b", Published(settling=0.6)),
        _as(step(proportional(2.0)), "", Published()),
        _as(step(proportional(0.35), _REDUCED, 4.5), "5.2a", Published()),
        _as(step(proportional(0.6), _REDUCED, 3.5), "5.2b", Published()),
        _as(step(proportional(1.2), _REDUCED), "5.2c", Published(settling=1.4)),
        _as(sine(proportional(1.2)), "5.3", Published(mean_lag=0.156, max_lag=0.184)),
        _as(sine(proportional(2.0)), "5.4", Published(mean_lag=0.092, max_lag=0.106)),
        _as(sine(proportional(0.35), _REDUCED), "5.5a", Published()),
        _as(sine(proportional(0.6), _REDUCED), "5.5b", Published()),
        _as(sine(proportional(1.2), _REDUCED), "5.5c, 5.6", Published()),
        _as(sine(proportional(1.2), size_deg=60.0), "5.7", Published(mean_lag=0.141, max_lag=0.189)),
    )


def better_experiments() -> tuple[Experiment, ...]:
    """The same references with what the publication did not have."""
    return (
        step(PREDICTION),
        sine(FEED_FORWARD_ONLY),
        sine(PREDICTION),
        sine(PREDICTION, size_deg=60.0),
        sine(LOOK_AHEAD),
        sine(LOOK_AHEAD, size_deg=60.0),
    )


def joint_experiments() -> tuple[Experiment, ...]:
    """Both arms, all joints at once."""
    everything = tuple(range(JOINT_COUNT))
    return tuple(replace(sine(PREDICTION), moved=everything).on(side) for side in Side)


def other_frequencies() -> tuple[Experiment, ...]:
    """The publication's two sines, slower."""
    return tuple(
        sine(proportional(gain), frequency=frequency) for frequency in OTHER_FREQUENCIES for gain in (1.2, 2.0)
    )


def _as(experiment: Experiment, figure: str, published: Published) -> Experiment:
    return replace(experiment, figure=figure, published=published)
