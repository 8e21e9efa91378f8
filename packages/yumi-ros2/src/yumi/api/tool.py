"""The tool of an arm, as a script sees it: its gripper, and the poses, frames, postures and lines of its motions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import degrees, isfinite, nan
from typing import TYPE_CHECKING, Any, SupportsFloat

from abb_protocols.catalogue import Message, message, quoted
from abb_protocols.errors import CommandRefused, GoalNotReached, YumiError
from abb_protocols.robot.confdata import Configuration, configuration
from abb_protocols.robot.description import FINGERTIPS
from abb_protocols.robot.gripper_values import TRAVEL, Direction, GripperGoal, Outcome, go_to, grip
from abb_protocols.robot.inverse_kinematics import (
    Unreachable,
    arm_angle,
    nearest_posture,
    postures,
    postures_of_each,
    unreachable,
)
from abb_protocols.robot.joints import ORIGIN, JointLimits, Joints, Pose, Quaternion, Side
from abb_protocols.robot.kinematics import IDENTITY, compose, euler_zyx, quaternion_from_euler_zyx
from yumi.control.motion.setpoint import largest_difference
from yumi.core.collision import Obstacle
from yumi.planning.tool_path import Waypoint, checked_pose

if TYPE_CHECKING:  # yumi.pose takes no more than poses need
    from yumi.driver import gripper as driver

# ---- the gripper

PICKED_PRESSURE = 70_000.0
"""The usual pressure below which a cup holds something [Pa]."""

WIDTH_TOLERANCE = 0.003
"""By how much what is grasped may be wider or narrower than expected [m]."""


@dataclass(frozen=True, slots=True)
class Grip:
    """How a gripper command ended.

    Attributes:
        outcome: open, closed, in place, holding or stalled.
        width: distance between the fingers [m].
    """

    outcome: Outcome
    width: float


class Gripper:
    """The gripper of one arm; its motions do not disturb the arm's.

    Args:
        side: which arm carries it.
        gripper: the robot's, while it is connected; raises when it is not.
        force: holding force where a call names none [N].
        picked_pressure: a vacuum module whose pressure is not above this has picked something [Pa].
        calibrate: calibrates it, whatever its arm does; None where EGM does not run on the arm.
        check_not_stopped: raises RobotNotReady while a stop waits for a person's confirmation.

    Attributes:
        side: which arm carries it.
    """

    def __init__(
        self,
        side: Side,
        gripper: Callable[[], driver.Gripper],
        force: float,
        picked_pressure: float = PICKED_PRESSURE,
        check_not_stopped: Callable[[], None] = lambda: None,
        calibrate: Callable[[], None] | None = None,
    ) -> None:
        self._check_not_stopped = check_not_stopped
        self.side = side
        self._gripper = gripper
        self._force = force
        self._picked_pressure = picked_pressure
        self._calibrate = calibrate or (lambda: gripper().calibrate())
        self._direction = Direction.INWARDS  # of the last grip

    def __repr__(self) -> str:
        try:
            width, holding = self.width, self.is_holding
        except YumiError:
            return f"<yumi.Gripper {self.side.word}, not connected>"
        return f"<yumi.Gripper {self.side.word}, {_mm(width)} wide{', holding' if holding else ''}>"

    @property
    def position(self) -> float:
        """Measured distance of each finger from the middle [m], 0 to 0.025; raises RobotNotReady if there is none."""
        return self._gripper().position()

    @property
    def width(self) -> float:
        """Measured distance between the fingers [m], 0 to 0.05; raises as :attr:`position`."""
        return 2.0 * self.position

    @property
    def is_holding(self) -> bool:
        """Whether the gripper holds something now, by its own signals; raises as :attr:`position`."""
        return self._gripper().is_holding()

    def open(self, width: float = 2.0 * TRAVEL) -> Grip:
        """Open the fingers, and return when they stand.

        Args:
            width: distance between them [m], above 0 up to 0.05.

        Raises:
            CommandRefused: the width is impossible; nothing was changed.
            RobotNotReady: the gripper is not calibrated, or reports an error.
            GoalNotReached: something is in the way.
        """
        if not 0.0 < width <= 2.0 * TRAVEL:  # NaN too
            raise CommandRefused(message("gripper_width_out_of_range", width=width, most=2.0 * TRAVEL))
        result = self._command(go_to(width / 2.0))
        if result.outcome is Outcome.STALLED:
            raise GoalNotReached(
                message("gripper_stopped_short", gripper=self.side.word, width=result.width, wanted=width)
            )
        return result

    def close(self) -> Grip:
        """Close the fingers with the usual force, on whatever is between them; returns and raises as :meth:`open`."""
        return self._command(grip(Direction.INWARDS, self._force))

    def grasp(self, force: float | None = None, width: float | None = None, *, outwards: bool = False) -> Grip:
        """Close the fingers on an object and hold it, or open them inside a hollow one.

        Args:
            force: to hold it with, above 0 up to 20 [N]; None takes the usual one.
            width: of the object [m], above 0 up to 0.05; None takes any.
            outwards: whether the object is held from inside.

        Raises:
            CommandRefused: the force or width is impossible; nothing was changed.
            RobotNotReady: as for :meth:`open`.
            GoalNotReached: nothing is held, or something wider or narrower by more than 3 mm; it is still held.
        """
        if width is not None and not 0.0 < width <= 2.0 * TRAVEL:
            raise CommandRefused(message("object_width_out_of_range", width=width, most=2.0 * TRAVEL))
        self._direction = Direction.OUTWARDS if outwards else Direction.INWARDS
        result = self._command(grip(self._direction, self._force if force is None else force))
        if result.outcome is not Outcome.HOLDING:
            raise GoalNotReached(message("gripper_holds_nothing", gripper=self.side.word, outcome=result.outcome.value))
        if width is not None and abs(result.width - width) > WIDTH_TOLERANCE:
            raise GoalNotReached(
                message("gripper_holds_other_width", gripper=self.side.word, width=result.width, wanted=width)
            )
        return result

    def release(self) -> Grip:
        """Let go of what is held: open the fingers, or close them after a grasp outwards.

        Raises:
            RobotNotReady: as for :meth:`open`.
            GoalNotReached: something is in the way.
        """
        if self._direction is Direction.INWARDS:
            return self.open()
        result = self._command(go_to(0.0))
        if result.outcome is Outcome.STALLED:
            raise GoalNotReached(
                message("gripper_stopped_short", gripper=self.side.word, width=result.width, wanted=0.0)
            )
        return result

    def calibrate(self) -> None:
        """Close the fingers and call that zero; connecting and recovering do it where it is needed.

        The arm comes to rest, and EGM on it pauses meanwhile; ``robot.recover()`` starts it again where this fails.

        Raises:
            RobotNotReady: the gripper did not become calibrated.
        """
        self._check_not_stopped()
        with self._gripper().alone():
            self._calibrate()

    def clear_error(self) -> None:
        """Acknowledge the gripper's error; raises RobotNotReady when it still reports one."""
        self._gripper().clear_error()

    def pressure(self, channel: int = 1) -> float:
        """Absolute pressure in the cup of a vacuum module [Pa]; raises CommandRefused when there is no such module."""
        return self._gripper().vacuum(channel).pressure

    def has_picked(self, channel: int = 1) -> bool:
        """Whether a vacuum module sucks and something closes its cup; raises as :meth:`pressure`."""
        return self._gripper().vacuum(channel).has_picked(self._picked_pressure)

    def pick(self, channel: int = 1, timeout: float = 1.0) -> None:
        """Switch a vacuum module on and wait until it has picked something.

        Args:
            channel: 1 or 2.
            timeout: longest wait for the pressure [s].

        Raises:
            CommandRefused: the gripper has no such module.
            RobotNotReady: the gripper is not calibrated, or did not switch.
            GoalNotReached: nothing was picked; the vacuum stays on.
        """
        gripper = self._gripper()
        gripper.switch_vacuum(channel, is_on=True)
        if not gripper.wait_until_picked(channel, self._picked_pressure, timeout):
            raise GoalNotReached(
                message(
                    "vacuum_picked_nothing",
                    channel=channel,
                    gripper=self.side.word,
                    pressure=self.pressure(channel),
                    timeout=timeout,
                    needed=self._picked_pressure,
                )
            )

    def drop(self, channel: int = 1) -> None:
        """Blow off what a vacuum module holds, and switch it off; raises as :meth:`pick`."""
        self._gripper().drop(channel)

    def _command(self, goal: GripperGoal) -> Grip:
        gripper = self._gripper()
        with gripper.alone():
            gripper.begin(goal, self._check_not_stopped)
            outcome = gripper.wait(goal)
        assert outcome is not None, "it is not cancelled"
        return Grip(outcome, 2.0 * gripper.last_position)


