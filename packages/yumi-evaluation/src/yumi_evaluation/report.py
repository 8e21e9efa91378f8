"""The report: one self-contained HTML page beside the raw data, and its first tables on the terminal.

The tables put what is published beside what was measured; the page's text is in ``report.html.jinja``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from math import isnan, pi
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape
from rich.box import SIMPLE
from rich.console import Console
from rich.table import Table as RichTable

from abb_protocols.robot.joints import CYCLE
from virtual_irc5.mechanics.arm_motion import ArmModel
from yumi_evaluation.experiments import (
    FREQUENCY,
    GOAL_RATE,
    HOLD,
    PREDICTION,
    PUBLISHED_OSCILLATION,
    TOLERANCE_DEG,
    Experiment,
    Mode,
    SineFigures,
    StepFigures,
    System,
    better_experiments,
    joint_experiments,
    main_figure,
    other_frequencies,
    proportional,
    published_experiments,
    step,
)
from yumi_evaluation.gain_sweep import onset_of
from yumi_evaluation.kpis import WORST_TO_MEAN, Kpi, Measured, kpis, legs, machine_legs, machine_totals
from yumi_evaluation.metrics import Distribution, distribution
from yumi_evaluation.pictures import Picture, draw_pictures, draw_ratios
from yumi_evaluation.results import Result, Results, Variant, write_csv
from yumi_evaluation.round_trips import LEGS
from yumi_evaluation.virtual_time import FITTED, FITTED_ACCELERATION

NEAR = 0.1
"""By what fraction a figure may differ from the published one and count as reproduced."""

AGREEMENT = 0.15
"""By what fraction real time may differ from virtual time."""

_FIGURES = {
    "settling_s": "time until within 0.1°",
    "mean_lag_s": "mean control lag",
    "max_lag_s": "longest control lag",
}
_SHORT = {"settling_s": "time", "mean_lag_s": "mean lag", "max_lag_s": "longest lag"}
_BESIDE_NUMBER = re.compile(r"(?<=\d) (?=(?:ms|s|Hz|%|rad/s[²³]?|°/s)(?:\W|$))|(?<=\bP) (?== \d)|(?<=\bP =) (?=\d)")


@dataclass(frozen=True, slots=True)
class Table:
    """Cells as text; the first column names the row, numbers are set flush right.

    Attributes:
        header: one text a column.
        rows: as long as the header.
        caption: what it shows.
        texts: columns of text, which are set flush left.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    texts: tuple[int, ...] = (0,)

    def without_empty(self, column: int) -> Table:
        """Without that column, where it has no text at all."""
        if any(row[column] for row in self.rows):
            return self
        rows = tuple((*row[:column], *row[column + 1 :]) for row in (self.header, *self.rows))
        return Table(rows[0], rows[1:], self.caption, tuple(each for each in self.texts if each < len(self.texts) - 1))


@dataclass(frozen=True, slots=True)
class Verdict:
    """How something came out, in counts.

    Attributes:
        title: of what.
        good: how many were as wanted.
        missed: how many were not.
        not_run: how many were not measured.
        is_demand: whether a missed one is a failure, and not a difference.
    """

    title: str
    good: int
    missed: int
    not_run: int
    is_demand: bool = True

    @property
    def kind(self) -> str:
        """``good``, ``bad``, ``differs`` or ``unknown``: the colour."""
        if self.missed:
            return "bad" if self.is_demand else "differs"
        return "good" if self.good and not self.not_run else "unknown"


def verdicts(results: Results) -> list[Verdict]:
    """What the page says first: published figures reproduced, and indicators inside their limits."""
    near = _are_near(results)
    title = "published figures reproduced within a tenth"
    found = [Verdict(title, near.count(True), near.count(False), near.count(None), is_demand=False)]
    for system in (System.SHIPPED, System.NETWORKED):
        judged = [each.holds for each in kpis(results.measured.get(system, Measured()))]
        title = f"indicators inside their limits, {system.title}"
        found.append(Verdict(title, judged.count(True), judged.count(False), judged.count(None)))
    return found


