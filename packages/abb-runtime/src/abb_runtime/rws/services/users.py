"""The client's service for users: grants, masterships, and the remote manual mode privilege (RMMP)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from abb_protocols.catalogue import message
from abb_protocols.errors import ControllerRefused, NoConnection
from abb_protocols.rws import documents
from abb_protocols.rws.operations import mastership
from abb_protocols.rws.operations import users as table
from abb_protocols.rws.operations.users import User
from abb_protocols.rws.values import Privilege, RmmpStatus, RwsCode
from abb_runtime.rws.services.service import Service

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


class UsersService(Service):
    """``/users`` and ``/rw/mastership``."""

    def users(self) -> tuple[User, ...]:
        """Clients that are logged in; some controllers show this one only."""
        return self._answers("reading the users", table.USERS)

    def register(
        self, name: str = "Default User", application: str = "yumi-ros2", location: str = "", *, is_local: bool = False
    ) -> None:
        """Say who this client is, for the FlexPendant and other clients."""
        whom = {"username": name, "application": application, "location": location}
        self._call("registering", table.REGISTER, **whom, ulocale="local" if is_local else "remote")

    def set_local(self, is_local: bool) -> None:
        """Become a local client, which needs the enabling device within 5 s, or a remote one."""
        self._call("changing the locale", table.SET_LOCALE, type="local" if is_local else "remote")

    def impersonate(self, uid: int) -> None:
        """Act as another client that is logged in; for local clients."""
        self._call("acting as another client", table.IMPERSONATE, uid=uid)

    def grants(self) -> tuple[str, ...]:
        """What the user is permitted, such as ``UAS_RAPID_EXECUTE``."""
        states = self._listed("reading the grants", table.GRANTS)
        return tuple(  # the title is the name, or "user-grant" with the name in a field
            next((text for text in state.fields.values() if text.startswith("UAS_")), state.title) for state in states
        )

    def log_in_remotely(self) -> None:
        """Take the rights of a remote user."""
        self._call("logging in as remote user", table.REMOTE_LOGIN)

    def log_out_remotely(self) -> None:
        """Give up the rights of a remote user."""
        self._call("logging out as remote user", table.REMOTE_LOGOUT)

    # Remote manual mode privilege

    def rmmp(self) -> Rmmp:
        """Who has the remote manual mode privilege."""
        state = self._shown("reading the privilege", table.RMMP).one("user-rmmp")
        privilege = state.text("privilege")
        user = None if privilege == "none" else table.RMMP_USER.read(state)
        return Rmmp(user, privilege, state.flag("rmmpheldbyme"))

    def request_rmmp(self, privilege: Privilege = Privilege.MODIFY) -> None:
        """Ask for the privilege to change something in manual mode; a person grants it on the FlexPendant.

        ``poll_rmmp`` at least every ten seconds, or the request is forgotten.
        """
        self._call("asking for the remote manual mode privilege", table.REQUEST_RMMP, privilege=privilege)

    def poll_rmmp(self) -> RmmpStatus:
        """What became of the request; a granted privilege ends when it is not polled, too.

        Raises:
            ControllerRefused: there is no request.
        """
        state = self._shown("asking for the privilege", table.POLL_RMMP).one("user-rmmp-poll")
        if state.text("code") == str(int(RwsCode.NO_SUCH_REQUEST)):
            said = message("no_privilege_requested", address=self.address)
            raise ControllerRefused(said, status=0, code=RwsCode.NO_SUCH_REQUEST)
        return state.member(RmmpStatus, "status")

    def cancel_rmmp(self) -> None:
        """Withdraw the request, or give the privilege back."""
        self._call("giving the privilege back", table.CANCEL_RMMP)

    def grant_rmmp(self, uid: int, privilege: Privilege | None) -> None:
        """Grant another client's request, or deny it with None; for local clients."""
        what = "answering a request for the privilege"
        self._call(what, table.GRANT_RMMP, uid=uid, privilege="deny" if privilege is None else privilege)

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
                    raise NoConnection(message("privilege_not_granted", address=self.address, timeout=timeout))
                self._clock.wait(_RMMP_POLL)
            if status is RmmpStatus.DENIED:
                said = message("privilege_denied", address=self.address)
                raise ControllerRefused(said, status=0, code=RwsCode.DENIED)
            yield
        finally:
            self.cancel_rmmp()

    # Mastership

    def mastership(self, domain: str) -> str:
        """Which other client holds the right to change ``cfg``, ``rapid`` or ``motion``; empty where none does."""
        what = f"reading the mastership of {domain}"
        return documents.read_mastership(self._shown(what, mastership.DOMAIN, domain))

    def mastership_domains(self) -> tuple[str, ...]:
        """What a client can have the mastership of: ``cfg``, ``motion``, ``rapid``."""
        return tuple(state.title for state in self._listed("reading the masterships", mastership.DOMAINS))

    def request_all_masterships(self) -> None:
        """Take the mastership of all domains; the FlexPendant is locked out until they are released."""
        self._call("requesting all masterships", mastership.REQUEST_ALL)

    def release_all_masterships(self) -> None:
        """Release the mastership of all domains."""
        self._call("releasing all masterships", mastership.RELEASE_ALL)
