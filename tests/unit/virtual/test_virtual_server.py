"""The virtual controller as a process: its cycles in real time, and long work beside them."""

from __future__ import annotations

import gc
import socket
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import pairwise
from threading import Event
from typing import Any
from urllib.parse import quote

import pytest
from lark import UnexpectedInput

from abb_protocols.robot.joints import CYCLE, Side
from abb_protocols.rws.operations import modules as operations
from abb_runtime.clock import ManualClock
from digest_client import authorization
from free_ports import free_tcp_port
from rws_examples_2 import BASIC, PASSWORD, USER
from virtual_irc5.background import Background
from virtual_irc5.pace import LONGEST_LAG, TIME_TO_ANSWER, Pace
from virtual_irc5.rapid import compiler, loading, parser
from virtual_irc5.rapid.parser import parse_module
from virtual_irc5.rapid.states import Execution, SystemEvent
from virtual_irc5.rapid.types import RapidSyntaxError
from virtual_irc5.rws import modules
from virtual_irc5.rws import rapid as rws_rapid
from virtual_irc5.rws.http import HttpReply, HttpRequest
from virtual_irc5.rws.router import Router
from virtual_irc5.rws.rws_call import RwsCall
from virtual_irc5.rws.version_2 import RwsService2
from virtual_irc5.server import VirtualController
from virtual_irc5.world import World, WorldSettings


@pytest.fixture(autouse=True)
def _modules_of_all_tests_stay_frozen(monkeypatch: pytest.MonkeyPatch) -> None:
    """A controller that ends has the collector look at whatever its process has loaded: here, at all tests."""
    monkeypatch.setattr("virtual_irc5.server.release_process", lambda: None)


@pytest.fixture
def background() -> Iterator[Background]:
    background = Background()
    background.start()
    yield background
    background.stop()


def test_work_gives_what_it_returns_or_raises(background: Background) -> None:
    assert background.submit(lambda: 1 + 1).result(5.0) == 2
    with pytest.raises(ZeroDivisionError):
        background.submit(lambda: 1 / 0).result(5.0)


def test_collector_goes_on_beside_long_work(background: Background) -> None:
    """And nothing is hidden from it for ever, however long the work took."""
    before = gc.get_freeze_count()
    assert background.submit(lambda: (Event().wait(0.15), gc.isenabled())[1]).result(5.0)
    background.submit(lambda: None).result(5.0)
    assert gc.get_freeze_count() == before


def test_module_that_is_not_rapid_keeps_nothing_of_the_parser(background: Background) -> None:
    """Who asks again gets the same sentence; the parser's state takes a hundred times as much memory."""
    work = partial(parse_module, "MODULE broken\n" + "VAR num x;\n" * 100 + "VAR;\nENDMODULE", "broken.mod")
    for _ in range(2):
        with pytest.raises(RapidSyntaxError, match=r"broken\.mod:102:4: found ';' where a name is allowed"):
            background.submit(work).result(5.0)
    background.submit(lambda: None).result(5.0)
    gc.collect()
    assert [each for each in gc.get_objects() if isinstance(each, UnexpectedInput)] == []


def test_work_that_was_cancelled_is_not_begun_and_others_are(background: Background) -> None:
    """A client that goes while its module waits to be parsed takes nothing with it."""
    release, done = Event(), []
    first = background.submit(lambda: release.wait(5.0))
    given_up = background.submit(lambda: done.append("given up"))
    last = background.submit(lambda: done.append("last"))
    assert given_up.cancel()
    release.set()
    last.result(5.0)
    assert (first.result(5.0), done) == (True, ["last"])


