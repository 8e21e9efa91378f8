"""Programs in the style of others (``motion_programs/``), each with what its path has to be, in its first lines.

Lengths in mm, speeds in mm/s, places of the tool in the robot's base; ``through`` within 0.1 mm, ``speed`` within 2 %.
A signal ``rises`` or ``falls`` where the tool is, and ``enters`` or ``leaves`` a zone where the tool is planned to be.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import radians
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from abb_protocols.robot.joints import Side
from virtual_irc5.controller.installed_system import ROBOTS, delivered_system, factory_system, with_programs
from virtual_irc5.world import World, WorldSettings

Array = NDArray[np.float64]
PROGRAMS = sorted((Path(__file__).parent / "motion_programs").glob("*.mod"))
SIGNAL_WORDS = {"rises": (1.0, 0), "falls": (0.0, 0), "enters": (1.0, 1), "leaves": (0.0, 1)}

# Denavit and Hartenberg's parameters (theta offset [deg], d [mm], a [mm], alpha [deg]) of an IRB 120, and Craig's
# (alpha [deg], a [mm], d [mm], theta offset [deg]) of a YuMi's arm; where their feet stand.
IRB120 = ((0, 290, 0, -90), (-90, 0, 270, 0), (0, 0, 70, -90), (0, 302, 0, 90), (0, 0, 0, -90), (180, 72, 0, 0))
YUMI = (
    (0, 0, 166, 0),
    (-90, -30, 0, 0),
    (90, 30, 251.5, 0),
    (-90, 40.5, 0, 90),
    (90, -40.5, 265, 0),
    (-90, 27, 0, 0),
    (90, -27, 36, 0),
)


def turned(axis: int, angle: float | Array) -> Array:
    """By each of some angles (n,), (n, 4, 4), or by one."""
    frame = np.tile(np.eye(4), (*np.shape(angle), 1, 1))
    second, third = (axis + 1) % 3, (axis + 2) % 3
    frame[..., second, second] = frame[..., third, third] = np.cos(angle)
    frame[..., third, second], frame[..., second, third] = np.sin(angle), -np.sin(angle)
    return frame


def moved(x: float, y: float, z: float) -> Array:
    frame = np.eye(4)
    frame[:3, 3] = (x, y, z)
    return frame


def flange(robot: str, joints: Array) -> Array:
    """tool0 in the base, (n, 4, 4) [mm], of each of some positions (n, k) [rad]."""
    frame = np.eye(4)
    if robot == "irb120":
        for angle, (offset, d, a, alpha) in zip(joints.T, IRB120, strict=True):
            frame = frame @ turned(2, angle + radians(offset)) @ moved(a, 0, d) @ turned(0, radians(alpha))
        return frame
    if robot == "yumi":  # the right arm's foot (reference/yumi.md §1.5)
        frame = moved(0, -50, 384) @ turned(0, 0.629233) @ turned(1, 0.950657) @ turned(2, 0.184266)
    for angle, (alpha, a, d, offset) in zip(joints.T, YUMI, strict=True):
        frame = frame @ turned(0, radians(alpha)) @ moved(a, 0, 0)
        frame = frame @ turned(2, angle + radians(offset)) @ moved(0, 0, d)
    return frame


class Expectations:
    """The lines ``!@ word arguments`` of a program."""

    def __init__(self, path: Path) -> None:
        lines = path.read_text(encoding="ascii").splitlines()
        self._lines = [line[3:].rstrip().split(maxsplit=1) for line in lines if line.startswith("!@ ")]

    def of(self, word: str) -> Iterator[str]:
        return (rest for each, rest in self._lines if each == word)

    def numbers(self, word: str) -> Iterator[list[float]]:
        return ([float(value) for value in rest.split() if not value[0].isalpha()] for rest in self.of(word))


class Performance:
    """One run of a program.

    Attributes:
        points: of the tool, cycle by cycle [mm], (n, 3).
        joints: planned positions [rad].
        changes: by signal, its new values with where the tool was then, and was planned to be.
    """

    def __init__(self, path: Path, expected: Expectations) -> None:
        robot = next(expected.of("robot"))
        tool = next(expected.numbers("tool"), [0.0, 0.0, 0.0])
        task = "T_ROB_R" if robot == "yumi" else "T_ROB1"
        system = delivered_system() if robot == "yumi" else factory_system(ROBOTS[robot])
        self.world = World(WorldSettings(system=with_programs(system, {task: [path]})))
        self.task = self.world.controller.tasks[task]
        self.module = self.task.modules[-1].name
        self._robot, self._tool = robot, np.array([*tool, 1.0])
        controller, touch = self.world.controller, next(expected.numbers("touch"), [np.inf])[0]
        controller.set_motors(on=True)
        controller.start_rapid("once")
        watched = [name.split()[0] for word in SIGNAL_WORDS for name in expected.of(word)]
        levels = dict.fromkeys(watched, 0.0)
        self.changes: dict[tuple[str, float], tuple[Array, Array]] = {}
        self.joints: list[tuple[float, ...]] = []
        while self.task.is_running:
            self.world.cycle({})
            self.joints.append(self.world.arms[Side.RIGHT].planned)
            if controller.time >= touch:
                controller.signals.drive("custom_DI_0", 1.0)
            for name in levels:
                value = controller.signals.get(name).value
                if value != levels[name]:
                    levels[name] = value
                    is_at, is_planned = self.places([self.world.arms[Side.RIGHT].position, self.joints[-1]])
                    self.changes[name, value] = is_at, is_planned
            assert controller.time < 60.0, "still running after a minute"
        self.points = self.places(self.joints)

    def places(self, joints: list[tuple[float, ...]]) -> Array:
        """Of the tool in each of some positions, (n, 3) [mm]."""
        places: Array = (flange(self._robot, np.array(joints)) @ self._tool)[:, :3]
        return places

    def nearest(self, point: list[float]) -> float:
        return float(np.min(np.linalg.norm(self.points - point, axis=1)))


@pytest.fixture(params=PROGRAMS, ids=lambda path: path.stem)
def program(request: pytest.FixtureRequest) -> Path:
    path: Path = request.param
    return path


def test_there_are_twenty_programs() -> None:
    assert len(PROGRAMS) >= 20


def test_program_moves_the_robot_as_it_says(program: Path) -> None:
    expected = Expectations(program)
    run = Performance(program, expected)
    codes = [event.code for event in run.world.controller.events.entries()]
    wanted = [int(code) for code in expected.of("event")]
    assert [code for code in wanted if code not in codes] == []
    assert wanted or 40228 not in codes
    for point in expected.numbers("through"):
        assert run.nearest(point) < 0.1, f"not through {point}"
    for (fastest,) in expected.numbers("speed"):
        speeds = np.linalg.norm(np.diff(run.points, axis=0), axis=1) / run.world.cycle_time
        assert np.max(speeds) == pytest.approx(fastest, rel=0.02)
    for height, x_low, y_low, x_high, y_high in expected.numbers("plane"):
        drawn = run.points[run.points[:, 2] < height + 0.05]
        assert np.max(np.abs(drawn[:, 2] - height)) < 0.1
        assert np.all(drawn[:, :2] > (x_low - 0.1, y_low - 0.1))
        assert np.all(drawn[:, :2] < (x_high + 0.1, y_high + 0.1))
    for x, y, z, off in expected.numbers("stays"):
        first = int(np.argmax(np.linalg.norm(run.points - (x, y, z), axis=1) < off))
        assert np.max(np.linalg.norm(run.points[first:] - (x, y, z), axis=1)) < off
    for offset in expected.numbers("offset"):
        assert run.nearest((run.points[-1] + offset).tolist()) < 0.1
    for axis, angle_deg in expected.numbers("joint"):
        turned_to = np.degrees([position[int(axis)] for position in run.joints])
        assert 0.75 * angle_deg < np.max(turned_to) <= angle_deg
    for word, (level, which) in SIGNAL_WORDS.items():
        for rest in expected.of(word):
            name, *numbers = rest.split()
            x, y, z, off = map(float, numbers)
            assert np.linalg.norm(run.changes[name, level][which] - (x, y, z)) < off
    screen = list(expected.of("screen"))
    assert not screen or screen == list(run.world.controller.screens[run.task.name])
    for rest in expected.of("value"):
        name, value = rest.split(maxsplit=1)
        assert run.task.read(run.module, name) == value
