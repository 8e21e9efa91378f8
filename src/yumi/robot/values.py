"""The values that flow along the fast line: what an arm reports, what it is told, and where its tool is."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from yumi.robot.joints import Joints

ZERO: Joints = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

Vector = tuple[float, float, float]
"""x, y, z; [m] or [rad] as the name says."""

Quaternion = tuple[float, float, float, float]
"""A unit quaternion, w first."""


@dataclass(frozen=True, slots=True)
class Pose:
    """One frame seen from another, which the name of the value gives (``tool0_to_body``).

    Attributes:
        position: x, y, z [m].
        orientation: unit quaternion w, x, y, z.
    """

    position: Vector
    orientation: Quaternion


class ArmState(NamedTuple):
    """One arm as the robot reported it in one datagram; a tuple, since that is made fastest.

    Attributes:
        time: when the datagram arrived, on the machine's monotonic clock [s].
        dt: robot time since the state before, 0 for the first of a session [s].
        session: counts EGM sessions from 1; a change means that the robot started anew.
        position: measured joint positions, chain order [rad], (7,).
        velocity: measured joint velocities, chain order [rad/s], (7,).
        planned: joint positions the controller is heading for, chain order [rad], (7,).
        is_running: whether the robot follows our commands: motors on, RAPID running, EGM running.
    """

    time: float
    dt: float
    session: int
    position: Joints
    velocity: Joints
    planned: Joints
    is_running: bool


class ArmCommand(NamedTuple):
    """What an arm is told in one datagram; a tuple, since that is made fastest.

    Attributes:
        position: joint positions to reach, chain order [rad], (7,).
        velocity: joint velocities fed forward, chain order [rad/s], (7,).
    """

    position: Joints
    velocity: Joints = ZERO
