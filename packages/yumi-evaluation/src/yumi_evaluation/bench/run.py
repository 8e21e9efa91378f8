"""The processes of one run: a fresh server, the load generator against it, and what the kernel says they used.

``sources`` has their programs: the load generator and the echo in C, compiled when they are older than their source,
and Python for ours and for the PyPI peers, which get a virtual environment of their own.

The soak: both arms of one control loop paced for minutes, in chunks, and the C echo in between for comparison; the
second half beside busy loops of other programs.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass, field
from itertools import product
from math import nan
from pathlib import Path
from threading import Timer
from time import monotonic
from typing import Any

import numpy as np
from numpy.typing import NDArray

from abb_protocols.catalogue import message
from abb_protocols.errors import MissingPrerequisite, RobotNotReady
from abb_runtime.udp import free_port
from yumi_evaluation.bench.contenders import ECHO, GOAL_DEG, Case, Contender, Mode, Runtime
from yumi_evaluation.bench.figures import COUNTERS, LATENCIES, MISSED_OVER_ECHO, ArmRun, Run, latency_figures

PERIOD_US = 4000
WARM_UP = 250
"""Cycles sent before counting begins."""

CHUNK = 30.0
"""How long one of the two of a soak is under load before the other is [s]."""

BUSY_LOOPS = 2
"""Programs beside what is measured on a busy machine."""

SOURCES = Path(__file__).with_name("sources")
ARMS = 2
COMPILERS = ("cc", "gcc", "clang", "c++", "g++", "clang++")

_READY_TIMEOUT = 60.0
_STOP_TIMEOUT = 15.0
_SLACK = 60.0
_GENERATOR_PRIORITY = 80
_SHORTEST_COUNTED = 0.1  # [s]; the kernel counts CPU time in ticks of 10 ms


@dataclass(frozen=True, slots=True)
class Workshop:
    """Where the benchmark's sources are and where its products go.

    Attributes:
        products: programs, the peers' environment, logs.
        sources: part of the package.
    """

    products: Path
    sources: Path = SOURCES

    @property
    def peers(self) -> Path:
        """The virtual environment of the PyPI peers."""
        return self.products / "peers"

    def command(self, contender: Contender) -> list[str]:
        """The command of ``contender``, without its arguments."""
        if contender.runtime is Runtime.OTHER:
            return shlex.split(contender.program)
        if contender.runtime is Runtime.COMPILED:
            return [str(self.products.absolute() / Path(contender.program).stem)]
        python = sys.executable if contender.runtime is Runtime.OURS else str(self.peers / "bin" / "python")
        return [python, str(self.sources / contender.program)]

    def compile_programs(self) -> None:
        """Compile what is older than its source.

        Raises:
            MissingPrerequisite: there is no compiler, it refuses, or the machine does not run Linux.
        """
        if not sys.platform.startswith("linux"):
            raise MissingPrerequisite(message("benchmark_needs_linux"))
        self.products.mkdir(parents=True, exist_ok=True)
        newest = max((source.stat().st_mtime for source in self.sources.glob("*.[ch]")), default=0.0)
        for source in sorted(self.sources.glob("*.c")):
            program = self.products / source.stem
            if program.exists() and program.stat().st_mtime >= newest:
                continue
            names = [name for name in (os.environ.get("CC", ""), *COMPILERS) if name and shutil.which(name)]
            if not names:
                raise MissingPrerequisite(message("benchmark_needs_compiler"))
            arguments = ["-x", "c", "-O2", "-Wall", "-Wextra", str(source), "-o", str(program), "-lm"]
            if reason := _why_not(names[0], *arguments):
                raise MissingPrerequisite(message("compiler_refused", file=source.name, reason=reason))

    def install_peers(self) -> None:
        """Install the PyPI peers into an environment of their own, once per list of requirements.

        Raises:
            MissingPrerequisite: they cannot be fetched.
        """
        requirements = self.sources / "requirements.txt"
        required, done = requirements.read_text(encoding="utf-8"), self.peers / "installed.txt"
        if done.exists() and done.read_text(encoding="utf-8") == required:
            return
        if reason := _why_not(sys.executable, "-m", "venv", "--clear", str(self.peers)):
            raise MissingPrerequisite(message("peers_without_environment", reason=reason))
        pip = [str(self.peers / "bin" / "python"), "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
        if reason := _why_not(*pip, "-r", str(requirements)):
            raise MissingPrerequisite(message("peers_not_installed", reason=reason))
        done.write_text(required, encoding="utf-8")


def _why_not(*command: str) -> str:
    """Run a tool: the last line of what it says where it fails, empty where it does not."""
    done = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    if done.returncode == 0:
        return ""
    return (done.stderr.strip().splitlines() or ["no reason given"])[-1]


class Server:
    """A contender in a session of its own, so that Ctrl-C reaches the benchmark only.

    Args:
        workshop: where its program is.
        contender: which.
        arms: ports a server of ours always has two of, others as many as are used.
        log: where its standard error goes.

    Raises:
        RobotNotReady: on entering, when it does not start.
    """

    def __init__(self, workshop: Workshop, contender: Contender, arms: int, log: Path) -> None:
        self.ports = [free_port() for _ in range(ARMS)]
        self.pids: list[int] = []
        self.reported: dict[str, dict[str, Any]] = {"heard": {}, "stages": {}, "unanswered": {}}
        self._contender = contender
        self._log = log
        used = [str(port) for port in self.ports[:arms]]
        arguments = {
            Runtime.COMPILED: used,
            Runtime.PEERS: [used[0], f"{contender.gain:g}", _goal()],
            Runtime.OTHER: [used[0], f"{contender.gain:g}", _goal()],
            Runtime.OURS: [
                *("--ports", *map(str, self.ports)), "--gain", f"{contender.gain:g}", f"--goal={_goal()}",
                *contender.options,
            ],
        }  # fmt: skip
        self._command = [*workshop.command(contender), *arguments[contender.runtime]]
        # A ROS domain of its own on this machine only, and its logs beside the other products.
        self._environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(workshop.products.absolute() / "ros"),
        }

    def __enter__(self) -> Server:
        with self._log.open("w", encoding="utf-8") as log:
            try:
                self._process = subprocess.Popen(
                    self._command,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    text=True,
                    start_new_session=True,
                    env=self._environment,
                )
            except OSError as error:  # a server of the user that is not there
                log.write(str(error))
                said = message("contender_did_not_start", contender=self._contender.title, log=str(self._log))
                raise RobotNotReady(said) from error
        try:
            assert self._process.stdout is not None
            with _at_most(_READY_TIMEOUT, self._process):
                first = self._process.stdout.readline().split()
            if first[:1] != ["ready"]:
                raise RobotNotReady(
                    message("contender_did_not_start", contender=self._contender.title, log=str(self._log))
                )
        except BaseException:
            self.stop()
            raise
        self.pids = [int(word) for word in first[1:]]
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def stop(self) -> None:
        """End it; ours ends by itself when its standard input does, and reports what is known of the run."""
        if self._contender.runtime is not Runtime.OURS:
            self._process.terminate()
        try:
            words, _ = self._process.communicate(timeout=_STOP_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            words, _ = self._process.communicate()
        for line in words.splitlines():
            what, _, values = line.partition(" ")
            if self._contender.runtime is Runtime.OURS and what in self.reported:
                self.reported[what] = json.loads(values)

    def cpu_seconds(self) -> tuple[float, float]:
        """CPU time of the processes that answer, and of all that belong to the server [s]."""
        return _cpu_seconds(self.pids), _cpu_seconds(_family(self._process.pid))

    def resident_kib(self) -> int:
        """Memory of the processes that answer [KiB]."""
        lines = [line for pid in self.pids for line in Path(f"/proc/{pid}/status").read_text("ascii").splitlines()]
        return sum(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))


@dataclass(frozen=True, slots=True, eq=False)
class Load:
    """What the load generator did and saw.

    Attributes:
        summary: its JSON.
        latencies: of each arm and counted cycle [ns], 0 without a right reply; shape (arms, cycles).
        cpu: CPU time of the answering process and of all while it ran [s].
        wall: how long that was [s].
    """

    summary: Mapping[str, Any]
    latencies: NDArray[np.int64]
    cpu: tuple[float, float]
    wall: float

    @property
    def arms(self) -> tuple[ArmRun, ...]:
        """The figures of each arm."""
        return tuple(
            ArmRun(latency_figures(latencies), *(int(arm[counter]) for counter in COUNTERS))
            for arm, latencies in zip(self.summary["arms"], self.latencies, strict=True)
        )


def put_load(workshop: Workshop, server: Server, case: Case, cycles: int) -> Load:
    """Run the load generator against ``server``.

    Raises:
        RobotNotReady: the server did not answer as it should, or stopped answering.
    """
    output, log = workshop.products / "latencies.bin", workshop.products / "load_generator.log"
    ports = [word for port in server.ports[: case.arms] for word in ("--port", str(port))]
    numbers = {
        "--cycles": cycles, "--warm-up": WARM_UP, "--period-us": PERIOD_US, "--gain": case.contender.gain,
        "--priority": _GENERATOR_PRIORITY, "--lead-in-ms": round(case.lead_in * 1e3),
    }  # fmt: skip
    options = [word for name, value in numbers.items() for word in (name, str(value))]
    options += ["--cpu", "0"] if (os.cpu_count() or 1) > 1 else []
    options += ["--ping-pong"] if case.mode is Mode.PING_PONG else []
    program = str(workshop.products.absolute() / "load_generator")
    command = [program, *ports, *options, f"--goal={_goal()}", "--output", str(output)]
    with (
        log.open("w", encoding="utf-8") as words,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=words, text=True, start_new_session=True) as process,
    ):
        assert process.stdout is not None
        try:
            with _at_most(_SLACK + 2 * cycles * PERIOD_US / 1e6, process):
                process.stdout.readline()  # begin
                begin, before = monotonic(), server.cpu_seconds()
                process.stdout.readline()  # end
                end, after = monotonic(), server.cpu_seconds()
                summary = process.stdout.read()
        except BaseException:
            process.kill()
            raise
    if process.returncode != 0:
        text = log.read_text(encoding="utf-8").strip()
        reason = message("text", text=text) if text else message("load_generator_killed")
        raise RobotNotReady(message("load_generator_failed", case=case.name, reason=reason))
    latencies = np.fromfile(output, dtype=np.int64).reshape(case.arms, -1)
    return Load(json.loads(summary), latencies, (after[0] - before[0], after[1] - before[1]), end - begin)


def run_case(workshop: Workshop, case: Case, number: int, cycles: int) -> Run:
    """One fresh server under load.

    Raises:
        RobotNotReady: it did not start, did not answer as it should, or stopped answering.
    """
    log = workshop.products / f"{case.name.replace('/', '-')}.log"
    busy = busy_loops() if case.is_machine_busy else nullcontext()
    with Server(workshop, case.contender, case.arms, log) as server, busy:
        load = put_load(workshop, server, case, cycles)
    return Run(
        round=number,
        case=case,
        cycles=load.summary["cycles"],
        duration=load.summary["duration_s"],
        cpu_percent=cpu_percent(load.cpu[0], load.wall),
        cpu_all_percent=cpu_percent(load.cpu[1], load.wall),
        generator_late_max_us=load.summary["generator_late_max_us"],
        arms=load.arms,
        heard=server.reported["heard"],
        stages=server.reported["stages"],
        unanswered=server.reported["unanswered"],
        latencies=load.latencies,
    )


@contextmanager
def busy_loops() -> Iterator[None]:
    """Other programs that compute all the time meanwhile, without a priority of their own."""
    loops = [
        subprocess.Popen([sys.executable, "-c", "while True: pass"], start_new_session=True) for _ in range(BUSY_LOOPS)
    ]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
        for loop in loops:
            loop.wait()


def cpu_percent(used: float, wall: float) -> float:
    """``used`` [s] of ``wall`` [s] in percent of one core; nan of a run that is too short for the kernel's ticks."""
    return 100.0 * used / wall if wall >= _SHORTEST_COUNTED else nan


