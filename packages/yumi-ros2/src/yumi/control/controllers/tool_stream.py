"""A stream of poses or velocities that a tool follows.

The tool's target moves smoothly, within the tool's limits, and the joints follow it by one step of the inverse
kinematics (:mod:`abb_protocols.robot.differential_kinematics`). What would be too fast for a joint, as near a
singularity, slows all of them down; a joint at the end of its range stays there, and the elbow gives way first.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import dist, hypot, inf, isnan, pi, tau

from abb_protocols.robot.differential_kinematics import DifferentialSolver, target_error, wrist_of, wrist_target
from abb_protocols.robot.joints import (
    JOINT_COUNT,
    ZERO_JOINTS,
    ArmCommand,
    ArmState,
    JointLimits,
    Joints,
    Pose,
    Quaternion,
    Side,
    Vector,
    joints,
    rotate,
)
from abb_protocols.robot.kinematics import (
    compose_poses,
    inverse_pose,
    quaternion_of,
    quaternion_product,
    rotation_vector,
    tool0_to_body,
    turn_between,
)
from yumi.control.goals import UNKNOWN_JOINTS
from yumi.control.motion.joint_steps import ramp_speed, speed_to_stop
from yumi.control.motion.setpoint import Setpoint
from yumi.control.motion.speed_motion import SpeedMotion
from yumi.control.motion.target_predictor import TargetPredictor
from yumi.control.motion.tracking_filter import TrackingFilter
from yumi.control.tool_goal import ToolGoal, pose_of
from yumi.control.tool_limits import ToolLimits

_CORRECTION = 20.0  # [1/s] what the joints are behind the target dies away so
_INDEPENDENT = 0.15  # where axes are more in line than this, all goes slower: the arm would swing about its reach
_SLOWEST = 0.3
_FASTEST_WEAK = 0.3  # [rad/s] so much may lead through a singularity
_LEAD = (0.002, 0.002, 0.002, 0.02, 0.02, 0.02, 0.05)  # [m], [rad] a velocity takes the target no further ahead
_UNMOVED = 1e-5  # [rad/s]
_SMALL = 1e-4  # [s] a step over which a rate is taken
QUIET_TOOL_STREAM = 1.0  # [s] after which a stream that rests has ended
_MOST_LOCKED = 3
SHARE_OF_SPEED = 0.8  # of the tool's limit on streams: joints that catch up with their target come to more for a moment
_ROOM = 0.002  # [m] a stream leads the tool so near to a wall
_CREEPING = 1e-5  # [m] a tool beyond a wall may be led along it
_FARTHEST_TURN = pi / 2  # [rad] the target's orientation counts from itself again beyond that


def _nearer(turn: Sequence[float], last: Sequence[float]) -> Sequence[float]:
    """A rotation vector, or the turn the other way round to the same orientation where that is nearer to ``last``."""
    size = hypot(*turn)
    if size < 1e-6:
        return turn
    other = [(1.0 - tau / size) * value for value in turn]
    return min((turn, other), key=lambda each: dist(each, last))


def _turned(back: Quaternion, numbers: Joints, last: Joints) -> Joints:
    """A target's numbers whose orientation is turned by ``back``, as the turn that is nearer to ``last``."""
    x, y, z, u, v, w, angle = numbers
    turn = rotation_vector(quaternion_product(back, quaternion_of((u, v, w))))
    return joints([x, y, z, *_nearer(turn, last[3:6]), angle])


