"""The pictures of the evaluation's report, as SVG whose ink follows the page, and that of gains."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from html import escape
from io import StringIO
from math import degrees, inf
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from yumi_evaluation.comparison import ComparedRobot, Comparison, Record
from yumi_evaluation.experiments import (
    AXIS_6,
    PREDICTION,
    PUBLISHED_OSCILLATION,
    TOLERANCE_DEG,
    Experiment,
    Mode,
    System,
    matches_of,
    proportional,
    sine,
    step,
)
from yumi_evaluation.gain_sweep import SLOWER, GainPoint, Recommendation
from yumi_evaluation.kpis import legs
from yumi_evaluation.results import Result, Results
from yumi_evaluation.round_trips import LEGS, RoundTrip

COLORS = ("#2f81f7", "#d98200", "#009e73", "#cc79a7", "#56b4e9", "#8b949e")
"""Distinct on white and on black, and for colour-blind readers (after Okabe and Ito)."""

GOOD, BAD = "#1a9850", "#d73027"
"""Inside and outside of a limit."""

LINES = {System.BARE: ":", System.SHIPPED: "-", System.NETWORKED: "--"}

_INK, _GRID = "#1b1f24", "#d1d9e0"
_WIDTH = 9.6  # [inch]
_LARGEST = 3.0  # ratio that is drawn where it is; a larger one is at the edge
_LONGEST = {Mode.FULLSPEED: 1.5, Mode.REDUCED: 4.0}  # [s] of steps

Draw = Callable[[Any], None]


class Picture(NamedTuple):
    """A picture of the report.

    Attributes:
        svg: to be put into a page that defines the colours --ink and --line.
        caption: what it shows, with units and the thesis's figure numbers.
    """

    svg: str
    caption: str


def draw_pictures(results: Results) -> dict[str, Picture]:
    """The pictures that the results allow, by name."""
    drawn = {}
    for name, height, caption, draw in _pictures(results):
        drawn[name] = _picture(_svg(draw, height, name), caption)
    return drawn


def _picture(svg: str, caption: str) -> Picture:
    svg = svg[svg.index("<svg") :].replace(_INK, "var(--ink)").replace(_GRID, "var(--line)")
    return Picture(re.sub("<svg ", f'<svg role="img" aria-label="{escape(caption)}" ', svg, count=1), caption)


def draw_ratios(
    name: str, caption: str, ratios: Sequence[tuple[str, float | None]], limits: tuple[float, float]
) -> Picture:
    """Ratios as a dot each, green between ``limits``, red outside; what was not run is grey and says so.

    Narrow enough to be read on a telephone.
    """
    lower, upper = limits

    def draw(figure: Any) -> None:
        panel = figure.subplots()
        panel.axvspan(lower, upper, color=GOOD, alpha=0.15, linewidth=0.0)
        longest = max([1.3 * upper, *(1.1 * ratio for _, ratio in ratios if ratio is not None and ratio < _LARGEST)])
        for row, (_, ratio) in enumerate(reversed(ratios)):
            if ratio is None:
                panel.text(0.5 * longest, row, "not run", color=COLORS[-1], ha="center", va="center", style="italic")
                continue
            color = GOOD if lower <= ratio <= upper else BAD
            panel.plot([min(ratio, longest)], [row], "o", color=color, markersize=7.0)
            panel.annotate(f"{ratio:.2f}", (min(ratio, longest), row), (7, 0), textcoords="offset points", va="center")
        panel.set(xlim=(0.0, 1.12 * longest), ylim=(-0.6, len(ratios) - 0.4))
        panel.set_yticks(range(len(ratios)), [title for title, _ in reversed(ratios)])

    svg = _svg(draw, 0.55 + 0.27 * len(ratios), name, width=5.4)
    return _picture(svg, caption)


def draw_recommendation(found: Recommendation, shipped: float, steps: Sequence[Result], file: Path) -> None:
    """Save the steps and the sweeps as an SVG picture.

    Args:
        found: the sweeps, and the gain they recommend.
        shipped: the gain that is delivered.
        steps: the step with a few of the gains, to be seen as curves.
        file: where to.
    """

    def draw(figure: Any) -> None:
        figure.suptitle(f"Proportional gain: {found.headline}")
        response, settling, overshoot = figure.subplots(1, 3)
        overshoot.sharex(settling)
        size = steps[0].experiment.size_deg if steps else 0.0
        response.axhspan(size - TOLERANCE_DEG, size + TOLERANCE_DEG, color="#8b949e", alpha=0.4, linewidth=0.0)
        for run, color in zip(steps, COLORS, strict=False):
            _plot(response, run, "-", color, run.experiment.controller.title)
        response.set(title="Step of the virtual robot", xlabel="time [s]", ylabel="angle [°]")
        _show_legend(response, loc="lower right")
        sweeps = {"virtual robot": found.points, f"{1e3 * SLOWER:g} ms slower": found.slower}
        _draw_sweep(sweeps, (settling, overshoot))
        settling.set_title("How long a step takes")
        overshoot.set_title("How far it goes past the goal")
        for panel in (settling, overshoot):
            panel.axvline(shipped, color=_INK, linestyle=":", linewidth=1.2, label=f"shipped: {shipped:g}")
            if found.gain is not None:
                label = f"recommended: {found.gain:g}"
                panel.axvline(found.gain, color=COLORS[2], linestyle="--", linewidth=1.2, label=label)
        settling.get_legend().remove()  # its lines leave no room
        # Its frame is opaque: the line of the delivered gain goes through it.
        handles = settling.get_legend_handles_labels()
        overshoot.legend(*handles, loc="upper left", framealpha=1.0, edgecolor="none", fontsize="small")

    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(_svg(draw, 3.8, "tune", width=12.6, is_transparent=False), encoding="utf-8")


_MOST_ROBOTS = 3  # in a picture


def draw_comparison(comparison: Comparison, file: Path) -> None:
    """Save a comparison as an SVG picture, a row a robot.

    On the left the record in which most happens: commands, what the robot reported, what the virtual robot did; in the
    middle how far apart these two are; on the right the records one beside the other.
    """
    robots = comparison.robots[:_MOST_ROBOTS]

    def draw(figure: Any) -> None:
        rows = figure.subplots(len(robots), 3, squeeze=False, width_ratios=(5, 5, 4))
        for robot, (motion, difference, records) in zip(robots, rows, strict=True):
            record = max(robot.records, key=lambda each: np.ptp(each.log.measured, axis=0).max())
            _draw_motion(record, motion, difference)
            motion.set_title(f"{robot.name}: {record.log.name}")
            _draw_records(robot, records)

    file.parent.mkdir(parents=True, exist_ok=True)
    height = 0.4 + 3.2 * len(robots)
    file.write_text(_svg(draw, height, "compare", width=14.0, is_transparent=False), encoding="utf-8")


def _draw_motion(record: Record, motion: Any, difference: Any) -> None:
    log = record.log
    apart = np.degrees(record.reported - log.measured)
    travel = np.ptp(log.measured, axis=0)
    most = [joint for joint in np.argsort(-travel)[: len(COLORS)] if travel[joint] > 0.05 * travel.max()]
    steps = np.arange(len(log.commands)) * log.cycle
    for joint, color in zip(most, COLORS, strict=False):
        start = log.start[joint]
        inside = (steps >= log.times[0]) & (steps <= log.times[-1])
        commands = np.degrees(log.commands[inside, joint] - start)
        motion.plot(steps[inside], commands, ":", color=color, linewidth=0.9)
        motion.plot(log.times, np.degrees(log.measured[:, joint] - start), color=color, label=log.joints[joint])
        virtual = np.degrees(record.reported[:, joint] - start)
        motion.plot(log.times, virtual, "--", color=_INK, linewidth=0.9)
        difference.plot(log.times, apart[:, joint], color=color, linewidth=1.1, label=log.joints[joint])
    for panel in (motion, difference):
        late = log.times[~record.is_free]
        if record.limited is not None and len(late):
            panel.axvspan(late[0], late[-1], color=COLORS[-1], alpha=0.25, linewidth=0.0, label="limited")
        panel.set_xlabel("time [s]")
    motion.set_ylabel("from the start [°]")
    motion.plot([], [], ":", color=_INK, linewidth=0.9, label="command")
    motion.plot([], [], "--", color=_INK, linewidth=0.9, label="virtual robot")
    difference.set(title="virtual robot minus robot", ylabel="difference [°]")
    free = np.abs(apart[record.is_free])
    if free.size and record.limited is not None:  # where joints are limited, the difference leaves the picture
        difference.set_ylim(-1.5 * free.max(), 1.5 * free.max())
    low, high = motion.get_ylim()
    motion.set_ylim(low, high + 0.35 * (high - low))
    _show_legend(motion, loc="upper center", ncols=4, columnspacing=0.8, handletextpad=0.3)


def _draw_records(robot: ComparedRobot, panel: Any) -> None:
    shown = [each for each in robot.records if each.rms_deg is not None]
    places = range(len(shown), 0, -1)
    panel.plot([each.rms_deg for each in shown], places, "o", color=COLORS[0], label="virtual robot")
    fitted = [each.fitted_deg for each in shown]
    panel.plot(fitted, places, "D", color=COLORS[1], markersize=4.0, label="with fitted parameters")
    limits = [(each.limited.rms_deg, place) for each, place in zip(shown, places, strict=True) if each.limited]
    if limits:
        panel.plot(*zip(*limits, strict=True), "x", color=BAD, label="limited rows")
    panel.set_xscale("log")
    panel.set_yticks(places, [each.log.name for each in shown], fontsize="small")
    panel.set(title="rms of each record", xlabel="rms [°]", ylim=(0.4, len(shown) + 1.4))
    _show_legend(panel, loc="upper center", ncols=3, columnspacing=0.8, handletextpad=0.2)


def _svg(draw: Draw, height: float, name: str, *, width: float = _WIDTH, is_transparent: bool = True) -> str:
    inked = ("axes.edgecolor", "axes.labelcolor", "text.color", "xtick.color", "ytick.color")
    style = {
        **dict.fromkeys(inked, _INK),
        "font.size": 9.0,
        "axes.titlesize": 10.0,
        "axes.axisbelow": True,
        "svg.hashsalt": name,  # the same picture is the same file, and ids of two pictures differ
    }
    with mpl.rc_context(style):
        figure = Figure(figsize=(width, height), layout="constrained")
        draw(figure)
        for panel in figure.axes:
            panel.grid(color=_GRID, linewidth=0.6)
            panel.spines[["top", "right"]].set_visible(False)
        text = StringIO()
        figure.savefig(text, format="svg", transparent=is_transparent, metadata={"Date": None})
    return text.getvalue()


def _pictures(results: Results) -> Iterator[tuple[str, float, str, Draw]]:
    """Name, height [inch], caption and how it is drawn."""
    if any(run.experiment.is_step for run in results.runs):
        ran = [system for system in LINES if any(run.system is system for run in results.runs)]
        styles = {":": "dotted", "-": "solid", "--": "dashed"}
        caption = (
            "Steps of 10° at full speed and reduced speed (thesis: figures 5.1 and 5.2). A colour is a controller. "
            f"The line: {', '.join(f'{styles[LINES[system]]} {system.title}' for system in ran)}. "
            "The grey band is 0.1° around the goal."
        )
        yield "steps", 3.6, caption, lambda figure: _draw_steps(results, figure)
    if any(not run.experiment.is_step for run in results.runs):
        caption = (
            "A sine of 10° at 0.2 Hz followed with three controllers, and how far the joint was from the reference of "
            "the same moment (thesis: figures 5.3a and 5.4a)."
        )
        yield "sines", 4.6, caption, lambda figure: _draw_sines(results, figure)
        caption = (
            "Control lag of every goal that found a match (thesis: figures 5.3b, 5.4b, 5.6 and 5.7b). The vertical "
            "lines are the published mean (solid) and longest lag (dashed)."
        )
        yield "lags", 4.6, caption, lambda figure: _draw_lags(results, figure)
        caption = "The sine of 10° at reduced speed, 10 °/s (thesis: figures 5.5a to 5.5c)."
        yield "reduced", 2.9, caption, lambda figure: _draw_reduced(results, figure)
    if results.sweeps:
        caption = (
            "Steps of 10° with one gain after another: how long they take and how far they overshoot. The dashed line "
            "is the gain at which the thesis saw oscillation begin. On the left, a line ends where steps no longer "
            "settle."
        )
        yield "sweep", 3.2, caption, lambda figure: _draw_sweeps(results, figure)
    for system, measured in results.measured.items():
        if measured.trips:
            caption = f"Round trips from the application to the EGM loop, the robot and back ({system.title})."
            yield f"trips_{system.value}", 3.2, caption, partial(_draw_trips, measured.trips)


def _draw_steps(results: Results, figure: Any) -> None:
    controllers = {
        Mode.FULLSPEED: (proportional(1.2), proportional(1.6), proportional(2.0), PREDICTION),
        Mode.REDUCED: (proportional(0.35), proportional(0.6), proportional(1.2)),
    }
    for panel, mode in zip(figure.subplots(1, 2), controllers, strict=True):
        panel.axhspan(9.9, 10.1, color="#8b949e", alpha=0.4, linewidth=0.0)
        for controller, color in zip(controllers[mode], COLORS, strict=False):
            runs = [run for system in System if (run := results.find(system, step(controller, mode))) is not None]
            for run in runs:
                _plot(panel, run, LINES[run.system], color, None, until=_LONGEST[mode])
            if runs:
                panel.plot([], [], color=color, label=controller.title)  # solid, whichever line came first
        panel.set(title=f"{mode.word}, {mode.value.max_speed_deviation:g} °/s", xlabel="time [s]", ylabel="angle [°]")
        _show_legend(panel, loc="lower right")


def _draw_sines(results: Results, figure: Any) -> None:
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    controllers = (proportional(1.2), proportional(2.0), PREDICTION)
    runs = [run for each in controllers if (run := _nearest_to_a_robot(results, sine(each)))]
    for run, color in zip(runs, COLORS, strict=False):
        _plot(upper, run, "-", color, run.experiment.controller.title)
        times, angles = run.trace.measured_deg(AXIS_6).T
        references = [degrees(run.experiment.reference(time)) for time in times]
        lower.plot(times, angles - references, color=color, linewidth=1.3)
    if runs:
        # Beneath the others, and wider: a line without lag would be hidden by it.
        goals = runs[0].trace.sent_deg.T
        upper.plot(*goals, color=_INK, linewidth=3.5, alpha=0.3, zorder=1.5, label="goals")
    _show_legend(upper, ncols=2, loc="lower left")
    upper.set_ylabel("angle [°]")
    lower.set(xlabel="time [s]", ylabel="distance [°]")


def _draw_lags(results: Results, figure: Any) -> None:
    shown = (
        sine(proportional(1.2)),
        sine(proportional(2.0)),
        sine(proportional(1.2), size_deg=60.0),
        sine(proportional(1.2), Mode.REDUCED),
    )
    for panel, experiment in zip(figure.subplots(2, 2).flat, shown, strict=True):
        for system, color in zip(System, COLORS, strict=False):
            run = results.find(system, experiment)
            if run is None:
                continue
            lags = 1e3 * matches_of(run.trace, AXIS_6).lags[:, 1]
            panel.hist(lags, bins=60, histtype="step", density=True, color=color, label=system.title, linewidth=1.2)
            published = run.experiment.published
            for value, line in ((published.mean_lag_s, "-"), (published.max_lag_s, "--")):
                if value is not None:
                    panel.axvline(1e3 * value, color=_INK, linestyle=line, linewidth=0.9)
        panel.set(title=experiment.title, xlabel="control lag [ms]", ylabel="fraction per ms")
        _show_legend(panel, loc="upper left")


def _draw_reduced(results: Results, figure: Any) -> None:
    panels = figure.subplots(1, 3, sharey=True)
    for panel, gain in zip(panels, (0.35, 0.6, 1.2), strict=True):
        runs = [(system, results.find(system, sine(proportional(gain), Mode.REDUCED))) for system in System]
        found = [(run, color) for (_, run), color in zip(runs, COLORS, strict=False) if run is not None]
        if found:
            panel.plot(*found[0][0].trace.sent_deg.T, color=_INK, linewidth=0.8, alpha=0.7, label="goals")
        for run, color in found:
            _plot(panel, run, "-", color, run.system.title)
        panel.set(title=f"P = {gain:g}", xlabel="time [s]")
    panels[0].set_ylabel("angle [°]")
    _show_legend(panels[0])


def _draw_sweeps(results: Results, figure: Any) -> None:
    panels = figure.subplots(1, 2)
    _draw_sweep({system.title: points for system, points in results.sweeps.items()}, panels)
    for panel in panels:
        panel.axvline(PUBLISHED_OSCILLATION, color=_INK, linestyle="--", linewidth=0.9)


def _draw_sweep(sweeps: dict[str, tuple[GainPoint, ...]], panels: Any) -> None:
    """Time to settle and overshoot over the gain, a line a sweep, on two panels."""
    for (title, points), color in zip(sweeps.items(), COLORS, strict=False):
        gains = [point.gain for point in points]
        times = [np.nan if (time := point.figures.settling_s) is None else time for point in points]
        panels[0].plot(gains, times, "o-", color=color, markersize=3.0, label=title)
        panels[1].plot(gains, [point.figures.overshoot_deg for point in points], "o-", color=color, markersize=3.0)
    panels[0].set_ylabel("time until within 0.1° [s]")
    panels[1].set_ylabel("overshoot [°]")
    for panel in panels:
        panel.set_xlabel("P")
    _show_legend(panels[0])


def _draw_trips(trips: Sequence[RoundTrip], figure: Any) -> None:
    left, right = figure.subplots(1, 2)
    left.hist([1e3 * trip.total for trip in trips], bins=80, color=COLORS[0])
    left.set(xlabel="whole round trip [ms]", ylabel="round trips")
    found = legs(trips)
    names = [name for name in LEGS if found[name].highest > 0.0][::-1]
    titles = [name.replace("_", " ") for name in names]
    right.barh(titles, [1e3 * found[name].mean for name in names], color=COLORS[0], label="mean")
    right.barh(titles, [1e3 * found[name].p99 for name in names], color="none", edgecolor=COLORS[1], label="p99")
    right.set_xlabel("leg [ms]")
    _show_legend(right)


def _nearest_to_a_robot(results: Results, experiment: Experiment) -> Result | None:
    found = [results.find(system, experiment) for system in (System.NETWORKED, System.SHIPPED, System.BARE)]
    return next((run for run in found if run is not None), None)


def _plot(panel: Any, run: Result, line: str, color: str, label: str | None, until: float = inf) -> None:
    measured = run.trace.measured_deg(run.experiment.moved[0])
    panel.plot(*measured[measured[:, 0] <= until].T, line, color=color, label=label, linewidth=1.3)


def _show_legend(panel: Any, **options: Any) -> None:
    if panel.get_legend_handles_labels()[0]:
        panel.legend(frameon=False, fontsize="small", **options)
