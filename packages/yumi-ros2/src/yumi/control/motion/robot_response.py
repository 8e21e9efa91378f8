"""The response of a robot to commands: the gain of its position loop, its delays, and when it stands."""

from __future__ import annotations

from abb_protocols.robot.joints import CYCLE

EGM_GAIN = 5.0
"""Gain of the robot's own position loop, at which a command's lead becomes speed [1/s] (reference/egm.md §6.1)."""

SERVO_CYCLES = 4
"""So many cycles after its plan a robot reports to be where it planned, behind which its position loop is closed:
transport delay and lag of the servo, as measured on an IRB 6640 (docs/explanation/virtual-robot.md)."""


def plan_gain(gain: float) -> float:
    """The gain at which a robot's plan closes its lead on a command [1/s], where that of its position loop is ``gain``.

    The loop is closed over what the robot reports, which is behind the plan by its speed times the servo's delay.
    """
    return gain / (1.0 - gain * SERVO_CYCLES * CYCLE)


RESPONSE_DELAY = 0.0262
"""From a command to the motion that the virtual robot reports, at full-speed settings [s]: a cycle until the reply is
taken, a cycle in the robot, half of the cycle for which it counts, and the servo's cycles; ``yumi_evaluation.metrics``
finds it in recorded cycles."""

STANDING = 0.05
"""An arm whose joints all move slower than this stands [rad/s]; measured positions jitter."""
