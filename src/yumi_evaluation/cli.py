"""``yumi evaluate`` and ``yumi tune``: the thesis's experiments repeated with a report, and gains recommended.

``yumi bench``: how fast robot datagrams are answered, beside what else there is, on this machine in this hour.
"""

from __future__ import annotations

import json
import os
import platform
import signal
import sys
from array import array
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from yumi import __version__
from yumi.cli.options import limit_discovery, password_options
from yumi.driver.settings import MAX_PORT
from yumi.errors import CommandRefused, MissingPrerequisite, RobotNotReady, SettingsError, YumiError
from yumi_evaluation.bench.build import (
    WAKE_MODES,
    Case,
    Contender,
    Mode,
    Runtime,
    Workshop,
    cases_of,
    compile_programs,
    contenders,
    fast_line,
    find_workshop,
    install_peers,
    schedule,
)
from yumi_evaluation.bench.figures import Figures, Run, draw_histograms
from yumi_evaluation.bench.report import document, latency_table, ratio_table, target_table
from yumi_evaluation.bench.run import ARMS, PERIOD_US, WARM_UP, chunks_of, run_case, soak, soak_document
from yumi_evaluation.experiments import DEFAULT_PASSWORD, DEFAULT_USER, RobotPlace

if TYPE_CHECKING:
    from yumi_evaluation.experiments import Recommendation
    from yumi_evaluation.results import Results

_INTERRUPTED = 130
_TABLE_WIDTH = 110
_GAIN_STEP = 0.1
_FOLDER = Path("build/evaluation")
_PICTURE = Path("build/tune.svg")


class _Ended(Exception):
    """Ctrl-C: report what is there."""


@click.command()
@click.option("--virtual-time", is_flag=True, help="Without ROS 2 and without waiting; the same figures every time.")
@click.option("--robot", help="Address of a real controller; without it a virtual one is started.")
@click.option(
    "--rws-port", type=click.IntRange(1, MAX_PORT), default=80, show_default=True, help="Of a real controller."
)
@click.option("--user", default=DEFAULT_USER, show_default=True, help="On a real controller.")
@password_options
@click.option("--yes", is_flag=True, help="Do not ask before a real robot moves.")
@click.option(
    "--round-trips",
    type=click.IntRange(10, 1_000_000),
    default=10_000,
    show_default=True,
    help="In real time, of each kind.",
)
@click.option(
    "--output", type=click.Path(path_type=Path), default=_FOLDER, show_default=True, help="Folder of the report."
)
@click.option("--json", "report", type=click.Path(path_type=Path), help="Also write every figure to this file.")
def evaluate(
    virtual_time: bool,
    robot: str | None,
    rws_port: int,
    user: str,
    password: str | None,
    yes: bool,
    round_trips: int,
    output: Path,
    report: Path | None,
) -> None:
    r"""Repeat the thesis's experiments and write a report beside what it published.

    In real time a virtual controller, the driver and an application run as processes of their own, after everything was
    run in virtual time, to compare with. Ctrl-C ends it early; the report then is about what was done until then.

    \b
    Examples:
      yumi evaluate --virtual-time                        everything but ROS 2, in about twenty seconds
      yumi evaluate --virtual-time --json figures.json
      yumi evaluate                                       over ROS 2 and the wire, too: about ten minutes
      yumi evaluate --robot 192.168.125.1                 on a real robot; the workspace has to be free
    """
    from yumi_evaluation.results import Results, evaluate_virtually, virtual_step_count  # noqa: PLC0415

    if virtual_time and robot:
        raise CommandRefused("A real robot knows no virtual time; give either --robot or --virtual-time.")
    if robot and not yes:
        click.confirm(
            f"Joint 6 and then all joints of the robot at {robot} will move. Is its workspace free?", abort=True
        )
    console = Console(highlight=False)
    console.width = max(console.width, _TABLE_WIDTH)
    results = Results(settings=_settings("virtual time" if virtual_time else "real time", robot))
    with _ends_on_interrupt() as check:
        try:
            with _bar(console, virtual_step_count(), check) as on_step:
                evaluate_virtually(results, on_step)
            if not virtual_time:
                place = RobotPlace(robot, rws_port, user, password or DEFAULT_PASSWORD)
                _evaluate_on_wire(results, console, check, place, round_trips, output)
            results.is_complete = not results.failures
        except _Ended:
            console.print("Ended early; the report is about what was done until now.")
        except YumiError:
            _finish(results, console, output, report)
            raise
    _finish(results, console, output, report)
    if results.failures:
        raise RobotNotReady(f"{len(results.failures)} experiments could not be run; the report says why.")
    if not results.is_complete:
        sys.exit(_INTERRUPTED)


