"""``yumi evaluate``, ``tune``, ``compare``, ``measure`` and ``bench``; they import what they need when they run."""

from __future__ import annotations

import json
import logging
import os
import platform
import signal
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from importlib.util import find_spec
from pathlib import Path
from shutil import which
from types import FrameType
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from abb_protocols.catalogue import message
from abb_protocols.errors import (
    CommandRefused,
    MissingPrerequisite,
    RobotNotReady,
    SettingsError,
    YumiError,
    missing_extra,
)
from abb_protocols.robot.joints import Side
from abb_runtime.options import (
    ARMS_TYPE,
    STARTED_HELP,
    JsonOutput,
    egm_port_options,
    json_option,
    output_option,
    password_options,
    picture_option,
    robot_option,
    user_option,
    yes_option,
)
from abb_runtime.rws.client import DEFAULT_PASSWORD, DEFAULT_USER
from yumi import __version__
from yumi.cli.driver_options import config_option, limit_discovery, robot_options, settings_of
from yumi.control.motion.robot_response import EGM_GAIN
from yumi.driver.settings import read_controllers

if TYPE_CHECKING:
    from yumi.driver.settings import Settings
    from yumi_evaluation.bench.contenders import Case, Contender
    from yumi_evaluation.comparison import Comparison
    from yumi_evaluation.results import Results

_API_LOG = logging.getLogger("yumi.api")
_INTERRUPTED = 130
_INCOMPLETE = 1
_TABLE_WIDTH = 110
_BENCH_WIDTH = 92  # a table that is cut is useless, a line that a narrow terminal breaks is not
_TUNE_PICTURE = Path("build/tune.svg")
_GAIN_STEP = 0.1
_QUICK = (1, 300)  # rounds and cycles
_START = 4.0  # [s] what a fresh server takes, for the announcement


class _Ended(Exception):
    """Ctrl-C: report what is there."""


@click.command()
@click.option("--virtual-time", is_flag=True, help="Without ROS 2 and without waiting; the same figures every time.")
@robot_option(STARTED_HELP)
@user_option(DEFAULT_USER)
@password_options
@yes_option
@click.option(
    "--round-trips",
    type=click.IntRange(10, 1_000_000),
    default=10_000,
    show_default=True,
    help="In real time, of each kind.",
)
@output_option("build/evaluation")
@json_option
def evaluate(
    virtual_time: bool,
    robot: str | None,
    user: str,
    password: str | None,
    yes: bool,
    round_trips: int,
    output: Path,
    json_output: JsonOutput,
) -> None:
    """Repeat the thesis's experiments and write a report.

    The report has the thesis's figures beside its own; --json writes every figure. A real robot moves only after you
    have confirmed it, or with --yes.

    In real time a virtual controller, the driver and an application run as processes of their own, after everything was
    run in virtual time, to compare with. Ctrl-C ends it early; the report then contains what was done until then.

    \b
    Examples:
      yumi evaluate --virtual-time           without ROS 2: about twenty seconds
      yumi evaluate --virtual-time --json figures.json
      yumi evaluate                          over ROS 2, too: about ten minutes
      yumi evaluate --robot 192.168.125.1    a real robot with a free workspace
    """
    if virtual_time and robot:
        raise CommandRefused(message("real_robot_in_virtual_time"))
    _demand_extra()
    if robot and not yes:
        click.confirm(
            f"Joint 6 and then all joints of the robot at {robot} will move. Is its workspace free?", abort=True
        )
    if not virtual_time:
        os.environ.setdefault("ROS_LOG_DIR", str((output / "ros").absolute()))
        limit_discovery()
        _demand_ros()
    from yumi_evaluation import results as evaluation  # noqa: PLC0415 - a quick --help
    from yumi_evaluation.report import model_settings  # noqa: PLC0415

    console = Console(highlight=False, stderr=json_output.is_printed)
    console.width = max(console.width, _TABLE_WIDTH)
    mode = {
        "mode": "virtual time" if virtual_time else "real time",
        "robot": robot or "virtual",
        "date": f"{datetime.now():%Y-%m-%d %H:%M}",
    }
    commit = (
        subprocess.run(
            ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty"],
            capture_output=True,
            text=True,
            check=False,
        ).stdout.strip()
        if which("git")
        else ""
    )
    versions = {"yumi-ros2": __version__, "python": platform.python_version(), "commit": commit}
    machine = {
        "cpus": os.cpu_count(),
        "processor": platform.machine(),
        "system": platform.platform(),
        "load": round(os.getloadavg()[0], 1),
    }
    settings: dict[str, dict[str, Any]] = {
        "evaluation": mode,
        **model_settings(),
        "versions": versions,
        "machine": machine,
    }
    results = evaluation.Results(settings=settings)
    with _ends_on_interrupt() as check:
        try:
            with _progress(console, evaluation.virtual_step_count(), check) as on_step:
                evaluation.evaluate_virtually(results, on_step)
            if not virtual_time:
                from yumi_evaluation import networked  # noqa: PLC0415 - needs ROS 2

                where = (robot, user, password or DEFAULT_PASSWORD)
                plan = networked.NetworkedPlan(round_trips, output / "networked", *where)
                with _progress(console, networked.networked_step_count(), check) as on_step:
                    networked.evaluate_networked(results, plan, on_step, check)
            results.is_complete = not results.failures
        except _Ended:
            console.print("Ended early; the report contains what was done until now.")
        except YumiError:
            _finish(results, console, output, json_output)
            raise
    _finish(results, console, output, json_output)
    if results.failures:
        raise RobotNotReady(message("experiments_failed", count=len(results.failures)))
    if not results.is_complete:
        sys.exit(_INTERRUPTED)