def _mm(width: float) -> str:
    return f"{width * 1e3:.1f} mm"


# ---- poses

PoseLike = Pose | Sequence[SupportsFloat]
"""A pose: a :class:`abb_protocols.robot.joints.Pose`, or seven numbers x, y, z [m] and the quaternion w, x, y, z."""

TOOL0 = ORIGIN


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ToolPose(Pose):
    """A pose that says of what it is: where a tool is in the robot's base frame; equal to any pose of the same numbers.

    Attributes:
        tool: its name, or what else is known of it.
        side: the arm that carries it.
    """

    tool: str
    side: Side

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Pose):
            return NotImplemented
        return (self.position, self.orientation) == (other.position, other.orientation)

    def __hash__(self) -> int:
        return hash((self.position, self.orientation))

    def __repr__(self) -> str:
        x, y, z = (f"{value * 1e3:.1f} mm" for value in self.position)
        roll, pitch, yaw = (f"{degrees(value):.1f}°" for value in euler_zyx(self.orientation))
        return (
            f"<yumi.Pose {self.tool} of the {self.side.word} arm in the base frame: x {x}, y {y}, z {z}, "
            f"roll {roll}, pitch {pitch}, yaw {yaw}>"
        )


def pose(
    x: float,
    y: float,
    z: float,
    quaternion: Sequence[SupportsFloat] | None = None,
    *,
    rpy: Sequence[SupportsFloat] | None = None,
) -> Pose:
    """A pose: ``yumi.pose(0.4, -0.2, 0.2, rpy=(math.pi, 0, 0))`` is a tool that points down.

    Args:
        x: the place [m].
        y: see x.
        z: see x.
        quaternion: the orientation as w, x, y, z; it need not have the length 1.
        rpy: the orientation as roll, pitch, yaw about x, y, z [rad], as in URDF.

    Raises:
        CommandRefused: both or a wrong number of values are given, or one is not finite.
    """
    if quaternion is not None and rpy is not None:
        raise CommandRefused(message("pose_orientation_twice"))
    orientation: Quaternion = IDENTITY
    if rpy is not None:
        roll, pitch, yaw = numbers_from(rpy, 3, "rpy")
        orientation = quaternion_from_euler_zyx((roll, pitch, yaw))
    elif quaternion is not None:
        w, i, j, k = numbers_from(quaternion, 4, "quaternion")
        length = (w * w + i * i + j * j + k * k) ** 0.5
        if not 1e-6 < length < 1e6:
            raise CommandRefused(message("pose_quaternion_without_direction"))
        orientation = (w / length, i / length, j / length, k / length)
    x, y, z = numbers_from((x, y, z), 3, "its place")
    return checked_pose(Pose((x, y, z), orientation))


