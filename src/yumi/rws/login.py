"""The client's login: answers a digest challenge once, then lives on the cookies of its session.

Like ABB's own client it never sends credentials unasked (reference/rws.md §2.2).
"""

from __future__ import annotations

import secrets
from collections.abc import Callable, Iterable

from yumi.rws import cookies, digest

Headers = tuple[tuple[str, str], ...]


class Login:
    """User, password and what the controller has handed out for them; one per client."""

    def __init__(self, user: str, password: str, make_cnonce: Callable[[], str] = lambda: secrets.token_hex(8)) -> None:
        self._user = user
        self._password = password
        self._make_cnonce = make_cnonce
        self._cookies: dict[str, str] = {}

    @property
    def has_session(self) -> bool:
        """Whether the controller has given us a session, as far as we know."""
        return cookies.SESSION in self._cookies

    def headers(self) -> Headers:
        """What every request carries: the cookies of the session, if there is one."""
        return (("Cookie", cookies.cookie_header(self._cookies)),) if self._cookies else ()

    def accept(self, headers: Iterable[tuple[str, str]]) -> None:
        """Keep a controller's own cookies of an answer; the connection cookie changes with each TCP connection.

        All others are dropped: they would make the next requests longer than the controller reads.
        """
        lines = (value for name, value in headers if name.lower() == "set-cookie")
        own = {name: value for name, value in map(cookies.read_set_cookie, lines) if cookies.is_own(name, value)}
        self._cookies = {**self._cookies, **own}  # replaced as a whole: another thread may be reading it

    def answer(self, challenge: digest.Challenge, method: str, target: str) -> Headers:
        """The headers that prove who we are for one request; the old session is gone and forgotten."""
        self.forget()
        credentials = digest.answer(
            challenge,
            user=self._user,
            password=self._password,
            method=method,
            uri=target,
            cnonce=self._make_cnonce(),
        )
        return (("Authorization", credentials.header()),)

    def forget(self) -> None:
        """Drop the session's cookies."""
        self._cookies = {}
