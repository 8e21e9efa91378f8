"""The operations of Robot Web Services as one table, and who may do them: users, their grants, masterships.

A line of the table is method, path, action and handler, and what is checked before it. Each service (``system``,
``rapid``, …) has its handlers and its part of the table; those of ``/users`` and ``/rw/mastership``
(reference/rws.md §10) are here, since they know who a client is, what it may do and what it holds.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import inf, isfinite, nan
from typing import NamedTuple, cast

from aiohttp import web
from yarl import URL

from yumi.errors import YumiError
from yumi.rws.documents import Link, Page, Pairs, State, Status, first_value
from yumi.rws.types import GRANTS, Code, Grant, OperatingMode
from yumi.virtual.controller.irc5 import Irc5
from yumi.virtual.controller_log import Refusal, Refused
from yumi.virtual.rws.http import HttpReply, entry, resource

_MOST_DIGITS = 12
_MOST_PATHS = 1024  # whose operations are remembered: finding one takes longer than most answers
LONGEST_KEPT = 256  # characters of a target or path that is remembered; none that clients use is longer


class Failure(YumiError):
    """The answer is an error.

    Attributes:
        status: of HTTP.
        code: ABB's.
    """

    def __init__(self, status: int, code: Code, sentence: str) -> None:
        super().__init__(sentence)
        self.status = status
        self.code = code

    def document(self, service: str) -> Status:
        """The error document, its message in the controller's shape (reference/rws.md §3.4)."""
        sentence = str(self).rstrip(".")
        if service == "fileservice":
            return Status(int(self.code), f"{sentence} {int(self.code)} -1")
        message = f"rws_resource_{service}.cpp[1] {sentence} code:{int(self.code)} icode:-1"
        return Status(int(self.code), message)


def invalid(sentence: str) -> Failure:
    """The failure for a parameter that makes no sense."""
    return Failure(400, Code.INVALIDARG, sentence)


_REFUSALS: Mapping[Refusal, tuple[int, Code]] = {
    Refusal.WRONG_MODE: (403, Code.MODE_REJECT),
    Refusal.MOTORS_OFF: (400, Code.EXEC_STATE),
    Refusal.NOT_STOPPED: (400, Code.EXEC_STATE),
    Refusal.ALREADY_RUNNING: (400, Code.EXEC_STATE),
    Refusal.NO_PROGRAM_POINTER: (400, Code.EXEC_STATE),
    Refusal.READ_ONLY: (403, Code.REJECT),
    Refusal.UNKNOWN: (404, Code.UNRESOLVED_URL),
    Refusal.OUT_OF_RANGE: (400, Code.INVALIDARG),
    Refusal.EMERGENCY_STOP: (403, Code.INVALID_STATE),
    Refusal.BAD_VALUE: (400, Code.INVALIDARG),
    Refusal.NO_FILE: (400, Code.FILE_NOT_FOUND),
    Refusal.NO_MODULE: (400, Code.NO_SUCH_SYMBOL),
    Refusal.NAME_TAKEN: (400, Code.MODULE_NAME_TAKEN),
    Refusal.BAD_PROGRAM: (400, Code.SYNTAX),
    Refusal.NO_SPACE: (507, Code.MAX_LIMIT_REACHED),
}


def refusal(refused: Refused) -> Failure:
    """The answer to a request that the controller refuses."""
    status, code = _REFUSALS[refused.reason]
    return Failure(status, code, str(refused))


@dataclass(frozen=True, slots=True)
class Call:
    """A request whose path is understood.

    Attributes:
        method: of HTTP.
        path: the segments, unescaped, without a sub-property behind ``;``.
        query: parameters in the URL.
        form: parameters in the body.
        names: values of the placeholders in the operation's path.
        content: the body as it came.
        session: whose request it is.
        host: host and port as the client calls them.
        privilege: what the client may change in manual mode (RMMP): ``none``, ``modify`` or ``exec``.
    """

    method: str
    path: tuple[str, ...]
    query: Pairs = ()
    form: Pairs = ()
    names: Mapping[str, str] = field(default_factory=dict)
    content: bytes = b""
    session: str = ""
    host: str = ""
    privilege: str = "none"

    def option(self, name: str) -> str | None:
        """A parameter in the URL, or None."""
        return first_value(self.query, name) if self.query else None

    def number_option(self, name: str, default: int) -> int:
        """A parameter in the URL that is a whole number from 0.

        Raises:
            Failure: it is not a number.
        """
        text = self.option(name)
        if text is None:
            return default
        if not text.isdecimal() or len(text) > _MOST_DIGITS:
            raise invalid(f"{name} is a whole number of up to {_MOST_DIGITS} digits, not {text[:50]!r}")
        return int(text)

    def parameter(self, name: str, default: str) -> str:
        """A parameter in the body; ``default`` where it is missing or empty."""
        return first_value(self.form, name) or default

    def required(self, name: str) -> str:
        """A parameter in the body.

        Raises:
            Failure: it is missing.
        """
        value = first_value(self.form, name)
        if value is None:
            raise invalid(f"the body lacks {name}")
        return value

    def number(self, name: str) -> float:
        """A parameter in the body that is a finite number.

        Raises:
            Failure: it is missing or none.
        """
        text = self.required(name)
        try:
            value = float(text)
        except ValueError:
            value = nan
        if not isfinite(value):
            raise invalid(f"{name} is a finite number, not {text!r}")
        return value


