"""``yumi rapid debug``: steps, breakpoints, call stack and data of a RAPID task, over Robot Web Services."""

from __future__ import annotations

import cmd
from collections.abc import Callable, Iterator
from typing import IO, TYPE_CHECKING, Any

from yumi.clock import Clock, comes_true
from yumi.errors import CommandRefused, ControllerRefused, YumiError
from yumi.rws.services.rapid import RunCycle, Step
from yumi.rws.types import ExecutionState

if TYPE_CHECKING:
    from yumi.rws.client import RwsClient

_STEP_TIMEOUT = 30.0  # [s]: a step that takes longer, such as a wait, goes on while others are entered
_CONTINUE_TIMEOUT = 1.0  # [s]: then `stop` can be entered
_AROUND = 4  # lines shown before and behind the program pointer
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

    # Execution ----------------------------------------------------------------------------------------------------

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

    # Where it is --------------------------------------------------------------------------------------------------

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
        for number in range(max(row - _AROUND, 1), min(row + _AROUND, len(lines)) + 1):
            mark = "->" if number == row else " *" if number in marks else "  "
            self._say(f"{number:5d} {mark} {lines[number - 1]}")

    # Breakpoints --------------------------------------------------------------------------------------------------

    def do_break(self, argument: str) -> None:
        """Break MODULE:LINE: stop before that line, or no more where there is a breakpoint; alone, it lists them."""
        if argument:
            module, colon, row = argument.rpartition(":")
            if not colon or not row.isdigit():
                raise CommandRefused(f"break takes a module and a line, such as break Program:12, not {argument!r}.")
            self._client.set_breakpoint(self._task, module, int(row))
        found = [f"{name}:{at.row}" for name, at in self._client.breakpoints(self._task)]
        self._say("breakpoints: " + (", ".join(found) or "none"))

    # Data ---------------------------------------------------------------------------------------------------------

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
