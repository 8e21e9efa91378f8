"""The evaluation's report: a summary on top, then pictures, tables, explanations with their evidence, settings.

The tables of the evaluation's report: what is published beside what was measured.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict
from math import isnan, pi
from pathlib import Path

from yumi.robot.joints import CYCLE
from yumi.virtual.mechanics.arm import ArmModel
from yumi_evaluation.document import Block, Heading, Paragraph, Picture, Table, to_html, to_markdown
from yumi_evaluation.experiment import FREQUENCY, GOAL_RATE, HOLD, TOLERANCE_DEG, Experiment, Mode, System
from yumi_evaluation.experiments import (
    PUBLISHED_OSCILLATION,
    better_experiments,
    joint_experiments,
    onset_of,
    published_experiments,
)
from yumi_evaluation.explanations import explanations
from yumi_evaluation.kpis import Kpi, kpis, legs, machine_legs
from yumi_evaluation.lag_study import TIMED_GAINS, Lags, LagStudy, is_near, studied_sines
from yumi_evaluation.metrics import Distribution
from yumi_evaluation.pictures import draw_pictures
from yumi_evaluation.results import Result, Results, main_figure, write_series
from yumi_evaluation.tracking_figures import SineFigures, StepFigures
from yumi_evaluation.virtual_machine import FITTED

_FIGURES = (
    ("settling_s", "settling", "time until within 0.1°"),
    ("mean_lag_s", "mean_lag", "mean control lag"),
    ("max_lag_s", "max_lag", "longest control lag"),
)


AGREEMENT = 0.15
"""By what share real time may differ from virtual time."""

_SUMMARY_CAPTION = (
    "Ours: without a guard, as in the thesis; only the last row is as shipped. The robot is fitted to the step times "
    "alone, so the lags are predictions. Within a tenth of the published figure counts as reproduced; the report "
    "discusses the others under 'Where our figures differ, and why'."
)
_KPI_CAPTION = "Limits are those the thesis suggests in its table 4.2; that of packet loss is ours."
_STAR = "A star: within a tenth of what is published."


def summary_table(results: Results) -> Table:
    """Every figure the thesis gives beside ours, and what to make of it."""
    rows = [
        (
            f"{experiment.title}: {words}",
            experiment.figure,
            _time(published),
            *_with_ratio(_value(results, System.BARE, experiment, name), published),
            _judged(_value(results, System.BARE, experiment, name), published, is_explained=results.study is not None),
        )
        for experiment, name, words, published in _published()
    ]
    onset = onset_of(results.sweeps.get(System.SHIPPED, ()))
    rows.append(
        (
            "Step of 10°: oscillation begins at P",
            "5.1",
            f"≈ {PUBLISHED_OSCILLATION:g}",
            *(("-", "-") if onset is None else (f"{onset:g}", f"{onset / PUBLISHED_OSCILLATION:.2f}")),
            "-" if onset is None else _onset_verdict(results, onset),
        )
    )
    header = ("", "thesis's figure", "published", "ours", "ratio", "verdict")
    return Table(header, tuple(rows), _SUMMARY_CAPTION, (0, 1, 5))


def headline(results: Results) -> str:
    """The outcome in a sentence or two."""
    pairs = [(_value(results, System.BARE, each, name), published) for each, name, _, published in _published()]
    run = [(value, published) for value, published in pairs if value is not None]
    near = sum(is_near(value, published) for value, published in run)
    texts = [f"{near} of {len(run)} published times and lags are reproduced within a tenth"] if run else []
    for system, measured in results.measured.items():
        found = kpis(measured)
        judged = [each for each in found if each.holds is not None]
        outside = ", ".join(each.title for each in judged if not each.holds)
        holding = (
            f"{sum(each.holds is True for each in judged)} of {len(judged)} measured indicators are inside their limits"
        )
        remarks = [f"outside: {outside}"] if outside else []
        if len(judged) < len(found):
            remarks.append(f"{len(found) - len(judged)} not run")
        texts.append(f"{holding} {system.title}" + (f" ({'; '.join(remarks)})" if remarks else ""))
    return "; ".join(texts) + "." if texts else ""


def systems_table(results: Results) -> Table | None:
    """The same figures as shipped and over the wire, each with its ratio to the published one."""
    systems = [each for each in (System.SHIPPED, System.WIRE) if any(run.system is each for run in results.runs)]
    rows = tuple(
        (
            f"{experiment.title}: {words}",
            _time(published),
            *(cell for system in systems for cell in _with_ratio(_value(results, system, experiment, name), published)),
        )
        for experiment, name, words, published in _published()
    )
    header = [cell for system in systems for cell in (system.title, "ratio")]
    return Table(("", "published", *header), rows, _systems_caption(systems)) if systems else None


def result_table(results: Results, experiments: Iterable[Experiment], systems: Iterable[System]) -> Table:
    """Everything that was measured of these experiments."""
    experiments = tuple(experiments)
    runs = [run for system in systems for run in results.of(system, experiments)]
    is_step = all(experiment.is_step for experiment in experiments)
    return _step_table(runs) if is_step else _sine_table(runs)


def real_time_table(results: Results) -> Table | None:
    """Step times and mean lags over the wire beside those in virtual time."""
    rows = tuple(
        (
            run.experiment.title,
            _time(virtual),
            _time(own),
            f"{round(1e3 * (own - virtual), 1) + 0.0:+.1f} ms",  # adding nothing makes -0.0 a 0.0
            f"{own / virtual:.2f}",
            _agreement(own, virtual),
        )
        for run in results.runs
        if results.ratio_to_virtual(run) is not None
        if (shipped := results.find(System.SHIPPED, run.experiment)) is not None
        if (own := main_figure(run.figures)) and (virtual := main_figure(shipped.figures))
    )
    caption = (
        "Step times and mean control lags. What the wire adds is the way through ROS 2, and cycles that a busy machine "
        f"missed. Within a sample is within a cycle, {1e3 * CYCLE:.1f} ms: lags cannot be told apart more finely."
    )
    header = ("", "as shipped", "over the wire", "difference", "ratio", "agrees")
    return Table(header, rows, caption, (0, 5)) if rows else None


def repeats_table(results: Results) -> Table | None:
    """Which experiments were repeated, how often and why."""
    rows = tuple((name, str(len(whys)), " ".join(dict.fromkeys(whys))) for name, whys in results.repeats.items())
    caption = "Runs that were thrown away and made again, because the machine or the connection was disturbed."
    return Table(("experiment", "repeated", "why"), rows, caption, (0, 2)) if rows else None


def kpi_table(found: Iterable[Kpi]) -> Table:
    """The seven indicators."""
    rows = tuple(
        (each.title, _amount(each.value, each.unit), _amount(each.limit, each.unit),
         _verdict(each.holds), each.note)
        for each in found
    )  # fmt: skip
    return Table(
        ("indicator", "measured", "limit", "holds", "how"),
        rows,
        _KPI_CAPTION,
        (0, 4),
    )


def kpis_of(results: Results, system: System) -> tuple[Kpi, ...]:
    """The indicators of one system, if it was measured."""
    return kpis(results.measured[system]) if system in results.measured else ()


def leg_table(legs: Mapping[str, Distribution], caption: str) -> Table:
    """Every leg of round trips in milliseconds."""
    rows = tuple(
        (name.replace("_", " "), str(found.count), *(f"{1e3 * value:.3f}" for value in _cuts(found)))
        for name, found in legs.items()
    )
    header = ("leg", "round trips", "mean", "jitter", "p50", "p90", "p99", "p99.9", "longest")
    return Table(header, rows, f"{caption} [ms]")


def settings_table(settings: Mapping[str, Mapping[str, object]]) -> Table:
    """What was chosen, and which versions ran."""
    rows = tuple((group, name, _setting(value)) for group, values in settings.items() for name, value in values.items())
    return Table(("of", "setting", "value"), rows, texts=(0, 1, 2))


def model_settings() -> dict[str, dict[str, object]]:
    """The experiments' settings and those of both virtual robots."""
    shipped = ArmModel()
    return {
        "EGM, fullspeed": asdict(Mode.FULLSPEED.value),
        "EGM, reduced speed": asdict(Mode.REDUCED.value),
        "experiments": {
            "goals a second": GOAL_RATE,
            "frequency of sines [Hz]": FREQUENCY,
            "tolerance [°]": TOLERANCE_DEG,
        },
        "virtual robot": {"delay [ms]": 1e3 * shipped.delay, "servo lag [ms]": 1e3 * shipped.lag},
        "fitted robot": {"delay [ms]": 1e3 * FITTED.delay, "servo lag [ms]": 1e3 * FITTED.lag},
    }