def overview(results: Results) -> list[Picture]:
    """The charts the page begins with: ours over published, and indicators over their limits."""
    ratios = []
    for experiment, name, published in _published():
        value = _value(results, System.BARE, experiment, name)
        title = f"{experiment.title}: {_SHORT[name]}"
        ratios.append((title, None if value is None else value / published))
    caption = "Ours divided by what is published, without the limiter. Green: within a tenth."
    charts = [draw_ratios("overview_published", caption, ratios, (1.0 - NEAR, 1.0 + NEAR))]
    for system in (System.NETWORKED, System.SHIPPED):
        if found := kpis_of(results, system):
            parts = [(each.title, None if each.value is None else each.value / each.limit) for each in found]
            caption = f"Indicators divided by their limits, {system.title}. Green: inside."
            charts.append(draw_ratios(f"overview_{system.value}", caption, parts, (0.0, 1.0)))
            break
    return charts


def write_report(results: Results, folder: Path) -> Path:
    """Write the page and the raw data into ``folder``; returns the page.

    Raises:
        OSError: the folder cannot be written.
    """
    write_csv(results, folder / "data")
    page = folder / "report.html"
    page.write_text(render(results), encoding="utf-8")
    return page


def render(results: Results) -> str:
    """The page."""
    environment = Environment(
        loader=PackageLoader("yumi_evaluation", "."), autoescape=True, undefined=StrictUndefined, trim_blocks=True
    )
    environment.filters["keep_units"] = keep_units
    environment.filters["with_contents"] = with_contents
    published = published_experiments()
    better = (*better_experiments(), *joint_experiments())
    trips = {
        system: (leg_table(legs(measured.trips)), leg_table(machine_legs(measured.machine_trips)))
        for system, measured in results.measured.items()
        if measured.trips or measured.machine_trips
    }
    return environment.get_template("report.html.jinja").render(
        results=results,
        pictures=draw_pictures(results),
        headline=headline(results),
        verdicts=verdicts(results),
        overview=overview(results),
        made=made(results.settings),
        colors=_COLORS,
        summary=summary_table(results),
        indicators={system: kpi_table(found) for system in System if (found := kpis_of(results, system))},
        systems=systems_table(results),
        limiter=_limiter_times(results),
        onsets={system: onset_of(points) for system, points in results.sweeps.items()},
        long_trips=list(long_trips(results)),
        frequencies=sine_table(results, (*other_frequencies(), *published[6:8]), (System.BARE,)),
        steps=step_table(results, [each for each in published if each.is_step]),
        sines=sine_table(results, [each for each in published if not each.is_step]),
        better_steps=step_table(results, [each for each in better if each.is_step]),
        better_sines=sine_table(results, [each for each in better if not each.is_step]),
        real_time=real_time_table(results),
        repeats=repeats_table(results),
        trips=trips,
        settings=settings_table(results.settings),
        fitted_acceleration=FITTED_ACCELERATION,
        published_onset=PUBLISHED_OSCILLATION,
    )


def keep_units(text: str) -> Markup:
    """Escaped ``text`` in which what belongs to a number stays on its line."""
    return Markup(_BESIDE_NUMBER.sub("&nbsp;", str(escape(text))))


def with_contents(body: Markup) -> Markup:
    """The ``body`` of the page with links to its sections above the first."""
    titles = re.findall("<h2>(.*?)</h2>", body)
    anchors = {title: re.sub("[^a-z0-9]+", "-", title.lower()).strip("-") for title in titles}
    links = "".join(f'<li><a href="#{anchor}">{title}</a></li>' for title, anchor in anchors.items())
    linked = re.sub("<h2>(.*?)</h2>", lambda found: f'<h2 id="{anchors[found[1]]}">{found[1]}</h2>', body)
    return Markup(f'<nav aria-label="Contents"><ul>{links}</ul></nav>\n{linked}')


