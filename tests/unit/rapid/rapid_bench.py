"""A RAPID task on a bench: a host that remembers, and programs of a few lines."""

from __future__ import annotations

from virtual_irc5.controller.file_store import FileStore
from virtual_irc5.controller.rapid_devices import RapidDisk
from virtual_irc5.program_sockets import ProgramNetwork
from virtual_irc5.rapid import InstructionSet
from virtual_irc5.rapid.devices import Devices
from virtual_irc5.rapid.states import Severity, TaskEvent
from virtual_irc5.rapid.task import Task


class RecordingHost:
    """A controller with the signals `di1`, `di2` and `do1`, `go1`, and files in memory."""

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.events: list[TaskEvent] = []
        self.log: list[tuple[str, str, Severity]] = []
        self.files: dict[str, str] = {}
        self.devices = Devices(RapidDisk(FileStore({})), ProgramNetwork())
        self.devices.log = lambda number, title, text, severity, arguments: self.log.append((title, text, severity))
        self.signals = {"di1": 0.0, "di2": 0.0, "do1": 0.0, "go1": 0.0, "ai1": 0.0, "ao1": 0.0, "gi1": 0.0}

    def write_text(self, task: str, text: str) -> None:
        self.lines.append(text)

    def write_event(self, task: str, title: str, text: str, severity: Severity, arguments: tuple[str, ...]) -> None:
        self.log.append((title, text, severity))

    def read_signal(self, name: str) -> float:
        return self.signals[name.lower()]

    def write_signal(self, name: str, value: float) -> None:
        if name.lower() not in self.signals:
            raise KeyError(name)
        self.signals[name.lower()] = value

    def read_file(self, path: str) -> str:
        try:
            return self.files[path]
        except KeyError as error:
            raise FileNotFoundError(path) from error

    def report(self, task: str, event: TaskEvent) -> None:
        self.events.append(event)

    def is_virtual(self) -> bool:
        return True


class Bench:
    """A task with the module `M`, made of declarations and the body of `main`.

    Attributes:
        lines: what the program wrote with TPWrite.
    """

    def __init__(self, body: str = "", declarations: str = "", library: InstructionSet | None = None) -> None:
        self.host = RecordingHost()
        self.task = Task("T_ROB_R", self.host, library or InstructionSet())
        self.task.load(f"MODULE M\n{declarations}\nPROC main()\n{body}\nENDPROC\nENDMODULE", "M.mod")

    @property
    def lines(self) -> list[str]:
        return self.host.lines

    @property
    def stop(self) -> TaskEvent:
        """Why the task stopped last."""
        return self.host.events[-1]

    def start(self) -> Bench:
        self.task.move_pp_to_main()
        self.task.start()
        self.task.advance(0.001)
        return self

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.004)):
            self.task.advance(0.004)

    def set(self, signal: str, value: float) -> None:
        """Change a signal from outside and let interrupts settle."""
        old, self.host.signals[signal] = self.host.signals[signal], value
        self.task.signal_changed(signal, old, value)
        self.task.advance(0.0)

    def read(self, symbol: str) -> str:
        return self.task.read("M", symbol)


def started(body: str = "", declarations: str = "", library: InstructionSet | None = None) -> Bench:
    """A bench whose program has run until it waits or ends."""
    return Bench(body, declarations, library).start()


def evaluated(expression: str, type_name: str = "num", declarations: str = "") -> str:
    """The value of an expression, as a RAPID literal."""
    bench = started(f"result := {expression};", f"VAR {type_name} result;\n{declarations}")
    assert bench.stop.error == "", bench.stop.sentence
    return bench.read("result")


def error_of(body: str, declarations: str = "") -> str:
    """The name of the error a program stops with."""
    return started(body, declarations).stop.error