def study_tables(study: LagStudy) -> Mapping[str, Table]:
    """What was varied, by the name of its topic; a star tells what is within a tenth of the published figure."""
    sines = studied_sines()
    heads = tuple(f"{each.size_deg:g}°, {each.law.title}: mean | longest" for each in sines)
    published = tuple(f"{_ms(each.published.mean_lag)} | {_ms(each.published.max_lag)}" for each in sines)
    return {
        "frequency": Table(
            ("sines at", *heads),
            (
                ("published", *published),
                *((f"{each:g} Hz", *_lag_cells(lags)) for each, lags in study.frequencies.items()),
            ),
            f"Predicted lags [ms] by the sines' frequency. {_STAR}",
        ),
        "matching": Table(
            ("a match is", *heads),
            (("published", *published), *((words, *_lag_cells(lags)) for words, lags in study.matchings.items())),
            f"Lags [ms] of the same motions at {FREQUENCY:g} Hz, matched in other ways. {_STAR}",
        ),
        "robot": Table(
            ("control lag", *(f"step, P = {gain:g}" for gain in TIMED_GAINS), *heads),
            (
                ("published", "0.8 s", "0.6 s", *published),
                *(
                    (f"{1e3 * lag:g} ms", *map(_time_of_step, robot.step_times), *_lag_cells(robot.lags))
                    for lag, robot in study.robots.items()
                ),
            ),
            f"What robots with other control lags would have shown; lags of sines [ms] at {FREQUENCY:g} Hz. {_STAR}",
        ),
    }