def print_results(results: Results, console: Console) -> None:
    """The summary table and the indicators, on the terminal."""
    console.print(headline(results))
    tables = {"what is published, and what we measured": summary_table(results)}
    for system in System:
        if found := kpis_of(results, system):
            tables[f"key performance indicators ({system.title})"] = kpi_table(found)
    for title, table in tables.items():
        shown = RichTable(title=title, box=SIMPLE, pad_edge=False)
        for index, name in enumerate(table.header):
            shown.add_column(name, justify="left" if index in table.texts else "right")
        for row in table.rows:
            shown.add_row(*row)
        console.print(shown)


def headline(results: Results) -> str:
    """The outcome in a sentence or two."""
    run = [each for each in _are_near(results) if each is not None]
    texts = [f"{sum(run)} of {len(run)} published times and lags are reproduced within a tenth"] if run else []
    for system, measured in results.measured.items():
        found = kpis(measured)
        judged = [each for each in found if each.holds is not None]
        outside = ", ".join(each.title for each in judged if not each.holds)
        remarks = [f"outside: {outside}"] if outside else []
        if len(judged) < len(found):
            remarks.append(f"{len(found) - len(judged)} not run")
        inside = f"{sum(each.holds is True for each in judged)} of {len(judged)} measured indicators"
        texts.append(
            f"{inside} are inside their limits {system.title}" + (f" ({'; '.join(remarks)})" if remarks else "")
        )
    return "; ".join(texts) + "." if texts else ""


def summary_table(results: Results) -> Table:
    """Every figure that the thesis gives beside ours, and a verdict."""
    rows = []
    for experiment, name, published in _published():
        value = _value(results, System.BARE, experiment, name)
        verdict = "not run" if value is None else _verdict(value, published)
        title = f"{experiment.title}: {_FIGURES[name]}"
        rows.append((title, experiment.figure, _time(published), *_with_ratio(value, published), verdict))
    onset = onset_of(results.sweeps.get(System.SHIPPED, ()))
    ours = ("-", "-", "not run")
    if onset is not None:
        is_shipped_only = System.BARE in results.sweeps and onset_of(results.sweeps[System.BARE]) is None
        verdict = _verdict(onset, PUBLISHED_OSCILLATION) + (
            ", but only as shipped" if is_shipped_only else ", as shipped"
        )
        ours = (f"{onset:g}", f"{onset / PUBLISHED_OSCILLATION:.2f}", verdict)
    rows.append(("Step of 10°: oscillation begins at P", "5.1", f"≈ {PUBLISHED_OSCILLATION:g}", *ours))
    caption = (
        "Ours: without the limiter, as in the thesis; only the last row is as shipped. The robot is fitted to the step "
        "times alone, so the lags are predictions. Within a tenth of the published figure counts as reproduced."
    )
    return Table(("", "thesis's figure", "published", "ours", "ratio", "verdict"), tuple(rows), caption, (0, 1, 5))


def systems_table(results: Results) -> Table | None:
    """The same figures as shipped and networked, each with its ratio to the published one."""
    systems = [each for each in (System.SHIPPED, System.NETWORKED) if any(run.system is each for run in results.runs)]
    rows = tuple(
        (
            f"{experiment.title}: {_FIGURES[name]}",
            _time(published),
            *(cell for system in systems for cell in _with_ratio(_value(results, system, experiment, name), published)),
        )
        for experiment, name, published in _published()
    )
    meanings = {
        System.SHIPPED: "As shipped: virtual time, the virtual robot and the limiter with the shipped settings",
        System.NETWORKED: "networked: real time, a ROS 2 node, the driver, and a robot on the network",
    }
    caption = "; ".join(meanings[system] for system in systems) + ". Ratios are to what is published."
    header = [cell for system in systems for cell in (system.title, "ratio")]
    return Table(("", "published", *header), rows, caption) if systems else None


