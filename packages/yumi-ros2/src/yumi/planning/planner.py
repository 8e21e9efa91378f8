"""The planner: motions of one or both arms around the robot and its surroundings, with RoboPlan.

::

    planner = Planner(obstacles=(Obstacle("box", Pose((0.4, 0.0, 0.1), IDENTITY), (0.2, 0.2, 0.2)),))
    plan = planner.plan({Side.RIGHT: here, Side.LEFT: resting}, {Side.RIGHT: there})
    robot.execute(plan)

The straight path in joint space is taken where it is free. Else a path is found by RRT-Connect and shortened by
RoboPlan, and its corners are rounded as far as there is room. A path is passed as fast as the joints' speeds,
accelerations and jerks allow (:func:`yumi.planning.path_timing.fastest_along`), and slower where the limiter
(:mod:`yumi.control.collisions`) would not let it pass.
Why RoboPlan: docs/explanation/decisions/0040-planning-with-roboplan.md.
The robot is read as :mod:`yumi.planning.scene_description` writes it.
"""

from __future__ import annotations

import time
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import chain, islice, product
from math import pi
from operator import itemgetter
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, PlanNotFound, WhyNoPlan, missing_extra
from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.inverse_kinematics import arm_angle, postures_of_each
from abb_protocols.robot.joints import (
    CYCLE,
    JOINT_COUNT,
    YUMI_LIMITS,
    JointLimits,
    Joints,
    Pose,
    Side,
    joint_names,
    joints,
)
from abb_runtime.clock import Clock, SystemClock
from yumi.control.collisions import BODY_MARGIN, COLLISION_DISTANCES, CollisionLimiter
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.control.motion.setpoint import Setpoint
from yumi.control.motion.spline import SplineSampler, TrajectoryPoint, spline_through
from yumi.core.collision import CollisionModel, CollisionPart, Obstacle
from yumi.planning.path_timing import NO_PATH_CEILING, MotionLimits, fastest_along
from yumi.planning.rounded_path import RoundedPath
from yumi.planning.scene_description import GROUPS, planning_description, semantic_description
from yumi.planning.smoothing import smooth_spline_through

_Array = NDArray[np.float64]

CLEARANCES = (0.02, 0.01, 0.005, 0.0, BODY_MARGIN - 0.001)
"""Between any two shapes along a plan [m]: the first of them that start and goal leave. Twice the limiter's margin is
passed unslowed; at home, the arms are nearer than that to the body, and within their padding where the limiter has
stopped them there. The last one is only for a way out from there: measured, they may be a little nearer than they were
sent.
"""

_LEVELS = (*((each, CLEARANCES[0]) for each in CLEARANCES), *((each, each) for each in CLEARANCES[1:]))
"""Of the arms from each other and from the body, and from boxes [m]: an arm that begins or stands beside the body need
not come nearer to boxes.
"""

_STEP = 0.01  # between two postures that are checked [rad]: 3 mm at half the reach of an arm either way
_CORNER = 0.15  # how far a rounded corner of a path may lie from the sharp one [rad]
_SHORTCUTS = 10  # that are tried between two looks at the time
_EVERY = 3  # cycles between two points of the result: a spline between them is a little above their rates
_ARM_ANGLES = (0.0, 0.35, -0.35, 0.7, -0.7, 1.2, -1.2, 1.9, -1.9, pi)  # tried for a pose, from that of the start [rad]
_GOALS = 12  # postures of a pose that are tried
_SLOWER = (0.85, 0.75, 0.65, 0.55, *(0.45,) * 5)  # than before, where the limiter does not accept a motion
_IN_VAIN = 2  # times slower without fewer cycles refused: then the way is too narrow for the limiter at any speed
_AROUND = 6  # cycles
_PLACE = 0.01  # [s] at the joints' speeds, between two places at which a motion is made slower
_CREEPING = 0.05  # of the joints' speeds: slower would be of no use
_QUICKER = 1.02  # than it is, the limiter must accept a motion: a real robot lags
_SHARE = 0.75  # of the distances that it may calculate must be enough for that: a robot that lags takes a few more
_ATTEMPTS = 4  # with other random numbers: a tree that grew into a corner is given up
_NODES = 20_000  # of a search, which ends without a path when it has so many
_BUSY = 0.8  # of a processor: a planner that gets less shares it with other programs


