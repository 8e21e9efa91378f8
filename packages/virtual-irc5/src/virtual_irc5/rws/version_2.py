"""Robot Web Services 2.0, of RobotWare 7, as a translation of 1.0: operations, and media types (XHTML, HAL, forms).

A line below gives method and path of 2.0 and, where they differ, path, action and resource of the operation of 1.0 that
answers. Behaviour, permitted values, status and bodies are those of that operation. What differs for all operations
together is here too: the login (Basic instead of digest), the media types, HAL, the domains of mastership and the
names of subscriptions.
"""

from __future__ import annotations

import re
from base64 import b64decode
from binascii import Error as Base64Error
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from hmac import compare_digest
from typing import Any
from urllib.parse import quote, unquote, urljoin

from abb_protocols.rws.documents import (
    FORM_TYPE,
    Form,
    Page,
    Pairs,
    RwsLink,
    RwsState,
    Status,
    decode_form,
    encode_form,
    first_value,
)
from abb_protocols.rws.operations.operation import Operation, Values
from abb_protocols.rws.operations.rapid import LOAD_MODULE
from abb_protocols.rws.values import REALM, RwsCode
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rws.files import path_of_file
from virtual_irc5.rws.http import HttpReply, HttpRequest, HttpSession
from virtual_irc5.rws.mastership import Domains
from virtual_irc5.rws.render import page_at, write_hal, write_hal_status, write_page, write_status
from virtual_irc5.rws.router import Route, Router
from virtual_irc5.rws.rws_call import CallFailure, RwsCall, Shown
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.rws.subscriptions import SubscriptionRules

XHTML_2 = "application/xhtml+xml;v=2.0"
HAL_2 = "application/hal+json;v=2.0"
FORM_2 = f"{FORM_TYPE};v=2.0"
_FILES = ("text/plain;v=2.0", "application/octet-stream;v=2.0")
"""What a body may be that is a file."""

_PROTOCOL = "rws_subscription"
_DOMAINS: Domains = {"cfg": "edit", "rapid": "edit", "motion": "motion"}
ROBOTWARE_7 = "7.13.0"
"""Of the controller that answers so."""

_MAX_GROUPS = 10