def step_table(results: Results, experiments: Sequence[Experiment]) -> Table:
    """Everything that was measured of these steps."""
    rows = tuple(
        (
            run.experiment.title,
            run.experiment.figure,
            run.system.title,
            "-" if found.settling_s is None else f"{found.settling_s:.2f} s",
            f"{found.overshoot_deg:.3f}",
            str(found.oscillations),
            f"{found.final_error_deg:.4f}",
        )
        for run in _runs(results, experiments)
        if isinstance(found := run.figures, StepFigures)
    )
    header = ("", "thesis's figure", "system", "within 0.1°", "overshoot [°]", "oscillations", "steady-state error [°]")
    caption = (
        "Oscillations: how often the joint crossed the goal by more than 0.1°. Steady-state error: the largest "
        f"distance from the goal in the last {HOLD:g} s; with a low gain the joint is still moving then."
    )
    return Table(header, rows, caption, (0, 1, 2)).without_empty(1)


def sine_table(results: Results, experiments: Sequence[Experiment], systems: Iterable[System] = System) -> Table:
    """Everything that was measured of these sines."""
    rows = tuple(
        (
            run.experiment.title,
            run.experiment.figure,
            run.system.title,
            *(_milliseconds(value) for value in (found.mean_lag_s, found.p99_lag_s, found.max_lag_s)),
            f"{100.0 * found.matched_fraction:.0f} %",
            f"{1e3 * found.delay_s:.1f} ms",
            f"{found.max_error_deg:.3f}",
        )
        for run in _runs(results, experiments, systems)
        if isinstance(found := run.figures, SineFigures)
    )
    header = ("", "thesis's figure", "system", "mean lag", "p99", "longest", "matched", "delay", "largest error [°]")
    caption = (
        "Mean lag, p99 and longest are control lags of the goals that found a match, and matched is their fraction: at "
        f"60° the joint moves up to {2.0 * pi * FREQUENCY * 60.0 * CYCLE:.1f}° in a cycle, so that a goal can fall "
        "between two samples. Delay is that of the whole motion, by least squares; a negative one is a lead. The "
        "largest error is the distance from the reference of the same moment, after the start."
    )
    return Table(header, rows, caption, (0, 1, 2)).without_empty(1)


def real_time_table(results: Results) -> Table | None:
    """Step times and mean lags of networked runs beside those in virtual time."""
    rows = []
    for run in results.runs:
        shipped = results.find(System.SHIPPED, run.experiment)
        ratio = results.ratio_to_virtual(run)
        if ratio is None or shipped is None:
            continue
        own, virtual = main_figure(run.figures) or 0.0, main_figure(shipped.figures) or 0.0
        agrees = "within a sample" if abs(own - virtual) <= CYCLE else "no"
        if abs(ratio - 1.0) <= AGREEMENT:
            agrees = f"within {100.0 * AGREEMENT:.0f} %"
        difference = f"{round(1e3 * (own - virtual), 1) + 0.0:+.1f} ms"  # adding nothing makes -0.0 a 0.0
        rows.append((run.experiment.title, _time(virtual), _time(own), difference, f"{ratio:.2f}", agrees))
    caption = (
        "Step times and mean control lags. What real time adds is the way through ROS 2, and cycles that a busy "
        f"machine missed. Within a sample is within a cycle, {1e3 * CYCLE:.1f} ms: the resolution of the lags."
    )
    header = ("", "as shipped", "networked", "difference", "ratio", "agrees")
    return Table(header, tuple(rows), caption, (0, 5)) if rows else None