def test_text_of_a_module_is_quoted_once_for_all_who_read_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a long one that takes longer than a cycle, in which the world stands still."""
    texts: list[str] = []
    monkeypatch.setattr(operations, "quote", lambda text, **how: texts.append(text) or quote(text, **how))
    rws_rapid.quoted_module_text.cache_clear()
    controller = World().controller
    options = (("resource", "module-text"), ("task", "T_ROB_L"))
    path = ("rw", "rapid", "modules", "TRobMain")
    route, names = Router(modules.ROUTES).find("GET", path, options)
    call = RwsCall("GET", path, options, names=names)
    pages = [route.handler(controller, call) for _ in range(3)]
    assert (len(texts), pages[1:]) == (1, pages[:-1])


def test_module_that_is_parsed_in_the_background_is_quoted_there_too(background: Background) -> None:
    background.submit(partial(rws_rapid._parsed, "MODULE once ENDMODULE", "once.mod")).result(5.0)
    hits = rws_rapid.quoted_module_text.cache_info().hits
    assert rws_rapid.quoted_module_text("MODULE once ENDMODULE") == "MODULE%20once%20ENDMODULE"
    assert rws_rapid.quoted_module_text.cache_info().hits == hits + 1


@pytest.fixture
def pace(clock: ManualClock) -> Pace:
    return Pace(clock)


def test_cycles_keep_their_times_whatever_they_take(pace: Pace, clock: ManualClock) -> None:
    begin = clock.now()
    for number, taken in enumerate((0.1, 0.6, 0.3), start=1):
        clock.advance(taken * CYCLE)
        pace.wait()
        assert clock.now() - begin == pytest.approx(number * CYCLE)


def test_a_late_cycle_is_caught_up_and_its_datagrams_can_be_answered(pace: Pace, clock: ManualClock) -> None:
    begin, taken, begins = clock.now(), 0.1 * CYCLE, []
    clock.advance(2.0 * CYCLE)
    for _ in range(6):
        pace.wait()
        begins.append(clock.now() - begin)
        clock.advance(taken)
    assert begins[0] == pytest.approx(2.0 * CYCLE + TIME_TO_ANSWER)
    assert min(after - before for before, after in pairwise(begins)) == pytest.approx(taken + TIME_TO_ANSWER)
    assert begins[-1] == pytest.approx(6.0 * CYCLE)


def test_what_a_machine_that_stood_still_has_missed_is_let_go(pace: Pace, clock: ManualClock) -> None:
    clock.advance(CYCLE + LONGEST_LAG)
    pace.wait()
    begin = clock.now()
    pace.wait()
    assert clock.now() - begin == pytest.approx(CYCLE)


@pytest.mark.parametrize("speed", [0.5, 5.0])
def test_robot_that_is_faster_or_slower_than_real_time_begins_its_cycles_accordingly(
    clock: ManualClock, speed: float
) -> None:
    pace, begin = Pace(clock, speed), clock.now()
    for _ in range(4):
        clock.advance(0.1 * CYCLE / speed)
        pace.wait()
    assert clock.now() - begin == pytest.approx(4 * CYCLE / speed)


def run_in_thread(virtual: VirtualController, over: Event, on_ready: Callable[[int], None] = lambda port: None) -> None:
    """Until ``over``: the thread that runs it has real-time priority afterwards, as its own process would."""
    with ThreadPoolExecutor(1) as pool:
        pool.submit(virtual.run, over, on_ready).result()


def running_program(body: str, **options: Any) -> VirtualController:
    """A controller whose left arm's task is to execute ``body`` in main, ten times as fast as a real one."""
    virtual = VirtualController(
        WorldSettings(),
        rws_port=0,
        user="user",
        password="password",
        host="127.0.0.1",
        is_started=True,
        speed=10.0,
        **options,
    )
    task = virtual.world.controller.tasks["T_ROB_L"]
    task.lose_pp()
    for module in task.modules:
        task.unload(module.name)
    task.load(f"MODULE First VAR socketdev listener; VAR num n; PROC main() {body} ENDPROC ENDMODULE", "first.mod")
    virtual.world.controller.execution.move_pp_to_main()
    return virtual


def test_controller_is_ready_once_a_program_listens_that_does_so_before_it_waits() -> None:
    """Also when what it does before takes more than one cycle; each cycle executes two thousand steps at most."""
    over, port, connected = Event(), free_tcp_port(), []
    virtual = running_program(
        f"""FOR i FROM 1 TO 20000 DO n:=n+i; ENDFOR
        SocketCreate listener; SocketBind listener, "192.168.125.1", {port}; SocketListen listener;
        WHILE TRUE DO WaitTime 1; ENDWHILE"""
    )

    def connect(_: int) -> None:
        with socket.create_connection(("127.0.0.1", port), timeout=5.0) as client:
            connected.append(client.getpeername())
        over.set()

    run_in_thread(virtual, over, connect)
    assert connected == [("127.0.0.1", port)]


