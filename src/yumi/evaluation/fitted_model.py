"""The arm whose control lag was fitted to the published step times, and to nothing else.

``benchmarks/tracking/fit_model.py`` does it again (:mod:`yumi.evaluation.model_fit`).
"""

from __future__ import annotations

from yumi.virtual.arm_model import ArmModel

CONTROL_LAG = 0.0167
"""From reference to position, where our step times are closest to the published ones [s]."""


def arm_with(control_lag: float) -> ArmModel:
    """An arm with that control lag [s], shared between delay and servo lag as in the virtual robot that is shipped."""
    shipped = ArmModel()
    share = shipped.delay / (shipped.delay + shipped.lag)
    return ArmModel(delay=share * control_lag, lag=(1.0 - share) * control_lag)


FITTED = arm_with(CONTROL_LAG)
