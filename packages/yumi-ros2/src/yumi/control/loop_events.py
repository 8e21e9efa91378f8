"""Events of the control loop in order: sessions, feedback, ignored references, failed cycles, faults, commanders.

They come through the pipe of the control process.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from abb_protocols.catalogue import Message, message
from abb_protocols.robot.joints import Joints, Side
from yumi.control.shared_state import ArmProblem, Limited
from yumi.control.stream_monitor import StreamReport


@dataclass(frozen=True, slots=True)
class Happened:
    """Something that happened to an arm; its string is a sentence for a log.

    Attributes:
        side: which arm.
    """

    side: Side

    @property
    def said(self) -> Message:
        """What happened, as a message."""
        raise NotImplementedError

    def __str__(self) -> str:
        return str(self.said)


@dataclass(frozen=True, slots=True)
class SessionStarted(Happened):
    """The robot began to send datagrams for an arm.

    Attributes:
        session: its number.
        deactivated: controllers that commanded the arm in the session before, whose end was not seen.
    """

    session: int
    deactivated: tuple[str, ...] = ()

    @property
    def said(self) -> Message:
        if not self.deactivated:
            return message("session_started", arm=self.side.word, session=self.session)
        return message(
            "session_restarted_in_motion", arm=self.side.word, session=self.session, controllers=self.deactivated
        )


@dataclass(frozen=True, slots=True)
class SessionResumed(Happened):
    """The robot's datagrams arrive again after a silence during which it went on with its session."""

    session: int

    @property
    def said(self) -> Message:
        return message("session_resumed", arm=self.side.word, session=self.session)


@dataclass(frozen=True, slots=True)
class SessionLost(Happened):
    """No datagram was received for too long.

    Attributes:
        silence: for how long [s].
        deactivated: controllers that commanded the arm until then; none after an ordered stop.
        stood_still: how long the control process itself did not run meanwhile [s]; 0 where the robot was silent.
    """

    silence: float
    deactivated: tuple[str, ...]
    stood_still: float = 0.0

    @property
    def said(self) -> Message:
        if self.stood_still and self.deactivated:
            return message(
                "driver_stood_still_in_motion",
                arm=self.side.word,
                duration=self.stood_still,
                controllers=self.deactivated,
            )
        if self.stood_still:
            return message("driver_stood_still", arm=self.side.word, duration=self.stood_still)
        if self.deactivated:
            return message("feedback_lost", arm=self.side.word, silence=self.silence, controllers=self.deactivated)
        return message("session_ended", arm=self.side.word, silence=self.silence)


@dataclass(frozen=True, slots=True)
class RobotFollows(Happened):
    """The robot began to follow commands."""

    @property
    def said(self) -> Message:
        return message("robot_follows", arm=self.side.word)


@dataclass(frozen=True, slots=True)
class RobotStoppedFollowing(Happened):
    """The robot still sends datagrams but no longer follows commands.

    Attributes:
        deactivated: controllers that commanded the arm until then; none after an ordered stop.
    """

    deactivated: tuple[str, ...]

    @property
    def said(self) -> Message:
        if not self.deactivated:
            return message("robot_stopped_following", arm=self.side.word)
        return message("robot_stopped_following_in_motion", arm=self.side.word, controllers=self.deactivated)


@dataclass(frozen=True, slots=True)
class ImplausibleFeedback(Happened):
    """A position was reported that the arm cannot have reached; it was not used.

    Attributes:
        joint: the joint that is furthest away, by name.
        distance: by how much [rad].
        position: what was reported [rad], (7,).
        deactivated: controllers that commanded the arm, once the feedback has not been believed for too long.
        is_lost: whether it has.
        is_other_arm: whether that is where the other arm is.
    """

    joint: str
    distance: float
    position: Joints
    deactivated: tuple[str, ...] = ()
    is_lost: bool = False
    is_other_arm: bool = False

    @property
    def said(self) -> Message:
        if not self.is_lost:
            return message("position_not_believed", arm=self.side.word, joint=self.joint, distance=self.distance)
        return message(
            "position_not_believed_for_long",
            arm=self.side.word,
            joint=self.joint,
            distance=self.distance,
            ended=_ended(self.deactivated),
            cause=message("positions_of_other_arm") if self.is_other_arm else message("positions_implausible"),
        )


@dataclass(frozen=True, slots=True)
class ReferencesIgnored(Happened):
    """The robot plans to stand although it is commanded to move.

    Attributes:
        deactivated: controllers that commanded the arm until then.
    """

    deactivated: tuple[str, ...] = ()

    @property
    def said(self) -> Message:
        return message(
            "arm_holds_ignored",
            problem=message("references_ignored", arm=self.side.word),
            ended=_ended(self.deactivated),
        )


@dataclass(frozen=True, slots=True)
class ControllersLate(Happened):
    """No controller answered in time, and the core braked the arm; reported about once a second while it lasts.

    Attributes:
        cycles: datagrams that the core answered since the last report.
        controllers: that command the arm, or did until then.
        deactivated: those of them that were deactivated, since the core had to answer for too long in a row.
    """

    cycles: int
    controllers: tuple[str, ...]
    deactivated: tuple[str, ...] = ()

    @property
    def said(self) -> Message:
        if self.deactivated:
            return message("controllers_hung", arm=self.side.word, cycles=self.cycles, controllers=self.deactivated)
        if not self.controllers:
            return message("loop_was_late", arm=self.side.word, cycles=self.cycles)
        return message("controllers_were_late", arm=self.side.word, cycles=self.cycles, controllers=self.controllers)


