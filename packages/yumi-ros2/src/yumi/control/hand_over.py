"""The hand-over: who commands each arm, who may request it, and what happens when the one who commands lets go.

It decides in the driver's process, through which every command passes: those of controllers go through
:meth:`HandOver.passing`, goals of streams are written inside :meth:`HandOver.writing`. A control process that starts
again finds arms that none commands.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, replace
from enum import Enum
from inspect import signature
from math import inf
from threading import Lock, RLock
from typing import NamedTuple

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import Side
from yumi.control.chunk_commands import FollowChunk
from yumi.control.controller import CONTROLLER_IDLE_TIME
from yumi.control.controllers.joint_goal import StopMotion
from yumi.control.loop_commands import Commands, ControllerCommand
from yumi.control.loop_events import (
    ArmGivenBack,
    CommanderChanged,
    CommanderSilent,
    ControlProcessEnded,
    CycleFailed,
    Event,
    ReferencesIgnored,
    RobotStoppedFollowing,
    SessionLost,
    SessionStarted,
)
from yumi.control.trajectory_commands import CancelTrajectory

MOTION_BEGINS = 0.2
"""A motion that was asked for is seen to move the arm, or to be over, within this time [s]."""

_STOPS = (StopMotion, CancelTrajectory)
"""What ends a motion is open to all, but for a :class:`.StopMotion` by which the requester takes an arm over."""

_ENDINGS = (
    CommanderSilent,
    SessionLost,
    SessionStarted,
    RobotStoppedFollowing,
    ReferencesIgnored,
    ControlProcessEnded,
    CycleFailed,
)


class Commander(Enum):
    """Who commands an arm; the value is the word for people."""

    NONE = "none"
    PAGE = "page"
    HEADSET = "headset"
    DEVICE = "device"
    LEAD_THROUGH = "lead-through"
    TRAJECTORY = "trajectory"
    PLANNER = "planner"
    STREAM = "stream"
    POLICY = "policy"
    RAPID = "RAPID"

    @property
    def is_person(self) -> bool:
        """Whether a person moves the arm at this moment; all others are programs."""
        return self in (Commander.PAGE, Commander.HEADSET, Commander.DEVICE, Commander.LEAD_THROUGH)


@dataclass(frozen=True, slots=True)
class Commanding:
    """Who commands an arm.

    Attributes:
        who: commands it.
        client: whose commands they are: a connection, or another value by which clients differ.
        name: of the client, for people.
        since: when it was taken over, or let go, on the machine's monotonic clock [s].
        is_reserved: whether the arm is kept for people, since a person has let it go and not given it back.
        refused: why the last request to take the arm over was refused; None once one was granted.
    """

    who: Commander = Commander.NONE
    client: Hashable = None
    name: str = ""
    since: float = 0.0
    is_reserved: bool = False
    refused: Message | None = None

    @property
    def is_of_person(self) -> bool:
        """Whether a person commands the arm, or has let it go and not given it back."""
        return self.is_reserved or self.who.is_person

    @property
    def is_own(self) -> bool:
        """Whether the requester on this thread commands the arm."""
        return self.who is not Commander.NONE and self.client == _requester.get().client


class Requester(NamedTuple):
    """The client that requests what is done on this thread.

    Attributes:
        who: None is what the kind of the motion says, such as a stream.
        client: None is the program that owns the driver: ROS, or a script that has connected.
        name: of the client, for people.
        only_holds: whether all that is asked for is that arms come to rest, or hold.
    """

    who: Commander | None = None
    client: Hashable = None
    name: str = ""
    only_holds: bool = False


_requester: ContextVar[Requester] = ContextVar("requester", default=Requester())  # noqa: B039 - it is frozen


@contextmanager
def requested_by(
    who: Commander | None = None, client: Hashable = None, name: str = "", *, only_holds: bool = False
) -> Iterator[None]:
    """Have what is done inside be asked for by ``who``, see :class:`Requester`."""
    token = _requester.set(Requester(who, client, name, only_holds))
    try:
        yield
    finally:
        _requester.reset(token)


def is_person_requesting() -> bool:
    """Whether the requester on this thread is a person."""
    who = _requester.get().who
    return who is not None and who.is_person


class _Held(NamedTuple):
    """A command with what it takes to see that it is over."""

    command: Commanding = Commanding()
    until: float = -inf  # [s] it is over then, unless it is renewed
    is_motion: bool = False  # and then it is not over as long as the arm moves


class HandOver:
    """Who commands both arms; safe from any thread.

    A person may take an arm over from a program at any time; otherwise the one who commands keeps the arm. A program
    commands as long as the arm moves, and a stream for a second after its last goal. A person commands until the
    clutch or key is released, or nothing has come for a time: then the arm is reserved for people until
    :meth:`give_back`, so that no program goes on by itself.

    Args:
        now: the time on the machine's monotonic clock [s].
        is_busy: whether an arm moves, or is on its way however slowly.
        on_event: called with each hand-over, on the thread that made it.

    Attributes:
        own_name: of the client that owns the driver, for people.
    """

    def __init__(
        self,
        now: Callable[[], float],
        is_busy: Callable[[Side], bool] = lambda side: False,
        on_event: Callable[[Event], None] = lambda event: None,
    ) -> None:
        self.own_name = "script"
        self._now, self._is_busy, self._on_event = now, is_busy, on_event
        self._held = dict.fromkeys(Side, _Held())
        self._before: dict[Side, tuple[Commander, object]] = {}  # who commanded last
        self._lock = Lock()  # of what is above, held for moments
        self._gates = {side: RLock() for side in Side}  # held while something that was granted is carried out
        self._events: list[Event] = []

    def of(self, side: Side) -> Commanding:
        """Who commands an arm now."""
        with self._reporting():
            return self._current(side).command

    # ---- taking over

    def take(self, side: Side, kind: Commander, lasts: float | None = CONTROLLER_IDLE_TIME) -> bool:
        """Have the requester command an arm, or go on to.

        Args:
            side: the arm.
            kind: of the motion, for who has not said who it is.
            lasts: the command is over after this time [s], unless it is taken again; None: when the arm stands. That of
                a program is never over before the arm stands.

        Returns:
            Whether another client commanded the arm last: nothing that was sent before may go on.

        Raises:
            CommandRefused: another client commands the arm, or it is reserved for a person.
        """
        with self._gates[side], self._reporting():  # what was granted to another client is over then
            return self._take(side, kind, lasts)

    def take_all(
        self, sides: Collection[Side], kind: Commander, lasts: float | None = CONTROLLER_IDLE_TIME
    ) -> frozenset[Side]:
        """Have the requester command arms, or go on to: all of them, or none.

        Args:
            sides: the arms.
            kind: as for :meth:`take`.
            lasts: as for :meth:`take`.

        Returns:
            Those that another client commanded last.

        Raises:
            CommandRefused: as :meth:`take`, for one of the arms; nothing was changed.
        """
        with ExitStack() as gates:
            ordered = self._entered(gates, sides)
            self.check_all(ordered, kind)
            return frozenset(side for side in ordered if self.take(side, kind, lasts))

    def check(self, side: Side, kind: Commander) -> None:
        """See that the requester could take an arm; nothing is taken. Raises as :meth:`take`."""
        requester = _requester.get()
        with self._reporting():
            self._check(side, self._current(side).command, requester.who or kind, requester.client)

    def check_all(self, sides: Collection[Side], kind: Commander) -> None:
        """See that the requester could take arms, for what comes beside their goals. Raises as :meth:`take`."""
        for side in sides:
            self.check(side, kind)

    @contextmanager
    def writing(
        self, sides: Collection[Side], kind: Commander, lasts: float | None = CONTROLLER_IDLE_TIME
    ) -> Iterator[None]:
        """Take arms, and keep them while goals are written: the client that takes one over next finds its goal written.

        Raises:
            CommandRefused: as :meth:`take_all`.
        """
        with ExitStack() as gates:
            self._entered(gates, sides)
            self.take_all(sides, kind, lasts)
            yield

    def was_of_another(self, side: Side) -> bool:
        """Whether a person, or another client than the requester, commanded an arm last."""
        who, client = self._before.get(side, (Commander.NONE, None))
        return who is not Commander.NONE and (who.is_person or client != _requester.get().client)

    @contextmanager
    def holding(self, side: Side, kind: Commander) -> Iterator[None]:
        """Take an arm for as long as something is done; raises as :meth:`take`."""
        self.take(side, kind, inf)
        try:
            yield
        finally:
            self.let_go(side)

    @contextmanager
    def keeping(self, sides: Collection[Side]) -> Iterator[None]:
        """Keep arms as they are commanded: none takes them over meanwhile."""
        with ExitStack() as gates:
            self._entered(gates, sides)
            yield

    def has_kept(self, side: Side) -> bool:
        """Whether none has taken an arm since the requester commanded it; then its controller of before may have it."""
        command, client = self.of(side), _requester.get().client
        if command.who is not Commander.NONE:
            return command.is_own
        return not command.is_reserved or self._before.get(side, (Commander.NONE, client))[1] == client

    @contextmanager
    def switching(self, sides: Collection[Side]) -> Iterator[None]:
        """Keep arms whose controllers the requester may switch: none takes them over meanwhile.

        Raises:
            CommandRefused: another client commands one of them, or it is reserved for a person.
        """
        requester = _requester.get()
        with ExitStack() as gates:
            for side in self._entered(gates, sides):
                self._check_switch(side, requester)
            yield

    @contextmanager
    def passing(
        self, command: Callable[..., object], args: Sequence[object], options: Mapping[str, object]
    ) -> Iterator[None]:
        """Whether a command of :class:`.Commands` may be carried out, and while it is, none takes its arms over.

        The requester commands them from then on, unless the command is refused: then nothing was changed. What got no
        answer in time may have been carried out all the same.

        Raises:
            CommandRefused: as :meth:`take`.
        """
        requester, kinds = _requester.get(), dict[Side, Commander]()
        with ExitStack() as gates:
            if command in (Commands.send_commands, Commands.take_commands):
                given = [each for each in args if isinstance(each, ControllerCommand)]
                moved = {each.side: each.message for each in given if not isinstance(each.message, _STOPS)}
                stopped = (
                    set() if requester.only_holds else {it.side for it in given if isinstance(it.message, StopMotion)}
                )
                ordered = self._entered(gates, {*moved, *stopped})
                kinds = {side: self._kind_of_motion(side, moved[side], requester) for side in ordered if side in moved}
                for side, kind in kinds.items():
                    self.check(side, kind)
                gates.enter_context(self.switching(stopped))
            elif command is Commands.switch_controllers and not requester.only_holds:
                named = signature(command).bind(None, *args, **options).arguments
                gates.enter_context(self.switching({named["side"]} if named.get("activate") else set()))
            try:
                yield
            except CommandRefused:
                kinds.clear()
                raise
            finally:
                for side, kind in kinds.items():
                    self.take(side, kind, None)

    def is_foreign(self, side: Side) -> bool:
        """Whether another client than the requester commands an arm."""
        command = self.of(side)
        return command.who is not Commander.NONE and not command.is_own

    def is_own(self, side: Side) -> bool:
        """Whether the requester commands an arm."""
        return self.of(side).is_own

    def renew(self, side: Side, lasts: float) -> None:
        """Have the command of the requester last for a time [s] from now, if the requester commands the arm."""
        with self._reporting():
            held = self._current(side)
            if held.command.is_own:
                self._held[side] = held._replace(until=self._now() + lasts)

    def let_go(self, side: Side) -> None:
        """End the command of the requester, if the requester commands the arm; a person's arm is reserved then."""
        with self._reporting():
            held = self._current(side)
            if held.command.is_own:
                self._end(side, held)

    def give_back(self, sides: Sequence[Side]) -> tuple[Side, ...]:
        """Let programs command arms again that are reserved for a person.

        Returns:
            Those that were.

        Raises:
            CommandRefused: a person commands one of them; nothing was changed.
        """
        with self._reporting():
            now = {side: self._current(side).command for side in sides}
            for side, command in now.items():
                if command.who.is_person:
                    raise CommandRefused(message("give_back_while_commanded", arm=side.word, who=command.who.value))
            reserved = tuple(side for side, command in now.items() if command.is_reserved)
            for side in reserved:
                self._held[side] = _Held(Commanding(since=self._now()))
                self._events.append(ArmGivenBack(side))
            return reserved

    def note(self, event: Event) -> None:
        """Take an event of the control process: none commands an arm whose controllers were ended."""
        if isinstance(event, _ENDINGS):
            with self._reporting():
                held = self._held[event.side]
                if isinstance(event, CommanderSilent):  # the next one to take the arm begins anew, who was silent, too
                    who, _ = self._before.get(event.side, (Commander.NONE, None))
                    self._before[event.side] = (who, event)
                if held.command.who is not Commander.NONE:
                    self._end(event.side, held)

    # ---- with the lock

    def _take(self, side: Side, kind: Commander, lasts: float | None) -> bool:
        requester, held, now = _requester.get(), self._current(side), self._now()
        who, command = requester.who or kind, held.command
        until, is_motion = now + (MOTION_BEGINS if lasts is None else lasts), lasts is None or not who.is_person
        if command.who is who and command.client == requester.client:
            self._held[side] = held._replace(until=until, is_motion=is_motion)
            return False
        self._check(side, command, who, requester.client)
        before = self._before.get(side, (who, requester.client))
        self._before[side] = (who, requester.client)
        new = Commanding(who, requester.client, requester.name or self.own_name, now, command.is_reserved)
        self._held[side] = _Held(new, until, is_motion)
        is_handed_over = before[1] != requester.client or before[0].is_person != who.is_person
        if who.is_person or is_handed_over:
            self._events.append(CommanderChanged(side, who.value, new.name, command.who.value))
        return is_handed_over

    def _check(self, side: Side, command: Commanding, who: Commander, client: Hashable) -> None:
        """Whether an arm may be taken over; the refusal is kept."""
        refusal = None
        if command.who is not Commander.NONE and not (who.is_person and not command.who.is_person):
            if command.client != client or command.who.is_person != who.is_person:
                refusal = message("arm_commanded_by_another", arm=side.word, who=command.who.value, client=command.name)
        elif command.is_reserved and not who.is_person:
            refusal = message("arm_reserved_for_person", arm=side.word, who=who.value)
        if refusal is not None:
            held = self._held[side]
            self._held[side] = held._replace(command=replace(command, refused=refusal))
            raise CommandRefused(refusal)

    def _kind_of_motion(self, side: Side, motion: object, requester: Requester) -> Commander:
        """Of a motion without a kind of its own: that of the requester, where that one commands a motion already."""
        if isinstance(motion, FollowChunk):
            return Commander.POLICY
        command = self.of(side)
        is_known = command.client == requester.client and command.who in (Commander.PLANNER, Commander.POLICY)
        return command.who if is_known else Commander.TRAJECTORY

    def _check_switch(self, side: Side, requester: Requester) -> None:
        """Controllers begin where the arm is measured: the arm of another client is left alone by them, too."""
        with self._reporting():
            command = self._current(side).command
            if command.is_reserved or command.client != requester.client:
                self._check(side, command, requester.who or Commander.TRAJECTORY, requester.client)

    def _current(self, side: Side) -> _Held:
        """What holds now: a command that is over is ended."""
        held = self._held[side]
        if held.command.who is Commander.NONE or self._now() <= held.until:
            return held
        if held.is_motion and self._is_busy(side):
            return held
        return self._end(side, held)

    def _end(self, side: Side, held: _Held) -> _Held:
        """None commands the arm any more; what a person commanded is reserved."""
        was, is_reserved = held.command, held.command.who.is_person or held.command.is_reserved
        ended = Commanding(since=self._now(), is_reserved=is_reserved, refused=was.refused)
        self._held[side] = held = _Held(ended)
        if was.who.is_person:
            self._events.append(CommanderChanged(side, Commander.NONE.value, was.name, was.who.value))
        return held

    def _entered(self, gates: ExitStack, sides: Collection[Side]) -> Sequence[Side]:
        """The arms in one order, each with its gate closed until ``gates`` ends."""
        ordered = tuple(side for side in Side if side in sides)
        for side in ordered:
            gates.enter_context(self._gates[side])
        return ordered

    @contextmanager
    def _reporting(self) -> Iterator[None]:
        """Hold the lock; then report what has happened."""
        events: list[Event] = []
        try:
            with self._lock:
                try:
                    yield
                finally:
                    events, self._events = self._events, []
        finally:
            for event in events:
                self._on_event(event)
