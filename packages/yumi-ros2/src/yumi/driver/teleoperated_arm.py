"""One teleoperated arm: while the clutch is held, what a device reports becomes goals of the arm's tool or joints.

A calculation without a clock, a robot or a thread. Pressing the clutch takes a reference, where the arm is sent and
where the device's hand is; the goals are the reference moved by what the hand has moved since. The first goal is where
the arm is sent, so that nothing moves by pressing.
"""

from __future__ import annotations

from enum import Enum, auto
from math import cos, dist, hypot, sin
from typing import NamedTuple

from abb_protocols.catalogue import Message, message
from abb_protocols.robot.inverse_kinematics import arm_angle
from abb_protocols.robot.joints import YUMI_LIMITS, ZERO_JOINTS, Joints, Pose, Quaternion, Side, Vector, joints, rotate
from abb_protocols.robot.kinematics import (
    compose_poses,
    pose_distance,
    quaternion_of,
    quaternion_product,
    tool0_to_body,
    turn_between,
    unit_quaternion,
)
from yumi.control.motion.one_euro import OneEuroFilter, PoseFilter
from yumi.driver.device_frame import DeviceHand, DeviceSettings

DEVICE_LINK_LOST = 0.2
"""Without a frame for so long the link is lost [s]: the arm brakes, and the clutch must be pressed again."""

_CLOSE_ENOUGH = 0.2
"""A follower goes to where its leader arm is only where no joint is further away at first [rad]."""

BLENDING = 2.0
"""So long the offset of such a follower fades away [s]."""

_STANDING = 2e-5  # [rad] an arm that is sent no further than this for a while stands
_STANDS = 0.03  # [s] that while
_FASTEST_HAND = 5.0  # [m/s] a hand that is faster has jumped: its device has lost it for a while
_FASTEST_TURN = 40.0  # [rad/s] the same of its orientation and of a leader's joints
_JITTER = 0.05  # [m], [rad] which a hand may jump by
_GRIPPER_STEP = 0.05  # a gripper's value that has changed by less is the same
_CLOSED, _OPEN = 0.97, 0.03  # beyond these a gripper's value is at its end


class Clutch(Enum):
    """What the clutch of an arm does.

    RELEASED: nothing moves.
    ENGAGING: it is held, and the arm is being taken over, or does not stand yet.
    ENGAGED: the arm follows.
    INERT: it is held, and nothing moves until it was released and is pressed again.
    """

    RELEASED = auto()
    ENGAGING = auto()
    ENGAGED = auto()
    INERT = auto()


class TeleoperationFollower(Enum):
    """What of an arm follows."""

    TOOL = auto()
    JOINTS = auto()


class PoseGoal(NamedTuple):
    """Where the tool is to be, with the arm angle [rad]; at most so fast, [m/s] and [rad/s]."""

    pose: Pose
    angle: float
    speed: float
    turning: float


class TwistGoal(NamedTuple):
    """How fast the tool and the arm angle are to move [m/s], [rad/s], (7,); at most so fast, [m/s] and [rad/s]."""

    twist: Joints
    is_in_tool: bool
    speed: float
    turning: float


class JointsGoal(NamedTuple):
    """Where the joints are to be [rad], (7,)."""

    position: Joints


MotionGoal = PoseGoal | TwistGoal | JointsGoal


class ClutchStep(NamedTuple):
    """What a frame asks of an arm.

    Attributes:
        goal: where it is to go.
        take_over: what of it is to follow, where it is to be taken over.
        brakes: whether it comes to rest.
        gripper: a new goal of its gripper, 0 is open, 1 is closed.
    """

    goal: MotionGoal | None = None
    take_over: TeleoperationFollower | None = None
    brakes: bool = False
    gripper: float | None = None


_NOTHING = ClutchStep()


class ArmNow(NamedTuple):
    """An arm at the moment of a frame.

    Attributes:
        sent: the position that was sent last [rad], (7,).
        is_taken: whether it was taken over for this hold of the clutch.
        is_kept: whether nothing else has commanded it since.
    """

    sent: Joints
    is_taken: bool
    is_kept: bool


