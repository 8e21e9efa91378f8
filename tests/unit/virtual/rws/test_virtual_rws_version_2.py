"""Robot Web Services 2.0: every operation, in both representations, and what differs from 1.0."""

from __future__ import annotations

import json
import re
from base64 import b64encode
from collections import Counter
from collections.abc import Callable
from urllib.parse import urljoin

import pytest

from abb_protocols.rws.documents import read_page, read_status
from abb_protocols.rws.values import GRANTS, Grant, OperatingMode
from rws_examples import Example, content_type, operation_of
from rws_examples_2 import BASIC, EXAMPLES_2, SIGNALS, SYMBOL, TASK, Session2
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.subscriptions import Upgrade
from virtual_irc5.rws.version_2 import FORM_2, HAL_2, XHTML_2
from virtual_irc5.testing.memory_rws import MemoryChannel

PANEL = "/rw/panel/ctrl-state"
_DRIFT = {"sys-options": "sys-option"}  # a type that has another name in HAL


@pytest.fixture(scope="module")
def session() -> Session2:
    return Session2()


@pytest.fixture
def client(session: Session2) -> Session2:
    """A client that has just logged in, of a controller where nothing runs."""
    session.reset()
    session.prepare("program")
    return session


def in_hal(body: bytes) -> list[tuple[str, str, list[str]]]:
    document = json.loads(body)
    if "msg" in document.get("status", {}):
        return [("status", str(document["status"]["code"]), [])]
    states = [*document.get("state", ()), *document.get("_embedded", {}).get("resources", ())]
    return sorted(
        (
            _DRIFT.get(state["_type"], state["_type"]),
            re.sub(r"/\d+$", "", state["_title"]),
            sorted(name for name, value in state.items() if isinstance(value, str) and name[0] != "_"),
        )
        for state in states
    )


def in_xhtml(reply: HttpReply) -> list[tuple[str, str, list[str]]]:
    if reply.status >= 400:
        return [("status", str(read_status(content_type(reply), reply.body).code), [])]
    page = read_page(content_type(reply), reply.body)
    return sorted((state.type, re.sub(r"/\d+$", "", state.title), sorted(state.fields)) for state in page.states)


@pytest.mark.parametrize("example", EXAMPLES_2, ids=lambda each: f"{each.method} {each.target}")
def test_operation_is_answered_in_both_representations(session: Session2, example: Example) -> None:
    operation = operation_of(session, example)
    xhtml, data = example.send(session), example.send(session, "json")
    expected = (operation.success, operation.success)
    assert (xhtml.status, data.status) == expected, (xhtml.body, data.body)
    if content_type(data) == HAL_2 and data.body:
        assert content_type(xhtml) == XHTML_2
        assert in_xhtml(xhtml) == in_hal(data.body)


def test_every_operation_has_an_example(session: Session2) -> None:
    found = Counter(id(operation_of(session, example)) for example in EXAMPLES_2)
    missing = [each for each in session.service.operations if id(each) not in found]
    assert [(each.method, each.path, each.action) for each in missing] == []


def test_links_lead_to_what_is_there(client: Session2) -> None:
    lost = set()
    for example in EXAMPLES_2:
        if example.method != "GET" or example.before or "{" in example.target:
            continue
        reply = client.ask("GET", example.target, accept=HAL_2)
        if content_type(reply) != HAL_2 or example.target == "/logout":
            continue
        document = json.loads(reply.body)
        base = document["_links"]["base"]["href"]
        linked = [document["_links"], *(each["_links"] for each in document.get("_embedded", {}).get("resources", ()))]
        for href in (link["href"] for links in linked for rel, link in links.items() if rel in ("self", "next")):
            assert "json=1" not in href
            target = urljoin(base, href).removeprefix("https://memory")
            found = client.ask("GET", target, accept=HAL_2)
            if found.status == 405 or b"there is no resource" in found.body:
                lost.add(target)
    assert lost == set()


class AsLibrariesDo(Session2):
    """A client that leaves ``Accept`` to its library: to all that is possible, or nothing."""

    accept: str | None = None

    def show(self, method: str, target: str, body: str, form: str) -> HttpReply:
        return self.ask(method, target, body, accept=self.accept)


@pytest.fixture(scope="module", params=["*/*", None], ids=["all", "none"])
def default_session(request: pytest.FixtureRequest) -> AsLibrariesDo:
    session = AsLibrariesDo()
    session.accept = request.param
    return session


@pytest.mark.parametrize("example", EXAMPLES_2, ids=lambda each: f"{each.method} {each.target}")
def test_operation_is_answered_to_the_defaults_of_http_libraries(
    default_session: AsLibrariesDo, example: Example
) -> None:
    reply = example.send(default_session)
    assert reply.status == operation_of(default_session, example).success, reply.body
    if reply.body.startswith(b"<?xml"):
        assert content_type(reply) == XHTML_2