def _lag_cells(lags: Iterable[Lags]) -> tuple[str, ...]:
    return tuple(
        " | ".join(
            f"{_ms(value)}{'*' if near else ''}"
            for value, near in zip((each.mean, each.longest), each.are_near(experiment), strict=True)
        )
        for each, experiment in zip(lags, studied_sines(), strict=True)
    )


def _ms(value: float | None) -> str:
    return "-" if value is None else f"{1e3 * value:.0f}"


def _step_time(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f} s"


def _time_of_step(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f} s"


def _published() -> Iterator[tuple[Experiment, str, str, float]]:
    """Every published figure: of which experiment, its name, what it is in words, and the figure [s]."""
    for experiment in published_experiments():
        for name, attribute, words in _FIGURES:
            published = getattr(experiment.published, attribute)
            if published is not None:
                yield experiment, name, words, published


def _value(results: Results, system: System, experiment: Experiment, name: str) -> float | None:
    run = results.find(system, experiment)
    found = getattr(run.figures, name) if run else None
    return None if found is None or isnan(found) else float(found)


def _with_ratio(value: float | None, published: float) -> tuple[str, str]:
    return _time(value), "-" if value is None else f"{value / published:.2f}"


def _judged(value: float | None, published: float, *, is_explained: bool) -> str:
    if value is None:
        return "not run"
    verdict = _verdict_of(value, published)
    return f"{verdict}, discussed" if is_explained and not is_near(value, published) else verdict


def _verdict_of(value: float, published: float) -> str:
    if is_near(value, published):
        return "reproduced"
    return f"{100.0 * abs(value / published - 1.0):.0f} % {'more' if value > published else 'less'}"


def _onset_verdict(results: Results, onset: float) -> str:
    verdict = _verdict_of(onset, PUBLISHED_OSCILLATION)
    bare = results.sweeps.get(System.BARE, ())
    return f"{verdict}, but only as shipped" if bare and onset_of(bare) is None else f"{verdict}, as shipped"


def _agreement(own: float, virtual: float) -> str:
    if abs(own / virtual - 1.0) <= AGREEMENT:
        return f"within {100.0 * AGREEMENT:.0f} %"
    return "within a sample" if abs(own - virtual) <= CYCLE else "no"


def _systems_caption(systems: Iterable[System]) -> str:
    meanings = {
        System.SHIPPED: "As shipped: virtual time, the virtual robot and the guard as everybody gets them",
        System.WIRE: "over the wire: real time, a ROS 2 node, the driver, and a robot at the other end of the wire",
    }
    return "; ".join(meanings[system] for system in systems) + ". Ratios are to what is published."