class TeleoperatedArm:
    """The clutch of one arm, and the motion that follows the device while the clutch is held.

    Args:
        side: the arm.
        tool: that moves, its frame in tool0.

    Attributes:
        clutch: what it does now.
        why: it is inert.
    """

    def __init__(self, side: Side, tool: Pose) -> None:
        self.clutch = Clutch.RELEASED
        self.why: Message | None = None
        self._side, self._tool = side, tool
        self._sent: Joints = ZERO_JOINTS
        self._stands_since = 0.0
        self._follower = TeleoperationFollower.TOOL
        self._motion: _PoseFollowing | _JointFollowing | None = None  # of this hold; a twist needs none
        self._gripper: float | None = None  # the value of the gripper when it counted last, or when the clutch engaged

    def take(self, hand: DeviceHand, settings: DeviceSettings, time: float, now: float, arm: ArmNow) -> ClutchStep:
        """What the next frame asks of the arm.

        Args:
            hand: what the device reports.
            settings: how the arm follows.
            time: of the frame, on the device's clock [s].
            now: on the clock of the robot [s].
            arm: where it is.
        """
        if dist(arm.sent, self._sent) > _STANDING:
            self._sent, self._stands_since = arm.sent, now
        if not hand.clutch:
            return self._release()
        if self.clutch is Clutch.RELEASED:
            self.clutch, self._stands_since, self._sent = Clutch.ENGAGING, now, arm.sent
            self._follower = TeleoperationFollower.TOOL if hand.joints is None else TeleoperationFollower.JOINTS
            return ClutchStep(take_over=self._follower)
        if self.clutch is Clutch.INERT or not arm.is_taken:
            return _NOTHING
        if not arm.is_kept:
            return self._inert("teleoperation_interrupted")
        if self.clutch is Clutch.ENGAGED:
            return self._follow(hand, settings, time)
        return self._engage(hand, settings, time, arm.sent) if now - self._stands_since >= _STANDS else _NOTHING

    def end(self, why: Message) -> ClutchStep:
        """Have a clutch move nothing until it was released: the arm brakes if it was following."""
        if self.clutch is Clutch.INERT:
            return _NOTHING
        brakes = self.clutch is Clutch.ENGAGED
        self.clutch, self.why, self._motion = Clutch.INERT, why, None
        return ClutchStep(brakes=brakes)

    def _inert(self, code: str, **values: object) -> ClutchStep:
        return self.end(message(code, arm=self._side.word, **values))

    def _release(self) -> ClutchStep:
        brakes = self.clutch is Clutch.ENGAGED
        self.clutch, self.why, self._motion, self._gripper = Clutch.RELEASED, None, None, None
        return ClutchStep(brakes=brakes)

    def _engage(self, hand: DeviceHand, settings: DeviceSettings, time: float, sent: Joints) -> ClutchStep:
        """Take the reference; the first goal is where the arm is."""
        if (hand.joints is not None) != (self._follower is TeleoperationFollower.JOINTS):
            return self._inert("device_motion_changed")
        goal: MotionGoal
        if hand.pose is not None:
            self._motion = _PoseFollowing(self._side, self._tool, hand.pose, hand.elbow, settings, time, sent)
            goal = self._motion.reference
        elif hand.joints is not None:
            far = max(abs(a - b) for a, b in zip(hand.joints, sent, strict=True))
            if settings.is_absolute and far > _CLOSE_ENOUGH:
                return self._inert("leader_too_far", distance=far, most=_CLOSE_ENOUGH)
            self._motion = _JointFollowing(hand.joints, settings, time, sent)
            goal = JointsGoal(sent)
        else:
            goal = TwistGoal(ZERO_JOINTS, hand.is_in_tool, settings.speed, settings.turning)
        self.clutch, self._gripper = Clutch.ENGAGED, None if hand.gripper is None else _to_end(hand.gripper)
        return ClutchStep(goal=goal)

    def _follow(self, hand: DeviceHand, settings: DeviceSettings, time: float) -> ClutchStep:
        motion = self._motion
        goal: MotionGoal | None = None
        if motion is None:
            if hand.twist is not None:
                goal = _limited_twist(hand, settings)
        else:
            values = hand.pose if isinstance(motion, _PoseFollowing) else hand.joints
            if values is not None:
                dt, motion.time = min(time - motion.time, DEVICE_LINK_LOST), time  # whatever a device's clock does
                if motion.has_jumped(values, hand.elbow, dt):
                    return self._inert("device_hand_jumped")
                goal = motion.step(values, hand.elbow, settings, dt)
        if goal is None:
            return self._inert("device_motion_changed")
        return ClutchStep(goal=goal, gripper=self._gripper_goal(hand.gripper))

    def _gripper_goal(self, value: float | None) -> float | None:
        """A goal of the gripper where the device's value has changed enough since the last one."""
        if value is None:
            return None
        value = _to_end(value)
        if self._gripper is not None:
            is_at_end = value in (0.0, 1.0) and value != self._gripper
            if not is_at_end and abs(value - self._gripper) <= _GRIPPER_STEP:
                return None
        self._gripper = value
        return value


