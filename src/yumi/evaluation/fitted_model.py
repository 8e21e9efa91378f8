"""The arm whose delay and lag were fitted to the published step times, and to nothing else.

``benchmarks/tracking/fit_model.py`` does it again (:mod:`yumi.evaluation.model_fit`).
"""

from __future__ import annotations

from yumi.virtual.arm_model import ArmModel

FITTED = ArmModel(delay=0.010, lag=0.0)
"""What fits best among the control lags that the EGM manual allows, 10 to 20 ms."""
