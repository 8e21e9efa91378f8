"""The controllers that take joint positions or speeds as they come, and the one that passes the joints' state on.

:class:`JointPositionController` is the thesis's PID on the measured position. By default it commands
``measured + PID(goal - measured)``, with the parameters of ros2_control's ``control_toolbox``. With the robot's own
loop behind it the arm approaches the goal as a first-order lag of 1 / (5 s⁻¹ · P) (reference/egm.md §6.1).

With ``tracking.feed_forward`` it follows a stream of goals almost without lag. They are taken for samples of a motion:
where it will be when the robot gets there, ``tracking.delay`` from now, is predicted from the goals and their times,
followed within the joints' limits (:mod:`yumi.control.motion`), and sent to the robot together with its speed. The
robot's own loop, whose lag the PID controller cannot remove, then has nothing left to close.

:class:`ForwardCommandController` and its two kinds take positions or speeds by index, :class:`JointVelocityController`
takes speeds and stops when no more come. Speeds are ramped within the joints' limits and sent to the robot together
with positions that move along, so that they work with PosCorrGain 0 as with 1. :class:`JointStateBroadcaster` commands
nothing.
"""

from __future__ import annotations

from math import inf

from yumi.control.controller import (
    IDLE,
    Buffer,
    Controller,
    Goal,
    GoalBuffer,
    GoalInbox,
    GoalKind,
    Sampled,
    check_joints,
)
from yumi.control.motion import (
    DELAY,
    SpeedMotion,
    TargetPredictor,
    TrackingFilter,
    fixed,
    speeds_without_noise,
)
from yumi.control.shared_state import JointStates
from yumi.control.speed_scale import SpeedScale
from yumi.robot.joints import JOINT_COUNT, YUMI_LIMITS, ZERO, ArmCommand, ArmState, JointLimits, Joints, joints
from yumi.settings import Parameter, Values, flag, number, text

_NO_SPEED = 1e-6  # [rad/s] not worth feeding forward

_PID = (
    Parameter("p", 1.2, 0.0, 2.0, "", "Proportional gain; oscillation begins near 2."),
    Parameter("i", 0.0, 0.0, 10.0, "1/s", "Integral gain."),
    Parameter("d", 0.0, 0.0, 0.5, "s", "Derivative gain, on the measured speed."),
    Parameter("i_clamp_max", 0.1, 0.0, 1.0, "rad", "Highest share of the integral in the command."),
    Parameter("i_clamp_min", -0.1, -1.0, 0.0, "rad", "Lowest share of the integral in the command."),
)
_TRACKING = (
    Parameter(
        "tracking.feed_forward",
        default=False,
        description="Follow a stream of goals with prediction and speed references instead of the PID controller.",
    ),
    Parameter("tracking.delay", DELAY, 0.0, 0.2, "s", "From a command to the motion it makes; how far to predict."),
    Parameter("tracking.memory", 0.030, 0.005, 0.5, "s", "How long a goal counts; more against noise."),
    Parameter("tracking.stiffness", 40.0, 5.0, 100.0, "1/s", "How closely it is followed; less against noise."),
    Parameter("tracking.silence", 0.030, 0.010, 0.5, "s", "Without a goal for so long, the stream has ended."),
)


