"""``yumi rapid debug`` against the whole virtual controller, in virtual time."""

from __future__ import annotations

import io
import math
from collections.abc import Mapping, Sequence
from contextlib import nullcontext

import pytest
from click.testing import CliRunner

from abb_protocols.catalogue import Message, message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import CommandRefused
from abb_protocols.robot.joints import CYCLE
from abb_protocols.rws.documents import Pairs
from abb_protocols.rws.values import RunCycle, RwsCode
from abb_runtime.clock import ManualClock
from abb_runtime.rws.client import RwsClient
from memory_http import MemoryHttp
from refusals import refused
from virtual_irc5.commands.debugger import Debugger
from virtual_irc5.rws.router import Route
from virtual_irc5.rws.rws_call import CallFailure
from virtual_irc5.world import World
from yumi.cli.main import main

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
LOOPS = r"""MODULE Loops
    PROC main()
        VAR num total:=0;
        FOR i FROM 1 TO 3 DO
            add total, i \note:="x";
        ENDFOR
        WHILE TRUE DO
            total:=total+1;
            WaitTime 0.1;
        ENDWHILE
    ENDPROC
    PROC add(INOUT num sum, num n \string note \switch never)
        CONST num factor:=2;
        sum:=sum+factor*n;
    ENDPROC
ENDMODULE
"""


class Session(ManualClock):
    """A debugger whose waiting lets the controller go on.

    Args:
        program: the module of the right arm's task; the left one's has none.

    Attributes:
        questions: what it has asked.
        answer: to them.
        interrupt_at: when a wait ends with Ctrl-C [s].
    """

    def __init__(self, program: str = PROGRAM) -> None:
        super().__init__()
        self.world = World()
        controller = self.world.controller
        for task in (controller.tasks["T_ROB_R"], controller.tasks["T_ROB_L"]):
            task.lose_pp()
            for module in task.modules:
                task.unload(module.name)
        controller.tasks["T_ROB_R"].load(program, "program.mod")
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
    assert session.enter("where") == str(message("task_without_pointer", task="T_ROB_R"))
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


def test_breakpoint_stays_until_it_is_cleared(session: Session) -> None:
    for _ in range(2):
        assert session.enter("break program:12") == "breakpoints: Program:12"
    session.enter("break Program:6")
    assert session.enter("break Program:7") == "breakpoints: Program:6, Program:7, Program:12"
    assert session.enter("clear Program:12") == "breakpoints: Program:6, Program:7"
    session.enter("main")
    assert session.enter("continue") == "Program/main, line 6: add_one;"
    assert session.enter("clear").splitlines() == [
        "Program:6 stays: the program stands there, and a controller would lose the program pointer with it; `next` "
        "first, then `clear Program:6`.",
        "breakpoints: Program:6",
    ]
    session.enter("next")
    assert session.enter("clear") == "breakpoints: none"
    assert session.enter("where") == "#0 Program/main, line 7", "the program pointer is where it was"
    assert session.enter("clear Program:6") == str(message("no_breakpoint", module="Program", line=6, breakpoints=()))


def test_breakpoint_that_is_set_while_the_program_runs_is_hit() -> None:
    session = Session(LOOPS)
    session.enter("main")
    assert session.enter("continue").startswith("running;")
    assert session.enter("break Loops:8").splitlines() == [
        "breakpoints: Loops:8",
        "Loops/main, line 8: total:=total+1;",
        f"    total = {session.world.controller.tasks['T_ROB_R'].read('Loops/main', 'total')}",
    ]
    assert not session.is_running


def test_stop_that_comes_later_is_said_before_the_next_command(session: Session) -> None:
    session.enter("main")
    session.enter("continue")
    session.world.controller.stop_rapid()
    session.wait(0.1)
    assert session.enter("print count").splitlines() == ["Program/main, line 8: WaitTime 60;", "", "count = 2"]
    assert session.enter("print count") == "count = 2"