def _finish(results: Results, console: Console, output: Path, json_output: JsonOutput) -> None:
    from yumi_evaluation.report import print_results, write_report  # noqa: PLC0415 - a quick --help
    from yumi_evaluation.results import document  # noqa: PLC0415

    if not results.runs:
        console.print("No experiment was completed: there is nothing to report.")
        sys.exit(_INTERRUPTED)
    results.close()
    print_results(results, console)
    console.print(f"Report: {write_report(results, output)}")
    json_output.write(json.dumps(document(results), indent=2))


@click.command()
@click.option("--from", "lowest", type=click.FloatRange(0.1, 4.0), default=0.4, show_default=True, help="Lowest gain.")
@click.option("--to", "highest", type=click.FloatRange(0.1, 10.0), default=3.0, show_default=True, help="Highest gain.")
@click.option("--step", "size", type=click.FloatRange(0.5, 60.0), default=10.0, show_default=True, help="Step [°].")
@click.option("--reduced", is_flag=True, help="At 10 °/s, the thesis's reduced speed, instead of 180 °/s.")
@picture_option(str(_TUNE_PICTURE))
@json_option
def tune(
    lowest: float, highest: float, size: float, reduced: bool, picture: Path | None, json_output: JsonOutput
) -> None:
    """Sweep the proportional gain and recommend one.

    It is done in virtual time, with a picture. Every gain makes a step twice: of the virtual robot, and of one that
    answers 20 ms later. Recommended is the gain whose slower step is the quickest, of those with which neither goes
    past the goal.

    \b
    Examples:
      yumi tune
      yumi tune --reduced --step 5
      yumi param r/joint_position_controller p 1.6     to use what it recommends
    """
    if lowest >= highest:
        raise CommandRefused(message("gains_not_in_order", lowest=lowest, highest=highest))
    _demand_extra()
    from yumi_evaluation.experiments import Mode, System, proportional, step  # noqa: PLC0415 - a quick --help
    from yumi_evaluation.gain_sweep import Task, recommend  # noqa: PLC0415
    from yumi_evaluation.pictures import draw_recommendation  # noqa: PLC0415
    from yumi_evaluation.results import Results  # noqa: PLC0415
    from yumi_evaluation.virtual_time import run_virtually  # noqa: PLC0415

    count = round((highest - lowest) / _GAIN_STEP)
    gains = [round(lowest + _GAIN_STEP * number, 3) for number in range(count + 1)]
    console = Console(highlight=False, stderr=json_output.is_printed)
    task = Task(size, Mode.REDUCED if reduced else Mode.FULLSPEED)
    with _ends_on_interrupt() as check, _progress(console, 2 * len(gains), check) as on_step:
        try:
            found = recommend(gains, task, lambda: on_step("Steps"))
        except _Ended:
            sys.exit(_INTERRUPTED)
    (delivered,) = (each for each in read_controllers(Side.RIGHT) if each.name == "joint_position_controller")
    shipped = float(str(delivered.entries["p"].value))
    steps = Results()
    for gain in dict.fromkeys((shipped, found.gain or shipped, found.onset or shipped)):
        experiment = step(proportional(gain), task.mode, task.duration, task.size_deg)
        steps.add(System.SHIPPED, run_virtually(experiment, System.SHIPPED))
    console.print(str(found))
    if why := found.beside(shipped):
        console.print(why)
    draw_recommendation(found, shipped, steps.runs, picture or _TUNE_PICTURE)
    console.print(f"Picture: {picture or _TUNE_PICTURE}")
    figures = {
        "p": found.gain,
        "settling_s": found.settling_s,
        "oscillation_begins_p": found.onset,
        "delivered_p": shipped,
    }
    json_output.write(json.dumps(figures))