# METHOD path-of-2.0 [path-of-1.0?action=…&resource=…&parameter=value] [name=value | name-of-1.0<name-of-2.0 …]
# A "!" behind the method: 2.0 needs the mastership where 1.0 asks only that no other client has it. What stands in
# braces and is not in the path of 2.0 comes from the body. Of paths that begin alike, the longer one comes first.
_TABLE = """
GET /
GET /logout
GET /progress
GET /progress/{job}
GET /rw
GET /rw/retcode
GET /rw/system
GET /rw/system/energy
GET /rw/system/license
GET /rw/system/options
GET /rw/system/products
GET /rw/system/robottype
POST /rw/system/energy/reset /rw/system/energy?action=reset
GET /ctrl/backup
GET /ctrl/backup/state /ctrl/backup?action=backupstate
POST /ctrl/backup/check-restore GET:/ctrl/backup?action=check-restore&backup={backup}
POST /ctrl/backup/create /ctrl/backup?action=backup
POST /ctrl/backup/restore /ctrl/backup?action=restore
GET /ctrl/clock
PUT /ctrl/clock
GET /ctrl/compatibility/{version}
POST /ctrl/compress /ctrl/compress?action=comp
POST /ctrl/decompress /ctrl/compress?action=dcomp
GET /ctrl/diagnostics
GET /ctrl/identity
POST /ctrl/lang /ctrl?action=set-lang
GET /ctrl/options
GET /ctrl/features /ctrl/options
POST! /ctrl/restart /rw/panel?action=restart
GET /rw/panel
GET /rw/panel/coldetstate
GET /rw/panel/ctrl-state /rw/panel/ctrlstate
POST /rw/panel/ctrl-state /rw/panel/ctrlstate?action=setctrlstate
POST /rw/panel/lang /rw/panel?action=setlang
GET /rw/panel/opmode
POST /rw/panel/opmode
POST /rw/panel/opmode/acknowledge /rw/panel/opmode?action=acknowledge
POST /rw/panel/opmode/lock /rw/panel/opmode?action=lock
GET /rw/panel/opmode/lock-state /rw/panel/opmode?resource=lock-state
POST /rw/panel/opmode/unlock /rw/panel/opmode?action=unlock
GET /rw/panel/speedratio
POST /rw/panel/speedratio?action=setspeedratio /rw/panel/speedratio?action=setspeedratio
GET /rw/rapid
GET /rw/rapid/aliasio
GET /rw/rapid/execution
POST /rw/rapid/execution/cycle /rw/rapid/execution?action=setcycle
POST /rw/rapid/execution/holdtorun /rw/rapid/execution?action=holdtorun-state
POST! /rw/rapid/execution/resetpp /rw/rapid/execution?action=resetpp
POST /rw/rapid/execution/start /rw/rapid/execution?action=start
POST! /rw/rapid/execution/startprodentry /rw/rapid/execution?action=startprodentry
POST /rw/rapid/execution/stop /rw/rapid/execution?action=stop
POST /rw/rapid/symbols/search /rw/rapid/symbols?action=search-symbols
POST /rw/rapid/symbol/RAPID/{task}/data?action=validate
    /rw/rapid/symbol/data?action=validate task={task} datatype<dattyp
GET /rw/rapid/symbol/RAPID/{symbol}/data /rw/rapid/symbol/data/RAPID/{symbol}
POST! /rw/rapid/symbol/RAPID/{symbol}/data /rw/rapid/symbol/data/RAPID/{symbol}?action=set
GET /rw/rapid/symbol/RAPID/{symbol}/properties /rw/rapid/symbol/properties/RAPID/{symbol}
GET /rw/rapid/tasks
POST! /rw/rapid/tasks/activate /rw/rapid/tasks/{task}?action=activate
POST! /rw/rapid/tasks/deactivate /rw/rapid/tasks/{task}?action=deactivate
GET /rw/rapid/tasks/spy /rw/rapid/tasks?resource=spy-status
GET /rw/rapid/tasks/syncstate/motion-pointer /rw/rapid/tasks?resource=sync-state&type=motion-pointer
GET /rw/rapid/tasks/syncstate/program-pointer /rw/rapid/tasks?resource=sync-state&type=program-pointer
GET /rw/rapid/tasks/{task}
GET /rw/rapid/tasks/{task}/activation-record
POST! /rw/rapid/tasks/{task}/activate /rw/rapid/tasks/{task}?action=activate
POST! /rw/rapid/tasks/{task}/deactivate /rw/rapid/tasks/{task}?action=deactivate
POST /rw/rapid/tasks/{task}/loadmod /rw/rapid/tasks/{task}?action=loadmod
POST /rw/rapid/tasks/{task}/unloadmod /rw/rapid/tasks/{task}?action=unloadmod
GET /rw/rapid/tasks/{task}/modules /rw/rapid/modules?task={task}
GET /rw/rapid/tasks/{task}/modules/{module} /rw/rapid/modules/{module}?task={task}
GET /rw/rapid/tasks/{task}/modules/{module}/changecount /rw/rapid/modules/{module}?resource=change-count&task={task}
POST /rw/rapid/tasks/{task}/modules/{module}/modify-position
    /rw/rapid/modules/{module}?action=modify-position&task={task}
GET /rw/rapid/tasks/{task}/modules/{module}/module-extension
    /rw/rapid/modules/{module}?resource=module-extension&task={task}
POST /rw/rapid/tasks/{task}/modules/{module}/save /rw/rapid/modules/{module}?action=save&task={task}
GET /rw/rapid/tasks/{task}/modules/{module}/sync-pers /rw/rapid/modules/{module}?resource=syncper-status&task={task}
GET /rw/rapid/tasks/{task}/modules/{module}/text /rw/rapid/modules/{module}?resource=module-text&task={task}
POST /rw/rapid/tasks/{task}/modules/{module}/text /rw/rapid/modules/{module}?action=set-module-text&task={task}
GET /rw/rapid/tasks/{task}/modules/{module}/text/range /rw/rapid/modules/{module}?task={task}
POST /rw/rapid/tasks/{task}/modules/{module}/text/range /rw/rapid/modules/{module}?action=set-text-range task={task}
GET /rw/rapid/tasks/{task}/modules/{module}/text/search /rw/rapid/modules/{module}?task={task}
GET /rw/rapid/tasks/{task}/motion
GET /rw/rapid/tasks/{task}/pcp
POST /rw/rapid/tasks/{task}/pcp/next-inst /rw/rapid/tasks/{task}/pcp?action=set-pp-next-inst
POST /rw/rapid/tasks/{task}/pcp/prev-inst /rw/rapid/tasks/{task}/pcp?action=set-pp-prev-inst
POST /rw/rapid/tasks/{task}/pcp/routine /rw/rapid/tasks/{task}/pcp?action=set-pp-routine
POST /rw/rapid/tasks/{task}/pcp/routine-from-url
    /rw/rapid/tasks/{task}/pcp?action=set-pp-routine-from-url routine<routineurl
GET /rw/rapid/tasks/{task}/program
GET /rw/rapid/tasks/{task}/program/breakpoints /rw/rapid/tasks/{task}/program/breakpoint
POST /rw/rapid/tasks/{task}/program/breakpoints /rw/rapid/tasks/{task}/program/breakpoint?action=set
POST /rw/rapid/tasks/{task}/program/load /rw/rapid/tasks/{task}/program?action=loadprog
POST /rw/rapid/tasks/{task}/program/save /rw/rapid/tasks/{task}/program?action=save
GET /rw/rapid/tasks/{task}/serviceroutine
GET /rw/rapid/tasks/{task}/structural-changecount
GET /rw/rapid/tasks/{task}/syncstate/motion-pointer
    /rw/rapid/tasks/{task}?resource=task-sync-state&type=motion-pointer
GET /rw/rapid/taskselection
GET /rw/rapid/uiinstr
GET /rw/rapid/uiinstr/active
POST /rw/rapid/uiinstr/active/param/{stack} /rw/rapid/uiinstr/active/param/{stack}?action=set
GET /rw/iosystem
GET /rw/iosystem/devices
POST /rw/iosystem/devices?action=search /rw/iosystem/devices?action=search
GET /rw/iosystem/devices/{device}/config /rw/iosystem/devices/{device}?resource=config
POST /rw/iosystem/devices/{device}/set-lstate /rw/iosystem/devices/{device}?action=set
GET /rw/iosystem/devices/{device}
GET /rw/iosystem/networks
GET /rw/iosystem/networks/{network}
GET /rw/iosystem/networks/{network}/config /rw/iosystem/networks/{network}?resource=config
POST /rw/iosystem/networks/{network}/set-lstate /rw/iosystem/networks/{network}?action=set
GET /rw/iosystem/signals
POST /rw/iosystem/signals/signal-search /rw/iosystem/signals?action=signal-search
POST /rw/iosystem/signals/signal-search-ex /rw/iosystem/signals?action=signal-searchex
POST /rw/iosystem/signals/unblock-signal /rw/iosystem/signals?action=unblock-signal
GET /rw/iosystem/signals/{signal}/config /rw/iosystem/signals/{signal}?resource=config
POST /rw/iosystem/signals/{signal}/set-lstate /rw/iosystem/signals/{signal}?action=set
POST /rw/iosystem/signals/{signal}/set-value /rw/iosystem/signals/{signal}?action=set
GET /rw/iosystem/signals/{signal}
GET /rw/motionsystem
GET /rw/motionsystem/checkchangecount/{changecount} /rw/motionsystem/checkchangecount?changecount={changecount}
GET /rw/motionsystem/collisionprediction /rw/motionsystem/motionsupervision?action=collision-prediction-mode
POST /rw/motionsystem/collisionprediction /rw/motionsystem/motionsupervision?action=set-colpred-mode
GET /rw/motionsystem/errorstate
GET /rw/motionsystem/nonmotionexecution
POST /rw/motionsystem/nonmotionexecution /rw/motionsystem/nonmotionexecution?action=set
GET /rw/motionsystem/mechunits
GET /rw/motionsystem/mechunits/{unit}
POST /rw/motionsystem/mechunits/{unit} /rw/motionsystem/mechunits/{unit}?action=set
POST /rw/motionsystem/mechunits/{unit}?action=CalcRobTFromJoints
    /rw/motionsystem/mechunits/{unit}?action=CalcRobTFromJoints
GET /rw/motionsystem/mechunits/{unit}/axes
GET /rw/motionsystem/mechunits/{unit}/axes/{axis}
GET /rw/motionsystem/mechunits/{unit}/axes/{axis}/pose
    /rw/motionsystem/mechunits/{unit}/axes/{axis}?resource=axis-pose
GET /rw/motionsystem/mechunits/{unit}/baseframe
POST /rw/motionsystem/mechunits/{unit}/baseframe /rw/motionsystem/mechunits/{unit}/baseframe?action=set
GET /rw/motionsystem/mechunits/{unit}/cartesian
POST /rw/motionsystem/mechunits/{unit}/joints-from-cartesian
    /rw/motionsystem/mechunits/{unit}?action=JointsFromCartesian
GET /rw/motionsystem/mechunits/{unit}/jointtarget
GET /rw/motionsystem/mechunits/{unit}/lead-through /rw/motionsystem/mechunits/{unit}?resource=lead-through
POST /rw/motionsystem/mechunits/{unit}/lead-through /rw/motionsystem/mechunits/{unit}?action=set-lead-through
GET /rw/motionsystem/mechunits/{unit}/motionsupervision /rw/motionsystem/motionsupervision?mechunit={unit}
POST /rw/motionsystem/mechunits/{unit}/motionsupervision/level
    /rw/motionsystem/motionsupervision?action=set-level mechunit-name={unit}
POST /rw/motionsystem/mechunits/{unit}/motionsupervision/mode
    /rw/motionsystem/motionsupervision?action=set-mode mechunit-name={unit}
GET /rw/motionsystem/mechunits/{unit}/pathsupervision /rw/motionsystem/pathsupervision?mechunit={unit}
POST /rw/motionsystem/mechunits/{unit}/pathsupervision/mode
    /rw/motionsystem/pathsupervision?action=set-mode mechunit={unit}
GET /rw/motionsystem/mechunits/{unit}/pjoints
POST /rw/motionsystem/mechunits/{unit}/pose-from-joints /rw/motionsystem/mechunits/{unit}?action=CalcPoseFromJoints
POST /rw/motionsystem/mechunits/{unit}/position /rw/motionsystem/mechunits/{unit}?action=mechunit-position
GET /rw/motionsystem/mechunits/{unit}/robtarget
GET /rw/cfg
POST /rw/cfg/load /rw/cfg?action=load
POST /rw/cfg/validate-instances /rw/cfg?action=validate-instances
GET /rw/cfg/{domain}
POST /rw/cfg/{domain}/saveas /rw/cfg/{domain}?action=saveas
GET /rw/cfg/{domain}/{type}/attributes
GET /rw/cfg/{domain}/{type}/instances
POST /rw/cfg/{domain}/{type}/instances/create-default /rw/cfg/{domain}/{type}/instances?action=create-default
GET /rw/cfg/{domain}/{type}/instances/{instance}
POST /rw/cfg/{domain}/{type}/instances/{instance} /rw/cfg/{domain}/{type}/instances/{instance}?action=set
DELETE /rw/cfg/{domain}/{type}/instances/{instance}
GET /rw/elog
POST /rw/elog/clearall /rw/elog?action=clearall
POST /rw/elog/saveraw /rw/elog?action=saveraw
GET /rw/elog/seqnum/{number} /rw/elog/{domain}/{number} domain=0
GET /rw/elog/{domain}
POST /rw/elog/{domain}/clear /rw/elog/{domain}?action=clear
GET /rw/elog/{domain}/{number}
GET /rw/dipc
POST /rw/dipc /rw/dipc?action=dipc-create
GET /rw/dipc/{queue}/information /rw/dipc/{queue}
GET /rw/dipc/{queue} /rw/dipc/{queue}?action=dipc-read
POST /rw/dipc/{queue} /rw/dipc/{queue}?action=dipc-send
DELETE /rw/dipc/{queue}
GET /fileservice
POST /fileservice/{path}/copy /fileservice/{path} fs-action=copy
POST /fileservice/{path}/create /fileservice/{path} fs-action=create
POST /fileservice/{path}/rename /fileservice/{path} fs-action=rename
GET /fileservice/{path}
HEAD /fileservice/{path}
PUT /fileservice/{path}
DELETE /fileservice/{path}
GET /rw/mastership
POST /rw/mastership/request /rw/mastership?action=request
POST /rw/mastership/release /rw/mastership?action=release
GET /rw/mastership/{domain}
POST /rw/mastership/{domain}/request /rw/mastership/{domain}?action=request
POST /rw/mastership/{domain}/release /rw/mastership/{domain}?action=release
GET /users/rmmp
POST /users/rmmp
POST /users/rmmp/cancel /users/rmmp?action=cancel
GET /users/rmmp/poll
POST /users/register /users
POST /users/impersonate /users?action=impersonate
POST /subscription
GET /subscription/{group}
PUT /subscription/{group}
DELETE /subscription/{group}
DELETE /subscription/{group}/{resource}
"""

