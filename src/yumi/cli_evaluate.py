"""``yumi evaluate`` and ``yumi tune``: the thesis's experiments repeated with a report, and gains recommended."""

from __future__ import annotations

import os
import platform
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from yumi import __version__

if TYPE_CHECKING:
    from yumi.evaluation.evaluation_results import Results
    from yumi.evaluation.gain_sweep import Recommendation

_INTERRUPTED = 130
_TABLE_WIDTH = 110
_FOLDER = Path("build/evaluation")
_PICTURE = Path("build/tune.svg")


class _Ended(Exception):
    """Ctrl-C: report what is there."""


@click.command()
@click.option("--virtual-time", is_flag=True, help="Without ROS 2 and without waiting; the same figures every time.")
@click.option(
    "--output", type=click.Path(path_type=Path), default=_FOLDER, show_default=True, help="Folder of the report."
)
@click.option("--json", "report", type=click.Path(path_type=Path), help="Also write every figure to this file.")
def evaluate(virtual_time: bool, output: Path, report: Path | None) -> None:
    """Repeat the thesis's experiments and write a report beside what it published.

    Ctrl-C ends it early; the report then is about what was done until then.

    \b
    Examples:
      yumi evaluate --virtual-time                  everything, in half a minute
      yumi evaluate --virtual-time --json figures.json
    """
    from yumi.evaluation.evaluation_results import Results, evaluate_virtually, virtual_step_count  # noqa: PLC0415

    console = Console(highlight=False)
    console.width = max(console.width, _TABLE_WIDTH)
    results = Results(settings=_settings("virtual time"))
    with _ends_on_interrupt() as check, _bar(console, virtual_step_count(), check) as on_step:
        try:
            evaluate_virtually(results, on_step)
            results.is_complete = True
        except _Ended:
            console.print("Ended early; the report is about what was done until now.")
    _finish(results, console, output, report)


@click.command()
@click.option("--from", "lowest", type=click.FloatRange(0.1, 4.0), default=0.4, show_default=True, help="Lowest gain.")
@click.option("--to", "highest", type=click.FloatRange(0.1, 10.0), default=3.0, show_default=True, help="Highest gain.")
@click.option("--step", "size", type=click.FloatRange(0.5, 60.0), default=10.0, show_default=True, help="Step [°].")
@click.option("--reduced", is_flag=True, help="At 10 °/s, the thesis's reduced speed, instead of 180 °/s.")
@click.option("--picture", type=click.Path(dir_okay=False, path_type=Path), default=_PICTURE, show_default=True)
def tune(lowest: float, highest: float, size: float, reduced: bool, picture: Path) -> None:
    """Sweep the proportional gain in virtual time and recommend one, with a picture.

    Every gain makes a step twice: of the virtual robot, and of one that answers 20 ms later. Recommended is the gain
    whose slower step is the quickest, of those with which neither goes past the goal.

    \b
    Examples:
      yumi tune
      yumi tune --reduced --step 5
      ros2 param set /r/joint_position_controller p 1.6     to use what it recommends
    """
    from yumi.errors import CommandRefused  # noqa: PLC0415 - a quick --help
    from yumi.evaluation.experiment import Mode  # noqa: PLC0415
    from yumi.evaluation.gain_sweep import Task, recommend  # noqa: PLC0415

    if lowest >= highest:
        raise CommandRefused(f"The gains go from {lowest:g} to {highest:g}; --from must be below --to.")
    gains = [round(lowest + (highest - lowest) * number / 20.0, 3) for number in range(21)]
    console = Console(highlight=False)
    task = Task(size_deg=size, mode=Mode.REDUCED if reduced else Mode.FULLSPEED)
    with _ends_on_interrupt() as check, _bar(console, 2 * len(gains), check) as on_step:
        try:
            found = recommend(gains, task, lambda: on_step("Steps"))
        except _Ended:
            sys.exit(_INTERRUPTED)
    _show(found, console, picture)


def _finish(results: Results, console: Console, output: Path, report: Path | None) -> None:
    from yumi.evaluation.evaluation_files import write_json  # noqa: PLC0415 - a quick --help
    from yumi.evaluation.evaluation_report import write_report  # noqa: PLC0415
    from yumi.evaluation.evaluation_screen import print_results  # noqa: PLC0415

    if not results.runs:
        console.print("No experiment came to its end: there is nothing to report.")
        sys.exit(_INTERRUPTED)
    print_results(results, console)
    console.print(f"Report: {write_report(results, output)}")
    if report:
        report.parent.mkdir(parents=True, exist_ok=True)
        write_json(results, report)
    if not results.is_complete:
        sys.exit(_INTERRUPTED)


def _show(found: Recommendation, console: Console, picture: Path) -> None:
    from yumi.evaluation.evaluation_screen import draw_recommendation, recommendation_text  # noqa: PLC0415 - as above

    console.print(recommendation_text(found))
    draw_recommendation(found, picture)
    console.print(f"Picture: {picture}")


def _settings(mode: str) -> dict[str, dict[str, object]]:
    """Groups of the report's settings that every mode has."""
    return {
        "evaluation": {"mode": mode, "robot": "virtual"},
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
    """A progress bar; what it gives is called with the name of each step, and ends it on Ctrl-C."""
    columns = (TextColumn("{task.description:44.44}"), BarColumn(24), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("", total=total)

        def on_step(title: str) -> None:
            check()
            progress.update(task, description=title, advance=1)

        yield on_step
