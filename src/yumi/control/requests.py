"""What is asked of the fast line between two cycles, what it answers, and what it tells unasked."""

from __future__ import annotations

from dataclasses import dataclass, field

from yumi.control.manager import ControllerInfo
from yumi.robot.joints import Side


@dataclass(frozen=True, slots=True)
class SwitchControllers:
    """Activate and deactivate controllers of one arm as one step."""

    side: Side
    activate: tuple[str, ...] = ()
    deactivate: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class SetParameters:
    """Change parameters of one controller from the next cycle on."""

    side: Side
    controller: str
    values: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ListControllers:
    """Tell which controllers one arm has."""

    side: Side


@dataclass(frozen=True, slots=True)
class Stop:
    """End the fast line when its arm stands."""


Request = SwitchControllers | SetParameters | ListControllers


@dataclass(frozen=True, slots=True)
class Done:
    """The request was carried out.

    Attributes:
        controllers: the answer to :class:`ListControllers`.
    """

    controllers: tuple[ControllerInfo, ...] = ()


@dataclass(frozen=True, slots=True)
class Refusal:
    """The request broke a rule and changed nothing."""

    sentence: str


Reply = Done | Refusal


@dataclass(frozen=True, slots=True)
class SessionStarted:
    """The robot began to send datagrams for an arm.

    Attributes:
        session: its number.
        deactivated: controllers that commanded the arm in the session before, which nobody has seen end.
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
    """No datagram came for too long.

    Attributes:
        silence: how long the robot has been silent [s].
        deactivated: controllers that commanded the arm until then; none after an ordered stop.
    """

    side: Side
    silence: float
    deactivated: tuple[str, ...]

    def __str__(self) -> str:
        arm, silence = self.side.word.capitalize(), f"silent for {self.silence * 1e3:.0f} ms"
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
            f"{arm} arm: the robot follows commands no longer (motors off, RAPID stopped or EGM ended); "
            f"{', '.join(self.deactivated)} deactivated. Call start_egm to go on."
        )


@dataclass(frozen=True, slots=True)
class ControllerFailed:
    """A controller raised an error in its update."""

    side: Side
    sentence: str

    def __str__(self) -> str:
        return f"{self.side.word.capitalize()} arm: {self.sentence}"


@dataclass(frozen=True, slots=True)
class CycleFailed:
    """A cycle could not be completed; told at most every few seconds."""

    side: Side
    sentence: str

    def __str__(self) -> str:
        return f"{self.side.word.capitalize()} arm: a cycle could not be completed: {self.sentence}."


@dataclass(frozen=True, slots=True)
class FastLineEnded:
    """An arm's fast-line process has ended by itself."""

    side: Side
    exit_code: int | None

    def __str__(self) -> str:
        return (
            f"{self.side.word.capitalize()} arm: its fast-line process has ended (exit code {self.exit_code}); the "
            "robot gets no answers any more and keeps its last references. Stop EGM and restart the driver."
        )


def is_fault(event: Event) -> bool:
    """Whether ``event`` is one that nobody asked for."""
    if isinstance(event, SessionStarted | SessionLost | RobotStoppedFollowing):
        return bool(event.deactivated)
    return isinstance(event, ControllerFailed | CycleFailed | FastLineEnded)


Event = (
    SessionStarted
    | SessionResumed
    | SessionLost
    | RobotFollows
    | RobotStoppedFollowing
    | ControllerFailed
    | CycleFailed
    | FastLineEnded
)
