"""A connection to a running driver over its local endpoint, for asyncio."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from typing import Any

import msgspec

from abb_protocols.catalogue import Message, message, said_by
from abb_protocols.errors import RobotNotReady
from yumi.driver.command import Command, EndpointRequest
from yumi.driver.endpoint import (
    ENDPOINT_ANSWER_TIME,
    Attach,
    EndpointAnswer,
    Subscribe,
    connect_driver,
    error_of,
    find_driver,
)
from yumi.driver.reports import EventReport, MotionReport

_LONGEST_LINE = 1 << 22  # of a driver [bytes]; a state has some kilobytes
_answer_decoder = msgspec.json.Decoder(EndpointAnswer)


def _close_result(connecting: asyncio.Future[socket.socket]) -> None:
    if not connecting.cancelled() and connecting.exception() is None:
        connecting.result().close()


class DriverLink:
    """A connection to a running driver, on one event loop. What is closed stops the motions it has asked for."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer
        self._number = 0
        self._waiting: dict[int, asyncio.Queue[EndpointAnswer | RobotNotReady]] = {}
        self._reading = asyncio.create_task(self._read())

    @classmethod
    async def open(cls, robot: str = "", *, is_page: bool = False) -> DriverLink:
        """Connect to the one driver that runs, or to that of ``robot``; ``is_page`` as in :class:`.Attach`.

        Raises:
            RobotNotReady: none runs, or several do; the message says what to do.
        """
        # Of the executor, as a task of its own would be cancelled, too, where the program ends, and its socket lost.
        connecting = asyncio.get_running_loop().run_in_executor(None, lambda: connect_driver(find_driver(robot)))
        try:
            connected = await asyncio.shield(connecting)
        except asyncio.CancelledError:  # the thread connects all the same
            connecting.add_done_callback(_close_result)
            raise
        reader, writer = await asyncio.open_unix_connection(sock=connected, limit=_LONGEST_LINE)
        link = cls(reader, writer)
        link._write(Attach(is_page=is_page))  # a page that has taken control may ask for nothing for long
        return link

    async def close(self) -> None:
        """Disconnect; a motion that was asked for over it is stopped."""
        self._reading.cancel()
        self._writer.close()
        with suppress(OSError):
            await self._writer.wait_closed()

    async def ask(
        self,
        command: Command[Any],
        on_step: Callable[[str], None] = lambda step: None,
        on_motion: Callable[[dict[str, MotionReport]], None] = lambda motions: None,
    ) -> msgspec.Raw:
        """Send a command and wait for its result, as JSON.

        Raises:
            YumiError: the driver refuses or has failed, with its sentence; or the connection is lost.
        """
        number, answers = await self._send(command)
        try:
            while True:
                answer = await self._next(answers)
                if answer.step:
                    on_step(answer.step)
                if answer.motions:
                    on_motion(answer.motions)
                if answer.result:
                    return answer.result
        finally:
            del self._waiting[number]

    async def states(self, rate: float) -> AsyncIterator[tuple[msgspec.Raw, tuple[EventReport, ...]]]:
        """The state ``rate`` times a second, as JSON, with the events since the one before; raises as :meth:`ask`."""
        number, answers = await self._send(Subscribe(rate=rate))
        try:
            while True:
                try:
                    answer = await asyncio.wait_for(self._next(answers), ENDPOINT_ANSWER_TIME)
                except asyncio.TimeoutError as error:
                    raise RobotNotReady(message("driver_sent_no_state", duration=ENDPOINT_ANSWER_TIME)) from error
                if answer.state:
                    yield answer.state, answer.events
        finally:
            del self._waiting[number]

    async def _send(self, request: EndpointRequest) -> tuple[int, asyncio.Queue[EndpointAnswer | RobotNotReady]]:
        if self._reading.done():
            raise self._lost(message("driver_closed_connection"))
        self._number += 1
        number, answers = self._number, asyncio.Queue[EndpointAnswer | RobotNotReady]()
        self._waiting[number] = answers
        self._write(msgspec.structs.replace(request, id=number))
        try:
            await self._writer.drain()
        except OSError as error:
            del self._waiting[number]
            raise self._lost(said_by(error)) from error
        return number, answers

    def _write(self, request: EndpointRequest) -> None:
        self._writer.write(msgspec.json.encode(request) + b"\n")

    async def _next(self, answers: asyncio.Queue[EndpointAnswer | RobotNotReady]) -> EndpointAnswer:
        answer = await answers.get()
        if isinstance(answer, RobotNotReady):
            raise answer
        if answer.error is not None:
            raise error_of(answer.error)
        return answer

    async def _read(self) -> None:
        why = message("driver_closed_connection")
        try:
            while line := await self._reader.readline():
                answer = _answer_decoder.decode(line)
                # What has no number is about the whole connection, such as one client too many.
                for number in (answer.id,) if answer.id else tuple(self._waiting):
                    if number in self._waiting:
                        self._waiting[number].put_nowait(answer)
        except (OSError, ValueError, msgspec.DecodeError) as error:
            why = said_by(error)
        finally:
            for each in self._waiting.values():
                each.put_nowait(self._lost(why))

    @staticmethod
    def _lost(why: Message) -> RobotNotReady:
        return RobotNotReady(message("connection_to_driver_lost", why=why))