def _evaluate_on_wire(
    results: Results,
    console: Console,
    check: Callable[[], None],
    place: RobotPlace,
    round_trips: int,
    output: Path,
) -> None:
    os.environ.setdefault("ROS_LOG_DIR", str((output / "ros").absolute()))
    limit_discovery()
    try:
        from yumi_evaluation.networked import WirePlan, evaluate_on_wire, wire_step_count  # noqa: PLC0415 - needs ROS 2
    except ImportError as error:
        raise MissingPrerequisite(
            f"ROS 2 is missing ({error}); run `make setup` in a clone of yumi-ros2, or add --virtual-time."
        ) from error
    with _bar(console, wire_step_count(), check) as on_step:
        plan = WirePlan(place, round_trips, output / "wire")
        evaluate_on_wire(results, plan, on_step, check)


@click.command()
@click.option("--from", "lowest", type=click.FloatRange(0.1, 4.0), default=0.4, show_default=True, help="Lowest gain.")
@click.option("--to", "highest", type=click.FloatRange(0.1, 10.0), default=3.0, show_default=True, help="Highest gain.")
@click.option("--step", "size", type=click.FloatRange(0.5, 60.0), default=10.0, show_default=True, help="Step [°].")
@click.option("--reduced", is_flag=True, help="At 10 °/s, the thesis's reduced speed, instead of 180 °/s.")
@click.option("--picture", type=click.Path(dir_okay=False, path_type=Path), default=_PICTURE, show_default=True)
def tune(lowest: float, highest: float, size: float, reduced: bool, picture: Path) -> None:
    r"""Sweep the proportional gain in virtual time and recommend one, with a picture.

    Every gain makes a step twice: of the virtual robot, and of one that answers 20 ms later. Recommended is the gain
    whose slower step is the quickest, of those with which neither goes past the goal.

    \b
    Examples:
      yumi tune
      yumi tune --reduced --step 5
      ros2 param set /r/joint_position_controller p 1.6     to use what it recommends
    """
    from yumi_evaluation.experiment import Mode  # noqa: PLC0415
    from yumi_evaluation.experiments import Task, recommend  # noqa: PLC0415

    if lowest >= highest:
        raise CommandRefused(f"The gains go from {lowest:g} to {highest:g}; --from must be below --to.")
    count = round((highest - lowest) / _GAIN_STEP)
    gains = [round(lowest + _GAIN_STEP * number, 3) for number in range(count + 1)]
    console = Console(highlight=False)
    task = Task(size_deg=size, mode=Mode.REDUCED if reduced else Mode.FULLSPEED)
    with _ends_on_interrupt() as check, _bar(console, 2 * len(gains), check) as on_step:
        try:
            found = recommend(gains, task, lambda: on_step("Steps"))
        except _Ended:
            sys.exit(_INTERRUPTED)
    _show(found, console, picture)


def _finish(results: Results, console: Console, output: Path, report: Path | None) -> None:
    from yumi_evaluation.report import write_report  # noqa: PLC0415
    from yumi_evaluation.results import write_json  # noqa: PLC0415 - a quick --help
    from yumi_evaluation.screen import print_results  # noqa: PLC0415

    if not results.runs:
        console.print("No experiment came to its end: there is nothing to report.")
        sys.exit(_INTERRUPTED)
    results.close()
    print_results(results, console)
    console.print(f"Report: {write_report(results, output)}")
    if report:
        report.parent.mkdir(parents=True, exist_ok=True)
        write_json(results, report)


def _show(found: Recommendation, console: Console, picture: Path) -> None:
    from yumi_evaluation.screen import draw_recommendation, recommendation_text  # noqa: PLC0415 - as above

    console.print(recommendation_text(found))
    draw_recommendation(found, picture)
    console.print(f"Picture: {picture}")


def _settings(mode: str, robot: str | None) -> dict[str, dict[str, object]]:
    """What the report says of how it was made."""
    from yumi_evaluation.report import model_settings  # noqa: PLC0415 - a quick --help

    return {
        "evaluation": {"mode": mode, "robot": robot or "virtual"},
        **model_settings(),
        "versions": {"yumi-ros2": __version__, "python": platform.python_version()},
        "machine": {"cpus": os.cpu_count(), "processor": platform.machine(), "system": platform.platform()},
    }


