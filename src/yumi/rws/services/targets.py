"""Positions of a robot: ABB's millimetres and degrees as metres and radians."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians

from yumi.robot.joints import Pose
from yumi.rws.documents import State
from yumi.rws.replies import JointTarget

_NOT_CONNECTED = 8.9e9  # 9E9 marks an external axis that does not exist; it is printed in several roundings
_MM = 1e-3

Configuration = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True)
class RobTarget:
    """A position of the tool.

    Attributes:
        tool_to_object: of the tool in the work object, or as was asked for.
        configuration: quarter turns of axes 1, 4 and 6, and ABB's cfx.
        external: external axes [rad], None where there is no axis; of a YuMi's arm the first is the arm angle.
    """

    tool_to_object: Pose
    configuration: Configuration
    external: tuple[float | None, ...] = ()


def pose(state: State) -> Pose:
    """Out of ``x`` to ``q4``."""
    x, y, z = (state.number(name) * _MM for name in "xyz")
    w, i, j, k = (state.number(f"q{number}") for number in range(1, 5))
    return Pose((x, y, z), (w, i, j, k))


def rob_target(state: State) -> RobTarget:
    """A robtarget, as each of the services spells it."""
    names = ("cf1", "cf4", "cf6", "cfx") if "cf1" in state.fields else ("j1", "j4", "j6", "jx")
    one, four, six, x = (state.whole(name) for name in names)
    external = [name for name in state.fields if name.startswith(("eax", "ej"))]
    return RobTarget(pose(state), (one, four, six, x), axes(state, external))


def axes(state: State, names: Sequence[str]) -> tuple[float | None, ...]:
    """External axes [rad]."""
    found = [state.number(name) for name in names]
    return tuple(None if angle > _NOT_CONNECTED else radians(angle) for angle in found)


def joint_target(state: State, robot: str, external: Sequence[str]) -> JointTarget:
    """A jointtarget whose fields of the robot's axes begin with ``robot``."""
    a1, a2, a3, a4, a5, a6 = (state.number(f"{robot}{axis}") for axis in range(1, 7))
    found = [state.number(name) for name in external]
    return JointTarget((a1, a2, a3, a4, a5, a6), tuple(None if angle > _NOT_CONNECTED else angle for angle in found))