Answer = Page | HttpReply | None
"""A page, a reply that is not a page, or None for "done, nothing to show"."""

Handler = Callable[[Irc5, Call], Answer]
"""Answers a call; raises Failure or Refused."""

Preparation = Callable[[Irc5, Call], Callable[[], object] | None]
"""Work that may be done while the robot goes on, and that the handler then finds done; None where nothing takes long.

It reads the controller, raises Failure, and changes nothing; the work touches nothing that the robot changes.
"""

Values = Mapping[str, tuple[str, ...]]
"""Parameters by name, each with the texts it may be; none where any text may come."""

_SUCCESS: Mapping[str, int] = {"GET": 200, "PUT": 200, "OPTIONS": 200, "HEAD": 204, "POST": 204, "DELETE": 204}


@dataclass(frozen=True, slots=True)
class Operation:
    """One line of the table.

    Attributes:
        method: of HTTP.
        path: ``{name}`` stands for one segment, ``{name:.+}`` for all that follow.
        handler: answers the call.
        action: the ``action`` in the URL; None for a call without one.
        values: the parameters in the body, and what each may be.
        needs_mastership: the domain whose mastership the client must hold, or "".
        respects_mastership: the domain that no other client may hold, or "".
        resource: the ``resource`` in the URL; an operation whose ``query`` has it answers all without their own line.
        query: the parameters in the URL beside these two, and what each may be.
        status: of HTTP where the call succeeds; 0 for the usual one of the method.
        needs_grant: what the user must be granted; None for what everybody may do.
        lacks: hardware or option that this robot does not have; such a call is answered with 404.
        prepare: the part of a call that takes longer than a cycle.
    """

    method: str
    path: str
    handler: Handler
    action: str | None = None
    values: Values = field(default_factory=dict)
    needs_mastership: str = ""
    respects_mastership: str = ""
    resource: str | None = None
    query: Values = field(default_factory=dict)
    status: int = 0
    lacks: str = ""
    needs_grant: Grant | None = None
    prepare: Preparation | None = None

    @property
    def success(self) -> int:
        """Status of HTTP where the call succeeds."""
        return 404 if self.lacks else self.status or _SUCCESS[self.method]

    @property
    def service(self) -> str:
        """The service it belongs to, such as ``rapid`` or ``fileservice``."""
        parts = [part for part in self.path.split("/") if part]
        return "root" if not parts else parts[1] if parts[0] == "rw" and len(parts) > 1 else parts[0]

    def check_values(self, call: Call) -> None:
        """Refuse a call with a parameter that is none of its values.

        Raises:
            Failure: 400.
        """
        for pairs, values in ((call.form, self.values), (call.query, self.query)):
            for name, text in pairs:
                if values.get(name) and text not in values[name]:
                    raise invalid(f"{name} is {' or '.join(values[name])}, not {text[:50]!r}")


def not_there(controller: Irc5, call: Call) -> None:
    """The answer of a controller without the hardware or option: it has no such resource."""
    raise Failure(404, Code.FAIL, f"there is no resource /{'/'.join(call.path)}")


class _Target(NamedTuple):
    """The two properties of a request that aiohttp's router reads."""

    method: str
    rel_url: URL


async def _no_handler(request: web.Request) -> web.StreamResponse:
    """Aiohttp's routes need a coroutine; ours answer without an event loop, in virtual time too."""
    raise NotImplementedError


