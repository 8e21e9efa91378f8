r"""Programs in the styles of others, tried from outside: sockets, files, signals, questions, screen and events.

Each module of `programs` says in comments what is done and must happen, line by line:

    connect a, udp a, listen a    a client of TCP or UDP, a server the program connects to; all on the program's port
    send a TEXT, receive a TEXT   what the client sends, and gets within a second (receivepart: more may come before)
    sendhex, receivehex           the same in hexadecimal form
    wait S                        let time pass [s]
    put PATH TEXT, file PATH TEXT write a file before, compare one (filehex: in hexadecimal form); \n is a line feed
    set NAME V, signal NAME V     a signal is set; a signal must have the value
    answer TEXT                   the operator answers
    screen TEXT                   the next line that the program has written
    event TITLE                   the event log has it
"""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

from free_ports import free_tcp_port
from virtual_irc5.program_sockets import ProgramNetwork
from virtual_irc5.world import World

PROGRAMS = sorted(Path(__file__).with_name("programs").glob("*.mod"))
LONGEST_WAIT = 1.0  # [s], for what a client must receive
IDLE = "MODULE Idle\nPROC main()\nWaitTime 1000;\nENDPROC\nENDMODULE\n"


class Outside:
    """The virtual robot with one program, and who deals with it."""

    def __init__(self, text: str) -> None:
        self.port = free_tcp_port()
        self.clients: dict[str, socket.socket] = {}
        self.world = World()
        controller = self.world.controller
        controller.devices.network = ProgramNetwork()
        for name, module in (("T_ROB_R", text.replace("5000", str(self.port))), ("T_ROB_L", IDLE)):
            task = controller.tasks[name]
            task.lose_pp()
            for old in task.modules:
                task.unload(old.name)
            task.load(module, "program.mod")
        self.lines = 0

    def begin(self) -> None:
        controller = self.world.controller
        controller.execution.move_pp_to_main()
        controller.set_motors(True)
        controller.start_rapid()
        self.wait("0.008")

    def wait(self, seconds: str) -> None:
        for _ in range(round(float(seconds) / self.world.cycle_time)):
            self.world.cycle({})

    def close(self) -> None:
        for client in self.clients.values():
            client.close()
        for task in self.world.controller.tasks.values():
            task.lose_pp()

    # The lines of a script

    def connect_(self, name: str) -> None:
        if name in self.clients:
            self.clients.pop(name).close()
        self.clients[name] = client = self._client()
        for _ in range(round(LONGEST_WAIT / self.world.cycle_time)):
            if client.connect_ex(("127.0.0.1", self.port)) == 0:
                break
            self.wait("0.004")  # it does not listen yet
        client.setblocking(False)
        self.wait("0.02")

    def _client(self) -> socket.socket:
        """With a port of its own: it could be given the program's otherwise, and would connect to itself."""
        client = socket.socket()
        client.bind(("127.0.0.1", 0))
        return client if client.getsockname()[1] != self.port else self._client()

    def udp(self, name: str) -> None:
        client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        client.connect(("127.0.0.1", self.port))
        client.setblocking(False)
        self.clients[name] = client

    def listen(self, name: str) -> None:
        self.clients[name] = socket.create_server(("127.0.0.1", self.port))
        self.clients[name].setblocking(False)

    def close_(self, name: str) -> None:
        self.clients.pop(name).close()
        self.wait("0.02")

    def send(self, name: str, text: str) -> None:
        self.clients[name].sendall(text.encode("latin-1"))

    def sendhex(self, name: str, digits: str) -> None:
        self.clients[name].sendall(bytes.fromhex(digits))

    def receive(self, name: str, text: str) -> None:
        assert self._received(name, len(text)).decode("latin-1") == text

    def receivehex(self, name: str, digits: str) -> None:
        assert self._received(name, len(bytes.fromhex(digits))).hex() == bytes.fromhex(digits).hex()

    def receivepart(self, name: str, text: str) -> None:
        assert text in self._received(name, 1024).decode("latin-1")

    def _received(self, name: str, size: int) -> bytes:
        """What has come, up to `size` bytes, after a second at the latest."""
        client, got = self.clients[name], b""
        for _ in range(round(LONGEST_WAIT / self.world.cycle_time)):
            self.world.cycle({})
            try:
                if client.type == socket.SOCK_STREAM and client.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
                    client, _ = client.accept()
                    self.clients.pop(name).close()
                    self.clients[name] = client
                    client.setblocking(False)
                got += client.recv(size - len(got))
            except BlockingIOError:
                continue
            if len(got) == size or client.type == socket.SOCK_DGRAM:
                break
        return got

    def put(self, path: str, text: str) -> None:
        self.world.controller.files.write(path, text.encode("latin-1").decode("unicode_escape").encode("latin-1"))

    def file(self, path: str, text: str) -> None:
        assert self.world.controller.files[path] == text.encode("latin-1").decode("unicode_escape")

    def filehex(self, path: str, digits: str) -> None:
        content = self.world.controller.files.get_file(path).content or b""
        assert content.hex() == bytes.fromhex(digits).hex()

    def set(self, name: str, value: str) -> None:
        self.world.controller.signals.drive(name, float(value))

    def signal(self, name: str, value: str) -> None:
        assert self.world.controller.signals.get(name).value == float(value)

    def answer(self, text: str) -> None:
        dialog = self.world.controller.devices.pendant.active
        assert dialog is not None
        dialog.give(text)

    def screen(self, text: str) -> None:
        lines = self.world.controller.screens["T_ROB_R"]
        assert len(lines) > self.lines, self.world.controller.events.entries()[:2]
        assert lines[self.lines] == text
        self.lines += 1

    def event(self, title: str) -> None:
        assert title in [event.title for event in self.world.controller.events.entries()]


def script(text: str) -> Iterator[tuple[str, list[str]]]:
    """Each line's verb with what follows, the last of which may have blanks."""
    for line in text.splitlines():
        mark, _, rest = line.strip().partition(" ")
        if mark == "!>":
            verb, *arguments = rest.split(" ", 1)
            if verb in ("answer", "screen", "event"):
                yield verb, arguments
            else:
                yield {"connect": "connect_", "close": "close_"}.get(verb, verb), "".join(arguments).split(" ", 1)


@pytest.mark.parametrize("path", PROGRAMS, ids=lambda path: path.stem)
def test_program_does_what_it_says(path: Path) -> None:
    text = path.read_text(encoding="ascii")
    outside = Outside(text)
    steps = list(script(text))
    assert any(verb in ("screen", "file", "filehex", "event", "signal") or "receive" in verb for verb, _ in steps)
    try:
        for verb, arguments in steps:
            if verb == "put":
                outside.put(*arguments)
        outside.begin()
        for verb, arguments in steps:
            if verb != "put":
                getattr(outside, verb)(*arguments)
    finally:
        outside.close()
