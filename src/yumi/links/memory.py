"""Two ends of a connection inside one process: what one sends, the other receives. For virtual time and tests."""

from __future__ import annotations

from collections import deque


class MemoryLink:
    """One end; make both with :func:`memory_links`."""

    foreign = 0  # there is one sender only
    is_pinned = True

    def __init__(self, inbox: deque[bytes], outbox: deque[bytes]) -> None:
        self._inbox = inbox
        self._outbox = outbox

    def send(self, datagram: bytes) -> None:
        self._outbox.append(datagram)

    def pin(self) -> None:
        """It always is."""

    def release(self) -> None:
        """There is no other sender."""

    def receive_next(self) -> bytes | None:
        """The oldest datagram that waits."""
        return self._inbox.popleft() if self._inbox else None

    def receive(self) -> list[bytes]:
        """All datagrams that wait, oldest first."""
        datagrams = list(self._inbox)
        self._inbox.clear()
        return datagrams


def memory_links() -> tuple[MemoryLink, MemoryLink]:
    """Two connected ends."""
    there: deque[bytes] = deque()
    back: deque[bytes] = deque()
    return MemoryLink(there, back), MemoryLink(back, there)
