"""Experiments over ROS 2 and the wire, with a driver that is up."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from itertools import pairwise

from yumi.control.parameter import Values
from yumi.controllers.joint_position import DELAY
from yumi.errors import RobotNotReady
from yumi.evaluation.experiment import Experiment, Trace, proportional
from yumi.evaluation.streamed_reference import Sine
from yumi.evaluation.virtual_experiment import goal_times, moved, planned_goals, planned_sine
from yumi.robot.joints import Joints
from yumi.ros.evaluation_node import POSITION_CONTROLLER, TRAJECTORY_CONTROLLER, EvaluationNode, HeardJointState

USUAL: Values = {"tracking.feed_forward": False, "tracking.delay": DELAY, **proportional(1.2).values}
"""The joint position controller as it is delivered."""

_BACK = 2e-4  # [rad] from where an arm is taken to be back
_STILL = 0.2  # [s]
_REST = 2.0  # [s] before each experiment, as in the publication's program: nothing is left of the way back then
_RETURN = 15.0  # [s] at most, at reduced speed
_ATTEMPTS = 4
_LONGEST_GAP = 0.06  # [s] longer, and what was measured is about the machine
_NOTICE = 0.3  # [s] between sending a trajectory and its beginning


def run_undisturbed(
    node: EvaluationNode, experiment: Experiment, on_repeat: Callable[[str], None] = lambda why: None
) -> Trace:
    """Again, from the same place, when the machine was too busy to keep EGM alive: that says nothing of control.

    Args:
        node: the application.
        experiment: what is asked.
        on_repeat: told why, each time a run is thrown away and made again.

    Raises:
        RobotNotReady: the last attempt failed, too.
    """
    node.start_egm()
    start = node.position()
    for _ in range(_ATTEMPTS - 1):
        try:
            return run_on_wire(node, experiment)
        except RobotNotReady as error:
            on_repeat(str(error))
        node.start_egm()
        with suppress(RobotNotReady):
            _bring_back(node, start)
    return run_on_wire(node, experiment)


def run_on_wire(node: EvaluationNode, experiment: Experiment) -> Trace:
    """Run ``experiment`` with a driver that is up, in an EGM session of its own, and bring the arm back.

    The robot takes one reply a cycle from its queue: a reply that once came too late to its cycle leaves all commands
    after it a cycle late, until the session ends (reference/egm.md §4.3).

    Raises:
        RobotNotReady: the driver refused something, no state came for too long, or the arm did not come back.
    """
    node.stop_egm()
    node.start_egm()
    if experiment.law.is_planned:
        return _run_planned(node, experiment)
    node.set_law({**USUAL, **experiment.law.values})
    node.spin_until(time.monotonic() + _REST)
    start = standing(node)
    reference, which = experiment.reference, experiment.moved
    due = list(goal_times(experiment))
    node.states.clear()
    sent = node.stream(lambda moment: moved(start, reference(moment if len(due) > 1 else 0.0), which), due)
    begin = sent[0][0]
    node.spin_until(begin + experiment.duration)
    states = [state for state in node.states if 0.0 <= state.stamp - begin < experiment.duration]
    measured = {
        joint: [(each.stamp - begin, each.position[joint] - start[joint]) for each in states] for joint in which
    }
    _check_gaps(experiment.duration, states)
    _bring_back(node, start)
    joint = which[0]
    return Trace(experiment, [(moment - begin, goal[joint] - start[joint]) for moment, goal in sent], measured)


def _run_planned(node: EvaluationNode, experiment: Experiment) -> Trace:
    """A trajectory that ends where it began; nothing has to be brought back."""
    reference, (joint, *_) = experiment.reference, experiment.moved
    assert isinstance(reference, Sine), "trajectories are measured with sines"
    sine = planned_sine(reference)
    node.switch(TRAJECTORY_CONTROLLER, POSITION_CONTROLLER)
    try:
        start = standing(node)
        node.states.clear()
        begin = time.monotonic() + _NOTICE
        node.send_trajectory(sine.points(start, joint), begin)
        node.spin_until(begin + sine.duration)
    finally:
        node.switch(POSITION_CONTROLLER, TRAJECTORY_CONTROLLER)
    states = [state for state in node.states if 0.0 <= state.stamp - begin < sine.duration]
    _check_gaps(sine.duration, states)
    measured = [(each.stamp - begin, each.position[joint] - start[joint]) for each in states]
    return Trace(experiment, planned_goals(sine), {joint: measured})


def _check_gaps(duration: float, states: Sequence[HeardJointState]) -> None:
    times = [0.0, *(state.stamp - states[0].stamp for state in states), duration]
    gap = max(new - old for old, new in pairwise(times))
    if gap > _LONGEST_GAP:
        raise RobotNotReady(
            f"No joint state came for {1e3 * gap:.0f} ms: the machine is too busy, or the robot was lost; "
            "try again when it is idle."
        )


def standing(node: EvaluationNode) -> Joints:
    """Where the arm stands, once it does."""
    position = node.position()
    while True:
        node.spin_until(time.monotonic() + _STILL)
        last, position = position, node.position()
        if max(abs(now - before) for now, before in zip(position, last, strict=True)) < _BACK:
            return position


def _bring_back(node: EvaluationNode, start: Joints) -> None:
    node.set_law(USUAL)
    node.send(start)

    def is_back() -> bool:
        now = node.states[-1].position if node.states else None
        return now is not None and max(abs(a - b) for a, b in zip(now, start, strict=True)) < 5.0 * _BACK

    node.until(is_back, "coming back to the start", _RETURN)