class Router:
    """Finds the operation of a call with aiohttp's router."""

    def __init__(self, operations: Iterable[Operation]) -> None:
        self._dispatcher = web.UrlDispatcher()
        self._operations: dict[tuple[str, str], list[Operation]] = {}
        for operation in operations:
            resource = self._dispatcher.add_resource(operation.path)
            alternatives = self._operations.setdefault((operation.method, resource.canonical), [])
            if not alternatives:
                resource.add_route(operation.method, _no_handler)
            alternatives.append(operation)
        self._resolve_kept = lru_cache(_MOST_PATHS)(self._resolve_once)

    def find(self, call: Call) -> tuple[Operation, Call]:
        """The operation, and the call with the values of its placeholders.

        Raises:
            Failure: 404 for an unknown path, 405 for a method, 400 for an action it does not have.
        """
        path = "/" + "/".join(call.path)
        status, alternatives, names = self._resolve(call.method, path)
        if status == web.HTTPNotFound.status_code:
            raise Failure(404, Code.FAIL, f"there is no resource {path}")
        if status:
            raise Failure(405, Code.NOTIMPL, f"{call.method} is not possible on {path}")
        action, wanted = call.option("action"), call.option("resource") or None  # an empty one is none
        fitting = [each for each in alternatives if each.action == action]
        if call.method != "POST":  # an action of POST changes something; elsewhere an unknown one is ignored
            fitting = fitting or [each for each in alternatives if each.action is None]
        if not fitting:
            raise invalid(f"{path} {'needs an action' if action is None else f'does not have the action {action!r}'}")
        for operation in sorted(fitting, key=lambda each: each.resource != wanted):
            if operation.resource == wanted or (operation.resource is None and "resource" in operation.query):
                return operation, replace(call, names=names)
        raise invalid(f"{path} does not have the resource {wanted!r}")

    def actions(self, call: Call) -> Sequence[Operation]:
        """What can be done with the path of a call beside reading it."""
        path = "/" + "/".join(call.path)
        found: list[Operation] = []
        for method in ("POST", "PUT", "DELETE"):
            found += self._resolve(method, path)[1]
        return found

    def _resolve(self, method: str, path: str) -> tuple[int, Sequence[Operation], Mapping[str, str]]:
        return (self._resolve_kept if len(path) <= LONGEST_KEPT else self._resolve_once)(method, path)

    def _resolve_once(self, method: str, path: str) -> tuple[int, Sequence[Operation], Mapping[str, str]]:
        """Status of an error or 0, the operations of a method and path, and the values of the placeholders."""
        target = _Target(method, URL.build(path=path))
        try:
            # The router's coroutine waits for nothing, so that its first step is its last.
            self._dispatcher.resolve(cast("web.Request", target)).send(None)
        except StopIteration as result:
            match: web.UrlMappingMatchInfo = result.value
        if match.http_exception is not None:
            return match.http_exception.status, (), {}
        resource = match.route.resource
        assert resource is not None, "all routes are added to resources"
        return 0, self._operations[method, resource.canonical], dict(match)


_USERS_BASE = "/users/"
_MASTERSHIP_BASE = "/rw/mastership/"

Domains = Mapping[str, str]
"""What one client at a time may change: the names a client knows, by those of the table of operations."""

OWN_DOMAINS: Domains = {"cfg": "cfg", "motion": "motion", "rapid": "rapid"}
"""Those of RobotWare 6."""

_FULL_SPEED = 100  # [%]
_POLL_CODES = {
    "PENDING": 294914,
    "GRANTED": 294915,
    "DENIED": int(Code.DENIED),
    "NO SUCH REQUEST": int(Code.NO_SUCH_REQUEST),
}
"""The states of a request for the privilege (3HAC050973, "Poll for RMMP grant status")."""

_POLL_LIFE = 10.0
"""A request for the privilege ends when its client does not poll for this long [s]."""

PENDANT_TIME = 1.0
"""The operator at the FlexPendant, whom this controller does not have, grants a request after this time [s]."""

_MASTERSHIP_GRANT = Grant.RAPID_DEBUG
"""What a client is granted that takes a mastership."""

_RESTART_GRANTS = {"restart": Grant.REMOTE_WARMSTART, "shutdown": Grant.REMOTE_WARMSTART, "bstart": Grant.RESTORE}
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


class Users:
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
        return resource("ROBAPI2 User", _USERS_BASE, "grants", *(State("user-grant", name, {}) for name in names))

    def check(self, operation: Operation, controller: Irc5, call: Call) -> None:
        """Refuse an operation that the user is not granted.

        Raises:
            Failure: 403.
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
            "ROBAPI2 User", _USERS_BASE, "rmmp", State("user-rmmp", "state", fields, (Link("poll", "rmmp/poll"),))
        )

    def ask(self, controller: Irc5, call: Call) -> HttpReply:
        held = self._request
        if held is not None and held.session != call.session:
            raise Failure(403, Code.RESOURCE_HELD, "another client has asked for the privilege or holds it")
        self._request = _PrivilegeRequest(call.session, call.required("privilege"), self._now, self._now)
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
        held, status = self._request, "NO SUCH REQUEST"
        if held is not None and held.session == call.session:
            held.polled_at, status = self._now, held.status
        state = State("user-rmmp-poll", "poll", {"code": str(_POLL_CODES[status]), "status": status})
        return resource("ROBAPI2 User", _USERS_BASE, "rmmp/poll", state)


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
            Operation("POST", "/rw/mastership", self.request_all, "request", needs_grant=_MASTERSHIP_GRANT),
            Operation("POST", "/rw/mastership", self.release_all, "release"),
            Operation("GET", path, self.get_domain),
            Operation("POST", path, self.request, "request", needs_grant=_MASTERSHIP_GRANT),
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
        return resource(
            "MasterShip", _MASTERSHIP_BASE, "", *(entry("msh-resource-li", domain) for domain in self.names)
        )

    def get_domain(self, controller: Irc5, call: Call) -> Page:
        domain = self._domain(call)
        is_own = self._holders.get(domain) == call.session
        fields = {**self.fields(domain), "mastershipheldbyme": "TRUE" if is_own else "FALSE"}
        return resource("MasterShip", _MASTERSHIP_BASE, domain, State("msh-resource", domain, fields))

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
        self._users.check_grant(_MASTERSHIP_GRANT)
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
