"""One arm of the virtual robot: a planned motion, a servo that follows it, motors and brakes."""

from __future__ import annotations

from itertools import pairwise
from math import acos, dist

from yumi.errors import CommandRefused, RobotNotReady
from yumi.robot.joints import Joints, Side, joint_names
from yumi.robot.kinematics import tool0_to_body
from yumi.robot.poses import home
from yumi.robot.values import ZERO, Pose
from yumi.virtual.arm_load import LoadSupervision, Overload
from yumi.virtual.arm_model import ArmModel
from yumi.virtual.arm_motion import Motion, MotionState, Standstill, braking, stopping, travel
from yumi.virtual.arm_servo import Servo
from yumi.virtual.egm_motion import EgmMotion
from yumi.virtual.egm_settings import EgmSettings

IN_POSITION = 1e-5
"""Difference of planned and measured position at which the arm counts as standing [rad]."""

_WAYPOINTS = 32  # how finely the length of the tool's way is measured


class VirtualArm:
    """One arm, motors off at first.

    Args:
        side: the arm.
        position: where it stands [rad], (7,), chain order; home when left out.
        model: its dynamics.

    Attributes:
        overload: the joint of which EGM has asked too much since it began; None as long as the load is bearable.
    """

    def __init__(self, side: Side, position: Joints | None = None, model: ArmModel | None = None) -> None:
        self.side = side
        self.model = model or ArmModel()
        self._motors_on = False
        self._motion: Motion = Standstill(position or home(side))
        self._servo = Servo(self.planned, self.model)
        self._load: LoadSupervision | None = None
        self.overload: Overload | None = None

    @property
    def position(self) -> Joints:
        """Measured joint positions, chain order [rad], (7,)."""
        return self._servo.position

    @property
    def planned(self) -> Joints:
        """Joint positions the controller plans, chain order [rad], (7,); EGM's reference while EGM guides."""
        return self._motion.state.position

    @property
    def velocity(self) -> Joints:
        """Planned joint speeds, chain order [rad/s], (7,)."""
        return self._motion.state.velocity

    @property
    def motors_on(self) -> bool:
        return self._motors_on

    @property
    def reaction_time(self) -> float:
        """How much later than planned the arm is where it was planned to be [s]."""
        return self._servo.wanted_delay + self.model.lag

    @property
    def is_stationary(self) -> bool:
        """Whether no motion is under way and the arm has settled (a RAPID fine point)."""
        return self._motion.is_finished and all(
            abs(a - b) < IN_POSITION for a, b in zip(self.planned, self.position, strict=True)
        )

    @property
    def egm(self) -> EgmMotion | None:
        """The motion EGM guides, or None."""
        return self._motion if isinstance(self._motion, EgmMotion) else None

    def advance(self, dt: float) -> None:
        """Let ``dt`` [s] pass; any length, the arm divides it into its own steps."""
        steps = max(1, -int(-dt // self.model.step)) if dt > 0.0 else 0
        for _ in range(steps):
            self._motion.advance(dt / steps)
            self._servo.advance(self.planned, dt / steps)
            self._supervise_load(dt / steps)

    def switch_motors_on(self) -> None:
        self._motors_on = True

    def switch_motors_off(self) -> None:
        """The brakes stop the arm, whatever it was doing, and hold it."""
        self._motors_on = False
        if not self._motion.is_finished:
            self._motion = braking(self._motion.state, self.model)

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
            RobotNotReady: the motors are off, or EGM guides the arm.
        """
        self._check_ready()
        self._check_range(target)
        if self._motion.is_finished and target == self.planned and duration <= 0.0:
            return  # there already: a program that says so in a loop must not cost a plan each time
        length, turn = self._tool_way(target, tool)
        shortest = max(duration, length / tool_speed, turn / turn_speed)
        self._motion = travel(self._motion.state, target, self.model, shortest)

    def stop(self) -> None:
        """Decelerate any motion to standstill as fast as the drives allow, and hold."""
        if not self._motion.is_finished:
            self._motion = stopping(self._motion.state, self.model)

    def start_egm(self, settings: EgmSettings) -> None:
        """Let EGM guide the arm from where it is planned to be.

        Raises:
            RobotNotReady: the motors are off, or EGM guides the arm already.
        """
        self._check_ready()
        extra = self.model.filtering_delay if settings.level > 0 else 0.0
        self._servo.wanted_delay = self.model.delay + extra
        self._motion = EgmMotion(self.planned, settings, self.model.limits)
        self.overload = None
        if self.model.supervises_load:
            self._load = LoadSupervision(self.side, self.model, self.planned)

    def set_reference(self, position: Joints | None, velocity: Joints | None) -> None:
        """Order what EGM shall reach: None keeps the last position, and means no speed [rad], [rad/s], (7,).

        Raises:
            RobotNotReady: EGM does not guide the arm.
        """
        egm = self.egm
        if egm is None:
            raise RobotNotReady(f"EGM does not guide the {self.side.word} arm: start EGM first.")
        if position is not None:
            egm.reference = position
        egm.reference_velocity = ZERO if velocity is None else velocity

    def stop_egm(self, ramp_time: float = 0.0, *, returns_to_start: bool = False) -> None:
        """End EGM: come to a stop over ``ramp_time`` [s] and hold, or go back to where EGM started.

        The way back takes longer than ``ramp_time`` where the arm's limits ask for it, as on the real
        controller (event 50446).
        """
        egm = self.egm
        if egm is None:
            return
        # Without EGM's acceleration, which is that of single steps of speed.
        state = MotionState(egm.state.position, egm.state.velocity)
        if returns_to_start:
            self._motion = travel(state, egm.start, self.model, ramp_time)
        else:
            self._motion = stopping(state, self.model, ramp_time)

    def _supervise_load(self, dt: float) -> None:
        """Only references from outside are supervised: the controller plans its own motions within the limits."""
        egm = self.egm
        if egm is not None and self._load is not None and self.overload is None:
            self.overload = self._load.advance(egm.state, dt)

    def _check_ready(self) -> None:
        if not self._motors_on:
            raise RobotNotReady(f"The motors of the {self.side.word} arm are off: switch them on first.")
        if self.egm is not None:
            raise RobotNotReady(f"EGM guides the {self.side.word} arm: end EGM before other motions (50453).")

    def _check_range(self, target: Joints) -> None:
        index = self.model.limits.outside(target)
        if index is not None:
            name, range_deg = joint_names(self.side)[index], self.model.limits.range_deg(index)
            raise CommandRefused(f"{name} cannot move to {target[index]:.4f} rad: its range is {range_deg} (50027).")

    def _tool_way(self, target: Joints, tool: Pose | None) -> tuple[float, float]:
        """Length [m] and turn [rad] of the tool's way when all joints move in proportion."""
        start = self.planned
        poses = [
            tool0_to_body(self.side, _between(start, target, index / _WAYPOINTS), tool)
            for index in range(_WAYPOINTS + 1)
        ]
        pairs = list(pairwise(poses))
        length = sum(dist(a.position, b.position) for a, b in pairs)
        return length, sum(_angle(a, b) for a, b in pairs)


def _between(start: Joints, target: Joints, share: float) -> Joints:
    a, b, c, d, e, f, g = (x + (y - x) * share for x, y in zip(start, target, strict=True))
    return (a, b, c, d, e, f, g)


def _angle(a: Pose, b: Pose) -> float:
    product = abs(sum(x * y for x, y in zip(a.orientation, b.orientation, strict=True)))
    return 2.0 * acos(min(1.0, product))
