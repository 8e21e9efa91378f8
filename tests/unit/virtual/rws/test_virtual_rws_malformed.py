"""Requests that are wrong in every way the table allows: only documented statuses come back, and the server goes on."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import islice

import pytest

from abb_protocols.rws.documents import encode_form, read_status
from abb_protocols.rws.operations.operation import Operation
from rws_examples import Session
from rws_examples_2 import Session2
from soak import long, short
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.version_2 import XHTML_2

DOCUMENTED = {200, 201, 202, 204, 400, 401, 403, 404, 405, 409, 415, 500, 503, 507}
NUMBERS = ("-1", "nan", "1e999", "9" * 400, "0x10", "1;DROP", "\u0661")
TEXTS = ("", "\x00", "\ufffd\U0001f600", "../../x", "%", "a" * 5000, "[[[", '"', "$HOME/../x")
SEGMENTS = ("nothing", "..%2f..", "%00", "%ff", "a" * 300, "-1", "{}")
FAULT = "a fault of the virtual controller"


@pytest.fixture(scope="module", params=[Session, Session2], ids=["1.0", "2.0"])
def session(request: pytest.FixtureRequest) -> Session:
    kind: type[Session] = request.param
    return kind()


def target_of(operation: Operation, segment: str) -> str:
    path = re.sub(r"\{[^{}]*(\{[^{}]*\})?[^{}]*\}", lambda _: segment, operation.path)
    options = [(name, text) for name in ("action", "resource") if (text := getattr(operation, name))]
    return path + ("?" + encode_form(options) if options else "")


def known(operation: Operation) -> str:
    """The operation's path with names that this controller has."""
    names = {"task": "T_ROB_L", "module": "TRobMain", "unit": "ROB_L", "domain": "SIO", "type": "COM_TRP", "axis": "1",
             "instance": "ROB_L", "signal": "EGM_STOP", "name": "EGM_STOP", "network": "Virtual1", "device": "x",
             "path": "$HOME/nothing", "symbol": "RAPID/T_ROB_L/TRobMain/current_state"}  # fmt: skip
    return re.sub(r"\{(\w+)[^{}]*(\{[^{}]*\})?[^{}]*\}", lambda found: names.get(found[1], "1"), operation.path)


def malformed(operation: Operation) -> Iterator[tuple[str, str]]:
    """Targets and bodies."""
    options = [(name, text) for name in ("action", "resource") if (text := getattr(operation, name))]
    right = [(name, allowed[0] if allowed else "1") for name, allowed in operation.values.items()]
    if "{" in operation.path:
        for segment in SEGMENTS:
            yield target_of(operation, segment), encode_form(right)
    path = known(operation)
    for number, (name, _) in enumerate(right):
        for text in (*NUMBERS, *TEXTS):
            pairs = [*right[:number], (name, text), *right[number + 1 :]]
            yield f"{path}?{encode_form(options)}", encode_form(pairs)
        yield f"{path}?{encode_form(options)}", encode_form([*right[:number], *right[number + 1 :]])
        yield f"{path}?{encode_form(options)}", encode_form([*right, (name, "twice")])
    for name in operation.query:
        for text in (*NUMBERS, *TEXTS):
            yield f"{path}?{encode_form([*options, (name, text)])}", encode_form(right)
    yield f"{path}?{encode_form([('action', 'fly')])}", encode_form(right)
    yield f"{path}?{encode_form([*options, ('resource', 'fly')])}", encode_form(right)
    yield f"{path}?&&=&%&json=2", "&&=&%zz"


def raw(session: Session, method: str, target: str, content_type: str, body: bytes) -> HttpReply:
    headers = (session.cookie, ("Host", "memory"), ("Accept", XHTML_2), ("Content-Type", content_type))
    return session._handled(HttpRequest(method, target, headers, body, "client"))


