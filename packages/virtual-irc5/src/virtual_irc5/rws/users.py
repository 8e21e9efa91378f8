"""The virtual controller's answers on ``/users``: who a client is, what it may change in manual mode (rws.md §10)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from math import inf
from typing import Any

from abb_protocols.rws.documents import Page, RwsLink, RwsState
from abb_protocols.rws.operations import users as table
from abb_protocols.rws.operations.operation import Operation
from abb_protocols.rws.operations.users import User
from abb_protocols.rws.values import GRANTS, Grant, OperatingMode, RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rws.http import HttpReply
from virtual_irc5.rws.render import page_at
from virtual_irc5.rws.router import Route
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, bad_call

_USERS_BASE = "/users/"

_FULL_SPEED = 100  # [%]
_POLL_CODES = {
    "PENDING": 294914,
    "GRANTED": 294915,
    "DENIED": int(RwsCode.DENIED),
    "NO SUCH REQUEST": int(RwsCode.NO_SUCH_REQUEST),
}
"""The states of a request for the privilege (3HAC050973, "Poll for RMMP grant status")."""

_POLL_LIFE = 10.0
"""A request for the privilege ends when its client does not poll for this long [s]."""

_PENDANT_TIME = 1.0
"""The operator at the FlexPendant, whom this controller does not have, grants a request after this time [s]."""


_RESTART_GRANTS = {"restart": Grant.REMOTE_WARMSTART, "shutdown": Grant.REMOTE_WARMSTART, "bstart": Grant.RESTORE}
"""By the mode of a restart; all others change which system runs, or its state."""


@dataclass(slots=True)
class _PrivilegeRequest:
    """A client's privilege, asked for or granted.

    Attributes:
        session: of the client.
        privilege: ``modify`` or ``exec``.
        asked_at, polled_at: when [s].
        status: ``PENDING``, ``GRANTED`` or ``DENIED``.
    """

    session: str
    privilege: str
    asked_at: float
    polled_at: float
    status: str = "PENDING"


class VirtualUsers:
    """The users of all sessions, and who may write in manual mode (RMMP).

    Attributes:
        granted: what the user may do; everything else that needs a grant is refused.
    """

    def __init__(self, granted: Collection[Grant] = GRANTS) -> None:
        self._users: dict[str, User] = {}
        self._counted = 0
        self._request: _PrivilegeRequest | None = None
        self._now = -inf
        self.granted = granted
        self.routes = (
            Route(table.USERS, self.get_users),
            Route(table.REGISTER_USER, self.register),
            Route(table.IMPERSONATE_USER, self.impersonate),
            Route(table.SET_USER_LOCALE, self.set_locale),
            Route(table.GRANTS, self.get_grants),
            Route(table.RMMP, self.get_rmmp),
            Route(table.REQUEST_RMMP, self.ask),
            Route(table.GRANT_RMMP, self.grant),
            Route(table.CANCEL_RMMP, self.cancel),
            Route(table.POLL_RMMP, self.poll),
            Route(table.REMOTE_LOGIN, lambda *_: None),
            Route(table.REMOTE_LOGOUT, lambda *_: None),
        )

    def of(self, session: str) -> User:
        """The user of a session; one that has not registered is remote."""
        if session not in self._users:
            self._counted += 1
            self._users[session] = User(self._counted, "Default User")
        return self._users[session]

    def privilege(self, session: str) -> str:
        """What a client may change in manual mode: ``none``, ``modify`` or ``exec``."""
        held = self._request
        is_held = held is not None and held.session == session and held.status == "GRANTED"
        return held.privilege if held is not None and is_held else "none"

    @property
    def state(self) -> str:
        """Holder and status of the privilege, which rise an event when they change."""
        held = self._request
        return "none" if held is None else f"{self.of(held.session).uid} {held.privilege} {held.status}"

    def keep(self, sessions: Collection[str], now: float) -> None:
        """Forget all other sessions; grant what has waited long enough, and drop what is no longer polled."""
        self._now = now
        self._users = {session: user for session, user in self._users.items() if session in sessions}
        held = self._request
        if held is None:
            return
        if held.session not in sessions or (held.status == "PENDING" and now - held.polled_at > _POLL_LIFE):
            self._request = None
        elif held.status == "PENDING" and now - held.asked_at >= _PENDANT_TIME:
            held.status = "GRANTED"

    def get_users(self, controller: Irc5, call: RwsCall) -> Page:
        own = self.of(call.session)
        shown = [own] if call.option("user-type") == "self" else self._users.values()
        return page_at("ROBAPI2 User", "/", "users", *(table.USERS.answered.state(user.name, user) for user in shown))

    def register(self, controller: Irc5, call: RwsCall) -> None:
        self._users[call.session] = User(
            self.of(call.session).uid,
            call.required("username"),
            call.required("location"),
            call.required("application"),
            call.required("ulocale") == "local",
        )

    def impersonate(self, controller: Irc5, call: RwsCall) -> None:
        uid = call.required("uid")
        if uid not in {str(user.uid) for user in self._users.values()}:
            raise bad_call(f"there is no user {uid[:20]!r}")

    def set_locale(self, controller: Irc5, call: RwsCall) -> None:
        locale, own = call.required("type"), self.of(call.session)
        if (locale == "local") is own.is_local:
            raise CallFailure(409, RwsCode.INVALIDARG, f"the client is {locale} already")
        if locale == "local":
            raise CallFailure(403, RwsCode.LOCAL_NOT_ALLOWED, "the enabling device was not pressed within 5 s")
        self._users[call.session] = replace(own, is_local=False)

    def get_grants(self, controller: Irc5, call: RwsCall) -> Page:
        names = [each.value for each in Grant if each in self.granted]
        return page_at("ROBAPI2 User", _USERS_BASE, "grants", *(RwsState("user-grant", name, {}) for name in names))

    def check(self, operation: Operation[Any], controller: Irc5, call: RwsCall) -> None:
        """Refuse an operation that the user is not granted.

        Raises:
            CallFailure: 403.
        """
        needed = operation.needs_grant
        if needed is Grant.REMOTE_WARMSTART:
            needed = _RESTART_GRANTS.get(call.parameter("restart-mode", "restart"), Grant.SYSTEM_ADMINISTRATION)
        if needed is Grant.SPEED_DECREASE and (
            controller.mode is not OperatingMode.AUTO or controller.speed_ratio < _FULL_SPEED
        ):
            return
        if needed is not None:
            self.check_grant(needed)

    def check_grant(self, needed: Grant) -> None:
        """Refuse what the user lacks a grant for.

        Raises:
            CallFailure: 403.
        """
        if needed not in self.granted and Grant.FULL_ACCESS not in self.granted:
            raise CallFailure(403, RwsCode.UAS_REJECT, f"the user lacks the grant {needed.value}")

    def get_rmmp(self, controller: Irc5, call: RwsCall) -> Page:
        held = self._request
        user = User(0) if held is None else self.of(held.session)
        privilege = "none" if held is None else held.privilege if held.status == "GRANTED" else "pending modify"
        fields = {
            **table.RMMP_USER.write(user),
            "privilege": privilege,
            "rmmpheldbyme": "TRUE" if self.privilege(call.session) != "none" else "FALSE",
        }
        return page_at(
            "ROBAPI2 User", _USERS_BASE, "rmmp", RwsState("user-rmmp", "state", fields, (RwsLink("poll", "rmmp/poll"),))
        )

    def ask(self, controller: Irc5, call: RwsCall) -> HttpReply:
        held = self._request
        if held is not None and held.session != call.session:
            raise CallFailure(403, RwsCode.RESOURCE_HELD, "another client has asked for the privilege or holds it")
        self._request = _PrivilegeRequest(call.session, call.required("privilege"), self._now, self._now)
        return HttpReply.at("/users/rmmp/poll")

    def grant(self, controller: Irc5, call: RwsCall) -> None:
        held, privilege = self._request, call.required("privilege")
        if not self.of(call.session).is_local:
            raise CallFailure(
                403, RwsCode.LOCAL_NOT_ALLOWED, "a local client grants the privilege, such as the FlexPendant"
            )
        if held is None or str(self.of(held.session).uid) != call.required("uid"):
            raise CallFailure(400, RwsCode.NO_SUCH_REQUEST, "there is no request of that user")
        held.status = "DENIED" if privilege == "deny" else "GRANTED"
        held.privilege = held.privilege if privilege == "deny" else privilege

    def cancel(self, controller: Irc5, call: RwsCall) -> None:
        if self._request is not None and self._request.session == call.session:
            self._request = None

    def poll(self, controller: Irc5, call: RwsCall) -> Page:
        held, status = self._request, "NO SUCH REQUEST"
        if held is not None and held.session == call.session:
            held.polled_at, status = self._now, held.status
        state = RwsState("user-rmmp-poll", "poll", {"code": str(_POLL_CODES[status]), "status": status})
        return page_at("ROBAPI2 User", _USERS_BASE, "rmmp/poll", state)


def refuse_in_manual_mode(controller: Irc5, call: RwsCall, what: str) -> None:
    """Refuse a change in manual mode to a client without the privilege.

    Raises:
        CallFailure: 403.
    """
    if controller.mode.value != "AUTO" and call.privilege == "none":
        raise CallFailure(403, RwsCode.MASTER_REJECT, f"in manual mode {what} needs RMMP: request it at /users/rmmp")
