"""The web server of the page of a controller, which a virtual one also takes faults from."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

import msgspec
from aiohttp import web

from abb_protocols.catalogue import Message, message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused
from abb_runtime.faults import Fault, inject_fault, takes_faults
from abb_runtime.udp import is_loopback
from abb_view.controller_reader import ControllerReader, LogMessage
from abb_view.controller_view import ControllerView
from abb_view.page_build import CONTROLLER_PAGE, page_folder
from abb_view.page_server import OpenPage, PageServer, PageSettings, error_on_page, fault_for_page, is_of_this_machine
from abb_view.robot_model import controller_model


class _Seen(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="type", tag="seen"):
    """The state that was sent is shown; the next one may come."""


class _Inject(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="type", tag="inject"):
    """A fault for a virtual controller, with the options of ``virtual-irc5 fault``."""

    id: int
    name: str
    form: dict[str, str] = {}


_decoder = msgspec.json.Decoder(_Seen | _Inject)


class ControllerServer(PageServer[OpenPage]):
    """Serves the page of a controller.

    Args:
        settings: how.
        program: the command that serves it.
        reader: of the controller.
        reopen: opens another one, when another controller may answer, see :class:`ControllerView`.
        takes_faults: whether pages of this machine may inject faults into it, where it is a virtual one of it, too.

    Raises:
        MissingPrerequisite: the page must be built first, and cannot be.
    """

    def __init__(
        self,
        settings: PageSettings,
        program: str,
        reader: ControllerReader,
        reopen: Callable[[], ControllerReader],
        *,
        takes_faults: bool = False,
    ) -> None:
        super().__init__(settings, program, page_folder(CONTROLLER_PAGE), controller_model(reader))
        self._view = ControllerView(reader, reopen, program, self._publish, self._publish_log, self._introduce_all)
        self._takes_faults = takes_faults
        self._following: asyncio.Task[None] | None = None
        self._injecting: set[asyncio.Task[None]] = set()

    async def start(self) -> None:
        """Listen, and read the controller while a page is open."""
        await super().start()
        self._following = asyncio.create_task(self._view.run())

    async def stop(self) -> None:
        """Close all pages and the reader, after a request to the controller that is under way."""
        if self._following is not None:
            self._following.cancel()
            await asyncio.wait([self._following, *self._injecting])
        await asyncio.to_thread(self._view.reader.close)
        await super().stop()

    def open_page(self, socket: web.WebSocketResponse, request: web.Request) -> OpenPage:
        """The page."""
        return OpenPage(socket, is_local=is_of_this_machine(request))

    def watch(self, is_watched: bool) -> None:
        """Whether a page is open."""
        self._view.watch(is_watched)

    def introduce(self, page: OpenPage) -> None:
        """What does not change of the controller, its log so far, and why there is no state, if there is none."""
        reader = self._view.reader
        page.send(
            {
                "type": "view",
                "controller": reader.kind,
                "is_virtual": reader.is_virtual,
                "log": tuple(self._view.lines),
                "why_no_robot": "" if self._view.why_not is None else _words(self._view.why_not),
                "faults": [fault_for_page(each) for each in self._faults(page)],
            }
        )

    async def take(self, page: OpenPage, data: str) -> None:
        """Take what the page has shown, or inject its fault; anything else is refused: it can only look."""
        try:
            request = _decoder.decode(data)
        except (msgspec.DecodeError, RecursionError):
            page.send({"type": "refused", "sentence": _words(message("no_driver_for_controller"))})
            return
        if isinstance(request, _Seen):
            page.seen()
            return
        task = asyncio.create_task(self._inject(page, request))
        self._injecting.add(task)
        task.add_done_callback(self._injecting.discard)

    def _faults(self, page: OpenPage) -> tuple[Fault, ...]:
        """Those that a page may inject: one of this machine, as that alone may, into a virtual controller of it."""
        reader = self._view.reader
        is_here = reader.is_virtual and is_loopback(reader.address.rpartition(":")[0])
        return tuple(Fault) if self._takes_faults and is_here and page.is_local else ()

    async def _inject(self, page: OpenPage, request: _Inject) -> None:
        try:
            address = self._view.reader.address
            if not page.is_local:
                raise CommandRefused(message("faults_only_here"))
            if not self._faults(page) or not await asyncio.to_thread(takes_faults, address):
                raise CommandRefused(message("faults_only_virtual"))
            fault = await asyncio.to_thread(inject_fault, address, request.name, request.form)
        except Exception as error:  # a fault of ours, too: the page waits for an answer
            said = _words(error_on_page(error, self._program))
            page.send({"type": "failed", "id": request.id, "error": {"sentence": said}})
            return
        page.send({"type": "done", "id": request.id, "result": f"Done: {fault.value.meaning}"})

    def _publish(self, state: bytes) -> None:
        for page in self.pages:
            page.send_state(state)

    def _publish_log(self, lines: LogMessage) -> None:
        data = msgspec.json.encode(lines)
        for page in self.pages:
            page.send_bytes(data)

    def _introduce_all(self) -> None:
        self.draw(controller_model(self._view.reader))
        for page in self.pages:
            self.introduce(page)


def _words(said: Message) -> str:
    return sentence(said, FrontEnd.PAGE)