def repeats_table(results: Results) -> Table | None:
    """Which experiments were repeated, how often and why."""
    rows = tuple((name, str(len(whys)), " ".join(dict.fromkeys(whys))) for name, whys in results.repeats.items())
    caption = "Runs that were discarded and repeated, because the machine or the connection was disturbed."
    return Table(("experiment", "repeated", "why"), rows, caption, (0, 2)) if rows else None


def kpis_of(results: Results, system: System) -> tuple[Kpi, ...]:
    """The indicators of one system, if it was measured."""
    return kpis(results.measured[system]) if system in results.measured else ()


def kpi_table(found: Iterable[Kpi]) -> Table:
    """The seven indicators."""
    words = {None: "not run", True: "yes", False: "no"}
    rows = tuple(
        (each.title, _amount(each.value, each.unit), _amount(each.limit, each.unit), words[each.holds], each.note)
        for each in found
    )
    caption = "Limits are those the thesis suggests in its table 4.2; that of packet loss is ours."
    return Table(("indicator", "measured", "limit", "holds", "how"), rows, caption, (0, 4))


def leg_table(found: Mapping[str, Distribution]) -> Table:
    """Every leg of round trips in milliseconds."""
    cuts = ("mean", "jitter", "p50", "p90", "p99", "p999", "highest")
    rows = tuple(
        (name.replace("_", " "), str(each.count), *(f"{1e3 * getattr(each, cut):.3f}" for cut in cuts))
        for name, each in found.items()
    )
    return Table(("leg", "round trips", "mean", "jitter", "p50", "p90", "p99", "p99.9", "longest"), rows, "[ms]")


def long_trips(results: Results) -> Iterator[str]:
    """A sentence for each end to which networked round trips took much longer than their mean."""
    measured = results.measured.get(System.NETWORKED)
    if measured is None:
        return
    egm = {leg: [getattr(trip, leg) for trip in measured.trips] for leg in LEGS} if measured.trips else {}
    for where, times in (("the EGM loop", egm), ("the state machine", measured.machine_trips)):
        totals = machine_totals(times)
        found = distribution(totals)
        if totals and found.highest > WORST_TO_MEAN * found.mean:
            worst = totals.index(found.highest)
            leg = max(times, key=lambda name: times[name][worst])
            longer = sum(total > WORST_TO_MEAN * found.mean for total in totals)
            yield (
                f"To {where} and back {longer} of {found.count} round trips took longer than {WORST_TO_MEAN:g} times "
                f"the mean of {1e3 * found.mean:.1f} ms; in the longest one, of {1e3 * found.highest:.0f} ms, the leg "
                f"'{leg.replace('_', ' ')}' alone took {1e3 * times[leg][worst]:.0f} ms. 99.9 % take at most "
                f"{1e3 * found.p999:.0f} ms, {found.p999 / found.mean:.1f} times the mean."
            )


def settings_table(settings: Mapping[str, Mapping[str, object]]) -> Table:
    """What was chosen, and which versions ran."""
    rows = []
    for group, values in settings.items():
        for name, value in values.items():
            rows.append((group, name, str(round(value, 3)) if isinstance(value, float) else str(value) or "-"))
    return Table(("of", "setting", "value"), tuple(rows), texts=(0, 1, 2))


def model_settings() -> dict[str, dict[str, object]]:
    """The experiments' settings and those of both virtual robots."""
    return {
        "EGM, fullspeed": asdict(Mode.FULLSPEED.value),
        "EGM, reduced speed": asdict(Mode.REDUCED.value),
        "references": {
            "goals a second": GOAL_RATE,
            "frequency of sines [Hz]": FREQUENCY,
            "tolerance [°]": TOLERANCE_DEG,
        },
        "virtual robot": _model_settings(ArmModel()),
        "fitted robot": _model_settings(FITTED),
    }


def _model_settings(model: ArmModel) -> dict[str, object]:
    return {
        "delay of references [ms]": 1e3 * model.reference_delay,
        "delay [ms]": 1e3 * model.delay,
        "servo lag [ms]": 1e3 * model.lag,
        "acceleration of EGM [rad/s²]": "any" if model.egm_acceleration is None else model.egm_acceleration[0],
    }


