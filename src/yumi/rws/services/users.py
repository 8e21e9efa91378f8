"""Users, grants, mastership, and the remote manual mode privilege (RMMP)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum

from yumi.errors import ControllerRefused, NoConnection
from yumi.rws import replies
from yumi.rws.documents import State
from yumi.rws.session import Request, Requests, get, given, post
from yumi.rws.types import Code

_RMMP = "/users/rmmp"
_RMMP_POLL = 0.25  # [s]; the controller forgets a request that is not polled for 10 s


class Privilege(Enum):
    """What a client may do in manual mode."""

    MODIFY = "modify"
    """Write data and programs."""
    EXECUTE = "exec"
    """Start programs, too."""


class RmmpStatus(Enum):
    """What became of a request for the remote manual mode privilege."""

    PENDING = "PENDING"
    GRANTED = "GRANTED"
    DENIED = "DENIED"


@dataclass(frozen=True, slots=True)
class User:
    """A client that is logged in."""

    uid: int
    name: str
    application: str
    location: str
    is_local: bool


@dataclass(frozen=True, slots=True)
class Rmmp:
    """Who has the remote manual mode privilege, or asks for it.

    Attributes:
        user: who; None for no user.
        privilege: ``none``, ``pending modify``, ``modify`` or ``exec``.
        is_own: whether it is this client.
    """

    user: User | None
    privilege: str
    is_own: bool


class Users(Requests):
    """``/users`` and ``/rw/mastership``."""

    def users(self) -> tuple[User, ...]:
        """Clients that are logged in; some controllers show this one only."""
        return tuple(_user(state, "uid", "ulocale") for state in self._states("reading the users", "/users"))

    def register(
        self, name: str = "Default User", application: str = "yumi-ros2", location: str = "", *, is_local: bool = False
    ) -> None:
        """Say who this client is, for the FlexPendant and other clients."""
        locale = "local" if is_local else "remote"
        form = given(username=name, application=application, location=location, ulocale=locale)
        self._do(Request("POST", "/users", form=form), "registering")

    def set_local(self, is_local: bool) -> None:
        """Become a local client, which needs the enabling device within 5 s, or a remote one."""
        self._do(post("/users", "set-locale", ("type", "local" if is_local else "remote")), "changing the locale")

    def impersonate(self, uid: int) -> None:
        """Act as another client that is logged in; for local clients."""
        self._do(post("/users", "impersonate", ("uid", str(uid))), "acting as another client")

    def grants(self) -> tuple[str, ...]:
        """What the user is permitted, such as ``UAS_RAPID_EXECUTE``."""
        states = self._states("reading the grants", "/users/grants")
        return tuple(  # the title is the name, or "user-grant" with the name in a field
            next((text for text in state.fields.values() if text.startswith("UAS_")), state.title) for state in states
        )

    def log_in_remotely(self) -> None:
        """Take the rights of a remote user."""
        self._do(post("/users/remoteuser", "remotelogin"), "logging in as remote user")

    def log_out_remotely(self) -> None:
        """Give up the rights of a remote user."""
        self._do(post("/users/remoteuser", "remotelogout"), "logging out as remote user")

    # Remote manual mode privilege

    def rmmp(self) -> Rmmp:
        """Who has the remote manual mode privilege."""
        state = self._state("reading the privilege", _RMMP, "user-rmmp")
        privilege = state.text("privilege")
        user = None if privilege == "none" else _user(state, "userid", "ulocale")
        return Rmmp(user, privilege, state.flag("rmmpheldbyme"))

    def request_rmmp(self, privilege: Privilege = Privilege.MODIFY) -> None:
        """Ask for the privilege to change something in manual mode; a person grants it on the FlexPendant.

        ``poll_rmmp`` at least every ten seconds, or the request is forgotten.
        """
        form = (("privilege", privilege.value),)
        self._do(Request("POST", _RMMP, form=form), "asking for the remote manual mode privilege")

    def poll_rmmp(self) -> RmmpStatus:
        """What became of the request; a granted privilege ends when it is not polled, too.

        Raises:
            ControllerRefused: there is no request.
        """
        return self._state("asking for the privilege", f"{_RMMP}/poll", "user-rmmp-poll").member(RmmpStatus, "status")

    def cancel_rmmp(self) -> None:
        """Withdraw the request, or give the privilege back."""
        self._do(post(_RMMP, "cancel"), "giving the privilege back")

    def grant_rmmp(self, uid: int, privilege: Privilege | None) -> None:
        """Grant another client's request, or deny it with None; for local clients."""
        form = given(uid=uid, privilege="deny" if privilege is None else privilege.value)
        self._do(post(_RMMP, "set", *form), "answering a request for the privilege")

    @contextmanager
    def holding_rmmp(self, privilege: Privilege = Privilege.MODIFY, timeout: float = 30.0) -> Iterator[None]:
        """The remote manual mode privilege for the time of the block, which has to poll it when it takes long.

        Args:
            privilege: what for.
            timeout: longest time that a person has to grant it [s].

        Raises:
            ControllerRefused: it was denied.
            NoConnection: no one answered in time.
        """
        self.request_rmmp(privilege)
        try:
            end = self._clock.now() + timeout
            while (status := self.poll_rmmp()) is RmmpStatus.PENDING:
                if self._clock.now() >= end:
                    raise NoConnection(
                        f"{self.address}: the remote manual mode privilege was not granted within {timeout:.0f} s; "
                        "grant it on the FlexPendant."
                    )
                self._clock.wait(_RMMP_POLL)
            if status is RmmpStatus.DENIED:
                what = f"{self.address}: the remote manual mode privilege was denied on the FlexPendant."
                raise ControllerRefused(what, status=0, code=Code.DENIED)
            yield
        finally:
            self.cancel_rmmp()

    # Mastership

    def mastership(self, domain: str) -> str:
        """Which other client holds the right to change ``cfg``, ``rapid`` or ``motion``; empty where none does."""
        return self._read(get(f"/rw/mastership/{domain}"), replies.mastership, f"reading the mastership of {domain}")

    def mastership_domains(self) -> tuple[str, ...]:
        """What a client can have the mastership of: ``cfg``, ``motion``, ``rapid``."""
        return tuple(state.title for state in self._states("reading the masterships", "/rw/mastership"))

    def request_all_masterships(self) -> None:
        """Take the mastership of all domains; the FlexPendant is locked out until they are released."""
        self._do(post("/rw/mastership", "request"), "requesting all masterships")

    def release_all_masterships(self) -> None:
        """Release the mastership of all domains."""
        self._do(post("/rw/mastership", "release"), "releasing all masterships")


def _user(state: State, uid: str, locale: str) -> User:
    names = ("alias", "application", "location")
    name, application, location = (state.fields.get(name, "") for name in names)
    return User(state.whole(uid), name, application, location, state.fields.get(locale, "") == "local")
