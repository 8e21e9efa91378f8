"""``yumi rapid``: RAPID programs, checked here or stepped through on a controller; ``yumi answer``: their questions.

A check finds what the language does not allow, and what the virtual controller does not provide. The debugger has
steps, breakpoints, call stack and data of one task, over Robot Web Services.
"""

from __future__ import annotations

import cmd
import json
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import click

from yumi.cli.controller import of_controller
from yumi.cli.options import (
    FILE,
    JsonOutput,
    cfg_option,
    json_option,
    model_option,
    password_options,
    robot_option,
    settings_of,
    user_option,
    yes_option,
)
from yumi.clock import Clock, SystemClock, comes_true
from yumi.errors import CommandRefused, ControllerRefused, RapidError, SettingsError, YumiError
from yumi.rws.client import RwsClient
from yumi.rws.services.rapid import RunCycle, Step
from yumi.rws.types import ExecutionState

if TYPE_CHECKING:
    from yumi.rapid.types import RapidReferenceError


@click.group()
def rapid() -> None:
    """Work on RAPID programs.

    \b
    Examples:
      yumi rapid check pick.mod
      yumi rapid debug T_ROB_R --robot 192.168.125.1
    """


@rapid.command()
@click.argument("files", nargs=-1, required=True, type=FILE, metavar="FILE…")
@cfg_option
@model_option
@json_option
def check(files: tuple[Path, ...], cfg: tuple[Path, ...], model: str, json_output: JsonOutput) -> None:
    """Find errors in RAPID modules.

    The modules are checked as one program: syntax errors, type errors and unknown names, for the robot of --model.
    One line each: file, line, column, and what is expected. "unknown" is what nothing declares (an error where it is
    executed, once all modules are there), "missing" what RobotWare has and this package has not. Exit code 1 with any.

    \b
    Examples:
      yumi rapid check pick.mod
      yumi rapid check --json pick.mod          a list, for editors
    """
    faults = check_program(files, cfg, model)
    json_output.write(json.dumps([asdict(fault) for fault in faults], indent=2))
    if not json_output.is_printed:
        for fault in faults:
            click.echo(f"{fault.file}:{fault.line}:{fault.column}: {fault.kind}: {fault.sentence}")
        if not faults:
            click.echo(f"{len(files)} {'file' if len(files) == 1 else 'files'}: nothing found")
    if faults:
        sys.exit(1)


@rapid.command("debug")
@click.argument("task")
@yes_option
@of_controller
def debug(client: RwsClient, task: str, yes: bool) -> None:
    """Step through the RAPID of a task on a controller.

    Commands are typed, or come from standard input: step, next, out, continue, stop, main, where, list, break
    MODULE:LINE, print [NAME], set NAME VALUE, quit; help explains them. All tasks that are selected on the task panel
    start, and arms move: it asks before the first start; commands that are not typed need --yes for it. Ctrl-C stops
    what was started.

    \b
    Examples:
      yumi rapid debug T_ROB_R --robot 192.168.125.1
      printf "main\\nstep\\nwhere\\n" | yumi rapid debug T_ROB_R --yes
    """
    commands = None if sys.stdin.isatty() else sys.stdin

    def confirm(question: str) -> bool:
        return yes or (commands is None and click.confirm(question))

    debugger = Debugger(client, task, SystemClock(), sys.stdout, confirm, commands)
    if commands is not None:
        debugger.prompt = ""
    try:
        debugger.cmdloop()
    except KeyboardInterrupt:
        sys.exit(130)


@click.command()
@click.argument("value", required=False)
@robot_option(default="127.0.0.1")
@user_option("Default User")
@password_options
@json_option
def answer(value: str | None, robot: str, user: str, password: str | None, json_output: JsonOutput) -> None:
    """Show or answer what a RAPID program asks.

    Without VALUE it shows the question to the operator. VALUE is a button's or an item's text, the value that the
    program gets for it, a number, or a text.

    \b
    Examples:
      yumi answer
      yumi answer Yes
    """
    own = settings_of(None, {"robot": robot}).robot
    address, login = f"{own.address}:{own.rws_port}", password or own.password
    with RwsClient(address, user=user, password=login, timeout=own.timeout) as client:
        dialog = client.dialog()
        if dialog is None:
            raise CommandRefused("No program asks anything.")
        asked = [f"{name}: {text}" for name, text in client.dialog_parameters(dialog.stack).items() if text]
        if value is None:
            task = dialog.stack.split("/")[1]
            json_output.write(json.dumps({"instruction": dialog.instruction, "task": task, "asked": asked}))
            if not json_output.is_printed:
                click.echo("\n".join([f"{dialog.instruction} of {task}", *asked]))
            return
        try:
            client.answer_dialog(dialog.stack, value)
        except ControllerRefused as error:
            raise CommandRefused(
                f"The controller refuses {value!r} as an answer to {dialog.instruction} ({', '.join(asked)})."
            ) from error