def check(reply: HttpReply, request: object) -> None:
    assert reply.status in DOCUMENTED, request
    assert FAULT.encode() not in reply.body, (request, reply.body)
    if reply.status in (400, 403, 404, 405, 409, 415) and reply.body.startswith(b"<?xml"):
        assert read_status("application/xhtml+xml", reply.body).code < 0, request


@pytest.mark.parametrize("every", [short(4), long(1, 120.0)])
def test_malformed_requests_get_documented_statuses(session: Session, every: int) -> None:
    """Each fourth of an operation's, beginning with another one at each operation; all of them with ``make soak``."""
    count = 0
    for operation in session.service.operations:
        session.reset()
        if operation.method == "HEAD" or operation.path in ("/logout",):
            continue
        session.ask("POST", session.request_of_mastership)
        for target, form in islice(malformed(operation), count % every, None, every):
            check(session.ask(operation.method, target, form), (operation.method, target[:200], form[:200]))
            session.controller._restart_left = 0.0
            count += 1
    assert count > 3000 / every


def test_body_of_another_type_is_refused(session: Session) -> None:
    session.reset()
    for operation in session.service.operations:
        if operation.method not in {"POST", "PUT"}:
            continue
        if operation.path.startswith("/fileservice"):
            continue
        reply = raw(session, operation.method, target_of(operation, "x"), "application/json", b"{}")
        assert reply.status == 415, operation.path


def test_other_methods_are_refused(session: Session) -> None:
    session.reset()
    paths = {operation.path: {each.method for each in session.service.operations if each.path == operation.path}
             for operation in session.service.operations}  # fmt: skip
    for path, methods in paths.items():
        if path.startswith(("/fileservice", "/poll")):
            continue
        target = re.sub(r"\{[^{}]*(\{[^{}]*\})?[^{}]*\}", "1", path)
        # Actions of 2.0 have paths that may also be those of a domain or a task of that name.
        others = {"PATCH", "BREW"} if isinstance(session, Session2) else {"GET", "PUT", "DELETE", "PATCH", "BREW"}
        for method in others - methods:
            assert raw(session, method, target, session.form_type, b"").status in (404, 405), (method, target)


@pytest.mark.parametrize(
    "value", ["[" * 60000 + "1" + "]" * 60000, "(" * 120000, "NOT " * 30000, "{" * 100000, '"' * 100001]
)
def test_deeply_nested_value_gets_a_documented_status(session: Session, value: str) -> None:
    datum = "RAPID/T_ROB_L/TRobMain/current_state"
    targets = {
        Session: (f"/rw/rapid/symbol/data/{datum}?action=set", "/rw/rapid/symbol/data?action=validate"),
        Session2: (
            f"/rw/rapid/symbol/{datum}/data?mastership=implicit",
            "/rw/rapid/symbol/RAPID/T_ROB_L/data?action=validate",
        ),
    }[type(session)]
    session.reset()
    for target in targets:
        body = f"value={value}&task=T_ROB_L&datatype=robtarget&dattyp=robtarget".encode()
        reply = raw(session, "POST", target, session.form_type, body)
        check(reply, target)
        assert reply.status == 400


@pytest.mark.parametrize("header", ["Cookie", "Accept", "Host", "Content-Type", "Authorization", "Upgrade"])
@pytest.mark.parametrize(
    "text", ["\udcff=\udcfe", "Basic \udcff", 'Digest username="\udcff", nonce="\udcff", uri="\udcff"']
)
def test_header_that_is_not_text_gets_a_documented_status(session: Session, header: str, text: str) -> None:
    headers = ((header, text), session.cookie)
    reply = session._handled(HttpRequest("GET", "/rw/panel/opmode", headers, b"", "client"))
    assert reply.status in {200, 401, 406}
    assert FAULT.encode() not in reply.body


@pytest.mark.parametrize("action", ["loadmod", "resetpp", "set"])
def test_action_on_no_resource_gets_a_documented_status(session: Session, action: str) -> None:
    check(raw(session, "POST", f"/?action={action}", session.form_type, b"modulepath=HOME/x.mod"), action)
