"""The soak: both arms of one fast line paced for minutes, in chunks, and the C echo in between for comparison."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from typing import Any

from yumi.evaluation.bench_build import Workshop
from yumi.evaluation.bench_contenders import ECHO, Case, Contender, Mode
from yumi.evaluation.bench_figures import COUNTERS, LATENCIES, ArmRun
from yumi.evaluation.bench_processes import PERIOD_US, Server, arm_runs, put_load

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
