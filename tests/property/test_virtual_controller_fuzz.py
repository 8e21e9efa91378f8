"""Whatever a program says and whatever a client sends: a typed error, a refusal, and the controller goes on."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

import abb_protocols.controller_files
from abb_protocols.errors import RapidError, RobotNotReady
from abb_protocols.rws.documents import FORM_TYPE
from abb_protocols.rws.operations.operation import get
from digest_client import authorization
from soak import FUZZ_PROGRAMS, FUZZ_REQUESTS
from virtual_irc5.rapid.states import Execution
from virtual_irc5.rws import rws_service
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.router import Route, Router
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.world import World

# Programs

FOLDER = Path(next(iter(abb_protocols.controller_files.__path__)))
MODULES = {path.stem: path.read_text(encoding="ascii") for path in sorted(FOLDER.glob("TRob*.*"))}
TESTS = Path(__file__).parents[1]
FOREIGN = {
    path.stem: path.read_text(encoding="latin-1")
    for folder in ("rapid_corpus", "unit/virtual/programs", "unit/virtual/motion_programs")
    for path in sorted((TESTS / folder).glob("*.mod"))
}
"""Whole programs in the styles of others; each takes the place of our modules."""
TOKEN = re.compile(r'"[^"\n]*"|\w+|\s+|:=|<>|.', re.DOTALL)
WORDS = (
    *("0", "1", "-1", "1E38", "9E9", "1E400", "0.5", "0x7FFFFFFF", '""', '"x"', "TRUE", "[]", "[[1,2],[3]]", "{1}"),
    *("x", "tool0", "settings", "current_state", "ERRNO", "ROB_ID", "EGM_STOP", "egm_id", "clock", "robtarget"),
    *("MoveAbsJ", "MoveL", "Stop", "SystemStopAction\\Halt", "EXIT", "RETURN", "RAISE", "RETRY", "TRYNEXT", "WaitTime"),
    *("EGMRunJoint", "EGMReset", "EGMStop", "Load", "UnLoad", "CRobT()", "CJointT()", "NumToStr(1,9)", "StrPart"),
    *("IDelete", "ISignalDI", "ITimer", "BookErrNo", "PulseDO", "Reset", "ReadCfgData", "GetNextMechUnit", "Present"),
    *("IF", "THEN", "ELSE", "ENDIF", "WHILE", "DO", "ENDWHILE", "FOR", "TEST", "CASE", "GOTO", "PROC", "ENDPROC"),
    *("FUNC", "TRAP", "ERROR", "UNDO", "VAR", "PERS", "CONST", "LOCAL", "num", "string", "+", "-", "*", "/", "DIV"),
    *(
        "MOD",
        "AND",
        "OR",
        "NOT",
        "=",
        "<",
        ":=",
        ";",
        ",",
        "(",
        ")",
        "[",
        "]",
        "{",
        "}",
        "\\",
        "%",
        "?",
        "|",
        "!",
        "\n",
    ),
)
Mutation = tuple[float, int, str]

mutations = st.lists(
    st.tuples(st.floats(0.0, 1.0, exclude_max=True), st.integers(0, 3), st.sampled_from(WORDS)), min_size=1, max_size=6
)
programs = st.tuples(st.sampled_from(sorted(MODULES)), mutations)
foreign_programs = st.tuples(st.sampled_from(sorted(FOREIGN)), mutations)


def mutated(text: str, changes: Sequence[Mutation]) -> str:
    """The text with tokens replaced, inserted, deleted or moved."""
    tokens = TOKEN.findall(text)
    for place, kind, word in changes:
        index = int(place * len(tokens))
        if kind == 0:
            tokens[index] = word
        elif kind == 1:
            tokens.insert(index, f" {word} ")
        elif kind == 2:
            del tokens[index]
        else:
            tokens.insert(len(tokens) - index, tokens.pop(index))
    return "".join(tokens)


def check_program(program: tuple[str, Sequence[Mutation]]) -> None:
    """Load one mutated module in the place of ours, run the state machine, use it and stop it."""
    name, changes = program
    world = World()
    controller, task = world.controller, world.controller.tasks["T_ROB_R"]
    filename = next(module.filename for module in task.modules if module.name == name)
    try:
        task.unload(name)
    except RobotNotReady:  # main is executing
        task.lose_pp()
        task.unload(name)
    try:
        task.load(mutated(MODULES[name], changes), filename)
        task.move_pp_to_main()
    except (RapidError, RobotNotReady):
        return
    controller.set_motors(True)
    controller.start_rapid()
    for signal in ("RUN_RAPID_ROUTINE", "EGM_START_JOINT", "RUN_SG_ROUTINE", "EGM_STOP", "WD_STOP_REQUEST"):
        controller.signals.set(signal, 1)
        controller.settle()
        for _ in range(25):
            world.cycle({})
    assert [event.description for event in controller.events.entries() if "system error" in event.description] == []
    assert all(
        task.execution is not Execution.UNINITIALIZED or not task.is_running for task in controller.tasks.values()
    )


def check_foreign_program(program: tuple[str, Sequence[Mutation]]) -> None:
    """Run one mutated program of others in T_ROB_R for half a second, and stop it."""
    name, changes = program
    world = World()
    controller, task = world.controller, world.controller.tasks["T_ROB_R"]
    task.lose_pp()
    for module in task.modules:
        task.unload(module.name)
    try:
        task.load(mutated(FOREIGN[name], changes), f"HOME:/{name}.mod")
        task.faults()
        task.move_pp_to_main()
    except (RapidError, RobotNotReady):
        return
    controller.set_motors(True)
    controller.start_rapid()
    for _ in range(125):
        world.cycle({})
    assert [event.description for event in controller.events.entries() if "system error" in event.description] == []
    controller.stop_rapid()
    for _ in range(25):
        world.cycle({})
    assert not task.is_running
    task.lose_pp()  # what it has opened is closed


@settings(max_examples=12)
@given(foreign_programs)
def test_mutated_program_of_others_only_gives_typed_errors(program: tuple[str, Sequence[Mutation]]) -> None:
    check_foreign_program(program)


@pytest.mark.soak
@pytest.mark.timeout(7200)
@settings(max_examples=FUZZ_PROGRAMS)
@given(foreign_programs)
def test_many_mutated_programs_of_others_only_give_typed_errors(program: tuple[str, Sequence[Mutation]]) -> None:
    check_foreign_program(program)


@settings(max_examples=12)
@given(programs)
def test_mutated_program_only_gives_typed_errors(program: tuple[str, Sequence[Mutation]]) -> None:
    check_program(program)


@pytest.mark.soak
@pytest.mark.timeout(7200)
@settings(max_examples=FUZZ_PROGRAMS)
@given(programs)
def test_many_mutated_programs_only_give_typed_errors(program: tuple[str, Sequence[Mutation]]) -> None:
    check_program(program)


# Clients

USER, PASSWORD = "Default User", "robotics"
PATHS = (
    *("/", "/rw", "/rw/system", "/rw/panel/ctrlstate", "/rw/panel/speedratio", "/rw/panel", "/rw/rapid/execution"),
    *("/rw/rapid/tasks", "/rw/rapid/tasks/T_ROB_L", "/rw/rapid/modules?task=T_ROB_L", "/rw/cfg", "/rw/cfg/SIO/COM_TRP"),
    *("/rw/rapid/symbol/data/RAPID/T_ROB_L/TRobMain/current_state", "/rw/rapid/symbol/data/RAPID/T_ROB_L/TRobEGM/x{1}"),
    *("/rw/rapid/symbol/properties/RAPID/T_ROB_R/TRobEGM/settings", "/rw/iosystem/signals", "/rw/elog/0"),
    *("/rw/iosystem/signals/EGM_STOP", "/rw/motionsystem/mechunits/ROB_L/jointtarget", "/rw/mastership/rapid"),
    *("/rw/iosystem/signals/hand_CmdGripper_L", "/rw/iosystem/signals/hand_MaxSpeed_R"),
    *("/fileservice", "/fileservice/$home", "/fileservice/$home/yumi/TRobMain.mod", "/subscription", "/poll/1"),
)
ACTIONS = ("set", "show", "start", "stop", "resetpp", "loadmod", "unloadmod", "setctrlstate", "clear", "request", "x")
NAMES = ("value", "lvalue", "ctrl-state", "speed-ratio", "modulepath", "module", "replace", "resources", "1", "1-p")
VALUES = (
    "",
    "0",
    "1",
    "7",
    "-1",
    "1e30",
    "1e999",
    "9" * 5000,
    "-" * 5000,
    "[" * 3000,
    "TRUE",
    "motoron",
    "HOME:",
    "HOME:/yumi/TRobMain.mod",
)
odd = st.text(st.characters(codec="latin-1"), max_size=20) | st.sampled_from(
    ("\udcff", "%ff", "%", "..", "\u0663", "\x00")
)
pieces = st.sampled_from(VALUES) | odd
options = ("action", "json", "start", "limit", "order", "task", "lang")


def joined(pairs: Sequence[tuple[str, str]]) -> str:
    return "&".join(f"{name}={value}" for name, value in pairs)


targets = st.builds(
    lambda path, rest, action, more: f"{path}{rest}{'&' if '?' in path else '?'}action={action}&{joined(more)}",
    st.sampled_from(PATHS),
    st.just("") | odd.map(lambda text: f"/{text}"),
    st.sampled_from(ACTIONS),
    st.lists(st.tuples(st.sampled_from(options), pieces), max_size=2),
)
contents = st.binary(max_size=50) | st.lists(st.tuples(st.sampled_from(NAMES), pieces), max_size=3).map(
    lambda pairs: joined(pairs).encode(errors="surrogateescape")
)
headers = st.lists(
    st.tuples(st.sampled_from(("Host", "Content-Type", "Upgrade", "Connection", "Cookie", "Authorization")), odd),
    max_size=2,
)
calls = st.builds(
    lambda method, target, content, more: HttpRequest(
        method, target, (*more, ("Content-Type", FORM_TYPE)), content, "127.0.0.1:4711"
    ),
    st.sampled_from(("GET", "POST", "PUT", "DELETE", "HEAD", "PATCH", "\udcff")),
    targets,
    contents,
    headers,
)


FORM = ("Content-Type", FORM_TYPE)
DIGEST = (
    'Digest username="{user}", realm="validusers@robapi.abb", nonce="{nonce}", uri="/rw", response="x", opaque="x", '
    'qop="auth", nc=00000001, cnonce="x"'
)


class Client:
    """Somebody with a session on a virtual controller."""

    def __init__(self) -> None:
        self.service = RwsService(World().controller, user=USER, password=PASSWORD)
        challenge = self.asked(HttpRequest("GET", "/rw")).header("WWW-Authenticate") or ""
        proof = authorization(challenge, user=USER, password=PASSWORD, method="GET", uri="/rw")
        reply = self.asked(HttpRequest("GET", "/rw", (("Authorization", proof),)))
        jar = [text.partition(";")[0] for name, text in reply.headers if name == "Set-Cookie"]
        self.cookie = ("Cookie", "; ".join(jar))

    def asked(self, request: HttpRequest) -> HttpReply:
        self.service.may_enter(request, 0.0)
        reply = self.service.handle(request, 0.0)
        return reply if isinstance(reply, HttpReply) else HttpReply(101)


def check_request(client: Client, call: HttpRequest) -> None:
    """With a session and without one."""
    with patch.object(rws_service.log, "exception", side_effect=AssertionError("a fault of ours")):
        reply = client.asked(replace(call, headers=(*call.headers, client.cookie)))
        assert client.asked(call).status in {401, 403, 503}
    assert reply.status in {*range(200, 300), *range(400, 500), 101, 503, 507}, reply


@pytest.fixture(scope="module")
def client() -> Client:
    return Client()


@settings(max_examples=100, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(calls)
@example(HttpRequest("GET", "/rw/\udcff"))
@example(HttpRequest("POST", "/rw/rapid/tasks/T_ROB_L?action=loadmod", (FORM,), b"modulepath=HOME:"))
@example(HttpRequest("GET", "/rw/elog/0?limit=" + "9" * 5000))
@example(HttpRequest("GET", "/rw", (("Authorization", DIGEST.format(user="\udcff", nonce="x")),)))
@example(HttpRequest("GET", "/rw", (("Authorization", DIGEST.format(user="Default User", nonce="\xff")),)))
@example(HttpRequest("GET", "/rw", (("Authorization", "Digest \xff"), ("Cookie", "\udcff=1; -http-session-=\udcff"))))
def test_nonsense_of_a_client_is_refused(client: Client, call: HttpRequest) -> None:
    check_request(client, call)


@pytest.mark.soak
@pytest.mark.timeout(7200)
@settings(max_examples=FUZZ_REQUESTS, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(calls)
def test_much_nonsense_of_a_client_is_refused(client: Client, call: HttpRequest) -> None:
    check_request(client, call)


def test_fault_of_ours_is_refused_and_logged(
    client: Client, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def broken(controller: object, call: object) -> None:
        raise ZeroDivisionError("of ours")

    monkeypatch.setattr(client.service, "_router", Router([Route(get("/rw/broken"), broken)]))
    assert client.asked(HttpRequest("GET", "/rw/broken", (client.cookie,))).status == 400
    assert [record.exc_info is not None for record in caplog.records] == [True]
