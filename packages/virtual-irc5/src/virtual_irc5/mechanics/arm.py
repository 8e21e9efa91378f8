"""One arm of the virtual robot: its planned motion, motors and brakes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise
from math import acos, dist, pi, sin

from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.robot.arm_kinematics import KinematicArm
from abb_protocols.robot.joints import Joints, Pose, Side, joint_names
from abb_protocols.robot.kinematics import compose_poses, tool0_to_body
from abb_protocols.robot.yumi_arms import yumi_arm
from virtual_irc5.mechanics.arm_motion import ArmModel, ArmMotion, MotionState, Standstill, braking, stopping, travel
from virtual_irc5.mechanics.egm_motion import EgmMotion, EgmMotionParameters
from virtual_irc5.mechanics.load_supervision import LoadSupervision, Overload
from virtual_irc5.mechanics.path import PathMotion
from virtual_irc5.mechanics.servo import Servo, between

_IN_POSITION = 1e-5
"""Difference of planned and measured position at which the arm counts as standing [rad]."""

ARM_STOPPED = "stopped"
"""Why an arm stands on its path: the program's execution was stopped."""

_PUSH_TIME = 0.8
"""So long does a push last: out and back [s]."""

_PUSHED_JOINT = 3  # axis 3, the elbow: its place in the chain
_WAYPOINTS = 32  # into which the path of the tool is divided to measure its length
_tool_pose = lru_cache(maxsize=8)(tool0_to_body)  # an arm that stands has the same poses in each cycle


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
        kinematics: KinematicArm | None = None,
        unit: str = "",
    ) -> None:
        self.side = side
        self.unit = unit or side.unit
        self.model = model or ArmModel()
        self.kinematics = kinematics or yumi_arm(side, self.model.limits)
        self._motors_on = False
        self._motion: ArmMotion = Standstill(position or self.kinematics.home)
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
        aside = position[_PUSHED_JOINT] + self._push * sin(pi * self._push_left / _PUSH_TIME) ** 2
        position[_PUSHED_JOINT] = max(limits.lower[_PUSHED_JOINT], min(limits.upper[_PUSHED_JOINT], aside))
        return tuple(position)

    @property
    def planned(self) -> Joints:
        """Joint positions the controller plans, chain order [rad], (7,); what EGM has integrated while EGM runs."""
        return self._motion.state.position

    def tool_pose(self, position: Joints, tool: Pose | None) -> Pose:
        """Where a tool (seen from tool0) is in the world at joint positions [rad]."""
        if self.kinematics.is_of_yumi:
            return _tool_pose(self.side, position, tool)
        tool0 = self.kinematics.tool0(position)
        return tool0 if tool is None else compose_poses(tool0, tool)

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
            abs(a - b) < _IN_POSITION for a, b in zip(self.planned, self.position, strict=True)
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
        self._push, self._push_left = by, _PUSH_TIME

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
        poses = [self.tool_pose(between(start, target, index / _WAYPOINTS), tool) for index in range(_WAYPOINTS + 1)]
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
        self.path.holds.discard(ARM_STOPPED)
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
            self.path.hold(ARM_STOPPED)
        elif not self._motion.is_finished:
            self._motion, self._is_regaining = stopping(self._motion.state, self.model), False

    def strike(self, position: Joints) -> None:
        """It meets something and stands at once, at ``position`` [rad], (7,); a path is kept."""
        if self._motion is self.path:
            self.path.halt()
        self._motion, self._is_regaining, self._push_left = Standstill(position), False, 0.0
        self._servo.rest_at(position)

    def start_egm(self, settings: EgmMotionParameters) -> None:
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
