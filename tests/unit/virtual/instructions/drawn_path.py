"""What an arm has drawn: the tool's way from its planned joint positions, by Denavit and Hartenberg's parameters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from instruction_bench import InstructionBench
from numpy.typing import NDArray

from abb_protocols.robot.joints import CYCLE, Joints, Side

Array = NDArray[np.float64]

# Craig's parameters, from the foot to tool0 (reference/yumi.md §1.4): alpha [deg], a [mm], d [mm], offset [deg].
YUMI = (
    (0.0, 0.0, 166.0, 0.0),
    (-90.0, -30.0, 0.0, 0.0),
    (90.0, 30.0, 251.5, 0.0),
    (-90.0, 40.5, 0.0, 90.0),
    (90.0, -40.5, 265.0, 0.0),
    (-90.0, 27.0, 0.0, 0.0),
    (90.0, -27.0, 36.0, 0.0),
)
_FOOT = ((0.629233, 0.950657, 0.184266), 384.0, 50.0)  # angles of the right one about x, y, z [rad]; heights [mm]


def turn(axis: int, angle: Array) -> Array:
    """Rotations about x, y or z, as frames (n, 4, 4)."""
    frames = np.zeros((len(angle), 4, 4))
    second, third = (axis + 1) % 3, (axis + 2) % 3
    frames[:, 3, 3] = frames[:, axis, axis] = 1.0
    frames[:, second, second] = frames[:, third, third] = np.cos(angle)
    frames[:, third, second] = np.sin(angle)
    frames[:, second, third] = -np.sin(angle)
    return frames


def shift(x: float, y: float, z: float) -> Array:
    frame = np.eye(4)
    frame[:3, 3] = (x, y, z)
    return frame


def foot(side: Side) -> Array:
    """The foot of an arm in the robot's base, (4, 4)."""
    (alpha, beta, gamma), height, beside = _FOOT
    sign = 1.0 if side is Side.RIGHT else -1.0
    turned = np.eye(4)
    for axis, angle in enumerate((sign * alpha, beta, sign * gamma)):
        turned = turned @ turn(axis, np.array([angle]))[0]
    return shift(0.0, -sign * beside, height) @ turned


def tool_frames(base: Array, parameters: Sequence[Sequence[float]], joints: Array, tool_mm: Sequence[float]) -> Array:
    """The tool in the base, (n, 4, 4) [mm], of joint positions [rad], (n, k)."""
    frames = np.repeat(base[None], len(joints), 0)
    for (alpha, a, d, offset), angles in zip(parameters, joints.T, strict=True):
        frames = frames @ turn(0, np.radians([alpha])) @ shift(a, 0.0, 0.0)
        frames = frames @ turn(2, angles + np.radians(offset)) @ shift(0.0, 0.0, d)
    return frames @ shift(*tool_mm)


class Drawing:
    """The planned path of a program, cycle by cycle.

    Attributes:
        frames: of the tool in the base, (n, 4, 4) [mm].
    """

    def __init__(
        self,
        body: str,
        tool_mm: tuple[float, float, float] = (0.0, 0.0, 0.0),
        bench: InstructionBench | None = None,
        limit: float = 60.0,
    ) -> None:
        self.bench = bench or InstructionBench()
        self.bench.start(body)
        joints: list[Joints] = [self.bench.unit.arm.planned]
        while self.bench.task.is_running and self.bench.task.now < limit:
            self.bench.step()
            joints.append(self.bench.unit.arm.planned)
        assert not self.bench.task.is_running, f"still running after {limit} s"
        moved = [at for at, before in zip(joints[1:], joints, strict=False) if at != before]
        self.joints = [joints[0], *moved]
        self.frames = tool_frames(foot(self.bench.unit.side), YUMI, np.array(self.joints), tool_mm)

    @property
    def points(self) -> Array:
        """Of the tool [mm], (n, 3)."""
        points: Array = self.frames[:, :3, 3]
        return points

    @property
    def speeds(self) -> Array:
        """Of the tool's point from cycle to cycle [mm/s], (n-1,)."""
        speeds: Array = np.linalg.norm(np.diff(self.points, axis=0), axis=1) / CYCLE
        return speeds

    def distance_to(self, point: Array) -> float:
        """How near the tool came to a point [mm]."""
        return float(np.min(np.linalg.norm(self.points - point, axis=1)))


def at(x: float, y: float, z: float) -> Array:
    """A point or offset [mm], (3,)."""
    return np.array([x, y, z], dtype=float)


def from_line(points: Array, start: Array, end: Array) -> Array:
    """Distances of points from a straight line [mm], (n,)."""
    along = (end - start) / np.linalg.norm(end - start)
    offset = points - start
    distances: Array = np.linalg.norm(offset - np.outer(offset @ along, along), axis=1)
    return distances
