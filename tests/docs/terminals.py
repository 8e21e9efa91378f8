"""A clone with ports of its own, and terminals in which the commands of a page are typed."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from math import isclose
from pathlib import Path

from doc_pages import ROOT, Fence, read

from abb_runtime.process.command_process import CONTROLLER_READY, DRIVER_READY
from abb_runtime.udp import free_port
from free_ports import free_tcp_port

SERVER = re.compile(r"^(\.venv/bin/)?yumi (controller|up)\b")
PREAMBLE = ("source ", "cd ", "export ")
_STARTED = 60.0
_DONE = 150.0  # plan_around.py may look for each of its three plans for 30 s
_ENDED = 30.0
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
_TIME = re.compile(r"\s?(s|ms|µs|min)\b")
_TOLERANCE = 0.2  # of what was measured, as a share of what the page shows


class Clone:
    """The files of this clone in another folder, where every usual port is a free one: pages are run as they are.

    Attributes:
        root: the folder.
        environment: what its commands run with; a ROS domain of their own.
    """

    def __init__(self, folder: Path) -> None:
        self.root = folder / "clone"
        ignored = shutil.ignore_patterns(".venv", ".git", "build", "__pycache__", ".*_cache", ".hypothesis", "*.mcap")
        shutil.copytree(ROOT, self.root, ignore=ignored, ignore_dangling_symlinks=True)
        (self.root / ".venv").symlink_to(sys.prefix)
        (self.root / "build").mkdir()
        for built in ("core", "page"):  # from the same sources, of which each has the fingerprint in its name
            (self.root / "build" / built).symlink_to(ROOT / "build" / built)
        tcp = {port: str(free_tcp_port()) for port in ("8080", "8090", "8000")}
        self.ports = {**tcp, **{port: str(free_port()) for port in ("6510", "6511", "6512")}}
        usual = re.compile(rf"\b({'|'.join(self.ports)})\b")
        for part in ("packages", "config", "examples", "docs", "README.md"):
            files = [self.root / part] if (self.root / part).is_file() else (self.root / part).rglob("*")
            for file in files:
                if file.suffix in {".py", ".md", ".yaml", ".cfg", ".mod", ".sys"}:
                    self._replace(file, usual)
        self.environment = {
            **os.environ,
            "PATH": f"{self.root / '.venv' / 'bin'}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": os.pathsep.join(map(str, sorted(self.root.glob("packages/*/src")))),
            "PYTHONUNBUFFERED": "1",
            "ROS_DOMAIN_ID": str(1 + (os.getpid() + 50) % 100),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(folder / "ros"),
            "MPLCONFIGDIR": str(folder / "matplotlib"),
            "XDG_STATE_HOME": str(folder / "state"),
            "COLUMNS": "200",
        }

    def _replace(self, file: Path, usual: re.Pattern[str]) -> None:
        before = file.read_text(encoding="utf-8")
        after = usual.sub(lambda port: self.ports[port[1]], before)
        if after != before:
            file.write_text(after, encoding="utf-8")


class Background:
    """A command in a terminal of its own.

    Attributes:
        command: what was typed.
        fails: whether it ends with an error.
    """

    def __init__(self, clone: Clone, command: str, preamble: str, log: Path, *, fails: bool) -> None:
        self.command = command
        self.fails = fails
        self._log = log
        with log.open("w") as output:
            self._process = subprocess.Popen(
                ["bash", "-c", f"{preamble}exec {command}"],
                cwd=clone.root,
                env=clone.environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    @property
    def output(self) -> str:
        return self._log.read_text(encoding="utf-8", errors="replace")

    def wait_for(self, text: str, timeout: float) -> None:
        until(lambda: text in self.output or self._process.poll() is not None, timeout, f"{text!r} of {self.command}")
        assert text in self.output, f"{self.command} ended without {text!r}:\n{self.output}"

    def end(self) -> None:
        """Ctrl-C, unless it has ended by itself; it ends in order, and without a traceback."""
        if self._process.poll() is None:
            self._process.send_signal(signal.SIGINT)
        try:
            status = self._process.wait(_ENDED)
        finally:
            if self._process.poll() is None:
                os.killpg(self._process.pid, signal.SIGKILL)
                self._process.wait()
        assert "Traceback" not in self.output, self.output
        assert (status != 0) == self.fails, f"{self.command} ended with status {status}:\n{self.output}"


class Terminals:
    """Runs a page's fences in order.

    Attributes:
        ran: the commands that were run.
        left_out: the commands that were not, with the reason.
        outputs: what each command has printed that ended by itself.
    """

    def __init__(self, clone: Clone, folder: Path) -> None:
        self.ran: list[str] = []
        self.outputs: dict[str, str] = {}
        self.left_out: list[tuple[str, str]] = []
        self._clone = clone
        self._folder = folder
        self._background: list[Background] = []
        self._printed = ""

    def run(self, fence: Fence) -> None:
        if fence.language == "Ctrl-C":
            self._of(fence.text).end()
        elif fence.language == "text" and fence.mark.startswith("output"):
            self._check_output(fence)
        elif fence.language == "bash" and fence.reason:
            self.left_out += [(command, fence.reason) for command in fence.commands]
        elif fence.language == "python" and fence.reason:
            self.left_out.append((f"the script in {fence.page}:{fence.line}", fence.reason))
        elif fence.language == "bash":
            self._type(fence)
        elif fence.language == "python":
            self._run_python(fence)

    def close(self) -> None:
        """End what is left, the newest first; all of them, even when one does not end in order."""
        failures = []
        for each in reversed(self._background):
            try:
                each.end()
            except (AssertionError, subprocess.TimeoutExpired) as error:
                failures.append(str(error))
        assert not failures, "\n".join(failures)

    def _type(self, fence: Fence) -> None:
        preamble, self._printed = "", ""
        for command in fence.commands:
            self.ran.append(command)
            if command.startswith(PREAMBLE):
                preamble += f"{command}\n"
            elif SERVER.match(command):
                ready = DRIVER_READY if " up" in command else CONTROLLER_READY
                self._start(command, preamble, fails=False).wait_for(ready, _STARTED)
            elif fence.mark.startswith("test: background"):
                started = self._start(command, preamble, fails=", fails" in fence.mark)
                _, _, shown = fence.mark.partition(", shows ")
                started.wait_for(shown, _STARTED)
            else:
                self.outputs[command] = self._done(["bash", "-ec", f"{preamble}{command}"], command)
                self._printed += self.outputs[command]

    def _start(self, command: str, preamble: str, *, fails: bool) -> Background:
        log = self._folder / f"{len(self._background)}.log"
        self._background.append(Background(self._clone, command, preamble, log, fails=fails))
        return self._background[-1]

    def _done(self, arguments: list[str], command: str) -> str:
        done = subprocess.run(
            arguments,
            cwd=self._clone.root,
            env=self._clone.environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=_DONE,
            check=False,
        )
        output = done.stdout + done.stderr
        assert done.returncode == 0, f"{command} ended with status {done.returncode}:\n{output}\n{self._logs()}"
        assert "Traceback" not in output, output
        return output

    def _run_python(self, fence: Fence) -> None:
        """A part of an example is run with it; anything else is a script."""
        for example in sorted((self._clone.root / "examples").glob("*.py")):
            if fence.text in example.read_text(encoding="utf-8"):
                return
        self._printed = self._done([str(self._clone.root / ".venv/bin/python"), "-c", fence.text], "a script")
        self.ran.append(f"the script in {fence.page}:{fence.line}")

    def _check_output(self, fence: Fence) -> None:
        """Every line of the fence, in this order."""
        _, _, command = fence.mark.partition(" of ")
        if not command:
            is_printed = has_lines(self._printed, fence.text)
            assert is_printed, f"{fence.page}:{fence.line}: not in the output:\n{self._printed}"
            return
        shown = self._of(command)
        until(lambda: has_lines(shown.output, fence.text), _ENDED, f"{fence.text!r} in the output of {command}")

    def _of(self, beginning: str) -> Background:
        return next(each for each in reversed(self._background) if each.command.startswith(beginning))

    def _logs(self) -> str:
        return "\n".join(f"--- {each.command}\n{each.output[-3000:]}" for each in self._background)


def run_page(page: str, clone: Clone, folder: Path) -> Terminals:
    """Run all of a page; everything that it started has ended afterwards."""
    terminals = Terminals(clone, folder)
    try:
        for fence in read(page, clone.root):
            terminals.run(fence)
    finally:
        terminals.close()
    return terminals


def has_lines(output: str, wanted: str) -> bool:
    """Whether ``output`` has all lines of ``wanted``, in this order; see :func:`_has_line`."""
    printed = iter(output.splitlines())
    return all(any(_has_line(line, text.strip()) for line in printed) for text in wanted.splitlines() if text.strip())


def _has_line(printed: str, wanted: str) -> bool:
    """Whether a line has the text ``wanted``, where … stands for anything.

    Whole numbers and zeros are the same, times may differ, and other numbers differ by :data:`_TOLERANCE` at most.
    """
    numbers = list(_NUMBER.finditer(wanted))
    literals = [re.escape(text).replace("…", ".*") for text in _NUMBER.split(wanted)]
    found = re.search(r"(?<![\d.])(-?\d+(?:\.\d+)?)(?!\d)".join(literals), printed)
    return found is not None and all(
        _TIME.match(wanted, number.end()) or _is_close(measured, number[0])
        for number, measured in zip(numbers, found.groups(), strict=True)
    )


def _is_close(measured: str, shown: str) -> bool:
    if "." not in shown:
        return measured == shown
    return isclose(float(measured), float(shown), rel_tol=0.0, abs_tol=_TOLERANCE * abs(float(shown)))


RESULTS: dict[str, Terminals] = {}
"""Of the pages that were run, for the list at the end."""


class Pages:
    """Runs pages of one clone, each once."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.clone = Clone(folder)

    def run(self, page: str) -> Terminals:
        if page not in RESULTS:
            folder = self._folder / page.replace("/", "-")
            folder.mkdir(exist_ok=True)
            RESULTS[page] = run_page(page, self.clone, folder)
        return RESULTS[page]

    def add(self, name: str, result: Terminals) -> None:
        """Commands from elsewhere, for the list."""
        RESULTS[name] = result


def until(is_so: Callable[[], bool], timeout: float, what: str) -> None:
    end = time.monotonic() + timeout
    while not is_so():
        assert time.monotonic() < end, f"{what} did not come within {timeout:g} s"
        time.sleep(0.05)
