"""The joint position controller: follows a stream of joint positions.

It is the thesis's PID on the measured position. By default it commands
``measured + PID(goal - measured)``, with the parameters of ros2_control's ``control_toolbox``. With the robot's own
loop behind it the arm approaches the goal as a first-order lag of 1 / (5 s⁻¹ · P) (reference/egm.md §6.1).

With ``tracking.feed_forward`` it follows a stream of goals almost without lag. They are taken for samples of a motion:
where it will be when the robot gets there, ``tracking.delay`` from now, is predicted from the goals and their times,
followed within the joints' limits (:mod:`yumi.control.motion.tracking_filter`), and sent to the robot together with its
speed. The robot's own loop, whose lag the PID controller cannot remove, then has nothing left to close.
"""

from __future__ import annotations

from math import inf

from yumi.control.controller import IDLE, Controller
from yumi.control.goals import Goal, GoalBuffer, GoalInbox, GoalKind
from yumi.control.motion.robot_response import DELAY
from yumi.control.motion.setpoint import fixed
from yumi.control.motion.speed_motion import speeds_without_noise
from yumi.control.motion.target_predictor import TargetPredictor
from yumi.control.motion.tracking_filter import TrackingFilter
from yumi.control.sampled import Sampled
from yumi.control.speed_scale import SpeedScale
from yumi.robot.joints import JOINT_COUNT, YUMI_LIMITS, ZERO, ArmCommand, ArmState, JointLimits, Joints, joints
from yumi.settings import Parameter, Values, flag, number

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
        goals: where goals arrive, see :mod:`yumi.control.goals`.
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
