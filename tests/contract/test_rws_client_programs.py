"""The client brings files and modules to the whole virtual controller, where they run; and restarts it."""

from __future__ import annotations

from threading import Event, Thread

import httpx
import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, ControllerRefused, NoConnection
from abb_protocols.robot.joints import CYCLE
from abb_protocols.rws.operations.files import FileInfo
from abb_protocols.rws.values import ControllerState, ExecutionState, RwsCode
from abb_runtime.clock import ManualClock
from abb_runtime.rws.client import RwsClient
from abb_runtime.rws.session import RwsRequest
from memory_http import MemoryHttp
from refusals import refused
from virtual_irc5.controller.irc5 import RESTART_TIME
from virtual_irc5.world import World

GREETER = """MODULE Greeter
    PERS num greetings:=0;
    PROC greet1()
        greetings:=greetings+1;
    ENDPROC
ENDMODULE
"""
CALLER = r"""MODULE Caller
    PROC main()
        FOR i FROM 1 TO 3 DO
            called i, "part";
        ENDFOR
    ENDPROC
    PROC called(num number, string name \num spare)
        CONST num half:=0.5;
        VAR num list{2};
        WaitTime 10;
    ENDPROC
ENDMODULE
"""
LEFT = "T_ROB_L"
PATH = "HOME:/greeter.mod"


class Plant(ManualClock):
    """The virtual controller and a client; waiting lets both go on."""

    def __init__(self) -> None:
        super().__init__()
        self.world = World()
        self.http = MemoryHttp(self.world.controller, self)
        self.client = RwsClient(self.http, clock=self)

    def wait(self, seconds: float) -> None:
        for _ in range(max(1, round(seconds / CYCLE))):
            self.advance(CYCLE)
            self.world.cycle({})
            self.http.advance()

    def start(self) -> None:
        self.client.set_motors(True)
        self.client.move_pp_to_main()
        self.client.start_rapid()
        self.wait(0.1)


@pytest.fixture
def plant() -> Plant:
    return Plant()


@pytest.fixture
def client(plant: Plant) -> RwsClient:
    return plant.client


def test_file_is_written_read_listed_and_removed(client: RwsClient) -> None:
    client.upload(PATH, GREETER)
    assert client.download(PATH) == GREETER
    assert FileInfo("greeter.mod", len(GREETER)) in client.files("HOME:")
    assert FileInfo("yumi", None) in client.files("HOME:")
    client.delete_file(PATH)
    with refused(ControllerRefused, "rws_refused", what="reading HOME:/greeter.mod"):
        client.download(PATH)


def test_file_that_rapid_could_not_hold_is_refused(client: RwsClient) -> None:
    with refused(CommandRefused, "file_not_latin_1", path="HOME:/greeter.mod", character="五"):
        client.upload(PATH, "! 五")


def test_loaded_module_runs(plant: Plant, client: RwsClient) -> None:
    client.upload(PATH, GREETER)
    client.load_module(LEFT, PATH)
    plant.start()
    client.set_symbol(LEFT, "TRobRAPID", "callbyvar_name_input", '"greet"')
    client.set_symbol(LEFT, "TRobRAPID", "callbyvar_num_input", "1")
    client.set_symbol(LEFT, "TRobRAPID", "routine_name_input", '"runCallByVar"')
    client.pulse_signal("RUN_RAPID_ROUTINE")
    plant.wait(0.2)
    assert client.symbol(LEFT, "Greeter", "greetings") == "1"


def test_module_is_replaced_and_unloaded(client: RwsClient) -> None:
    client.upload(PATH, GREETER)
    client.load_module(LEFT, PATH)
    client.upload(PATH, GREETER.replace(":=0", ":=7"))
    client.load_module(LEFT, PATH)
    assert client.symbol(LEFT, "Greeter", "greetings") == "7"
    client.unload_module(LEFT, "Greeter")
    assert "Greeter" not in [module.name for module in client.modules(LEFT)]


