"""One arm of the virtual robot: planned motion, servo, motors, brakes, supervision of its load; contacts of both arms.

The shapes that may touch are those of the URDF that the robot publishes, without padding, and MuJoCo places them by
that URDF: nothing here is shared with the limiter that keeps the arms apart, so that a run without contact is the
limiter's doing. Links of one arm do not touch each other here.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from math import acos, dist, exp, pi, sin
from typing import Any, NamedTuple, cast

from yumi.errors import CommandRefused, RobotNotReady
from yumi.robot.arms import Arm, yumi_arm
from yumi.robot.description import robot_description
from yumi.robot.dynamics import HAND, ArmDynamics
from yumi.robot.gripper import GripperModules
from yumi.robot.joints import CYCLE, Joints, Pose, Side, finger_names, joint_names, prefixed
from yumi.robot.kinematics import compose, tool0_to_body
from yumi.virtual.mechanics.arm_motion import (
    ArmModel,
    EgmMotion,
    EgmSettings,
    Motion,
    MotionState,
    Standstill,
    braking,
    stopping,
    travel,
)
from yumi.virtual.mechanics.path import PathMotion

IN_POSITION = 1e-5
"""Difference of planned and measured position at which the arm counts as standing [rad]."""

STOPPED = "stopped"
"""Why an arm stands on its path: the program's execution was stopped."""

PUSH_TIME = 0.8
"""So long does a push last: out and back [s]."""

_PUSHED_JOINT = 3  # axis 3, the elbow: its place in the chain
_WAYPOINTS = 32  # into which the path of the tool is divided to measure its length


