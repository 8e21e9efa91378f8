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
from yumi.cli_options import limit_discovery, password_options
from yumi.errors import CommandRefused, MissingPrerequisite, RobotNotReady, YumiError
from yumi.evaluation.robot_place import DEFAULT_PASSWORD, DEFAULT_USER, RobotPlace
from yumi.settings import MAX_PORT

if TYPE_CHECKING:
    from yumi.evaluation.evaluation_results import Results
    from yumi.evaluation.gain_sweep import Recommendation

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
    """Repeat the thesis's experiments and write a report beside what it published.

    In real time a virtual controller, the driver and an application run as processes of their own, after everything was
    run in virtual time, to compare with. Ctrl-C ends it early; the report then is about what was done until then.

    \b
    Examples:
      yumi evaluate --virtual-time                        everything but ROS 2, in about twenty seconds
      yumi evaluate --virtual-time --json figures.json
      yumi evaluate                                       over ROS 2 and the wire, too: about ten minutes
      yumi evaluate --robot 192.168.125.1                 on a real robot; the workspace has to be free
    """
    from yumi.evaluation.evaluation_results import Results, evaluate_virtually, virtual_step_count  # noqa: PLC0415

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
        from yumi.wire_evaluation import WirePlan, evaluate_on_wire, wire_step_count  # noqa: PLC0415 - needs ROS 2
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
    """Sweep the proportional gain in virtual time and recommend one, with a picture.

    Every gain makes a step twice: of the virtual robot, and of one that answers 20 ms later. Recommended is the gain
    whose slower step is the quickest, of those with which neither goes past the goal.

    \b
    Examples:
      yumi tune
      yumi tune --reduced --step 5
      ros2 param set /r/joint_position_controller p 1.6     to use what it recommends
    """
    from yumi.evaluation.experiment import Mode  # noqa: PLC0415
    from yumi.evaluation.gain_sweep import Task, recommend  # noqa: PLC0415

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
    from yumi.evaluation.evaluation_files import write_json  # noqa: PLC0415 - a quick --help
    from yumi.evaluation.evaluation_report import write_report  # noqa: PLC0415
    from yumi.evaluation.evaluation_screen import print_results  # noqa: PLC0415

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
    from yumi.evaluation.evaluation_screen import draw_recommendation, recommendation_text  # noqa: PLC0415 - as above

    console.print(recommendation_text(found))
    draw_recommendation(found, picture)
    console.print(f"Picture: {picture}")


def _settings(mode: str, robot: str | None) -> dict[str, dict[str, object]]:
    """What the report says of how it was made."""
    from yumi.evaluation.evaluation_tables import model_settings  # noqa: PLC0415 - a quick --help

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