@click.command()
@click.argument("log", type=click.Path(path_type=Path))
@click.option("--commands", type=click.Path(path_type=Path), help="Of a CSV file: the CSV file with what was sent.")
@click.option(
    "--pos-corr-gain",
    type=click.FloatRange(0.01, 4.0),
    default=1.0,
    show_default=True,
    help="With which the log was made; k is so many times 5/s.",
)
@click.option(
    "--lp-filter",
    type=click.FloatRange(0.0, 100.0),
    help="EGM's low-pass filter with which the log was made [Hz], 0: off.  [off; of a folder as it says]",
)
@output_option("build/compare")
@json_option
def compare(
    log: Path,
    commands: Path | None,
    pos_corr_gain: float,
    lp_filter: float | None,
    output: Path,
    json_output: JsonOutput,
) -> None:
    """Compare a robot's log with the virtual robot.

    The virtual robot is sent the commands of LOG, which is a recording of `yumi up --record`, another MCAP file with
    joint states and commands, a CSV file with its --commands, or a folder of records. It also identifies k, dead time,
    lag, noise and limits, as far as the log determines them, and writes a picture and a settings file for `yumi
    controller --dynamics`.

    \b
    Examples:
      yumi compare session.mcap
      yumi compare joints.csv --commands commands.csv
      yumi compare session.mcap --json
    """
    _demand_extra()
    from yumi_evaluation import comparison  # noqa: PLC0415 - a quick --help
    from yumi_evaluation.identification import RUNS  # noqa: PLC0415
    from yumi_evaluation.logs import read_logs  # noqa: PLC0415

    console = Console(highlight=False, stderr=json_output.is_printed)
    console.width = max(console.width, _TABLE_WIDTH)
    logs = read_logs(log, commands)
    with _ends_on_interrupt() as check, _compare_progress(console, RUNS, check) as tick:
        try:
            found = comparison.compare(logs, EGM_GAIN * pos_corr_gain, lp_filter, tick)
        except _Ended:
            sys.exit(_INTERRUPTED)
    files = _write_comparison(found, output, pos_corr_gain, log.name)
    json_output.write(json.dumps(comparison.document(found), indent=2, allow_nan=False))
    if not json_output.is_printed:
        _print_comparison(found, files, console)


