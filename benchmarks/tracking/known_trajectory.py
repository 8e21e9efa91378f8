"""Prints how closely the virtual arm follows a sine of 0.2 Hz on axis 6 as a trajectory.

In virtual time, with the virtual robot's default dynamics and the full-speed settings; without feed-forward for
comparison, and for delays other than the robot's own::

    python benchmarks/tracking/known_trajectory.py
"""

from __future__ import annotations

from math import radians

from tracking_runs import follow_sine

from abb_runtime.parameters import Values
from yumi.control.motion.robot_response import RESPONSE_DELAY
from yumi_evaluation.virtual_time import PlannedSine

CASES: tuple[tuple[str, Values], ...] = (
    ("feed-forward and look-ahead", {}),
    ("sent 4 ms too late", {"lookahead": RESPONSE_DELAY - 0.004}),
    ("sent 4 ms too early", {"lookahead": RESPONSE_DELAY + 0.004}),
    ("feed-forward alone", {"lookahead": 0.0}),
    ("look-ahead alone", {"feedforward": 0.0}),
    ("neither", {"feedforward": 0.0, "lookahead": 0.0}),
)


def main() -> None:
    print(f"{'':30}{'amplitude':>10}{'max. error':>12}{'mean lag':>12}{'slowed':>8}")
    for name, parameters in CASES:
        for amplitude in (10.0, 60.0):
            figures = follow_sine(PlannedSine(radians(amplitude)), parameters)
            print(
                f"{name:30}{amplitude:>8.0f} °{figures.max_error_deg:>10.4f} °{figures.mean_lag * 1e3:>9.2f} ms"
                f"{figures.slowed:>8}"
            )


if __name__ == "__main__":
    main()