@dataclass(slots=True)
class Endured:
    """One server over all its chunks.

    Attributes:
        chunks: per chunk, both arms.
        cycles: of each arm, in all.
        resident_kib: memory of the process that answers, after each chunk [KiB].
        cpu_percent: of one core, per chunk, used by that process.
    """

    chunks: list[tuple[ArmRun, ...]] = field(default_factory=list)
    cycles: int = 0
    resident_kib: list[int] = field(default_factory=list)
    cpu_percent: list[float] = field(default_factory=list)


def chunks_of(minutes: float) -> int:
    """How many chunks each server has; at least two, so that growth can be seen."""
    return max(2, round(minutes * 60.0 / CHUNK))


def soak(workshop: Workshop, contender: Contender, minutes: float, on_chunk: Callable[[], None]) -> dict[str, Endured]:
    """Load ``contender`` and the C echo in turn, each for ``minutes``; Ctrl-C ends it with what there is.

    The second half is beside busy loops.

    Raises:
        RobotNotReady: one of them did not start, did not answer as it should, or stopped answering.
    """
    endured = {contender.name: Endured(), ECHO.name: Endured()}
    with ExitStack() as stack:
        servers = {
            each: stack.enter_context(Server(workshop, each, ARMS, workshop.products / f"soak-{each.name}.log"))
            for each in (contender, ECHO)
        }
        with suppress(KeyboardInterrupt):  # the report is made of the chunks that are there
            count = chunks_of(minutes)
            for number, (each, server) in product(range(count), servers.items()):
                with busy_loops() if 2 * number >= count else nullcontext():
                    load = put_load(workshop, server, Case(each, Mode.PACED, ARMS), round(CHUNK / PERIOD_US * 1e6))
                found = endured[each.name]
                found.chunks.append(load.arms)
                found.cycles += load.summary["cycles"]
                found.resident_kib.append(server.resident_kib())
                found.cpu_percent.append(100.0 * load.cpu[0] / load.wall)
                on_chunk()
    return {name: each for name, each in endured.items() if each.chunks}