@pytest.mark.parametrize(
    ("text", "replace", "reason"),
    [
        (None, True, "rws_file_not_found"),
        ("hello", True, "rws_syntax"),
        (GREETER.replace(":=0", ":=TRUE"), True, "rws_syntax"),
        (GREETER, False, "rws_module_name_taken"),
    ],
)
def test_module_that_cannot_be_loaded_changes_nothing(
    client: RwsClient, text: str | None, replace: bool, reason: str
) -> None:
    client.upload("HOME:/first.mod", GREETER)
    client.load_module(LEFT, "HOME:/first.mod")
    if text is not None:
        client.upload(PATH, text)
    before = client.modules(LEFT)
    with refused(ControllerRefused, "rws_refused", reason=message(reason)):
        client.load_module(LEFT, PATH, replace=replace)
    assert client.modules(LEFT) == before
    assert client.symbol(LEFT, "Greeter", "greetings") == "0"


def test_text_of_a_loaded_module_is_read_as_it_was_written(client: RwsClient) -> None:
    text = 'MODULE Added\n  ! 100 % + "ümlaut" & a=b\n  CONST string s:="a+b&c%20";\nENDMODULE\n'
    client.upload("HOME:/added.mod", text)
    client.load_module("T_ROB_R", "HOME:/added.mod")
    assert client.module_text("T_ROB_R", "added") == text
    with refused(ControllerRefused, "rws_refused") as caught:
        client.module_text("T_ROB_R", "Other")
    assert "has no module 'Other'" in caught.value.said.values["reason"].values["text"]  # the controller's words


def test_modules_stay_while_rapid_runs(plant: Plant, client: RwsClient) -> None:
    client.upload(PATH, GREETER)
    plant.start()
    for call in (lambda: client.load_module(LEFT, PATH), lambda: client.unload_module(LEFT, "TRobSG")):
        with refused(ControllerRefused, "rws_refused", reason=message("rws_exec_state")):
            call()


def test_unknown_module_is_not_unloaded(client: RwsClient) -> None:
    reason = message("rws_no_such_symbol")
    with refused(ControllerRefused, "rws_refused", what="unloading Nobody from T_ROB_L", reason=reason):
        client.unload_module(LEFT, "Nobody")


def test_mastership_is_given_back_after_a_refusal(plant: Plant, client: RwsClient) -> None:
    with pytest.raises(ControllerRefused):
        client.load_module(LEFT, PATH)
    other = RwsClient(plant.http, clock=plant)
    other.upload(PATH, GREETER)
    other.load_module(LEFT, PATH)


def test_error_of_a_block_is_not_replaced_by_that_of_the_release(
    plant: Plant, client: RwsClient, caplog: pytest.LogCaptureFixture
) -> None:
    def fail() -> None:
        plant.http.is_there = False
        raise CommandRefused("of the block")

    with pytest.raises(CommandRefused, match="of the block"), client.holding("rapid"):
        fail()
    assert "The mastership of rapid may still be held, which locks the FlexPendant out" in caplog.text