_PLACE = re.compile(r"\{(\w+)(:[^{}]*)?\}")

# Where one operation of 1.0 names or permits something else.
_QUERY_NAMES = {"dipc-timeout": "timeout"}
_VALUES: Mapping[tuple[str, str], str] = {("opmode", "manf"): "manfs"}
_QUERIES: Mapping[str, Values] = {
    "GET /rw/rapid/symbol/RAPID/{symbol}/data": {"value": ("1",)},
    "GET /rw/dipc/{queue}": {"dipc-timeout": ()},
}
_CFG_VALUE = re.compile(r"^\[(.*),\d+\]$")  # a value with the number of its instance in a list
_STATUS = {"/rw/rapid/tasks/{task}/loadmod": 200, "/fileservice/{path}/create": 201}
_TYPES = {
    "sys-system-li": "sys-system",
    "sys-option-li": "sys-option",
    "cfg-ia-t-li": "cfg-ia-t",
    "fs-device": "fs-dir",
}
_WITHOUT_LINKS = ("rap-module-info-li",)
_TITLES = {("pnl-ctrlstate", "ctrlstate"): "ctrl-state"}
_FIELDS = {"ms-mechunit-cartesian": {"j1": "cf1", "j4": "cf4", "j6": "cf6", "jx": "cfx"}}


