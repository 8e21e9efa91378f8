"""Teleoperation of the robot: who operates, which frames of the device count, and both arms with their grippers.

What decides about an arm is :mod:`yumi.driver.teleoperated_arm`. On the way from a frame to the control process nothing
waits: an arm is taken over and a gripper gets its goal on other threads.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from contextlib import AbstractContextManager, suppress
from functools import partial
from math import inf
from threading import Lock
from typing import NamedTuple, Protocol

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused, YumiError
from abb_protocols.robot.description import FINGERTIPS
from abb_protocols.robot.joints import Side
from abb_runtime.clock import Clock
from yumi.control.hand_over import Commander, HandOver, requested_by
from yumi.control.shared_state import Snapshots
from yumi.driver.device_frame import ClutchWord, DeviceFrame, TeleoperatedArmReport, TeleoperationReport
from yumi.driver.gripper_follower import GripperFollower
from yumi.driver.reports import Said
from yumi.driver.teleoperated_arm import (
    DEVICE_LINK_LOST,
    ArmNow,
    Clutch,
    ClutchStep,
    MotionGoal,
    TeleoperatedArm,
    TeleoperationFollower,
)

OPERATOR_HOLDS = 1.0
"""An operator whose device has sent nothing for so long makes room for another one [s]."""

_DEVICES = (Commander.DEVICE, Commander.HEADSET)
_CLOCKS_DIFFER = 1e-3  # by so much a second two clocks may run apart
_WORDS: Mapping[Clutch, ClutchWord] = {
    Clutch.RELEASED: "released",
    Clutch.ENGAGING: "engaging",
    Clutch.ENGAGED: "engaged",
    Clutch.INERT: "inert",
}


class Made(NamedTuple):
    """When a frame was made, on the clock here [s].

    Attributes:
        at: as if the frame that came fastest had taken no time.
        earliest: the frame was not made before.
    """

    at: float
    earliest: float


class DeviceClock:
    """The clock of a device, seen from here: bounds of what it is behind, of all frames.

    A frame was made before it came, and after whatever time from here the device had seen by then. The frame that came
    fastest gives the one bound, and the one that was made soonest after such a time came there the other one.

    Attributes:
        newest: the time of the newest frame, on the device's clock [s].
    """

    def __init__(self) -> None:
        self.newest = -inf
        self._behind = (-inf, inf)  # at least, at most [s]
        self._now = -inf

    def here(self, time: float, now: float, seen: float | None = None) -> Made:
        """When a frame that came ``now`` was made, which a device made that had ``seen`` a time from here by then."""
        drift = _CLOCKS_DIFFER * (now - self._now) if self._now > -inf else 0.0
        self._now = now
        least, most = self._behind
        least, most = least - drift, min(most + drift, now - time)
        if seen is not None:
            least = max(least, seen - time)
            if least > most:  # the device's clock was set, or stood while the device slept
                least, most = seen - time, now - time
        self._behind = least, most
        return Made(time + most, time + (most if seen is None else least))


class TeleoperatedArms(Protocol):
    """The arms as teleoperation moves them."""

    clock: Clock

    def begin_following(self, side: Side, follower: TeleoperationFollower) -> None: ...

    def follow_device(self, side: Side, goal: MotionGoal, time: float, until: float) -> None: ...

    def is_following(self, side: Side) -> bool: ...

    def end_following(self, side: Side) -> None: ...


class TeleoperatedControl(Snapshots, Protocol):
    """Where an arm is, and who commands it."""

    hand_over: HandOver


Elsewhere = Callable[[Callable[[], None]], None]
"""Has something done on a thread that may wait."""


class _Arm:
    """What belongs to one arm; ``press`` counts how often its clutch was pressed."""

    def __init__(self, side: Side) -> None:
        self.teleoperated = TeleoperatedArm(side, FINGERTIPS)
        self.press = 0
        self.taken = -1  # the press for which the arm was taken over


class Teleoperation:
    """Teleoperation of one robot, safe from any thread.

    Args:
        arms: that are moved.
        control: the control process.
        grippers: of both arms.
        on_change: called when an arm was taken over.
    """

    def __init__(
        self,
        arms: TeleoperatedArms,
        control: TeleoperatedControl,
        grippers: Mapping[Side, GripperFollower],
        on_change: Callable[[], None] = lambda: None,
    ) -> None:
        self._robot, self._control, self._grippers, self._on_change = arms, control, grippers, on_change
        self._lock = Lock()
        self._arms = {side: _Arm(side) for side in Side}
        self._operator: Hashable = None
        self._came_at = -inf
        self._until = -inf  # then the newest frame is so old that the link counts as lost
        self._clock = DeviceClock()
        self._dropped = 0

    def take(
        self,
        frame: DeviceFrame,
        operator: Hashable,
        elsewhere: Elsewhere,
        who: Commander = Commander.DEVICE,
        name: str = "",
    ) -> TeleoperationReport:
        """Have the arms follow a frame of the operator's device; ``who`` commands them meanwhile, ``name`` for people.

        Raises:
            CommandRefused: another operator's device moves the arms.
        """
        asked = partial(requested_by, who, operator, name)
        with asked():
            return self._take(frame, operator, elsewhere, asked)

    def _take(
        self,
        frame: DeviceFrame,
        operator: Hashable,
        elsewhere: Elsewhere,
        asked: Callable[[], AbstractContextManager[None]],
    ) -> TeleoperationReport:
        now = self._robot.clock.now()
        steps: dict[Side, ClutchStep] = {}
        with self._lock:
            self._check_operator(operator, now)
            is_new = operator is not self._operator
            if is_new:
                self._operator, self._dropped, self._clock = operator, 0, DeviceClock()
            made = self._clock.here(frame.time, now, frame.seen)
            is_in_time = now - made.earliest <= DEVICE_LINK_LOST and (frame.seen is None or frame.seen <= now)
            if is_new or now > self._until:
                # Nothing moves by connecting: who begins with a held clutch has to press it again, too.
                why = "teleoperation_begins" if is_new else "teleoperation_link_lost"
                slow = message("teleoperation_link_slow", age=now - made.earliest, most=DEVICE_LINK_LOST)
                steps |= self._end_all(message(why) if is_in_time else slow)
            if frame.time <= self._clock.newest or not is_in_time:
                self._dropped += 1
            else:
                self._clock.newest, self._came_at, self._until = frame.time, now, made.earliest + DEVICE_LINK_LOST
                steps |= self._move(frame, now, made.at)
            presses = {side: self._arms[side].press for side in steps}
        for side, step in steps.items():
            self._carry_out(side, step, presses[side], elsewhere, asked)
        with self._lock:
            return self._report()

    def _move(self, frame: DeviceFrame, now: float, made_at: float) -> dict[Side, ClutchStep]:
        """Give the arms their goals; what is left to do, by arm."""
        steps = {}
        for side, hand in frame.by_arm.items():
            arm = self._arms[side]
            is_kept = self._control.hand_over.is_own(side) and self._robot.is_following(side)
            state = ArmNow(self._control.snapshot(side).sent, arm.taken == arm.press, is_kept)
            step = arm.teleoperated.take(hand, frame.settings, frame.time, now, state)
            if step.goal is not None:
                self._robot.follow_device(side, step.goal, made_at, self._until)
            if step.take_over is not None:
                arm.press += 1
            if step.brakes or step.take_over is not None or step.gripper is not None:
                steps[side] = step
        for side, arm in self._arms.items():
            if arm.teleoperated.clutch in (Clutch.ENGAGING, Clutch.ENGAGED):
                self._control.hand_over.renew(side, self._until - now)
            elif self._control.hand_over.of(side).who in _DEVICES:  # the operator's page may move the arm otherwise
                self._control.hand_over.let_go(side)
        return steps

    def lasts(self) -> float:
        """How long the link counts as alive if no other frame comes [s]."""
        with self._lock:
            return max(0.0, self._until - self._robot.clock.now())

    def lose(self, operator: Hashable) -> None:
        """No more frames come from the operator: the arms that follow brake, and their clutches are inert."""
        with self._lock:
            is_operator = operator is self._operator
            steps = self._end_all(message("teleoperation_link_lost")) if is_operator else {}
        with requested_by(client=operator):
            for side in steps:
                self._brake(side)
                self._control.hand_over.let_go(side)

    def _check_operator(self, operator: Hashable, now: float) -> None:
        if operator is not self._operator and self._operator is not None and now - self._came_at < OPERATOR_HOLDS:
            raise CommandRefused(message("teleoperated_by_another"))

    def _end_all(self, why: Message) -> dict[Side, ClutchStep]:
        """Make every clutch inert; what is left to do for it, by arm."""
        steps = {side: arm.teleoperated.end(why) for side, arm in self._arms.items()}
        return {side: step for side, step in steps.items() if step.brakes}

    def _carry_out(
        self,
        side: Side,
        step: ClutchStep,
        press: int,
        elsewhere: Elsewhere,
        asked: Callable[[], AbstractContextManager[None]],
    ) -> None:
        if step.brakes:
            self._brake(side)
        if step.take_over is not None:
            follower = step.take_over

            def take_over() -> None:
                with asked():  # on another thread
                    self._take_over(side, follower, press)

            elsewhere(take_over)
        if step.gripper is not None and (work := self._grippers[side].take(step.gripper)) is not None:
            elsewhere(work)

    def _brake(self, side: Side) -> None:
        self._grippers[side].forget()
        with suppress(YumiError):  # an arm that does not answer follows no stream either: it ends with the frames
            self._robot.end_following(side)

    def _take_over(self, side: Side, follower: TeleoperationFollower, press: int) -> None:
        arm = self._arms[side]
        with self._lock:  # an arm whose clutch was released meanwhile is left to whatever commands it
            if arm.press != press or arm.teleoperated.clutch is not Clutch.ENGAGING:
                return
        self._grippers[side].refusal = None
        try:
            self._robot.begin_following(side, follower)
            self._grippers[side].forget()  # what a stream has sent before, and waits for the gripper
        except YumiError as error:
            with self._lock:
                if arm.press == press:
                    arm.teleoperated.end(error.said)
            return
        with self._lock:
            arm.taken = max(arm.taken, press)
        self._on_change()

    def _report(self) -> TeleoperationReport:
        def of(side: Side) -> TeleoperatedArmReport:
            arm, refusal = self._arms[side].teleoperated, self._grippers[side].refusal
            return TeleoperatedArmReport(
                _WORDS[arm.clutch],
                None if arm.why is None else Said.of(arm.why),
                self._control.snapshot(side).limited,
                None if refusal is None else Said.of(refusal),
            )

        return TeleoperationReport(of(Side.RIGHT), of(Side.LEFT), self._dropped)
