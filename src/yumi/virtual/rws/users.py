"""``/users`` and ``/rw/mastership``: who a client is, what it may do and what it holds (reference/rws.md §10)."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf

from yumi.rws.documents import Link, Page, State
from yumi.rws.types import GRANTS, Code, Grant, OperatingMode
from yumi.virtual.controller.controller import Irc5
from yumi.virtual.rws.http import HttpReply
from yumi.virtual.rws.operations import Call, Failure, Operation, entry, invalid, resource

_BASE = "/users/"
_MASTERSHIP = "/rw/mastership/"

Domains = Mapping[str, str]
"""What one client at a time may change: the names a client knows, by those of the table of operations."""

OWN_DOMAINS: Domains = {"cfg": "cfg", "motion": "motion", "rapid": "rapid"}
"""Those of RobotWare 6."""

_FULL_SPEED = 100  # [%]
_POLL_LIFE = 10.0
"""A request for the privilege ends when its client does not poll for this long [s]."""

PENDANT_TIME = 1.0
"""The operator at the FlexPendant, whom this controller does not have, grants a request after this time [s]."""

_TAKING = Grant.RAPID_DEBUG
"""What a client is granted that takes a mastership."""

_RESTARTS = {"restart": Grant.REMOTE_WARMSTART, "shutdown": Grant.REMOTE_WARMSTART, "bstart": Grant.RESTORE}
"""By the mode of a restart; all others change which system runs, or its state."""


@dataclass(frozen=True, slots=True)
class User:
    """How a client has introduced itself.

    Attributes:
        uid: its number.
        name, application, location: free text.
        locale: ``local`` at the FlexPendant, ``remote`` elsewhere.
    """

    uid: int
    name: str = "Default User"
    application: str = ""
    location: str = ""
    locale: str = "remote"


@dataclass(slots=True)
class _Request:
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


class Users:
    """The users of all sessions, and who may write in manual mode (RMMP).

    Attributes:
        granted: what the user may do; everything else that needs a grant is refused.
    """

    def __init__(self, granted: Collection[Grant] = GRANTS) -> None:
        self._users: dict[str, User] = {}
        self._counted = 0
        self._request: _Request | None = None
        self._now = -inf
        self.granted = granted
        self.operations = (
            Operation("GET", "/users", self.get_users, query={"user-type": ("self",)}),
            Operation(
                "POST",
                "/users",
                self.register,
                values={"username": (), "application": (), "location": (), "ulocale": ("local", "remote")},
                status=201,
            ),
            Operation("POST", "/users", self.impersonate, "impersonate", {"uid": ()}, status=200),
            Operation("POST", "/users", self.set_locale, "set-locale", {"type": ("local", "remote")}, status=200),
            Operation("GET", "/users/grants", self.get_grants),
            Operation("GET", "/users/rmmp", self.get_rmmp),
            Operation("POST", "/users/rmmp", self.ask, values={"privilege": ("modify", "exec")}, status=202),
            Operation("POST", "/users/rmmp", self.grant, "set", {"uid": (), "privilege": ("modify", "exec", "deny")}),
            Operation("POST", "/users/rmmp", self.cancel, "cancel"),
            Operation("GET", "/users/rmmp/poll", self.poll),
            Operation("POST", "/users/remoteuser", lambda *_: None, "remotelogin"),
            Operation("POST", "/users/remoteuser", lambda *_: None, "remotelogout"),
        )

    def of(self, session: str) -> User:
        """The user of a session; one that has not registered is remote."""
        if session not in self._users:
            self._counted += 1
            self._users[session] = User(self._counted)
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
        elif held.status == "PENDING" and now - held.asked_at >= PENDANT_TIME:
            held.status = "GRANTED"

    def get_users(self, controller: Irc5, call: Call) -> Page:
        own = self.of(call.session)
        shown = [own] if call.option("user-type") == "self" else self._users.values()
        states = (
            State(
                "user",
                user.name,
                {
                    "uid": str(user.uid),
                    "alias": user.name,
                    "location": user.location,
                    "application": user.application,
                    "ulocale": user.locale,
                },
            )
            for user in shown
        )
        return resource("ROBAPI2 User", "/", "users", *states)

    def register(self, controller: Irc5, call: Call) -> None:
        self._users[call.session] = User(
            self.of(call.session).uid,
            call.required("username"),
            call.required("application"),
            call.required("location"),
            call.required("ulocale"),
        )

    def impersonate(self, controller: Irc5, call: Call) -> None:
        uid = call.required("uid")
        if uid not in {str(user.uid) for user in self._users.values()}:
            raise invalid(f"there is no user {uid[:20]!r}")

    def set_locale(self, controller: Irc5, call: Call) -> None:
        locale, own = call.required("type"), self.of(call.session)
        if locale == own.locale:
            raise Failure(409, Code.INVALIDARG, f"the client is {locale} already")
        if locale == "local":
            raise Failure(403, Code.LOCAL_NOT_ALLOWED, "the enabling device was not pressed within 5 s")
        self._users[call.session] = replace(own, locale=locale)

    def get_grants(self, controller: Irc5, call: Call) -> Page:
        names = [each.value for each in Grant if each in self.granted]
        return resource("ROBAPI2 User", _BASE, "grants", *(State("user-grant", name, {}) for name in names))

    def check(self, operation: Operation, controller: Irc5, call: Call) -> None:
        """Refuse an operation that the user is not granted.

        Raises:
            Failure: 403.
        """
        needed = operation.needs_grant
        if needed is Grant.REMOTE_WARMSTART:
            needed = _RESTARTS.get(call.parameter("restart-mode", "restart"), Grant.SYSTEM_ADMINISTRATION)
        if needed is Grant.SPEED_DECREASE and (
            controller.mode is not OperatingMode.AUTO or controller.speed_ratio < _FULL_SPEED
        ):
            return
        if needed is not None:
            self.check_grant(needed)

    def check_grant(self, needed: Grant) -> None:
        """Refuse what the user lacks a grant for.

        Raises:
            Failure: 403.
        """
        if needed not in self.granted and Grant.FULL_ACCESS not in self.granted:
            raise Failure(403, Code.UAS_REJECT, f"the user lacks the grant {needed.value}")

    def get_rmmp(self, controller: Irc5, call: Call) -> Page:
        held = self._request
        user = User(0, "", "", "") if held is None else self.of(held.session)
        privilege = "none" if held is None else held.privilege if held.status == "GRANTED" else "pending modify"
        fields = {
            "userid": str(user.uid),
            "alias": user.name,
            "location": user.location,
            "application": user.application,
            "privilege": privilege,
            "rmmpheldbyme": "TRUE" if self.privilege(call.session) != "none" else "FALSE",
        }
        return resource(
            "ROBAPI2 User", _BASE, "rmmp", State("user-rmmp", "state", fields, (Link("poll", "rmmp/poll"),))
        )

    def ask(self, controller: Irc5, call: Call) -> HttpReply:
        held = self._request
        if held is not None and held.session != call.session:
            raise Failure(403, Code.RESOURCE_HELD, "another client has asked for the privilege or holds it")
        self._request = _Request(call.session, call.required("privilege"), self._now, self._now)
        return HttpReply(202, (("Location", "/users/rmmp/poll"), ("Content-Type", "application/xhtml+xml")))

    def grant(self, controller: Irc5, call: Call) -> None:
        held, privilege = self._request, call.required("privilege")
        if self.of(call.session).locale != "local":
            raise Failure(403, Code.LOCAL_NOT_ALLOWED, "a local client grants the privilege, such as the FlexPendant")
        if held is None or str(self.of(held.session).uid) != call.required("uid"):
            raise Failure(400, Code.NO_SUCH_REQUEST, "there is no request of that user")
        held.status = "DENIED" if privilege == "deny" else "GRANTED"
        held.privilege = held.privilege if privilege == "deny" else privilege

    def cancel(self, controller: Irc5, call: Call) -> None:
        if self._request is not None and self._request.session == call.session:
            self._request = None

    def poll(self, controller: Irc5, call: Call) -> Page:
        held = self._request
        if held is None or held.session != call.session:
            raise Failure(400, Code.NO_SUCH_REQUEST, "NO SUCH REQUEST: the privilege was not asked for")
        held.polled_at = self._now
        code = {"PENDING": 294914, "GRANTED": 294915, "DENIED": int(Code.DENIED)}[held.status]
        state = State("user-rmmp-poll", "poll", {"code": str(code), "status": held.status})
        return resource("ROBAPI2 User", _BASE, "rmmp/poll", state)


def refuse_in_manual_mode(controller: Irc5, call: Call, what: str) -> None:
    """Refuse a change in manual mode to a client without the privilege.

    Raises:
        Failure: 403.
    """
    if controller.mode.value != "AUTO" and call.privilege == "none":
        raise Failure(403, Code.MASTER_REJECT, f"in manual mode {what} needs RMMP: request it at /users/rmmp")


class Mastership:
    """Which session of ``users`` holds which domain; a session that ends releases what it holds.

    Attributes:
        names: of the domains, as clients know them.
    """

    def __init__(self, users: Users, domains: Domains) -> None:
        self._users = users
        self._domains = domains
        self.names = tuple(dict.fromkeys(domains.values()))
        self._holders: dict[str, str] = {}
        path = "/rw/mastership/{domain}"
        self.operations = (
            Operation("GET", "/rw/mastership", self.get_domains),
            Operation("POST", "/rw/mastership", self.request_all, "request", needs_grant=_TAKING),
            Operation("POST", "/rw/mastership", self.release_all, "release"),
            Operation("GET", path, self.get_domain),
            Operation("POST", path, self.request, "request", needs_grant=_TAKING),
            Operation("POST", path, self.release, "release"),
        )

    def keep(self, sessions: Collection[str]) -> None:
        """Release what all other sessions hold."""
        self._holders = {domain: holder for domain, holder in self._holders.items() if holder in sessions}

    def check(self, operation: Operation, controller: Irc5, call: Call, *, is_implicit: bool = False) -> None:
        """Refuse an operation that another client's mastership forbids, or that needs one.

        Args:
            operation: to be carried out.
            controller: that is to do it.
            call: of the client.
            is_implicit: whether the client takes the mastership for this operation alone.

        Raises:
            Failure: 403.
        """
        domain = self._domains.get(operation.needs_mastership or operation.respects_mastership, "")
        if domain:
            self._exclude_others(domain, call.session)
        if not operation.needs_mastership or domain in self._holders:
            return
        if is_implicit:
            self._check_taking(controller, call, (domain,))
        else:
            raise Failure(403, Code.MASTER_REJECT, f"the mastership of {domain} is needed; request it first")

    def _exclude_others(self, domain: str, session: str) -> None:
        if self._holders.get(domain, session) != session:
            raise Failure(403, Code.RESOURCE_HELD, f"Requested resource is held by someone else: {domain}")

    def get_domains(self, controller: Irc5, call: Call) -> Page:
        return resource("MasterShip", _MASTERSHIP, "", *(entry("msh-resource-li", domain) for domain in self.names))

    def get_domain(self, controller: Irc5, call: Call) -> Page:
        domain = self._domain(call)
        is_own = self._holders.get(domain) == call.session
        fields = {**self.fields(domain), "mastershipheldbyme": "TRUE" if is_own else "FALSE"}
        return resource("MasterShip", _MASTERSHIP, domain, State("msh-resource", domain, fields))

    def fields(self, domain: str) -> dict[str, str]:
        """Who holds a domain."""
        holder = self._holders.get(domain)
        user = User(0, "") if holder is None else self._users.of(holder)
        return {
            "uid": str(user.uid),
            "location": user.location,
            "alias": user.name,
            "application": user.application,
            "mastership": "nomaster" if holder is None else user.locale,
        }

    def request_all(self, controller: Irc5, call: Call) -> None:
        self._take(controller, call, self.names)

    def request(self, controller: Irc5, call: Call) -> None:
        self._take(controller, call, (self._domain(call),))

    def _take(self, controller: Irc5, call: Call, domains: Sequence[str]) -> None:
        self._check_taking(controller, call, domains)
        self._holders |= dict.fromkeys(domains, call.session)

    def _check_taking(self, controller: Irc5, call: Call, domains: Sequence[str]) -> None:
        """Refuse a mastership, for one request or until it is released.

        Raises:
            Failure: 403.
        """
        self._users.check_grant(_TAKING)
        refuse_in_manual_mode(controller, call, "the mastership")
        for domain in domains:
            self._exclude_others(domain, call.session)

    def release_all(self, controller: Irc5, call: Call) -> None:
        self._holders = {domain: holder for domain, holder in self._holders.items() if holder != call.session}

    def release(self, controller: Irc5, call: Call) -> None:
        domain = self._domain(call)
        if self._holders.get(domain) != call.session:
            raise Failure(403, Code.RESOURCE_NOT_HELD, f"the mastership of {domain} is not held by this client")
        del self._holders[domain]

    def _domain(self, call: Call) -> str:
        domain = call.names["domain"].lower()
        if domain not in self.names:
            raise Failure(404, Code.FAIL, f"there is no mastership of {domain!r}")
        return domain