class JointPositionController(Controller):
    """Takes goals for all joints of an arm from a buffer.

    Args:
        goals: where goals arrive, see :mod:`yumi.control.controller`.
        limits: what the joints may do while they follow a stream.
        speed: the factor on their speeds.
    """

    kind = "yumi_controllers/JointPositionController"
    goal_kind = GoalKind.POSITION

    def __init__(self, goals: GoalBuffer, limits: JointLimits = YUMI_LIMITS, speed: SpeedScale | None = None) -> None:
        self._speed = speed or SpeedScale()
        self._inbox = GoalInbox(goals)
        self._joint_names: tuple[str, ...] = ()
        self._goal: Joints | None = None
        self._given_at = -inf
        self._p = self._i = self._d = ZERO
        self._i_clamp = (0.0, 0.0)
        self._is_proportional = True
        self._integrals = [0.0] * JOINT_COUNT
        self._predictor, self._filter = TargetPredictor(limits), TrackingFilter(limits)
        self._delay = DELAY
        self._feeds_forward = self._is_tracking = False

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        self._joint_names = joint_names
        own = [
            Parameter(f"gains.{name}.{gain.name}", -1.0, -1.0, gain.highest, gain.unit, description)
            for name in joint_names
            for gain in _PID[:3]
            for description in (f"{gain.name} of this joint; -1 takes {gain.name} of all joints.",)
        ]
        return (*_PID, *own, *_TRACKING)

    def configure(self, values: Values) -> None:
        self._p, self._i, self._d = (self._gains_of(values, gain) for gain in "pid")
        self._i_clamp = (number(values, "i_clamp_min"), number(values, "i_clamp_max"))
        self._is_proportional = not any(self._i) and not any(self._d)
        if not any(self._i):
            self._integrals = [0.0] * JOINT_COUNT
        self._feeds_forward = flag(values, "tracking.feed_forward")
        self._delay = number(values, "tracking.delay")
        self._predictor.memory = number(values, "tracking.memory")
        self._predictor.timeout = number(values, "tracking.silence")
        self._filter.stiffness = number(values, "tracking.stiffness")

    def _gains_of(self, values: Values, gain: str) -> Joints:
        """One gain of all joints; a joint with one of its own has that."""
        own = [number(values, f"gains.{name}.{gain}") for name in self._joint_names]
        common = number(values, gain)
        return joints([common if value < 0.0 else value for value in own])

    def command_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(f"{name}/{kind}" for name in joint_names for kind in ("position", "velocity"))

    def activate(self, state: ArmState) -> None:
        self._goal, self._given_at = state.position, -inf
        self._inbox.forget()
        self._integrals = [0.0] * JOINT_COUNT
        self._is_tracking = False

    def update(self, state: ArmState) -> ArmCommand | None:
        goal = self._inbox.take(state.session, state.time)
        if goal is not None:
            self._goal, self._given_at = goal.position, state.time
        if self._goal is None:
            return None
        return self._track(state, goal) if self._feeds_forward else self._control(state, self._goal)

    @property
    def sampled(self) -> Sampled | None:
        is_simple = type(self) is JointPositionController and self._is_proportional and not self._feeds_forward
        return self._inbox.sampled(self._goal, self._p) if is_simple and self._goal is not None else None

    def is_idle(self, now: float) -> bool:
        return now - self._given_at > IDLE

    @property
    def reference(self) -> Joints | None:
        return self._goal

    def _control(self, state: ArmState, goal: Joints) -> ArmCommand:
        """``p·e + ∫ i·e dt + d·de/dt``.

        The integral is kept after its gain, so that a change of the gain makes no step, and is bounded on both sides.
        The rate of the error is minus the measured speed, not differentiated: a goal that jumps gives no kick.
        """
        self._is_tracking = False
        if self._is_proportional:
            errors = zip(state.position, goal, self._p, strict=True)
            return ArmCommand(fixed([now + p * (to - now) for now, to, p in errors]))
        low, high = self._i_clamp
        rows = zip(self._integrals, self._i, goal, state.position, strict=True)
        self._integrals = [max(low, min(high, old + i * (to - now) * state.dt)) for old, i, to, now in rows]
        parts = zip(state.position, goal, state.velocity, self._p, self._integrals, self._d, strict=True)
        return ArmCommand(fixed([now + p * (to - now) + integral - d * v for now, to, v, p, integral, d in parts]))

    def _track(self, state: ArmState, goal: Goal | None) -> ArmCommand | None:
        if not self._is_tracking:  # from where the robot is, with the speed it has, to the goal there is
            self._is_tracking = True
            self._filter.begin(state.position, speeds_without_noise(state.velocity))
            self._predictor.rest_at(self._goal or state.position)
        if goal is not None:
            self._predictor.add(*goal)
        if state.dt <= 0.0:
            return None
        target = self._predictor.at(state.time, self._delay)
        position, velocity, _ = self._filter.step(target, state.dt, self._speed.value)
        return ArmCommand(position, velocity if max(map(abs, velocity)) > _NO_SPEED else ZERO)


