"""Events of the control process: what happened to an arm, in the order in which it happened."""

from __future__ import annotations

from dataclasses import dataclass
from math import degrees
from typing import ClassVar

from yumi.control.shared_state import CAUSES, Limited, Problem
from yumi.robot.joints import Joints, Side


@dataclass(frozen=True, slots=True)
class SessionStarted:
    """The robot began to send datagrams for an arm.

    Attributes:
        session: its number.
        deactivated: controllers that commanded the arm in the session before, whose end was not seen.
    """

    side: Side
    session: int
    deactivated: tuple[str, ...] = ()

    def __str__(self) -> str:
        arm = self.side.word.capitalize()
        if not self.deactivated:
            return f"{arm} arm: EGM session {self.session} started."
        return (
            f"{arm} arm: the robot began EGM session {self.session} in the middle of a motion; "
            f"{', '.join(self.deactivated)} deactivated. Call start_egm to go on."
        )


@dataclass(frozen=True, slots=True)
class SessionResumed:
    """The robot's datagrams arrive again after a silence during which it went on with its session."""

    side: Side
    session: int

    def __str__(self) -> str:
        arm = self.side.word.capitalize()
        return f"{arm} arm: EGM feedback is back, session {self.session} goes on and the arm holds."


@dataclass(frozen=True, slots=True)
class SessionLost:
    """No datagram was received for too long.

    Attributes:
        silence: for how long [s].
        deactivated: controllers that commanded the arm until then; none after an ordered stop.
        stood_still: how long the control process itself did not run meanwhile [s]; 0 where the robot was silent.
    """

    side: Side
    silence: float
    deactivated: tuple[str, ...]
    stood_still: float = 0.0

    def __str__(self) -> str:
        arm, silence = self.side.word.capitalize(), f"silent for {self.silence * 1e3:.0f} ms"
        if self.stood_still:
            what = f"{arm} arm: the control process stood still for {self.stood_still:.2g} s"
            if not self.deactivated:
                return f"{what}; the arm was not controlled meanwhile."
            return (
                f"{what}, the arm was not controlled meanwhile; {', '.join(self.deactivated)} deactivated. "
                "Call start_egm to go on."
            )
        if not self.deactivated:
            return f"{arm} arm: EGM has ended, the robot is {silence}."
        return (
            f"{arm} arm: EGM feedback lost, the robot has been {silence}; {', '.join(self.deactivated)} deactivated. "
            "Call start_egm when the controller is back."
        )


@dataclass(frozen=True, slots=True)
class RobotFollows:
    """The robot began to follow commands."""

    side: Side

    def __str__(self) -> str:
        return f"{self.side.word.capitalize()} arm: the robot follows commands."


@dataclass(frozen=True, slots=True)
class RobotStoppedFollowing:
    """The robot still sends datagrams but no longer follows commands.

    Attributes:
        deactivated: controllers that commanded the arm until then; none after an ordered stop.
    """

    side: Side
    deactivated: tuple[str, ...]

    def __str__(self) -> str:
        arm = self.side.word.capitalize()
        if not self.deactivated:
            return f"{arm} arm: the robot follows commands no longer."
        return (
            f"{arm} arm: the robot follows commands no longer; {', '.join(self.deactivated)} deactivated. "
            "Call start_egm to go on."
        )


@dataclass(frozen=True, slots=True)
class ImplausibleFeedback:
    """A position was reported that the arm cannot have reached; it was not used.

    Attributes:
        joint: the joint that is furthest away, by name.
        distance: by how much [rad].
        position: what was reported [rad], (7,).
        deactivated: controllers that commanded the arm, once the feedback has not been believed for too long.
        is_lost: whether it has.
        is_other_arm: whether that is where the other arm is.
    """

    side: Side
    joint: str
    distance: float
    position: Joints
    deactivated: tuple[str, ...] = ()
    is_lost: bool = False
    is_other_arm: bool = False

    def __str__(self) -> str:
        arm = self.side.word.capitalize()
        what = f"the reported position of {self.joint} is {degrees(self.distance):.1f}° from where the arm can be"
        if not self.is_lost:
            return f"{arm} arm: {what}; the datagram was not used (an old, forged or mixed-up one)."
        ended = f"; {', '.join(self.deactivated)} deactivated" if self.deactivated else ""
        cause = CAUSES[Problem.IMPLAUSIBLE]
        if self.is_other_arm:
            cause = (
                "that is where the other arm is: left and right EGM ports are exchanged? Check the remote ports of the "
                "controller's UDPUC devices ROB_L and ROB_R"
            )
        return f"{arm} arm: {what}, the arm holds{ended}: {cause}. Stop and start EGM when that is mended."