def test_controller_is_ready_though_a_program_never_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    over, cycles = Event(), []
    monkeypatch.setattr("virtual_irc5.server.LONGEST_BEGINNING", 0.4)
    virtual = running_program("WHILE TRUE DO n:=n+1; ENDWHILE")
    exchange = virtual.world.exchange
    monkeypatch.setattr(virtual.world, "exchange", lambda inboxes: cycles.append(1) or exchange(inboxes))
    run_in_thread(virtual, over, lambda port: over.set())
    assert len(cycles) == pytest.approx(0.4 / CYCLE, abs=2)


def until(virtual: VirtualController, is_over: Callable[[], bool], monkeypatch: pytest.MonkeyPatch) -> None:
    """Run a controller for as many cycles as something takes."""
    over, exchange = Event(), virtual.world.exchange

    def cycle(inboxes: object) -> object:
        outgoing = exchange(inboxes)  # type: ignore[arg-type]
        if is_over():
            over.set()
        return outgoing

    monkeypatch.setattr(virtual.world, "exchange", cycle)
    run_in_thread(virtual, over)


def test_program_that_runs_once_is_shown_what_it_writes_and_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[tuple[str, str]] = []
    virtual = running_program(
        r'TPWrite "Hello "\Num:=2; n:=n+1;', runs_once=True, show=lambda *line: shown.append(line)
    )
    task = virtual.world.controller.tasks["T_ROB_L"]
    until(virtual, lambda: task.execution is Execution.READY, monkeypatch)
    assert (shown, task.read("First", "n")) == ([("T_ROB_L", "Hello 2")], "1")


def test_program_that_is_started_with_the_controller_stops_at_breakpoints(monkeypatch: pytest.MonkeyPatch) -> None:
    virtual = running_program("n:=1; n:=2; WaitTime 10;")
    task = virtual.world.controller.tasks["T_ROB_L"]
    task.set_breakpoint("First", 1)
    until(virtual, lambda: task.execution is Execution.STOPPED, monkeypatch)
    assert task.read("First", "n") == "1", "it has stopped before the second statement of the line"


def test_controller_without_a_program_that_runs_is_ready_before_its_first_cycle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    over, cycles = Event(), []
    virtual = VirtualController(WorldSettings(), rws_port=0, user="user", password="password", host="127.0.0.1")
    monkeypatch.setattr(virtual.world, "exchange", lambda inboxes: cycles.append(1) or [])

    def ready(_: int) -> None:
        assert not cycles
        over.set()

    run_in_thread(virtual, over, ready)


def test_fault_in_a_cycle_stops_rapid_and_is_logged_once_but_ends_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    virtual = VirtualController(WorldSettings(), rws_port=0, user="user", password="password", host="127.0.0.1")
    controller, over, cycles = virtual.world.controller, Event(), []
    controller.set_motors(True)
    controller.start_rapid()

    def fail(_: object) -> None:
        cycles.append(1)
        if len(cycles) == 3:
            over.set()
        raise ZeroDivisionError("a slip")

    monkeypatch.setattr(virtual.world, "exchange", fail)
    run_in_thread(virtual, over)
    faults = [each for each in controller.events.entries() if each.title == "System error"]
    assert (len(cycles), controller.execution.is_running) == (3, False)
    assert [each.description for each in faults] == ["ZeroDivisionError: a slip"]


def test_device_without_an_address_is_logged_once_and_ends_no_process(monkeypatch: pytest.MonkeyPatch) -> None:
    virtual = VirtualController(WorldSettings(), rws_port=0, user="user", password="password", host="127.0.0.1")
    controller, over, cycles = virtual.world.controller, Event(), []

    def departures(_: object) -> list[tuple[Side, bytes, bool]]:
        controller.effective.change("SIO", "COM_TRP", "ROB_L", {"RemotePortNumber": "70000"})
        cycles.append(1)
        if len(cycles) == 3:
            over.set()
        return [(Side.LEFT, b"datagram", False)]

    monkeypatch.setattr(virtual.world, "exchange", departures)
    run_in_thread(virtual, over)
    sentences = [each.description for each in controller.events.entries() if each.code == 41830]
    assert sentences == ["The UDPUC device ROB_L has the port '70000'; use 1 to 65535."]