@dataclass(frozen=True, slots=True)
class Translation:
    """One operation of 2.0.

    Attributes:
        operation: by its path and action of 2.0; it is answered as ``rws1`` is.
        rws1: the route of the operation of 1.0.
        query: parameters in the URL of 1.0, beside those of the request; ``{name}`` stands for a part of the path, or a
            parameter of the body that is none in 1.0.
        form: parameters in its body, likewise.
        names: names of parameters in the body of 1.0, by those of 2.0.
    """

    operation: Operation[Any]
    rws1: Route
    query: Pairs
    form: Pairs
    names: Mapping[str, str]

    @property
    def route(self) -> Route:
        """What the router finds."""
        return Route(self.operation, self._answer, self._prepare if self.rws1.prepare else None)

    def _answer(self, controller: Irc5, call: RwsCall) -> Shown:
        rws1_call = self.rws1_call(call)
        answer = self.rws1.answer(controller, rws1_call)
        if self.rws1.operation is LOAD_MODULE:  # which shows what it has loaded
            text = controller.files[path_of_file(rws1_call.required("modulepath"))]
            name = next(iter(re.findall(r"^\s*MODULE\s+(\w+)", text, re.MULTILINE | re.IGNORECASE)), "")
            return page_at("rapid", "/rw/rapid/", "tasks", RwsState("rap-task-module-li", name, {"name": name}))
        return answer

    def _prepare(self, controller: Irc5, call: RwsCall) -> Callable[[], object] | None:
        assert self.rws1.prepare is not None
        return self.rws1.prepare(controller, self.rws1_call(call))

    def rws1_call(self, call: RwsCall) -> RwsCall:
        """The call of 1.0 that a call of 2.0 stands for.

        Raises:
            CallFailure: 400, the body lacks what 1.0 has in the path.
        """
        templates = (self.rws1.operation.path, *(text for _, text in (*self.query, *self.form)))
        missing = {match[1] for text in templates for match in _PLACE.finditer(text)} - set(call.names)
        fixed = {name: text for name, text in self.form if name in missing}
        names = {**call.names, **fixed, **{name: call.required(name) for name in missing - set(fixed)}}
        query = [(_QUERY_NAMES.get(name, name), text) for name, text in call.query]
        kept = [pair for pair in query if pair[0] not in ("action", "mastership", "json")]
        form = [
            (self.names.get(name, name), _VALUES.get((name, text), text))
            for name, text in call.form
            if name not in missing
        ]
        if self.rws1.operation.path.startswith("/rw/cfg/"):
            form = [(name, _CFG_VALUE.sub(r"\1", text)) for name, text in form]
        return replace(
            call,
            method=self.rws1.operation.method,
            path=tuple(part for part in _filled(self.rws1.operation.path, names).split("/") if part),
            query=(*((name, _filled(text, names)) for name, text in self.query), *kept),
            form=(*((name, _filled(text, names)) for name, text in self.form), *form),
            names=names,
        )

    def rws2_target(self, places: Mapping[str, str], query: Pairs) -> str | None:
        """Path and query of 2.0 for those of 1.0, whose placeholders have values; None where it lacks one of them."""
        names = dict(places)
        rest = []
        for name, text in query:
            place = _PLACE.fullmatch(dict(self.query).get(name, ""))
            if place:
                names[place[1]] = text
            elif name not in dict(self.query):
                rest.append((name, text))
        if set(_names(self.operation.path)) - set(names):
            return None
        path = quote(_filled(self.operation.path, names), safe="/$:;")
        return f"{path}?{encode_form(rest)}" if rest else path


