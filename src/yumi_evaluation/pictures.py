"""The pictures of the evaluation's report, each as an SVG for light pages and one for dark ones.

A picture of arms that followed references: the angle, what was measured, and the error below.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from io import StringIO
from math import degrees, inf
from pathlib import Path
from typing import Any

from yumi.errors import MissingPrerequisite
from yumi_evaluation.document import Picture
from yumi_evaluation.experiment import FREQUENCY, PREDICTION, Mode, Run, System, proportional, sine, step
from yumi_evaluation.experiments import GainPoint
from yumi_evaluation.kpis import legs
from yumi_evaluation.lag_study import NEAR, LagStudy, studied_sines
from yumi_evaluation.results import Result, Results
from yumi_evaluation.round_trips import LEGS, Trip
from yumi_evaluation.tracking_figures import SineFigures, matches_of

COLORS = ("#2f81f7", "#d98200", "#009e73", "#cc79a7", "#56b4e9", "#8b949e")
"""Told apart on white and on black, and by people who do not see all colours (after Okabe and Ito)."""

LINES = {System.BARE: ":", System.SHIPPED: "-", System.WIRE: "--"}

_INK, _GRID = "#1b1f24", "#d1d9e0"
_DARK = {_INK: "#e6edf3", _GRID: "#3d444d"}
_WIDTH = 9.6  # [inch]
_LONGEST = {Mode.FULLSPEED: 1.5, Mode.REDUCED: 4.0}  # [s] of steps

Draw = Callable[[Any], None]


def draw_pictures(results: Results, folder: Path) -> dict[str, Picture]:
    """Draw what there is of the results into ``folder``; the pictures by name.

    Raises:
        MissingPrerequisite: matplotlib is not installed.
        OSError: the folder cannot be written.
    """
    (folder / "figures").mkdir(parents=True, exist_ok=True)
    drawn = {}
    for name, height, caption, draw in _pictures(results):
        _save(folder, name, height, draw)
        drawn[name] = Picture(f"figures/{name}.svg", f"figures/{name}_dark.svg", caption)
    return drawn


def draw_sweep(sweeps: Sequence[tuple[str, Sequence[GainPoint]]], panels: Any) -> None:
    """Time to settle and overshoot over the gain, a line a sweep, on two panels."""
    for (title, points), color in zip(sweeps, COLORS, strict=False):
        gains = [point.gain for point in points]
        settled = [(point.gain, point.figures.settling_s) for point in points if point.figures.settling_s is not None]
        panels[0].plot(*zip(*settled, strict=True), "o-", color=color, markersize=3.0, label=title)
        panels[1].plot(gains, [point.figures.overshoot_deg for point in points], "o-", color=color, markersize=3.0)
    panels[0].set_ylabel("time until within 0.1° [s]")
    panels[1].set_ylabel("overshoot [°]")
    for panel in panels:
        panel.set_xlabel("P")
    _name_lines(panels[0])


def save_figure(draw: Draw, height: float, *, is_transparent: bool = True) -> tuple[str, str]:
    """The figure that ``draw`` draws, ``height`` [inch] high, as SVG for light and for dark pages.

    Raises:
        MissingPrerequisite: matplotlib is not installed.
    """
    try:
        import matplotlib as mpl  # noqa: PLC0415 - an extra; nothing else needs it
        from matplotlib.figure import Figure  # noqa: PLC0415
    except ImportError as error:
        raise MissingPrerequisite("The report's pictures need matplotlib; install yumi-ros2[plot].") from error
    with mpl.rc_context(_style()):
        figure = Figure(figsize=(_WIDTH, height), layout="constrained")
        draw(figure)
        for panel in figure.axes:
            panel.grid(color=_GRID, linewidth=0.6)
            panel.spines[["top", "right"]].set_visible(False)
        text = StringIO()
        figure.savefig(text, format="svg", transparent=is_transparent, metadata={"Date": None})
    light = text.getvalue()
    dark = light
    for one, other in _DARK.items():
        dark = dark.replace(one, other)
    return light, dark


def _save(folder: Path, name: str, height: float, draw: Draw) -> None:
    light, dark = save_figure(draw, height)
    (folder / "figures" / f"{name}.svg").write_text(light, encoding="utf-8")
    (folder / "figures" / f"{name}_dark.svg").write_text(dark, encoding="utf-8")


def _style() -> dict[str, Any]:
    inked = ("axes.edgecolor", "axes.labelcolor", "text.color", "xtick.color", "ytick.color")
    return {
        **dict.fromkeys(inked, _INK),
        "font.size": 9.0,
        "axes.titlesize": 10.0,
        "axes.axisbelow": True,
        "svg.hashsalt": "yumi",  # the same picture is the same file
    }


def _pictures(results: Results) -> Iterable[tuple[str, float, str, Draw]]:
    """Name, height [inch], caption and how it is drawn."""
    if any(run.experiment.is_step for run in results.runs):
        caption = (
            "Steps of 10° at full speed and reduced speed (thesis: figures 5.1 and 5.2). A colour is a law. Dotted: "
            "without a guard; solid: as shipped; dashed: over the wire. The grey band is 0.1° around the "
            "goal."
        )
        yield "steps", 3.6, caption, lambda figure: _draw_steps(results, figure)
    if any(not run.experiment.is_step for run in results.runs):
        caption = (
            "A sine of 10° at 0.2 Hz followed with three laws, and how far the joint was from the reference of the "
            "same moment (thesis: figures 5.3a and 5.4a)."
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
    if results.study is not None:
        caption = (
            "Control lags predicted at every frequency: mean (solid) and longest (dashed). The bands are the published "
            "figures and a tenth to either side: a frequency explains them where each line is inside the band of its "
            f"colour. The dotted line is the frequency we take, {FREQUENCY:g} Hz."
        )
        yield "frequency", 3.2, caption, partial(_draw_frequencies, results.study)
    for system, measured in results.measured.items():
        if measured.trips:
            caption = (
                f"Round trips from the application to the EGM loop, the robot and back, leg by leg ({system.title})."
            )
            yield f"trips_{system.value}", 3.2, caption, partial(_draw_trips, measured.trips)


def _draw_steps(results: Results, figure: Any) -> None:
    panels = figure.subplots(1, 2)
    laws = {
        Mode.FULLSPEED: (proportional(1.2), proportional(1.6), proportional(2.0), PREDICTION),
        Mode.REDUCED: (proportional(0.35), proportional(0.6), proportional(1.2)),
    }
    for panel, mode in zip(panels, laws, strict=True):
        panel.axhspan(9.9, 10.1, color="#8b949e", alpha=0.4, linewidth=0.0)
        for law, color in zip(laws[mode], COLORS, strict=False):
            runs = [run for system in System if (run := results.find(system, step(law, mode))) is not None]
            for run in runs:
                _plot(panel, run, LINES[run.system], color, None, until=_LONGEST[mode])
            if runs:
                panel.plot([], [], color=color, label=law.title)  # solid, whichever line came first
        panel.set(title=f"{mode.word}, {mode.value.max_speed_deviation:g} °/s", xlabel="time [s]", ylabel="angle [°]")
        _name_lines(panel, loc="lower right")


def _plot(panel: Any, run: Result, line: str, color: str, label: str | None, until: float = inf) -> None:
    shown = [(time, value) for time, value in run.trace.measured_deg(run.experiment.moved[0]) if time <= until]
    times, values = zip(*shown, strict=True)
    panel.plot(times, values, line, color=color, label=label, linewidth=1.3)


def _draw_sines(results: Results, figure: Any) -> None:
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    runs = [(run, law) for law in (proportional(1.2), proportional(2.0), PREDICTION) if (run := _shown(results, law))]
    for (run, law), color in zip(runs, COLORS, strict=False):
        _plot(upper, run, "-", color, law.title)
        reference = run.experiment.reference
        moved = [(time, value - degrees(reference(time))) for time, value in run.trace.measured_deg(6)]
        lower.plot(*zip(*moved, strict=True), color=color, linewidth=1.3)
    if runs:
        # Beneath the others, and wider: who follows without lag would be hidden by it.
        goals = zip(*runs[0][0].trace.sent_deg, strict=True)
        upper.plot(*goals, color=_INK, linewidth=3.5, alpha=0.3, zorder=1.5, label="goals")
    _name_lines(upper, ncols=2, loc="lower left")
    upper.set_ylabel("angle [°]")
    lower.set(xlabel="time [s]", ylabel="distance [°]")


def _shown(results: Results, law: Any) -> Result | None:
    """What is nearest to a robot."""
    found = [results.find(system, sine(law)) for system in (System.WIRE, System.SHIPPED, System.BARE)]
    return next((run for run in found if run is not None), None)


def _draw_lags(results: Results, figure: Any) -> None:
    panels = figure.subplots(2, 2).flat
    shown = (
        sine(proportional(1.2)),
        sine(proportional(2.0)),
        sine(proportional(1.2), size_deg=60.0),
        sine(proportional(1.2), Mode.REDUCED),
    )
    for panel, experiment in zip(panels, shown, strict=True):
        for system, color in zip(System, COLORS, strict=False):
            run = results.find(system, experiment)
            if run is not None and isinstance(run.figures, SineFigures):
                lags = [1e3 * lag for _, lag in matches_of(run.trace).lags]
                panel.hist(lags, bins=60, histtype="step", density=True, color=color, label=system.title, linewidth=1.2)
                _draw_published(panel, run)
        panel.set(title=experiment.title, xlabel="control lag [ms]", ylabel="share per ms")
        _name_lines(panel, loc="upper left")


def _name_lines(panel: Any, **options: Any) -> None:
    if panel.get_legend_handles_labels()[0]:
        panel.legend(frameon=False, fontsize="small", **options)


def _draw_published(panel: Any, run: Result) -> None:
    for value, line in ((run.experiment.published.mean_lag, "-"), (run.experiment.published.max_lag, "--")):
        if value is not None:
            panel.axvline(1e3 * value, color=_INK, linestyle=line, linewidth=0.9)


def _draw_reduced(results: Results, figure: Any) -> None:
    panels = figure.subplots(1, 3, sharey=True)
    for panel, gain in zip(panels, (0.35, 0.6, 1.2), strict=True):
        runs = [results.find(system, sine(proportional(gain), Mode.REDUCED)) for system in System]
        sent = next((run.trace.sent_deg for run in runs if run is not None), None)
        if sent:
            panel.plot(*zip(*sent, strict=True), color=_INK, linewidth=0.8, alpha=0.7, label="goals")
        for run, color in zip(runs, COLORS, strict=False):
            if run is not None:
                _plot(panel, run, "-", color, run.system.title)
        panel.set(title=f"P = {gain:g}", xlabel="time [s]")
    panels[0].set_ylabel("angle [°]")
    _name_lines(panels[0])


def _draw_sweeps(results: Results, figure: Any) -> None:
    panels = figure.subplots(1, 2)
    draw_sweep([(system.title, points) for system, points in results.sweeps.items()], panels)
    for panel in panels:
        panel.axvline(2.0, color=_INK, linestyle="--", linewidth=0.9)


def _draw_frequencies(study: LagStudy, figure: Any) -> None:
    panels = figure.subplots(1, len(studied_sines()))
    for number, (panel, experiment) in enumerate(zip(panels, studied_sines(), strict=True)):
        lags = [each[number] for each in study.frequencies.values()]
        series = (
            ("mean", "-", COLORS[0], experiment.published.mean_lag, [each.mean for each in lags]),
            ("longest", "--", COLORS[1], experiment.published.max_lag, [each.longest for each in lags]),
        )
        for words, line, color, published, values in series:
            assert published is not None, "only sines with published lags are studied"
            panel.axhspan(
                1e3 * (1.0 - NEAR) * published, 1e3 * (1.0 + NEAR) * published, color=color, alpha=0.18, linewidth=0
            )
            panel.plot(list(study.frequencies), [1e3 * value for value in values], line, color=color, label=words)
        panel.axvline(FREQUENCY, color=_INK, linewidth=0.8, linestyle=":")
        panel.set_xscale("log")
        panel.set_xticks([0.02, 0.05, 0.1, 0.2, 0.5], ["0.02", "0.05", "0.1", "0.2", "0.5"])
        panel.set(title=f"{experiment.size_deg:g}°, {experiment.law.title}", xlabel="frequency [Hz]", ylim=(0, None))
        panel.minorticks_off()
    panels[0].set_ylabel("control lag [ms]")
    _name_lines(panels[0], loc="lower right")


def _draw_trips(trips: Sequence[Trip], figure: Any) -> None:
    left, right = figure.subplots(1, 2)
    left.hist([1e3 * trip.total for trip in trips], bins=80, color=COLORS[0])
    left.set(xlabel="whole round trip [ms]", ylabel="round trips")
    found = legs(trips)
    names = [name for name in LEGS if found[name].highest > 0.0][::-1]
    titles = [name.replace("_", " ") for name in names]
    right.barh(titles, [1e3 * found[name].mean for name in names], color=COLORS[0], label="mean")
    right.barh(titles, [1e3 * found[name].p99 for name in names], color="none", edgecolor=COLORS[1], label="p99")
    right.set_xlabel("leg [ms]")
    _name_lines(right)


def draw_runs(runs: Sequence[tuple[str, Run]], file: Path) -> None:
    """Draw each named run in a column of its own and save the picture as ``file``.

    Raises:
        MissingPrerequisite: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra; nothing else needs it
    except ImportError as error:
        raise MissingPrerequisite("Pictures need matplotlib; install yumi-ros2[plot].") from error
    figure = Figure(figsize=(4.5 * len(runs), 6.0), layout="constrained")
    panels = figure.subplots(2, len(runs), sharex="col", squeeze=False, height_ratios=(2, 1))
    for (name, run), upper, lower in zip(runs, panels[0], panels[1], strict=True):
        _draw(upper, lower, run)
        upper.set_title(name)
    panels[0][0].set_ylabel("angle [°]")
    panels[1][0].set_ylabel("error [°]")
    panels[0][-1].legend(frameon=False)
    figure.savefig(file, dpi=150)


def _draw(upper: Any, lower: Any, run: Run) -> None:
    times = [each.time for each in run.samples]
    upper.plot(times, [degrees(each.reference) for each in run.samples], label="reference", linewidth=3.0, alpha=0.4)
    upper.plot(times, [degrees(each.measured) for each in run.samples], label="measured")
    lower.plot(times, [degrees(each.measured - each.reference) for each in run.samples])
    lower.set_xlabel("time [s]")
    for panel in (upper, lower):
        panel.grid(alpha=0.3)