class _PoseFollowing:
    """A tool that follows the pose of a hand, from when the clutch was pressed.

    Attributes:
        reference: where the tool was sent then.
        time: of the last frame, on the device's clock [s].
    """

    def __init__(
        self,
        side: Side,
        tool: Pose,
        hand: Joints,
        elbow: float | None,
        settings: DeviceSettings,
        time: float,
        sent: Joints,
    ) -> None:
        here = compose_poses(tool0_to_body(side, sent), tool)
        self.reference = PoseGoal(
            Pose(here.position, unit_quaternion(here.orientation)),
            arm_angle(side, sent),
            settings.speed,
            settings.turning,
        )
        self.time = time
        self._hand = self._last = _pose_of_hand(hand)
        self._elbow, self._bend = elbow, 0.0
        # Kept until the clutch is released: another scale would move the tool of a hand that stands.
        self._scale, self._turned = settings.scale, _yaw_of(settings)
        self._filter = PoseFilter(self._hand, settings.cutoff, settings.beta)

    def has_jumped(self, values: Joints, elbow: float | None, dt: float) -> bool:
        """Whether no hand, or elbow, can have moved so far since the last frame."""
        distance, turn = pose_distance(self._last, _pose_of_hand(values))
        if elbow is not None and self._elbow is not None:
            turn = max(turn, abs(elbow - self._elbow))
        return distance > _JITTER + _FASTEST_HAND * dt or turn > _JITTER + _FASTEST_TURN * dt

    def step(self, values: Joints, elbow: float | None, settings: DeviceSettings, dt: float) -> PoseGoal:
        """The next goal, ``dt`` [s] after the last one."""
        self._last = _pose_of_hand(values)
        hand = self._filter.step(self._last, dt)
        translation = rotate(self._turned, _difference(hand.position, self._hand.position))
        turn = rotate(self._turned, turn_between(self._hand.orientation, hand.orientation))
        x, y, z = (at + self._scale * by for at, by in zip(self.reference.pose.position, translation, strict=True))
        orientation = quaternion_product(quaternion_of(turn), self.reference.pose.orientation)
        if elbow is not None and self._elbow is not None:
            self._bend += elbow - self._elbow
        self._elbow = elbow  # where it is not reported the arm angle stays, and counts from the next report on
        return PoseGoal(
            Pose((x, y, z), unit_quaternion(orientation)),
            self.reference.angle + self._bend,
            settings.speed,
            settings.turning,
        )


class _JointFollowing:
    """Joints that follow those of a leader arm, from when the clutch was pressed.

    Attributes:
        time: of the last frame, on the device's clock [s].
    """

    def __init__(self, leader: Joints, settings: DeviceSettings, time: float, sent: Joints) -> None:
        self.time, self._since_press = time, 0.0
        self._last = leader
        self._is_absolute = settings.is_absolute  # as long as the clutch is held, as the scale of a pose
        self._offset: Joints = joints([a - b for a, b in zip(sent, leader, strict=True)])
        self._filter = OneEuroFilter(leader, settings.cutoff, settings.beta)
        self._goal = sent

    def has_jumped(self, values: Joints, elbow: float | None, dt: float) -> bool:
        """Whether no leader can have moved so far since the last frame."""
        return max(abs(b - a) for a, b in zip(self._last, values, strict=True)) > _JITTER + _FASTEST_TURN * dt

    def step(self, values: Joints, elbow: float | None, settings: DeviceSettings, dt: float) -> JointsGoal:
        """The next goal, at most as far from the last one as the joints may move in ``dt`` [s]."""
        self._last, self._since_press = values, self._since_press + dt
        share = min(1.0, self._since_press / BLENDING) if self._is_absolute else 0.0
        left = 1.0 - share * share * (3.0 - 2.0 * share)  # the offset fades without a step in speed
        leader, most = self._filter.step(values, dt), settings.joint_speed * dt
        rows = zip(leader, self._offset, self._goal, YUMI_LIMITS.lower, YUMI_LIMITS.upper, strict=True)
        self._goal = joints(
            [
                at + max(-most, min(most, max(lower, min(upper, to + left * by)) - at))
                for to, by, at, lower, upper in rows
            ]
        )
        return JointsGoal(self._goal)


def _to_end(value: float) -> float:
    """A gripper's value, where a trigger that rests or is pulled to its end is there exactly."""
    return 1.0 if value > _CLOSED else 0.0 if value < _OPEN else value


def _pose_of_hand(values: Joints) -> Pose:
    x, y, z, *orientation = values
    w, i, j, k = orientation
    return Pose((x, y, z), unit_quaternion((w, i, j, k)))


def _yaw_of(settings: DeviceSettings) -> Quaternion:
    """How the operator's frame is turned from the robot's base."""
    return (cos(0.5 * settings.yaw), 0.0, 0.0, sin(0.5 * settings.yaw))


def _difference(to: Vector, start: Vector) -> Vector:
    (a, b, c), (x, y, z) = to, start
    return (a - x, b - y, c - z)


def _within(vector: Vector, most: float) -> Vector:
    """A vector, or the part of it that is ``most`` long."""
    x, y, z = vector
    size = hypot(x, y, z)
    share = 1.0 if size <= most else most / size
    return (share * x, share * y, share * z)


def _limited_twist(hand: DeviceHand, settings: DeviceSettings) -> TwistGoal:
    """A velocity in the robot's base, or in the tool, within the speeds that the settings allow."""
    vx, vy, vz, wx, wy, wz = hand.twist or (0.0,) * 6
    linear: Vector = (settings.scale * vx, settings.scale * vy, settings.scale * vz)
    angular: Vector = (settings.scale * wx, settings.scale * wy, settings.scale * wz)
    if not hand.is_in_tool:
        turned = _yaw_of(settings)
        linear, angular = rotate(turned, linear), rotate(turned, angular)
    bend = max(-settings.turning, min(settings.turning, settings.scale * (hand.elbow or 0.0)))
    twist = (*_within(linear, settings.speed), *_within(angular, settings.turning), bend)
    return TwistGoal(twist, hand.is_in_tool, settings.speed, settings.turning)
