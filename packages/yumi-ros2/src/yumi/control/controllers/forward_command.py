"""The forward command controllers: take positions or speeds by index, as they come.

Speeds are ramped within the joints' limits and sent to the robot together with positions that move along, so that they
work with PosCorrGain 0 as with 1.
"""

from __future__ import annotations

from math import inf

from abb_protocols.robot.joints import YUMI_LIMITS, ZERO_JOINTS, ArmCommand, ArmState, JointLimits, Joints
from abb_runtime.parameters import Parameter, Values, number, text
from yumi.control.controller import CONTROLLER_IDLE_TIME, Controller, check_controller_joints
from yumi.control.goals import GoalBuffer, GoalInbox, GoalKind
from yumi.control.motion.speed_motion import SpeedMotion
from yumi.control.place import Place
from yumi.control.sampled import Sampled
from yumi.control.speed_scale import SpeedScale

_TIMEOUT = Parameter(
    "timeout", 0.5, 0.0, 10.0, "s", "Without a new speed for so long, the arm stops; 0 lets it go on for ever."
)


class ForwardCommandController(Controller):
    """Forwards what arrives for all joints of an arm, as it is; the limiter keeps it within what the arm can do.

    Where it differs from upstream (reference/ros2_control.md §3.3), on purpose:

    - an array of the wrong length is refused with a sentence, where upstream the controller fails and is deactivated;
    - a position out of its range is refused, as everywhere else;
    - speeds that are not confirmed end after ``timeout``, where upstream they go on for ever; 0 switches this off;
    - ``joints`` has to be all joints of the arm in chain order, since ranges are checked where the message arrives;
    - speeds claim the positions, too: the robot gets positions that move along.

    Args:
        positions: where positions arrive.
        speeds: where speeds arrive.
        limits: what the joints may do.
        speed: the factor on their speeds.
    """

    kind = "forward_command_controller/ForwardCommandController"
    _interface: str | None = None

    def __init__(
        self,
        positions: GoalBuffer,
        speeds: GoalBuffer,
        limits: JointLimits = YUMI_LIMITS,
        speed: SpeedScale | None = None,
    ) -> None:
        self._speed = speed or SpeedScale()
        self._buffers = {"position": GoalInbox(positions), "velocity": GoalInbox(speeds)}
        self._motion = SpeedMotion(limits)
        self._joint_names: tuple[str, ...] = ()
        self._timeout = 0.0
        self._forwarded = self._interface or "position"
        self._wanted: Joints | None = None
        self._given_at = -inf

    @classmethod
    def make(cls, place: Place) -> ForwardCommandController:
        return cls(place.buffers.forward_positions, place.buffers.forward_speeds, place.limits, place.speed)

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        self._joint_names = joint_names
        kinds = (self._interface,) if self._interface else ("position", "velocity")
        return (
            Parameter("joints", joint_names, description="The arm's joints in chain order.", read_only=True),
            Parameter("interface_name", kinds[0], choices=kinds, description="What is forwarded.", read_only=True),
            _TIMEOUT,
        )

    def configure(self, values: Values) -> None:
        check_controller_joints(values, self._joint_names, in_order=True)
        self._forwarded = text(values, "interface_name")
        self._timeout = number(values, "timeout")

    @property
    def goal_kind(self) -> GoalKind:  # type: ignore[override]  # a parameter decides
        return GoalKind.FORWARD_POSITION if self._forwarded == "position" else GoalKind.FORWARD_VELOCITY

    def command_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        kinds = ("position",) if self._forwarded == "position" else ("position", "velocity")
        return tuple(f"{name}/{kind}" for name in joint_names for kind in kinds)

    def activate(self, state: ArmState) -> None:
        self._buffers[self._forwarded].forget()
        self._wanted, self._given_at = None, -inf
        self._motion.begin(state)

    def update(self, state: ArmState) -> ArmCommand | None:
        """None, which holds, until the first message."""
        goal = self._buffers[self._forwarded].take(state.session, state.time)
        if self._forwarded == "position":
            if goal is not None:
                self._wanted, self._given_at = goal.position, state.time
            return None if self._wanted is None else ArmCommand(self._wanted)
        if goal is not None:
            self._wanted, self._given_at = goal.velocity, goal.time
        if self._wanted is None:
            return None
        is_silent = 0.0 < self._timeout < state.time - self._given_at
        return self._motion.follow(state, ZERO_JOINTS if is_silent else self._wanted, self._speed.value, self.sent)

    @property
    def sampled(self) -> Sampled | None:
        is_simple = type(self) in FORWARDERS and self._forwarded == "position"
        return self._buffers["position"].sampled(self._wanted) if is_simple and self._wanted is not None else None

    def note_withheld(self, position: Joints) -> None:
        self._motion.give_up(position)

    def is_idle(self, now: float) -> bool:
        return now - self._given_at > CONTROLLER_IDLE_TIME

    @property
    def reference(self) -> Joints | None:
        if self._forwarded == "position":
            return self._wanted
        return None if self._wanted is None else self._motion.position


class JointGroupPositionController(ForwardCommandController):
    """Positions by index."""

    kind = "position_controllers/JointGroupPositionController"
    _interface = "position"


class JointGroupVelocityController(ForwardCommandController):
    """Speeds by index."""

    kind = "velocity_controllers/JointGroupVelocityController"
    _interface = "velocity"


FORWARDERS = (ForwardCommandController, JointGroupPositionController, JointGroupVelocityController)
"""All types of forward command controllers."""