@pytest.mark.parametrize("accept", ["*/*", None])
def test_options_are_answered_to_the_defaults_of_http_libraries(client: Session2, accept: str | None) -> None:
    reply = client.ask("OPTIONS", PANEL, accept=accept)
    assert (reply.status, content_type(reply), b"motoron|motoroff" in reply.body) == (200, XHTML_2, True)


@pytest.mark.parametrize(
    ("accept", "expected"),
    [
        ("", XHTML_2),
        ("application/*", XHTML_2),
        ("*/*;v=2.0", XHTML_2),
        ("text/html,application/xhtml+xml,application/xml;q=0.9,image/avif,image/webp,*/*;q=0.8", XHTML_2),
        ("text/html, image/gif, image/jpeg, *; q=.2, */*; q=.2", XHTML_2),
        ("application/json, text/plain, */*", XHTML_2),
        ("application/hal+json;v=2.0, */*", HAL_2),
        ("*/*, application/hal+json;v=2.0", HAL_2),
        ("APPLICATION/HAL+JSON; V=2.0", HAL_2),
        ("application/hal+json ; charset=utf-8 ; v=2", HAL_2),
        ('application/hal+json;v="2.0"', HAL_2),
        ("application/hal+json;v=2.0, application/xhtml+xml;v=2.0", HAL_2),
        ("application/xhtml+xml;v=2.0, application/hal+json;v=2.0", XHTML_2),
        ("application/xhtml+xml;v=2.0;q=0.5, application/hal+json;v=2.0;q=0.9", HAL_2),
        ("application/hal+json;v=2.0;q=0.2, application/*;q=0.5", XHTML_2),
        ("application/xhtml+xml;v=2.0;q=0, */*", HAL_2),
        ("application/hal+json;v=2.0;q=much", HAL_2),
    ],
)
def test_representation_is_the_one_that_a_client_prefers(client: Session2, accept: str, expected: str) -> None:
    reply = client.ask("GET", PANEL, accept=accept)
    assert (reply.status, content_type(reply)) == (200, expected)


def test_representation_is_chosen_from_all_accept_headers(client: Session2) -> None:
    headers = (client.cookie, ("Accept", "text/html"), ("accept", "application/xml;q=0.5"), ("ACCEPT", HAL_2))
    assert content_type(client._handled(HttpRequest("GET", PANEL, headers))) == HAL_2


@pytest.mark.parametrize(
    "accept",
    [
        "application/json",
        "application/hal+json",
        "application/xhtml+xml",
        "application/hal+json;v=1.0",
        "application/*;v=1.0",
        "text/*",
        "*/*;q=0",
        "application/hal+json;v=2.0;q=0",
        "nonsense",
    ],
)
def test_other_representations_are_not_acceptable(client: Session2, accept: str) -> None:
    for method, target, form in (("GET", PANEL, ""), ("POST", PANEL, "ctrl-state=motoron"), ("OPTIONS", PANEL, "")):
        reply = client.ask(method, target, form, accept=accept)
        assert (reply.status, content_type(reply)) == (406, XHTML_2)
        assert "accept header" in read_status(XHTML_2, reply.body).message
    assert client.controller.controller_state.value == "motoroff"


def test_parameter_json_of_version_1_has_no_effect(client: Session2) -> None:
    assert content_type(client.ask("GET", f"{PANEL}?json=1")) == XHTML_2


@pytest.mark.parametrize("kind", ["application/x-www-form-urlencoded", "application/json", "text/plain;v=2.0"])
def test_other_types_of_a_form_are_refused(client: Session2, kind: str) -> None:
    assert client.ask("POST", PANEL, "ctrl-state=motoron", kind=kind).status == 415
    assert client.controller.controller_state.value == "motoroff"


@pytest.mark.parametrize("kind", ["text/plain", "application/json", FORM_2])
def test_other_types_of_a_file_are_refused(client: Session2, kind: str) -> None:
    assert client.ask("PUT", "/fileservice/HOME/other.txt", "text", kind=kind).status == 415
    assert "HOME:/other.txt" not in client.controller.files


def test_file_is_read_whatever_a_client_accepts(client: Session2) -> None:
    client.controller.files["HOME:/x.txt"] = "text"
    reply = client.ask("GET", "/fileservice/HOME/x.txt", accept="*/*")
    assert (reply.status, reply.body) == (200, b"text")