# ---- forward commands

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

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        self._joint_names = joint_names
        kinds = (self._interface,) if self._interface else ("position", "velocity")
        return (
            Parameter("joints", joint_names, description="The arm's joints in chain order.", read_only=True),
            Parameter("interface_name", kinds[0], choices=kinds, description="What is forwarded.", read_only=True),
            _TIMEOUT,
        )

    def configure(self, values: Values) -> None:
        check_joints(values, self._joint_names, in_order=True)
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
        return self._motion.step(state, ZERO if is_silent else self._wanted, self._speed.value)

    @property
    def sampled(self) -> Sampled | None:
        is_simple = type(self) in FORWARDERS and self._forwarded == "position"
        return self._buffers["position"].sampled(self._wanted) if is_simple and self._wanted is not None else None

    def note_withheld(self, position: Joints) -> None:
        self._motion.give_up(position)

    def is_idle(self, now: float) -> bool:
        return now - self._given_at > IDLE

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


# ---- joint velocity


class JointVelocityController(Controller):
    """Takes speeds for all joints of an arm from a buffer.

    Args:
        speeds: where they arrive, see :func:`yumi.control.controller.write_speeds`.
        limits: what the joints may do.
        speed: the factor on their speeds.
    """

    kind = "yumi_controllers/JointVelocityController"
    goal_kind = GoalKind.VELOCITY

    def __init__(self, speeds: GoalBuffer, limits: JointLimits = YUMI_LIMITS, speed: SpeedScale | None = None) -> None:
        self._speed = speed or SpeedScale()
        self._inbox = GoalInbox(speeds)
        self._motion = SpeedMotion(limits)
        self._wanted: Joints = ZERO
        self._given_at = -inf
        self._timeout = inf
        self._is_active = False

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        return (Parameter("timeout", 0.1, 0.01, 2.0, "s", "Without a new speed for so long, the arm stops."),)

    def configure(self, values: Values) -> None:
        self._timeout = number(values, "timeout")

    def command_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(f"{name}/{kind}" for name in joint_names for kind in ("position", "velocity"))

    def activate(self, state: ArmState) -> None:
        self._inbox.forget()
        self._wanted, self._given_at = ZERO, -inf
        self._motion.begin(state)
        self._is_active = True

    def deactivate(self) -> None:
        self._is_active = False

    def update(self, state: ArmState) -> ArmCommand | None:
        goal = self._inbox.take(state.session, state.time)
        if goal is not None:
            self._wanted, self._given_at = goal.velocity, goal.time
        is_silent = state.time - self._given_at > self._timeout
        return self._motion.step(state, ZERO if is_silent else self._wanted, self._speed.value)

    def note_withheld(self, position: Joints) -> None:
        self._motion.give_up(position)

    def is_idle(self, now: float) -> bool:
        return now - self._given_at > IDLE

    @property
    def reference(self) -> Joints | None:
        return self._motion.position if self._is_active else None


# ---- joint state broadcaster


class JointStateBroadcaster(Controller):
    """Puts the time, the 7 positions [rad] and the 7 velocities [rad/s] of each state into a buffer.

    Args:
        states: where the states go.
    """

    kind = "joint_state_broadcaster/JointStateBroadcaster"
    is_command = False

    def __init__(self, states: Buffer[JointStates]) -> None:
        self._states = states

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        every = "all joints are published, with position and velocity"
        one = "joint_states has them, in the namespace of the arm"
        return (
            Parameter("joints", joint_names, fixed=every),
            Parameter("interfaces", ("position", "velocity"), fixed=every),
            Parameter("extra_joints", (), fixed=every),
            Parameter("map_interface_to_joint_state", (), fixed=every),
            Parameter("use_urdf_to_filter", default=True, fixed="all joints are in the robot description"),
            Parameter("use_local_topics", default=False, fixed=one),
            Parameter("publish_dynamic_joint_states", default=False, fixed=one),
            Parameter("frame_id", (), fixed="the driver sets the frame"),
        )

    def activate(self, state: ArmState) -> None:
        """Begins with the next state."""

    def update(self, state: ArmState) -> ArmCommand | None:
        self._states.write(JointStates(state.time, state.position, state.velocity))
        return None