@dataclass(frozen=True, slots=True)
class Plan:
    """A motion that was planned and not executed yet.

    Attributes:
        start: where both arms have to be [rad], also one that does not move.
        points: of each arm that moves, for its trajectory controller; both begin together.
        duration: of the motion [s].
        planning_time: how long planning took [s].
        clearance: between any two shapes along the path, at least [m]; besides what the shapes have already, of which a
            negative one takes.
    """

    start: Mapping[Side, Joints]
    points: Mapping[Side, tuple[TrajectoryPoint, ...]]
    duration: float
    planning_time: float
    clearance: float


Goal = Joints | Pose
_Motion = Mapping[Side, tuple[TrajectoryPoint, ...]]


class Planner:
    """Plans around one robot and its surroundings.

    Args:
        grippers: the modules of each arm's gripper.
        tools: more parts of an arm: fingers of one's own, a tool, an object it holds.
        obstacles: what stands around the robot.
        limits: of the joints; motions are planned for all of their speed, acceleration and jerk.
        clock: of the timeouts; a search of RoboPlan's looks at that of the machine, too.

    Attributes:
        obstacles: as above, as ``limits``.

    Raises:
        MissingPrerequisite: RoboPlan is not installed.
    """

    def __init__(
        self,
        grippers: Mapping[Side, GripperModules] | None = None,
        *,
        tools: Mapping[Side, Sequence[CollisionPart]] | None = None,
        obstacles: Sequence[Obstacle] = (),
        limits: JointLimits = YUMI_LIMITS,
        clock: Clock = SystemClock(),  # noqa: B008 - it has no state
    ) -> None:
        if find_spec("roboplan") is None or find_spec("roboplan.rrt") is None:
            raise missing_extra(message("planning_needs_roboplan"), "yumi-ros2", "planning")
        self.limits, self.obstacles, self._tools = limits, tuple(obstacles), tools
        self._clock = clock
        self._grippers = grippers or dict.fromkeys(Side, GripperModules.SERVO)
        self._collisions = CollisionModel(self._grippers, tools=tools, obstacles=obstacles)
        self._scenes: dict[tuple[float, float], Any] = {}
        # At the program's end, too: RoboPlan lists on standard error what is left of it then, such as in a frame of a
        # thread that goes on, and the list would come after the error that ended the program.
        weakref.finalize(self, self._scenes.clear)
        self._level = _LEVELS[0]
        self._with_clearance(*self._level)

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
            timeout: how long to look for a path [s]; a straight one is found in any case.
            speed_scale: share of the joints' speeds, above 0 up to 1.
            seed: of the random numbers; the same one finds the same path.

        Raises:
            CommandRefused: the start or the goal is impossible, out of range or too near to something.
            PlanNotFound: no path was found; ``why`` says whether time was up or there is none.
        """
        from roboplan import core  # noqa: PLC0415
        from roboplan.rrt import RRT, RRTOptions  # noqa: PLC0415

        begin, begin_of_work = self._clock.now(), time.thread_time()
        sides = tuple(side for side in Side if side in goal)
        if not sides:
            raise CommandRefused(message("no_arm_has_goal"))
        (group,) = (name for name, members in GROUPS.items() if set(members) == set(sides))
        clearance, free = self._free_targets(start, self._targets(start, goal))
        targets = [*islice(free, _ATTEMPTS)]
        self._scene.setJointPositions(self._full(start))  # where an arm without a goal stays
        names = self._scene.getJointGroupInfo(group).joint_names
        here, *there = (
            np.array([known[name] for name in names])
            for known in ({**_by_name(start), **_by_name(target)} for target in ({}, *targets))
        )
        found: dict[int, _Motion] = {}  # by how much of it the limiter would refuse

        def take(motion: _Motion, refused: int) -> bool:
            """Keep a motion; whether no other one has to be looked for."""
            is_known = bool(motion) and found.setdefault(refused, motion) is not motion and found[refused] == motion
            # Other motions are the same, or no better.
            return bool(motion) and (not refused or is_known or clearance < CLEARANCES[0])

        # The straight paths need no search, so they are tried however little time there is.
        deadline = begin + timeout
        is_over = any(take(*self._timed(start, group, np.array([here, end]), speed_scale, deadline)) for end in there)
        is_cut_short = False
        for attempt, end in enumerate(there * _ATTEMPTS):
            if is_over:
                break
            left = deadline - self._clock.now()
            if left < 0.0:
                is_cut_short = True
                break
            rrt = RRT(
                self._scene,
                RRTOptions(
                    group_name=group,
                    max_nodes=_NODES,
                    max_connection_distance=1.0,
                    collision_check_step_size=_STEP,
                    max_planning_time=max(min(timeout / _ATTEMPTS, left), 0.1),
                    rrt_connect=True,
                ),
            )
            rrt.setRngSeed(seed + attempt)
            try:
                path = rrt.plan(*(core.JointConfiguration(names, each) for each in (here, end)))
            except RuntimeError:  # not within its nodes or time
                is_cut_short = is_cut_short or sum(map(len, rrt.getNodes())) < _NODES
                continue
            corners = self._shortened(group, path, seed, deadline)
            is_over = take(*self._timed(start, group, corners, speed_scale, deadline))
        spent = self._clock.now() - begin
        if not found:
            raise _not_found(spent, time.thread_time() - begin_of_work, is_cut_short=is_cut_short)
        points = found[min(found)]
        return Plan(dict(start), points, _duration(points), spent, clearance)

    @property
    def _scene(self) -> Any:
        """RoboPlan's scene of the clearance that is planned with."""
        return self._with_clearance(*self._level)

    def is_free(self, positions: Mapping[Side, Joints]) -> bool:
        """Whether all shapes are the clearance apart, also those of one arm among each other."""
        return not self._scene.hasCollisions(self._full(positions))

    def _full(self, positions: Mapping[Side, Joints]) -> _Array:
        known = _by_name(positions)
        return np.array([known[name] for name in self._scene.getJointNames()])

    def _with_clearance(self, clearance: float, to_boxes: float) -> Any:
        """RoboPlan's scene of shapes that are larger; made when it is first needed."""
        if (clearance, to_boxes) in self._scenes:
            return self._scenes[clearance, to_boxes]
        from roboplan import core  # noqa: PLC0415 - an extra; nothing else needs it

        urdf = planning_description(
            self._grippers,
            tools=self._tools,
            obstacles=self.obstacles,
            clearance=clearance,
            to_boxes=to_boxes,
            limits=self.limits,
        )
        scene = self._scenes[clearance, to_boxes] = core.Scene("yumi", core.loadUrdfSceneDescriptionFromXml(urdf))
        scene.importSrdf(semantic_description(with_fingers=False))
        return scene

    def _free_targets(
        self, start: Mapping[Side, Joints], targets: Sequence[Mapping[Side, Joints]]
    ) -> tuple[float, list[Mapping[Side, Joints]]]:
        """The largest clearance that leaves the start and a target free, and the targets that are."""
        for clearance, to_boxes in _LEVELS:
            if clearance < 0.0 and self.is_free(start):
                continue  # a way out is not needed: no plan leads into what the limiter stops the arms at
            self._level = clearance, to_boxes
            free = [each for each in targets if self.is_free({**start, **each})] if self.is_free(start) else []
            if free:
                return clearance, free
        self._refuse(start, {**start, **targets[0]})

    def _refuse(self, start: Mapping[Side, Joints], goal: Mapping[Side, Joints]) -> NoReturn:
        """Say which of them is not free, and why."""
        is_goal = self.is_free(start)
        nearest = self._collisions.nearest(goal if is_goal else start)[0]
        if nearest.distance > CLEARANCES[0]:
            where = message("arm_touches_itself")
        elif nearest.distance < 0.0:
            where = message("parts_overlap", part=nearest.part, other=nearest.other, depth=-nearest.distance)
        else:
            where = message("parts_are_near", part=nearest.part, other=nearest.other, distance=nearest.distance)
        raise CommandRefused(message("plan_goal_not_free" if is_goal else "plan_start_not_free", where=where))

    def _check_range(self, side: Side, position: Joints) -> None:
        for index, (name, value) in enumerate(zip(joint_names(side), position, strict=True)):
            if not self.limits.lower[index] <= value <= self.limits.upper[index]:
                raise CommandRefused(
                    message(
                        "plan_joint_out_of_range",
                        joint=name,
                        position=float(value),
                        lower=self.limits.lower[index],
                        upper=self.limits.upper[index],
                    )
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
            angles = [arm_angle(side, start[side]) + turn for turn in _ARM_ANGLES]
            found = postures_of_each(side, [each] * len(angles), angles, self.limits)
            own = list(chain.from_iterable(found))[:_GOALS]
            if not own:
                raise CommandRefused(message("plan_pose_out_of_reach", arm=side.word))
            choices[side] = sorted(own, key=lambda position, at=start[side]: _way(at, position))  # type: ignore[misc]
        together: list[Mapping[Side, Joints]] = [
            dict(zip(choices, each, strict=True)) for each in product(*choices.values())
        ]
        together.sort(key=lambda each: max(_way(start[side], position) for side, position in each.items()))
        return together

    def _shortened(self, group: str, path: Any, seed: int, deadline: float) -> _Array:
        """The corners of a path of RoboPlan after shortcuts, which are looked for until ``deadline``, (n, k)."""
        from roboplan import core  # noqa: PLC0415

        for attempt in range(10):
            if self._clock.now() > deadline:
                break  # a longer path than need be
            options = core.PathShortcuttingOptions(
                group_name=group, max_step_size=_STEP, max_iters=_SHORTCUTS, seed=seed + attempt
            )
            path = core.PathShortcutter(self._scene, options).shortcut(path)
        return np.array(path.positions)

    def _timed(
        self,
        start: Mapping[Side, Joints],
        group: str,
        corners: _Array,
        speed_scale: float,
        deadline: float,
    ) -> tuple[_Motion, int]:
        """The motion of a group along a path of ``corners``, (n, k), as fast as joints and limiter let it.

        In how many cycles the limiter would refuse it; no motion, where the path is not free, or has no room for
        corners that can be passed.
        """
        names = self._scene.getJointGroupInfo(group).joint_names
        in_order = [name for side in Side for name in joint_names(side)]
        index = [in_order.index(name) % JOINT_COUNT for name in names]
        rows = (getattr(self.limits, name) for name in ("velocity", "acceleration", "jerk", "lower", "upper"))
        velocity, acceleration, jerk, lower, upper = (np.array(row)[index] for row in rows)
        velocity = velocity * speed_scale

        corners = corners[np.concatenate([[True], np.max(np.abs(np.diff(corners, axis=0)), axis=1) > 1e-9])]
        if len(corners) == 1:  # it is there
            here, still = tuple(corners[0].tolist()), (0.0,) * len(names)
            return _of_each_arm(names, [TrajectoryPoint(at, here, still, still) for at in (0.0, CYCLE)]), 0
        rounded = RoundedPath(corners, velocity, _CORNER)
        places = np.linspace(0.0, rounded.length, int(rounded.length * float(np.max(velocity)) / _STEP) + 2)
        while True:
            # A rounded corner may touch what the sharp one, which was checked, does not.
            full = (self._scene.toFullJointPositions(group, row) for row in rounded.at(places)[0])
            touching = places[np.array([self._scene.hasCollisions(row) for row in full])]
            if not len(touching):
                break
            if not rounded.sharpen(touching):
                return {}, 0
        return self._accepted(start, names, rounded, MotionLimits(velocity, acceleration, jerk, lower, upper), deadline)

    def _accepted(
        self,
        start: Mapping[Side, Joints],
        names: Sequence[str],
        path: RoundedPath,
        limits: MotionLimits,
        deadline: float,
    ) -> tuple[_Motion, int]:
        """The fastest motion along a path that the limiter accepts, or the one of which it refuses least; how much.

        It is made slower in places until ``deadline``. Nothing, where no motion along it keeps the joints' limits.
        """
        places = np.linspace(0.0, path.length, int(path.length / _PLACE) + 2)
        ceiling = np.full(len(places), NO_PATH_CEILING)
        found: dict[int, _Motion] = {}
        in_vain = 0
        for slower in (*_SLOWER, 0.0):
            try:
                law, positions = fastest_along(path, limits, ceiling)
            except CommandRefused:  # no motion along it keeps the limits, or none with this ceiling
                break
            motion = _of_each_arm(names, _spline_points(positions, limits))
            refused = self._refused(start, motion)
            in_vain = 0 if not found or len(refused) < min(found) else in_vain + 1
            found.setdefault(len(refused), motion)
            if not refused or in_vain == _IN_VAIN or self._clock.now() > deadline:
                break
            # A little around, too: the time law averages, and would fill a gap.
            last = len(law) - 1
            cycles = np.minimum(np.array(refused) / _duration(motion) * last, last).astype(int)
            speeds = np.full(len(law), NO_PATH_CEILING)
            speeds[cycles] = slower * np.maximum(np.gradient(law)[cycles] / CYCLE, _CREEPING)
            edge = np.pad(speeds, _AROUND, mode="edge")
            speeds = np.min(np.lib.stride_tricks.sliding_window_view(edge, 2 * _AROUND + 1), axis=1)
            following = np.clip(np.searchsorted(places, law), 1, len(places) - 1)
            for place in (following - 1, following):  # those between which it is in each cycle
                np.minimum.at(ceiling, place, speeds)
        least = min(found, default=0)
        return found.get(least, {}), least

    def _refused(self, start: Mapping[Side, Joints], motion: _Motion) -> list[float]:
        """When the limiter would not accept what the trajectory controllers send of a motion [s]."""
        both = CollisionLimiter(self._collisions, self.limits, EGM_GAIN, distances=int(_SHARE * COLLISION_DISTANCES))
        ways = {side: SplineSampler(spline_through(points)) for side, points in motion.items()}
        planned, refused = dict(start), []
        for at in np.arange(0.0, _duration(motion) + CYCLE, CYCLE).tolist():
            for side in Side:
                arm, now = both.arm(side), ways[side].setpoint(at) if side in ways else Setpoint(start[side])
                now = now._replace(velocity=joints([_QUICKER * speed for speed in now.velocity]))
                robot = now if any(now.velocity) else None  # which follows with what is fed forward
                if not arm.accepts(planned[side], now, robot, feeds_forward=robot is not None):
                    refused.append(at)
                arm.sent(planned[side], now, robot)  # what comes then is judged all the same
                planned[side] = now.position
        return refused


def _spline_points(positions: _Array, limits: MotionLimits) -> list[TrajectoryPoint]:
    """A motion of positions in each cycle [rad], (n, k), as points of a spline that keeps the limits."""
    # Velocities and accelerations are those of the smoothest spline, which the controllers' is then, too.
    chosen = [*range(0, len(positions) - 1, _EVERY), len(positions) - 1]
    knots = [TrajectoryPoint(index * CYCLE, tuple(positions[index].tolist())) for index in chosen]
    still = (0.0,) * positions.shape[1]
    points = [knots[0]._replace(velocity=still, acceleration=still)]
    for segment in smooth_spline_through(knots).segments[1:]:
        place, speeds, halves, *_ = zip(*segment.rows, strict=True)
        points.append(TrajectoryPoint(segment.begin, place, speeds, tuple(2.0 * each for each in halves)))
    points.append(knots[-1]._replace(velocity=still, acceleration=still))
    # Between its points a spline may be a little more abrupt: slower by what the worst place needs.
    segments = spline_through(points).segments
    coefficients = np.zeros((len(segments), positions.shape[1], 6))  # from the constant up
    for own, segment in zip(coefficients, segments, strict=True):
        for row, values in zip(own, segment.rows, strict=True):
            row[: len(values)] = values
    times = np.array([np.linspace(0.0, each.end - each.begin, 5) for each in segments])[:, None, :]
    stretch = 1.0
    for order, most in enumerate((limits.velocity, limits.acceleration, limits.jerk), 1):
        coefficients = coefficients[:, :, 1:] * np.arange(1.0, coefficients.shape[2])  # the derivative's
        rates = sum(coefficients[:, :, [power]] * times**power for power in range(coefficients.shape[2]))
        fastest = np.abs(rates).max(axis=(0, 2))
        stretch = max(stretch, float(np.max(fastest / most)) ** (1.0 / order))
    return [
        TrajectoryPoint(
            each.time * stretch,
            each.position,
            tuple(rate / stretch for rate in each.velocity),
            tuple(rate / stretch**2 for rate in each.acceleration),
        )
        for each in points
    ]


def _of_each_arm(names: Sequence[str], points: Sequence[TrajectoryPoint]) -> _Motion:
    """The motion of joints of these names, arm by arm."""
    motion = {}
    for side in (side for side in Side if joint_names(side)[0] in names):
        own = itemgetter(*(names.index(name) for name in joint_names(side)))
        motion[side] = tuple(TrajectoryPoint(at, *map(own, rows)) for at, *rows in points)
    return motion


def _duration(motion: _Motion) -> float:
    return max(points[-1].time for points in motion.values())


def _by_name(positions: Mapping[Side, Joints]) -> dict[str, float]:
    return {n: value for side, each in positions.items() for n, value in zip(joint_names(side), each, strict=True)}


def _not_found(spent: float, work: float, *, is_cut_short: bool) -> PlanNotFound:
    """Why there is no plan after ``spent`` seconds, of which the planner had a processor for ``work`` seconds."""
    share = min(1.0, work / spent) if spent > 0.0 else 1.0
    if not is_cut_short:
        return PlanNotFound(
            message("no_path", duration=spent),
            WhyNoPlan.NO_PATH,
            share,
        )
    code = "no_path_in_time_busy" if share < _BUSY else "no_path_in_time"
    return PlanNotFound(message(code, duration=spent, share=share), WhyNoPlan.TIME_IS_UP, share)


def _way(start: Joints, end: Joints) -> float:
    return max(abs(b - a) for a, b in zip(start, end, strict=True))
