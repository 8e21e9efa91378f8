"""What public clients of Robot Web Services send, one sequence each, and what they read in the answers.

Written after reading the clients; none of their code is here. How each reads an answer is part of its sequence: some
parse XML, others search text with a pattern, which also depends on the order of attributes and elements.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from xml.etree import ElementTree

import pytest

from abb_protocols.rws.values import EventType, OperatingMode
from digest_client import authorization
from rws_examples import PASSWORD, USER, Session
from rws_examples_2 import Session2
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.subscriptions import Upgrade
from virtual_irc5.rws.version_2 import HAL_2, XHTML_2
from virtual_irc5.testing.memory_rws import MemoryChannel

UNIT = "/rw/motionsystem/mechunits/ROB_L"
SIGNAL = "/rw/iosystem/signals/DeviceNet/D652_10/custom_DO_0"
_NAMESPACE = "{http://www.w3.org/1999/xhtml}"


@pytest.fixture
def session() -> Session:
    session = Session()
    session.prepare("program")
    return session


def spans(reply: HttpReply) -> dict[str, str]:
    """All spans by class, as clients read them that walk through the tree and keep the last."""
    assert reply.status == 200, reply.body
    body = ElementTree.fromstring(reply.body)[1]
    return {each.attrib["class"]: each.text or "" for each in body.iter(f"{_NAMESPACE}span")}


def state(reply: HttpReply, index: int = 0) -> dict[str, object]:
    assert reply.status == 200, reply.body
    found = json.loads(reply.body)["_embedded"]["_state"][index]
    assert isinstance(found, dict)
    return found


class Listener:
    protocol = "robapi2_subscription"

    def __init__(self) -> None:
        self.texts: list[str] = []

    def on_text(self, text: str) -> None:
        self.texts.append(text)

    def on_lost(self, sentence: str) -> None:
        self.texts.append(sentence)


def listening(session: Session, target: str, *more: tuple[str, str]) -> Listener:
    """What comes on a WebSocket that a client opens with its cookies."""
    listener = Listener()
    headers = (session.cookie, ("Upgrade", "websocket"), ("Sec-WebSocket-Protocol", listener.protocol), *more)
    upgrade = session.service.handle(HttpRequest("GET", target, headers, peer="socket"), session.now)
    assert isinstance(upgrade, Upgrade)
    upgrade.attach(MemoryChannel(listener))
    return listener


def pass_seconds(session: Session, seconds: float) -> None:
    for _ in range(int(seconds / 0.05)):
        session.pass_time(0.05)


# C++, XML by Poco: ids of resources from 0, the group's number behind /poll/


def test_librws_sequence(session: Session) -> None:
    ask = session.ask
    for field, expected in (("ctrlexecstate", "stopped"), ("cycle", "forever")):
        root = ElementTree.fromstring(ask("GET", "/rw/rapid/execution").body)
        item = root.find("/".join(f"{_NAMESPACE}{tag}" for tag in ("body", "div", "ul", "li")))
        assert item is not None
        assert {each.attrib["class"]: each.text for each in item}[field] == expected
    assert spans(ask("GET", "/rw/rapid/symbol/properties/RAPID/T_ROB_L/TRobMain/current_state"))["dattyp"] == "num"
    assert ask("POST", "/rw/mastership/rapid?action=request").status == 204
    assert ask("PUT", "/fileservice/$home/small.mod", "MODULE Small\nENDMODULE\n").status in (200, 201)
    form = "modulepath=$home/small.mod&replace=true"
    assert ask("POST", "/rw/rapid/tasks/T_ROB_L?action=loadmod", form).status == 204
    assert ask("POST", "/rw/rapid/tasks/T_ROB_L?action=unloadmod", "module=Small").status == 204
    assert ask("POST", "/rw/mastership/rapid?action=release").status == 204
    assert re.search(rb'"ms-mechunit"', ask("GET", f"{UNIT}?resource=static").body)
    assert spans(ask("GET", f"{UNIT}/robtarget?coordinate=Base&tool=tool0&wobj=wobj0"))["cfx"]
    domains = ElementTree.fromstring(ask("GET", "/rw/elog?lang=en&resource=count").body)
    titles = [each.attrib["title"] for each in domains.iter(f"{_NAMESPACE}li")]
    assert [int(each) for each in titles] == sorted(int(each) for each in titles)
    error = spans(ask("GET", "/rw/retcode?code=-1073442810"))
    assert (error["code"], error["severity"]) == ("-1073442810", "Error")
    two = (
        "resources=0&0=/rw/iosystem/signals/custom_DO_0;state&0-p=1"
        "&resources=1&1=/rw/rapid/execution;ctrlexecstate&1-p=0"
    )
    subscribed = ask("POST", "/subscription", two)
    location = subscribed.header("Location") or ""
    number = location[location.find("/poll/") + len("/poll/") :]
    assert (subscribed.status, number) == (201, "1")
    listener = listening(session, f"/poll/{number}")
    session.controller.signals.set("custom_DO_0", 1)
    pass_seconds(session, 1.0)
    event = ElementTree.fromstring(listener.texts[-1])
    item = event.find("/".join(f"{_NAMESPACE}{tag}" for tag in ("body", "div", "ul", "li")))
    assert item is not None
    link = item.find(f"{_NAMESPACE}a")
    assert link is not None
    assert link.attrib["href"].removeprefix("/rw/iosystem/signals/").partition(";")[0] == "custom_DO_0"
    assert ask("PUT", f"/subscription/{number}", two).status == 200
    assert ask("DELETE", f"/subscription/{number}").status == 200
    assert ask("GET", "/logout").status in (200, 204)
    session.cookie = session._log_in()
    assert session.ask("POST", "/ctrl", "restart-mode=restart").status == 200


# C#: JSON by attributes; numbers only where the real controller has them


def test_dotnet_console_sequence(session: Session) -> None:
    ask = session.ask
    assert {"ctrl-name", "ctrl-type"} <= state(ask("GET", "/ctrl?json=1"), 1).keys()
    system = json.loads(ask("GET", "/rw/system?json=1").body)["_embedded"]["_state"]
    assert isinstance(system[0]["rwversion"], str)
    assert all(isinstance(each["option"], str) for each in system[1]["options"])
    listed, start = [], 0
    while True:  # until a page is not full
        page = json.loads(ask("GET", f"/rw/iosystem/signals?json=1&limit=10&start={start}").body)["_embedded"]["_state"]
        listed += page
        start += 10
        if len(page) < 10:
            break
    assert sorted(each["name"] for each in listed) == sorted(session.controller.signals.names)
    assert all(isinstance(each["lvalue"], (int, float)) for each in listed)
    assert ask("POST", f"{SIGNAL}?action=set", "lvalue=1").status == 204
    task = state(ask("GET", "/rw/rapid/tasks/T_ROB_L?json=1"))
    assert {"tasktype", "trust", "taskID", "execmode", "prodentrypt", "bind_ref", "task_in_forgnd"} <= task.keys()
    assert all(isinstance(task[name], str) for name in ("taskID", "bind_ref", "motiontask"))
    assert ask("PUT", "/fileservice/$HOME/a.txt", "text").status in (200, 201)
    files = json.loads(ask("GET", "/fileservice/$HOME?json=1").body)["_embedded"]["_state"]
    file = next(each for each in files if each["_title"] == "a.txt")
    assert (file["_type"], file["fs-size"], file["fs-readonly"]) == ("fs-file", "4", "false")
    body = "resources=1&1=/rw/iosystem/signals/custom_DO_0;state&1-p=1"
    assert (ask("POST", "/subscription", body).header("Location") or "").startswith("ws://")


# C# of an industrial library: patterns over the text, then XML of one list item


def test_hsl_sequence(session: Session) -> None:
    def item(target: str, kind: str) -> dict[str, str]:
        text = session.ask("GET", target).body.decode()
        match = re.search(rf'<li class="{kind}"[\S\s]+?</li>', text)
        assert match is not None, text
        return {each.attrib["class"]: each.text or "" for each in ElementTree.fromstring(match[0]).iter("span")}

    def span(target: str, name: str) -> str:
        match = re.search(rf'<span class="{name}">([^<]+)', session.ask("GET", target).body.decode())
        assert match is not None
        return match[1]

    assert span("/rw/panel/ctrlstate", "ctrlstate") == "motoroff"
    assert span("/rw/motionsystem/errorstate", "err-state")
    assert int(span("/rw/panel/speedratio", "speedratio")) == 100
    assert span("/rw/iosystem/devices/D652_10", "outdata")
    assert float(item(f"{UNIT}/robtarget", "ms-robtargets")["z"]) > 0
    assert item("/rw/system", "sys-system-li")["rwversion"]
    session.controller.events.append(10010, "Motors OFF")
    assert item("/rw/elog/0?lang=zh&amp;resource=title", "elog-message-li")["code"] == "10010"
    # Whether the servos are on is a signal of the drive module.
    drive = "/rw/iosystem/signals/Local/DRV_1/DRV1K1"
    assert (item(drive, "ios-signal")["lvalue"], item(drive, "ios-signal")["category"]) == ("0", "safety")
    session.controller.set_motors(True)
    session.world.cycle({})
    assert item(drive, "ios-signal")["lvalue"] == "1"
    assert session.ask("POST", f"{drive}?action=set", "lvalue=0").status == 403


# Status servers of ROS-Industrial and PLCs: signals that the user has bound to states of the controller

_STATUS_SIGNALS = """EIO:CFG_1.0:6:1::
#
SYSSIG_OUT:

      -Status "RunchOk" -Signal "signalMotionPossible"

      -Status "MotOnState" -Signal "signalMotorOn"

      -Status "EmStop" -Signal "signalRobotEStop"

      -Status "MechUnitActive" -Signal "signalRobotActive" -Arg1 "ROB_L"