LOAD = {False: "/rw/rapid/tasks/T_ROB_L?action=loadmod", True: "/rw/rapid/tasks/T_ROB_L/loadmod"}
Served = tuple[VirtualController, tuple[str, str]]


@pytest.fixture(params=[False, True], ids=["1.0", "2.0"])
def served(request: pytest.FixtureRequest) -> Iterator[Served]:
    """A controller that does not run, and the cookies of a client that is logged in."""
    virtual = VirtualController(
        WorldSettings(), rws_port=0, user=USER, password=PASSWORD, host="127.0.0.1", is_robotware_7=request.param
    )
    credentials = BASIC
    if not request.param:
        challenge = answered(virtual, HttpRequest("GET", "/rw")).header("WWW-Authenticate") or ""
        credentials = authorization(challenge, user=USER, password=PASSWORD, method="GET", uri="/rw")
    headers = (("Authorization", credentials), ("Accept", "application/xhtml+xml;v=2.0"))
    cookies = answered(virtual, HttpRequest("GET", "/rw", headers)).headers
    yield virtual, ("Cookie", "; ".join(text.partition(";")[0] for name, text in cookies if name == "Set-Cookie"))
    for link in (*virtual._links.values(), *virtual._foreign_links.values()):
        link.close()


def answered(virtual: VirtualController, request: HttpRequest) -> HttpReply:
    reply = virtual._handle(request)
    assert isinstance(reply, HttpReply)
    return reply


@pytest.mark.parametrize("path", ["HOME/once.mod", "$home/once.mod", "HOME:/once.mod"])
def test_module_is_prepared_however_its_path_is_spelled(served: Served, path: str) -> None:
    virtual, cookie = served
    virtual.world.controller.files["HOME:/once.mod"] = "MODULE once ENDMODULE"
    target = LOAD[isinstance(virtual._service, RwsService2)]
    assert virtual._prepare(HttpRequest("POST", target, (cookie,), f"modulepath={path}".encode())) is not None
    for wrong in ("HOME/../once.mod", "nowhere/once.mod", ""):
        assert virtual._prepare(HttpRequest("POST", target, (cookie,), f"modulepath={wrong}".encode())) is None


@pytest.mark.parametrize("action", ["loadmod", "resetpp", "set"])
def test_action_on_no_resource_is_not_prepared(served: Served, action: str) -> None:
    virtual, cookie = served
    request = HttpRequest("POST", f"/?action={action}", (cookie,), b"modulepath=HOME:/x.mod")
    assert virtual._prepare(request) is None


_EARLY = "MODULE early\n  PROC p()\n    x := 1;\n  ENDPROC\n  VAR num x;\nENDMODULE\n"
_LATE = _EARLY.replace("1", "2")
_TASK_1, _MODULES_1 = "/rw/rapid/tasks/T_ROB_L", "/rw/rapid/modules/early"
LOADS = {  # targets of 1.0 and 2.0, form
    "set-module-text": (
        f"{_MODULES_1}?task=T_ROB_L&action=set-module-text",
        f"{_TASK_1}/modules/early/text",
        f"text={quote(_LATE)}",
    ),
    "set-text-range": (
        f"{_MODULES_1}?action=set-text-range",
        f"{_TASK_1}/modules/early/text/range",
        "task=T_ROB_L&replace-mode=Replace&query-mode=Force&startrow=3&startcol=10&endrow=3&endcol=10&text=2",
    ),
    "loadprog": (
        f"{_TASK_1}/program?action=loadprog",
        f"{_TASK_1}/program/load",
        "progpath=HOME:/late.pgf&loadmode=replace",
    ),
    "loadmod": (f"{_TASK_1}?action=loadmod", f"{_TASK_1}/loadmod", "modulepath=HOME:/late.mod&replace=true"),
}


