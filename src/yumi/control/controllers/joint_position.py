"""The joint position controller: the thesis's PID on the measured position, or a stream followed almost without lag.

By default ``command = measured + PID(goal - measured)``; with the robot's own loop behind it the arm approaches the
goal as a first-order lag of 1 / (5 s⁻¹ · P) (reference/egm.md §6.1).

With ``tracking.feed_forward`` the goals are taken for samples of a motion: where it will be when the robot gets there,
``tracking.delay`` from now, is forecast from the goals and their times (:mod:`yumi.control.tracking`), pursued within
the joints' limits (:mod:`yumi.control.tracking`), and told to the robot together with its speed. The robot's own loop,
whose lag the law above cannot be rid of, then has nothing left to close.

A PID law for the joints of one arm, with the parameters of ros2_control's ``control_toolbox``.

``output = p·e + ∫ i·e dt + d·de/dt``. The integral is kept after its gain, so that a change of the gain makes no step,
and is bounded on both sides. The rate of the error is given, not differentiated: a goal that jumps gives no kick.
"""

from __future__ import annotations

from dataclasses import dataclass

from yumi.control.commands import Goal, GoalBuffer, GoalInbox, GoalKind
from yumi.control.controller import Controller
from yumi.control.limiter import SpeedScale
from yumi.control.tracking import GoalForecast, Pursuit
from yumi.robot.joints import JOINT_COUNT, YUMI_LIMITS, ZERO, ArmCommand, ArmState, JointLimits, Joints, joints
from yumi.settings import Parameter, Values, flag, number


@dataclass(frozen=True, slots=True)
class PidGains:
    """The gains of all joints.

    Attributes:
        p: proportional gains, (7,).
        i: integral gains [1/s], (7,).
        d: derivative gains [s], (7,).
        i_clamp_min: lowest share of the integral in the output [rad].
        i_clamp_max: highest share of it [rad].
    """

    p: Joints
    i: Joints
    d: Joints
    i_clamp_min: float = 0.0
    i_clamp_max: float = 0.0

    @property
    def is_proportional(self) -> bool:
        """Whether nothing but the error of the moment counts."""
        return not any(self.i) and not any(self.d)


class JointPid:
    """The law with its memory.

    Args:
        gains: may be replaced at any time.
    """

    def __init__(self, gains: PidGains) -> None:
        self.gains = gains
        self._integrals = [0.0] * JOINT_COUNT

    def reset(self) -> None:
        """Forget the past."""
        self._integrals = [0.0] * JOINT_COUNT

    def step(self, error: Joints, rate: Joints, dt: float) -> Joints:
        """The output [rad], (7,), for an ``error`` [rad] and its ``rate`` [rad/s] after ``dt`` [s]."""
        gains = self.gains
        low, high = gains.i_clamp_min, gains.i_clamp_max
        grown = zip(self._integrals, gains.i, error, strict=True)
        self._integrals = [max(low, min(high, old + gain * value * dt)) for old, gain, value in grown]
        parts = zip(gains.p, error, self._integrals, gains.d, rate, strict=True)
        return joints([p * value + integral + d * slope for p, value, integral, d, slope in parts])


DELAY = 0.032
"""From a command to the motion it makes, of the virtual robot at full-speed settings [s].

The servo's transport delay and lag, 16 and 10 ms, a cycle until the command is taken, and half of the cycle for which
it counts; ``yumi_evaluation.metrics`` finds it in recorded cycles."""

_NO_SPEED = 1e-6  # [rad/s] nothing worth telling the robot
_STANDING = 1e-3  # [rad/s] less than the measured speed tells

_LAW = (
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
        description="Follow a stream of goals with forecast and speed references instead of the PID law.",
    ),
    Parameter("tracking.delay", DELAY, 0.0, 0.2, "s", "From a command to the motion it makes; how far to forecast."),
    Parameter("tracking.memory", 0.030, 0.005, 0.5, "s", "How long a goal counts in the forecast; more against noise."),
    Parameter("tracking.stiffness", 40.0, 5.0, 100.0, "1/s", "How hard the forecast is pursued; less against noise."),
    Parameter("tracking.silence", 0.030, 0.010, 0.5, "s", "Without a goal for so long, the stream has ended."),
)


