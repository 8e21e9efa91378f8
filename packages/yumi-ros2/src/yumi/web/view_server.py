"""The web server of ``yumi view``: pages that show the robot of a driver and operate it, or show a recording.

Who may do what: who sees the robot is decided by :mod:`abb_view.page_server`; a token is also needed where a real robot
is operated. One page at a time operates the robot, after it has taken control: a virtual one always, a real one where
the server was started to operate it and the page is opened on the same machine, or on another one over HTTPS after it
was paired (:mod:`yumi.web.pairing`). What a proxy forwards is of another machine, wherever the proxy runs. Every page
that shows a driver's robot may stop it.

A page draws the robot's description, which it gets as JSON (:mod:`yumi.web.robot_model`), and moves it as the driver's
state or a recording (:mod:`yumi.web.page_recording`) says.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine, Mapping
from dataclasses import dataclass
from typing import Any

import msgspec
from aiohttp import web

from abb_protocols.catalogue import Message, message, said_by, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused, SettingsError, YumiError
from abb_runtime.faults import Fault
from abb_runtime.udp import is_loopback
from abb_view.page_build import page_folder
from abb_view.page_server import OpenPage, PageServer, PageSettings, fault_for_page, is_of_this_machine
from yumi.driver.commands import StopEgm
from yumi.driver.reports import EventReport
from yumi.planning.planning_process import PlanningProcess
from yumi.web.live import LiveRobot
from yumi.web.page_build import ROBOT_PAGE
from yumi.web.page_device import refused_report
from yumi.web.page_messages import (
    AnyMessage,
    Ask,
    DeviceMessage,
    ForOperator,
    GiveBackMessage,
    Inject,
    JointsJog,
    Pair,
    Seen,
    TakeControl,
    ToolJog,
)
from yumi.web.page_operator import Operator
from yumi.web.page_words import PAGE_PROGRAM, failure_for_page
from yumi.web.pairing import Pairing
from yumi.web.robot_model import robot_model

_message_decoder = msgspec.json.Decoder(AnyMessage)
_ANSWER = 5.0  # [s] a page that has control and shows no state for so long loses it


@dataclass(frozen=True, slots=True)
class ViewSettings(PageSettings):
    """How the page is served; it needs a token also where a real robot is operated.

    Attributes:
        robot: address or namespace, where several drivers run.
        may_operate: whether a real robot may be operated from this machine.
        show_code: takes each code with which a page on another machine is paired, for a person at this machine.
        recording: to be shown instead of a robot.
    """

    robot: str = ""
    may_operate: bool = False
    show_code: Callable[[str], None] = lambda code: None
    recording: Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        PageSettings.__post_init__(self)  # super() is that of the class before it had slots
        if self.may_operate and not self.token:
            raise SettingsError(message("operating_page_needs_token"))


class ViewServer(PageServer["RobotPage"]):
    """Serves the page from :meth:`start` to :meth:`stop`, on the event loop of its caller.

    Args:
        settings: how.

    Raises:
        MissingPrerequisite: the page must be built first, and cannot be.
    """

    def __init__(self, settings: ViewSettings) -> None:
        super().__init__(settings, PAGE_PROGRAM, page_folder(ROBOT_PAGE), robot_model())
        self._application.router.add_get("/recording.json", self._send_recording)
        self._settings = settings
        self._live = LiveRobot(settings.robot, self._publish, self._publish_events, self._note_driver)
        self._planning = PlanningProcess()
        self._pairing = Pairing(settings.show_code)
        self._operator: tuple[RobotPage, Operator] | None = None
        self._switching = asyncio.Lock()  # one change of control at a time
        self._following: asyncio.Task[None] | None = None
        self._taking: asyncio.Task[None] | None = None
        self._giving_back: asyncio.Task[None] | None = None
        self._tasks: set[asyncio.Task[object]] = set()

    async def start(self) -> None:
        """Listen, and follow the robot while a page is open."""
        await super().start()
        if self._settings.may_operate and self._settings.tls is not None and not is_loopback(self._settings.host):
            self._pairing.begin()
        if self._settings.recording is None:
            self._following = asyncio.create_task(self._live.run())

    async def stop(self) -> None:
        """Give control back, close all pages and end."""
        self._cancel_giving_back()
        await self._release(None, message("view_has_ended"))
        if self._tasks:  # such as a Stop EGM
            await asyncio.wait(self._tasks, timeout=_ANSWER)
        self._planning.close()
        if self._following is not None:
            self._following.cancel()
        await super().stop()

    async def _send_recording(self, request: web.Request) -> web.StreamResponse:
        if self._settings.recording is None:
            raise web.HTTPNotFound(text="There is no recording; the page shows a robot.")
        if not self._has_token(request):
            raise web.HTTPForbidden(text=self._no_token)
        return web.Response(body=msgspec.json.encode(self._settings.recording), content_type="application/json")

    def open_page(self, socket: web.WebSocketResponse, request: web.Request) -> RobotPage:
        """The page, with what decides whether it may operate a real robot."""
        # Over HTTP, the key of a pairing counts for nothing: others may read it.
        is_paired = request.secure and self._pairing.is_paired(request.query.get("paired", ""))
        return RobotPage(socket, is_local=is_of_this_machine(request), is_encrypted=request.secure, is_paired=is_paired)

    def watch(self, is_watched: bool) -> None:
        """Whether a page is open."""
        self._live.watch(is_watched)

    async def forget(self, page: RobotPage) -> None:
        """A page that had control gives it back when it is closed."""
        await self._release(page, message("page_closed"))

    async def take(self, page: RobotPage, data: str) -> None:
        """Carry out a message of a page, or have its operator do so."""
        try:
            request = _message_decoder.decode(data)
        except (msgspec.DecodeError, RecursionError) as error:
            is_nested = isinstance(error, RecursionError)
            why = message("request_nested_too_deeply") if is_nested else said_by(error)
            self._refuse(page, message("request_not_understood", why=why))
            return
        if isinstance(request, Seen):
            page.seen()
        elif isinstance(request, Pair):
            self._pair(page, request)
        elif isinstance(request, TakeControl):
            await self._take_control(page)
        elif isinstance(request, GiveBackMessage):
            if await self._release(page, None):  # the rest may take seconds: a Stop EGM must be read meanwhile
                self._giving_back = asyncio.create_task(self._live.give_back())
        else:
            self._operate(page, request)

    def _operate(self, page: RobotPage, request: ForOperator) -> None:
        """Have the page's operator take a request, or stop the robot for any page."""
        why_not = self._why_not_operated(page)
        operator = self._operator[1] if self._operator is not None and self._operator[0] is page else None
        may_stop = operator is not None or self._may_stop
        if may_stop and isinstance(request, Ask) and isinstance(request.request, StopEgm):
            self._cancel_giving_back()
            self._begin(self._stop_egm(page, request))
        elif operator is None or why_not:
            self._refuse_request(page, request, CommandRefused(why_not or message("control_not_taken")))
        elif isinstance(request, Inject) and not page.is_local:
            self._refuse_request(page, request, CommandRefused(message("faults_only_here")))
        else:
            operator.take(request)

    def _refuse_request(self, page: RobotPage, request: ForOperator | Pair, refusal: CommandRefused) -> None:
        failure = failure_for_page(refusal, is_virtual=self._live.is_virtual)
        if isinstance(request, DeviceMessage):
            page.send_report(refused_report(request, failure))
        elif isinstance(request, JointsJog | ToolJog):
            page.send({"type": "jog_refused", "hold": request.hold, "error": failure})
        else:
            page.send({"type": "failed", "id": request.id, "error": failure})

    def _pair(self, page: RobotPage, request: Pair) -> None:
        """Give a page the key of a pairing, with which it connects anew."""
        try:
            if not self._may_pair(page):
                raise CommandRefused(message("pairing_not_needed"))
            result = {"key": self._pairing.pair(request.code)}
        except CommandRefused as error:
            self._refuse_request(page, request, error)
        else:
            page.send({"type": "done", "id": request.id, "result": result})

    async def _take_control(self, page: RobotPage) -> None:
        why_not = self._why_not_operated(page)
        if why_not is not None:
            self._refuse(page, why_not)
            return
        await self._release(None, message("control_taken_by_other"), unless=page)
        async with self._switching:
            if self._operator is not None or page not in self.pages:
                return  # it has it already, another one was faster, or it is gone
            self._cancel_giving_back()
            operator = Operator(self._live, page.send, page.send_report, self._planning)
            try:
                await operator.open()
            except YumiError as error:
                self._refuse(page, error.said)
                return
            self._operator = page, operator
        self._introduce_all()

    async def _release(self, page: RobotPage | None, why: Message | None, unless: RobotPage | None = None) -> bool:
        """Take control from a page, or from the one that has it; what moves for it is stopped. Whether it had it."""
        async with self._switching:
            if self._operator is None or self._operator[0] is unless or page not in (None, self._operator[0]):
                return False
            holder, operator = self._operator
            self._operator = None
            if why is not None and holder in self.pages:
                self._refuse(holder, why)
            await operator.close()
        self._introduce_all()
        return True

    async def _stop_egm(self, page: RobotPage, request: Ask) -> None:
        """Over a connection of its own: that of a page that has control may be to a driver that has ended."""
        async with page.stopping:
            operator = Operator(self._live, page.send, page.send_report, self._planning)

            async def stop() -> object:
                await operator.open()
                return await operator.carry_out(request.id, request.request)

            try:
                await operator.answer(request.id, stop)
            finally:
                await operator.close()

    def _cancel_giving_back(self) -> None:
        if self._giving_back is not None:
            self._giving_back.cancel()

    def _begin(self, work: Coroutine[Any, Any, object]) -> None:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    def _why_not_operated(self, page: RobotPage) -> Message | None:
        """Why a page may only look; None when it may operate the robot."""
        if (why_not := self._why_none_operates()) is not None:
            return why_not
        if self._live.is_virtual or page.is_local or page.is_paired:
            return None
        return message("operated_once_paired" if page.is_encrypted else "operated_elsewhere_over_https")

    def _why_none_operates(self) -> Message | None:
        """Why no page may operate the robot; None where one may."""
        if self._settings.recording is not None:
            return message("is_a_recording")
        if self._live.why_not is not None:
            return self._live.why_not
        return None if self._live.is_virtual or self._settings.may_operate else message("page_only_shows")

    @property
    def _may_stop(self) -> bool:
        """Whether every page may stop the robot: one without control, not paired, where none may operate, too."""
        return self._settings.recording is None and self._live.why_not is None

    def _may_pair(self, page: RobotPage) -> bool:
        why_not = self._why_not_operated(page)
        return why_not is not None and why_not.code == "operated_once_paired"

    def _words(self, said: Message | None) -> str:
        """In the page's words; empty where there is nothing to say."""
        if said is None:
            return ""
        return sentence(said, FrontEnd.VIRTUAL_PAGE if self._live.is_virtual else FrontEnd.PAGE)

    def _refuse(self, page: RobotPage, said: Message) -> None:
        page.send({"type": "refused", "sentence": self._words(said)})

    def _publish(self, state: bytes) -> None:
        for page in self.pages:
            page.send_state(state)
        if self._operator is not None and self._operator[0].is_silent(_ANSWER) and self._taking is None:
            self._taking = asyncio.create_task(self._take_from_silent(self._operator[0]))

    def _publish_events(self, events: tuple[EventReport, ...]) -> None:
        """Apart from the states, of which a slow page gets only some."""
        for page in self.pages:
            page.send({"type": "events", "events": self._live.words_of_events(events)})

    async def _take_from_silent(self, page: RobotPage) -> None:
        try:
            await self._release(page, message("page_was_silent"))
        finally:
            self._taking = None

    def _note_driver(self) -> None:
        """Another driver or controller is there, or none: a page that may not operate any more loses control."""
        self._introduce_all()
        if self._live.why_not is not None:
            self._begin(self._release(None, message("driver_has_ended")))
        elif self._operator is not None and (why_not := self._why_not_operated(self._operator[0])) is not None:
            self._begin(self._release(self._operator[0], why_not))

    def _introduce_all(self) -> None:
        for page in self.pages:
            self.introduce(page)

    def introduce(self, page: RobotPage) -> None:
        """What a page must know beside the state: whether there is a robot or a recording, and who operates the robot.

        Of a recording its name and date, so that the page says of a state when it was so.
        """
        holder = self._operator[0] if self._operator is not None else None
        recording = self._settings.recording
        is_virtual = self._live.is_virtual
        page.send(
            {
                "type": "view",
                "is_recording": recording is not None,
                "recording": None if recording is None else {"name": recording["name"], "date": recording["date"]},
                "why_no_robot": "" if recording is not None else self._words(self._live.why_not),
                "is_virtual": is_virtual,
                "why_not_operated": self._words(self._why_not_operated(page)),
                "may_stop": self._may_stop,
                "may_pair": self._may_pair(page),
                "control": "none" if holder is None else "here" if holder is page else "elsewhere",
                "events": self._live.words_of_events(self._live.events),
                "surroundings": self._live.surroundings,
                "faults": [fault_for_page(each) for each in Fault] if is_virtual and page.is_local else [],
                "why_no_faults": self._words(message("faults_only_here")) if is_virtual and not page.is_local else "",
            }
        )


class RobotPage(OpenPage):
    """One page: whether it is of this machine, encrypted and paired, and its Stop EGM."""

    def __init__(self, socket: web.WebSocketResponse, *, is_local: bool, is_encrypted: bool, is_paired: bool) -> None:
        super().__init__(socket, is_local=is_local)
        self.is_encrypted, self.is_paired = is_encrypted, is_paired
        self.stopping = asyncio.Lock()  # one Stop EGM at a time