def _filled(template: str, names: Mapping[str, str]) -> str:
    return _PLACE.sub(lambda match: names[match[1]], template)


def _translations(routes: Sequence[Route]) -> tuple[Translation, ...]:
    """The operations of 2.0, in order, of those of 1.0."""
    known = {
        (own.method, _plain(own.path), own.action, own.resource): each for each in routes for own in [each.operation]
    }
    lines = re.sub(r"\n +", " ", _TABLE.strip()).splitlines()
    return tuple(_translation(line, known) for line in lines)


def _translation(line: str, known: Mapping[tuple[str, str, str | None, str | None], Route]) -> Translation:
    mark, target, *rest = line.split()
    method, path, own = mark.rstrip("!"), *target.partition("?")[::2]
    other, *body = rest or [path]
    first_method, colon, first_target = other.partition(":/")
    first_path, _, first_query = (f"/{first_target}" if colon else other).partition("?")
    query = decode_form(first_query)
    key = (first_method if colon else method, first_path, first_value(query, "action"), first_value(query, "resource"))
    route = known[key]
    rws1 = route.operation
    form = tuple((name, text) for name, sign, text in (each.partition("=") for each in body) if sign)
    names = {rws2: name for name, sign, rws2 in (each.partition("<") for each in body) if sign}
    spelled = {name: rws2 for rws2, name in names.items()}
    values = {
        spelled.get(name, name): tuple(_rws2_value(name, text) for text in allowed)
        for name, allowed in rws1.values.items()
        if name not in dict(form)
    }
    from_body = {match[1] for _, text in query for match in _PLACE.finditer(text)} | set(_names(rws1.path))
    values |= dict.fromkeys(sorted(from_body - set(_names(path)) - set(dict(form))), ())
    without_moved = {name: each for name, each in rws1.query.items() if name not in dict(query)}
    patterns = {match[1]: match[0] for match in _PLACE.finditer(rws1.path)}
    needed = (rws1.needs_mastership or rws1.respects_mastership or "rapid") if mark.endswith("!") else ""
    operation = replace(
        rws1,
        method=method,
        path=_PLACE.sub(lambda match: patterns.get(match[1], match[0]), path),
        action=first_value(decode_form(own), "action"),
        resource=None,
        values=values,
        query={**without_moved, **_QUERIES.get(f"{method} {path}", {})},
        status=_STATUS.get(path, rws1.success),
        needs_mastership=needed or rws1.needs_mastership,
        respects_mastership="" if needed else rws1.respects_mastership,
    )
    return Translation(operation, route, query, form, names)


