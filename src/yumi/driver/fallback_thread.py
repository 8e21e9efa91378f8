"""The core's thread that answers for controllers that do not: no arm waits for Python."""

from __future__ import annotations

from collections.abc import Iterable

from yumi.catalogue import message
from yumi.control.limiter import Limiter
from yumi.core.library import load
from yumi.egm.session import ArmSession
from yumi.egm.udp import HasFileno
from yumi.errors import MissingPrerequisite


class FallbackThread:
    """Answers what arrives while this process has something to do and has not called the core for 2 ms.

    Each arm brakes within its limits meanwhile. A later answer is dropped; the next one goes on from what was sent.

    Args:
        arms: of each arm its limiter, its session, and its socket.

    Raises:
        MissingPrerequisite: the operating system has no descriptors left.
    """

    def __init__(self, arms: Iterable[tuple[Limiter, ArmSession, HasFileno]]) -> None:
        self._library = load()
        self._arms = tuple(arms)  # kept: the thread uses them
        self._handle: int | None = self._library.fallback_thread_new()
        if self._handle is None:
            raise MissingPrerequisite(message("no_thread_for_core"))
        for limiter, session, socket in self._arms:
            self._library.fallback_thread_add(self._handle, limiter.handle, session.handle, socket.fileno())

    def start(self) -> None:
        """Begin; the thread gets the priority of the caller's.

        Raises:
            MissingPrerequisite: the operating system does not let it begin.
        """
        if not self._library.fallback_thread_start(self._handle):
            self.close()
            raise MissingPrerequisite(message("no_thread_for_core"))

    def note_busy(self) -> None:
        """This process has found something to do."""
        self._library.fallback_thread_note_busy(self._handle)

    def note_waiting(self) -> None:
        """This process waits for datagrams; what it has left without an answer, since something failed, is answered."""
        self._library.fallback_thread_note_waiting(self._handle)

    def close(self) -> None:
        """End the thread; nothing may be noted any more."""
        handle, self._handle = self._handle, None
        if handle is not None:
            self._library.fallback_thread_delete(handle)
