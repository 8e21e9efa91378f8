"""The parameters of a trajectory controller: upstream's names, and what lets an arm follow without lag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from yumi.control.parameter import Parameter, Values, number
from yumi.controllers.trajectory_orders import DEFAULT, UNLIMITED, Tolerances
from yumi.robot.joints import Joints, joints

LOOKAHEAD = 0.032
"""What lies between a command and the measured position that shows it: transport and servo of the virtual arm [s]."""

_RAD, _RATE = "rad", "rad/s"


def trajectory_parameters(joint_names: Sequence[str]) -> tuple[Parameter, ...]:
    """What can be set on a trajectory controller of these joints."""
    common = (
        Parameter("feedforward", 1.0, 0.0, 1.0, "", "Share of the planned speed that is sent beside the position."),
        Parameter(
            "lookahead",
            LOOKAHEAD,
            0.0,
            0.2,
            "s",
            "How much earlier than due the arm is told: the delay from a command to its effect.",
        ),
        Parameter("start_tolerance", 0.02, 1e-4, 0.5, _RAD, "A first point due at 0 s is at most so far from the arm."),
        Parameter("constraints.stopped_velocity_tolerance", 0.01, 0.0, 1.0, _RATE, "Speed at the goal; 0 is any."),
        Parameter("constraints.goal_time", 0.0, 0.0, 3600.0, "s", "The goal may be reached so late; 0 waits for ever."),
        Parameter(
            "speed_scaling.initial_scaling_factor", 1.0, 0.0, 1.0, "", "Share of the speed until told otherwise."
        ),
        Parameter("action_monitor_rate", 20.0, 1.0, 250.0, "Hz", "How often feedback is given."),
    )
    return (*common, *(each for name in joint_names for each in _parameters_of(name)))


def _parameters_of(joint: str) -> tuple[Parameter, ...]:
    return (
        Parameter(
            f"constraints.{joint}.trajectory", 0.0, 0.0, 6.3, _RAD, "Distance on the way that ends it; 0 is any."
        ),
        Parameter(f"constraints.{joint}.goal", 0.0, 0.0, 6.3, _RAD, "Distance at which the goal is reached; 0 is any."),
        Parameter(
            f"constraints.{joint}.max_deceleration_on_cancel", 0.0, 0.0, 40.0, "rad/s²", "0 is the joint's own limit."
        ),
    )


@dataclass(frozen=True, slots=True)
class Bounds:
    """Tolerances as they are applied: infinity where there is none.

    Attributes:
        path: on the way [rad], (7,).
        path_velocity: on the way [rad/s], (7,).
        goal: at the end [rad], (7,).
        goal_velocity: at the end [rad/s], (7,).
        goal_time: how much later than planned the goal may be reached [s].
    """

    path: Joints
    path_velocity: Joints
    goal: Joints
    goal_velocity: Joints
    goal_time: float


@dataclass(frozen=True, slots=True)
class TrajectorySettings:
    """The parameters' values as the controller uses them.

    Attributes:
        feedforward: share of the planned speed that is sent beside the position.
        lookahead: how much earlier than due the arm is told [s].
        start_tolerance: how far from the arm a trajectory may begin without time to go there [rad].
        scale: share of the speed until told otherwise.
        feedback_period: time between two feedbacks [s].
        bounds: tolerances where an order names none.
        deceleration: what a cancelled motion brakes with [rad/s²], (7,).
    """

    feedforward: float
    lookahead: float
    start_tolerance: float
    scale: float
    feedback_period: float
    bounds: Bounds
    deceleration: Joints

    @staticmethod
    def of(values: Values, joint_names: Sequence[str], strongest: Joints) -> TrajectorySettings:
        """From complete parameter ``values``; ``strongest`` decelerations are the joints' own [rad/s²], (7,)."""
        stopped = _or_any(number(values, "constraints.stopped_velocity_tolerance"))
        own = [number(values, f"constraints.{name}.max_deceleration_on_cancel") for name in joint_names]
        return TrajectorySettings(
            feedforward=number(values, "feedforward"),
            lookahead=number(values, "lookahead"),
            start_tolerance=number(values, "start_tolerance"),
            scale=number(values, "speed_scaling.initial_scaling_factor"),
            feedback_period=1.0 / number(values, "action_monitor_rate"),
            bounds=Bounds(
                path=joints([_or_any(number(values, f"constraints.{name}.trajectory")) for name in joint_names]),
                path_velocity=joints([inf] * len(joint_names)),
                goal=joints([_or_any(number(values, f"constraints.{name}.goal")) for name in joint_names]),
                goal_velocity=joints([stopped] * len(joint_names)),
                goal_time=_or_any(number(values, "constraints.goal_time")),
            ),
            deceleration=joints([min(mine or most, most) for mine, most in zip(own, strongest, strict=True)]),
        )

    def bounds_with(self, wanted: Tolerances) -> Bounds:
        """The tolerances an order wants, and the controller's own for the others."""
        own = self.bounds
        return Bounds(
            path=_chosen(wanted.path, own.path),
            path_velocity=_chosen(wanted.path_velocity, own.path_velocity),
            goal=_chosen(wanted.goal, own.goal),
            goal_velocity=_chosen(wanted.goal_velocity, own.goal_velocity),
            goal_time=_choice(wanted.goal_time, own.goal_time),
        )


def _or_any(tolerance: float) -> float:
    return tolerance or inf


def _chosen(wanted: Joints, own: Joints) -> Joints:
    return joints([_choice(*pair) for pair in zip(wanted, own, strict=True)])


def _choice(wanted: float, own: float) -> float:
    if wanted == DEFAULT:
        return own
    return inf if wanted == UNLIMITED else wanted
