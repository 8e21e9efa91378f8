"""The processes of one run: a fresh server, the load generator against it, and what the kernel says they used.

The soak: both arms of one fast line paced for minutes, in chunks, and the C echo in between for comparison.
"""

from __future__ import annotations

import json
import os
import subprocess
from array import array
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from math import nan
from pathlib import Path
from threading import Timer
from time import monotonic
from types import TracebackType
from typing import Any

from yumi.egm.udp import free_port
from yumi.errors import RobotNotReady
from yumi_evaluation.bench.build import ECHO, GOAL_DEG, Case, Contender, Mode, Runtime, Workshop
from yumi_evaluation.bench.figures import COUNTERS, LATENCIES, ArmRun, Run, latency_figures

PERIOD_US = 4000
WARM_UP = 250
"""Cycles sent before counting begins."""

_READY_TIMEOUT = 60.0
_STOP_TIMEOUT = 15.0
_SLACK = 60.0
_GENERATOR_PRIORITY = 80
_PORTS = 2
_SHORTEST_COUNTED = 0.1  # [s]; the kernel counts CPU time in ticks of 10 ms


class Server:
    """A contender in a session of its own, so that Ctrl-C reaches the benchmark only.

    Args:
        workshop: where its program is.
        contender: which.
        arms: ports a server of ours always has two of, others as many as are used.
        log: where its words go.
    """

    def __init__(self, workshop: Workshop, contender: Contender, arms: int, log: Path) -> None:
        self.ports = [free_port() for _ in range(_PORTS)]
        self.pids: list[int] = []
        self.heard: dict[str, int] = {}
        self._contender = contender
        self._log = log
        self._command = [*workshop.command(contender), *_arguments(contender, self.ports, arms)]
        self._environment = _environment(workshop)

    def __enter__(self) -> Server:
        with self._log.open("w", encoding="utf-8") as log:
            self._process = subprocess.Popen(
                self._command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
                start_new_session=True,
                env=self._environment,
            )
        try:
            self._wait_until_ready()
        except BaseException:
            self.stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def stop(self) -> None:
        """End it, in order where it knows how; its last words are kept."""
        if self._contender.runtime is not Runtime.OURS:
            self._process.terminate()
        try:
            words, _ = self._process.communicate(timeout=_STOP_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            words, _ = self._process.communicate()
        for line in words.splitlines():
            if line.startswith("heard "):
                self.heard = json.loads(line.removeprefix("heard "))

    def cpu_seconds(self) -> tuple[float, float]:
        """CPU time of the processes that answer, and of all that belong to the server [s]."""
        return _cpu_seconds(self.pids), _cpu_seconds(_family(self._process.pid))

    def resident_kib(self) -> int:
        """Memory of the processes that answer [KiB]."""
        return sum(_resident_kib(pid) for pid in self.pids)

    def _wait_until_ready(self) -> None:
        assert self._process.stdout is not None
        with _at_most(_READY_TIMEOUT, self._process):
            first = self._process.stdout.readline().split()
        if first[:1] != ["ready"]:
            raise RobotNotReady(f"The {self._contender.title} did not start; see {self._log}.")
        self.pids = [int(word) for word in first[1:]]


@dataclass(frozen=True, slots=True)
class Load:
    """What the load generator did and saw.

    Attributes:
        summary: its JSON.
        latencies: per arm, of every counted cycle [ns]; 0 without a reply.
        cpu: CPU time of the answering process and of all while it ran [s].
        wall: how long that was [s].
    """

    summary: Mapping[str, Any]
    latencies: tuple[array[int], ...]
    cpu: tuple[float, float]
    wall: float


def put_load(workshop: Workshop, server: Server, case: Case, cycles: int) -> Load:
    """Run the load generator against ``server``.

    Raises:
        RobotNotReady: the server did not guide the robot, or stopped answering.
    """
    output = workshop.products / "latencies.bin"
    command = _generator_command(workshop, server, case, cycles, output)
    words = workshop.products / "load_generator.log"
    with (
        words.open("w", encoding="utf-8") as log,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True, start_new_session=True) as process,
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
        reason = words.read_text(encoding="utf-8").strip() or "The load generator was killed."
        raise RobotNotReady(f"{case.name}: {reason}")
    parsed: dict[str, Any] = json.loads(summary)
    used = (after[0] - before[0], after[1] - before[1])
    return Load(parsed, _read_latencies(output, case.arms), used, end - begin)


def run_case(workshop: Workshop, case: Case, number: int, cycles: int) -> tuple[Run, tuple[array[int], ...]]:
    """One fresh server under load: its figures and its latencies [ns] per arm.

    Raises:
        RobotNotReady: it did not start, did not guide the robot, or stopped answering.
    """
    log = workshop.products / f"{case.name.replace('/', '-')}.log"
    with Server(workshop, case.contender, case.arms, log) as server:
        load = put_load(workshop, server, case, cycles)
    run = Run(
        round=number,
        case=case,
        cycles=load.summary["cycles"],
        duration=load.summary["duration_s"],
        cpu_percent=cpu_percent(load.cpu[0], load.wall),
        cpu_all_percent=cpu_percent(load.cpu[1], load.wall),
        generator_late_max_us=load.summary["generator_late_max_us"],
        arms=arm_runs(load),
        heard=server.heard,
    )
    return run, load.latencies


def arm_runs(load: Load) -> tuple[ArmRun, ...]:
    """The figures of each arm."""
    return tuple(
        ArmRun(
            latency_figures(latencies),
            missed=arm["missed"],
            stale=arm["stale"],
            bad=arm["bad"],
            recovering=arm["recovering"],
            unparsed=arm["unparsed"],
            duplicates=arm["duplicates"],
        )
        for arm, latencies in zip(load.summary["arms"], load.latencies, strict=True)
    )


def _arguments(contender: Contender, ports: Sequence[int], arms: int) -> list[str]:
    used = [str(port) for port in ports[:arms]]
    goal = ",".join(f"{value:g}" for value in GOAL_DEG)
    if contender.runtime is Runtime.COMPILED:
        return used
    if contender.runtime is Runtime.PEERS:
        return [used[0], f"{contender.gain:g}", goal]
    both = [str(port) for port in ports]
    return ["--ports", *both, "--gain", f"{contender.gain:g}", f"--goal={goal}", *contender.options]


def _generator_command(workshop: Workshop, server: Server, case: Case, cycles: int, output: Path) -> list[str]:
    ports = [word for port in server.ports[: case.arms] for word in ("--port", str(port))]
    numbers = {
        "--cycles": cycles, "--warm-up": WARM_UP, "--period-us": PERIOD_US, "--gain": case.contender.gain,
        "--priority": _GENERATOR_PRIORITY, "--lead-in-ms": round(case.lead_in * 1e3),
    }  # fmt: skip
    options = [word for name, value in numbers.items() for word in (name, str(value))]
    goal = f"--goal={','.join(f'{value:g}' for value in GOAL_DEG)}"
    pin = ["--cpu", "0"] if (os.cpu_count() or 1) > 1 else []
    ping_pong = ["--ping-pong"] if case.mode is Mode.PING_PONG else []
    return [str(workshop.load_generator), *ports, *options, goal, "--output", str(output), *pin, *ping_pong]


def _environment(workshop: Workshop) -> dict[str, str]:
    """A ROS domain of its own on this machine only, and nothing written outside of the clone."""
    own = {
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_LOG_DIR": str(workshop.products / "ros"),
    }
    return {**os.environ, **own}


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


def _read_latencies(file: Path, arms: int) -> tuple[array[int], ...]:
    values = array("q", file.read_bytes())
    each = len(values) // arms
    return tuple(values[index * each : (index + 1) * each] for index in range(arms))


def _resident_kib(pid: int) -> int:
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS"))


def cpu_percent(used: float, wall: float) -> float:
    """``used`` [s] of ``wall`` [s] in percent of one core; nan of a run that is too short for the kernel's ticks."""
    return 100.0 * used / wall if wall >= _SHORTEST_COUNTED else nan


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
    for each in family:  # grows while it is walked: children of children
        family += [child for child, parent in parents.items() if parent == each]
    return family


CHUNK = 30.0
"""How long one of the two is under load before the other is [s]."""

ARMS = 2


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

    def count(self, counter: str) -> int:
        """A counter over all arms and chunks."""
        return sum(int(getattr(arm, counter)) for arms in self.chunks for arm in arms)

    def worst(self, figure: str) -> float:
        """A latency figure of the worst arm and chunk [µs]."""
        return max(float(getattr(arm.latency, figure)) for arms in self.chunks for arm in arms)

    @property
    def growth_kib(self) -> int:
        """Memory after the last chunk less that after the first [KiB]."""
        return self.resident_kib[-1] - self.resident_kib[0]


def chunks_of(minutes: float) -> int:
    """How many chunks each server has; at least two, so that growth can be seen."""
    return max(2, round(minutes * 60.0 / CHUNK))


def soak(workshop: Workshop, contender: Contender, minutes: float, on_chunk: Callable[[], None]) -> dict[str, Endured]:
    """Load ``contender`` and the C echo in turn, each for ``minutes``; Ctrl-C ends it with what there is.

    Raises:
        RobotNotReady: one of them did not start, did not guide the robot, or stopped answering.
    """
    endured = {contender.name: Endured(), ECHO.name: Endured()}
    with ExitStack() as stack:
        servers = {
            each.name: stack.enter_context(Server(workshop, each, ARMS, workshop.products / f"soak-{each.name}.log"))
            for each in (contender, ECHO)
        }
        with suppress(KeyboardInterrupt):  # the report is made of the chunks that are there
            for _ in range(chunks_of(minutes)):
                for each in (contender, ECHO):
                    _endure(workshop, servers[each.name], each, endured[each.name])
                    on_chunk()
    return {name: each for name, each in endured.items() if each.chunks}


def soak_document(endured: dict[str, Endured]) -> dict[str, Any]:
    """The figures of a soak under stable names."""
    return {
        name: {
            "cycles_per_arm": each.cycles,
            **{counter: each.count(counter) for counter in COUNTERS},
            **{f"worst_{figure}": each.worst(figure) for figure in LATENCIES},
            "resident_kib": each.resident_kib,
            "growth_kib": each.growth_kib,
            "cpu_percent": each.cpu_percent,
            "missed_per_chunk": [sum(arm.missed for arm in arms) for arms in each.chunks],
        }
        for name, each in endured.items()
    }


def _endure(workshop: Workshop, server: Server, contender: Contender, endured: Endured) -> None:
    load = put_load(workshop, server, Case(contender, Mode.PACED, ARMS), round(CHUNK / PERIOD_US * 1e6))
    endured.chunks.append(arm_runs(load))
    endured.cycles += load.summary["cycles"]
    endured.resident_kib.append(server.resident_kib())
    endured.cpu_percent.append(100.0 * load.cpu[0] / load.wall)
