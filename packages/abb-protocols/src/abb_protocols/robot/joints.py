"""The joints of both sides of the robot: axes in chain order, limits, home; poses, quaternions; state and command.

Chain order lists the axes from body to flange in ABB's numbers: 1, 2, 7, 3, 4, 5, 6. RAPID and EGM keep axis 7
apart: ``robax`` (EGM ``joints``) holds axes 1-6 and ``extax.eax_a`` (EGM ``externalJoints[0]``) axis 7
(reference/yumi.md §1.1, reference/egm.md §3.2).

Beside it: the states and commands of an arm, the cycle of the robot's motion control, home, and the limits: positions
from the robot's own motion configuration, speeds from ABB, accelerations and jerks ours.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from math import degrees, inf, isfinite, radians
from operator import le
from typing import TYPE_CHECKING, Literal, NamedTuple, SupportsFloat, TypeVar

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused

_T = TypeVar("_T")

CHAIN_AXES = (1, 2, 7, 3, 4, 5, 6)
JOINT_COUNT = len(CHAIN_AXES)

if TYPE_CHECKING:  # other robots' arms have other counts
    Joints = tuple[float, ...]
else:  # what msgspec reads from a message or a file is checked for the count of this one's
    Joints = tuple[(float,) * JOINT_COUNT]
"""Values of all joints of an arm in chain order; [rad] or [rad/s] unless the name says otherwise."""


class Side(Enum):
    """One arm of the robot; the value is its ROS namespace."""

    RIGHT = "r"
    LEFT = "l"

    __hash__ = object.__hash__  # each arm is one object: an enumeration's own hash costs a call at every look-up

    @property
    def other(self) -> Side:
        """The arm on the other side."""
        return Side.LEFT if self is Side.RIGHT else Side.RIGHT

    @property
    def word(self) -> str:
        """The arm in a sentence: ``right`` or ``left``."""
        return "right" if self is Side.RIGHT else "left"

    @property
    def task(self) -> str:
        """Name of the arm's RAPID task."""
        return f"T_ROB_{self.name[0]}"

    @property
    def unit(self) -> str:
        """Name of the arm's mechanical unit, EGM device and EGM configuration."""
        return f"ROB_{self.name[0]}"


def by_side(right: _T | None, left: _T | None) -> dict[Side, _T]:
    """What there is for each arm; one that has None is left out."""
    return {side: each for side, each in ((Side.RIGHT, right), (Side.LEFT, left)) if each is not None}


_prefix = ""


def set_prefix(prefix: str) -> None:
    """Put ``prefix`` before the ROS names of this process's robot: its joints and links.

    One process drives one robot, so this is set once, before any name is asked for: by
    :func:`yumi.driver.wiring.make_parts`, and in the control process.
    """
    global _prefix  # noqa: PLW0603 - names are asked for where nothing else of the settings is known
    _prefix = prefix


def prefixed(name: str) -> str:
    """The ROS name of a joint or link of this process's robot: ``name`` after the robot's prefix."""
    return _prefix + name


def joint_names(side: Side) -> tuple[str, ...]:
    """ROS names of the arm's joints in chain order, e.g. ``yumi_joint_7_r`` in third place."""
    return tuple(f"{_prefix}yumi_joint_{axis}_{side.value}" for axis in CHAIN_AXES)


def finger_names(side: Side) -> tuple[str, str]:
    """ROS names of the two finger joints of the arm's gripper."""
    return (f"{_prefix}gripper_{side.value}_joint", f"{_prefix}gripper_{side.value}_joint_m")


def joints(values: Sequence[float]) -> Joints:
    """Check the count of ``values``, those of one of this robot's arms in chain order, and fix them as a tuple."""
    if len(values) != JOINT_COUNT:
        raise ValueError(f"an arm has {JOINT_COUNT} joints, got {len(values)} values")
    return tuple(map(float, values))


def chain_from_abb(robax: Sequence[float], eax_a: float) -> Joints:
    """Chain order from RAPID's split: ``robax`` holds axes 1-6, ``eax_a`` axis 7; units are kept."""
    a1, a2, a3, a4, a5, a6 = robax
    return (a1, a2, eax_a, a3, a4, a5, a6)