@contextmanager
def _ends_on_interrupt() -> Iterator[Callable[[], None]]:
    """Gives a check that raises once Ctrl-C was pressed."""
    pressed = []

    def note(number: int, frame: FrameType | None) -> None:
        pressed.append(number)

    def check() -> None:
        if pressed:
            raise _Ended

    before = signal.signal(signal.SIGINT, note)
    try:
        yield check
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _bar(console: Console, total: int, check: Callable[[], None]) -> Iterator[Callable[[str], None]]:
    """A progress bar; what it gives is called with the name of each step, and ends it on Ctrl-C.

    Nothing is drawn during a step, so that nothing disturbs what is measured.
    """
    columns = (TextColumn("{task.description:44.44}"), BarColumn(24), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, auto_refresh=False) as progress:
        task = progress.add_task("", total=total)

        told = ""

        def on_step(title: str) -> None:
            nonlocal told
            check()
            if not console.is_terminal and title != told:  # where no bar can move
                console.print(title)
            told = title
            progress.update(task, description=title, advance=1, refresh=True)

        yield on_step


QUICK = (2, 500)
"""Rounds and cycles to look at, not to judge by."""

_INCOMPLETE = 1
_CLI_BENCH_TABLE_WIDTH = 92  # a table that is cut says nothing, a line that a narrow terminal breaks still does
_START = 4.0  # [s] what a fresh server takes, for the announcement
_PANELS = {(Mode.PACED, 1): "one arm, 250 Hz", (Mode.PACED, 2): "two arms, 250 Hz", (Mode.PING_PONG, 1): "ping-pong"}


@click.command()
@click.option("--rounds", type=click.IntRange(1, 100), default=5, show_default=True, help="Each contender, so often.")
@click.option(
    "--cycles", type=click.IntRange(100, 500_000), default=4000, show_default=True, help="Counted cycles of a run."
)
@click.option("--quick", is_flag=True, help="Two rounds of 500 cycles: to look at, not to judge by.")
@click.option("--only", multiple=True, metavar="NAME", help="Only this contender; may be repeated.")
@click.option("--wake", multiple=True, type=click.Choice(WAKE_MODES), help="Only this egm.wake; may be repeated.")
@click.option("--seed", default=1, show_default=True, help="Of the order within the rounds.")
@click.option("--soak", "minutes", type=click.FloatRange(0.5, 1440.0), help="Instead: both arms for so many minutes.")
@click.option("--json", "report", type=click.Path(path_type=Path), help="Write every figure to this file.")
@click.option("--histograms", type=click.Path(path_type=Path), help="Where the picture goes.  [build/bench/*.png]")
def bench(
    rounds: int,
    cycles: int,
    quick: bool,
    only: tuple[str, ...],
    wake: tuple[str, ...],
    seed: int,
    minutes: float | None,
    report: Path | None,
    histograms: Path | None,
) -> None:
    r"""Measure the time from a robot datagram to its reply, interleaved with others.

    Every run starts a fresh server; a load generator plays the robot on this machine. Ctrl-C reports what is there.

    \b
    Examples:
      yumi bench --quick
      yumi bench --rounds 5 --cycles 15000 --json figures.json
      yumi bench --soak 10
    """
    workshop = find_workshop()
    console = Console(highlight=False)
    console.width = max(console.width, _CLI_BENCH_TABLE_WIDTH)
    machine = _machine()
    if minutes is not None:
        compile_programs(workshop)
        _soak(workshop, console, machine, minutes, (wake or WAKE_MODES)[-1], report)
        return
    rounds, cycles = QUICK if quick else (rounds, cycles)
    chosen = _chosen(wake or WAKE_MODES, only)
    _prepare(workshop, console, chosen)
    plan = schedule(cases_of(chosen), rounds, seed)
    _announce(console, plan, rounds, cycles)
    figures, latencies = _run_all(workshop, console, plan, cycles)
    if not figures.runs:
        console.print("No run came to its end: there is nothing to report.")
        sys.exit(_INCOMPLETE)
    console.print(latency_table(figures), ratio_table(figures), target_table(figures))
    picture = histograms or workshop.products / "histograms.png"
    draw_histograms(_panels(latencies), picture)
    console.print(f"Histograms: {picture}")
    settings = {
        "rounds": rounds, "cycles": cycles, "warm_up_cycles": WARM_UP, "period_us": PERIOD_US, "seed": seed,
        "contenders": [each.name for each in chosen],
    }  # fmt: skip
    is_complete = len(figures.runs) == len(plan)
    _write(report, document(figures, settings, machine, is_complete=is_complete))
    sys.exit(0 if is_complete else _INCOMPLETE)