def soak_document(endured: dict[str, Endured]) -> dict[str, Any]:
    """The figures of a soak under stable names; of latencies those of the worst arm and chunk."""
    content: dict[str, Any] = {}
    for name, each in endured.items():
        arms = [arm for chunk in each.chunks for arm in chunk]
        content[name] = {
            "cycles_per_arm": each.cycles,
            **{counter: sum(int(getattr(arm, counter)) for arm in arms) for counter in COUNTERS},
            **{f"worst_{figure}": max(float(getattr(arm.latency, figure)) for arm in arms) for figure in LATENCIES},
            "resident_kib": each.resident_kib,
            "growth_kib": each.resident_kib[-1] - each.resident_kib[0],
            "cpu_percent": each.cpu_percent,
            "missed_per_chunk": [sum(arm.missed for arm in chunk) for chunk in each.chunks],
        }
    if ECHO.name in content:
        allowed = content[ECHO.name]["missed"] + MISSED_OVER_ECHO
        for each in content.values():
            each["missed_allowed"] = allowed
    return content


def _goal() -> str:
    return ",".join(f"{value:g}" for value in GOAL_DEG)


@contextmanager
def _at_most(seconds: float, process: subprocess.Popen[str]) -> Iterator[None]:
    """Kill ``process`` after that time, which ends the reading of its output."""
    timer = Timer(seconds, process.kill)
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()


def _cpu_seconds(pids: Sequence[int]) -> float:
    """Time on a CPU of all threads; a thread that has ended meanwhile is not counted."""
    total = 0
    for pid in pids:
        for thread in Path(f"/proc/{pid}/task").glob("*"):
            with suppress(FileNotFoundError, ProcessLookupError):
                total += int((thread / "schedstat").read_text(encoding="ascii").split()[0])
    return total / 1e9


def _family(pid: int) -> list[int]:
    """The process and all its descendants."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").glob("[0-9]*"):
        with suppress(FileNotFoundError, ProcessLookupError):
            after_name = (entry / "stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2]
            parents[int(entry.name)] = int(after_name.split()[1])
    family = [pid]
    for each in family:  # grows meanwhile: children of children
        family += [child for child, parent in parents.items() if parent == each]
    return family