@dataclass(frozen=True, slots=True)
class ProblemOver(Happened):
    """What made the arm hold is over; it goes on holding until it is commanded."""

    problem: ArmProblem

    @property
    def said(self) -> Message:
        if self.problem is ArmProblem.REFERENCES_IGNORED:
            return message("references_followed_again", arm=self.side.word)
        return message("positions_plausible_again", arm=self.side.word)


@dataclass(frozen=True, slots=True)
class KeptApart(Happened):
    """An arm is limited because it would come too near to something; reported about once a second while it lasts.

    Attributes:
        limited: the two parts and their distance.
    """

    limited: Limited

    @property
    def said(self) -> Message:
        return message("motion_limited", arm=self.side.word, limited=self.limited.said)


@dataclass(frozen=True, slots=True)
class AllowedCollisionsChanged(Happened):
    """Other parts may touch than before, of both arms: see :mod:`yumi.control.allowed_collisions`.

    Attributes:
        side: the arm under which it is recorded; it concerns both.
        pairs: of parts that may touch now.
    """

    side: Side = field(default=Side.RIGHT, init=False)
    pairs: tuple[tuple[str, str], ...]

    @property
    def said(self) -> Message:
        if not self.pairs:
            return message("all_kept_apart")
        return message("may_touch", pairs=tuple(f"{part} - {other}" for part, other in self.pairs))


@dataclass(frozen=True, slots=True)
class ControllerFailed(Happened):
    """A controller raised an error in its update."""

    failure: Message

    @property
    def said(self) -> Message:
        return message("controller_failed", arm=self.side.word, failure=self.failure)


@dataclass(frozen=True, slots=True)
class ControllerReport(Happened):
    """Something a controller reports, in the order in which it happened.

    Attributes:
        controller: its name.
        report: a frozen value of the controller's own kind, see :meth:`.Controller.take_reports`.
    """

    controller: str
    report: object

    @property
    def said(self) -> Message:
        said = getattr(self.report, "said", None)
        report = said if isinstance(said, Message) else message("text", text=str(self.report))
        return message("controller_reports", arm=self.side.word, controller=self.controller, report=report)


@dataclass(frozen=True, slots=True)
class CycleFailed(Happened):
    """A cycle could not be completed; reported at most every few seconds."""

    failure: str

    @property
    def said(self) -> Message:
        return message("cycle_failed", arm=self.side.word, failure=self.failure)


@dataclass(frozen=True, slots=True)
class ReportsDropped(Happened):
    """The driver did not read what the control process reported, and reads again: one event for each arm, which holds.

    Attributes:
        count: how many events and answers, of both arms, were dropped.
    """

    count: int

    @property
    def said(self) -> Message:
        return message("reports_dropped", arm=self.side.word, count=self.count)


@dataclass(frozen=True, slots=True)
class ControlProcessEnded(Happened):
    """The control process has ended by itself: one event for each arm."""

    exit_code: int | None

    @property
    def said(self) -> Message:
        return message("control_process_ended", arm=self.side.word, exit_code=self.exit_code)


@dataclass(frozen=True, slots=True)
class CommanderSilent(Happened):
    """Who commanded an arm has sent nothing for too long: the arm comes to rest and holds.

    Attributes:
        silence: for how long [s].
    """

    silence: float

    @property
    def said(self) -> Message:
        return message("commander_silent", arm=self.side.word, silence=self.silence)


@dataclass(frozen=True, slots=True)
class CommanderChanged(Happened):
    """Another one commands an arm, or a person has let the arm go.

    Attributes:
        who: commands it now, see :class:`yumi.control.hand_over.Commander`.
        client: whose commands they are; where none commands the arm now, whose they were.
        before: who commanded it until then.
    """

    who: str
    client: str
    before: str

    @property
    def said(self) -> Message:
        if self.who == "none":
            return message("arm_let_go", arm=self.side.word, client=self.client, before=self.before)
        if self.before == "none":
            return message("arm_taken", arm=self.side.word, who=self.who, client=self.client)
        return message("arm_taken_over", arm=self.side.word, who=self.who, client=self.client, before=self.before)


@dataclass(frozen=True, slots=True)
class ArmGivenBack(Happened):
    """An arm that was reserved for people may be commanded by programs again."""

    @property
    def said(self) -> Message:
        return message("arm_given_back", arm=self.side.word)


Event = (
    SessionStarted
    | SessionResumed
    | SessionLost
    | RobotFollows
    | RobotStoppedFollowing
    | ImplausibleFeedback
    | ReferencesIgnored
    | ProblemOver
    | ControllersLate
    | KeptApart
    | AllowedCollisionsChanged
    | ControllerFailed
    | ControllerReport
    | CycleFailed
    | ReportsDropped
    | ControlProcessEnded
    | CommanderSilent
    | CommanderChanged
    | ArmGivenBack
)
"""What happened to an arm."""


def is_fault(event: Event) -> bool:
    """Whether ``event`` is a fault: nothing had asked for it."""
    if isinstance(event, SessionStarted | SessionLost | RobotStoppedFollowing | ControllersLate):
        return bool(event.deactivated)
    if isinstance(event, ImplausibleFeedback):
        return event.is_lost
    return isinstance(event, ReferencesIgnored | ControllerFailed | CycleFailed | ReportsDropped | ControlProcessEnded)


def is_logged(event: Event) -> bool:
    """Whether a log has ``event``: a controller's own reports are for who has commanded it, but those of a stream."""
    return not isinstance(event, ControllerReport) or isinstance(event.report, StreamReport)


def is_warning(event: Event) -> bool:
    """Whether a person should look at it: a fault, or a stream that leaves its range."""
    if isinstance(event, ControllerReport):
        return isinstance(event.report, StreamReport) and event.report.is_warning
    return is_fault(event)


def _ended(controllers: tuple[str, ...]) -> Message:
    return message("controllers_deactivated", controllers=controllers) if controllers else message("nothing")