def _write_comparison(found: Comparison, folder: Path, pos_corr_gain: float, origin: str) -> list[tuple[str, Path]]:
    """Write picture and settings; what each file is, and the file."""
    from yumi_evaluation.comparison import write_settings  # noqa: PLC0415 - a quick --help
    from yumi_evaluation.pictures import draw_comparison  # noqa: PLC0415

    picture = folder / "comparison.svg"
    draw_comparison(found, picture)
    settings = write_settings(found, folder, pos_corr_gain, origin)
    return [("Picture", picture), *(("Settings", file) for file in settings)]


def _print_comparison(found: Comparison, files: list[tuple[str, Path]], console: Console) -> None:
    from yumi_evaluation.comparison import tables  # noqa: PLC0415 - a quick --help

    for robot in found.robots:
        console.print(*tables(robot))
        console.print(robot.verdict)
    for sentence in found.left_out:
        console.print(sentence)
    for word, file in files:
        console.print(f"{word}: {file}")


@click.command()
@click.argument("arm", type=ARMS_TYPE)
@robot_options()
@egm_port_options()
@config_option
@yes_option
@output_option("build/measure_ and the time", is_shown_only=True)
@json_option
def measure(
    arm: str, config: Path | None, yes: bool, output: Path | None, json_output: JsonOutput, **options: Any
) -> None:
    """Measure how a robot follows EGM, by three small motions.

    They are compared with those of the virtual robot. --yes is for virtual robots only, and the folder must be new.
    All joints move at the same time, by 2° and with 10 °/s at most: a slow ramp, steps, a sine. The command drives the
    robot itself, so no other driver may run. It asks before EGM starts and before each motion; whatever stops the
    robot, a no and Ctrl-C end everything, and what was recorded until then is kept. At the end there are a settings
    file for `yumi controller --dynamics` and one archive with all that was found.

    \b
    Examples:
      yumi measure right --robot 127.0.0.1 --yes    a running `yumi controller`
      yumi measure both --robot 192.168.125.1
    """
    _demand_extra()
    if find_spec("mcap") is None:
        raise missing_extra(message("recordings_need_mcap"), "yumi-ros2", "evaluation")
    from yumi_evaluation import measurement  # noqa: PLC0415 - a quick --help

    settings = measurement.settings_for_measuring(settings_of(config, options))
    folder = output or Path("build") / f"measure_{datetime.now():%Y-%m-%d_%H-%M-%S}"
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise SettingsError(message("measurement_exists", folder=str(folder)))
    console = Console(highlight=False, stderr=json_output.is_printed)
    console.width = max(console.width, _TABLE_WIDTH)
    before = {each: signal.signal(each, signal.default_int_handler) for each in (signal.SIGTERM, signal.SIGHUP)}
    level = _API_LOG.level
    _API_LOG.setLevel(logging.CRITICAL)  # the steps are printed, and a stop is the error
    try:
        document, files = _measured(arm, settings, folder, yes, console)
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
        _API_LOG.setLevel(level)
    json_output.write(json.dumps({**document, "files": [str(file) for _, file in files]}, allow_nan=False))


def _measured(
    arms: str, settings: Settings, folder: Path, yes: bool, console: Console
) -> tuple[dict[str, Any], list[tuple[str, Path]]]:
    """Measure, compare and pack: the comparison as a document, and the files."""
    from yumi_evaluation import comparison, measurement  # noqa: PLC0415 - a quick --help
    from yumi_evaluation.identification import RUNS  # noqa: PLC0415
    from yumi_evaluation.logs import read_logs  # noqa: PLC0415

    examined = measurement.examine(settings)
    _check_confirmable(settings.robot.address, examined.is_virtual, yes)

    def confirm(question: str) -> None:
        console.print(question)
        if not yes and not _is_confirmed("Is no person near the robot, and may it do that?"):
            raise CommandRefused(message("motion_not_confirmed"))

    sides = tuple(side for side in Side if arms in (side.word, "both"))
    evidence = measurement.Evidence(folder, examined, settings, arms)
    motion = settings.egm_motion
    try:
        measurement.measure(sides, settings, evidence, confirm, console.print)
        logs = read_logs(evidence.recordings)
        with _ends_on_interrupt() as check, _compare_progress(console, RUNS, check) as tick:
            found = comparison.compare(logs, EGM_GAIN * motion.pos_corr_gain, motion.lp_filter, tick)
    except (YumiError, KeyboardInterrupt, click.Abort, _Ended) as error:
        why = error.said if isinstance(error, YumiError) else message("ended_by_signal")
        said = message("measurement_ended", error=why, file=str(evidence.close(str(why))))
        if isinstance(error, YumiError):
            error.said = said
            raise
        click.echo(str(said), err=True)
        sys.exit(_INTERRUPTED)
    files = [("Recordings", evidence.recordings)]
    files += _write_comparison(found, folder, motion.pos_corr_gain, folder.name)
    document = comparison.document(found)
    measurement.write_json(folder / "comparison.json", document)
    files.append(("Archive", evidence.close("")))
    _print_comparison(found, files, console)
    return document, files