def pose_from(given: PoseLike) -> Pose:
    """A pose as this package has it; raises CommandRefused when it is none."""
    if isinstance(given, Pose):
        return checked_pose(given)
    x, y, z, *quaternion = numbers_from(given, 7, "pose")
    return checked_pose(Pose((x, y, z), (quaternion[0], quaternion[1], quaternion[2], quaternion[3])))


def poses_from(given: PoseLike | Sequence[PoseLike]) -> Sequence[PoseLike]:
    """One pose or several as several."""
    if isinstance(given, Pose) or (len(given) and isinstance(given[0], SupportsFloat)):
        return [given]  # type: ignore[list-item]
    return given  # type: ignore[return-value]


def boxes_from(given: Mapping[str, tuple[PoseLike, Sequence[SupportsFloat]]]) -> tuple[Obstacle, ...]:
    """Boxes by name, each with the pose of its centre and its edges [m], as obstacles.

    Raises:
        CommandRefused: a pose or a size is none.
    """
    found = []
    for name, (centre, size) in given.items():
        length, width, height = numbers_from(size, 3, message("size_of_box", box=name))
        if min(length, width, height) <= 0.0:
            raise CommandRefused(message("box_edge_not_positive", box=name))
        found.append(Obstacle(name, pose_from(centre), (length, width, height)))
    return tuple(found)


def numbers_from(values: Any, count: int, name: Message | str) -> list[float]:
    """So many finite numbers as they are; raises CommandRefused when they are not."""
    try:
        numbers = [float(each) for each in values]
    except (TypeError, ValueError) as error:
        raise CommandRefused(message("pose_values_no_numbers", name=name, given=quoted(values), count=count)) from error
    if len(numbers) != count or not all(map(isfinite, numbers)):
        raise CommandRefused(message("pose_values_not_finite", name=name, given=quoted(values), count=count))
    return numbers