def _step_table(runs: Iterable[Result]) -> Table:
    rows = tuple(
        (run.experiment.title, run.experiment.figure, run.system.title, _step_time(found.settling_s),
         f"{found.overshoot_deg:.3f}", str(found.swings), f"{found.final_error_deg:.4f}")
        for run in runs
        if isinstance(found := run.figures, StepFigures)
    )  # fmt: skip
    header = ("", "thesis's figure", "system", "within 0.1°", "overshoot [°]", "swings", "steady-state error [°]")
    caption = (
        "Swings: how often the joint crossed the goal by more than 0.1°. Steady-state error: the largest distance "
        f"from the goal in the last {HOLD:g} s; with a low gain the joint is still on its way then."
    )
    return _without_empty_figures(Table(header, rows, caption, (0, 1, 2)))


def _sine_table(runs: Iterable[Result]) -> Table:
    rows = tuple(
        (run.experiment.title, run.experiment.figure, run.system.title, *_sine_cells(found))
        for run in runs
        if isinstance(found := run.figures, SineFigures)
    )
    header = ("", "thesis's figure", "system", "mean lag", "p99", "longest", "matched", "delay", "largest error [°]")
    caption = (
        "Mean lag, p99 and longest are control lags of the goals that found a match, and matched is their share: at "
        f"60° the joint moves up to {2.0 * pi * FREQUENCY * 60.0 * CYCLE:.1f}° in a cycle, so that a goal can fall "
        "between two samples. Delay is that of the whole motion, by least squares; a negative one is a lead. The "
        "largest error is the distance from the reference of the same moment, after the start."
    )
    return _without_empty_figures(Table(header, rows, caption, (0, 1, 2)))


def _without_empty_figures(table: Table) -> Table:
    """Without the column of the thesis's figures, where it has none of all that."""
    if any(row[1] for row in table.rows):
        return table
    rows = tuple((row[0], *row[2:]) for row in table.rows)
    return Table((table.header[0], *table.header[2:]), rows, table.caption, (0, 1))


def _sine_cells(found: SineFigures) -> tuple[str, ...]:
    return (
        *(_lag(value) for value in (found.mean_lag_s, found.p99_lag_s, found.max_lag_s)),
        f"{100.0 * found.matched_share:.0f} %",
        f"{1e3 * found.delay_s:.1f} ms",
        f"{found.max_error_deg:.3f}",
    )


def _cuts(found: Distribution) -> tuple[float, ...]:
    return (found.mean, found.jitter, found.p50, found.p90, found.p99, found.p999, found.highest)


def _verdict(holds: bool | None) -> str:
    return {None: "not measured", True: "yes", False: "no"}[holds]


def _amount(value: float | None, unit: str) -> str:
    if value is None:
        return "-"
    if unit == "s":
        return f"{1e3 * value:.3g} ms"
    return f"{value:.3g}{'' if unit == '°' else ' '}{unit}".strip()


def _setting(value: object) -> str:
    """What a person wants to read of it."""
    return str(round(value, 3)) if isinstance(value, float) else str(value) or "-"


def _lag(value: float | None) -> str:
    """Milliseconds, however many: in a column of lags units would hide which is longer."""
    return "-" if value is None or isnan(value) else f"{1e3 * value:.0f} ms"


def _time(value: float | None) -> str:
    """Seconds where there are many, milliseconds where there are few."""
    if value is None or isnan(value):
        return "-"
    return f"{value:.2f} s" if value >= 0.5 else f"{1e3 * value:.0f} ms"


TITLE = "Evaluation of the YuMi's joint control"

_INTRODUCTION = (
    "The experiments of the master's thesis this system comes from, repeated: axis 6 makes steps and follows sines, "
    "an application sends the goals, and what counts is the measured position. Our figures stand beside the published "
    "ones, with their ratio. They are of a virtual robot unless the settings at the end name a real one."
)
_TERMS = (
    "The words below: 'without a guard' is the thesis's system, in virtual time, with a virtual robot fitted to its "
    "step times; 'as shipped' is what everybody gets, in virtual time, with a guard that limits the speed, "
    "acceleration and jerk of commands; 'over the wire' is the same in real time, through ROS 2 and the network. P is "
    "the controller's gain. A control lag is the time from a goal until the joint is within 0.1° of it."
)
_PARTIAL = "This evaluation is not complete: what is missing was not run."


