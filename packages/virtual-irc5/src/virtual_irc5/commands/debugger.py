"""The debugger: steps, breakpoints, call stack and data of one task, over Robot Web Services."""

from __future__ import annotations

import cmd
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import IO, Any

import click

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import CommandRefused, ControllerRefused, YumiError
from abb_protocols.rws.operations.modules import TextRange
from abb_protocols.rws.values import (
    ControllerState,
    ExecutionState,
    RunCycle,
    RwsCode,
    Step,
    SymbolKind,
    TaskExecution,
    code_meaning,
)
from abb_runtime.clock import Clock, SystemClock, comes_true
from abb_runtime.rws.client import RwsClient

_STEP_TIMEOUT = 30.0  # [s]: a step that takes longer, such as a wait, goes on while others are entered
_CONTINUE_TIMEOUT = 1.0  # [s]: then `stop` can be entered
_LINES_AROUND = 4  # shown before and behind the program pointer
_MOST_DATA = 100  # of a module that are listed
_MOST_LOCALS = 8  # that are shown whenever the program stops
_LONGEST_LOCAL = 30  # characters of one then
_NOT_FOUND = 404
_WRONG_STATE = (RwsCode.EXEC_STATE, RwsCode.TASK_STATE, RwsCode.NO_PP)
_NO_SYMBOL = (RwsCode.FAIL, RwsCode.NO_SUCH_SYMBOL, RwsCode.UNRESOLVED_URL)


def _running_first(tasks: Sequence[str]) -> Message:
    """That tasks run, and must be stopped first."""
    if len(tasks) == 1:
        return message("task_is_running", task=tasks[0])
    return message("tasks_are_running", tasks=tuple(tasks))


def _cut(literal: str) -> str:
    return literal if len(literal) <= _LONGEST_LOCAL else f"{literal[:_LONGEST_LOCAL]}…"


