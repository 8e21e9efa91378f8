"""``yumi rapid debug``: steps, breakpoints, call stack and data of a RAPID task, over Robot Web Services."""

from __future__ import annotations

import cmd
from collections.abc import Iterator
from typing import IO, TYPE_CHECKING

from yumi.clock import Clock, comes_true
from yumi.errors import CommandRefused, ControllerRefused, YumiError
from yumi.rws.types import ExecutionState

if TYPE_CHECKING:
    from yumi.rws.client import RwsClient

_STEP_TIMEOUT = 30.0  # [s]: a step that takes longer, such as a wait, goes on while others are entered
_MASTERSHIP = "/rw/mastership/rapid"
_AROUND = 4  # lines shown before and behind the program pointer
_MOST_DATA = 100  # of a module that are listed


class Debugger(cmd.Cmd):
    """Commands for one task.

    Args:
        client: of the controller.
        task: name of the task.
        clock: what waits for the end of a step.
        output: where answers are written.
        commands: where commands come from when they are not typed.
    """

    prompt = "(rapid) "

    def __init__(
        self, client: RwsClient, task: str, clock: Clock, output: IO[str], commands: IO[str] | None = None
    ) -> None:
        super().__init__(stdin=commands, stdout=output)
        self.use_rawinput = commands is None
        self._client, self._task, self._clock = client, task, clock
        self._path = f"/rw/rapid/tasks/{task}"

    def _say(self, text: str) -> None:
        self.stdout.write(f"{text}\n")

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
        self._run("stepin")

    def do_next(self, argument: str) -> None:
        """next: execute one statement, with the routines it calls."""
        self._run("stepover")

    def do_out(self, argument: str) -> None:
        """out: execute the rest of the routine."""
        self._run("stepout")

    def do_continue(self, argument: str) -> None:
        """continue: execute until a breakpoint, an error or the end; `stop` stops it."""
        self._run("continue")

    def _run(self, mode: str) -> None:
        form = (
            ("regain", "continue"),
            ("execmode", mode),
            ("cycle", "asis"),
            ("condition", "none"),
            ("stopatbp", "enabled"),
            ("alltaskbytsp", "false"),
        )
        self._client.call("POST", "/rw/rapid/execution", (("action", "start"),), form)
        is_stopped = comes_true(self._clock, lambda: self._client.execution() is ExecutionState.STOPPED, _STEP_TIMEOUT)
        self._say(self._here() if is_stopped else "running; `stop` stops it, `where` says where it is")

    def do_stop(self, argument: str) -> None:
        """stop: stop RAPID in all tasks."""
        self._client.stop_rapid()
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
            query = (("resource", "activation-record"), ("stackframe", str(number)))
            try:
                page = self._client.call("GET", self._path, query)
            except ControllerRefused:  # no more
                return
            if page is None:
                return
            fields = page.one("rap-stackframe").fields
            module, routine = fields["routine-url"].split("/")[-2:]
            yield module, routine, int(fields["beg-row"])
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
        marks = {line for name, line in self._breakpoints() if name.lower() == module.lower()}
        lines = self._client.module_text(self._task, module).splitlines()
        for number in range(max(row - _AROUND, 1), min(row + _AROUND, len(lines)) + 1):
            mark = "->" if number == row else " *" if number in marks else "  "
            self._say(f"{number:5d} {mark} {lines[number - 1]}")

    # Breakpoints --------------------------------------------------------------------------------------------------

    def _breakpoints(self) -> list[tuple[str, int]]:
        page = self._client.call("GET", f"{self._path}/program/breakpoint")
        states = () if page is None else page.of_type("rap-program-breakpoint")
        return [(state.fields["module-name"], int(state.fields["start-row"])) for state in states]

    def do_break(self, argument: str) -> None:
        """Break MODULE:LINE: stop before that line, or no more where there is a breakpoint; alone, it lists them."""
        if argument:
            module, colon, row = argument.rpartition(":")
            if not colon or not row.isdigit():
                raise CommandRefused(f"break takes a module and a line, such as break Program:12, not {argument!r}.")
            form = (("module", module), ("row", row), ("column", "1"))
            self._client.call("POST", _MASTERSHIP, (("action", "request"),))
            try:
                self._client.call("POST", f"{self._path}/program/breakpoint", (("action", "set"),), form)
            finally:
                self._client.call("POST", _MASTERSHIP, (("action", "release"),))
        found = [f"{module}:{row}" for module, row in self._breakpoints()]
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
