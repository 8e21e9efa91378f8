"""Catches up with a moving target and stays with it, within the joints' velocity, acceleration and jerk.

Near the target the difference to it dies away as a critically damped filter of third order would have it, which lets
noise of the target through only far below its corner. A joint that this would ask too much of is brought to the target
as fast as its limits allow, by the online trajectory generator Ruckig, as seen by someone who moves with the target.
"""

from __future__ import annotations

from math import exp

from ruckig import InputParameter, OutputParameter, Ruckig

from yumi.control.forecast import Target
from yumi.control.online_step import take_step
from yumi.robot.joints import Joints, joints
from yumi.robot.limits import JointLimits
from yumi.robot.values import ZERO

_SHARE = 0.95  # of the limits, since the guard looks at differences from cycle to cycle
_PACE = 0.9  # a target that moves nearly as fast as the joint cannot be caught up with
_NEAR = 3e-4  # a chase ends when the filter would go no further than this past the target [rad]


class _Joint:
    """One joint on its way.

    Args:
        velocity, acceleration, jerk: its limits, in [rad] and [s].
    """

    __slots__ = ("_is_chasing", "_limits", "_tools", "acceleration", "position", "velocity")

    def __init__(self, velocity: float, acceleration: float, jerk: float) -> None:
        self._limits = (_SHARE * velocity, _SHARE * acceleration, _SHARE * jerk)
        self._tools: tuple[Ruckig, InputParameter, OutputParameter] | None = None
        self.begin(0.0, 0.0)

    def begin(self, position: float, velocity: float) -> None:
        self.position, self.velocity, self.acceleration = position, velocity, 0.0
        self._is_chasing = False

    def step(self, target: float, speed: float, gain: float, dt: float, stiffness: float, scale: float) -> None:
        """Go on for ``dt`` [s], at whose end the target is at ``target`` [rad] with ``speed`` and acceleration."""
        w = stiffness
        behind = self.position - (target - dt * (speed - 0.5 * dt * gain))
        slower = self.velocity - (speed - dt * gain)
        weaker = self.acceleration - gain
        if self._is_chasing and max(abs(behind), abs(slower) / w, abs(weaker) / (w * w)) > _NEAR:
            self._chase(target, speed, gain, dt, scale)
            return
        # The difference is (a + b·t + c·t²)·exp(-w·t).
        b, c = slower + w * behind, 0.5 * (weaker + w * (2.0 * slower + w * behind))
        left, value, slope = exp(-w * dt), behind + dt * (b + dt * c), b + 2.0 * c * dt
        velocity = speed + (slope - w * value) * left
        acceleration = gain + (2.0 * c - 2.0 * w * slope + w * w * value) * left
        top, strength, jerk = self._limits
        if (
            abs(velocity) > scale * top
            or abs(acceleration) > strength
            or abs(acceleration - self.acceleration) > jerk * dt
        ):
            self._chase(target, speed, gain, dt, scale)
            return
        self._is_chasing = False
        self.position, self.velocity, self.acceleration = target + value * left, velocity, acceleration

    def _chase(self, target: float, speed: float, gain: float, dt: float, scale: float) -> None:
        """As seen by someone who moves with the target, as long as the joint is stronger than the target."""
        self._is_chasing = True
        top, strength = scale * self._limits[0], self._limits[1]
        speed = speed if abs(speed) < _PACE * top else 0.0
        gain = gain if abs(gain) < _PACE * strength else 0.0
        generator, given, output = self._generator()
        given.current_position = [self.position - (target - dt * (speed - 0.5 * dt * gain))]
        given.current_velocity = [self.velocity - (speed - dt * gain)]
        given.current_acceleration = [self.acceleration - gain]
        given.max_velocity, given.min_velocity = [top - speed], [-top - speed]
        given.max_acceleration, given.min_acceleration = [strength - gain], [-strength - gain]
        if not take_step(generator, given, output, dt):
            self.begin(self.position, 0.0)
            return
        self.position = target + output.new_position[0]
        self.velocity = speed + output.new_velocity[0]
        self.acceleration = gain + output.new_acceleration[0]

    def end(self) -> None:
        """Give the generator back; it is made again when it is needed."""
        self._tools = None

    def _generator(self) -> tuple[Ruckig, InputParameter, OutputParameter]:
        if self._tools is None:
            given = InputParameter(1)
            given.max_jerk, given.target_position = [self._limits[2]], [0.0]
            self._tools = (Ruckig(1, 0.004), given, OutputParameter(1))
        return self._tools


class Pursuit:
    """The joints of one arm after a target.

    Args:
        limits: what the joints may do.

    Attributes:
        stiffness: corner of the filter [rad/s]; larger follows more closely and lets more noise through.
    """

    def __init__(self, limits: JointLimits) -> None:
        self.stiffness = 40.0
        self._joints = tuple(
            _Joint(*each) for each in zip(limits.velocity, limits.acceleration, limits.jerk, strict=True)
        )

    def begin(self, position: Joints, velocity: Joints = ZERO) -> None:
        """Begin again, at ``position`` [rad] with ``velocity`` [rad/s], (7,)."""
        for joint, place, speed in zip(self._joints, position, velocity, strict=True):
            joint.begin(place, speed)

    def end(self) -> None:
        """Give back what the generator holds outside of Python; :meth:`begin` goes on."""
        for joint in self._joints:
            joint.end()

    def step(self, target: Target, dt: float, scale: float = 1.0) -> Target:
        """Go on for ``dt`` [s] > 0, with at most ``scale`` times the joints' speeds; where the joints are then."""
        stiffness = self.stiffness
        for joint, position, speed, gain in zip(self._joints, *target, strict=True):
            joint.step(position, speed, gain, dt, stiffness, scale)
        return Target(
            joints([joint.position for joint in self._joints]),
            joints([joint.velocity for joint in self._joints]),
            joints([joint.acceleration for joint in self._joints]),
        )