def _plain(path: str) -> str:
    """A path whose placeholders have their names alone."""
    return _PLACE.sub(r"{\1}", path)


def _names(path: str) -> list[str]:
    return [match[1] for match in _PLACE.finditer(path)]


def _rws2_value(name: str, text: str) -> str:
    return next((rws2 for (known, rws2), rws1 in _VALUES.items() if (known, rws1) == (name, text)), text)


# Subscriptions


def _rws1_resource(path: str) -> str:
    """The path of 1.0 of a resource that a client of 2.0 subscribes to; "" for one that only 1.0 has."""
    if re.match(r"/rw/panel/ctrlstate\b|/rw/rapid/symbol/data/", path):
        return ""
    path = re.sub(r"^/rw/panel/ctrl-state\b", "/rw/panel/ctrlstate", path)
    return re.sub(r"^/rw/rapid/symbol/RAPID/(.+)/data;value$", r"/rw/rapid/symbol/data/RAPID/\1;value", path)


_RULES = SubscriptionRules(
    protocol=_PROTOCOL,
    is_secure=True,
    max_groups=_MAX_GROUPS,
    rws1_resource=_rws1_resource,
    is_adding=True,
    outlives_connection=False,
)


class RwsService2(RwsService):
    """Answers requests as a controller with RobotWare 7 does; see :class:`RwsService`."""

    scheme = "https"
    default_port = 443
    domains = _DOMAINS
    rules = _RULES

    def _build_router(self) -> Router:
        self._rws1_router = Router(self.routes)
        self.translations = _translations(self.routes)
        self._by_rws1 = {id(each.rws1): each for each in reversed(self.translations)}
        self.routes = tuple(each.route for each in self.translations)
        return Router(self.routes)

    # Logging in

    def _proven_age(self, request: HttpRequest, now: float) -> float | None:
        scheme, _, proof = (request.header("Authorization") or "").partition(" ")
        try:
            user, _, password = b64decode(proof.strip(), validate=True).partition(b":")
        except (Base64Error, ValueError):
            return None
        is_user = compare_digest(user, self._user.encode())
        is_password = compare_digest(password, self._password.encode())
        return 0.0 if scheme.lower() == "basic" and is_user and is_password else None

    def _challenge(self, now: float, *, is_stale: bool) -> str:
        return f'Basic realm="{REALM}"'

    # Representations

    def _form(self, request: HttpRequest) -> Form:
        form = _preferred_form(request.header_values("Accept"))
        if form is not None:
            return form
        if request.path[:1] == ("fileservice",) and request.method in ("GET", "HEAD"):
            return Form.XHTML  # the content of a file is what it is
        raise CallFailure(
            406,
            RwsCode.FAIL,
            f"Server cannot generate response for given accept header; it makes {XHTML_2} and {HAL_2}",
        )

    def _pairs(self, request: HttpRequest) -> Pairs:
        kind = _media_type(request.header("Content-Type") or "")
        is_file = request.method == "PUT" and request.path[:1] == ("fileservice",)
        allowed = _FILES if is_file else (FORM_2,)
        if (request.body or (kind and request.method in ("POST", "PUT"))) and kind not in allowed:
            raise CallFailure(415, RwsCode.INVALIDARG, f"a body is {' or '.join(allowed)}, not {kind or 'of no type'}")
        return () if is_file else request.form()

    def _wants_forms(self, request: HttpRequest) -> bool:
        return request.method == "OPTIONS"

    def _check_mastership(self, operation: Operation[Any], call: RwsCall) -> None:
        is_implicit = call.option("mastership") == "implicit"
        self._mastership.check(operation, self._controller, call, is_implicit=is_implicit)

    def _operate(self, request: HttpRequest, form: Form, session: HttpSession) -> HttpReply:
        reply = super()._operate(request, form, session)
        headers = tuple((name, XHTML_2 if text == Form.XHTML.value else text) for name, text in reply.headers)
        return replace(reply, headers=headers)

    def _content_type(self, form: Form) -> str:
        return HAL_2 if form is Form.JSON else XHTML_2

    def _page(self, page: Page, form: Form, host: str) -> bytes:
        links = self._rws2_links([link for link in page.links if link.rel != "action"], page.base)
        states = tuple(self._rws2_state(state, page.base) for state in page.states)
        rws2 = Page(page.title, f"{self.scheme}://{host}{page.base}", states, links)
        return write_hal(rws2) if form is Form.JSON else write_page(rws2, form)

    def _status(self, status: Status, form: Form, host: str, title: str) -> bytes:
        base = f"{self.scheme}://{host}/"
        if form is Form.JSON:
            return write_hal_status(status, base)
        return write_status(status, form, base=base, title=title)

    def _rws2_state(self, state: RwsState, base: str) -> RwsState:
        names = _FIELDS.get(state.type, {})
        return replace(
            state,
            type=_TYPES.get(state.type, state.type),
            title=_TITLES.get((state.type, state.title), state.title),
            fields={names.get(name, name): text for name, text in state.fields.items()},
            links=() if state.type in _WITHOUT_LINKS else self._rws2_links(state.links, base),
            children=tuple(self._rws2_state(child, base) for child in state.children),
        )

    def _rws2_links(self, links: Sequence[RwsLink], base: str) -> tuple[RwsLink, ...]:
        """Links of 1.0 as 2.0 has them, without those to what it does not have."""
        found = []
        for link in links:
            path, _, query = urljoin(base, link.href).partition("?")
            segments = tuple(unquote(part) for part in path.split("/") if part)
            try:
                rws1, names = self._rws1_router.find("GET", segments, decode_form(query))
            except CallFailure:
                continue
            translation = self._by_rws1.get(id(rws1))
            target = translation.rws2_target(names, decode_form(query)) if translation is not None else None
            if translation is None or target is None:
                continue
            is_same = _plain(translation.operation.path) == _plain(rws1.operation.path)
            found.append(link if is_same else RwsLink(link.rel, target))
        return tuple(found)