def write_report(results: Results, folder: Path) -> Path:
    """Write report, pictures and raw data into ``folder``; returns the HTML page.

    Raises:
        MissingPrerequisite: matplotlib is not installed.
        OSError: the folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_series(results, folder / "data")
    blocks = report_blocks(results, draw_pictures(results, folder))
    (folder / "report.md").write_text(to_markdown(blocks), encoding="utf-8")
    page = folder / "report.html"
    page.write_text(to_html(blocks, TITLE), encoding="utf-8")
    return page


def report_blocks(results: Results, pictures: Mapping[str, Picture]) -> list[Block]:
    """The report from top to bottom; ``pictures`` that are missing are left out."""
    return [
        Heading(TITLE, 1),
        Paragraph(_INTRODUCTION),
        Paragraph(_TERMS),
        *([] if results.is_complete else [Paragraph(_PARTIAL)]),
        *(Paragraph(f"{name} could not be run: {why}") for name, why in results.failures.items()),
        Paragraph(headline(results)),
        summary_table(results),
        *_indicators(results),
        *_systems(results),
        *_differences(results, pictures),
        *_steps(results, pictures),
        *_sines(results, pictures),
        *_better(results),
        *_real_time(results),
        *_round_trips(results, pictures),
        Heading("Settings and versions"),
        settings_table(results.settings),
        Paragraph("Raw data: data/*.csv, one file for each experiment, angles in degrees from where the joint began."),
    ]


def _indicators(results: Results) -> list[Block]:
    blocks: list[Block] = []
    words = {System.SHIPPED: "in virtual time", System.WIRE: "in real time"}
    for system, title in words.items():
        found = kpis_of(results, system)
        if found:
            blocks += [Heading(f"Key performance indicators {system.title}, {title}"), kpi_table(found)]
    return blocks


def _systems(results: Results) -> list[Block]:
    table = systems_table(results)
    return [Heading("What a user gets"), table] if table else []


def _steps(results: Results, pictures: Mapping[str, Picture]) -> list[Block]:
    experiments = [each for each in published_experiments() if each.is_step]
    table = result_table(results, experiments, System)
    return [Heading("Step responses"), *_shown(pictures, "steps"), table, *_shown(pictures, "sweep")]


def _sines(results: Results, pictures: Mapping[str, Picture]) -> list[Block]:
    experiments = [each for each in published_experiments() if not each.is_step]
    return [
        Heading("Followed sines"),
        *_shown(pictures, "sines", "lags", "reduced"),
        result_table(results, experiments, System),
    ]


def _better(results: Results) -> list[Block]:
    sines = [each for each in (*better_experiments(), *joint_experiments()) if not each.is_step]
    return [
        Heading("Better control laws, both arms, all joints"),
        Paragraph(
            "Feed-forward tells the robot the goal's speed beside its position; prediction forecasts where the goal "
            "will be when the robot gets there; a trajectory with look-ahead is known as a whole, and is sent ahead by "
            "the robot's delay. Where all joints move at once, the figures are those of the joint that follows worst."
        ),
        result_table(results, [each for each in better_experiments() if each.is_step], System),
        result_table(results, sines, System),
    ]


def _real_time(results: Results) -> list[Block]:
    table, repeats = real_time_table(results), repeats_table(results)
    if table is None:
        return []
    undisturbed = Paragraph("No experiment had to be repeated: no run was disturbed.")
    return [Heading("Real time beside virtual time"), table, repeats or undisturbed]


def _round_trips(results: Results, pictures: Mapping[str, Picture]) -> list[Block]:
    blocks: list[Block] = []
    for system, measured in results.measured.items():
        if measured.trips:
            caption = f"From the application to the EGM loop and back ({system.title})"
            blocks += [*_shown(pictures, f"trips_{system.value}"), leg_table(legs(measured.trips), caption)]
        if measured.machine_trips:
            caption = f"From the application to the state machine and back ({system.title})"
            blocks.append(leg_table(machine_legs(measured.machine_trips), caption))
    return [Heading("Round trips, leg by leg"), *blocks] if blocks else []


def _differences(results: Results, pictures: Mapping[str, Picture]) -> list[Block]:
    tables = study_tables(results.study) if results.study else {}
    blocks: list[Block] = [Heading("Where our figures differ, and why")]
    for each in explanations(results):
        blocks += [Heading(each.title, 3), Paragraph(each.text), *_shown(pictures, each.name)]
        blocks += [tables[each.name]] if each.name in tables else []
    return blocks


def _shown(pictures: Mapping[str, Picture], *names: str) -> list[Block]:
    return [pictures[name] for name in names if name in pictures]