def _check_confirmable(address: str, is_virtual: bool, yes: bool) -> None:
    """Each motion of a real robot is confirmed by a person.

    Raises:
        SettingsError: it cannot be.
    """
    if yes and not is_virtual:
        raise SettingsError(message("yes_for_virtual_robots", address=address))
    if not yes and not _is_at_a_terminal():
        raise SettingsError(message("no_terminal_for_virtual" if is_virtual else "no_terminal"))


def _is_at_a_terminal() -> bool:
    return sys.stdin.isatty()


def _is_confirmed(question: str) -> bool:
    if sys.stdin.isatty():
        termios.tcflush(sys.stdin, termios.TCIFLUSH)  # an answer given before the question does not count
    return click.confirm(question, err=True)


@contextmanager
def _compare_progress(console: Console, total: int, check: Callable[[], None]) -> Iterator[Callable[[], None]]:
    """A bar that shows itself after a second; what it gives is called with each run."""
    columns = (TextColumn("Runs of the virtual robot"), BarColumn(24), MofNCompleteColumn(), TimeElapsedColumn())
    begin = time.monotonic()
    with Progress(*columns, console=console, transient=True, auto_refresh=False) as progress:
        task, count = progress.add_task("", total=total, visible=False), 0

        def tick() -> None:
            nonlocal count
            check()
            count += 1
            is_slow = time.monotonic() - begin > 1.0
            progress.update(task, advance=1, total=max(total, count), visible=is_slow, refresh=is_slow)

        yield tick


