"""Parameters of the trajectory controllers; names and defaults are upstream's (reference/ros2_control.md §3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import Joints, joints
from abb_runtime.parameters import Parameter, Value, Values, flag_setting, number, texts
from yumi.control.controller import check_controller_joints
from yumi.control.motion.robot_response import RESPONSE_DELAY
from yumi.control.trajectory_commands import Tolerances

_RAD, _RATE = "rad", "rad/s"


def trajectory_parameters(joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
    """What can be set on a trajectory controller of these joints; names and defaults are upstream's.

    Where upstream has no default the first value that it allows is the one.
    """
    both, values = ("position", "velocity"), "position, or position and velocity"
    common = (
        Parameter("joints", joint_names, description="The arm's joints, in any order.", read_only=True),
        *(
            Parameter(f"{word}_interfaces", both, choices=both, read_only=True, description=f"What is {use}: {values}.")
            for word, use in (("command", "claimed"), ("state", "read"))
        ),
        Parameter(
            "allow_partial_joints_goal",
            default=False,
            description="Whether a goal may leave out joints; they hold where they are commanded to be.",
        ),
        Parameter("interpolation_method", "splines", choices=("splines",), description="What is between two points."),
        Parameter(
            "positions_upsampling.enable",
            default=False,
            description="Whether points with positions alone are followed by a smooth spline, not on straight lines.",
        ),
        Parameter(
            "positions_upsampling.policy_frequency",
            30.0,
            0.1,
            1000.0,
            "Hz",
            "How many points a second such a trajectory has that gives no times.",
        ),
        Parameter("feedforward", 1.0, 0.0, 1.0, "", "Share of the planned speed that is sent beside the position."),
        Parameter(
            "lookahead",
            RESPONSE_DELAY,
            0.0,
            0.2,
            "s",
            "How much earlier than due the arm is commanded: the delay from a command to its effect.",
        ),
        Parameter("start_tolerance", 0.02, 1e-4, 0.5, _RAD, "A first point due at 0 s is at most so far from the arm."),
        Parameter("constraints.stopped_velocity_tolerance", 0.01, 0.0, 1.0, _RATE, "Speed at the goal; 0 is any."),
        Parameter("constraints.goal_time", 0.0, 0.0, 3600.0, "s", "The goal may be reached so late; 0 waits for ever."),
        Parameter(
            "speed_scaling.initial_scaling_factor", 1.0, 0.0, 1.0, "", "Share of the speed until commanded otherwise."
        ),
        Parameter("action_monitor_rate", 20.0, 1.0, 100.0, "Hz", "How often the action gives feedback."),
        Parameter("state_publish_rate", 50.0, 1.0, 100.0, "Hz", "How often controller_state is published."),
    )
    own = []
    for name in joint_names:
        constraints = f"constraints.{name}"
        own += [
            Parameter(f"{constraints}.trajectory", 0.0, 0.0, 6.3, _RAD, "Distance on the way that ends it; 0 is any."),
            Parameter(f"{constraints}.goal", 0.0, 0.0, 6.3, _RAD, "Distance at which the goal is reached; 0 is any."),
            Parameter(
                f"{constraints}.max_deceleration_on_cancel", 0.0, 0.0, 40.0, "rad/s²", "0 is the joint's own limit."
            ),
        ]
    fixed = [Parameter(name, default, fixed=reason) for name, default, reason in _FIXED]
    return (*common, *own, *fixed, Parameter("command_joints", joint_names, fixed="commands go to the joints"))


_SCALED = "every trajectory follows the robot's speed_scale without an interface"
_CONTINUES = "a motion always continues from the last command"
_FIXED: tuple[tuple[str, Value, str], ...] = (
    ("gains", (), "gains are for velocity or effort commands; this arm is commanded by position"),
    ("interface_name", (), "a trajectory controller has command_interfaces"),
    ("open_loop_control", True, _CONTINUES),
    ("interpolate_from_desired_state", True, _CONTINUES),
    (
        "set_last_command_interface_value_as_state_on_activation",
        True,
        "after activation the arm holds where the robot plans to be",
    ),
    ("allow_integration_in_goal_trajectories", False, "points without positions are refused; give positions"),
    (
        "allow_nonzero_velocity_at_trajectory_end",
        False,
        "a trajectory ends at rest; a last point with a velocity is refused",
    ),
    ("cmd_timeout", 0.0, "the arm holds at the end of every trajectory"),
    ("constraints.decelerate_on_cancel", True, "a cancelled arm always brakes within its limits"),
    ("speed_scaling.state_interface", "", _SCALED),
    ("speed_scaling.command_interface", "", _SCALED),
    ("speed_scaling_interface_name", "", _SCALED),
)
"""Upstream's parameters, and those of drivers that build on it, which change nothing here: each with why."""