class VirtualArm:
    """One arm, motors off at first.

    Args:
        side: which of the robot's arms it is; a robot with one arm has the right one's place.
        position: where it stands at first [rad], (7,); home without one.
        model: its dynamics.
        kinematics: of the arm; those of a YuMi's arm without them.
        unit: name of its mechanical unit, ``ROB_R`` or ``ROB_L`` without one.

    Attributes:
        kinematics: where its tool is, and which joint positions bring it somewhere.
        path: the motions that RAPID has planned.
        overload: the joint that EGM has overloaded since it began; None as long as there is none.
    """

    def __init__(
        self,
        side: Side,
        position: Joints | None = None,
        model: ArmModel | None = None,
        kinematics: Arm | None = None,
        unit: str = "",
    ) -> None:
        self.side = side
        self.unit = unit or side.unit
        self.model = model or ArmModel()
        self.kinematics = kinematics or yumi_arm(side, self.model.limits)
        self._motors_on = False
        self._motion: Motion = Standstill(position or self.kinematics.home)
        self.path = PathMotion(self.planned, self.model.limits)
        self._is_regaining = False
        self._servo = Servo(self.planned, self.model)
        self.path.reaction_time = self.reaction_time
        self._load: LoadSupervision | None = None
        self._push, self._push_left = 0.0, 0.0  # by how much [rad], and for how long still [s]
        self.overload: Overload | None = None

    @property
    def position(self) -> Joints:
        """Measured joint positions, chain order [rad], (7,)."""
        if self._push_left <= 0.0:
            return self._servo.position
        position, limits = list(self._servo.position), self.model.limits
        aside = position[_PUSHED_JOINT] + self._push * sin(pi * self._push_left / PUSH_TIME) ** 2
        position[_PUSHED_JOINT] = max(limits.lower[_PUSHED_JOINT], min(limits.upper[_PUSHED_JOINT], aside))
        return cast("Joints", tuple(position))

    @property
    def planned(self) -> Joints:
        """Joint positions the controller plans, chain order [rad], (7,); what EGM has integrated while EGM runs."""
        return self._motion.state.position

    def tool_pose(self, position: Joints, tool: Pose | None) -> Pose:
        """Where a tool (seen from tool0) is in the world at joint positions [rad]."""
        if self.kinematics.is_of_yumi:
            return tool0_to_body(self.side, position, tool)
        tool0 = self.kinematics.tool0(position)
        return tool0 if tool is None else compose(tool0, tool)

    def joint_name(self, index: int) -> str:
        """What sentences call a joint, by its place in the chain: as in ROS on a YuMi, else ABB's number."""
        if self.kinematics.is_of_yumi:
            return joint_names(self.side)[index]
        return f"axis {self.kinematics.axes[index]}"

    @property
    def velocity(self) -> Joints:
        """Planned joint speeds, chain order [rad/s], (7,)."""
        return self._motion.state.velocity

    @property
    def motors_on(self) -> bool:
        return self._motors_on

    @property
    def reaction_time(self) -> float:
        """Time from a planned position until the arm is there [s]."""
        return self._servo.target_delay + self.model.lag

    @property
    def is_stationary(self) -> bool:
        """Whether no motion is under way and the arm has settled (a RAPID fine point)."""
        return self._motion.is_finished and all(
            abs(a - b) < IN_POSITION for a, b in zip(self.planned, self.position, strict=True)
        )

    @property
    def egm(self) -> EgmMotion | None:
        """The motion under EGM, or None."""
        return self._motion if isinstance(self._motion, EgmMotion) else None

    def advance(self, dt: float) -> None:
        """Let ``dt`` [s] pass; any length, the arm divides it into its own steps."""
        self._push_left = max(0.0, self._push_left - dt)
        steps = max(1, -int(-dt // self.model.step)) if dt > 0.0 else 0
        for _ in range(steps):
            egm = self.egm
            if egm is not None:
                egm.reported = self.position
            self._motion.advance(dt / steps)
            if self._is_regaining and self._motion.is_finished:
                self._motion, self._is_regaining = self.path, False
            self._servo.advance(self.planned, dt / steps)
            if not self.path.has_acted:
                self.path.act(dt / steps)
            # Only references from outside are supervised: the controller plans its own motions within the limits.
            if egm is not None and self._load is not None and self.overload is None:
                self.overload = self._load.advance(egm.state, dt / steps)

    def push(self, by: float) -> None:
        """Someone pushes its elbow aside by an angle [rad] and lets go: what is measured deviates, the plan does not.

        EGM, whose loop is closed over what is measured, plans against the push.

        Raises:
            CommandRefused: the motors are off: the brakes hold it.
        """
        if not self._motors_on:
            raise CommandRefused("The motors are off, and the brakes hold the arm; switch the motors on first.")
        self._push, self._push_left = by, PUSH_TIME

    def tune(self, gains: Mapping[int, float] | None = None) -> None:
        """Gains of position control (TuneServo) by index of the joint; 1 is the usual one, and that of all others."""
        self._servo.tune(gains or {})

    def switch_motors_on(self) -> None:
        self._motors_on = True

    def switch_motors_off(self) -> None:
        """The brakes stop the arm, whatever it was doing, and hold it."""
        self._motors_on = False
        if not self._motion.is_finished:
            if self._motion is self.path:
                self.path.halt()
            self._motion, self._is_regaining = braking(self._motion.state, self.model), False

    def move_to(
        self,
        target: Joints,
        *,
        tool_speed: float = float("inf"),
        turn_speed: float = float("inf"),
        duration: float = 0.0,
        tool: Pose | None = None,
    ) -> None:
        """Begin a jerk-limited motion to ``target`` (RAPID MoveAbsJ); it ends when :attr:`is_stationary`.

        Args:
            target: joint positions, chain order [rad], (7,).
            tool_speed: mean speed of the tool's point, ``speeddata.v_tcp`` [m/s].
            turn_speed: mean speed of its orientation, ``speeddata.v_ori`` [rad/s].
            duration: shortest time the motion takes, RAPID's optional argument T [s].
            tool: tool frame in tool0 whose speed is meant; None is tool0.

        Raises:
            CommandRefused: the target is out of the joints' range.
            RobotNotReady: the motors are off, or EGM moves the arm.
        """
        self.check_ready()
        index = self.model.limits.outside(target)
        if index is not None:
            name, range_deg = self.joint_name(index), self.model.limits.range_deg(index)
            raise CommandRefused(f"{name} cannot move to {target[index]:.4f} rad: its range is {range_deg} (50027).")
        if self._motion.is_finished and target == self.planned and duration <= 0.0:
            return  # there already: a program that repeats it in a loop must not cost a plan each time
        start = self.planned
        poses = [self.tool_pose(_between(start, target, index / _WAYPOINTS), tool) for index in range(_WAYPOINTS + 1)]
        length = sum(dist(a.position, b.position) for a, b in pairwise(poses))
        cosines = (
            abs(sum(x * y for x, y in zip(a.orientation, b.orientation, strict=True))) for a, b in pairwise(poses)
        )
        turn = sum(2.0 * acos(min(1.0, cosine)) for cosine in cosines)  # of half the angle between quaternions
        shortest = max(duration, length / tool_speed, turn / turn_speed)
        self._motion = travel(self._motion.state, target, self.model, shortest)

    def follow_path(self) -> None:
        """Go on along the path, back from where something else has moved the arm to.

        Raises:
            RobotNotReady: the motors are off, or EGM moves the arm.
        """
        self.path.holds.discard(STOPPED)
        self.regain_path()

    def regain_path(self) -> None:
        """Go back to the path from where something else has moved the arm to, as far as nothing else holds it.

        Raises:
            RobotNotReady: the motors are off, or EGM moves the arm.
        """
        if self.path.is_empty or self._motion is self.path or self._is_regaining:
            return
        self.check_ready()
        there = self.path.state.position
        self._is_regaining = self.planned != there
        self._motion = travel(self._motion.state, there, self.model) if self._is_regaining else self.path

    def leave_path(self) -> None:
        """Stay where it is, at standstill, while the path becomes another one; `follow_path` goes there."""
        if self._motion is self.path:
            self._motion = Standstill(self.planned)

    def stop(self) -> None:
        """Decelerate any motion to standstill as fast as the drives allow, and hold; a path is kept."""
        if self._motion is self.path:
            self.path.hold(STOPPED)
        elif not self._motion.is_finished:
            self._motion, self._is_regaining = stopping(self._motion.state, self.model), False

    def strike(self, position: Joints) -> None:
        """It meets something and stands at once, at ``position`` [rad], (7,); a path is kept."""
        if self._motion is self.path:
            self.path.halt()
        self._motion, self._is_regaining, self._push_left = Standstill(position), False, 0.0
        self._servo.rest_at(position)

    def start_egm(self, settings: EgmSettings) -> None:
        """Let EGM move the arm, from its planned position.

        Raises:
            RobotNotReady: the motors are off, or EGM moves the arm already.
        """
        self.check_ready()
        self._servo.target_delay = self.model.egm_delay(settings.level)
        self._motion, self._is_regaining = EgmMotion(self.planned, settings, self.model), False
        self.overload = None
        if self.model.supervises_load:
            self._load = LoadSupervision(self.side, self.model, self.planned)

    def set_reference(self, position: Joints | None, velocity: Joints | None) -> None:
        """Set EGM's references [rad], [rad/s], (7,): None keeps the last position, and means speed 0.

        Raises:
            RobotNotReady: EGM does not move the arm.
        """
        egm = self.egm
        if egm is None:
            raise RobotNotReady(f"EGM does not move the {self.kinematics.name}: start EGM first.")
        if position is not None:
            egm.reference = position
        egm.reference_velocity = MotionState.standing(egm.reference).velocity if velocity is None else velocity

    def stop_egm(self, ramp_time: float = 0.0, *, returns_to_start: bool = False) -> None:
        """End EGM: come to a stop over ``ramp_time`` [s] and hold, or go back to where EGM started.

        The way back takes longer than ``ramp_time`` where the arm's limits ask for it, as on the real
        controller (event 50446).
        """
        egm = self.egm
        if egm is None:
            return
        # Without EGM's acceleration, which is that of single steps of speed.
        state = replace(MotionState.standing(egm.state.position), velocity=egm.state.velocity)
        if returns_to_start:
            self._motion = travel(state, egm.start, self.model, ramp_time)
        else:
            self._motion = stopping(state, self.model, ramp_time)

    def check_ready(self) -> None:
        """Raise RobotNotReady where RAPID cannot move the arm: the motors are off, or EGM moves it."""
        if not self._motors_on:
            raise RobotNotReady(f"The motors of the {self.kinematics.name} are off: switch them on first.")
        if self.egm is not None:
            raise RobotNotReady(f"EGM moves the {self.kinematics.name}: end EGM before other motions (50453).")


_SLEWING = 0.5  # how fast the delay may change [s/s]: below 1, so the past never runs backwards


class Servo:
    """Follows the planned position late and smoothly; exact for a plan that is straight within each step."""

    def __init__(self, position: Joints, model: ArmModel) -> None:
        self._model = model
        self._planned = position
        self._lagged = position
        self._time = 0.0
        self._delay = model.delay
        self._past = deque([(0.0, position)])
        self._lags: tuple[float, ...] = ()  # of the joints, where they are not all that of the model [s]
        self.target_delay = model.delay
        self.position = position

    def rest_at(self, position: Joints) -> None:
        """Stand at a position [rad], (7,), whatever motion it was following."""
        self._planned = self._lagged = self.position = position
        self._past = deque([(self._time, position)])

    def tune(self, gains: Mapping[int, float]) -> None:
        """Follow with other gains of position control, 1 being the usual one, by index of the joint."""
        lag = self._model.lag
        self._lags = tuple(lag / gains.get(index, 1.0) for index in range(len(self.position))) if gains else ()

    def advance(self, planned: Joints, dt: float) -> None:
        """Follow the plan in a straight line to ``planned`` [rad] for ``dt`` [s] > 0."""
        lag, left = self._model.lag, exp(-dt / self._model.lag) if self._model.lag > 0.0 else 0.0
        ramp = lag / dt
        # The lag's exact answer to a ramp from the last plan to this one, per joint:
        # u - a·τ + (y - u_before + a·τ)·e^(-dt/τ) with the slope a = (u - u_before)/dt. Of an arm that stands, u.
        if self._lags and not planned == self._planned == self._lagged:
            tuned = []
            for now, before, lagged, own in zip(planned, self._planned, self._lagged, self._lags, strict=True):
                behind = (now - before) * own / dt
                tuned.append(now - behind + (lagged - before + behind) * (exp(-dt / own) if own > 0.0 else 0.0))
            self._lagged = cast("Joints", tuple(tuned))
        elif not planned == self._planned == self._lagged:
            answer = [
                now - (now - before) * ramp + (lagged - before + (now - before) * ramp) * left
                for now, before, lagged in zip(planned, self._planned, self._lagged, strict=True)
            ]
            self._lagged = cast("Joints", tuple(answer))
        self._planned = planned
        self._time += dt
        self._past.append((self._time, self._lagged))
        change = self.target_delay - self._delay
        self._delay += max(-_SLEWING * dt, min(_SLEWING * dt, change))
        # The lagged position at a time in the past, interpolated; what lies before it is forgotten.
        shown, past = self._time - self._delay, self._past
        while len(past) > 1 and past[1][0] <= shown:
            past.popleft()
        start, self.position = past[0]
        if shown > start and len(past) > 1:
            end, after = past[1]
            self.position = _between(self.position, after, (shown - start) / (end - start))


class Answer(NamedTuple):
    """What an arm under EGM reports in a cycle: its measured and its planned position [rad]."""

    measured: Joints
    planned: Joints


def follow_references(
    references: Sequence[Joints],
    start: Joints,
    model: ArmModel,
    settings: EgmSettings,
    *,
    cycle: float = CYCLE,
    speeds: Sequence[Joints] | None = None,
) -> list[Answer]:
    """How an arm follows references without anything else of a robot: what it reports and plans, cycle by cycle.

    EGM takes reference ``n`` in cycle ``n``, after the datagram of that cycle: the answer to a datagram, which arrives
    a cycle after that datagram, comes one place later.

    Args:
        references: positions [rad], one a cycle, as many joints as ``start`` has.
        start: where the arm stands [rad].
        model: its dynamics; its limits are of as many joints.
        settings: of EGM.
        cycle: [s].
        speeds: fed forward with the references [rad/s]; none without them.

    Returns:
        For each reference what the datagram of the cycle reports: the measured position, the planned position.
    """
    servo, motion = Servo(start, model), EgmMotion(start, settings, model)
    servo.target_delay = model.egm_delay(settings.level)
    answer = []
    fed = [motion.state.velocity] * len(references) if speeds is None else speeds
    for reference, velocity in zip(references, fed, strict=True):
        answer.append(Answer(servo.position, motion.state.position))
        motion.reference, motion.reference_velocity, motion.reported = reference, velocity, servo.position
        motion.advance(cycle)
        servo.advance(motion.state.position, cycle)
    return answer


@dataclass(frozen=True, slots=True)
class Overload:
    """A joint whose reference needs more than its drive can give.

    Attributes:
        joint: its index in chain order.
        torque: mean torque it would need [N m].
        limit: what the drive can give [N m].
    """

    joint: int
    torque: float
    limit: float


_USUAL_TORQUE = ArmModel().torque
_TORQUE_MEMORY = 40  # cycles after which the mean of the torque has forgotten what was before


class LoadSupervision:
    """Supervises the torque that EGM's references need of the drives.

    The real controller stops with event 50375 when a reference needs too much torque of a joint; how it measures is not
    published. Here the mean of the torque over some tens of milliseconds counts, since a reference is made of steps of
    speed, one per cycle, which the servo smooths.

    Args:
        side: the arm.
        model: its payload and the torque of its drives.
        position: where it stands [rad], (7,); the drives hold it there.
    """

    def __init__(self, side: Side, model: ArmModel, position: Joints) -> None:
        self._dynamics = ArmDynamics(side, model.payload)
        self._model = model
        self._is_strong = model.torque == _USUAL_TORQUE and (model.payload is None or model.payload.mass <= HAND.mass)
        # States whose torque has not been computed, as they cannot overload anything; what came before is forgotten.
        self._rest: deque[tuple[MotionState, float]] = deque(maxlen=_TORQUE_MEMORY)
        self._torque = self._dynamics.torque(position)

    @property
    def torque(self) -> Joints:
        """Mean torque at the joints [N m], (7,)."""
        self._catch_up()
        return self._torque

    def advance(self, state: MotionState, dt: float) -> Overload | None:
        """Follow the planned state during ``dt`` [s]; the joint that it overloads, or None.

        Motions within the limits need less than the drives of a YuMi can give (:attr:`ArmModel.torque`): their torque
        is computed only once a state beyond the limits comes.
        """
        limits = self._model.limits
        if self._is_strong and all(
            -most <= value <= most
            for value, most in (
                *zip(state.acceleration, limits.acceleration, strict=True),
                *zip(state.velocity, limits.velocity, strict=True),
            )
        ):
            self._rest.append((state, dt))
            return None
        self._catch_up()
        return self._follow(state, dt)

    def _catch_up(self) -> None:
        if len(self._rest) == _TORQUE_MEMORY:
            first, _ = self._rest[0]
            self._torque = self._dynamics.torque(first.position, first.velocity, first.acceleration)
        while self._rest:
            self._follow(*self._rest.popleft())

    def _follow(self, state: MotionState, dt: float) -> Overload | None:
        needed = self._dynamics.torque(state.position, state.velocity, state.acceleration)
        fraction = 1.0 - exp(-dt / self._model.torque_time)
        self._torque = _between(self._torque, needed, fraction)
        loads = [abs(torque) / limit for torque, limit in zip(self._torque, self._model.torque, strict=True)]
        if max(loads) <= 1.0:
            return None
        joint = loads.index(max(loads))
        return Overload(joint, abs(self._torque[joint]), self._model.torque[joint])


def _between(start: Joints, end: Joints, fraction: float) -> Joints:
    if start == end:  # as of an arm that stands
        return start
    return cast("Joints", tuple([x + (y - x) * fraction for x, y in zip(start, end, strict=True)]))


ARMS_DEPTH = 0.003
"""Parts of both arms that overlap by less do not touch: the shapes are fitted to the outsides of covers [m]."""

BODY_DEPTH = 0.030
"""The same of an arm and the body, which at home are 7 mm apart: boxes stand for its rounded covers [m]."""

_DEEPER = 0.001  # [m] parts that overlap already touch anew once they are deeper by this
_MOVED = 0.004  # [rad] of all joints together; with less, no part has moved by more than ARMS_DEPTH
_FINGERS_MOVED = 1e-4  # [m]

# Which shapes MuJoCo compares, as bits.
_OF_BODY = 4
_OF_ARM = {Side.RIGHT: 1, Side.LEFT: 2}
_OF_SHOULDER = {Side.RIGHT: 8, Side.LEFT: 16}


@cache  # a robot has one, and nothing changes it
def _contact_model(right: GripperModules, left: GripperModules) -> Any:
    """The shapes of a robot with these grippers, and which of them are compared."""
    import mujoco  # noqa: PLC0415 - what runs no virtual robot need not wait for it

    spec = mujoco.MjSpec.from_string(robot_description(grippers={Side.RIGHT: right, Side.LEFT: left}))
    for shape in spec.geoms:
        shape.contype, shape.conaffinity = _OF_BODY, 0
    for side in Side:
        shoulder = spec.body(prefixed(f"yumi_link_1_{side.value}"))
        for shape in shoulder.find_all("geom"):
            shape.contype, shape.conaffinity = (
                _OF_ARM[side],
                _OF_ARM[side.other] | _OF_SHOULDER[side.other] | _OF_BODY,
            )
        for shape in shoulder.geoms:  # bolted to the body
            shape.contype, shape.conaffinity = _OF_SHOULDER[side], 0
    return spec.compile()


class ContactDetector:
    """Sees when parts begin to touch.

    Parts that overlap from the beginning, or that were let through, may come apart: only what gets deeper touches anew.

    Args:
        grippers: the modules of each gripper.
        positions: where the arms are at first [rad], (7,) each.

    Attributes:
        free: where the arms were last before they touched anything new [rad], (7,) each.
    """

    def __init__(self, grippers: Mapping[Side, GripperModules], positions: Mapping[Side, Joints]) -> None:
        import mujoco  # noqa: PLC0415 - what runs no virtual robot need not wait for it

        self._mujoco = mujoco
        self._model = _contact_model(grippers[Side.RIGHT], grippers[Side.LEFT])
        self._data: Any = mujoco.MjData(self._model)
        self._joints = {
            side: [int(self._model.joint(name).qposadr[0]) for name in (*joint_names(side), *finger_names(side))]
            for side in Side
        }
        roots = {self._model.body(prefixed(f"yumi_link_1_{side.value}")).id: side for side in Side}
        self._side_of = [roots.get(root) for root in self._model.body_rootid[self._model.geom_bodyid].tolist()]
        self.free = dict(positions)
        self._fingers = dict.fromkeys(Side, 0.0)
        self._allowed = self._overlaps(positions, self._fingers)

    def touched(
        self, positions: Mapping[Side, Joints], fingers: Mapping[Side, float], supervised: Collection[Side]
    ) -> Mapping[Side, str]:
        """What the arms touch, by the arm that has moved there; to be asked in every cycle.

        Args:
            positions: of both arms [rad], (7,) each.
            fingers: of each gripper, from its middle [m].
            supervised: the arms that notice when they touch something; others are let through.
        """
        changes = {
            side: sum(abs(now - before) for now, before in zip(positions[side], self.free[side], strict=True))
            for side in Side
        }
        if sum(changes.values()) < _MOVED:
            return {}
        if any(abs(fingers[side] - self._fingers[side]) > _FINGERS_MOVED for side in Side):
            # They have opened into something while the arms stood: that is no motion of the arms.
            self._fingers, self._allowed = dict(fingers), self._overlaps(self.free, fingers)
        allowed, touched = dict[tuple[int, int], float](), dict[Side, str]()
        for pair, depth in self._overlaps(positions, fingers).items():
            sides = [side for side in map(self._side_of.__getitem__, pair) if side is not None]
            moved = [side for side in sides if changes[side] > 0.0 and side in supervised]
            allowed[pair] = min(depth, self._allowed.get(pair, depth)) if moved else depth
            if moved and depth > self._allowed.get(pair, 0.0) + _DEEPER:
                met = {side: f"the {side.other.word} arm" if len(sides) > 1 else "the robot's body" for side in moved}
                touched.update(met)
        if not touched:
            self.free, self._allowed = dict(positions), allowed
        return touched

    def _overlaps(
        self, positions: Mapping[Side, Joints], fingers: Mapping[Side, float]
    ) -> dict[tuple[int, int], float]:
        """Of shapes that overlap by more than those of two that touch may, by how much [m]."""
        for side, places in self._joints.items():
            self._data.qpos[places] = (*positions[side], fingers[side], fingers[side])
        self._mujoco.mj_kinematics(self._model, self._data)
        self._mujoco.mj_collision(self._model, self._data)
        found, depths = self._data.contact, dict[tuple[int, int], float]()
        for (one, other), distance in zip(found.geom.tolist(), found.dist.tolist(), strict=True):
            is_body = self._side_of[one] is None or self._side_of[other] is None
            if distance < -(BODY_DEPTH if is_body else ARMS_DEPTH):
                depths[one, other] = max(-distance, depths.get((one, other), 0.0))
        return depths
