"""Pages on this and other machines, paired or not, at random: who may not operate a real robot moves nothing."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any, cast

import msgspec
import numpy as np
import pytest

from soak import HAND_OVERS, SEED, long, short
from yumi.driver.commands import StartEgm, StopEgm
from yumi.driver.device_frame import DeviceFrame, DeviceHand
from yumi.web import view_server
from yumi.web.page_messages import (
    Ask,
    DeviceMessage,
    ForOperator,
    GiveBackMessage,
    JointsJog,
    Pair,
    TakeControl,
)
from yumi.web.pairing import LONGEST_PAIRING_PAUSE, Pairing
from yumi.web.view_server import ViewServer, ViewSettings

HELD = DeviceFrame(time=1.0, seen=1.0, right=DeviceHand(clutch=True, twist=(0.1, 0.0, 0.0, 0.0, 0.0, 0.0)))
MOTIONS: tuple[ForOperator, ...] = (
    DeviceMessage(frame=HELD),
    JointsJog(arm="right", hold=1, seen=1.0, speeds=(0.1,) * 7),
    Ask(id=1, request=StartEgm()),
)
STOP = Ask(id=2, request=StopEgm())


class Operators:
    """What reaches the driver, in place of :class:`yumi.web.page_operator.Operator`.

    Attributes:
        taken: what was taken for pages, by their ``send``, since it was emptied.
        stops: how often the robot was stopped.
        connected: operators that have a connection to the driver.
    """

    def __init__(self) -> None:
        self.taken: list[tuple[object, ForOperator]] = []
        self.stops = 0
        self.connected: set[object] = set()

    def make(self, live: object, send: Callable[..., None], show: object, planning: object) -> object:
        operator = SimpleNamespace()

        async def open_() -> None:
            self.connected.add(operator.key)

        async def close() -> None:
            self.connected.discard(operator.key)

        async def carry_out(number: int, command: object) -> str:
            assert isinstance(command, StopEgm), "only a stop passes without control"
            self.stops += 1
            return "stopped"

        async def answer(number: int, call: Callable[[], Any]) -> None:
            await call()

        operator.key, operator.open, operator.close = object(), open_, close
        operator.carry_out, operator.answer = carry_out, answer
        operator.take = lambda request: self.taken.append((send, request))
        return operator


class Pages:
    """A server with pages that come, go and ask for things.

    Attributes:
        done: what has happened, by kind.
    """

    def __init__(self, view: ViewServer, operators: Operators, generator: np.random.Generator) -> None:
        self.done: Counter[str] = Counter()
        self._view, self._operators, self._random = view, operators, generator
        self._codes: list[str] = []
        self._time = 0.0
        view._pairing = Pairing(self._codes.append, lambda: self._time)
        view._pairing.begin()
        self._keys: set[str] = set()  # that were given for right codes
        self._open: dict[Any, bool] = {}  # whether a page may operate

    async def run(self, steps: int) -> None:
        for _ in range(steps):
            kind = str(self._random.choice(["open", "pair", "pair", "control", "motion", "motion", "stop", "leave"]))
            await {
                "open": self._come,
                "pair": self._pair,
                "control": self._take_control,
                "motion": self._move,
                "stop": self._stop,
                "leave": self._leave,
            }[kind]()
            holder = self._view._operator
            assert holder is None or self._open[holder[0]], "a page has control that may not operate"
            assert len(self._operators.connected) == (0 if holder is None else 1)
        for page in tuple(self._open):
            await self._close(page)
        assert self._view._operator is None
        assert not self._operators.connected  # the driver has stopped what moved

    def _any(self) -> Any:
        pages = list(self._open)
        return pages[int(self._random.integers(len(pages)))] if pages else None

    async def _come(self) -> None:
        remote = str(self._random.choice(["127.0.0.1", "192.0.2.7", "192.0.2.8"]))
        key = str(self._random.choice(["", "guess", *self._keys]))
        is_encrypted = bool(self._random.uniform() < 0.7)
        is_forwarded = bool(self._random.uniform() < 0.2)  # by a proxy on this machine, or on any other
        is_local = remote == "127.0.0.1" and not is_forwarded
        headers = {"Via": "a proxy"} if is_forwarded else {}
        request = SimpleNamespace(remote=remote, query={"paired": key}, headers=headers, secure=is_encrypted)
        page = self._view.open_page(cast("Any", None), cast("Any", request))
        self._view.pages.add(page)
        self._open[page] = is_local or (is_encrypted and key in self._keys)
        self.done["paired"] += self._open[page] and not is_local

    async def _ask(self, page: Any, message: msgspec.Struct) -> list[Mapping[str, Any]]:
        """What a page hears of a message."""
        page._messages.clear()
        page._report = b""
        await self._view.take(page, msgspec.json.encode(message).decode())
        await asyncio.gather(*self._view._tasks)
        said = [*page._messages, *([page._report] if page._report else [])]
        return [msgspec.json.decode(each) for each in said]

    async def _pair(self) -> None:
        self._time += float(self._random.choice([0.0, 1.0, LONGEST_PAIRING_PAUSE]))
        if (page := self._any()) is None:
            return
        is_right = bool(self._random.uniform() < 0.5)
        code = self._codes[-1] if is_right else str(self._random.choice(["", "x", *self._codes[:-1]]))
        for heard in await self._ask(page, Pair(id=7, code=code)):
            if heard["type"] != "done":
                continue
            assert code == self._codes[-2], "a wrong code has paired a page"
            assert page.is_encrypted
            assert not page.is_local
            self._keys.add(heard["result"]["key"])
            self.done["key"] += 1

    async def _take_control(self) -> None:
        if (page := self._any()) is None:
            return
        await self._ask(page, TakeControl())
        holder = self._view._operator
        assert (holder is not None and holder[0] is page) == self._open[page]

    async def _move(self) -> None:
        if (page := self._any()) is None:
            return
        request = MOTIONS[int(self._random.integers(len(MOTIONS)))]
        self._operators.taken.clear()
        holder = self._view._operator
        has_control = holder is not None and holder[0] is page
        heard = await self._ask(page, request)
        assert self._operators.taken == ([(page.send, request)] if has_control else [])
        assert bool(heard) != has_control, "what is not carried out is refused"
        self.done["moved" if has_control else "refused"] += 1

    async def _stop(self) -> None:
        if (page := self._any()) is None:
            return
        before, holder = self._operators.stops, self._view._operator
        await self._ask(page, STOP)
        assert self._operators.stops == before + 1  # paired or not, with control or not
        assert self._view._operator is holder

    async def _leave(self) -> None:
        if (page := self._any()) is None:
            return
        if self._random.uniform() < 0.5:
            await self._ask(page, GiveBackMessage())
        else:
            await self._close(page)
        holder = self._view._operator
        assert holder is None or holder[0] is not page

    async def _close(self, page: Any) -> None:
        self._view.pages.discard(page)
        del self._open[page]
        await self._view._release(page, None)


@pytest.mark.parametrize("count", [short(200), long(HAND_OVERS, 1800.0)])
def test_page_that_may_not_operate_moves_nothing_and_any_page_stops_the_robot(
    monkeypatch: pytest.MonkeyPatch, count: int
) -> None:
    operators, done = Operators(), Counter[str]()
    monkeypatch.setattr(view_server, "Operator", operators.make)
    monkeypatch.setattr(ViewServer, "_introduce_all", lambda self: None)

    async def give_back() -> None:
        """Nothing was jogged."""

    async def run() -> None:
        view = ViewServer(ViewSettings(may_operate=True, token="t"))
        view._live = cast("Any", SimpleNamespace(why_not=None, is_virtual=False, give_back=give_back))
        generator = np.random.default_rng((75, SEED))
        for _ in range(count):
            pages = Pages(view, operators, generator)
            await pages.run(60)
            done.update(pages.done)
        view._planning.close()

    asyncio.run(run())
    assert min(done[kind] for kind in ("key", "paired", "moved", "refused")) > count // 2, done