@dataclass
class Frames:
    """Tools and work objects of a robot by name; scripts add their own.

    Attributes:
        tools: frames of tools in tool0, RAPID's ``tframe``.
        work_objects: frames in the robot's body, in which poses may be given.
    """

    tools: dict[str, PoseLike] = field(default_factory=lambda: {"tool0": TOOL0, "fingertips": FINGERTIPS})
    work_objects: dict[str, PoseLike] = field(default_factory=lambda: {"wobj0": TOOL0})

    def tool(self, given: PoseLike | str) -> Pose:
        """The frame of a tool, by name or given itself."""
        return _named(given, self.tools, is_tool=True)

    def work_object(self, given: PoseLike | str | None) -> Pose:
        """The frame of a work object; None is the body's."""
        return TOOL0 if given is None else _named(given, self.work_objects, is_tool=False)


def _named(given: PoseLike | str, known: Mapping[str, PoseLike], *, is_tool: bool) -> Pose:
    if not isinstance(given, str):
        return pose_from(given)
    if given not in known:
        raise CommandRefused(
            message("tool_name_unknown" if is_tool else "work_object_unknown", name=given, known=tuple(known))
        )
    return pose_from(known[given])


# ---- postures

_FURTHER_ANGLES = tuple(sign * number * 0.2618 for number in range(1, 12) for sign in (1.0, -1.0))  # [rad] 15° apart


def postures_of(side: Side, tool0: Pose, angle: float | None, now: Joints, limits: JointLimits) -> tuple[Joints, ...]:
    """All postures of a pose of tool0 with an arm angle, None for the present one; the nearest to ``now`` first."""
    found = postures(side, tool0, arm_angle(side, now) if angle is None else checked_angle(angle), limits)
    return tuple(sorted(found, key=lambda each: largest_difference(each, now)))


def posture_for(
    side: Side,
    tool0: Pose,
    angle: float | None,
    desired: Configuration | Sequence[int] | None,
    now: Joints,
    limits: JointLimits,
) -> Joints:
    """The posture to go to: with the configuration, or the nearest.

    Raises:
        Unreachable: there is none; where no arm angle was asked for, with none of those tried.
    """
    with_angle = arm_angle(side, now) if angle is None else checked_angle(angle)
    wanted = None if desired is None else _checked_configuration(desired)
    if wanted is None:
        try:
            near = nearest_posture(side, tool0, with_angle, now, limits)
        except Unreachable:
            near = None
        if near is not None and largest_difference(near, now) < 1.0:
            return near
    for angles in ([with_angle], [with_angle + turn for turn in _FURTHER_ANGLES] if angle is None else []):
        for own in postures_of_each(side, [tool0] * len(angles), angles, limits):
            found = [each for each in own if wanted is None or configuration(each) == wanted]
            if found:
                return min(found, key=lambda each: largest_difference(each, now))
    x, y, z = tool0.position
    if wanted is None:
        reason = message(
            "posture_missing" if angle is None else "posture_missing_at_angle", arm=side.word, x=x, y=y, z=z
        )
        raise unreachable(side, tool0, reason, now, limits)
    raise Unreachable(
        message(
            "posture_missing_in_configuration" if angle is None else "posture_missing_in_configuration_at_angle",
            arm=side.word,
            configuration=wanted,
            x=x,
            y=y,
            z=z,
        )
    )


def checked_angle(angle: SupportsFloat) -> float:
    """An arm angle as a number [rad]; raises CommandRefused when it is none."""
    try:
        number = float(angle)
    except (TypeError, ValueError):
        number = nan
    if not isfinite(number):
        raise CommandRefused(message("pose_angle_not_finite", given=quoted(angle)))
    return number


def _checked_configuration(given: Sequence[int]) -> tuple[int, ...]:
    values = numbers_from(given, 4, "configuration")
    if any(each != int(each) for each in values):
        raise CommandRefused(message("pose_configuration_not_whole", given=quoted(given)))
    return tuple(map(int, values))


# ---- lines


def waypoints_from(
    frames: Frames, poses: Sequence[PoseLike], work_object: PoseLike | str | None, angle: float | None
) -> tuple[Waypoint, ...]:
    """Poses given in a work object as waypoints in the body frame; the arm angle is that of the last."""
    base = frames.work_object(work_object)
    points = [Waypoint(compose(base, pose_from(each))) for each in poses]
    if points and angle is not None:
        points[-1] = replace(points[-1], angle=checked_angle(angle))
    return tuple(points)