@pytest.mark.parametrize(
    "credentials",
    [
        "",
        "Basic",
        "Basic !!",
        'Digest username="Default User"',
        f"Basic {b64encode(b'Default User:wrong').decode()}",
        f"Basic {b64encode(b'Admin:robotics').decode()}",
        f"Bearer {BASIC.partition(' ')[2]}",
    ],
)
def test_wrong_credentials_are_asked_for_again(client: Session2, credentials: str) -> None:
    headers = (("Authorization", credentials), ("Accept", HAL_2)) if credentials else (("Accept", HAL_2),)
    reply = client._handled(HttpRequest("GET", PANEL, headers))
    assert (reply.status, reply.header("WWW-Authenticate")) == (401, 'Basic realm="validusers@robapi.abb"')


def test_names_and_actions_of_version_1_are_not_there(client: Session2) -> None:
    assert client.ask("GET", "/rw/panel/ctrlstate").status == 404
    assert client.ask("GET", "/rw/rapid/modules?task=T_ROB_L").status == 404
    assert client.ask("GET", "/rw/mastership/rapid").status == 404
    assert client.ask("POST", "/rw/rapid/execution?action=stop").status == 405


def test_actions_are_shown_by_options(client: Session2) -> None:
    document = json.loads(client.ask("OPTIONS", PANEL, accept=HAL_2).body)
    assert document["state"][0]["ctrl-state"] == "motoron|motoroff"


def test_data_are_written_with_mastership_of_edit_alone(client: Session2) -> None:
    assert client.ask("POST", f"{SYMBOL}/data", "value=3").status == 403
    assert client.ask("POST", "/rw/mastership/edit/request").status == 204
    assert client.ask("POST", f"{SYMBOL}/data", "value=3").status == 204
    assert json.loads(client.ask("GET", f"{SYMBOL}/data", accept=HAL_2).body)["state"][0]["value"] == "3"
    assert client.ask("POST", f"{SYMBOL}/data", "value=0").status == 204
    assert client.ask("POST", "/rw/mastership/edit/release").status == 204


def test_mastership_may_be_taken_for_one_request(client: Session2) -> None:
    assert client.ask("POST", "/rw/rapid/execution/resetpp").status == 403
    assert client.ask("POST", "/rw/rapid/execution/resetpp?mastership=implicit").status == 204
    status = json.loads(client.ask("GET", "/rw/mastership/edit", accept=HAL_2).body)["state"][0]
    assert status["mastership"] == "nomaster"


def test_mastership_of_another_client_is_not_taken(client: Session2) -> None:
    client.ask("POST", "/rw/mastership/edit/request")
    client.cookie = client._log_in()
    assert client.ask("POST", "/rw/rapid/execution/resetpp?mastership=implicit").status == 403


def test_mastership_for_one_request_needs_the_grant_of_its_request(
    client: Session2, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client.service._users, "granted", [each for each in GRANTS if each is not Grant.RAPID_DEBUG])
    reply = client.ask("POST", "/rw/rapid/execution/cycle?mastership=implicit", "cycle=forever")
    assert (reply.status, b"UAS_RAPID_DEBUG" in reply.body) == (403, True)


def test_mastership_for_one_request_needs_the_privilege_in_manual_mode(client: Session2) -> None:
    client.controller.select_mode(OperatingMode.MANUAL_REDUCED)
    reply = client.ask("POST", "/rw/rapid/execution/cycle?mastership=implicit", "cycle=forever")
    assert (reply.status, b"RMMP" in reply.body) == (403, True)
    client.prepare("rmmp")
    client.pass_time(1.0)
    client.pass_time(0.1)
    assert client.ask("POST", "/rw/rapid/execution/cycle?mastership=implicit", "cycle=once").status == 204


def test_loaded_module_is_shown(client: Session2) -> None:
    client.prepare("no small")
    client.prepare("hold rapid")
    reply = client.ask("POST", f"{TASK}/loadmod", "modulepath=HOME/small.mod&replace=true", accept=HAL_2)
    assert (reply.status, json.loads(reply.body)["state"][0]["name"]) == (200, "Small")


def test_body_without_the_task_that_it_is_about_is_refused(client: Session2) -> None:
    client.prepare("hold rapid")
    reply = client.ask("POST", "/rw/rapid/tasks/activate")
    assert (reply.status, "task" in read_status(XHTML_2, reply.body).message) == (400, True)


# Subscriptions


class Listener:
    """What a client hears."""

    protocol = "rws_subscription"

    def __init__(self) -> None:
        self.texts: list[str] = []

    def on_text(self, text: str) -> None:
        self.texts.append(text)

    def on_lost(self, reason: str) -> None:
        self.texts.append("lost")


