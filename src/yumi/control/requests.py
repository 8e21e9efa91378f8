"""What is asked of the fast line between two cycles, what it answers, and what it tells unasked.

Orders for both arms, whose controllers live in processes of their own: all are taken or none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from math import degrees

from yumi.control.controller import ControllerInfo, HardwareInfo, ParameterInfo, State
from yumi.control.shared_state import CAUSES, Problem
from yumi.errors import CommandRefused, YumiError
from yumi.robot.joints import Joints, Side
from yumi.settings import Values


class Strictness(IntEnum):
    """What becomes of a switch that names controllers which cannot do what they shall; the numbers are the wire's.

    BEST_EFFORT leaves those out, STRICT refuses the whole switch. AUTO and FORCE_AUTO are BEST_EFFORT, as upstream.
    """

    BEST_EFFORT = 1
    STRICT = 2
    AUTO = 3
    FORCE_AUTO = 4


@dataclass(frozen=True, slots=True)
class LoadController:
    """Make a controller, unconfigured.

    Attributes:
        kind: its type, one of those in :attr:`Done.kinds`.
        values: parameters that differ from their defaults.
    """

    side: Side
    name: str
    kind: str
    values: Values = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ConfigureController:
    """Have an unconfigured or inactive controller take its parameters; it is inactive then."""

    side: Side
    name: str


@dataclass(frozen=True, slots=True)
class CleanupController:
    """Make an inactive controller unconfigured."""

    side: Side
    name: str


@dataclass(frozen=True, slots=True)
class UnloadController:
    """Forget a controller that is not active."""

    side: Side
    name: str


@dataclass(frozen=True, slots=True)
class SwitchControllers:
    """Activate and deactivate controllers of one arm as one step between two cycles.

    Attributes:
        activate: names of inactive controllers, or of active ones that are in ``deactivate``, too: a restart.
        deactivate: names of active controllers.
        strictness: what becomes of those that cannot.
    """

    side: Side
    activate: tuple[str, ...] = ()
    deactivate: tuple[str, ...] = ()
    strictness: Strictness = Strictness.STRICT


@dataclass(frozen=True, slots=True)
class HoldArm:
    """Deactivate whatever commands an arm; it comes to rest and holds."""

    side: Side


@dataclass(frozen=True, slots=True)
class SetParameters:
    """Change parameters of one controller from the next cycle on, all or none."""

    side: Side
    controller: str
    values: Values = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ListParameters:
    """Tell what can be set on one controller and what is set: :attr:`Done.parameters`."""

    side: Side
    controller: str


@dataclass(frozen=True, slots=True)
class ListControllers:
    """Tell which controllers one arm has: :attr:`Done.controllers`."""

    side: Side


@dataclass(frozen=True, slots=True)
class ListControllerKinds:
    """Tell which types of controllers can be loaded: :attr:`Done.kinds`."""

    side: Side


@dataclass(frozen=True, slots=True)
class ListHardware:
    """Tell what state an arm's hardware component and its interfaces are in: :attr:`Done.hardware`."""

    side: Side


@dataclass(frozen=True, slots=True)
class SetHardwareState:
    """Lead an arm's hardware component to a state; who uses what it no longer offers is deactivated.

    Attributes:
        name: the component's name.
        state: unconfigured, inactive or active.
    """

    side: Side
    name: str
    state: State


@dataclass(frozen=True, slots=True)
class Order:
    """What one active controller shall take, see :meth:`yumi.control.controller.Controller.receive`.

    Attributes:
        controller: its name.
        message: a picklable value it knows.
    """

    side: Side
    controller: str
    message: object


@dataclass(frozen=True, slots=True)
class CheckOrders:
    """Tell whether the controllers would take their orders now; nothing is changed."""

    orders: tuple[Order, ...]


@dataclass(frozen=True, slots=True)
class SendOrders:
    """Have controllers of one or both arms take their orders, each between two cycles of its arm, all or none.

    Orders that shall begin at the same time name it: each arm has a clock of its own, its robot's datagrams.
    """

    orders: tuple[Order, ...]


@dataclass(frozen=True, slots=True)
class Stop:
    """End the fast line when its arm stands."""


