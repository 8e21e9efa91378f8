"""One arm, as a script sees it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from enum import Enum

from yumi.api.gripper import Gripper
from yumi.api.guidance import Guidance, Position, TimedPosition
from yumi.api.motions import Motion
from yumi.api.waiting import wait_for
from yumi.control.calming import STANDING
from yumi.control.snapshot import Snapshot
from yumi.errors import RobotNotReady
from yumi.robot.joints import Joints, Side, joint_names
from yumi.robot.kinematics import tool0_to_body
from yumi.robot.values import Pose


class ArmMode(Enum):
    """What an arm does, for ``arm.state``."""

    SILENT = "silent"
    """The robot sends no datagrams for it: EGM is not running."""

    IDLE = "idle"
    """The robot sends where it is, but does not follow: motors off, or RAPID stopped."""

    HOLDING = "holding"
    """It follows, and stands."""

    MOVING = "moving"
    """It follows, and moves."""

    FAULT = "fault"
    """Something stopped it; ``robot.recover()`` brings it back, the last error says what it was."""


class Arm:
    """One arm of a connected robot. Joints are in chain order: axes 1, 2, 7, 3, 4, 5, 6, from body to flange.

    Args:
        side: which one.
        guidance: the robot's, while it is connected; raises when it is not.
        gripper: its hand.

    Attributes:
        side: which one.
        gripper: its hand.
    """

    def __init__(self, side: Side, guidance: Callable[[], Guidance], gripper: Gripper) -> None:
        self.side = side
        self.gripper = gripper
        self._guidance = guidance

    def __repr__(self) -> str:
        return f"<yumi.Arm {self.side.word}>"

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints in the order of all positions, as ROS has them."""
        return joint_names(self.side)

    @property
    def position(self) -> Joints:
        """Measured joint positions, not older than a few milliseconds [rad], (7,).

        Raises:
            RobotNotReady: the robot is not connected, or silent.
        """
        return self._snapshot().position

    @property
    def velocity(self) -> Joints:
        """Measured joint velocities [rad/s], (7,); raises as :attr:`position`."""
        return self._snapshot().velocity

    @property
    def pose(self) -> Pose:
        """Pose of tool0 in the frame of the robot's body, from the measured joints [m], quaternion w first.

        It is exact forward kinematics; raises as :attr:`position`.
        """
        return tool0_to_body(self.side, self.position)

    @property
    def state(self) -> ArmMode:
        """What the arm does now.

        Raises:
            RobotNotReady: the robot is not connected, or does not guide this arm.
        """
        guidance = self._guidance()
        mode = _mode(guidance.snapshot(self.side))
        return ArmMode.FAULT if guidance.fault(self.side) else mode

    def move_to(
        self,
        position: Position,
        *,
        wait: bool = True,
        timeout: float | None = None,
        speed: float | None = None,
        acceleration: float | None = None,
    ) -> Motion:
        """Move to ``position``, all joints together; a motion under way bends into the new one without a stop.

        Args:
            position: joint positions [rad], (7,) in chain order, or by joint name; see :func:`yumi.degrees` and, for
                the FlexPendant's order, :func:`yumi.abb_degrees`.
            wait: return when the arm stands at the goal; else at once.
            timeout: an arm that takes longer than this is stopped [s]; None lets it take its time.
            speed: share of the joints' highest speeds, above 0 up to 1; None takes that of ``connect``.
            acceleration: the same for accelerations and jerks.

        Returns:
            The motion; over, unless ``wait`` is False.

        Raises:
            CommandRefused: the position is impossible (length, names, NaN, range), or a share is; nothing was changed.
            RobotNotReady: not connected, EGM not running, or stopped by a fault; nothing was changed.
            GoalNotReached: the motion ended elsewhere; the arm holds.
        """
        guidance = self._guidance()
        (motion,) = guidance.move({self.side: position}, speed, acceleration)
        if wait:
            wait_for((motion,), timeout, guidance)
        return motion

    def follow(self, trajectory: Sequence[TimedPosition], *, wait: bool = True, timeout: float | None = None) -> Motion:
        """Follow a trajectory: splines through points that are due at times.

        ::

            robot.right.follow([(1.0, q1), (2.0, q2), (3.5, q1)])

        Between two points the way is straight if they have positions only, cubic with velocities, quintic with
        accelerations. What moves when it is called comes to rest first; a point at time 0 must be where the arm is.

        Args:
            trajectory: points ``(time, position)``, ``(time, position, velocity)`` or ``(time, position, velocity,
                acceleration)``: the time since the begin [s], then (7,) each in [rad], [rad/s] and [rad/s²]; or by
                joint name.
            wait: return when the arm stands at the last point; else at once.
            timeout: an arm that takes longer than this is stopped [s]; None lets it take its time.

        Returns:
            The motion; over, unless ``wait`` is False.

        Raises:
            CommandRefused: the trajectory is impossible: its points, their order, or more than the joints may do.
            RobotNotReady: as for :meth:`move_to`.
            GoalNotReached: the motion ended elsewhere; the arm holds.
        """
        guidance = self._guidance()
        (motion,) = guidance.follow({self.side: trajectory})
        if wait:
            wait_for((motion,), timeout, guidance)
        return motion

    def stop(self) -> None:
        """Come to rest as fast as the joints may, and return when the arm stands.

        Raises:
            RobotNotReady: the robot is not connected.
            GoalNotReached: the arm did not come to rest.
        """
        guidance = self._guidance()
        wait_for(guidance.stop((self.side,)), None, guidance)

    def stream(self, position: Position) -> None:
        """Follow a stream of positions, of which this is the next; returns at once.

        It may be called up to 250 times a second. The arm keeps the joints' limits on the way and stays at the last
        position; :meth:`move_to` or :meth:`stop` end the stream. A motion under way ends before the stream begins.

        Args:
            position: joint positions [rad], (7,) in chain order, or by joint name.

        Raises:
            CommandRefused: the position is impossible; the arm keeps the one before.
            RobotNotReady: as for :meth:`move_to`.
        """
        self._guidance().stream(self.side, position)

    def _snapshot(self) -> Snapshot:
        snapshot = self._guidance().snapshot(self.side)
        if not snapshot.is_streaming:
            raise RobotNotReady(
                f"The robot sends no positions of its {self.side.word} arm: EGM is not running; call robot.recover()."
            )
        return snapshot


def _mode(snapshot: Snapshot) -> ArmMode:
    if not snapshot.is_streaming:
        return ArmMode.SILENT
    if not snapshot.is_running:
        return ArmMode.IDLE
    return ArmMode.MOVING if max(map(abs, snapshot.velocity)) > STANDING else ArmMode.HOLDING