def test_refused_release_of_a_mastership_is_an_error(
    plant: Plant, client: RwsClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    exchange = client._session.exchange

    def refusing(request: RwsRequest) -> httpx.Response:
        return httpx.Response(403) if ("action", "release") in request.query else exchange(request)

    other = RwsClient(plant.http, clock=plant)
    release_refused = refused(
        ControllerRefused, "rws_refused_without_code", what="releasing the mastership of rapid", status=403
    )
    with release_refused, client.holding("rapid"):
        monkeypatch.setattr(client._session, "exchange", refusing)
    assert other.mastership("rapid") != ""
    monkeypatch.undo()
    with client.holding("rapid"):  # it is requested again, and released
        pass
    assert other.mastership("rapid") == ""


def test_mastership_that_the_controller_has_ended_needs_no_release(plant: Plant, client: RwsClient) -> None:
    with client.holding("rapid"):
        client.call("POST", "/rw/mastership/rapid", (("action", "release"),))
    assert RwsClient(plant.http, clock=plant).mastership("rapid") == ""


def test_mastership_is_not_released_while_another_thread_comes_to_use_it(
    client: RwsClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    exchange, has_it = client._session.exchange, Event()
    done: list[str] = []

    def hold() -> None:
        with client.holding("rapid"):
            has_it.set()

    other = Thread(target=hold)

    def recorded(request: RwsRequest) -> httpx.Response:
        action = dict(request.query).get("action", "")
        if action == "release" and other.ident is None:  # of the first thread: the other one comes now
            other.start()
            assert not has_it.wait(0.1)
        reply = exchange(request)
        done.append(action)
        return reply

    monkeypatch.setattr(client._session, "exchange", recorded)
    with client.holding("rapid"):
        pass
    other.join(10.0)
    assert done == ["request", "release", "request", "release"]


def test_restart_leaves_motors_off_and_rapid_stopped_with_its_program(plant: Plant, client: RwsClient) -> None:
    plant.start()
    client.set_signal("EGM_STOP", 1)
    client.restart()
    assert client.execution() is ExecutionState.RUNNING
    plant.wait(1.0)
    with pytest.raises(NoConnection):
        client.execution()
    plant.wait(RESTART_TIME)
    assert (client.controller_state(), client.execution()) == (ControllerState.MOTORS_OFF, ExecutionState.STOPPED)
    assert (client.signal("EGM_STOP").value, client.events(count=1)[0].code) == (0, 10045)
    plant.start()
    assert client.symbol(LEFT, "TRobMain", "current_state") == "0"


def test_message_of_the_event_log_has_its_arguments(plant: Plant, client: RwsClient) -> None:
    plant.world.controller.events.append(50204, "Motion supervision", arguments=("ROB_L", "5"))
    assert client.events(count=1)[0].arguments == ("ROB_L", "5")


def test_events_are_cleared(plant: Plant, client: RwsClient) -> None:
    plant.start()
    client.clear_events()
    assert client.events() == ()


def test_file_is_written_again_when_the_connection_breaks() -> None:
    assert RwsRequest("PUT", PATH, content=b"").is_repeatable


@pytest.fixture
def calling(plant: Plant) -> RwsClient:
    """A client whose left arm's task is in a routine that main has called."""
    plant.world.controller.replace_program({"HOME:/caller.mod": CALLER})
    plant.start()
    return plant.client


def test_stack_is_searched_for_what_has_a_value_in_a_routine_under_way(calling: RwsClient) -> None:
    found = calling.find_symbols(f"RAPID/{LEFT}", view="stack", stack=1)
    assert [(each.name, each.kind.value, each.type, each.dimensions, each.is_read_only) for each in found] == [
        ("number", "par", "num", (), False),
        ("name", "par", "string", (), False),
        ("half", "con", "num", (), True),
        ("list", "var", "num", (2,), False),
    ]
    (counter,) = calling.find_symbols(f"RAPID/{LEFT}", view="stack", stack=2)
    assert (counter.address, counter.kind.value) == (f"RAPID/{LEFT}/%2/i", "for")
    with pytest.raises(ControllerRefused) as refused:
        calling.find_symbols(f"RAPID/{LEFT}", view="stack", stack=3)
    assert refused.value.code == RwsCode.NO_PP


@pytest.mark.parametrize(("block", "name", "value"), [("Caller/called", "name", "part"), ("%1", "name", "part"),
                                                      ("%2", "i", 1.0), ("Caller/main", "i", 1.0)])  # fmt: skip
def test_data_of_routines_under_way_are_read_by_their_addresses(
    calling: RwsClient, block: str, name: str, value: object
) -> None:
    assert calling.value(LEFT, block, name) == value


def test_datum_of_a_routine_under_way_is_written_and_a_loop_variable_is_not(calling: RwsClient) -> None:
    calling.set_value(LEFT, "%1", "list{2}", 4.0)
    assert calling.value(LEFT, "Caller/called", "list") == (0.0, 4.0)
    with pytest.raises(ControllerRefused) as refused:
        calling.set_value(LEFT, "%2", "i", 4.0)
    assert refused.value.code == RwsCode.SYNTAX


@pytest.mark.parametrize(("block", "name"), [("Caller/called", "spare"), ("Caller/nothing", "x"), ("%3", "i"),
                                             ("%1", "tool0"), ("Caller/called/name", "x")])  # fmt: skip
def test_what_no_routine_under_way_has_is_not_found(calling: RwsClient, block: str, name: str) -> None:
    with pytest.raises(ControllerRefused) as refused:
        calling.symbol(LEFT, block, name)
    assert (refused.value.status, refused.value.code) == (400, RwsCode.FAIL)
