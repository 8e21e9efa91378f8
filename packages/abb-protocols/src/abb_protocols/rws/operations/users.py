"""Operations on users, their grants, logout, and the remote manual mode privilege, RMMP (``/users``); their calls."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated

from abb_protocols.catalogue import message
from abb_protocols.errors import ControllerRefused, NoConnection
from abb_protocols.rws.operations.operation import get, post
from abb_protocols.rws.operations.operation_answer import WHOLE, Spelling, choice, record
from abb_protocols.rws.operations.service import Service
from abb_protocols.rws.values import Privilege, RmmpStatus, RwsCode

_LOCALE = choice("local", "remote")
_RMMP_POLL = 0.25  # [s]; the controller forgets a request that is not polled for 10 s


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


@dataclass(frozen=True, slots=True)
class User:
    """A client that is logged in, as it has introduced itself; it is local at the FlexPendant."""

    uid: int
    name: Annotated[str, "alias"] = ""
    location: str = ""
    application: str = ""
    is_local: Annotated[bool, "ulocale", _LOCALE] = False


USERS = get("/users", "user-type=self").shows(record("user", User))
REGISTER_USER = post("/users", None, "username, application, location, ulocale=local|remote", status=201)
IMPERSONATE_USER = post("/users", "impersonate", "uid", status=200)
SET_USER_LOCALE = post("/users", "set-locale", "type=local|remote", status=200)
GRANTS = get("/users/grants")
RMMP = get("/users/rmmp")
RMMP_USER = record(
    "user-rmmp", User, uid=("userid", WHOLE), is_local=("ulocale", Spelling(_LOCALE.read, lambda name, is_local: {}))
)
"""Who has the privilege, in the state of ``RMMP``."""

REQUEST_RMMP = post("/users/rmmp", None, "privilege=modify|exec", status=202)
GRANT_RMMP = post("/users/rmmp", "set", "uid, privilege=modify|exec|deny")
CANCEL_RMMP = post("/users/rmmp", "cancel")
POLL_RMMP = get("/users/rmmp/poll")
REMOTE_LOGIN = post("/users/remoteuser", "remotelogin")
REMOTE_LOGOUT = post("/users/remoteuser", "remotelogout")
LOGOUT = get("/logout", status=204)


class UsersService(Service):
    """``/users``."""

    def users(self) -> tuple[User, ...]:
        """Clients that are logged in; some controllers show this one only."""
        return self._answers("reading the users", USERS)

    def register(
        self, name: str = "Default User", application: str = "yumi-ros2", location: str = "", *, is_local: bool = False
    ) -> None:
        """Say who this client is, for the FlexPendant and other clients."""
        whom = {"username": name, "application": application, "location": location}
        self._call("registering", REGISTER_USER, **whom, ulocale="local" if is_local else "remote")

    def set_local(self, is_local: bool) -> None:
        """Become a local client, which needs the enabling device within 5 s, or a remote one."""
        self._call("changing the locale", SET_USER_LOCALE, type="local" if is_local else "remote")

    def impersonate(self, uid: int) -> None:
        """Act as another client that is logged in; for local clients."""
        self._call("acting as another client", IMPERSONATE_USER, uid=uid)

    def grants(self) -> tuple[str, ...]:
        """What the user is permitted, such as ``UAS_RAPID_EXECUTE``."""
        states = self._listed("reading the grants", GRANTS)
        return tuple(  # the title is the name, or "user-grant" with the name in a field
            next((text for text in state.fields.values() if text.startswith("UAS_")), state.title) for state in states
        )

    def log_in_remotely(self) -> None:
        """Take the rights of a remote user."""
        self._call("logging in as remote user", REMOTE_LOGIN)

    def log_out_remotely(self) -> None:
        """Give up the rights of a remote user."""
        self._call("logging out as remote user", REMOTE_LOGOUT)

    # Remote manual mode privilege

    def rmmp(self) -> Rmmp:
        """Who has the remote manual mode privilege."""
        state = self._shown("reading the privilege", RMMP).one("user-rmmp")
        privilege = state.text("privilege")
        user = None if privilege == "none" else RMMP_USER.read(state)
        return Rmmp(user, privilege, state.flag("rmmpheldbyme"))

    def request_rmmp(self, privilege: Privilege = Privilege.MODIFY) -> None:
        """Ask for the privilege to change something in manual mode; a person grants it on the FlexPendant.

        ``poll_rmmp`` at least every ten seconds, or the request is forgotten.
        """
        self._call("asking for the remote manual mode privilege", REQUEST_RMMP, privilege=privilege)

    def poll_rmmp(self) -> RmmpStatus:
        """What became of the request; a granted privilege ends when it is not polled, too.

        Raises:
            ControllerRefused: there is no request.
        """
        state = self._shown("asking for the privilege", POLL_RMMP).one("user-rmmp-poll")
        if state.text("code") == str(int(RwsCode.NO_SUCH_REQUEST)):
            said = message("no_privilege_requested", address=self.address)
            raise ControllerRefused(said, status=0, code=RwsCode.NO_SUCH_REQUEST)
        return state.member(RmmpStatus, "status")

    def cancel_rmmp(self) -> None:
        """Withdraw the request, or give the privilege back."""
        self._call("giving the privilege back", CANCEL_RMMP)

    def grant_rmmp(self, uid: int, privilege: Privilege | None) -> None:
        """Grant another client's request, or deny it with None; for local clients."""
        what = "answering a request for the privilege"
        self._call(what, GRANT_RMMP, uid=uid, privilege="deny" if privilege is None else privilege)

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
            answers = (self.poll_rmmp() for _ in self._polls(_RMMP_POLL, timeout))
            status = next((each for each in answers if each is not RmmpStatus.PENDING), None)
            if status is None:
                raise NoConnection(message("privilege_not_granted", address=self.address, timeout=timeout))
            if status is RmmpStatus.DENIED:
                said = message("privilege_denied", address=self.address)
                raise ControllerRefused(said, status=0, code=RwsCode.DENIED)
            yield
        finally:
            self.cancel_rmmp()
