"""Experiments in virtual time: a virtual arm, the wire's codecs, our fast line with its controllers; always the same.

Bare, nothing but the gain's range and the guard's limits differ from what is shipped: a gain may be as high as one
likes, and the guard lets every step pass, as the publication's system did.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import radians

from yumi.control.goals import put_goal
from yumi.control.guard import Guard
from yumi.control.mailbox import MemoryMailbox
from yumi.control.parameter import Parameter
from yumi.controllers.joint_position import JointPositionController
from yumi.evaluation.experiment import GOAL_RATE, Experiment, Mode, System, Trace
from yumi.evaluation.fitted_model import FITTED
from yumi.evaluation.guided_arm import GuidedArm
from yumi.evaluation.known_trajectory import Sine as PlannedSine
from yumi.evaluation.known_trajectory import follow_planned
from yumi.evaluation.streamed_reference import CONTROLLER, Sine
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import JOINT_COUNT, Joints, joints
from yumi.robot.limits import YUMI_LIMITS, JointLimits
from yumi.virtual.arm_model import ArmModel

HIGHEST_GAIN = 10.0
"""To which a sweep may go; what is shipped refuses more than 2."""

_REST = 0.2  # [s] until the robot has taken over
_NO_LIMIT = joints([1e9] * JOINT_COUNT)


class AnyGainController(JointPositionController):
    """The joint position controller for which no gain is too high: to find where oscillation begins."""

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        own = super().parameters(joint_names)
        return tuple(replace(each, highest=HIGHEST_GAIN) if each.name == "p" else each for each in own)


def run_virtually(experiment: Experiment, system: System = System.SHIPPED, model: ArmModel | None = None) -> Trace:
    """Run ``experiment`` in virtual time.

    Args:
        experiment: what is asked.
        system: with our guard, or without, as published.
        model: of the arm; what is shipped, or when bare the fitted one, if left out.
    """
    if experiment.law.is_planned:
        return _run_planned(experiment)
    model = model or (FITTED if system is System.BARE else ArmModel())
    goals, limits = MemoryMailbox(), _limits(experiment.mode)
    guard = Guard(limits if system is System.SHIPPED else _unlimited(limits))
    controller = AnyGainController(goals, limits)
    arm = GuidedArm({CONTROLLER: controller}, side=experiment.side, guard=guard, model=model)
    arm.manager.set_parameters(CONTROLLER, experiment.law.values)
    arm.start(experiment.mode.value)
    arm.run(_REST)
    arm.switch_to(CONTROLLER)
    return _follow(experiment, arm, goals)


def goal_times(experiment: Experiment) -> Iterator[float]:
    """When goals are sent, from the beginning [s]: once for a step, at 500 Hz for a sine."""
    count = 1 if experiment.is_step else int(experiment.duration * GOAL_RATE)
    return iter([number / GOAL_RATE for number in range(count)])


def planned_sine(sine: Sine) -> PlannedSine:
    """The same as a trajectory: it begins, and ends, where it turns."""
    return PlannedSine(sine.amplitude, sine.frequency, periods=1)


def planned_goals(sine: PlannedSine) -> list[tuple[float, float]]:
    """Where the joint shall be, at the rate of goals that are streamed: time [s], angle [rad]."""
    times = [number / GOAL_RATE for number in range(int(sine.duration * GOAL_RATE))]
    return [(time, sine.at(time)[0]) for time in times]


def moved(start: Joints, way: float, which: tuple[int, ...]) -> Joints:
    """``start`` with the joints ``which`` moved by ``way`` [rad]."""
    return joints([value + way * (index in which) for index, value in enumerate(start)])


def _follow(experiment: Experiment, arm: GuidedArm, goals: MemoryMailbox) -> Trace:
    reference, which = experiment.reference, experiment.moved
    start, begin, slowed, first = arm.robot.arm.planned, arm.clock.now(), arm.snapshot.slowed, len(arm.cycles)
    times, session = list(goal_times(experiment)), arm.snapshot.session
    coming = iter([*times, float("inf")])
    due = next(coming)
    while arm.clock.now() - begin < experiment.duration:
        # What is sent before a datagram arrives is there when it is answered.
        while begin + due <= arm.clock.now() + CYCLE:
            put_goal(goals, session, moved(start, reference(due), which), time=begin + due)
            due = next(coming)
        arm.cycle()
    states = [cycle.state for cycle in arm.cycles[first:]]
    measured = {
        joint: [(state.time - begin, state.position[joint] - start[joint]) for state in states] for joint in which
    }
    return Trace(experiment, [(time, reference(time)) for time in times], measured, arm.snapshot.slowed - slowed)


def _run_planned(experiment: Experiment) -> Trace:
    """A trajectory: the sine begins where it turns, since a planned motion begins at rest."""
    reference, (joint, *_) = experiment.reference, experiment.moved
    assert isinstance(reference, Sine), "trajectories are measured with sines"
    sine = planned_sine(reference)
    way = follow_planned(sine, side=experiment.side, joint=joint)
    return Trace(experiment, planned_goals(sine), {joint: way.measured}, way.slowed)


def _limits(mode: Mode) -> JointLimits:
    return YUMI_LIMITS.slowed_to(radians(mode.value.max_speed_deviation))


def _unlimited(limits: JointLimits) -> JointLimits:
    """Only the ranges remain."""
    return replace(limits, velocity=_NO_LIMIT, acceleration=_NO_LIMIT, jerk=_NO_LIMIT)