class Debugger(cmd.Cmd):
    """Commands for one task.

    Args:
        client: of the controller.
        task: name of the task.
        clock: what waits for the end of a step.
        output: where answers are written.
        confirm: asked before the first start; whether it may be.
        commands: where commands come from when they are not typed.
        cycle: whether the program begins again at its end.
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
        cycle: RunCycle = RunCycle.AS_IS,
    ) -> None:
        super().__init__(stdin=commands, stdout=output)
        self.use_rawinput = commands is None
        self._client, self._task, self._clock, self._cycle = client, task, clock, cycle
        self._confirm, self._is_confirmed = confirm, False
        self._has_started = False  # and has not seen it stop
        self._was_running = False  # when it was last looked at

    def _say(self, text: str) -> None:
        self.stdout.write(f"{text}\n")

    def cmdloop(self, intro: Any = None) -> None:
        """Commands until `quit`; Ctrl-C stops RAPID if it was started here, and drops what was typed."""
        self._begin()
        while True:
            try:
                super().cmdloop(intro)
                return
            except KeyboardInterrupt:
                if self._has_started:
                    self._say("")  # behind ^C
                    self.onecmd("stop")
                elif self.use_rawinput:
                    self._say("\n`quit` leaves, and so does Ctrl-D.")
                if not self.use_rawinput:  # the commands that follow count on what was interrupted
                    raise

    def _begin(self) -> None:
        """Say what the person meets: whether RAPID runs, and the breakpoints that others have left."""
        tasks = {each.name.upper(): each for each in self._client.tasks()}
        if self._task.upper() not in tasks:
            raise CommandRefused(
                message("task_unknown", task=self._task, tasks=tuple(each.name for each in tasks.values()))
            )
        self._task = tasks[self._task.upper()].name
        if running := self._running():
            self._was_running = True
            self._say(f"{' and '.join(running)} {'is' if len(running) == 1 else 'are'} running; `stop` stops RAPID.")
        self._say(self._breakpoint_list())

    def onecmd(self, line: str) -> bool:
        """A command; what is refused is said, and the next one can be tried."""
        try:
            self._notice_stop()
            return super().onecmd(line)
        except ControllerRefused as error:
            self._say(str(self._why_refused(error)))
        except YumiError as error:
            self._say(str(error))
        return False

    def emptyline(self) -> bool:
        """Nothing, instead of the last command again: that might be a movement."""
        return False

    def default(self, line: str) -> None:
        raise CommandRefused(message("debugger_command_unknown", command=line.split(maxsplit=1)[0]))

    def get_names(self) -> list[str]:
        """The end of the commands is no command that help lists."""
        return [name for name in super().get_names() if name != "do_EOF"]

    def do_help(self, arg: str) -> None:
        """Help [COMMAND]: what a command does; alone, all of them."""
        found = [name for name in self.get_names() if name.startswith(f"do_{arg}")]
        if arg and f"do_{arg}" not in found:
            raise CommandRefused(message("debugger_command_unknown", command=arg))
        for name in [f"do_{arg}"] if arg else found:
            text = str(getattr(self, name).__doc__)
            self._say(f"{text[:1].lower()}{text[1:]}")

    # ---- what is refused

    def _running(self) -> tuple[str, ...]:
        """The tasks that run."""
        tasks = self._client.tasks()
        return tuple(each.name for each in tasks if each.starts_by_hand and each.execution is TaskExecution.STARTED)

    def _why_refused(self, error: ControllerRefused) -> Message:
        """Why the controller refuses, and what to do; its code decides, and the state it is in."""
        if error.code in _WRONG_STATE:
            if running := self._running():
                return _running_first(running)
            state = self._client.controller_state()
            if state is not ControllerState.MOTORS_ON:
                return message("motors_off_for_program", state=state.value)
            with_pointer = self._startable()
            if self._task not in with_pointer:
                return self._no_pointer
            if others := [each for each in self._selected() if each not in with_pointer]:
                return message("tasks_without_pointer", tasks=tuple(others))
        reason = code_meaning(error.code) or message("event_log_may_tell")
        return message("controller_refuses_it", reason=reason)

    @property
    def _no_pointer(self) -> Message:
        return message("task_without_pointer", task=self._task)

    def _selected(self) -> list[str]:
        """The tasks that the task panel selects."""
        return [each.name for each in self._client.tasks() if each.is_active and each.starts_by_hand]

    def _startable(self) -> list[str]:
        """Those of them that a start starts: they have a program pointer."""
        return [name for name in self._selected() if self._client.pointers(name)[0].range is not None]

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
            if running := self._running():
                raise CommandRefused(_running_first(running))
            if self._task not in (tasks := self._startable()):
                raise CommandRefused(self._no_pointer)
            what = f"This starts {' and '.join(tasks)}, and arms may move."
            if not self._confirm(f"{what} Is their workspace free?"):
                raise CommandRefused(message("start_not_confirmed", tasks=tuple(tasks)))
            self._is_confirmed = True
        before, self._has_started = self._has_started, True  # Ctrl-C may come before the answer
        try:
            self._client.start_rapid(cycle=self._cycle, step=step, stop_at_breakpoints=True)
        except ControllerRefused:
            self._has_started = before
            raise
        self._was_running = True
        if not self._wait_for_stop(_CONTINUE_TIMEOUT if step is Step.CONTINUE else _STEP_TIMEOUT):
            self._say("running; `stop` stops it, `where` shows where it is")

    def _wait_for_stop(self, timeout: float) -> bool:
        """Whether RAPID has stopped within a time [s]; where, is said then."""
        if not comes_true(self._clock, lambda: self._client.execution() is ExecutionState.STOPPED, timeout):
            return False
        self._has_started = self._was_running = False
        if any(each.name == self._task and each.execution is TaskExecution.READY for each in self._client.tasks()):
            self._say("The program has ended.")
        self._say(self._here())
        self._show_locals()
        return True

    def _notice_stop(self) -> None:
        """Say that RAPID has stopped meanwhile, such as at a breakpoint."""
        if self._was_running and self._wait_for_stop(0.0):
            self._say("")

    def do_stop(self, argument: str) -> None:
        """stop: stop RAPID in all tasks."""
        self._client.stop_rapid()
        self._has_started = self._was_running = False
        self._say(self._here())
        self._show_locals()

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
            return str(self._no_pointer)
        return f"{module}/{routine}, line {row}: {self._line(module, row)}"

    def _line(self, module: str, row: int) -> str:
        lines = self._client.module_text(self._task, module).splitlines()
        return lines[row - 1].strip() if row <= len(lines) else ""

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
        marks = {at.row for name, at in self._breakpoints() if name.lower() == module.lower()}
        lines = self._client.module_text(self._task, module).splitlines()
        for number in range(max(row - _LINES_AROUND, 1), min(row + _LINES_AROUND, len(lines)) + 1):
            mark = "->" if number == row else " *" if number in marks else "  "
            self._say(f"{number:5d} {mark} {lines[number - 1]}")

    # ---- breakpoints

    def _breakpoints(self) -> tuple[tuple[str, TextRange], ...]:
        """Module and place of each; none where the controller does not tell them."""
        try:
            return self._client.breakpoints(self._task)
        except ControllerRefused as error:
            if error.status != _NOT_FOUND:
                raise
            return ()

    def _breakpoint_list(self) -> str:
        return "breakpoints: " + (", ".join(self._breakpoint_names()) or "none")

    def _breakpoint_names(self) -> tuple[str, ...]:
        return tuple(f"{name}:{at.row}" for name, at in self._breakpoints())

    def _place(self, argument: str, command: str) -> tuple[str, int]:
        """The module, as it is spelled, and the line that an argument names."""
        module, colon, row = argument.rpartition(":")
        if not colon or not row.isdigit():
            raise CommandRefused(message("place_expected", command=command, argument=argument))
        names = [each.name for each in self._client.modules(self._task)]
        found = next((name for name in names if name.lower() == module.strip().lower()), None)
        if found is None:
            raise CommandRefused(
                message("module_unknown", task=self._task, module=module.strip(), modules=tuple(names))
            )
        return found, int(row)

    def do_break(self, argument: str) -> None:
        """Break [MODULE:LINE]: stop before that line; alone, it lists the breakpoints."""
        if argument:
            module, row = self._place(argument, "break")
            try:
                self._client.set_breakpoint(self._task, module, row)
            except ControllerRefused as error:
                if error.status == _NOT_FOUND:
                    raise CommandRefused(message("no_breakpoints_here")) from error
                if error.code != RwsCode.SOURCEPOS:
                    raise
                count = len(self._client.module_text(self._task, module).splitlines())
                if not 1 <= row <= count:
                    raise CommandRefused(message("line_beyond_module", module=module, count=count, line=row)) from error
                text = self._line(module, row)
                raise CommandRefused(
                    message("no_statement_at_line", line=row, module=module, text=text)
                    if text
                    else message("no_statement_at_empty_line", line=row, module=module)
                ) from error
        self._say(self._breakpoint_list())
        if argument and self._was_running:
            self._wait_for_stop(_CONTINUE_TIMEOUT)

    def do_clear(self, argument: str) -> None:
        """Clear [MODULE:LINE]: remove that breakpoint; alone, it removes all."""
        found = self._breakpoints()
        if argument:
            module, row = self._place(argument, "clear")
            found = tuple((name, at) for name, at in found if (name.lower(), at.row) == (module.lower(), row))
            if not found:
                raise CommandRefused(
                    message("no_breakpoint", module=module, line=row, breakpoints=self._breakpoint_names())
                )
        stands = {(module.lower(), row) for module, _, row in self._frames()}
        for name, at in found:
            if (name.lower(), at.row) in stands:
                self._say(
                    f"{name}:{at.row} stays: the program stands there, and a controller would lose the program "
                    f"pointer with it; `next` first, then `clear {name}:{at.row}`."
                )
            else:
                self._client.clear_breakpoint(self._task, name, at)
        self._say(self._breakpoint_list())

    # ---- data

    def _locals(self, number: int = 1) -> dict[str, str]:
        """The parameters, data and loop variables of a routine under way, and the blocks their addresses name.

        Args:
            number: 1 for the innermost routine, 2 for what has called it, and so on.
        """
        found = self._client.find_symbols(f"RAPID/{self._task}", view="stack", stack=number)
        return {each.name: "/".join(each.address.split("/")[2:-1]) for each in found}

    def _show_locals(self) -> None:
        """Say the first of them when the program has stopped, where there are any."""
        try:
            found = self._locals()
            values = [
                f"{name} = {_cut(self._client.symbol(self._task, block, name))}"
                for name, block in list(found.items())[:_MOST_LOCALS]
            ]
        except ControllerRefused:  # there is no program pointer, or the controller does not tell them
            return
        if values:
            more = ", … (`locals` shows all)" if len(found) > len(values) else ""
            self._say(f"    {', '.join(values)}{more}")

    def do_locals(self, argument: str) -> None:
        """Locals [N]: parameters, data and loop variables of the routine that is executed, or of #N of `where`."""
        if argument and not argument.isdigit():
            raise CommandRefused(message("frame_number_expected", argument=argument))
        frames = list(self._frames())
        number = int(argument or 0)
        if not number < len(frames):
            raise CommandRefused(message("no_frame", number=number) if frames else self._no_pointer)
        found = self._locals(number + 1)
        for name, block in found.items():
            self._say(f"{name} = {self._client.symbol(self._task, block, name)}")
        if not found:
            module, routine, row = frames[number]
            self._say(f"{module}/{routine} has no parameters or data at line {row}")

    def _find(self, argument: str) -> tuple[str, str]:
        """The block of a datum and its name: of the routine that is executed, of its module, or as MODULE/NAME."""
        block, slash, name = argument.rpartition("/")
        if slash:
            return block, name
        module = self._module()
        own = {key.lower(): each for key, each in self._locals().items()}
        return own.get(name.partition("{")[0].lower(), module), name

    def _module(self) -> str:
        """The module of the routine that is executed."""
        module = next(self._frames(), ("", "", 0))[0]
        if not module:
            raise CommandRefused(message("datum_needs_module", reason=self._no_pointer))
        return module

    def do_print(self, argument: str) -> None:
        """Print [NAME]: a datum of the routine that is executed or of its module, or MODULE/NAME; alone, all."""
        if argument:
            self._print(*self._find(argument))
            return
        module = self._module()
        found = self._locals()
        for name, block in [*found.items(), *((each, module) for each in self._data(module))]:
            self._print(block, name)

    def _print(self, block: str, name: str) -> None:
        with self._existing(block, name):
            self._say(f"{name} = {self._client.symbol(self._task, block, name)}")

    @contextmanager
    def _existing(self, block: str, name: str) -> Iterator[None]:
        """Say where a datum is missing that the controller does not find meanwhile."""
        try:
            yield
        except ControllerRefused as error:
            if error.code not in _NO_SYMBOL:
                raise
            module, routine, _ = next(self._frames(), ("", "", 0))
            if module.lower() == block.lower():
                said = message("no_datum_in_routine", name=name, module=module, routine=routine)
            else:
                said = message("no_datum", name=name, block=block)
            raise CommandRefused(said) from error

    def _data(self, module: str) -> list[str]:
        form = (("view", "block"), ("blockurl", f"RAPID/{self._task}/{module}"), ("symtyp", "var,per,con"))
        page = self._client.call("POST", "/rw/rapid/symbols", (("action", "search-symbols"),), form)
        states = () if page is None else page.states
        return [state.title.rpartition("/")[2] for state in states][:_MOST_DATA]

    def do_set(self, argument: str) -> None:
        """Set NAME VALUE: give a datum a value, a RAPID literal."""
        target, _, literal = argument.partition(" ")
        if not literal:
            raise CommandRefused(message("datum_and_value_expected"))
        block, name = self._find(target)
        with self._existing(block, name):
            found = self._client.symbol_properties(self._task, block, name)
        if found.is_read_only:
            raise CommandRefused(
                message("loop_variable_not_set" if found.kind is SymbolKind.FOR else "constant_not_set", name=name)
            )
        try:
            self._client.set_symbol(self._task, block, name, literal.strip())
        except ControllerRefused as error:
            if error.code not in (RwsCode.SYNTAX, RwsCode.SEMANTIC):
                raise
            raise CommandRefused(
                message("no_value_of_datum", value=literal.strip(), name=name, type=found.type)
            ) from error
        self._print(block, name)

    def do_quit(self, argument: str) -> bool:
        """quit: leave; RAPID stays as it is."""
        return True

    def do_EOF(self, argument: str) -> bool:  # noqa: N802 - the end of the commands
        if self.use_rawinput:
            self._say("")  # behind the prompt
        return True


def run_debugger(client: RwsClient, task: str, yes: bool, once: bool) -> None:
    """Take commands, typed or from standard input, until ``quit``.

    Args:
        client: of the controller.
        task: name of the task.
        yes: whether arms may move without a question.
        once: whether the program ends with main.
    """
    commands = None if sys.stdin.isatty() else sys.stdin

    def confirm(question: str) -> bool:
        return yes or (commands is None and click.confirm(question))

    cycle = RunCycle.ONCE if once else RunCycle.AS_IS
    debugger = Debugger(client, task, SystemClock(), sys.stdout, confirm, commands, cycle)
    if commands is not None:
        debugger.prompt = ""
    try:
        debugger.cmdloop()
    except KeyboardInterrupt:
        sys.exit(130)
