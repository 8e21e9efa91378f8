"""An arm of the control loop that EGM guides: datagrams become states, commands become answers; its fallback thread.

All of that is compiled, ``core/arm_handle.hpp``: the socket, the datagrams, the session and the limiter. Where the
controller's formula is known there, too, the answer has left before Python is woken. No arm waits for Python:
:class:`FallbackThread` answers for controllers that do not.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from ctypes import create_string_buffer, string_at
from itertools import islice
from struct import Struct

from abb_protocols.catalogue import message
from abb_protocols.errors import MissingPrerequisite
from abb_protocols.robot.joints import ArmCommand, ArmState
from abb_runtime.udp import LOST_ON_THE_WAY
from yumi.control.counters import WireCounters
from yumi.control.cycle import Cycle
from yumi.control.limiter import Limiter, limiter_arm_command, limiter_arm_state, pack_command
from yumi.control.sampled import Sampled
from yumi.control.stage_times import DECODE_STAGE, LIMIT_STAGE, RECEIVE_STAGE, SEND_STAGE, UPDATE_STAGE, StageClock
from yumi.core.library import BRAKED_STRUCT, MOST_BRAKED, SAMPLED_STRUCT, ArmExchange, load, new_handle
from yumi.driver.egm_server import DatagramLink, wire_counters
from yumi.egm.egm_session import Session
from yumi.egm.joint_codec import not_finite

_READY = ((), (0,), (1,), (0, 1))  # arms, by the bits that the core returns
_NONE, _UNSAFE, _TO_ANSWER = range(3)  # what became of the datagrams that waited, as in the core
_STAGES = Struct("7d")  # in the order of the marks
_STATE = 25  # values of a state
_ANSWER_AT, _DATAGRAM_AT = ArmExchange.answer.offset, ArmExchange.datagram.offset


class EgmArm:
    """One seven-axis arm guided by EGM.

    Args:
        link: where its datagrams come from.
        session: its sessions.
        limiter: what its commands must pass.
        stages: what notes where a cycle's time goes, by the machine's clock; None where time is virtual.
        keep: given the datagram of each cycle after it was answered, for who wants to know what else is in it.

    Attributes:
        handle: what the core calls it.
    """

    def __init__(
        self,
        link: DatagramLink,
        session: Session,
        limiter: Limiter,
        stages: StageClock | None = None,
        keep: Callable[[bytes], None] = lambda datagram: None,
    ) -> None:
        self._library = load()
        self._link, self._session, self._limiter = link, session, limiter
        self._stages, self._keep = stages, keep
        self._is_socket = link.fileno() >= 0
        self.handle = new_handle(self, "arm", limiter.handle, session.handle, link.fileno())
        self._braked = create_string_buffer(BRAKED_STRUCT.size * MOST_BRAKED)
        self._exchange = ArmExchange.from_address(self.handle)

    def receive(self, now: float) -> ArmState | None:
        if self._is_socket and self._link.is_pinned:
            verdict = self._limiter.done(self._library.arm_receive(self.handle, now))
        else:
            verdict = self._receive_unpinned(now)
        return self._limiter.checked() if verdict == _TO_ANSWER else None

    def _receive_unpinned(self, now: float) -> int:
        """The sender of what begins a session is the only one heard until the session ends."""
        link, verdict = self._link, _NONE
        while verdict == _NONE and (datagrams := link.receive()):
            last = len(datagrams) - 1
            for index, datagram in enumerate(datagrams):
                taken = self._library.arm_accept(self.handle, datagram, len(datagram), now, index == 0, index == last)
                verdict = self._limiter.done(taken)
            if link.is_pinned:
                break
            if verdict != _NONE:
                link.pin()
        return verdict

    def reply(self, desired: ArmCommand | None) -> ArmCommand | None:
        sends = self._is_socket and self._link.is_pinned
        packed = None if desired is None else pack_command(desired)
        if not self._limiter.done(self._library.arm_reply(self.handle, packed, sends)):
            return None
        exchange, sent = self._exchange, self._limiter.sent()
        size = exchange.answer_size
        if not size:
            raise not_finite(*sent)
        if not sends:
            self._link.send(string_at(self.handle + _ANSWER_AT, size))
        elif exchange.send_error and exchange.send_error not in LOST_ON_THE_WAY:
            raise OSError(exchange.send_error, os.strerror(exchange.send_error))
        if self._stages is not None:
            marks, noted = self._stages.marks, _STAGES.unpack_from(exchange)
            if noted[UPDATE_STAGE]:  # the core has sampled it
                marks[: SEND_STAGE + 1] = noted
            else:
                marks[RECEIVE_STAGE : DECODE_STAGE + 1], marks[LIMIT_STAGE : SEND_STAGE + 1] = (
                    noted[RECEIVE_STAGE : DECODE_STAGE + 1],
                    noted[LIMIT_STAGE:],
                )
        return sent

    def settle(self, state: ArmState) -> None:
        self._limiter.done(self._library.arm_settle(self.handle))
        self._keep(string_at(self.handle + _DATAGRAM_AT, self._exchange.datagram_size))

    def prepare(self, sampled: Sampled | None, session: int) -> None:
        packed = None
        if sampled is not None:
            goal, gains = sampled.goal, sampled.gains
            packed = SAMPLED_STRUCT.pack(
                session, sampled.address, sampled.taken, gains is None, *goal, *(gains or goal)
            )
        self._library.arm_prepare(self.handle, packed)

    def take_braked(self) -> Sequence[Cycle]:
        count = self._limiter.done(self._library.arm_take_braked(self.handle, self._braked))
        cycles = islice(BRAKED_STRUCT.iter_unpack(self._braked), count)
        return [
            Cycle(limiter_arm_state(values[:_STATE]), None, limiter_arm_command(values[_STATE:])) for values in cycles
        ]

    def silence(self, now: float) -> float:
        return self._session.silence(now)

    def lost_after(self, now: float) -> float | None:
        if not self._session.close_if_silent(now):
            return None
        self._link.release()
        return self._session.silence(now)

    def wire_counters(self) -> WireCounters:
        return wire_counters(self._session, self._link.foreign + self._exchange.foreign)


class FallbackThread:
    """Answers what arrives while this process has something to do and has not called the core for 2 ms.

    Each arm brakes within its limits meanwhile. A later answer is dropped; the next one goes on from what was sent.

    Args:
        arms: for which it answers.

    Raises:
        MissingPrerequisite: the operating system has no descriptors left.
    """

    def __init__(self, arms: Iterable[EgmArm]) -> None:
        self._library = load()
        self._arms = tuple(arms)  # kept: the thread uses them
        self._handle: int | None = self._library.fallback_thread_new()
        if self._handle is None:
            raise MissingPrerequisite(message("no_thread_for_core"))
        for arm in self._arms:
            self._library.fallback_thread_add(self._handle, arm.handle)

    def start(self) -> None:
        """Begin; the thread gets the priority of the caller's.

        Raises:
            MissingPrerequisite: the operating system does not let it begin.
        """
        if not self._library.fallback_thread_start(self._handle):
            self.close()
            raise MissingPrerequisite(message("no_thread_for_core"))

    def wait(self, other: int, timeout: float) -> tuple[Sequence[int], bool]:
        """Wait for datagrams, and for the file of descriptor ``other``, at most ``timeout`` [s] in whole milliseconds.

        What an arm has left without an answer, since something failed, is answered at first. Datagrams that come are
        answered at once where that was prepared, see :meth:`EgmArm.prepare`.

        Returns:
            The numbers of the arms that are to receive, and whether the other file can be read.
        """
        ready = self._library.fallback_thread_wait(self._handle, other, round(1e3 * timeout))
        return _READY[ready & 3], ready > 3

    def close(self) -> None:
        """End the thread; :meth:`wait` may not be called any more."""
        handle, self._handle = self._handle, None
        if handle is not None:
            self._library.fallback_thread_delete(handle)
