"""Plans motions of one or both arms around the robot itself and what stands about it, with RoboPlan.

::

    planner = Planner(obstacles=(Obstacle("box", Pose((0.4, 0.0, 0.1), IDENTITY), (0.2, 0.2, 0.2)),))
    plan = planner.plan({Side.RIGHT: here, Side.LEFT: resting}, {Side.RIGHT: there})
    robot.execute(plan)

A path is found by RRT-Connect and shortened, rounded and timed by TOPP-RA within the joints' speeds and accelerations;
then its time law is smoothed, so that the joints' jerks are kept, too. The way through space stays the one that was
checked. Why RoboPlan: docs/explanation/decisions/0040-planning-with-roboplan.md.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import islice, product
from math import pi
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NoReturn

import numpy as np
import yaml
from numpy.typing import NDArray

from yumi.control.trajectory import TrajectoryPoint, spline_through
from yumi.errors import CommandRefused, MissingPrerequisite, PlanNotFound
from yumi.planning.scene import GROUPS, planning_description, semantic_description
from yumi.robot.collision import CollisionModel, Obstacle, Part
from yumi.robot.gripper import GripperModules
from yumi.robot.inverse_kinematics import arm_angle, postures
from yumi.robot.joints import JOINT_COUNT, YUMI_LIMITS, JointLimits, Joints, Pose, Side, joint_names, joints

Array = NDArray[np.float64]

CLEARANCES = (0.02, 0.01, 0.005, 0.0)
"""Between any two shapes along a plan [m]: the first of them that start and goal leave. Twice the limiter's margin is
passed unslowed; at home, the arms are nearer than that to the body."""

_STEP = 0.01  # between two postures that are checked [rad]: 3 mm at half the reach of an arm either way
_CORNER = 0.15  # how far a rounded corner of a path may lie from the sharp one [rad]
_DT = 0.004  # of the time law while it is smoothed [s]
_POINT = 0.02  # between two points of the result [s]
_ARM_ANGLES = (0.0, 0.35, -0.35, 0.7, -0.7, 1.2, -1.2, 1.9, -1.9, pi)  # tried for a pose, from that of the start [rad]
_GOALS = 12  # postures of a pose that are tried
_ATTEMPTS = 4  # with other random numbers: a tree that grew into a corner is given up


@dataclass(frozen=True, slots=True)
class Plan:
    """A motion that was planned and not executed yet.

    Attributes:
        start: where both arms have to be [rad], also one that does not move.
        points: of each arm that moves, for its trajectory controller; both begin together.
        duration: of the motion [s].
        planning_time: how long planning took [s].
        clearance: between any two shapes along the way, at least [m]; besides what the shapes have already.
    """

    start: Mapping[Side, Joints]
    points: Mapping[Side, tuple[TrajectoryPoint, ...]]
    duration: float
    planning_time: float
    clearance: float


Goal = Joints | Pose


class Planner:
    """Plans around one robot and its surroundings.

    Args:
        grippers: the modules of each arm's gripper.
        tools: more parts of an arm: fingers of one's own, a tool, an object it holds.
        obstacles: what stands around the robot.
        limits: of the joints; motions are planned for all of their speed, acceleration and jerk.

    Raises:
        MissingPrerequisite: RoboPlan is not installed.
    """

    def __init__(
        self,
        grippers: Mapping[Side, GripperModules] | None = None,
        *,
        tools: Mapping[Side, Sequence[Part]] | None = None,
        obstacles: Sequence[Obstacle] = (),
        limits: JointLimits = YUMI_LIMITS,
    ) -> None:
        if find_spec("roboplan") is None or find_spec("roboplan.rrt") is None:
            raise MissingPrerequisite("Planning needs RoboPlan; install yumi-ros2[planning].")
        self._limits, self._obstacles, self._tools = limits, obstacles, tools
        self._grippers = grippers or dict.fromkeys(Side, GripperModules.SERVO)
        self._collisions = CollisionModel(self._grippers, tools=tools, obstacles=obstacles)
        self._scenes: dict[float, Any] = {}
        self._scene = self._with_clearance(CLEARANCES[0])

    def plan(
        self,
        start: Mapping[Side, Joints],
        goal: Mapping[Side, Goal],
        *,
        timeout: float = 30.0,
        speed_scale: float = 1.0,
        seed: int = 0,
    ) -> Plan:
        """A motion of the arms in ``goal`` that keeps clear of everything, or an error.

        Args:
            start: where both arms are [rad]; one without a goal stays there.
            goal: joint positions [rad], or the pose of tool0 in the body frame, by arm.
            timeout: how long to look for a way [s].
            speed_scale: share of the joints' speeds, above 0 up to 1.
            seed: of the random numbers; the same one finds the same way.

        Raises:
            CommandRefused: the start or the goal is impossible, out of range or too near to something.
            PlanNotFound: no way was found in time.
        """
        from roboplan import core  # noqa: PLC0415
        from roboplan.rrt import RRT, RRTOptions  # noqa: PLC0415

        begin = time.monotonic()
        sides = tuple(side for side in Side if side in goal)
        if not sides:
            raise CommandRefused("Nothing to plan: give a goal for the right arm, the left arm or both.")
        (group,) = (name for name, members in GROUPS.items() if set(members) == set(sides))
        clearance, free = self._free_targets(start, self._targets(start, goal))
        self._scene.setJointPositions(self._full(start))  # where an arm without a goal stays
        path = None
        for attempt, target in enumerate([*islice(free, _ATTEMPTS)] * _ATTEMPTS):
            if time.monotonic() - begin > timeout:
                break
            rrt = RRT(
                self._scene,
                RRTOptions(
                    group_name=group,
                    max_nodes=20_000,
                    max_connection_distance=1.0,
                    collision_check_step_size=_STEP,
                    max_planning_time=max(min(timeout / _ATTEMPTS, timeout - (time.monotonic() - begin)), 0.1),
                    rrt_connect=True,
                ),
            )
            rrt.setRngSeed(seed + attempt)
            names = self._scene.getJointGroupInfo(group).joint_names
            ends = []
            for positions in (start, {**start, **target}):
                known = {
                    n: value for side in sides for n, value in zip(joint_names(side), positions[side], strict=True)
                }
                ends.append(core.JointConfiguration(names, np.array([known[name] for name in names])))
            try:
                path = rrt.plan(*ends)
            except RuntimeError:  # not within its nodes or time
                continue
            if path is not None:
                break
        if path is None:
            raise PlanNotFound(
                f"No way was found in {time.monotonic() - begin:.1f} s: every one that was tried comes too near to the "
                "robot itself or to a box. Take a goal with more room about it, or plan in two steps."
            )
        timed = self._timed(group, path, speed_scale, seed)
        points = {}
        for side in sides:
            own = [names.index(name) for name in joint_names(side)]
            points[side] = tuple(
                TrajectoryPoint(at, *(tuple(row[own].tolist()) for row in rows)) for at, *rows in timed
            )
        return Plan(dict(start), points, timed[-1][0], time.monotonic() - begin, clearance)

    def is_free(self, positions: Mapping[Side, Joints]) -> bool:
        """Whether all shapes are the clearance apart, also those of one arm among each other."""
        return not self._scene.hasCollisions(self._full(positions))

    def _full(self, positions: Mapping[Side, Joints]) -> Array:
        known = {n: value for side in Side for n, value in zip(joint_names(side), positions[side], strict=True)}
        return np.array([known[name] for name in self._scene.getJointNames()])

    def _with_clearance(self, clearance: float) -> Any:
        """RoboPlan's scene of shapes that are larger; made when it is first needed."""
        if clearance in self._scenes:
            return self._scenes[clearance]
        from roboplan import core  # noqa: PLC0415 - an extra; nothing else needs it

        limits = self._limits
        urdf = planning_description(
            self._grippers, tools=self._tools, obstacles=self._obstacles, clearance=clearance, limits=limits
        )
        scene = self._scenes[clearance] = core.Scene("yumi", core.loadUrdfSceneDescriptionFromXml(urdf))
        scene.importSrdf(semantic_description(with_fingers=False))
        # TOPP-RA takes the accelerations from the scene, which reads them from a file.
        rows = {
            name: {"max_acceleration": [acceleration], "max_jerk": [jerk]}
            for side in Side
            for name, acceleration, jerk in zip(joint_names(side), limits.acceleration, limits.jerk, strict=True)
        }
        with TemporaryDirectory() as folder:
            file = Path(folder, "joint_limits.yaml")
            file.write_text(yaml.safe_dump({"joint_limits": rows}), encoding="utf-8")
            scene.importJointLimitsFromConfig(core.loadJointLimitsConfig(file))
        return scene

    def _free_targets(
        self, start: Mapping[Side, Joints], targets: Sequence[Mapping[Side, Joints]]
    ) -> tuple[float, list[Mapping[Side, Joints]]]:
        """The largest clearance that leaves the start and a target free, and the targets that are."""
        for clearance in CLEARANCES:
            self._scene = self._with_clearance(clearance)
            free = [each for each in targets if self.is_free({**start, **each})] if self.is_free(start) else []
            if free:
                return clearance, free
        self._refuse(start, {**start, **targets[0]})

    def _refuse(self, start: Mapping[Side, Joints], goal: Mapping[Side, Joints]) -> NoReturn:
        """Say which of them is not free, and why."""
        what, positions = ("The goal", goal) if self.is_free(start) else ("The start", start)
        nearest = self._collisions.nearest(positions)[0]
        where = f"nearest are {nearest.part} and {nearest.other}, {nearest.distance * 1e3:.0f} mm apart"
        if nearest.distance > CLEARANCES[0]:
            where = "an arm touches itself"
        raise CommandRefused(f"{what} is not free: {where}. Plans keep clear of everything; take another one.")

    def _check_range(self, side: Side, position: Joints) -> None:
        for index, (name, value) in enumerate(zip(joint_names(side), position, strict=True)):
            if not self._limits.lower[index] <= value <= self._limits.upper[index]:
                raise CommandRefused(
                    f"Nothing was planned: {name} is {np.degrees(value):.1f}°; its range is "
                    f"{self._limits.range_deg(index)}."
                )

    def _targets(self, start: Mapping[Side, Joints], goal: Mapping[Side, Goal]) -> list[Mapping[Side, Joints]]:
        """Positions of the arms with goals, those with the shortest way first."""
        choices: dict[Side, list[Joints]] = {}
        for side, position in start.items():
            self._check_range(side, position)
        for side, each in goal.items():
            if not isinstance(each, Pose):
                self._check_range(side, each)
                choices[side] = [joints(each)]
                continue
            own: list[Joints] = []
            here = arm_angle(side, start[side])
            for turn in _ARM_ANGLES:
                own += postures(side, each, here + turn, self._limits)
                if len(own) >= _GOALS:
                    break
            if not own:
                raise CommandRefused(f"The {side.word} arm does not reach this pose, whatever its arm angle.")
            choices[side] = sorted(own, key=lambda position, at=start[side]: _way(at, position))  # type: ignore[misc]
        together: list[Mapping[Side, Joints]] = [
            dict(zip(choices, each, strict=True)) for each in product(*choices.values())
        ]
        together.sort(key=lambda each: max(_way(start[side], position) for side, position in each.items()))
        return together

    def _timed(self, group: str, path: Any, speed_scale: float, seed: int) -> list[tuple[float, Array, Array, Array]]:
        """Time, positions [rad], velocities and accelerations along a path, as fast as the joints may."""
        from roboplan import core  # noqa: PLC0415
        from roboplan.toppra import PathParameterizerTOPPRA, SplineFittingMode, TOPPRAOptions  # noqa: PLC0415

        options = core.PathShortcuttingOptions(group_name=group, max_step_size=_STEP, max_iters=100, seed=seed)
        short = core.PathShortcutter(self._scene, options).shortcut(path)
        toppra = PathParameterizerTOPPRA(self._scene, group)
        rounded = TOPPRAOptions(
            dt=_DT, mode=SplineFittingMode.LinearBlend, velocity_scale=speed_scale, max_blend_deviation=_CORNER
        )
        way = np.array(toppra.generate(short, rounded).positions)
        names = self._scene.getJointGroupInfo(group).joint_names
        chain = [name for side in Side for name in joint_names(side)]
        index = [chain.index(name) % JOINT_COUNT for name in names]
        velocity, acceleration, jerk = (
            np.array(row)[index] for row in (self._limits.velocity, self._limits.acceleration, self._limits.jerk)
        )
        # TOPP-RA switches accelerations at once. Averaged over the time in which the jerk builds an acceleration up,
        # twice so that the jerk is one without steps, the time law along the same way changes them gently.
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
        keep = np.concatenate([[True], np.diff(along) > 1e-9])
        window = max(int(float(np.max(acceleration / jerk)) / _DT), 1)
        padded = np.concatenate([along, np.full(2 * window, along[-1])])
        for _ in range(2):
            total = np.cumsum(np.concatenate([np.full(window, padded[0]), padded]))
            padded = (total[window:] - total[:-window]) / window
        law = np.array([np.interp(padded, along[keep], row) for row in way[keep].T]).T
        law[0], law[-1] = way[0], way[-1]
        # What is followed, corners rounded, is looked at once more: a library may round where there is no room.
        for row in law[::2]:
            if self._scene.hasCollisions(self._scene.toFullJointPositions(group, row)):
                raise PlanNotFound(
                    "The way that was found has no room for its rounded corners; plan with another seed."
                )
        # What is still too fast in a bend is made slower as a whole.
        rates = [law]
        for _ in range(3):
            rates.append(np.gradient(rates[-1], _DT, axis=0))
        slower = (
            1.01
            * max(  # a spline between points is a little above its points
                1.0,
                *(
                    float(np.max(np.abs(rate) / most)) ** (1.0 / order)
                    for order, (rate, most) in enumerate(
                        zip(rates[1:], (velocity * speed_scale, acceleration, jerk), strict=True), 1
                    )
                ),
            )
        )
        every = max(int(_POINT / _DT), 1)
        chosen = [*range(0, len(law) - 1, every), len(law) - 1]
        still = np.zeros(len(names))
        rows = [(i * _DT * slower, law[i], rates[1][i] / slower, rates[2][i] / slower**2) for i in chosen]
        rows[0], rows[-1] = (0.0, law[0], still, still), (rows[-1][0], law[-1], still, still)
        stretch = 1.0
        # Between its points a spline may be more abrupt than the law: slower by what the worst place needs.
        points = [TrajectoryPoint(at, *(tuple(each.tolist()) for each in row)) for at, *row in rows]
        for segment in spline_through(points).segments:
            times = np.linspace(0.0, segment.end - segment.begin, 5)
            for order, most in enumerate((velocity * speed_scale, acceleration, jerk), 1):
                for row, limit in zip(segment.rows, most.tolist(), strict=True):
                    rate = np.abs(np.polynomial.Polynomial(row).deriv(order)(times)).max()
                    stretch = max(stretch, (float(rate) / limit) ** (1.0 / order))
        return [(at * stretch, place, v / stretch, a / stretch**2) for at, place, v, a in rows]


def _way(start: Joints, end: Joints) -> float:
    return max(abs(b - a) for a, b in zip(start, end, strict=True))
