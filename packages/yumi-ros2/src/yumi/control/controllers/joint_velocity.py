"""The joint velocity controller: takes speeds, and stops when no more come.

Speeds are ramped and sent as by :mod:`yumi.control.controllers.forward_command`.
"""

from __future__ import annotations

from math import inf

from abb_protocols.robot.joints import YUMI_LIMITS, ZERO_JOINTS, ArmCommand, ArmState, JointLimits, Joints
from abb_runtime.parameters import Parameter, Values, number
from yumi.control.controller import CONTROLLER_IDLE_TIME, Controller
from yumi.control.goals import GoalBuffer, GoalInbox, GoalKind
from yumi.control.motion.speed_motion import SpeedMotion
from yumi.control.place import Place
from yumi.control.speed_scale import SpeedScale


class JointVelocityController(Controller):
    """Takes speeds for all joints of an arm from a buffer.

    Args:
        speeds: where they arrive, see :func:`yumi.control.goals.write_speeds`.
        limits: what the joints may do.
        speed: the factor on their speeds.
    """

    kind = "yumi_controllers/JointVelocityController"
    goal_kind = GoalKind.VELOCITY

    def __init__(self, speeds: GoalBuffer, limits: JointLimits = YUMI_LIMITS, speed: SpeedScale | None = None) -> None:
        self._speed = speed or SpeedScale()
        self._inbox = GoalInbox(speeds)
        self._motion = SpeedMotion(limits)
        self._wanted: Joints = ZERO_JOINTS
        self._given_at = -inf
        self._timeout = inf
        self._is_active = self._is_ended = False

    @classmethod
    def make(cls, place: Place) -> JointVelocityController:
        return cls(place.buffers.speeds, place.limits, place.speed)

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        return (Parameter("timeout", 0.1, 0.01, 2.0, "s", "Without a new speed for so long, the arm stops."),)

    def configure(self, values: Values) -> None:
        self._timeout = number(values, "timeout")

    def command_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(f"{name}/{kind}" for name in joint_names for kind in ("position", "velocity"))

    def activate(self, state: ArmState) -> None:
        self._inbox.forget()
        self._wanted, self._given_at = ZERO_JOINTS, -inf
        self._motion.begin(state)
        self._is_active, self._is_ended = True, False

    def deactivate(self) -> None:
        self._is_active = False

    def update(self, state: ArmState) -> ArmCommand | None:
        goal = self._inbox.take(state.session, state.time)
        if goal is not None:
            self._wanted, self._given_at = goal.velocity, goal.time
        is_silent = self._is_ended or state.time - self._given_at > self._timeout
        return self._motion.follow(state, ZERO_JOINTS if is_silent else self._wanted, self._speed.value, self.sent)

    def end_stream(self, state: ArmState) -> bool:
        self._is_ended = True
        return True

    def note_withheld(self, position: Joints) -> None:
        self._motion.give_up(position)

    def is_idle(self, now: float) -> bool:
        return now - self._given_at > CONTROLLER_IDLE_TIME

    @property
    def reference(self) -> Joints | None:
        return self._motion.position if self._is_active else None