_COLORS = {"reproduced": "good", "yes": "good", "no": "bad", "not run": "unknown", "not measured": "unknown"}
"""Verdicts in tables, by how they begin."""


def made(settings: Mapping[str, Mapping[str, object]]) -> str:
    """When, with which version and on which machine the figures were made, as far as it is known."""
    evaluation, versions, machine = (settings.get(group, {}) for group in ("evaluation", "versions", "machine"))
    texts = [
        f"{evaluation['date']}" if "date" in evaluation else "",
        f"yumi-ros2 {versions['yumi-ros2']}" if "yumi-ros2" in versions else "",
        f"commit {versions['commit']}" if versions.get("commit") else "",
        f"{evaluation['mode']}, {evaluation['robot']} robot" if "mode" in evaluation else "",
        f"{machine['system']}, {machine['cpus']} processors, load {machine['load']}" if "load" in machine else "",
    ]
    return " · ".join(text for text in texts if text)


def _limiter_times(results: Results) -> dict[str, float] | None:
    """What a step of 10° with P = 1.2 takes with and without the limiter, with both robots [s]."""
    times: dict[str, Any] = {
        "bare": _value(results, System.BARE, step(proportional(1.2)), "settling_s"),
        "shipped": _value(results, System.SHIPPED, step(proportional(1.2)), "settling_s"),
        "shipped_robot": results.variants.get(Variant.SHIPPED_ROBOT),
        "limited_fit": results.variants.get(Variant.LIMITED_FIT),
    }
    if None in times.values():
        return None
    return times | {"feed_forward": _value(results, System.SHIPPED, step(PREDICTION), "settling_s")}


def _runs(results: Results, experiments: Sequence[Experiment], systems: Iterable[System] = System) -> list[Result]:
    return [run for system in systems for run in results.of(system, experiments)]


def _published() -> Iterator[tuple[Experiment, str, float]]:
    """Every published figure: of which experiment, its name, and the figure [s]."""
    for experiment in published_experiments():
        for name in _FIGURES:
            published = getattr(experiment.published, name)
            if published is not None:
                yield experiment, name, published


def _value(results: Results, system: System, experiment: Experiment, name: str) -> float | None:
    run = results.find(system, experiment)
    found = getattr(run.figures, name) if run else None
    return None if found is None or isnan(found) else float(found)


def _are_near(results: Results) -> list[bool | None]:
    """Of each published figure, whether ours is near; None where it was not run."""
    values = ((_value(results, System.BARE, each, name), published) for each, name, published in _published())
    return [None if value is None else _is_near(value, published) for value, published in values]


def _is_near(value: float, published: float) -> bool:
    return abs(value / published - 1.0) <= NEAR


def _verdict(value: float, published: float) -> str:
    if _is_near(value, published):
        return "reproduced"
    return f"{100.0 * abs(value / published - 1.0):.0f} % {'more' if value > published else 'less'}"


def _with_ratio(value: float | None, published: float) -> tuple[str, str]:
    return _time(value), "-" if value is None else f"{value / published:.2f}"


def _amount(value: float | None, unit: str) -> str:
    if value is None:
        return "-"
    if unit == "s":
        return f"{1e3 * value:.3g} ms"
    return f"{value:.3g}{'' if unit == '°' else ' '}{unit}".strip()


def _milliseconds(value: float) -> str:
    """However many: in a column of lags units would hide which is longer."""
    return "-" if isnan(value) else f"{1e3 * value:.0f} ms"


def _time(value: float | None) -> str:
    """Seconds where there are many, milliseconds where there are few."""
    if value is None or isnan(value):
        return "-"
    return f"{value:.2f} s" if value >= 0.5 else f"{1e3 * value:.0f} ms"