def abb_from_chain(chain: Joints) -> tuple[tuple[float, float, float, float, float, float], float]:
    """RAPID's split (axes 1-6, axis 7) from chain order; units are kept."""
    a1, a2, a7, a3, a4, a5, a6 = chain
    return (a1, a2, a3, a4, a5, a6), a7


ZERO_JOINTS: Joints = (0.0,) * JOINT_COUNT

Vector = tuple[float, float, float]
"""x, y, z; [m] or [rad] as the name says."""

Quaternion = tuple[float, float, float, float]
"""A unit quaternion, w first."""


def rotate(rotation: Quaternion, vector: Vector) -> Vector:
    """``vector`` turned by ``rotation``."""
    w, x, y, z = rotation
    vx, vy, vz = vector
    tx, ty, tz = 2.0 * (y * vz - z * vy), 2.0 * (z * vx - x * vz), 2.0 * (x * vy - y * vx)
    return (
        vx + w * tx + y * tz - z * ty,
        vy + w * ty + z * tx - x * tz,
        vz + w * tz + x * ty - y * tx,
    )


@dataclass(frozen=True, slots=True)
class Pose:
    """One frame seen from another, which the name of the value gives (``tool0_to_body``).

    Attributes:
        position: x, y, z [m].
        orientation: unit quaternion w, x, y, z.
    """

    position: Vector
    orientation: Quaternion

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0, *, frame: Literal["base", "tool"] = "base") -> Pose:
        """The same pose at another place: ``pose.moved(z=0.02)`` is 20 mm higher; the orientation stays.

        Args:
            x: by how much [m].
            y: see x.
            z: see x.
            frame: along whose axes: ``"base"``, those of the frame that the pose is seen from (the robot's base, or the
                work object), or ``"tool"``, those of the frame whose pose it is.

        Raises:
            CommandRefused: a distance is not a finite number, or the frame another one.
        """
        if frame not in ("base", "tool"):
            raise CommandRefused(message("pose_moved_along_unknown_frame", frame=frame))
        if not all(isinstance(each, SupportsFloat) and isfinite(float(each)) for each in (x, y, z)):
            raise CommandRefused(message("pose_moved_by_no_numbers", by=(str(x), str(y), str(z))))
        by = (float(x), float(y), float(z))
        (px, py, pz), (dx, dy, dz) = self.position, rotate(self.orientation, by) if frame == "tool" else by
        return replace(self, position=(px + dx, py + dy, pz + dz))


ORIGIN_POSE = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
"""A frame that lies on another one, as tool0 does on the flange, and wobj0 on the world."""


class ArmState(NamedTuple):
    """One arm as the robot reported it in one datagram; a tuple, which is made in half the time of a frozen class.

    Attributes:
        time: when the datagram arrived, on the machine's monotonic clock [s].
        dt: robot time since the state before, 0 for the first of a session [s].
        session: counts EGM sessions from 1; a change means that the robot started anew.
        position: measured joint positions, chain order [rad], (7,).
        velocity: measured joint velocities, chain order [rad/s], (7,).
        planned: joint positions the controller is heading for, chain order [rad], (7,).
        is_running: whether the robot follows our commands: motors on, RAPID running, EGM running.
    """

    time: float
    dt: float
    session: int
    position: Joints
    velocity: Joints
    planned: Joints
    is_running: bool


class ArmCommand(NamedTuple):
    """The references in one datagram to an arm.

    Attributes:
        position: joint positions to reach, chain order [rad], (7,).
        velocity: joint velocities fed forward, chain order [rad/s], (7,).
    """

    position: Joints
    velocity: Joints = ZERO_JOINTS


CYCLE = 0.004032
"""Period of the motion control of a real controller [s] (reference/egm.md §2.5)."""


def home(side: Side) -> Joints:
    """The calibration pose (``cal_position`` of the controller): both arms folded in front of the body [rad]."""
    axis_7_deg = -135.0 if side is Side.RIGHT else 135.0
    return joints([radians(angle_deg) for angle_deg in (0.0, -130.0, axis_7_deg, 30.0, 0.0, 40.0, 0.0)])


