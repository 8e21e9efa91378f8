"""A request and a response as values: what the virtual controller receives and sends."""

from __future__ import annotations

from dataclasses import dataclass

Headers = tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class HttpRequest:
    """A request as the virtual controller receives it.

    Attributes:
        method: e.g. GET.
        target: path and query, exactly as on the request line.
        headers: names and values, in order; names may repeat.
        body: the content, empty for none.
        peer: the TCP connection it came on.
    """

    method: str
    target: str
    headers: Headers = ()
    body: bytes = b""
    peer: str = ""

    def header(self, name: str) -> str | None:
        """The first value of ``name`` in any case, or None."""
        return next(iter(self.header_values(name)), None)

    def header_values(self, name: str) -> tuple[str, ...]:
        """All values of ``name`` in any case."""
        return tuple(value for key, value in self.headers if key.lower() == name.lower())


@dataclass(frozen=True, slots=True)
class HttpReply:
    """A response as the virtual controller sends it."""

    status: int
    headers: Headers = ()
    body: bytes = b""

    def header(self, name: str) -> str | None:
        """The first value of ``name`` in any case, or None."""
        return next((value for key, value in self.headers if key.lower() == name.lower()), None)