def test_prompt_begins_with_what_others_have_left(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    session.enter("main")
    session.enter("break Program:12")
    session.world.controller.start_rapid()
    session.wait(0.02)
    assert session.type(monkeypatch, "quit")[-2:] == [
        "T_ROB_R is running; `stop` stops RAPID.",
        "breakpoints: Program:12",
    ]


def test_locals_and_parameters_are_read_and_set_where_the_program_stands() -> None:
    session = Session(LOOPS)
    session.enter("main")
    session.enter("break Loops:14")
    assert session.enter("continue").splitlines() == [
        "Loops/add, line 14: sum:=sum+factor*n;",
        '    sum = 0, n = 1, note = "x", factor = 2',
    ]
    assert session.enter("continue").splitlines()[1] == '    sum = 2, n = 2, note = "x", factor = 2'
    assert session.enter("locals").splitlines() == ["sum = 2", "n = 2", 'note = "x"', "factor = 2"]
    assert session.enter("locals 1").splitlines() == ["total = 2", "i = 2"]
    assert session.enter("print N") == "N = 2"
    assert session.enter("print Loops/main/i") == "i = 2"
    assert session.enter("print") == 'sum = 2\nn = 2\nnote = "x"\nfactor = 2'
    assert session.enter("set n 20") == "n = 20"
    assert session.enter("set factor 3") == str(message("constant_not_set", name="factor"))
    assert session.enter("out").splitlines()[-1] == "    total = 42, i = 2"
    assert session.enter("set i 7") == str(message("loop_variable_not_set", name="i"))
    session.enter("clear")
    for _ in range(3):  # the loop's head, what is in it, and its head
        session.enter("next")
    assert session.enter("locals") == "total = 48", "the loop has ended, and its variable with it"
    assert session.enter("locals 1") == str(message("no_frame", number=1))


def test_values_of_locals_are_cut_where_the_program_stops() -> None:
    text = "MODULE Long\nPROC main()\nVAR num a{40};\n" + "".join(f"VAR num n{i};\n" for i in range(9))
    session = Session(f"{text}WaitTime 1;\nENDPROC\nENDMODULE")
    session.enter("main")
    session.enter("break Long:13")
    said = session.enter("continue").splitlines()[1]
    assert said == f"    a = [{'0,' * 14}0…, {', '.join(f'n{i} = 0' for i in range(7))}, … (`locals` shows all)"
    assert session.enter("print a{3}") == "a{3} = 0"
    assert session.enter("set a{3} 5") == "a{3} = 5"
    assert session.enter("print a").startswith("a = [0,0,5,0,")


def test_program_that_runs_once_ends() -> None:
    session = Session("MODULE Brief\nPROC main()\nWaitTime 0.1;\nENDPROC\nENDMODULE")
    once = Debugger(session.client, "T_ROB_R", session, session.output, lambda _: True, cycle=RunCycle.ONCE)
    once.onecmd("main")
    once.onecmd("continue")
    assert session.output.getvalue().splitlines()[1:] == ["The program has ended.", "Brief/main, line 3: WaitTime 0.1;"]


def test_help_lists_each_command_in_a_line(session: Session) -> None:
    said = session.enter("help").splitlines()
    assert "step: execute one statement, and enter the routine it calls." in said
    assert "break [MODULE:LINE]: stop before that line; alone, it lists the breakpoints." in said
    assert not [line for line in said if "EOF" in line or "ndocumented" in line]
    assert session.enter("help jump") == str(message("debugger_command_unknown", command="jump"))
    assert session.enter("help next") == "next: execute one statement, with the routines it calls."


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


def test_interrupt_at_the_prompt_stops_what_goes_on_and_then_nothing_more(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = session.type(monkeypatch, "main", "continue", "^C", "^C", "quit")
    assert said[-3:] == ["Program/main, line 8: WaitTime 60;", "", "`quit` leaves, and so does Ctrl-D."]
    assert not session.is_running


def test_interrupt_leaves_what_was_not_started_here_running(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    session.enter("main")
    session.world.controller.start_rapid()
    session.wait(0.1)
    said = session.type(monkeypatch, "step", "where", "^C", "quit")
    assert str(message("task_is_running", task="T_ROB_R")) in said
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
    assert session.enter("step") == str(message("start_not_confirmed", tasks=("T_ROB_R",)))
    assert session.enter("where") == "#0 Program/main, line 5"
    session.answer = True
    assert session.enter("step") == "Program/main, line 6: add_one;"
    assert session.enter("next") == "Program/main, line 7: add_one;"
    assert session.questions == 2 * ["This starts T_ROB_R, and arms may move. Is their workspace free?"]


def test_all_tasks_that_start_are_named(session: Session) -> None:
    session.world.controller.tasks["T_ROB_L"].load(PROGRAM, "program.mod")
    session.enter("main")
    session.enter("step")
    assert session.questions == ["This starts T_ROB_R and T_ROB_L, and arms may move. Is their workspace free?"]


@pytest.mark.parametrize(("options", "line"), [([], "main, line 5"), (["--yes"], "main, line 6")])
def test_commands_from_a_pipe_start_with_yes_only(
    session: Session, monkeypatch: pytest.MonkeyPatch, options: list[str], line: str
) -> None:
    monkeypatch.setattr("yumi.driver.settings.RwsClient", lambda *_, **__: nullcontext(session.client))
    monkeypatch.setattr("virtual_irc5.commands.debugger.SystemClock", lambda: session)
    result = CliRunner().invoke(main, ["rapid", "debug", "T_ROB_R", *options], input="main\nstep\nwhere\n")
    assert result.output.splitlines()[-1] == f"#0 Program/{line}"
    assert (sentence(message("start_not_confirmed", tasks=("T_ROB_R",)), FrontEnd.SHELL) in result.output) is (
        not options
    )


def test_lines_are_listed_where_the_controller_does_not_tell_breakpoints(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    session.enter("main")
    find = session.http.adapter._router.find

    def without_breakpoints(method: str, path: Sequence[str], query: Pairs) -> tuple[Route, Mapping[str, str]]:
        if path[-1] == "breakpoint":
            raise CallFailure(404, RwsCode.FAIL, "there is no such resource")
        return find(method, path, query)

    monkeypatch.setattr(session.http.adapter._router, "find", without_breakpoints)
    assert session.enter("list").splitlines()[4] == "    5 ->         count:=0;"
    assert session.enter("break Program:6") == str(message("no_breakpoints_here"))


@pytest.mark.parametrize(
    ("command", "answer"),
    [
        ("jump", message("debugger_command_unknown", command="jump")),
        ("set count", message("datum_and_value_expected")),
        ("break 12", message("place_expected", command="break", argument="12")),
        ("break Other:3", message("module_unknown", task="T_ROB_R", module="Other", modules=("Program",))),
        ("break Program:99", message("line_beyond_module", module="Program", count=14, line=99)),
        ("break Program:9", message("no_statement_at_line", line=9, module="Program", text="ENDPROC")),
        ("clear Program", message("place_expected", command="clear", argument="Program")),
        ("print Program/nothing", message("no_datum", name="nothing", block="Program")),
        ("set Program/count three", message("no_value_of_datum", value="three", name="count", type="num")),
        ("set Program/nothing 3", message("no_datum", name="nothing", block="Program")),
        ("locals first", message("frame_number_expected", argument="first")),
        ("locals", message("task_without_pointer", task="T_ROB_R")),
        ("step", message("task_without_pointer", task="T_ROB_R")),
    ],
)
def test_what_cannot_be_done_is_said_and_the_next_command_can_be_tried(
    session: Session, command: str, answer: Message
) -> None:
    assert session.enter(command) == str(answer)
    assert session.enter("main").startswith("Program/main")


def test_print_names_the_routine_and_the_module_that_have_no_such_datum(session: Session) -> None:
    session.enter("main")
    said = message("no_datum_in_routine", name="nothing", module="Program", routine="main")
    assert session.enter("print nothing") == str(said)


@pytest.mark.parametrize("command", ["step", "continue", "main", "clear Program:12"])
def test_what_needs_a_stop_is_refused_while_rapid_runs(session: Session, command: str) -> None:
    session.enter("main")
    session.enter("break Program:12")
    session.enter("next")  # which confirms the start
    session.enter("continue")
    session.enter("continue")
    assert session.enter("continue").startswith("running;")
    assert session.enter(command) == str(message("task_is_running", task="T_ROB_R"))
    assert session.is_running


def test_start_is_refused_in_words_while_the_motors_are_off(session: Session) -> None:
    session.enter("main")
    session.world.controller.set_motors(False)
    assert session.enter("step") == str(message("motors_off_for_program", state="motoroff"))


def test_refusal_of_another_task_without_a_pointer_names_that_task(session: Session) -> None:
    session.enter("main")
    session.world.controller.tasks["T_ROB_L"].load(PROGRAM, "program.mod")
    assert session.enter("step") == str(message("tasks_without_pointer", tasks=("T_ROB_L",)))


def test_task_that_the_controller_lacks_is_refused_with_those_it_has(session: Session) -> None:
    with refused(CommandRefused, "task_unknown", task="T_ROB1", tasks=("T_ROB_R", "T_ROB_L")):
        Debugger(session.client, "T_ROB1", session, session.output, lambda _: True, io.StringIO("")).cmdloop()