ArmRequest = (
    LoadController
    | ConfigureController
    | CleanupController
    | UnloadController
    | SwitchControllers
    | HoldArm
    | SetParameters
    | ListParameters
    | ListControllers
    | ListControllerKinds
    | ListHardware
    | SetHardwareState
)
"""What concerns one arm."""

Orders = CheckOrders | SendOrders

Request = ArmRequest | Orders


@dataclass(frozen=True, slots=True)
class Done:
    """The request was carried out.

    Attributes:
        sentence: what a switch came to, in the words of ros2_control; else empty.
        controllers: the answer to :class:`ListControllers`.
        kinds: the answer to :class:`ListControllerKinds`.
        parameters: the answer to :class:`ListParameters`.
        hardware: the answer to :class:`ListHardware` and :class:`SetHardwareState`.
    """

    sentence: str = ""
    controllers: tuple[ControllerInfo, ...] = ()
    kinds: tuple[str, ...] = ()
    parameters: tuple[ParameterInfo, ...] = ()
    hardware: tuple[HardwareInfo, ...] = ()


@dataclass(frozen=True, slots=True)
class Refusal:
    """The request broke a rule and changed nothing; where a switch failed halfway, the sentence says what it left."""

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
    """The robot plans to stand although it is told to move.

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
class ControllerFailed:
    """A controller raised an error in its update."""

    side: Side
    sentence: str

    def __str__(self) -> str:
        return f"{self.side.word.capitalize()} arm: {self.sentence}"


@dataclass(frozen=True, slots=True)
class ControllerNotice:
    """Something a controller has to tell, in the order in which it happened.

    Attributes:
        controller: its name.
        notice: a frozen value of the controller's own kind, see :meth:`.Controller.take_notices`.
    """

    side: Side
    controller: str
    notice: object

    def __str__(self) -> str:
        return f"{self.side.word.capitalize()} arm: {self.controller}: {self.notice}"


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
            "robot gets no answers any more and keeps its last references. Call recover, which starts another one."
        )


def is_fault(event: Event) -> bool:
    """Whether ``event`` is one that nobody asked for."""
    if isinstance(event, SessionStarted | SessionLost | RobotStoppedFollowing):
        return bool(event.deactivated)
    if isinstance(event, ImplausibleFeedback):
        return event.is_lost
    return isinstance(event, ReferencesIgnored | ControllerFailed | CycleFailed | FastLineEnded)


Event = (
    SessionStarted
    | SessionResumed
    | SessionLost
    | RobotFollows
    | RobotStoppedFollowing
    | ImplausibleFeedback
    | ReferencesIgnored
    | ProblemOver
    | ControllerFailed
    | ControllerNotice
    | CycleFailed
    | FastLineEnded
)


Ask = Callable[[Side, CheckOrders | SendOrders | HoldArm], Done]
"""Has a request served by one arm's fast line; raises what it raises."""


def check_orders(orders: Sequence[Order], ask: Ask) -> Done:
    """Whether every controller would take its order now; nothing is changed.

    Raises:
        CommandRefused: one would not.
    """
    for side, own in _by_side(orders).items():
        ask(side, CheckOrders(own))
    return Done()


def send_orders(orders: Sequence[Order], ask: Ask) -> Done:
    """Have every controller take its order: all are checked before any is taken.

    Should an arm have changed its mind between the two, the arms that took theirs are made to hold.

    Raises:
        CommandRefused: a controller does not take its order.
    """
    by_side = _by_side(orders)
    if len(by_side) > 1:  # one arm checks all of its own before it takes any
        check_orders(orders, ask)
    told: list[Side] = []
    for side, own in by_side.items():
        try:
            ask(side, SendOrders(own))
        except YumiError as refusal:
            for other in told:
                ask(other, HoldArm(other))
            held = "".join(f" The {other.word} arm had taken its order and holds." for other in told)
            raise CommandRefused(f"{refusal}{held}") from refusal
        told.append(side)
    return Done()


def _by_side(orders: Sequence[Order]) -> dict[Side, tuple[Order, ...]]:
    sides = dict.fromkeys(order.side for order in orders)
    return {side: tuple(order for order in orders if order.side is side) for side in sides}