_FORMS = {XHTML_2: Form.XHTML, HAL_2: Form.JSON}
"""The representations by media type; the first is for a client that likes all of them alike."""


def _preferred_form(accepted: Sequence[str]) -> Form | None:
    """The representation that the values of ``Accept`` prefer; None where they permit none.

    A media type needs its version; a range such as ``*/*`` or ``application/*`` does not. What fits a representation
    best has its quality (RFC 9110, section 12.5.1). Of equal quality, a media type comes before a range, and what
    stands first before what follows.
    """
    ranges = [text for line in accepted for text in line.split(",") if text.strip()] or ["*/*"]
    found: list[tuple[float, int, int, Form]] = []
    for media_type, form in _FORMS.items():
        fitting = [(fit, -place, text) for place, text in enumerate(ranges) if (fit := _fit(text, media_type))]
        if fitting:
            fit, place, text = max(fitting)
            found.append((_quality(text), fit, place, form))
    permitted = [each for each in found if each[0] > 0.0]
    return max(permitted, key=lambda each: each[:3])[3] if permitted else None


def _fit(text: str, media_type: str) -> int:
    """How closely a range of ``Accept`` describes a media type; 0 where it does not."""
    kind, _, version = _media_type(text).partition(";")
    known, _, known_version = media_type.partition(";")
    if kind == known:
        return 3 if version == known_version else 0
    if version not in ("", known_version):
        return 0
    return {"application/*": 2, "*/*": 1, "*": 1}.get(kind, 0)  # the last is what Java's own client sends


def _quality(text: str) -> float:
    """How much a client likes a range of ``Accept``: from 0, not at all, to 1, which is also for what is no number."""
    weights = (part.partition("=")[2] for part in text.lower().split(";") if part.strip().startswith("q="))
    try:
        weight = float(next(weights, "1"))
    except ValueError:
        return 1.0
    return weight if 0.0 <= weight <= 1.0 else 1.0


def _media_type(text: str) -> str:
    """A media type with its version alone: ``application/hal+json;v=2.0``."""
    kind, *parameters = (part.strip().lower().replace('"', "") for part in text.split(";"))
    version = next((each for each in parameters if each.startswith("v=")), "")
    return f"{kind};{'v=2.0' if version == 'v=2' else version}" if version else kind
