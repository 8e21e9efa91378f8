"""The access to an arm: its controllers, how another one takes the arm over, and how the arm comes to rest."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from concurrent.futures import FIRST_EXCEPTION
from concurrent.futures import wait as wait_for_futures
from contextlib import suppress

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused, GoalNotReached, RobotNotReady, YumiError
from abb_protocols.robot.joints import Side
from abb_runtime.clock import Clock
from yumi.api.motion_registry import Motion, MotionRegistry
from yumi.control.controllers.joint_goal import StopMotion
from yumi.control.hand_over import Commander, requested_by
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.motion.robot_response import STANDING
from yumi.control.shared_state import Snapshot, TrajectoryFeedback
from yumi.driver.control_process import FRESH_FEEDBACK, ControlProcess
from yumi.driver.controller_names import GOAL_CONTROLLER
from yumi.driver.readiness import why_arm_does_not_follow
from yumi.driver.stops import because

_LAST_STOP = 5.0
"""An arm must have come to rest within this time [s]; it takes a tenth of it."""


class ArmAccess:
    """The arms of one robot, and what commands each.

    Args:
        control: the control process.
        motions: those under way.
        arms: those on which EGM runs.
        clock: of the control process.

    Attributes:
        control: as above.
        motions: as above.
        arms: as above.
        clock: as above.
        streaming: the controller that follows a stream of each arm, with the session and activation of the stream.
    """

    def __init__(
        self,
        control: ControlProcess,
        motions: MotionRegistry,
        arms: tuple[Side, ...],
        clock: Clock,
    ) -> None:
        self.control, self.motions, self.arms, self.clock = control, motions, arms, clock
        self.streaming: dict[Side, tuple[str, int, int]] = {}
        motions.limited_by = lambda side: control.snapshot(side).limited

    def snapshot(self, side: Side) -> Snapshot:
        """An arm after its last cycle.

        Raises:
            RobotNotReady: it is not one of those on which EGM runs.
        """
        if side not in self.arms:
            raise RobotNotReady(message("arm_not_named_to_connect", arm=side.word))
        return self.control.snapshot(side)

    def is_moving(self, side: Side) -> bool:
        """Whether a motion of the arm is under way, it follows a trajectory however slowly, or moves otherwise."""
        now = self.clock.now()
        return (
            self.motions.is_open(side)
            or any(each.goal and now - each.time < FRESH_FEEDBACK for each in self.trajectories(side))
            or max(map(abs, self.control.snapshot(side).velocity)) > STANDING
        )

    def trajectories(self, side: Side) -> list[TrajectoryFeedback]:
        """What the controllers that follow trajectories on an arm have said last."""
        buffers = self.control.buffers[side]
        newest = (each.read() for each in (buffers.trajectory, buffers.dual_trajectory, buffers.tool_path))
        return [each[1] for each in newest if each is not None]

    def fault(self, side: Side) -> Message | None:
        """What stopped the arm; None when nothing did."""
        return self.motions.fault(side)

    def stop(self, sides: Iterable[Side]) -> tuple[Motion, ...]:
        """Have arms come to rest, as fast as their joints may; those that do not follow stand already.

        A stop is open to all, whichever client commands the arms.

        Returns:
            The motions to standstill.
        """
        with requested_by(only_holds=True):
            return self._stop(sides)

    def stop_own(self, sides: Collection[Side]) -> tuple[Motion, ...]:
        """As :meth:`stop`, at the end of what the requester has begun: an arm that another one has by now goes on."""
        hand_over = self.control.hand_over
        with hand_over.keeping(sides):
            return self.stop([side for side in sides if not hand_over.is_foreign(side)])

    def _stop(self, sides: Iterable[Side]) -> tuple[Motion, ...]:
        """As :meth:`stop`, where the requester may have another controller command the arms."""
        moving = [side for side in sides if self.control.snapshot(side).is_commanded]
        self.activate(moving, GOAL_CONTROLLER)
        motions = tuple(self.motions.begin(side) for side in moving)
        return self.send(
            [ControllerCommand(each.side, GOAL_CONTROLLER, StopMotion(each.identity)) for each in motions], motions
        )

    def awaited(
        self, motions: tuple[Motion, ...], *, wait: bool = True, timeout: float | None = None
    ) -> tuple[Motion, ...]:
        """The motions; over, unless ``wait`` is False, see :func:`wait_for`."""
        if wait:
            wait_for(motions, timeout, self)
        return motions

    def bring_to_rest(self, sides: Iterable[Side]) -> None:
        """Stop arms and wait until they stand; raises GoalNotReached when one did not come to rest."""
        _wait_for_rest(self.stop(sides))

    def bring_own_to_rest(self, sides: Collection[Side]) -> None:
        """As :meth:`bring_to_rest`, for the arms of :meth:`stop_own`."""
        _wait_for_rest(self.stop_own(sides))

    def check_has(self, side: Side, name: str) -> None:
        """Raises CommandRefused where an arm has no controller of that name."""
        if all(info.name != name for info in self.control.call(Commands.list_controllers, side)):
            raise CommandRefused(message("cartesian_controller_missing", arm=side.word, controller=name))

    def take_over(self, sides: Collection[Side], name: str, anew: Collection[Side] = ()) -> None:
        """Have a controller command arms, from standstill: controllers plan their motions differently.

        On the arms ``anew`` a controller that commands already begins anew, and what it was sent before ends. An arm
        that another one has taken from the requester since it was granted is not stopped, and the refusal raised.
        """
        others = [side for side in sides if side in anew or self.commanding(side) != (name,)]
        _wait_for_rest(self._stop(others))
        self.activate(others, name)

    def take_for_trajectories(
        self, sides: Collection[Side], kind: Commander, name: str, *, from_rest: bool = False
    ) -> dict[Side, tuple[int, int]]:
        """Take arms for a controller of trajectories; the streams that they followed are over.

        Where another client commanded an arm last, what that client sent before does not go on afterwards. With
        ``from_rest`` arms that move come to rest first.

        Returns:
            The session and activation of the controller on each arm.

        Raises:
            CommandRefused: another client commands an arm, or has taken one meanwhile.
            GoalNotReached: an arm that moved did not come to rest.
        """
        handed_over = self.control.hand_over.take_all(sides, kind, None)
        moving = [side for side in sides if self.is_moving(side)] if from_rest else []
        self.take_over(sides, name, anew=handed_over.union(moving))
        with self.control.hand_over.switching(sides):  # who has taken an arm since then has a stream of it
            for side in sides:
                self.streaming.pop(side, None)
            return {side: self.control.snapshot(side).command_epoch for side in sides}

    def check_follows(self, side: Side) -> None:
        """Raises RobotNotReady where an arm does not follow, or waits for a recovery."""
        snapshot, fault = self.snapshot(side), self.motions.fault(side)
        if fault is not None:
            stop = self.motions.stop(side)
            raise RobotNotReady(message("arm_waits_for_recovery", arm=side.word, fault=fault), stop)
        reason = why_arm_does_not_follow(side, snapshot)
        if reason is not None:
            cause = self.motions.cause()
            raise RobotNotReady(because(message("goal_refused", reason=reason), cause), cause.stop)

    def activate(self, sides: Iterable[Side], name: str) -> None:
        """Switch the arms to a controller; what commands one until then is deactivated in the same switch."""
        for side in sides:
            commanding, stream = self.commanding(side), self.streaming.get(side)
            if commanding != (name,):
                self.control.call(Commands.switch_controllers, side, (name,), commanding)
                self.forget_stream(side, stream)

    def forget_stream(self, side: Side, stream: tuple[str, int, int] | None) -> None:
        """Have the next point begin a stream anew; one that another client has begun since then goes on."""
        if self.streaming.get(side) == stream:
            self.streaming.pop(side, None)

    def commanding(self, side: Side) -> tuple[str, ...]:
        """The controllers that command an arm."""
        infos = self.control.call(Commands.list_controllers, side)
        return tuple(info.name for info in infos if info.claimed)

    def send(self, commands: Sequence[ControllerCommand], motions: tuple[Motion, ...]) -> tuple[Motion, ...]:
        """Have controllers take commands that begin motions; raises CommandRefused, and no motion begins."""
        if not commands:
            return ()
        try:
            self.control.call(Commands.send_commands, *commands)
        except YumiError:
            self.motions.forget(motions)
            raise
        return motions


def _wait_for_rest(stops: Sequence[Motion]) -> None:
    for motion in stops:
        motion.wait(_LAST_STOP)


def wait_for(motions: Sequence[Motion], timeout: float | None, arms: ArmAccess) -> None:
    """Wait until all ``motions`` are at their goals, at most ``timeout`` [s]; else those that still move are stopped.

    Raises:
        GoalNotReached: a motion ended elsewhere, or its time was up.
    """
    try:
        wait_for_futures([motion.future for motion in motions], timeout, FIRST_EXCEPTION)
        check_ended(motions, timeout)
    except BaseException:  # Ctrl-C too
        halt(motions, arms)
        raise


def check_ended(motions: Iterable[Motion], timeout: float | None) -> None:
    """See how motions ended that were waited for; raises GoalNotReached when one ended elsewhere, or is not over."""
    for motion in [each for each in motions if each.is_done]:
        motion.future.result()
    late = tuple(motion.side.word for motion in motions if not motion.is_done)
    if late:
        raise GoalNotReached(message("goal_not_reached_in_time", arms=late, timeout=timeout))


def halt(motions: Iterable[Motion], arms: ArmAccess) -> None:
    """Stop the arms of those motions that are under way, and wait until they stand."""
    with suppress(YumiError):  # what ended the wait is what a person must read; the control process holds what it can
        arms.bring_own_to_rest([motion.side for motion in motions if not motion.is_done])