class ToolStream:
    """The motion of one arm along a stream, from where its joints are commanded to be.

    The target's seven numbers are the tool's place [m], its orientation as a rotation vector from where it
    was at most half a turn before, and the arm angle [rad]; they share filters with streams of joints.
    """

    def __init__(
        self,
        side: Side,
        tool: Joints,
        start: Setpoint,
        limits: JointLimits,
        tool_limits: JointLimits,
        stiffness: float,
        within: ToolLimits,
    ) -> None:
        self._side = side
        self._within = within
        self.wall = ""  # that holds the tool now
        self.is_stopping = False  # since no velocity leads it any further, or its poses have fallen silent
        self.tool = tool
        self._tool, self._to_tool0 = pose_of(tool), inverse_pose(pose_of(tool))
        self._limits = limits
        self._tool_limits = tool_limits
        self.predictor, self._filter = TargetPredictor(tool_limits), TrackingFilter(tool_limits)
        self._filter.stiffness = stiffness
        self._strength, self._jerk = tool_limits.acceleration[0], tool_limits.jerk[0]
        self._weakest_joint = min(limits.acceleration), min(limits.jerk)
        self._joints = SpeedMotion(limits)
        self._joints.go_on(*start)
        self._velocity = start.velocity
        here = tool0_to_body(side, start.position, self._tool)
        self._anchor = here.orientation
        self._now = wrist_of(side, start.position)
        x, y, z = here.position
        self._target: Joints = (x, y, z, 0.0, 0.0, 0.0, self._now.angle)
        # The tool's velocity at the begin, from a step of the joints.
        small = 1e-5
        soon = joints([p + small * v for p, v in zip(*start[:2], strict=True)])
        moved = self._numbers(tool0_to_body(side, soon, self._tool), wrist_of(side, soon).angle)
        self._rates: Joints = joints([(b - a) / small for a, b in zip(self._target, moved, strict=True)])
        self._changes = [0.0] * JOINT_COUNT
        self._filter.begin(self._target, self._rates)
        self.predictor.rest_at(self._target)
        self._twist: Joints = ZERO_JOINTS
        self._is_twist = self._is_at_rest = False
        self._given_at = self._came_at = -inf
        self.silence = 0.0
        self.independence = 1.0
        self._weakest: tuple[float, ...] = (1.0,) * 6

    def take(self, goal: ToolGoal, now: float) -> None:
        """The next message; ``now`` [s] where it has no time."""
        time = now if isnan(goal.time) else goal.time
        if goal.is_twist:
            if not self._is_twist:
                # A target's turn is counted in the frame of its anchor, a velocity is seen from the body.
                self._is_twist = True
                x, y, z, *_, bend = self._rates
                turn = [a + _SMALL * rate for a, rate in zip(self._target[3:6], self._rates[3:6], strict=True)]
                later = quaternion_product(self._anchor, quaternion_of((turn[0], turn[1], turn[2])))
                spin = [value / _SMALL for value in turn_between(self._pose.orientation, later)]
                self._twist, self._changes = joints([x, y, z, *spin, bend]), [0.0] * JOINT_COUNT
            self._goal, self._given_at = goal, time
            return
        if self._is_twist:
            self._is_twist = False
            x, y, z, roll, pitch, yaw, bend = self._twist
            here = self._pose
            turned = Pose(
                here.position, quaternion_product(quaternion_of((roll, pitch, yaw), _SMALL), here.orientation)
            )
            target = self._numbers(turned, self._target[6])
            rates = [(b - a) / _SMALL for a, b in zip(self._target[3:6], target[3:6], strict=True)]
            self._rates = joints([x, y, z, *rates, bend])
            self._filter.begin(self._target, self._rates)
            self.predictor.rest_at(self._target)
        self.predictor.timeout = self.silence
        angle = self.predictor.goal[6] if isnan(goal.angle) else goal.angle
        self.predictor.add(self._numbers(pose_of(goal.pose), angle), UNKNOWN_JOINTS, time)
        self._given_at, self._came_at = time, now

    def _numbers(self, pose: Pose, angle: float) -> Joints:
        """A pose and an arm angle as the target has them, without jumps at half a turn."""
        w, x, y, z = self._anchor
        turn = _nearer(rotation_vector(quaternion_product((w, -x, -y, -z), pose.orientation)), self._target[3:6])
        bend = (angle - self._target[6] + pi) % tau - pi
        return joints([*pose.position, *turn, self._target[6] + bend])

    def _anchor_here(self) -> None:
        """Count turns from the target's orientation on: far from where they count from, they are ambiguous."""
        x, y, z, *turn, angle = self._target
        u, v, w = turn
        self._anchor, back = self._pose.orientation, quaternion_of((u, v, w), -1.0)
        size = hypot(*self._anchor)
        w, u, v, q = self._anchor
        self._anchor = (w / size, u / size, v / size, q / size)
        self._target = (x, y, z, 0.0, 0.0, 0.0, angle)

        def seen_from_here(motion: Setpoint) -> Setpoint:
            here = _turned(back, motion.position, ZERO_JOINTS)
            small = 1e-4
            rows = list(zip(*motion, strict=True))
            after, before = (
                _turned(back, joints([p + dt * (v + 0.5 * dt * a) for p, v, a in rows]), here) for dt in (small, -small)
            )
            sides = list(zip(before, here, after, strict=True))
            velocity, acceleration = list(motion.velocity), list(motion.acceleration)
            velocity[3:6] = [(last - first) / (2.0 * small) for first, _, last in sides[3:6]]
            acceleration[3:6] = [(first - 2.0 * now + last) / small**2 for first, now, last in sides[3:6]]
            return Setpoint(here, joints(velocity), joints(acceleration))

        self._filter.rebase(seen_from_here, range(3, 6))
        self.predictor.rebase(seen_from_here)

    def step(self, state: ArmState, delay: float, timeout: float, scale: float) -> ArmCommand:
        """Go on for ``state.dt``; at most ``scale`` times the speeds."""
        dt, self.is_stopping = state.dt, False
        if dt > 0.0:
            if hypot(*self._target[3:6]) > _FARTHEST_TURN:
                self._anchor_here()
            self.wall = ""
            before = self._pose, self._target[6]
            self._now = wrist_of(self._side, self._joints.position)
            if self._is_twist:
                self._move_target(dt, timeout, state.time, scale)
            else:
                self.is_stopping = state.time - self._came_at > self.predictor.patience
                target = self.predictor.at(state.time, delay)
                self._target, self._rates, _ = self._filter.step(target, dt, scale)
                self._target = self._behind_walls(self._target, before[0].position, dt)
            is_at_rest = self._is_twist and self._is_at_rest
            velocity = ZERO_JOINTS if is_at_rest else self._within_limits(self._follow(before, dt, scale), dt, scale)
        else:
            velocity = self._velocity
        command = self._joints.step(state, velocity, 1.0)
        self._velocity = command.velocity
        return command

    @property
    def _calm(self) -> float:
        """A factor on speeds: slower, where joints move much for little of the way."""
        return max(_SLOWEST, min(1.0, self.independence / _INDEPENDENT))

    @property
    def _pose(self) -> Pose:
        x, y, z, u, v, w, _ = self._target
        return Pose((x, y, z), quaternion_product(self._anchor, quaternion_of((u, v, w))))

    def _behind_walls(self, target: Joints, before: Sequence[float], dt: float) -> Joints:
        """A target ``dt`` [s] after ``before`` that can stop before each wall, and is no further beyond one."""
        x, y, z, *others = target
        place: Vector = (x, y, z)
        is_held = False
        for wall in self._within.walls * 2:  # what is moved away from one wall may come to be beyond another one
            last = wall.distance(before)
            nearest = last - dt * speed_to_stop(last - _ROOM, 0.5 * self._strength, 0.5 * self._jerk)
            missing = nearest - wall.distance(place)
            if missing > 0.0:
                place, self.wall, is_held = wall.moved(place, missing), wall.name, True
        return joints([*place, *others]) if is_held else target

    def _within_limits(self, speeds: Joints, dt: float, scale: float) -> Joints:
        """Speeds of the joints at which the tool is not too fast, and can stop before each wall [rad/s]."""
        side, position, within = self._side, self._joints.position, self._within
        now = tool0_to_body(side, position, self._tool)
        here = now.position
        after = joints([p + _SMALL * speed for p, speed in zip(position, speeds, strict=True)])
        there = tool0_to_body(side, after, self._tool)
        velocity = [(b - a) / _SMALL for a, b in zip(here, there.position, strict=True)]
        share = min(1.0, scale * SHARE_OF_SPEED * within.speed / max(hypot(*velocity), 1e-9))
        if within.turning < inf:
            turn = hypot(*turn_between(now.orientation, there.orientation))
            share = min(share, scale * within.turning * _SMALL / max(turn, 1e-12))
        speeds = speeds if share == 1.0 else joints([share * speed for speed in speeds])
        if not within.walls:
            return speeds
        # Joints that catch up with their target may overshoot it: where they would come to rest decides.
        end = tool0_to_body(side, self._joints.rest_after(speeds, dt), self._tool).position
        for wall in within.walls:
            if wall.distance(end) < min(0.5 * _ROOM, wall.distance(here) - _CREEPING):
                self.wall = wall.name
                return ZERO_JOINTS
        return speeds

    def _move_target(self, dt: float, timeout: float, now: float, scale: float) -> None:
        """A velocity moves the target, as far as the tool keeps up with it."""
        goal, limits = self._goal, self._tool_limits
        wanted = ZERO_JOINTS if now - self._given_at > timeout else goal.twist
        self.is_stopping = wanted == ZERO_JOINTS
        vx, vy, vz, wx, wy, wz, bend = wanted
        linear, angular = (vx, vy, vz), (wx, wy, wz)
        if goal.is_in_tool:
            orientation = self._pose.orientation
            linear, angular = rotate(orientation, linear), rotate(orientation, angular)
        for wall in self._within.walls:
            fastest = speed_to_stop(wall.distance(self._target) - _ROOM, 0.5 * self._strength, 0.5 * self._jerk)
            too_fast = wall.towards(linear) - fastest
            if too_fast > 0.0:
                linear, self.wall = wall.moved(linear, too_fast), wall.name
        # Too much is too much in the same direction.
        slower = self._calm * min(
            scale * limits.velocity[0] / max(hypot(*linear), 1e-9),
            scale * limits.velocity[3] / max(hypot(*angular), 1e-9),
            1.0,
        )
        rates = []
        rows = zip((*linear, *angular, bend), self._twist, limits.acceleration, limits.jerk, strict=True)
        for index, (speed, last, strength, jerk) in enumerate(rows):
            rate, self._changes[index] = ramp_speed(
                slower * speed, last, self._changes[index], limits.velocity[index], strength, jerk, dt
            )
            rates.append(rate)
        self._twist = joints(rates)
        vx, vy, vz, wx, wy, wz, bend = self._twist
        x, y, z, *_, angle = self._target
        turned = quaternion_product(quaternion_of((wx, wy, wz), dt), self._pose.orientation)
        target = self._numbers(Pose((x + dt * vx, y + dt * vy, z + dt * vz), turned), angle + dt * bend)
        target = self._behind_walls(target, self._target, dt)
        here = self._numbers(tool0_to_body(self._side, self._joints.position, self._tool), self._now.angle)
        leads = zip(target, here, _LEAD, strict=True)
        self._target = joints([max(at - most, min(at + most, to)) for to, at, most in leads])
        # What is left to make up when the target stands is given up: near a singularity the joints would go on for it.
        self._is_at_rest = self._twist == ZERO_JOINTS == wanted
        if self._is_at_rest:
            self._target = here
        self._rates = self._twist

    def _follow(self, before: tuple[Pose, float], dt: float, scale: float) -> Joints:
        """The speeds of the joints that bring the tool after its target, which was at ``before`` [rad/s]."""
        side, position, now = self._side, self._joints.position, self._now
        old = wrist_target(side, compose_poses(before[0], self._to_tool0), before[1])
        new = wrist_target(side, compose_poses(self._pose, self._to_tool0), self._target[6])
        behind, ahead = target_error(now, old), target_error(now, new)
        onward = joints([b - a for a, b in zip(behind, ahead, strict=True)])
        limits = self._limits
        locked: dict[int, float] = {}
        for _ in range(_MOST_LOCKED):
            solver = DifferentialSolver(now, tuple(locked), self._weakest)
            self.independence, self._weakest = solver.independence, solver.weakest
            # In its weakest direction no faster than the arm can stop before its axes are in line.
            fastest = max(_FASTEST_WEAK, speed_to_stop(solver.independence, *self._weakest_joint))
            correction = solver.change(behind, fastest / _CORRECTION)
            # As fast as what is behind can still be stopped at the target, all joints alike.
            rows = zip(correction, limits.acceleration, limits.jerk, strict=True)
            rate = min(
                _CORRECTION,
                *(speed_to_stop(abs(way), top, jerk) / max(abs(way), 1e-9) for way, top, jerk in rows),
            )
            steps = zip(correction, solver.change(onward, fastest * dt), strict=True)
            calm = 1.0 if self._is_twist else self._calm
            speeds = [calm * (rate * way + further / dt) for way, further in steps]
            # All joints slower alike, so that the tool keeps its direction; a joint at its end stays there.
            most = max(abs(speed) / top for speed, top in zip(speeds, limits.velocity, strict=True))
            if most > scale:
                speeds = [speed * scale / most for speed in speeds]
            at_end = {}
            for index, speed in enumerate(speeds):
                if index in locked:
                    speeds[index] = 0.0
                    continue
                end = limits.upper[index] if speed > 0.0 else limits.lower[index]
                room = abs(end - position[index])
                if abs(speed) > speed_to_stop(room, limits.acceleration[index], limits.jerk[index]) + _UNMOVED:
                    at_end[index] = speed
            if not at_end:
                break
            locked.update(at_end)
        return joints(speeds)

    def is_over(self, now: float) -> bool:
        """Whether the tool stands where the stream has led it, and nothing has come for a while."""
        return (
            now - self._given_at > QUIET_TOOL_STREAM
            and max(map(abs, self._velocity)) < _UNMOVED
            and max(map(abs, self._rates)) < _UNMOVED
        )

    def motion(self, time: float) -> tuple[Joints, Joints]:
        """Where the joints are commanded to be now, whatever ``time``."""
        return self._joints.position, self._velocity

    def setpoint(self, time: float) -> Setpoint:
        """The same as a start for what comes next."""
        if max(map(abs, self._velocity)) <= _UNMOVED:
            return Setpoint(self._joints.position)
        return Setpoint(self._joints.position, self._velocity, self._joints.acceleration)
