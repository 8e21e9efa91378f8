"""``yumi rapid debug`` against the whole virtual controller, in virtual time."""

from __future__ import annotations

import io

import pytest

from memory_http import MemoryHttp
from yumi.cli.debugger import Debugger
from yumi.clock import ManualClock
from yumi.robot.joints import CYCLE
from yumi.rws.client import RwsClient
from yumi.virtual.world import World

PROGRAM = """MODULE Program
    PERS num count:=0;
    VAR string name:="left";
    PROC main()
        count:=0;
        add_one;
        add_one;
        WaitTime 60;
    ENDPROC
    PROC add_one()
        count:=count+1;
        name:="right";
    ENDPROC
ENDMODULE
"""


class Session(ManualClock):
    """A debugger whose waiting lets the controller go on."""

    def __init__(self) -> None:
        super().__init__()
        self.world = World()
        controller = self.world.controller
        for task in (controller.tasks["T_ROB_R"], controller.tasks["T_ROB_L"]):
            task.lose_pp()
            for module in task.modules:
                task.unload(module.name)
        controller.tasks["T_ROB_R"].load(PROGRAM, "program.mod")
        controller.set_motors(True)
        self._http = MemoryHttp(controller, self)
        self._output = io.StringIO()
        self._debugger = Debugger(RwsClient(self._http, clock=self), "T_ROB_R", self, self._output)

    def wait(self, seconds: float) -> None:
        for _ in range(max(1, round(seconds / CYCLE))):
            self.advance(CYCLE)
            self.world.cycle({})
            self._http.advance()

    def enter(self, command: str) -> str:
        """What a command answers, without the line's end."""
        begin = len(self._output.getvalue())
        self._debugger.onecmd(command)
        return self._output.getvalue()[begin:].rstrip()


@pytest.fixture
def session() -> Session:
    return Session()


def test_program_is_stepped_into_over_and_out_of_a_routine(session: Session) -> None:
    assert session.enter("where") == "T_ROB_R has no program pointer; `main` moves it to main"
    assert session.enter("main") == "Program/main, line 5: count:=0;"
    assert session.enter("step") == "Program/main, line 6: add_one;"
    assert session.enter("step") == "Program/add_one, line 11: count:=count+1;"
    assert session.enter("where") == "#0 Program/add_one, line 11\n#1 Program/main, line 6"
    assert session.enter("out") == "Program/main, line 7: add_one;"
    assert session.enter("next") == "Program/main, line 8: WaitTime 60;"
    assert session.enter("print count") == "count = 2"


def test_program_stops_at_a_breakpoint_and_data_are_changed_there(session: Session) -> None:
    session.enter("main")
    assert session.enter("break Program:12") == "breakpoints: Program:12"
    assert session.enter("continue") == 'Program/add_one, line 12: name:="right";'
    assert session.enter("list").splitlines()[4] == '   12 ->         name:="right";'
    assert session.enter("print") == 'count = 1\nname = "left"'
    assert session.enter("set count 41") == "count = 41"
    assert session.enter("continue") == 'Program/add_one, line 12: name:="right";'
    assert session.enter("print count") == "count = 42"
    assert session.enter("break Program:12") == "breakpoints: none"


def test_statement_that_waits_goes_on_until_it_is_stopped(session: Session) -> None:
    session.enter("main")
    assert session.enter("continue").startswith("running; `stop` stops it")
    assert session.enter("stop") == "Program/main, line 8: WaitTime 60;"


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        ("jump", "There is no command 'jump'; help lists them."),
        ("break 12", "break takes a module and a line, such as break Program:12, not '12'."),
        ("set count", "set takes a datum and its value, such as set count 3."),
        ("print Program/nothing", "refused"),
        ("step", "refused"),
    ],
)
def test_what_cannot_be_done_is_said_and_the_next_command_can_be_tried(
    session: Session, command: str, answer: str
) -> None:
    assert answer in session.enter(command)
    assert session.enter("main").startswith("Program/main")
