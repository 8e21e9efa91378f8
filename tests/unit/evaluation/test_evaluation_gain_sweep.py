from __future__ import annotations

import pytest

from yumi_evaluation.experiments import StepFigures
from yumi_evaluation.gain_sweep import GainPoint, Recommendation, Task, onset_of, recommend


def point(gain: float, overshoot_deg: float) -> GainPoint:
    return GainPoint(gain, StepFigures(0.5, overshoot_deg, 0, 0.0))


@pytest.mark.parametrize(
    ("overshoots", "onset"),
    [((0.0, 0.0, 0.5), 3.0), ((0.0, 0.5, 0.5), 2.0), ((0.5, 0.0, 0.5), 3.0), ((0.0, 0.0, 0.0), None)],
)
def test_onset_is_the_gain_from_which_on_all_oscillate(overshoots: tuple[float, ...], onset: float | None) -> None:
    points = [point(gain, overshoot) for gain, overshoot in zip((1.0, 2.0, 3.0), overshoots, strict=True)]
    assert onset_of(points) == onset


def test_recommended_gain_is_the_quickest_that_oscillates_with_neither_robot() -> None:
    found = recommend((1.6, 2.4), Task())
    assert found.gain == 1.6
    assert found.settling_s == pytest.approx(0.63, abs=0.03)
    assert found.onset == 2.4
    assert "Recommended: P = 1.6" in str(found)


def test_text_says_that_no_gain_does() -> None:
    text = str(Recommendation(None, None, 1.0, (), ()))
    assert text == "No gain up to 2 settles without overshoot; oscillation is seen from P = 1."


@pytest.mark.parametrize(
    ("shipped", "words"), [(1.7, ""), (1.2, "is lower on purpose"), (2.0, "is higher: for this task lower it")]
)
def test_delivered_gain_that_differs_is_explained(shipped: float, words: str) -> None:
    found = Recommendation(1.7, 0.6, 1.8, (), ())
    assert words in found.beside(shipped)
    assert bool(found.beside(shipped)) == bool(words)
