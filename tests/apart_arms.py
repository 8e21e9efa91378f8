"""Two virtual arms under the limiter in virtual time, without datagrams, and what drives them at each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field
from math import pi
from time import process_time

import numpy as np

from abb_protocols.robot.description import SERVO_GRIPPERS
from abb_protocols.robot.joints import (
    CYCLE,
    JOINT_COUNT,
    YUMI_LIMITS,
    ZERO_JOINTS,
    ArmCommand,
    ArmState,
    Joints,
    Pose,
    Side,
    joints,
)
from reported_limiter import ReportedLimiter
from trajectories import change_rate
from virtual_irc5.mechanics.arm import VirtualArm
from virtual_irc5.mechanics.arm_motion import ArmModel
from virtual_irc5.mechanics.egm_motion import EgmMotionParameters
from yumi.control.collisions import COLLISION_MARGIN, CollisionLimiter
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.control.motion.setpoint import largest_difference
from yumi.core.collision import CollisionModel, Obstacle

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
TABLE = Obstacle("table", Pose((0.40, 0.0, -0.13), UPRIGHT), (0.60, 1.20, 0.05))
POST = Obstacle("post", Pose((0.45, 0.0, 0.25), (np.cos(0.2), 0.0, 0.0, np.sin(0.2))), (0.06, 0.06, 0.60))

Drive = Callable[["ApartArms", Side], ArmCommand | None]
"""What a controller would command in this cycle."""

NEAR = 0.1
"""Parts further apart than this are not compared, which takes three hundred times as long [m]."""

HELD = 0.1  # [rad] a position that moves along is not further ahead of the one that is sent, unless the arm is held
LOST_AFTER = 5  # cycles without a datagram, as in the control loop


@dataclass
class ApartArms:
    """Both arms with their limiters; a command takes effect in the next cycle.

    Attributes:
        arms: the robot's.
        desired: what each was to be sent last.
        sent: what each was sent last.
        silent: cycles for which an arm hears nothing more and is not heard.
        costs: how long the replies took, both arms together, cycle by cycle [s].
    """

    positions: Mapping[Side, Joints]
    obstacles: Sequence[Obstacle] = (TABLE, POST)
    margin: float = COLLISION_MARGIN
    costs: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.shapes = CollisionModel(SERVO_GRIPPERS, obstacles=self.obstacles)
        self.both = CollisionLimiter(
            CollisionModel(SERVO_GRIPPERS, obstacles=self.obstacles), YUMI_LIMITS, EGM_GAIN, self.margin
        )
        self.limiters = {side: ReportedLimiter(YUMI_LIMITS, collisions=self.both.arm(side)) for side in Side}
        without_load = ArmModel(supervises_load=False)
        self.arms = {side: VirtualArm(side, self.positions[side], without_load) for side in Side}
        self.sent = {side: ArmCommand(self.positions[side]) for side in Side}
        self.desired = dict(self.sent)
        self.silent = dict.fromkeys(Side, 0)
        self._unheard = dict.fromkeys(Side, 0)
        self._measured = dict(self.positions)
        self._time = 100.0
        for arm in self.arms.values():
            arm.switch_motors_on()
            arm.start_egm(EgmMotionParameters(bandwidth=0.0, max_speed=10.0))
        self.cycle({})

    def commanded(self) -> dict[Side, Joints]:
        return {side: command.position for side, command in self.sent.items()}

    def measured(self) -> dict[Side, Joints]:
        return {side: arm.position for side, arm in self.arms.items()}

    def cycle(self, drives: Mapping[Side, Drive]) -> None:
        """One cycle of both arms; an arm without a drive holds."""
        self._time += CYCLE
        cost = 0.0
        for side, arm in self.arms.items():
            if self.silent[side] > 0:
                self.silent[side] -= 1
                self._unheard[side] += 1
                if self._unheard[side] == LOST_AFTER:
                    self.limiters[side].note_interruption()
            else:
                is_first = not self.costs
                dt = 0.0 if self._unheard[side] >= LOST_AFTER or is_first else CYCLE * (1 + self._unheard[side])
                speed = change_rate(arm.position, self._measured[side], dt) if dt else ZERO_JOINTS
                state = ArmState(self._time, dt, 1, arm.position, speed, arm.planned, True)
                drive = drives.get(side)
                desired = drive(self, side) if drive else None
                checked = self.limiters[side].check(state)
                assert checked is not None
                begun = process_time()
                self.sent[side] = self.limiters[side].limit(checked, desired)
                self.desired[side] = desired or self.sent[side]
                cost += process_time() - begun
                arm.set_reference(*self.sent[side])
                self.limiters[side].observe(state)
                self._unheard[side], self._measured[side] = 0, arm.position
            arm.advance(CYCLE)
        self.costs.append(cost)

    def without_links(self, seconds: float = 1.0) -> Iterator[dict[Side, VirtualArm]]:
        """Both arms on their way, 60 ms after 60 ms, if neither got a command any more."""
        arms = deepcopy(self.arms)
        for cycle in range(round(seconds / CYCLE)):
            for arm in arms.values():
                arm.advance(CYCLE)
            if cycle % 15 == 0:
                yield arms

    def least_without_links(self) -> float:
        """The smallest distance on that way, up to NEAR [m]."""
        ways = ({side: arm.position for side, arm in arms.items()} for arms in self.without_links())
        nearest = (self.shapes.nearest(positions, within=NEAR) for positions in ways)
        return min((each.distance for found in nearest for each in found), default=NEAR)


def to(goal: Joints) -> Drive:
    """A goal that stands far away: the limiter alone makes a motion of it."""
    return lambda arms, side: ArmCommand(goal)


def at_speed(velocity: Joints) -> Drive:
    """Speeds, with positions that move along."""

    def drive(arms: ApartArms, side: Side) -> ArmCommand:
        last, sent = arms.desired[side].position, arms.sent[side].position
        if largest_difference(last, sent) > HELD:
            last = sent
        return ArmCommand(joints([p + v * CYCLE for p, v in zip(last, velocity, strict=True)]), velocity)

    return drive


def behind(goal: Joints, gain: float = 1.2) -> Drive:
    """As a proportional controller: the command runs ahead of where the arm is."""

    def drive(arms: ApartArms, side: Side) -> ArmCommand:
        now = arms.arms[side].position
        return ArmCommand(joints([p + gain * (g - p) for p, g in zip(now, goal, strict=True)]))

    return drive


def at_nearest(arms: ApartArms, side: Side, group: int = 0, sign: float = -1.0, name: str = "") -> Joints:
    """Full speed of all joints towards what is nearest.

    Args:
        group: 0 of the other arm, 1 of what stands still.
        sign: 1 leads away from it.
        name: of what stands still; any when empty.
    """
    shapes = arms.shapes
    postures = np.concatenate([arms.sent[each].position for each in Side])
    near = shapes.contacts(postures, 5.0, side if group else None)
    mine = range(shapes.arms[side].start, shapes.arms[side].stop)
    least, found = np.inf, -1
    for index, pair in enumerate(near["parts"].tolist()):
        part, other = pair if pair[0] in mine else pair[::-1]
        is_moved = shapes.frames[part] > 0 or (not group and shapes.frames[other] > 0)
        if is_moved and (not name or shapes.names[other] == name) and near["distance"][index] < least:
            least, found = float(near["distance"][index]), index
    first = list(Side).index(side) * JOINT_COUNT
    steps = 1e-6 * np.eye(len(postures))[first : first + JOINT_COUNT]
    after = [shapes.contacts(postures + step, 5.0, side if group else None)["distance"][found] for step in steps]
    changes = np.sign(np.array(after) - least)
    return joints([sign * float(n) * top for n, top in zip(changes, YUMI_LIMITS.velocity, strict=True)])


def scaled_by(share: float, speeds: Joints) -> Joints:
    return joints([share * speed for speed in speeds])


def random_position(generator: np.random.Generator) -> Joints:
    return joints(list(generator.uniform(YUMI_LIMITS.lower, YUMI_LIMITS.upper)))


def renew_drive(
    generator: np.random.Generator, arms: ApartArms, side: Side, drives: dict[Side, Drive], left: dict[Side, int]
) -> bool:
    """One cycle less is ``left`` for what drives an arm; when that is over it is driven otherwise, and this is true."""
    left[side] -= 1
    if left[side] >= 0:
        return False
    left[side] = int(generator.integers(5, 120))
    drives[side] = random_drive(generator, arms, side) or (lambda *_: None)
    return True


def random_drive(generator: np.random.Generator, arms: ApartArms, side: Side) -> Drive | None:
    """One of the ways in which an arm may be driven into something."""
    kind = generator.integers(8)
    if kind < 3:
        goal, speeds = random_position(generator), generator.uniform(-1.0, 1.0, 7) * YUMI_LIMITS.velocity
        return (to(goal), behind(goal), at_speed(joints(list(speeds))))[kind]
    if kind == 3:
        return None
    group, share = int(generator.integers(2)), float(generator.uniform(0.1, 1.0))
    scaled = scaled_by(share, at_nearest(arms, side, group))
    if kind == 4:  # with a goal in that direction
        return to(joints([p + v for p, v in zip(arms.sent[side].position, scaled, strict=True)]))
    if kind == 5:  # oscillating
        period, begun = float(generator.uniform(0.05, 0.6)), len(arms.costs)

        def oscillate(these: ApartArms, which: Side) -> ArmCommand | None:
            phase = np.sin(2.0 * pi * (len(these.costs) - begun) * CYCLE / period)
            return at_speed(joints([float(np.sign(phase)) * v for v in scaled]))(these, which)

        return oscillate
    return at_speed(scaled)
