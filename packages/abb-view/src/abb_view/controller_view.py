"""A controller for the pages that are open: read again and again, and its state and log for them."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable

import msgspec

from abb_protocols.catalogue import Message
from abb_view.controller_reader import ControllerReader, LogLine, LogMessage
from abb_view.page_server import error_on_page

_LINES = 200
"""So many lines of the log are kept for a page that is opened later."""

_RECONNECT = 1.0  # [s]


class ControllerView:
    """A controller for the pages, read while one is open.

    Args:
        reader: of the controller; closed when another one takes its place.
        reopen: opens another one, when the controller's session has ended: another controller may answer by then, a
            real one instead of a virtual one. Called on a thread.
        program: the command that shows it.
        on_state: called with each :class:`ControllerMessage`, as JSON.
        on_log: called with new lines of the log.
        on_change: called when the controller does not answer any more, answers again, or may be another one.

    Attributes:
        why_not: why there is no state; None while there is one.
        lines: the newest ones of the log, oldest first.
        reader: of the controller now.
    """

    def __init__(
        self,
        reader: ControllerReader,
        reopen: Callable[[], ControllerReader],
        program: str,
        on_state: Callable[[bytes], None],
        on_log: Callable[[LogMessage], None],
        on_change: Callable[[], None],
    ) -> None:
        self.why_not: Message | None = None
        self.lines: deque[LogLine] = deque(maxlen=_LINES)
        self.reader = reader
        self._program, self._reopen = program, reopen
        self._on_state, self._on_log, self._on_change = on_state, on_log, on_change
        self._watched = asyncio.Event()
        self._new_lines: list[LogLine] = []
        reader.on_log = self._new_lines.extend  # on the reader's thread

    def watch(self, is_watched: bool) -> None:
        """Whether a page is open."""
        if is_watched:
            self._watched.set()
        else:
            self._watched.clear()

    async def run(self) -> None:
        """Read the controller while a page is open, until cancelled."""
        reading: asyncio.Future[float] | None = None  # nothing is read any more when this has ended
        try:
            while True:
                await self._watched.wait()
                reader = self.reader
                reading = asyncio.ensure_future(asyncio.to_thread(self._read))
                try:
                    delay = await asyncio.shield(reading)
                except Exception as error:  # a fault of ours, too, which the log shows whole
                    self.reader.forget()
                    self._set_why_not(error_on_page(error, self._program))
                    await asyncio.sleep(_RECONNECT)
                    continue
                if self.reader is not reader:
                    self.lines.clear()  # the log is read from its beginning
                    self.why_not = None
                    self._on_change()
                    continue
                self._set_why_not(None)
                if self._new_lines:
                    lines = tuple(self._new_lines)
                    self._new_lines.clear()
                    self.lines.extend(lines)
                    self._on_log(LogMessage(lines))
                self._on_state(msgspec.json.encode(self.reader.message()))
                await asyncio.sleep(delay)
        finally:
            if reading is not None:
                await asyncio.wait([reading])

    def _read(self) -> float:
        """Read what is due next, on a thread; how soon something is due again [s]."""
        delay = self.reader.step()
        if self.reader.is_of_session:
            return delay
        reader = self._reopen()
        self.reader.close()
        self._new_lines.clear()
        reader.on_log = self._new_lines.extend
        self.reader = reader
        return 0.0

    def _set_why_not(self, why_not: Message | None) -> None:
        if why_not != self.why_not:
            self.why_not = why_not
            self._on_change()