#
EIO_SIGNAL:

      -Name "signalMotionPossible" -SignalType "DO"

      -Name "signalMotorOn" -SignalType "DO"

      -Name "signalRobotEStop" -SignalType "DO"

      -Name "signalRobotActive" -SignalType "DO"
"""


def test_status_signals_sequence(session: Session) -> None:
    ask, controller = session.ask, session.controller
    assert ask("PUT", "/fileservice/$HOME/status.cfg", _STATUS_SIGNALS).status == 201
    assert ask("POST", "/rw/mastership/cfg?action=request").status == 204
    assert ask("POST", "/rw/cfg?action=load", "filepath=$HOME/status.cfg&action-type=add").status == 204
    controller.restart(0.1)
    for _ in range(200):
        session.world.cycle({})
    session.cookie = session._log_in()

    def signals() -> tuple[object, ...]:
        session.world.cycle({})
        names = ("signalMotionPossible", "signalMotorOn", "signalRobotEStop", "signalRobotActive")
        return tuple(state(session.ask("GET", f"/rw/iosystem/signals/{name}?json=1"))["lvalue"] for name in names)

    assert signals() == (1, 0, 0, 1)
    assert ask("POST", "/rw/panel/ctrlstate?action=setctrlstate", "ctrl-state=motoron").status == 204
    assert signals() == (1, 1, 0, 1)
    controller.press_emergency_stop()
    assert signals() == (0, 0, 1, 1)
    assert ask("POST", "/rw/iosystem/signals/signalMotionPossible?action=set", "lvalue=1").status == 403


# Crawlers and dashboards, which read what there is before anything has been asked for


def test_poll_for_a_privilege_that_was_not_requested_says_so(session: Session) -> None:
    for target, read in (("/users/rmmp/poll", spans), ("/users/rmmp/poll?json=1", state)):
        found = read(session.ask("GET", target))
        assert (found["code"], found["status"]) == ("-1073445870", "NO SUCH REQUEST")
    session.ask("POST", "/users/rmmp", "privilege=modify")
    session.cookie = session._log_in()
    assert spans(session.ask("GET", "/users/rmmp/poll"))["status"] == "NO SUCH REQUEST"


@pytest.mark.parametrize(
    ("target", "status", "code"),
    [
        ("/rw/rapid/uiinstr/active", 404, "-1073445864"),  # captured from a controller
        # ABB's manual has other values of the parameter, and these as resources of their own.
        ("/rw/motionsystem?resource=motionsupervision", 400, "-1073445879"),
        ("/rw/motionsystem?resource=nonmotionexecution", 400, "-1073445879"),
        ("/users?resource=grants", 400, "-1073445879"),
        ("/ctrl/features", 404, "-1073414146"),  # of RobotWare 7 alone
    ],
)
def test_resource_that_a_controller_does_not_have_gets_its_status(
    session: Session, target: str, status: int, code: str
) -> None:
    reply = session.ask("GET", target)
    assert (reply.status, f'<span class="code">{code}</span>'.encode() in reply.body) == (status, True)


@pytest.mark.parametrize(
    "target", ["/rw/motionsystem/motionsupervision", "/rw/motionsystem/nonmotionexecution", "/users/grants"]
)
def test_resource_is_at_the_path_of_the_manual(session: Session, target: str) -> None:
    assert session.ask("GET", target).status == 200


def test_features_of_robotware_7_are_not_listed() -> None:
    session = Session2()
    assert (session.ask("GET", "/ctrl/features").status, session.ask("GET", "/ctrl/options").status) == (204, 204)


# Java and Python for a YuMi: lead-through and jogging by a local client


def test_lead_through_sequence(session: Session) -> None:
    ask = session.ask
    assert ask("GET", "/").status == 200  # whose cookies it keeps
    form = "username=Default+User&application=Belal_API&location=anything&ulocale=local"
    assert ask("POST", "/users", form).status < 204
    assert ask("POST", "/users/rmmp", "privilege=modify").status == 202
    assert spans(ask("GET", "/users/rmmp/poll"))["status"] in ("PENDING", "GRANTED")
    uid = spans(ask("GET", "/users/rmmp"))["userid"]
    assert ask("POST", "/users/rmmp?action=set", f"uid={uid}&privilege=modify").status == 204
    assert spans(ask("GET", "/users/rmmp/poll"))["status"] == "GRANTED"
    assert ask("POST", "/rw/mastership?action=request").status == 204
    assert ask("POST", f"{UNIT}?action=set-lead-through", "status=active").status == 204
    assert spans(ask("GET", f"{UNIT}?resource=lead-through"))["status"] == "active"
    assert ask("POST", f"{UNIT}?action=set-lead-through", "status=inactive").status == 204
    joints = spans(ask("GET", f"{UNIT}/jointtarget"))
    assert [float(joints[f"rax_{n}"]) for n in range(1, 7)] == pytest.approx([0, -130, 30, 0, 40, 0], abs=1e-3)
    assert float(joints["eax_a"]) == pytest.approx(135, abs=1e-3)
    session.prepare("motors")
    assert ask("POST", "/rw/motionsystem?action=set-mechunit", "mechunit-name=ROB_L").status in (200, 204)
    counted = re.search(
        r'class="ms"[^>]*>\s*<span[^>]*>(\d+)<', ask("GET", "/rw/motionsystem?resource=change-count").body.decode()
    )
    assert counted is not None
    axes = "&".join(f"axis{n}={200 if n == 1 else 0}" for n in range(1, 7))
    assert ask("POST", "/rw/motionsystem?action=jog", f"{axes}&ccount={counted[1]}").status == 204
    text = "text=MODULE+Small%0D%0AENDMODULE%0D%0A"
    session.prepare("small")
    assert ask("POST", "/rw/rapid/modules/Small?action=set-module-text&task=T_ROB_L", text).status == 200


# A PLC: JSON by a tokenizer that wants four levels, cookies with a semicolon at the end, a ping of the root


def test_plc_sequence(session: Session) -> None:
    name, cookies = session.cookie
    session.cookie = name, cookies + ";"
    ask = session.ask
    assert ask("GET", "/?json=1").status == 200
    for target, field in (
        ("/rw/rapid/execution", "ctrlexecstate"),
        ("/rw/panel/ctrlstate", "ctrlstate"),
        ("/rw/panel/opmode", "opmode"),
    ):
        reply = ask("GET", f"{target}?json=1")
        assert isinstance(state(reply)[field], str)
        tokens = re.findall(rb'"[^"]*"|[{}\[\]]|[^\s{}\[\],:"]+', reply.body)
        assert sum(each not in b"}]" for each in tokens) <= 32, "its parser has room for 32 tokens"
    assert ask("POST", f"{SIGNAL}?action=set&json=1", "lvalue=1").status == 204
    assert state(ask("GET", f"{SIGNAL}?json=1"))["lvalue"] == 1
    session.prepare("hold rapid")
    assert (
        ask("POST", "/rw/rapid/symbol/data/RAPID/T_ROB_L/TRobMain/current_state?action=set&json=1", "value=0").status
        == 204
    )
    assert state(ask("GET", "/rw/rapid/symbol/data/RAPID/T_ROB_L/TRobMain/current_state?json=1"))["value"] == "0"


# TypeScript for VS Code: patterns; calculations log in anew, with credentials over the path without its query


def credentials(session: Session, target: str, uri: str, password: str = PASSWORD) -> HttpReply:
    challenge = session._handled(HttpRequest("POST", target)).header("WWW-Authenticate") or ""
    proof = authorization(challenge, user=USER, password=password, method="POST", uri=uri)
    kind = ("Content-Type", "application/x-www-form-urlencoded")
    return session._handled(HttpRequest("POST", target, (("Authorization", proof), kind), b"mode=OFF"))


def test_credentials_may_leave_out_the_query(session: Session) -> None:
    target = "/rw/motionsystem/nonmotionexecution?action=set&json=1"
    path = target.partition("?")[0]
    assert credentials(session, target, path).status == 204
    assert credentials(session, target, "/rw/motionsystem").status == 401
    assert credentials(session, target, path, "wrong").status == 401


def test_typescript_sequence(session: Session) -> None:
    ask = session.ask
    modules = ask("GET", "/rw/rapid/modules?task=T_ROB_L").body.decode()
    item, name = (
        r'<li[^>]*class="[^"]*\brap-module-info-li\b[^"]*"[^>]*>',
        r'<span[^>]*class="[^"]*\bname\b[^"]*"[^>]*>',
    )
    pattern = f"{item}.*?{name}(.*?)</span>"
    assert "TRobMain" in re.findall(pattern, modules, re.S | re.I)
    devices = ask("GET", "/rw/iosystem/devices?network=DeviceNet").body.decode()
    assert re.search(r'<li[^>]*class="[^"]*\bios-device-li\b[^"]*"[^>]*title="DeviceNet/D652_10"', devices)
    axes = json.loads(ask("GET", f"{UNIT}/axes?json=1").body)["_embedded"]["_state"]
    count = int(next(each for each in axes if each["_type"] == "ms-mechunit-axes")["axes"])
    assert [ask("GET", f"{UNIT}/axes/{n}?json=1").status for n in range(1, count + 1)] == [200] * count
    parameters = json.loads(ask("GET", "/rw/cfg/SYS/CAB_TASKS/instances?json=1").body)["_embedded"]["_state"]
    assert {each["_title"]: each["value"] for each in parameters[0]["attrib"]}["Type"] == "NORMAL"
    domains = [each["_title"] for each in json.loads(ask("GET", "/rw/mastership?json=1").body)["_embedded"]["_state"]]
    assert domains == ["cfg", "motion", "rapid"]
    assert ask("POST", "/rw/mastership/rapid?action=request", "").status == 204
    assert (
        ask(
            "POST", "/rw/rapid/symbol/data?action=validate", "task=T_ROB_L&value=%5B1%2C0%2C0%2C0%5D&datatype=orient"
        ).status
        == 204
    )
    assert ask("POST", "/fileservice/$HOME", "fs-action=create&fs-newname=made").status == 201
    for number in range(120):
        session.controller.events.append(10000 + number, "Event", type=EventType.WARNING)
    target, found = "/rw/elog/0?lang=en&limit=50&order=lifo", []
    while target:  # pages that name the next one relative to their folder
        text = ask("GET", target).body.decode()
        found += [int(each) for each in re.findall(r'class="elog-message-li" title="/rw/elog/0/(\d+)"', text)]
        following = re.search(r'<a href="([^"]*)" rel="next"', text)
        target = f"/rw/elog/{following[1].replace('&amp;', '&')}" if following else ""
    assert found == sorted(found, reverse=True)
    assert len(set(found)) == len(found) >= 120


# Go, a metrics agent: attributes of one link per event, an Origin of the robot itself


def test_agent_sequence(session: Session) -> None:
    session.prepare("queue")
    subscribed = session.ask(
        "POST",
        "/subscription",
        "resources=1&1=/rw/iosystem/signals/DeviceNet/D652_10/custom_DO_0;state&1-p=1&resources=2&2=/rw/elog/0&2-p=1"
        "&resources=3&3=/rw/dipc/q&3-p=1",
    )
    assert subscribed.status == 201
    listener = listening(session, "/poll/1", ("Origin", "ws://memory:80"))
    session.controller.signals.set("custom_DO_0", 1)
    session.controller.events.append(10010, "Motors OFF")
    form = "dipc-src-queue-name=q&dipc-cmd=111&dipc-userdef=1&dipc-msgtype=1&dipc-data=ping;[TRUE]"
    assert session.ask("POST", "/rw/dipc/q?action=dipc-send", form).status in (200, 204)
    pass_seconds(session, 1.0)
    found = {}
    for text in listener.texts:
        item = ElementTree.fromstring(text).find(f".//{_NAMESPACE}li")
        assert item is not None
        link = item.find(f"{_NAMESPACE}a")
        assert link is not None
        found[item.attrib["class"]] = link.attrib["href"]
    assert found["ios-signalstate-ev"] == "/rw/iosystem/signals/DeviceNet/D652_10/custom_DO_0;state"
    assert found["dipc-msg-ev"] == "/rw/dipc/q"
    assert re.fullmatch(r"/rw/elog/0/\d+", found["elog-message-ev"])


# Python of a thesis and its successors: JSON, a slash at the end of a path, forms with fields too many


def test_thesis_sequence(session: Session) -> None:
    ask = session.ask
    pose = state(ask("GET", f"{UNIT}/robtarget/?tool=tool0&wobj=wobj0&coordinate=Wobj&json=1"))
    assert all(isinstance(float(str(pose[name])), float) for name in ("x", "y", "z", "q1", "q2", "q3", "q4"))
    assert ask("POST", "/users/rmmp/", "userid=1&privilege=modify").status == 202
    assert ask("POST", "/users/rmmp?action=cancel").status <= 204
    assert ask("POST", "/rw/rapid/execution?action=resetpp").status == 204
    assert ask("POST", "/rw/panel/ctrlstate?action=setctrlstate", "ctrl-state=motoron").status == 204
    start = "regain=continue&execmode=continue&cycle=once&condition=none&stopatbp=disabled&alltaskbytsp=false"
    assert ask("POST", "/rw/rapid/execution?action=start", start).status == 204
    assert state(ask("GET", "/rw/rapid/execution?json=1"))["ctrlexecstate"] == "running"
    assert ask("POST", "/rw/rapid/execution?action=stop", "stopmode=qstop").status == 204
    session.controller.select_mode(OperatingMode.MANUAL_REDUCED)
    assert state(ask("GET", "/rw/panel/opmode?json=1"))["opmode"] == "MANR"
    refused = ask("POST", "/rw/panel/ctrlstate?action=setctrlstate&json=1", "ctrl-state=motoron")
    assert refused.status >= 400
    assert isinstance(json.loads(refused.body)["_embedded"]["status"]["code"], int)


# RWS 2.0: a PLC's and an editor's clients


@pytest.mark.parametrize(
    ("method", "target", "form", "check"),
    [
        ("GET", "/rw/panel/ctrl-state?json=1", "", lambda state: state["ctrlstate"] == "motoroff"),
        ("GET", "/rw/rapid/execution?json=1", "", lambda state: state["cycle"] == "forever"),
        (
            "GET",
            "/rw/motionsystem/mechunits/ROB_L/cartesian",
            "",
            lambda state: {"x", "q4", "cf1", "cf4", "cf6", "cfx"} <= state.keys() and "j1" not in state,
        ),
        ("GET", "/rw/rapid/symbol/RAPID/T_ROB_L/TRobMain/current_state/data", "", lambda state: "value" in state),
        ("POST", "/rw/panel/speedratio?action=setspeedratio", "speed-ratio=50", None),
        ("POST", "/rw/rapid/execution/cycle", "cycle=once", None),
        ("POST", "/rw/rapid/tasks/activate", "task=T_ROB_L", None),
        ("POST", "/rw/iosystem/signals/DeviceNet/D652_10/custom_DO_0/set-value", "lvalue=1", None),
        ("POST", "/rw/elog/clearall", "", None),
    ],
)
def test_version_2_sequence(
    method: str, target: str, form: str, check: Callable[[dict[str, object]], bool] | None
) -> None:
    session = Session2()
    session.prepare("program")
    assert session.ask("POST", "/rw/mastership/edit/request").status == 204
    reply = session.ask(method, target, form, accept=HAL_2 if method == "GET" else XHTML_2)
    assert reply.status == (200 if method == "GET" else 204), reply.body
    assert check is None or check(json.loads(reply.body)["state"][0])