# ---- yumi rapid check

_MOST_SYNTAX_ERRORS = 20  # of one file
_ROUTINE_BEGINS = re.compile(r"^\s*(?:LOCAL\s+)?(?:PROC|FUNC|TRAP)\b", re.IGNORECASE)
_ROUTINE_HEAD = re.compile(r"^\s*(?:LOCAL\s+)?(?:TRAP\s+\w+|(?:PROC|FUNC)\b.*\))\s*(?:!.*)?$", re.IGNORECASE)
_ROUTINE_ENDS = re.compile(r"^\s*END(?:PROC|FUNC|TRAP)\b", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class ProgramFault:
    """Something in a program that does not fit.

    Attributes:
        file: where it is.
        line, column: counted from 1.
        kind: "syntax", "reference" (a type, an argument, a name used twice), "unknown" or "missing".
        sentence: what was found and what is expected.
    """

    file: str
    line: int
    column: int
    kind: str
    sentence: str


def check_program(files: Sequence[Path], cfg: Sequence[Path] = (), robot: str = "yumi") -> list[ProgramFault]:
    """All that does not fit in modules that make one program, in the order of files and lines.

    Args:
        files: its modules.
        cfg: system parameters that it needs.
        robot: name of the robot it is written for, one of those of the virtual controller.

    Raises:
        SettingsError: a file cannot be read, or the system parameters are not what they should be.
    """
    from yumi.rapid.types import RapidReferenceError  # noqa: PLC0415 - a quick --help
    from yumi.virtual.controller.files import decoded  # noqa: PLC0415
    from yumi.virtual.controller.system import (  # noqa: PLC0415
        ROBOTS,
        delivered_system,
        factory_system,
        is_user_module,
        with_programs,
    )
    from yumi.virtual.world import World, WorldSettings  # noqa: PLC0415

    model = ROBOTS[robot]
    system = delivered_system() if model.is_yumi else factory_system(model)
    name = model.units[0].task
    world = World(WorldSettings(system=with_programs(system, {name: ()}, cfg)))
    task = world.controller.tasks[name]
    faults, modules = [], []
    for path in files:
        try:
            text = decoded(path.read_bytes())
        except OSError as error:
            raise SettingsError(f"{path} cannot be read: {error.strerror or error}.") from error
        parsable, found = _parsable(text, str(path))
        faults += found
        if parsable is not None:
            modules.append((path, parsable))
    if any(is_user_module(text) for _, text in modules):
        task.unload("user")
    for path, text in modules:
        try:
            task.load(text, str(path))
        except RapidReferenceError as error:
            faults.append(_fault(error))
        except RapidError as error:
            faults.append(ProgramFault(str(path), 1, 1, "reference", str(error)))
    faults += [_fault(error) for error in task.faults()]
    order = {str(path): index for index, path in enumerate(files)}
    return sorted(dict.fromkeys(faults), key=lambda each: (order.get(each.file, 0), each.line, each.column))


def _parsable(text: str, filename: str) -> tuple[str | None, list[ProgramFault]]:
    """The text without the routines that have syntax errors, None when it is none of RAPID's, and those errors."""
    from yumi.rapid.parser import parse_module  # noqa: PLC0415 - a quick --help
    from yumi.rapid.types import RapidSyntaxError  # noqa: PLC0415

    faults: list[ProgramFault] = []
    while len(faults) < _MOST_SYNTAX_ERRORS:
        try:
            parse_module(text, filename)
        except RapidSyntaxError as error:
            sentence = str(error).removeprefix(f"{filename}:{error.line}:{error.column}: ")
            faults.append(ProgramFault(filename, error.line, error.column, "syntax", sentence))
            lines = text.split("\n")
            first = min(error.line, len(lines)) - 1
            while first >= 0 and not _ROUTINE_BEGINS.match(lines[first]):
                if _ROUTINE_ENDS.match(lines[first]) and first < error.line - 1:
                    return None, faults  # between routines: there is nothing to leave out
                first -= 1
            last = next((i for i in range(max(first, 0), len(lines)) if _ROUTINE_ENDS.match(lines[i])), None)
            if first < 0 or last is None:
                return None, faults
            # Its head stays, so that calls of it are no errors, too.
            keeps_head = first < error.line - 1 and _ROUTINE_HEAD.match(lines[first])
            lines[first + 1 : last] = [""] * (last - first - 1)
            if not keeps_head:
                lines[first] = lines[last] = ""
            text = "\n".join(lines)
        else:
            return text, faults
    return None, faults


def _fault(error: RapidReferenceError) -> ProgramFault:
    from yumi.rapid.types import NotProvided, Unresolved  # noqa: PLC0415 - a quick --help

    kind = "missing" if isinstance(error, NotProvided) else "unknown" if isinstance(error, Unresolved) else "reference"
    return ProgramFault(error.filename, max(error.line, 1), max(error.column, 1), kind, error.sentence)


# ---- yumi rapid debug

_STEP_TIMEOUT = 30.0  # [s]: a step that takes longer, such as a wait, goes on while others are entered
_CONTINUE_TIMEOUT = 1.0  # [s]: then `stop` can be entered
_LINES_AROUND = 4  # shown before and behind the program pointer
_MOST_DATA = 100  # of a module that are listed


class Debugger(cmd.Cmd):
    """Commands for one task.

    Args:
        client: of the controller.
        task: name of the task.
        clock: what waits for the end of a step.
        output: where answers are written.
        confirm: asked before the first start; whether it may be.
        commands: where commands come from when they are not typed.
    """

    prompt = "(rapid) "

    def __init__(
        self,
        client: RwsClient,
        task: str,
        clock: Clock,
        output: IO[str],
        confirm: Callable[[str], bool],
        commands: IO[str] | None = None,
    ) -> None:
        super().__init__(stdin=commands, stdout=output)
        self.use_rawinput = commands is None
        self._client, self._task, self._clock = client, task, clock
        self._confirm, self._is_confirmed = confirm, False
        self._has_started = False  # and has not seen it stop

    def _say(self, text: str) -> None:
        self.stdout.write(f"{text}\n")

    def cmdloop(self, intro: Any = None) -> None:
        """Commands until `quit`; Ctrl-C stops RAPID if it was started here, and leaves otherwise."""
        while True:
            try:
                super().cmdloop(intro)
                return
            except KeyboardInterrupt:
                if not self._has_started:
                    raise
                self._say("")  # behind ^C
                self.onecmd("stop")
                if not self.use_rawinput:  # the commands that follow count on what was interrupted
                    raise

    def onecmd(self, line: str) -> bool:
        """A command; what is refused is said, and the next one can be tried."""
        try:
            return super().onecmd(line)
        except YumiError as error:
            self._say(str(error))
            return False

    def emptyline(self) -> bool:
        """Nothing, instead of the last command again: that might be a movement."""
        return False

    def default(self, line: str) -> None:
        raise CommandRefused(f"There is no command {line.split(maxsplit=1)[0]!r}; help lists them.")

    # ---- execution

    def do_step(self, argument: str) -> None:
        """step: execute one statement, and enter the routine it calls."""
        self._run(Step.IN)

    def do_next(self, argument: str) -> None:
        """next: execute one statement, with the routines it calls."""
        self._run(Step.OVER)

    def do_out(self, argument: str) -> None:
        """out: execute the rest of the routine."""
        self._run(Step.OUT)

    def do_continue(self, argument: str) -> None:
        """continue: execute until a breakpoint, an error or the end; `stop` or Ctrl-C stops it."""
        self._run(Step.CONTINUE)

    def _run(self, step: Step) -> None:
        if not self._is_confirmed:
            tasks = [task.name for task in self._client.tasks() if task.is_active and task.starts_by_hand]
            what = f"This starts {' and '.join(tasks) or 'RAPID'}, and arms may move."
            if not self._confirm(f"{what} Is their workspace free?"):
                raise CommandRefused(f"Not started. {what} It has to be confirmed, or --yes given.")
            self._is_confirmed = True
        before, self._has_started = self._has_started, True  # Ctrl-C may come before the answer
        try:
            self._client.start_rapid(cycle=RunCycle.AS_IS, step=step, stop_at_breakpoints=True)
        except ControllerRefused:
            self._has_started = before
            raise
        timeout = _CONTINUE_TIMEOUT if step is Step.CONTINUE else _STEP_TIMEOUT
        if comes_true(self._clock, lambda: self._client.execution() is ExecutionState.STOPPED, timeout):
            self._has_started = False
            self._say(self._here())
        else:
            self._say("running; `stop` stops it, `where` says where it is")

    def do_stop(self, argument: str) -> None:
        """stop: stop RAPID in all tasks."""
        self._client.stop_rapid()
        self._has_started = False
        self._say(self._here())

    def do_main(self, argument: str) -> None:
        """main: move the program pointers to main."""
        self._client.move_pp_to_main()
        self._say(self._here())

    # ---- where it is

    def _frames(self) -> Iterator[tuple[str, str, int]]:
        """Module, routine and line of each routine under way, the innermost first."""
        number = 1
        while True:
            try:
                frame = self._client.stack_frame(self._task, number)
            except ControllerRefused:  # no more
                return
            yield frame.module, frame.routine, frame.range.row
            number += 1

    def _here(self) -> str:
        module, routine, row = next(self._frames(), ("", "", 0))
        if not module:
            return f"{self._task} has no program pointer; `main` moves it to main"
        lines = self._client.module_text(self._task, module).splitlines()
        return f"{module}/{routine}, line {row}: {lines[row - 1].strip() if row <= len(lines) else ''}"

    def do_where(self, argument: str) -> None:
        """where: the call stack, the innermost routine first."""
        found = [
            f"#{number} {module}/{routine}, line {row}" for number, (module, routine, row) in enumerate(self._frames())
        ]
        self._say("\n".join(found) if found else self._here())

    def do_list(self, argument: str) -> None:
        """list: the lines around the program pointer."""
        module, _, row = next(self._frames(), ("", "", 0))
        if not module:
            self._say(self._here())
            return
        try:
            marks = {at.row for name, at in self._client.breakpoints(self._task) if name.lower() == module.lower()}
        except ControllerRefused:  # some controllers do not tell, and answer 404
            marks = set()
        lines = self._client.module_text(self._task, module).splitlines()
        for number in range(max(row - _LINES_AROUND, 1), min(row + _LINES_AROUND, len(lines)) + 1):
            mark = "->" if number == row else " *" if number in marks else "  "
            self._say(f"{number:5d} {mark} {lines[number - 1]}")

    # ---- breakpoints

    def do_break(self, argument: str) -> None:
        """Break MODULE:LINE: stop before that line, or no more where there is a breakpoint; alone, it lists them."""
        if argument:
            module, colon, row = argument.rpartition(":")
            if not colon or not row.isdigit():
                raise CommandRefused(f"break takes a module and a line, such as break Program:12, not {argument!r}.")
            self._client.set_breakpoint(self._task, module, int(row))
        found = [f"{name}:{at.row}" for name, at in self._client.breakpoints(self._task)]
        self._say("breakpoints: " + (", ".join(found) or "none"))

    # ---- data

    def do_print(self, argument: str) -> None:
        """Print [NAME]: the value of a datum of the module that is executed (or MODULE/NAME), or of all of them."""
        module, _, name = argument.rpartition("/")
        module = module or next(self._frames(), ("", "", 0))[0]
        if not module:
            raise CommandRefused(f"{self._here()}; or print MODULE/NAME.")
        for each in [name] if name else self._data(module):
            self._say(f"{each} = {self._client.symbol(self._task, module, each)}")

    def _data(self, module: str) -> list[str]:
        form = (("view", "block"), ("blockurl", f"RAPID/{self._task}/{module}"), ("symtyp", "var,per,con"))
        page = self._client.call("POST", "/rw/rapid/symbols", (("action", "search-symbols"),), form)
        states = () if page is None else page.states
        return [state.title.rpartition("/")[2] for state in states][:_MOST_DATA]

    def do_set(self, argument: str) -> None:
        """Set NAME VALUE: give a datum a value, a RAPID literal."""
        target, _, literal = argument.partition(" ")
        if not literal:
            raise CommandRefused("set takes a datum and its value, such as set count 3.")
        module, _, name = target.rpartition("/")
        module = module or next(self._frames(), ("", "", 0))[0]
        self._client.set_symbol(self._task, module, name, literal.strip())
        self._say(f"{name} = {self._client.symbol(self._task, module, name)}")

    def do_quit(self, argument: str) -> bool:
        """quit: leave; RAPID stays as it is."""
        return True

    def do_EOF(self, argument: str) -> bool:  # noqa: N802 - the end of the commands
        return True