class JointPositionController(Controller):
    """Takes goals for all joints of an arm from a buffer.

    Args:
        goals: where goals arrive, see :mod:`yumi.control.commands`.
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
        self._pid = JointPid(PidGains(ZERO, ZERO, ZERO))
        self._forecast, self._pursuit = GoalForecast(limits), Pursuit(limits)
        self._delay = DELAY
        self._feeds_forward = self._is_pursuing = False

    def parameters(self, joint_names: tuple[str, ...]) -> tuple[Parameter, ...]:
        self._joint_names = joint_names
        own = [
            Parameter(f"gains.{name}.{gain.name}", -1.0, -1.0, gain.highest, gain.unit, f"Own {gain.name}; -1 as all.")
            for name in joint_names
            for gain in _LAW[:3]
        ]
        return (*_LAW, *own, *_TRACKING)

    def configure(self, values: Values) -> None:
        self._pid.gains = PidGains(
            p=self._gains_of(values, "p"),
            i=self._gains_of(values, "i"),
            d=self._gains_of(values, "d"),
            i_clamp_min=number(values, "i_clamp_min"),
            i_clamp_max=number(values, "i_clamp_max"),
        )
        self._feeds_forward = flag(values, "tracking.feed_forward")
        self._delay = number(values, "tracking.delay")
        self._forecast.memory = number(values, "tracking.memory")
        self._forecast.silence = number(values, "tracking.silence")
        self._pursuit.stiffness = number(values, "tracking.stiffness")

    def command_interfaces(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        return tuple(f"{name}/{kind}" for name in joint_names for kind in ("position", "velocity"))

    def activate(self, state: ArmState) -> None:
        self._goal = state.position
        self._inbox.forget()
        self._pid.reset()
        self._is_pursuing = False

    def deactivate(self) -> None:
        self._pursuit.end()

    def update(self, state: ArmState) -> ArmCommand | None:
        goal = self._inbox.take(state.session, state.time)
        if goal is not None:
            self._goal = goal.position
        if self._goal is None:
            return None
        return self._follow(state, goal) if self._feeds_forward else self._control(state, self._goal)

    @property
    def reference(self) -> Joints | None:
        return self._goal

    def _gains_of(self, values: Values, gain: str) -> Joints:
        """One gain of all joints; a joint with one of its own has that."""
        own = [number(values, f"gains.{name}.{gain}") for name in self._joint_names]
        common = number(values, gain)
        return joints([common if value < 0.0 else value for value in own])

    def _control(self, state: ArmState, goal: Joints) -> ArmCommand:
        self._is_pursuing = False
        if not self._pid.gains.is_proportional:
            return self._control_with_memory(state, goal)
        a, b, c, d, e, f, g = state.position
        ga, gb, gc, gd, ge, gf, gg = goal
        pa, pb, pc, pd, pe, pf, pg = self._pid.gains.p
        return ArmCommand(
            (
                a + pa * (ga - a),
                b + pb * (gb - b),
                c + pc * (gc - c),
                d + pd * (gd - d),
                e + pe * (ge - e),
                f + pf * (gf - f),
                g + pg * (gg - g),
            )
        )

    def _control_with_memory(self, state: ArmState, goal: Joints) -> ArmCommand:
        error = joints([wanted - now for wanted, now in zip(goal, state.position, strict=True)])
        rate = joints([-speed for speed in state.velocity])
        output = self._pid.step(error, rate, state.dt)
        return ArmCommand(joints([now + share for now, share in zip(state.position, output, strict=True)]))

    def _follow(self, state: ArmState, goal: Goal | None) -> ArmCommand | None:
        if not self._is_pursuing:
            self._begin_to_follow(state)
        if goal is not None:
            self._forecast.take(*goal)
        if state.dt <= 0.0:
            return None
        position, velocity, _ = self._pursuit.step(
            self._forecast.at(state.time, self._delay), state.dt, self._speed.value
        )
        return ArmCommand(position, velocity if max(map(abs, velocity)) > _NO_SPEED else ZERO)

    def _begin_to_follow(self, state: ArmState) -> None:
        """From where the robot plans to be, with the speed it has, to the goal there is."""
        self._is_pursuing = True
        speed = joints([value if abs(value) > _STANDING else 0.0 for value in state.velocity])
        self._pursuit.begin(state.planned, speed)
        self._forecast.rest_at(self._goal or state.position)
