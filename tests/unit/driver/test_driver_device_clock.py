"""The clock of a device: a frame was made no earlier than the driver says, whatever the link and the clocks do."""

from __future__ import annotations

import numpy as np
import pytest

from yumi.driver.teleoperation import DeviceClock

STATES, FRAMES = 1.0 / 30.0, 1.0 / 60.0  # [s] between two


def delays(generator: np.random.Generator, count: int, least: float, jitter: float) -> np.ndarray:
    """Of messages on a link that delays, and now and then for long [s]."""
    spikes = (generator.uniform(size=count) < 0.05) * generator.exponential(0.3, count)
    return np.asarray(least + generator.uniform(0.0, jitter, count) + spikes)


@pytest.mark.parametrize("seed", range(20))
def test_frame_was_made_no_earlier_than_the_bound_says(seed: int) -> None:
    generator = np.random.default_rng(seed)
    down, up = generator.uniform(0.0, 0.2, 2)
    ahead, runs = generator.uniform(-1e4, 1e4), 1.0 + generator.uniform(-5e-4, 5e-4)  # how the device's clock goes
    sent = STATES * np.arange(900)
    arrived = np.maximum.accumulate(sent + delays(generator, len(sent), down, 0.05))  # in order, as over TCP
    made = 1.0 + FRAMES * np.arange(1600)
    came = np.maximum.accumulate(made + delays(generator, len(made), up, 0.05))
    clock, loose = DeviceClock(), []
    for at, now in zip(made, came, strict=True):
        seen = sent[np.searchsorted(arrived, at) - 1]
        if arrived[0] > at:
            continue
        earliest = clock.here(float(ahead + runs * at), float(now), float(seen)).earliest
        assert earliest <= at + 1e-9
        loose.append(at - earliest)
    # What the bound gives away is the way of the fastest state, and the wait until a frame is made after it.
    assert max(loose[200:]) < down + 0.05 + FRAMES


def test_device_of_this_machine_has_sent_its_fastest_frame_in_no_time() -> None:
    clock = DeviceClock()
    ages = [now - clock.here(time, now).earliest for time, now in ((5.0, 1.01), (5.1, 1.1), (5.2, 1.25))]
    assert ages == pytest.approx([0.0, 0.0, 0.05], abs=1e-3)


@pytest.mark.parametrize("jump", [-3.0, 3.0])
def test_clock_of_a_device_that_was_set_is_learnt_anew(jump: float) -> None:
    clock = DeviceClock()
    for time in (1.0, 1.1, 1.2):
        clock.here(50.0 + time, time + 0.02, time - 0.03)
    ages = [time + 0.02 - clock.here(50.0 + jump + time, time + 0.02, time - 0.03).earliest for time in (1.3, 1.4)]
    assert ages == pytest.approx([0.05, 0.05], abs=1e-3)