def _ready(side: Side) -> Joints:
    """Both arms lifted from home and turned outwards, so that neither is in the other's way [rad]."""
    sign = 1.0 if side is Side.RIGHT else -1.0
    return joints([radians(angle_deg) for angle_deg in (sign * 20.0, -110.0, sign * -135.0, 30.0, 0.0, 40.0, 0.0)])


POSES: Mapping[str, Callable[[Side], Joints]] = {"home": home, "calibration": home, "ready": _ready}
"""Poses by name. ABB's calibration pose is where the arms are at home."""


def named_pose(side: Side, name: str) -> Joints:
    """A pose of :data:`POSES` [rad].

    Raises:
        CommandRefused: there is none of this name.
    """
    if name not in POSES:
        raise CommandRefused(message("pose_name_unknown", name=name, poses=tuple(POSES)))
    return POSES[name](side)


@dataclass(frozen=True, slots=True)
class JointLimits:
    """The limits of the joints of one arm, in chain order.

    Attributes:
        lower: lowest positions [rad], (7,).
        upper: highest positions [rad], (7,).
        velocity: highest speeds [rad/s], (7,).
        acceleration: highest accelerations of a command [rad/s²], (7,).
        jerk: highest jerks of a command [rad/s³], (7,).
    """

    lower: Joints
    upper: Joints
    velocity: Joints
    acceleration: Joints
    jerk: Joints

    @classmethod
    def unlimited(cls, count: int) -> JointLimits:
        """Those of so many joints of which none are known."""
        most = (inf,) * count
        return cls((-inf,) * count, most, most, most, most)

    def slowed_to(self, speed: float) -> JointLimits:
        """The same joints none faster than ``speed`` [rad/s], as EGM's MaxSpeedDeviation limits them."""
        return replace(self, velocity=joints([min(top, speed) for top in self.velocity]))

    def slower(self, speed: float = 1.0, acceleration: float = 1.0, top_speed: float = inf) -> JointLimits:
        """The limits for a gentler motion.

        Args:
            speed: factor on the speeds, above 0 up to 1.
            acceleration: factor on accelerations and jerks, above 0 up to 1.
            top_speed: no joint is faster than ``speed`` times this [rad/s].
        """
        return replace(
            self,
            velocity=tuple([speed * min(each, top_speed) for each in self.velocity]),
            acceleration=tuple([acceleration * each for each in self.acceleration]),
            jerk=tuple([acceleration * each for each in self.jerk]),
        )

    def outside(self, position: Joints) -> int | None:
        """Index of the first joint whose position [rad] is out of range (or not a number), or None."""
        if all(map(le, self.lower, position)) and all(map(le, position, self.upper)):  # asked in every cycle
            return None
        for index, value in enumerate(position):
            if not self.lower[index] <= value <= self.upper[index]:
                return index
        return None

    def range_deg(self, index: int) -> str:
        """The joint's range for a sentence, e.g. ``-143.5° to 43.5°``."""
        return f"{degrees(self.lower[index]):.1f}° to {degrees(self.upper[index]):.1f}°"


# Positions: MOC.cfg of three real robots, equal for both arms (reference/yumi.md §1.2); speeds: ABB's specification.
# ABB publishes no accelerations of joints, only 11 m/s² at the tool. Ours give about that at half a metre with one
# large joint, and the drives' torque (ArmModel.torque) suffices for all joints at once, at full speed, in any pose,
# with 0.5 kg in the gripper. The jerks build that up in 67 ms, over the period of what bends in the arm.
YUMI_LIMITS = JointLimits(
    lower=(-2.94088, -2.50455, -2.94088, -2.15548, -5.06145, -1.53589, -3.9968),
    upper=(2.94088, 0.759218, 2.94088, 1.39626, 5.06145, 2.40855, 3.9968),
    velocity=joints([radians(speed_deg) for speed_deg in (180, 180, 180, 180, 400, 400, 400)]),
    acceleration=(20.0, 20.0, 20.0, 20.0, 40.0, 40.0, 40.0),
    jerk=(300.0, 300.0, 300.0, 300.0, 600.0, 600.0, 600.0),
)