@dataclass(frozen=True, slots=True)
class TrajectorySettings:
    """The parameters' values as the controller uses them.

    Attributes:
        feedforward: share of the planned speed that is sent beside the position.
        lookahead: how much earlier than due the arm is commanded [s].
        start_tolerance: how far from the arm a trajectory may begin without time to go there [rad].
        scale: share of the speed until commanded otherwise.
        feedback_period: time between two messages of the controller's state [s].
        monitor_period: time between two feedbacks of the action [s].
        is_partial_allowed: whether a goal may leave out joints.
        claimed: ``position``, and ``velocity`` where it is claimed, too.
        read: the same of what is measured.
        tolerances: applied where a command names none.
        deceleration: what a cancelled motion brakes with [rad/s²], (7,).
    """

    feedforward: float
    lookahead: float
    start_tolerance: float
    scale: float
    feedback_period: float
    monitor_period: float
    is_partial_allowed: bool
    claimed: tuple[str, ...]
    read: tuple[str, ...]
    tolerances: Tolerances
    deceleration: Joints

    @staticmethod
    def of(values: Values, joint_names: Sequence[str], strongest: Joints) -> TrajectorySettings:
        """From complete parameter ``values``; ``strongest`` decelerations are the joints' own [rad/s²], (7,).

        Raises:
            CommandRefused: the joints are not the arm's, or interfaces do not go together.
        """
        check_controller_joints(values, joint_names, in_order=False)
        for name in ("command_interfaces", "state_interfaces"):
            given = texts(values, name)
            if given not in (("position",), ("position", "velocity")):
                raise CommandRefused(message("parameter_interfaces_unknown", parameter=name, given=", ".join(given)))
        stopped = _or_any(number(values, "constraints.stopped_velocity_tolerance"))
        own = [number(values, f"constraints.{name}.max_deceleration_on_cancel") for name in joint_names]
        return TrajectorySettings(
            feedforward=number(values, "feedforward"),
            lookahead=number(values, "lookahead"),
            start_tolerance=number(values, "start_tolerance"),
            scale=number(values, "speed_scaling.initial_scaling_factor"),
            feedback_period=1.0 / number(values, "state_publish_rate"),
            monitor_period=1.0 / number(values, "action_monitor_rate"),
            is_partial_allowed=flag_setting(values, "allow_partial_joints_goal"),
            claimed=texts(values, "command_interfaces"),
            read=texts(values, "state_interfaces"),
            tolerances=Tolerances(
                path=joints([_or_any(number(values, f"constraints.{name}.trajectory")) for name in joint_names]),
                path_velocity=joints([inf] * len(joint_names)),
                goal=joints([_or_any(number(values, f"constraints.{name}.goal")) for name in joint_names]),
                goal_velocity=joints([stopped] * len(joint_names)),
                goal_time=_or_any(number(values, "constraints.goal_time")),
            ),
            deceleration=joints([min(mine or most, most) for mine, most in zip(own, strongest, strict=True)]),
        )


def _or_any(tolerance: float) -> float:
    return tolerance or inf