@dataclass(frozen=True, slots=True)
class ReferencesIgnored:
    """The robot plans to stand although it is commanded to move.

    Attributes:
        deactivated: controllers that commanded the arm until then.
    """

    side: Side
    deactivated: tuple[str, ...] = ()

    def __str__(self) -> str:
        ended = f"; {', '.join(self.deactivated)} deactivated" if self.deactivated else ""
        return f"{self.side.word.capitalize()} arm: {CAUSES[Problem.REFERENCES_IGNORED]}. The arm holds{ended}."


@dataclass(frozen=True, slots=True)
class ProblemOver:
    """What made the arm hold is over; it goes on holding until it is commanded."""

    side: Side
    problem: Problem

    def __str__(self) -> str:
        arm = self.side.word.capitalize()
        if self.problem is Problem.REFERENCES_IGNORED:
            return f"{arm} arm: the robot follows the references again. Call recover to go on."
        return f"{arm} arm: the reported positions are plausible again. Call recover to go on."


@dataclass(frozen=True, slots=True)
class KeptApart:
    """An arm is limited because it would come too near to something; reported about once a second while it lasts.

    Attributes:
        limited: the two parts and their distance.
    """

    side: Side
    limited: Limited

    def __str__(self) -> str:
        return f"{self.side.word.capitalize()} arm: motion limited by {self.limited}."


@dataclass(frozen=True, slots=True)
class AllowedCollisionsChanged:
    """Other parts may touch than before, of both arms: see :mod:`yumi.control.allowed_collisions`.

    Attributes:
        side: the arm under which it is recorded; it concerns both.
        pairs: of parts that may touch now.
    """

    side: ClassVar[Side] = Side.RIGHT
    pairs: tuple[tuple[str, str], ...]

    def __str__(self) -> str:
        if not self.pairs:
            return "All parts are kept apart again, and the arms have their speed."
        allowed = ", ".join(f"{part} - {other}" for part, other in self.pairs)
        return f"May touch for a while, slowly: {allowed}."


@dataclass(frozen=True, slots=True)
class ControllerFailed:
    """A controller raised an error in its update."""

    side: Side
    sentence: str

    def __str__(self) -> str:
        return f"{self.side.word.capitalize()} arm: {self.sentence}"


@dataclass(frozen=True, slots=True)
class ControllerReport:
    """Something a controller reports, in the order in which it happened.

    Attributes:
        controller: its name.
        report: a frozen value of the controller's own kind, see :meth:`.Controller.take_reports`.
    """

    side: Side
    controller: str
    report: object

    def __str__(self) -> str:
        return f"{self.side.word.capitalize()} arm: {self.controller}: {self.report}"


@dataclass(frozen=True, slots=True)
class CycleFailed:
    """A cycle could not be completed; reported at most every few seconds."""

    side: Side
    sentence: str

    def __str__(self) -> str:
        return f"{self.side.word.capitalize()} arm: a cycle could not be completed: {self.sentence}."


@dataclass(frozen=True, slots=True)
class ReportsDropped:
    """The driver did not read what the control process reported, and reads again: one event for each arm, which holds.

    Attributes:
        count: how many events and answers, of both arms, were dropped.
    """

    side: Side
    count: int

    def __str__(self) -> str:
        return (
            f"{self.side.word.capitalize()} arm: the driver did not read the control process's reports for a while and "
            f"{self.count} were dropped; the arms were served meanwhile, and hold now. Was the driver stopped or its "
            "machine overloaded? See the state for what holds now."
        )


@dataclass(frozen=True, slots=True)
class ControlProcessEnded:
    """The control process has ended by itself: one event for each arm."""

    side: Side
    exit_code: int | None

    def __str__(self) -> str:
        return (
            f"{self.side.word.capitalize()} arm: the control process has ended (exit code {self.exit_code}); the "
            "robot gets no answers any more and keeps its last references. Call recover, which starts another one."
        )


def is_fault(event: Event) -> bool:
    """Whether ``event`` is a fault: nothing had asked for it."""
    if isinstance(event, SessionStarted | SessionLost | RobotStoppedFollowing):
        return bool(event.deactivated)
    if isinstance(event, ImplausibleFeedback):
        return event.is_lost
    return isinstance(event, ReferencesIgnored | ControllerFailed | CycleFailed | ReportsDropped | ControlProcessEnded)


Event = (
    SessionStarted
    | SessionResumed
    | SessionLost
    | RobotFollows
    | RobotStoppedFollowing
    | ImplausibleFeedback
    | ReferencesIgnored
    | ProblemOver
    | KeptApart
    | AllowedCollisionsChanged
    | ControllerFailed
    | ControllerReport
    | CycleFailed
    | ReportsDropped
    | ControlProcessEnded
)