def subscribed(client: Session2, path: str) -> HttpReply:
    return client.ask("POST", "/subscription", f"resources=1&1={path}&1-p=1")


def connected(client: Session2, location: str, protocol: str = "rws_subscription") -> Listener | int:
    target = location.removeprefix("wss://memory:443")
    headers = (client.cookie, ("Upgrade", "websocket"), ("Sec-WebSocket-Protocol", protocol))
    reply = client.service.handle(HttpRequest("GET", target, headers, peer="socket"), client.now)
    if not isinstance(reply, Upgrade):
        assert isinstance(reply, HttpReply)
        return reply.status
    listener = Listener()
    reply.attach(MemoryChannel(listener))
    return listener


@pytest.mark.parametrize(
    ("path", "change"),
    [
        ("/rw/panel/ctrl-state;ctrlstate", lambda client: client.controller.set_motors(True)),
        (
            f"{SIGNALS}/custom_DO_1;state",
            lambda client: client.ask("POST", f"{SIGNALS}/custom_DO_1/set-value", "lvalue=1"),
        ),
        (
            "/rw/rapid/symbol/RAPID/T_ROB_L/TRobEGM/egm_presync_tasks/data;value",
            lambda client: client.ask(
                "POST",
                "/rw/rapid/symbol/RAPID/T_ROB_L/TRobEGM/egm_presync_tasks/data?mastership=implicit",
                'value=[["T_ROB_L"],["T_ROB_R"]]',
            ),
        ),
        ("/rw/mastership/edit", lambda client: client.ask("POST", "/rw/mastership/edit/request")),
    ],
)
def test_change_is_sent_with_the_path_of_version_2(
    client: Session2, path: str, change: Callable[[Session2], object]
) -> None:
    reply = subscribed(client, path)
    location = reply.header("Location") or ""
    assert (reply.status, location.startswith("wss://memory:443/poll/")) == (201, True)
    listener = connected(client, location)
    assert isinstance(listener, Listener)
    change(client)
    client.pass_time(1.0)
    assert [f'href="{path}"' in text and "https://memory:443/" in text for text in listener.texts] == [True]


@pytest.mark.parametrize(
    "path", ["/rw/panel/ctrlstate;ctrlstate", "/rw/rapid/symbol/data/RAPID/T_ROB_L/TRobEGM/egm_presync_tasks;value"]
)
def test_resources_of_version_1_are_not_subscribed(client: Session2, path: str) -> None:
    assert subscribed(client, path).status == 400


def test_protocol_of_version_1_is_refused(client: Session2) -> None:
    location = subscribed(client, "/rw/panel/opmode;opmode").header("Location") or ""
    assert connected(client, location, "robapi2_subscription") == 400


def test_group_ends_with_its_connection(client: Session2) -> None:
    location = subscribed(client, "/rw/panel/opmode;opmode").header("Location") or ""
    assert isinstance(connected(client, location), Listener)
    client.service.drop_web_sockets()
    assert connected(client, location) == 404


def test_change_of_a_group_adds_to_it(client: Session2) -> None:
    location = subscribed(client, "/rw/panel/opmode;opmode").header("Location") or ""
    number = location.rpartition("/")[2]
    client.ask("PUT", f"/subscription/{number}", "resources=1&1=/rw/panel/speedratio;speedratio&1-p=1")
    body = client.ask("GET", f"/subscription/{number}").body
    assert b"pnl-opmode-ev" in body
    assert b"pnl-speedratio-ev" in body


def test_client_has_ten_groups(client: Session2) -> None:
    statuses = [subscribed(client, "/rw/panel/opmode;opmode").status for _ in range(11)]
    assert statuses == [201] * 10 + [400]


@pytest.mark.parametrize("block", ["Counts/count", "%251"])  # a stack frame is %1, and its % escaped
def test_data_of_a_routine_under_way_are_read(block: str) -> None:
    session = Session2()
    text = "MODULE Counts PROC main() count 5; ENDPROC PROC count(num number) WaitTime 9; ENDPROC ENDMODULE"
    session.controller.replace_program({"HOME:/counts.mod": text})
    session.controller.set_motors(True)
    session.controller.start_rapid()
    session.world.cycle({})
    reply = session.ask("GET", f"/rw/rapid/symbol/RAPID/T_ROB_L/{block}/number/data", accept=HAL_2)
    assert [each["value"] for each in json.loads(reply.body)["state"]] == ["5"]
    found = session.ask("POST", "/rw/rapid/symbols/search", "view=stack&blockurl=RAPID/T_ROB_L&stack=1", accept=HAL_2)
    assert [each["symburl"] for each in json.loads(found.body)["state"]] == ["RAPID/T_ROB_L/%1/number"]