def _chosen(wake: tuple[str, ...], only: tuple[str, ...]) -> list[Contender]:
    everybody = contenders(wake)
    for name in only:
        if name not in {each.name for each in everybody}:
            known = ", ".join(each.name for each in everybody)
            raise SettingsError(f"There is no contender {name!r}; there are: {known}.")
    return [each for each in everybody if not only or each.name in only]


def _prepare(workshop: Workshop, console: Console, chosen: list[Contender]) -> None:
    compile_programs(workshop)
    if any(each.runtime is Runtime.PEERS for each in chosen):
        console.print("Peers from PyPI: into build/bench-venv, if they are not there yet")
        install_peers(workshop)


def _announce(console: Console, plan: list[tuple[int, Case]], rounds: int, cycles: int) -> None:
    paced = sum(case.mode is Mode.PACED for _, case in plan)
    seconds = paced * (cycles + WARM_UP) * PERIOD_US / 1e6 + len(plan) * _START
    console.print(f"{len(plan)} runs in {rounds} rounds of {cycles} cycles: about {seconds / 60.0:.0f} minutes.")


def _run_all(
    workshop: Workshop, console: Console, plan: list[tuple[int, Case]], cycles: int
) -> tuple[Figures, dict[Case, array[int]]]:
    runs: list[Run] = []
    latencies: dict[Case, array[int]] = defaultdict(lambda: array("q"))
    with _cli_bench_bar(console, len(plan)) as advance:
        try:
            for number, case in plan:
                advance(f"round {number}: {case.name}", 0)
                try:
                    run, measured = run_case(workshop, case, number, cycles)
                except RobotNotReady as error:
                    console.print(f"Round {number}: {error}")
                    continue
                runs.append(run)
                for arm in measured:
                    latencies[case].extend(arm)
                advance("", 1)
        except KeyboardInterrupt:
            console.print("Interrupted: the report is about the runs that have ended.")
    return Figures(tuple(runs)), latencies


@contextmanager
def _cli_bench_bar(console: Console, total: int) -> Iterator[Any]:
    """A progress bar that is drawn between the runs only: a redraw during one would be measured along."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), console=console, auto_refresh=False) as progress:
        task = progress.add_task("", total=total)

        def advance(what: str, steps: int) -> None:
            progress.update(task, description=what, advance=steps)
            progress.refresh()

        yield advance


def _panels(latencies: dict[Case, array[int]]) -> dict[str, dict[str, list[float]]]:
    panels: dict[str, dict[str, list[float]]] = {}
    for (mode, arms), title in _PANELS.items():
        contents = {
            case.contender.title: [value / 1000.0 for value in values if value > 0]
            for case, values in sorted(latencies.items(), key=lambda item: item[0].name)
            if case.mode is mode and case.arms == arms
        }
        if contents:
            panels[title] = contents
    return panels


def _soak(
    workshop: Workshop, console: Console, machine: dict[str, Any], minutes: float, wake: str, report: Path | None
) -> None:
    chunks = chunks_of(minutes)
    console.print(f"{ARMS} arms, {minutes:g} minutes each for the fast line ({wake}) and the C echo, in turns.")
    with _cli_bench_bar(console, 2 * chunks) as advance:
        endured = soak(workshop, fast_line(wake), minutes, lambda: advance("soak", 1))
    figures = soak_document(endured)
    for name, each in figures.items():
        console.print(
            f"{name}: missed {each['missed']} of {ARMS * each['cycles_per_arm']}, bad {each['bad']}, worst p99 "
            f"{each['worst_p99_us']:.0f} µs, max {each['worst_max_us']:.0f} µs, memory {each['growth_kib']:+d} KiB "
            f"after the first chunk ({each['resident_kib'][-1]} KiB)"
        )
    settings = {"minutes": minutes, "period_us": PERIOD_US, "arms": ARMS, "wake": wake}
    _write(report, {"format": "yumi-bench-soak/1", "machine": machine, "settings": settings, "soak": figures})


def _machine() -> dict[str, Any]:
    return {
        "cpus": os.cpu_count(),
        "processor": platform.machine(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "load_before": os.getloadavg()[0],
    }


def _write(report: Path | None, content: dict[str, Any]) -> None:
    if report:
        report.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")