@pytest.mark.parametrize("name", LOADS)
def test_no_module_is_parsed_or_compiled_while_the_world_waits(
    served: Served, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Under the lock of the world it is only put in its place, so that EGM goes on."""
    virtual, cookie = served
    is_2 = isinstance(virtual._service, RwsService2)
    task, files = virtual.world.controller.tasks["T_ROB_L"], virtual.world.controller.files
    task.load(_EARLY, "HOME:/early.mod")
    task.move_pp_to_main()
    task.event_routines = {SystemEvent.RESET: ("p",)}
    late = f"{_LATE}! {name} {is_2}"  # which nobody has parsed before
    files["HOME:/late.mod"] = late
    files["HOME:/late.pgf"] = "<Program><Module>late.mod</Module></Program>"
    kind = "application/x-www-form-urlencoded" + (";v=2.0" if is_2 else "")
    headers = (cookie, ("Content-Type", kind), ("Accept", "application/xhtml+xml;v=2.0"))
    mastership = "/rw/mastership/request" if is_2 else "/rw/mastership?action=request"
    assert answered(virtual, HttpRequest("POST", mastership, headers)).status == 204
    work: list[bool] = []
    for owner, function in ((parser, "_parse"), (compiler, "compile_routine"), (loading, "compile_routine")):
        real = getattr(owner, function)

        def noted(*arguments: object, real: Callable[..., object] = real) -> object:
            work.append(virtual._lock.locked())
            return real(*arguments)

        monkeypatch.setattr(owner, function, noted)
    *targets, form = LOADS[name]
    target = targets[is_2]
    request = HttpRequest("POST", target, headers, form.replace(quote(_LATE), quote(late)).encode())
    virtual._background.start()
    try:
        preparation = virtual._prepare(request)
        assert preparation is not None
        preparation.result(5.0)
        reply = answered(virtual, request)
        assert reply.status in (200, 204), reply.body
    finally:
        virtual._background.stop()
    assert "x := 2;" in next(each.text for each in task.modules if each.name == "early")
    assert work, "it was parsed"
    assert True not in work


def test_module_with_characters_that_no_file_has_is_prepared(served: Served) -> None:
    virtual, cookie = served
    virtual.world.controller.tasks["T_ROB_L"].load(_EARLY, "HOME:/early.mod")
    target = LOADS["set-module-text"][isinstance(virtual._service, RwsService2)]
    request = HttpRequest("POST", target, (cookie,), f"text={quote(_LATE + '! costs 5 €')}".encode())
    virtual._background.start()
    try:
        preparation = virtual._prepare(request)
        assert preparation is not None
        preparation.result(5.0)
    finally:
        virtual._background.stop()
    assert rws_rapid.quoted_module_text("! 5 €") == "%21%205%20%3F"


def test_preparation_that_fails_leaves_the_answer_to_the_handler(
    served: Served, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    virtual, cookie = served
    virtual.world.controller.files["HOME:/once.mod"] = "MODULE once ENDMODULE"

    def fail(*_: object, **__: object) -> None:
        raise ZeroDivisionError("by zero")

    monkeypatch.setattr(rws_rapid, "prepare_modules", fail)
    target = LOAD[isinstance(virtual._service, RwsService2)]
    request = HttpRequest("POST", target, (cookie,), b"modulepath=HOME:/once.mod")
    virtual._background.start()
    try:
        preparation = virtual._prepare(request)
        assert preparation is not None
        with caplog.at_level("INFO"):
            assert preparation.result(5.0) is None
    finally:
        virtual._background.stop()
    assert "ZeroDivisionError: by zero" in caplog.text


@pytest.mark.parametrize("action", ["set-pp-routine", "set-pp-routine-from-url"])
def test_moving_a_pointer_is_prepared(served: Served, action: str) -> None:
    virtual, cookie = served
    end = action.removeprefix("set-pp-")
    target = f"/pcp/{end}" if isinstance(virtual._service, RwsService2) else f"/pcp?action={action}"
    form = b"module=TRobMain&routine=main&routineurl=main&line=1&column=1"
    assert virtual._prepare(HttpRequest("POST", _TASK_1 + target, (cookie,), form)) is not None


def test_form_with_a_module_may_be_long_and_others_may_not(served: Served) -> None:
    virtual, cookie = served
    text = LOADS["set-module-text"][isinstance(virtual._service, RwsService2)]
    limits = [virtual._body_limit(HttpRequest("POST", target, (cookie,))) for target in (text, "/rw/elog", "/nowhere")]
    assert limits[0] > 3 * parser.LONGEST_MODULE > limits[1] == limits[2]
    assert virtual._body_limit(HttpRequest("POST", text)) == 0
