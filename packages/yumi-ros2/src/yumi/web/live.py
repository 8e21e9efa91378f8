"""The robot of a running driver as all pages of ``yumi view`` see it: looked for, watched, and its state for them.

With the driver's state a page gets the two parts that are nearest to each other.
"""

from __future__ import annotations

import asyncio
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple

import msgspec

from abb_protocols.catalogue import Message, in_words, message
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import Joints, Side
from abb_runtime.faults import takes_faults
from abb_runtime.udp import is_loopback
from yumi.control.hand_over import Commander
from yumi.control.shared_state import Limited
from yumi.core.collision import Distance
from yumi.driver.command import ArmName
from yumi.driver.commands import GetState, GetSurroundings, GiveBack, SwitchControllers
from yumi.driver.reports import CommandingReport, DriverState, EventReport, Said
from yumi.driver.surroundings import Surroundings
from yumi.web.distances import Distances, ShownLimits
from yumi.web.driver_link import DriverLink
from yumi.web.page_words import words_for_page, words_of_error

PAGE_STATE_RATE = 30.0
"""A page gets the state so often [1/s]."""

_LOOKED_FOR = message("driver_looked_for")
_STATES_PER_DISTANCE = 3
_EVENTS = 200  # of the driver's log that a new page gets
_SEARCH = 1.0  # [s] between two attempts to find a driver
_STAND = 3.0  # [s] after its end a jogged arm stands
_POLL = 0.05  # [s]


class StateMessage(msgspec.Struct, frozen=True, tag_field="type", tag="state"):
    """The state as the driver wrote it; of several states a slow page gets the newest one only.

    ``time`` is when it came, on this machine's monotonic clock [s]; ``reasons`` and ``causes`` are those of the state,
    and ``problems`` those of its arms, in the page's words, see :func:`words_for_page`; ``stop`` is the id of the stop
    that is to be confirmed; ``commanding`` says who commands each arm, where there is anything to say; ``limited`` are
    the arms that something limits, as :class:`ShownLimits` has it; ``nearest`` are two parts of these, else those
    nearest of all.
    """

    time: float
    state: msgspec.Raw
    reasons: tuple[Mapping[str, object], ...]
    causes: tuple[Mapping[str, object], ...]
    stop: str
    problems: dict[str, Mapping[str, object]]
    commanding: dict[str, str]
    limited: dict[str, Limited]
    nearest: Distance | None


class _ArmPart(msgspec.Struct, frozen=True):
    position: Joints | None
    problem: Said | None
    limited: Limited | None = None
    command: CommandingReport = CommandingReport()


class _StatePart(msgspec.Struct, frozen=True):
    """What is needed of a state for distances and words."""

    arms: dict[str, _ArmPart]
    reasons: tuple[Said, ...]
    causes: tuple[Said, ...]
    stop: str
    sessions: int = 0


class JoggedArm(NamedTuple):
    """An arm that pages have jogged: the controllers that commanded it before, and those that pages jogged it with."""

    before: tuple[str, ...]
    by: frozenset[str]