@click.command()
@click.option("--rounds", type=click.IntRange(1, 100), default=5, show_default=True, help="Of all contenders.")
@click.option("--cycles", type=click.IntRange(100, 500_000), default=4000, show_default=True, help="Number of cycles.")
@click.option(
    "--quick",
    is_flag=True,
    help="One round of 300 cycles, one arm at 250 Hz, blocking: a first impression in a minute.",
)
@click.option("--only", multiple=True, metavar="NAME", help="Only this contender; may be repeated.")
@click.option("--wake", multiple=True, metavar="MODE", help="Only this egm.wake; may be repeated.")
@click.option(
    "--server",
    metavar="COMMAND",
    help="One more server of yours, called with port, gain and goal, e.g. with a build of ABB's own C++ library.",
)
@click.option("--seed", default=1, show_default=True, help="Of the order within the rounds.")
@click.option("--soak", "minutes", type=click.FloatRange(0.5, 1440.0), help="Instead: both arms for so many minutes.")
@json_option
@picture_option("build/bench/histograms.png")
def bench(
    rounds: int,
    cycles: int,
    quick: bool,
    only: tuple[str, ...],
    wake: tuple[str, ...],
    server: str | None,
    seed: int,
    minutes: float | None,
    json_output: JsonOutput,
    picture: Path | None,
) -> None:
    """Measure the time from a robot's datagram to its reply.

    It is compared with other programs', in turns. Every run starts a fresh server and counts --cycles of each; a load
    generator plays the robot on this machine. Ctrl-C reports what is there. Programs and the peers' packages go to
    build/bench in the current folder.

    \b
    Examples:
      yumi bench --quick
      yumi bench --rounds 5 --cycles 15000 --json figures.json
      yumi bench --soak 10
    """
    _demand_extra()
    from yumi_evaluation.bench import report as tables  # noqa: PLC0415 - a quick --help
    from yumi_evaluation.bench.contenders import (  # noqa: PLC0415
        WAKE_MODES,
        Runtime,
        cases_of,
        contenders,
        other_server,
        schedule,
    )
    from yumi_evaluation.bench.figures import Figures  # noqa: PLC0415
    from yumi_evaluation.bench.run import PERIOD_US, WARM_UP, Workshop  # noqa: PLC0415

    if server and minutes is not None:
        raise SettingsError(message("server_has_no_soak"))
    for mode in wake:
        if mode not in WAKE_MODES:
            raise SettingsError(message("wake_mode_unknown", mode=mode, known=tuple(WAKE_MODES)))
    everything = contenders(wake or (WAKE_MODES[:1] if quick else WAKE_MODES))
    chosen = _chosen((*everything, other_server(server)) if server else everything, only)
    workshop = Workshop(Path("build/bench"))
    console = Console(highlight=False, stderr=json_output.is_printed)
    console.width = max(console.width, _BENCH_WIDTH)
    machine: dict[str, Any] = {
        "cpus": os.cpu_count(),
        "processor": platform.machine(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "load_before": os.getloadavg()[0],
    }
    workshop.compile_programs()
    if minutes is not None:
        content = _soak(workshop, console, minutes, (wake or WAKE_MODES)[-1])
        json_output.write(json.dumps({"format": "yumi-bench-soak/1", "machine": machine, **content}, indent=2))
        return
    if any(each.runtime is Runtime.PEERS for each in chosen):
        console.print(f"Peers from PyPI: into {workshop.peers}, if they are not there yet")
        workshop.install_peers()
    rounds, cycles = _QUICK if quick else (rounds, cycles)
    cases = [
        case
        for case in cases_of(chosen)
        if not quick or (case.is_paced and case.arms == 1 and not case.is_machine_busy)
    ]
    plan = schedule(cases, rounds, seed)
    paced = sum(case.is_paced for _, case in plan)
    seconds = paced * (cycles + WARM_UP) * PERIOD_US / 1e6 + len(plan) * _START
    console.print(f"{len(plan)} runs in {rounds} rounds of {cycles} cycles: about {seconds / 60.0:.1f} minutes.")
    runs = _run_all(workshop, console, plan, cycles)
    if not runs:
        console.print("No run was completed: there is nothing to report.")
        sys.exit(_INCOMPLETE)
    figures = Figures(tuple(runs))
    console.print(tables.latency_table(figures), tables.ratio_table(figures), tables.part_table(figures))
    console.print(tables.target_table(figures))
    picture = picture or workshop.products / "histograms.png"
    tables.draw_histograms(figures, picture)
    console.print(f"Histograms: {picture}")
    settings = {
        "rounds": rounds, "cycles": cycles, "warm_up_cycles": WARM_UP, "period_us": PERIOD_US, "seed": seed,
        "contenders": [each.name for each in chosen],
    }  # fmt: skip
    is_complete = len(runs) == len(plan)
    json_output.write(json.dumps(tables.document(figures, settings, machine, is_complete=is_complete), indent=2))
    sys.exit(0 if is_complete else _INCOMPLETE)


def _chosen(everything: tuple[Contender, ...], only: tuple[str, ...]) -> list[Contender]:
    names = [each.name for each in everything]
    for name in only:
        if name not in names:
            raise SettingsError(message("contender_unknown", name=name, known=tuple(names)))
    return [each for each in everything if not only or each.name in only]


def _run_all(workshop: Any, console: Console, plan: list[tuple[int, Case]], cycles: int) -> list[Any]:
    """Every run that was completed; Ctrl-C ends it early."""
    from yumi_evaluation.bench.run import run_case  # noqa: PLC0415 - a quick --help

    runs = []
    with _runs_progress(console, len(plan)) as advance:
        try:
            for number, case in plan:
                advance(f"round {number}: {case.name}", 0)
                try:
                    runs.append(run_case(workshop, case, number, cycles))
                except RobotNotReady as error:
                    console.print(f"Round {number}: {error}")
                    continue
                advance("", 1)
        except KeyboardInterrupt:
            console.print("Interrupted: the report contains the runs that have ended.")
    return runs


def _soak(workshop: Any, console: Console, minutes: float, wake: str) -> dict[str, Any]:
    from yumi_evaluation.bench.contenders import control_loop  # noqa: PLC0415 - a quick --help
    from yumi_evaluation.bench.run import ARMS, PERIOD_US, chunks_of, soak, soak_document  # noqa: PLC0415

    console.print(f"{ARMS} arms, {minutes:g} minutes each for the control loop ({wake}) and the C echo, in turns.")
    with _runs_progress(console, 2 * chunks_of(minutes)) as advance:
        endured = soak(workshop, control_loop(wake), minutes, lambda: advance("soak", 1))
    figures = soak_document(endured)
    for name, each in figures.items():
        console.print(
            f"{name}: missed {each['missed']} of {ARMS * each['cycles_per_arm']}, bad {each['bad']}, worst p99 "
            f"{each['worst_p99_us']:.0f} µs, max {each['worst_max_us']:.0f} µs, memory {each['growth_kib']:+d} KiB "
            f"after the first chunk ({each['resident_kib'][-1]} KiB)"
        )
    return {"settings": {"minutes": minutes, "period_us": PERIOD_US, "arms": ARMS, "wake": wake}, "soak": figures}


def _demand_extra() -> None:
    """Before anything is computed.

    Raises:
        MissingPrerequisite: a package of the extra is missing.
    """
    missing = [name for name in ("numpy", "jinja2", "matplotlib") if find_spec(name) is None]
    if missing:
        raise missing_extra(message("command_needs_packages", packages=tuple(missing)), "yumi-ros2", "evaluation")


def _demand_ros() -> None:
    if find_spec("rclpy") is None or find_spec("yumi_interfaces") is None:
        raise MissingPrerequisite(message("ros_missing_for_evaluation"))
    if find_spec("mcap") is None:
        raise missing_extra(message("recordings_need_mcap"), "yumi-ros2", "record")


@contextmanager
def _ends_on_interrupt() -> Iterator[Callable[[], None]]:
    """Gives a check that raises once Ctrl-C was pressed."""
    pressed = []

    def on_signal(number: int, frame: FrameType | None) -> None:
        pressed.append(number)

    def check() -> None:
        if pressed:
            raise _Ended

    before = signal.signal(signal.SIGINT, on_signal)
    try:
        yield check
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _progress(console: Console, total: int, check: Callable[[], None]) -> Iterator[Callable[[str], None]]:
    """A progress bar; what it gives is called with the name of each step, and ends it on Ctrl-C.

    Nothing is drawn during a step, so that nothing disturbs what is measured.
    """
    columns = (TextColumn("{task.description:44.44}"), BarColumn(24), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True, auto_refresh=False) as progress:
        task = progress.add_task("", total=total)
        last = ""

        def on_step(title: str) -> None:
            nonlocal last
            check()
            if not console.is_terminal and title != last:  # where no bar can move
                console.print(title)
            last = title
            progress.update(task, description=title, advance=1, refresh=True)

        yield on_step


@contextmanager
def _runs_progress(console: Console, total: int) -> Iterator[Callable[[str, int], None]]:
    """A progress bar that is drawn between the runs only: a redraw during one would be measured along."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, TimeRemainingColumn(), console=console, auto_refresh=False) as progress:
        task = progress.add_task("", total=total)
        yield lambda what, steps: progress.update(task, description=what, advance=steps, refresh=True)
