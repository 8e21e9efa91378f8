"""What a linear loop makes of any reference, from what it makes of a step.

Without a guard nothing between goal and joint is limited, so that the law of superposition holds: a reference that
changes with every cycle is a sum of steps. Many sines cost less so than one that is run; that they are the same is
checked against one that is.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import floor
from operator import mul

from yumi.evaluation.experiment import GOAL_RATE, Experiment, Trace
from yumi.evaluation.metrics import Series
from yumi.robot.cycle import CYCLE

_SETTLED = 1e-4  # share of a step that is left
_SAME = 1e-9  # [s]


def superpose(step: Trace, experiment: Experiment) -> Trace:
    """What the loop that did ``step`` makes of the reference of ``experiment``, with goals at the usual rate."""
    joint, count = experiment.moved[0], int(experiment.duration / CYCLE)
    response = _response(step)
    taken = [experiment.reference(_newest(number)) for number in range(count)]
    angles = _follow(taken, response)
    measured = [(CYCLE * (number + 1), angle) for number, angle in enumerate(angles)]
    times = [number / GOAL_RATE for number in range(int(experiment.duration * GOAL_RATE))]
    return Trace(experiment, [(time, experiment.reference(time)) for time in times], {joint: measured})


def largest_difference(one: Series, other: Series) -> float:
    """Between the values of two series of the same samples, in their unit."""
    return max(abs(mine - theirs) for (_, mine), (_, theirs) in zip(one, other, strict=False))


def _newest(cycle: int) -> float:
    """When the goal was sent that is the newest one in a cycle [s]."""
    return floor((cycle + 1) * CYCLE * GOAL_RATE + _SAME) / GOAL_RATE


def _response(step: Trace) -> list[float]:
    """Share of the step that is done, cycle by cycle, until as good as nothing is left."""
    values = [value / step.sent[0][1] for _, value in step.measured[step.experiment.moved[0]]]
    left = [index for index, value in enumerate(values) if abs(value - 1.0) > _SETTLED]
    return values[: left[-1] + 2]


def _follow(taken: Sequence[float], response: Sequence[float]) -> list[float]:
    """The sum of all steps so far; those longer ago than the response are done."""
    changes = [new - old for old, new in zip((0.0, *taken), taken, strict=False)]
    angles = []
    for index in range(len(taken)):
        begin = max(0, index + 1 - len(response))
        done = taken[begin - 1] if begin else 0.0
        angles.append(done + sum(map(mul, changes[begin : index + 1], response[index - begin :: -1])))
    return angles