class LiveRobot:
    """The robot of a running driver, which is looked for again and again; watched only while a page is open.

    Args:
        robot: its address or namespace, where several drivers run.
        on_state: called with each state, as JSON.
        on_events: called with new lines of the driver's log.
        on_change: called when a driver was found or lost, or another controller may answer it.

    Attributes:
        why_not: why there is no state; None while there is one.
        address: of the robot; empty while it is unknown.
        is_virtual: whether it is a virtual one on this machine; asked anew when the driver has another session with it.
        events: the newest lines of the driver's log.
        surroundings: what must not collide, as the driver declares it.
        jogged: the arms that pages have jogged since their controllers were switched otherwise.
    """

    def __init__(
        self,
        robot: str,
        on_state: Callable[[bytes], None],
        on_events: Callable[[tuple[EventReport, ...]], None],
        on_change: Callable[[], None],
    ) -> None:
        self.robot = robot
        self.why_not: Message | None = _LOOKED_FOR
        self.address, self.is_virtual = "", False
        self.events: deque[EventReport] = deque(maxlen=_EVENTS)
        self.surroundings = Surroundings()
        self.jogged: dict[ArmName, JoggedArm] = {}
        self._on_state, self._on_events, self._on_change = on_state, on_events, on_change
        self._state: tuple[float, msgspec.Raw] | None = None
        self._watched = asyncio.Event()

    def watch(self, is_watched: bool) -> None:
        """Whether a page is open."""
        if is_watched:
            self._watched.set()
        else:
            self._watched.clear()
            self.jogged.clear()  # what others do to the arms from now on is not seen

    def state(self) -> DriverState:
        """The newest state.

        Raises:
            RobotNotReady: there is none, or it is old.
        """
        if self._state is None or time.monotonic() - self._state[0] > 1.0:
            raise RobotNotReady(self.why_not or message("driver_sent_no_state", duration=1.0))
        return msgspec.json.decode(self._state[1], type=DriverState)

    async def run(self) -> None:
        """Find the driver and watch it, until cancelled."""
        while True:
            await self._watched.wait()
            try:
                link = await DriverLink.open(self.robot)
                try:
                    await self._follow(link)
                finally:
                    await link.close()
            except Exception as error:
                why_not, self.is_virtual = words_of_error(error), False
                if why_not != self.why_not:
                    self.why_not, self._state = why_not, None
                    self.jogged.clear()  # the next driver begins anew
                    self._on_change()
                await asyncio.sleep(_SEARCH)

    async def give_back(self) -> None:
        """Have the controllers command the arms again that did so before pages jogged them, once the arms stand.

        This may move them: a person must want it.
        """
        if not self.jogged:
            return
        try:
            link = await DriverLink.open(self.robot, is_page=True)
            try:
                for arm, (names, by) in tuple(self.jogged.items()):
                    for _ in range(round(_STAND / _POLL)):
                        raw = await link.ask(GetState())
                        state = msgspec.json.decode(raw, type=DriverState)
                        if (
                            state.arms[arm].mode.value != "moving"
                            and state.arms[arm].command.who == Commander.NONE.value
                        ):
                            break
                        await asyncio.sleep(_POLL)
                    now = tuple(each.name for each in state.controllers[arm] if each.commands)
                    is_jogged = bool(now) and by.issuperset(now)
                    if names and is_jogged and now != names and state.arms[arm].mode.value == "holding":
                        await link.ask(SwitchControllers(arm=arm, activate=names, deactivate=now))
                    await link.ask(GiveBack(arms=(arm,)))
                    self.jogged.pop(arm, None)
            finally:
                await link.close()
        except Exception as error:  # the driver has ended, or EGM has: no controller commands there; what is our fault
            words_of_error(error)  # is logged

    def _words(self, said: Said) -> Mapping[str, object]:
        return words_for_page(said.message, is_virtual=self.is_virtual)

    def words_of_events(self, events: Iterable[EventReport]) -> list[Mapping[str, object]]:
        """Lines of the driver's log in the page's words."""
        return [
            {"number": each.number, "time": each.time, "level": each.level, **self._words(each.said)} for each in events
        ]

    async def _follow(self, link: DriverLink) -> None:
        self.events.clear()
        self.surroundings = msgspec.json.decode(await link.ask(GetSurroundings()), type=Surroundings)
        distances, nearest, count = Distances(self.surroundings), None, 0
        shown, held, sessions = ShownLimits(), list[tuple[str, str]](), None
        async for raw, events in link.states(PAGE_STATE_RATE):
            is_new = self._state is None
            now = time.monotonic()
            self._state = now, raw
            self.events.extend(events)
            if events:
                self._on_events(events)
            part = msgspec.json.decode(raw, type=_StatePart)
            arms = part.arms
            if is_new:
                self.address = self.state().robot
                self.is_virtual = await asyncio.to_thread(_is_virtual, self.address)
                self.why_not = None
                self._on_change()
            elif part.sessions != sessions:
                self.is_virtual = False  # while it is asked, which a page hears that comes meanwhile
                self.is_virtual = await asyncio.to_thread(_is_virtual, self.address)
                self._on_change()
            sessions = part.sessions
            limited = shown.update({arm: place.limited for arm, place in arms.items()}, now)
            before, held = held, [(it.part, it.other) for it in limited.values()]
            if count % _STATES_PER_DISTANCE == 0 or held != before:
                places = {side: arms[side.word].position for side in Side}
                positions = {side: position for side, position in places.items() if position is not None}
                nearest = distances.nearest(positions, held) if len(positions) == len(Side) else None
            count += 1
            problems = {name: self._words(arm.problem) for name, arm in arms.items() if arm.problem is not None}
            words = tuple(map(self._words, part.reasons)), tuple(map(self._words, part.causes))
            front_end = FrontEnd.VIRTUAL_PAGE if self.is_virtual else FrontEnd.PAGE
            said = {name: in_words(arm.command.said, front_end) for name, arm in arms.items()}
            commanding = {name: each for name, each in said.items() if each}
            seen = StateMessage(now, raw, *words, part.stop, problems, commanding, limited, nearest)
            self._on_state(msgspec.json.encode(seen))
            if not self._watched.is_set():
                self._state, self.why_not, self.is_virtual = None, _LOOKED_FOR, False  # another one may run later
                return


def _is_virtual(address: str) -> bool:
    """Whether the controller is a virtual one on this machine: only that one has faults to inject."""
    return is_loopback(address.rpartition(":")[0]) and takes_faults(address)
