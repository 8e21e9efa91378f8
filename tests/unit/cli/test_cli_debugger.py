"""``yumi rapid debug`` against the whole virtual controller, in virtual time."""

from __future__ import annotations

import io
import math
from contextlib import nullcontext

import pytest
from click.testing import CliRunner

from memory_http import MemoryHttp
from yumi.cli.main import main
from yumi.cli.rapid import Debugger
from yumi.clock import ManualClock
from yumi.robot.joints import CYCLE
from yumi.rws.client import RwsClient
from yumi.rws.types import Code
from yumi.virtual.rws.operations import Call, Failure, Operation
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
    """A debugger whose waiting lets the controller go on.

    Attributes:
        questions: what it has asked.
        answer: to them.
        interrupt_at: when a wait ends with Ctrl-C [s].
    """

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
        self.http = MemoryHttp(controller, self)
        self.output = io.StringIO()
        self.questions: list[str] = []
        self.answer, self.interrupt_at = True, math.inf
        self.client = RwsClient(self.http, clock=self)
        self.debugger = Debugger(self.client, "T_ROB_R", self, self.output, self._confirm)

    def _confirm(self, question: str) -> bool:
        self.questions.append(question)
        return self.answer

    def wait(self, seconds: float) -> None:
        if self.now() >= self.interrupt_at:
            self.interrupt_at = math.inf
            raise KeyboardInterrupt
        for _ in range(max(1, round(seconds / CYCLE))):
            self.advance(CYCLE)
            self.world.cycle({})
            self.http.advance()

    def enter(self, command: str) -> str:
        """What a command answers, without the line's end."""
        begin = len(self.output.getvalue())
        self.debugger.onecmd(command)
        return self.output.getvalue()[begin:].rstrip()

    def type(self, monkeypatch: pytest.MonkeyPatch, *lines: str) -> list[str]:
        """What is said when lines are typed at the prompt, of which ^C is Ctrl-C."""
        typed = iter(lines)

        def read(prompt: str) -> str:
            if (line := next(typed)) == "^C":
                raise KeyboardInterrupt
            return line

        monkeypatch.setattr("builtins.input", read)
        self.debugger.cmdloop()
        assert next(typed, None) is None, "it has left before all was typed"
        return self.output.getvalue().splitlines()

    @property
    def is_running(self) -> bool:
        return self.world.controller.execution.is_running


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
    begin = session.now()
    assert session.enter("continue").startswith("running; `stop` stops it")
    assert session.now() - begin < 1.5, "`stop` cannot be entered yet"
    assert session.enter("stop") == "Program/main, line 8: WaitTime 60;"
    assert not session.is_running


@pytest.mark.parametrize("command", ["step", "continue"])
def test_interrupt_while_a_command_waits_stops_rapid_and_gives_the_prompt_back(
    session: Session, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    session.type(monkeypatch, "main", "next", "next", "next", "quit")
    session.interrupt_at = session.now() + 0.2
    said = session.type(monkeypatch, command, "print count", "quit")
    assert said[-2:] == ["Program/main, line 8: WaitTime 60;", "count = 2"]
    assert not session.is_running


def test_interrupt_at_the_prompt_stops_what_goes_on_and_then_leaves(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = session.type(monkeypatch, "main", "continue", "^C", "quit")
    assert said[-1] == "Program/main, line 8: WaitTime 60;"
    assert not session.is_running
    with pytest.raises(KeyboardInterrupt):
        session.type(monkeypatch, "^C")


def test_interrupt_leaves_what_was_not_started_here_running(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    session.enter("main")
    session.world.controller.start_rapid()
    session.wait(0.1)
    with pytest.raises(KeyboardInterrupt):
        session.type(monkeypatch, "step", "where", "^C")
    assert session.is_running


def test_interrupt_ends_commands_from_a_pipe_with_rapid_stopped(session: Session) -> None:
    session.interrupt_at = session.now() + 0.5
    commands = io.StringIO("main\ncontinue\nset count 7\n")
    with pytest.raises(KeyboardInterrupt):
        Debugger(session.client, "T_ROB_R", session, session.output, lambda _: True, commands).cmdloop()
    assert not session.is_running
    assert session.enter("print count") == "count = 2"


def test_first_start_is_confirmed(session: Session) -> None:
    session.enter("main")
    session.answer = False
    assert session.enter("step").startswith("Not started. This starts T_ROB_R and T_ROB_L, and arms may move.")
    assert session.enter("where") == "#0 Program/main, line 5"
    session.answer = True
    assert session.enter("step") == "Program/main, line 6: add_one;"
    assert session.enter("next") == "Program/main, line 7: add_one;"
    assert session.questions == 2 * ["This starts T_ROB_R and T_ROB_L, and arms may move. Is their workspace free?"]


@pytest.mark.parametrize(("options", "line"), [([], "main, line 5"), (["--yes"], "main, line 6")])
def test_commands_from_a_pipe_start_with_yes_only(
    session: Session, monkeypatch: pytest.MonkeyPatch, options: list[str], line: str
) -> None:
    monkeypatch.setattr("yumi.cli.controller.RwsClient", lambda *_, **__: nullcontext(session.client))
    monkeypatch.setattr("yumi.cli.rapid.SystemClock", lambda: session)
    result = CliRunner().invoke(main, ["rapid", "debug", "T_ROB_R", *options], input="main\nstep\nwhere\n")
    assert result.output.splitlines()[-1] == f"#0 Program/{line}"
    assert ("Not started." in result.output) is (not options)


def test_lines_are_listed_where_the_controller_does_not_tell_breakpoints(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    session.enter("main")
    find = session.http.adapter._router.find

    def without_breakpoints(call: Call) -> tuple[Operation, Call]:
        if call.path[-1] == "breakpoint" and call.method == "GET":
            raise Failure(404, Code.FAIL, "there is no such resource")
        return find(call)

    monkeypatch.setattr(session.http.adapter._router, "find", without_breakpoints)
    assert session.enter("list").splitlines()[4] == "    5 ->         count:=0;"
    assert "refused" in session.enter("break Program:6")


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
