"""Pictures: of a recording around an event, and of the paths of joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, degrees, isfinite, nan, radians
from pathlib import Path
from textwrap import fill
from typing import Any

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, missing_extra
from abb_protocols.robot.joints import CHAIN_AXES, Joints, Side
from yumi.control.flight_recorder import RecordedCycle
from yumi.recording.message_types import CYCLE_STAGES
from yumi.recording.reader import FLIGHT_RECORD_AFTER, Recording
from yumi.recording.tables import RECORDING_GAP, recording_gaps

_MOVED = radians(0.1)
"""An axis is drawn when it, its command or its reference changed by more than this [rad]."""

_CURVES = (
    ("reference", ":", "#8b949e"),
    ("desired", "--", "#009e73"),
    ("sent", "-", "#d98200"),
    ("position", "-", "#2f81f7"),
)

_TimedPath = Sequence[tuple[float, Joints]]
"""Times [s] and positions [rad] of one arm."""


def draw_recording(recording: Recording, side: Side, file: Path) -> None:
    """Draw one arm's cycles around the event and save the picture as ``file``.

    A panel for each axis that moved, one for how far the axes are from what was sent to them, and one for the stages of
    a cycle. The event is in the middle; gaps between datagrams are grey.

    Raises:
        CommandRefused: no cycle of that arm is recorded.
        MissingPrerequisite: matplotlib is not installed.
    """
    frames = recording.frames.get(side, ())
    if not frames:
        raise CommandRefused(message("no_cycle_of_arm", arm=side.word))
    stop = recording.stop
    zero = stop.time if stop else frames[-1].time
    # An event long after the last cycle: the last cycles are what there is to see.
    window = max(FLIGHT_RECORD_AFTER, 2.0 * (zero - frames[-1].time))
    shown = [frame for frame in frames if abs(frame.time - zero) <= window]
    gaps = [(begin - zero, end - zero) for begin, end in recording_gaps(shown)]
    if stop and shown[-1].time < zero + window - RECORDING_GAP:
        gaps.append((shown[-1].time - zero, window))
    # None stands where lines break: in every gap.
    points: list[tuple[float, RecordedCycle | None]] = [(frame.time - zero, frame) for frame in shown]
    points = sorted(points + [(begin, None) for begin, _ in gaps], key=lambda point: point[0])
    times = [time for time, _ in points]

    def curve(name: str, index: int) -> list[float]:
        vectors = [getattr(frame, name, None) for _, frame in points]
        return [nan if vector is None else degrees(vector[index]) for vector in vectors]

    def span(index: int) -> float:
        values = [value for name, _, _ in _CURVES for value in curve(name, index) if isfinite(value)]
        return max(values) - min(values)

    spans = [span(index) for index in range(len(CHAIN_AXES))]
    moved = [index for index, each in enumerate(spans) if each > degrees(_MOVED)]
    drawn = moved or [max(range(len(spans)), key=spans.__getitem__)]
    columns = min(2 if len(drawn) <= 4 else 3, len(drawn) + 1)
    lines = ceil(len(drawn) / columns) + 1
    figure = _figure(5.6 * columns, 2.5 * lines + 0.8)
    grid = figure.add_gridspec(lines, 2 * columns)
    panels = []
    for number, index in enumerate(drawn):
        row, column = divmod(number, columns)
        panel = figure.add_subplot(grid[row, 2 * column : 2 * column + 2])
        for name, style, color in _CURVES:
            label = "measured" if name == "position" else name
            panel.plot(times, curve(name, index), style, color=color, linewidth=1.3, label=label)
        panel.set_title(f"axis {CHAIN_AXES[index]} [°]")
        panels.append(panel)
    error = figure.add_subplot(grid[lines - 1, :columns])
    for index in drawn:
        sent, measured = curve("sent", index), curve("position", index)
        error.plot(times, [a - b for a, b in zip(sent, measured, strict=True)], label=str(CHAIN_AXES[index]))
    error.set_title("error: sent − measured [°]")
    error.legend(title="axis", fontsize="x-small", loc="upper right", ncols=4)

    # Stacked, so that the upper edge is the whole cycle.
    stages = figure.add_subplot(grid[lines - 1, columns:])
    layers = [
        [0.0 if frame is None else getattr(frame.stages, name) * 1e6 for _, frame in points] for name in CYCLE_STAGES
    ]
    stages.stackplot(times, *layers, labels=CYCLE_STAGES, linewidth=0.0, step="post")
    stages.set(title="stages of a cycle [µs]")
    stages.legend(loc="upper right", fontsize="x-small", ncols=4)
    panels[0].legend(loc="best", fontsize="small")
    for panel in (*panels, error, stages):
        for begin, end in gaps:
            panel.axvspan(begin, end, color="#8b949e", alpha=0.25, linewidth=0.0)
        panel.axvline(0.0, color="#cf222e", linewidth=1.2)
        panel.grid(alpha=0.3)
        panel.set(xlim=(-window, window), xlabel="time from the event [s]" if stop else "time from the last cycle [s]")
    headline = fill(stop.sentence if stop else f"{side.word.capitalize()} arm: nothing stopped a motion.", 55 * columns)
    figure.suptitle(
        f"{headline}\nRed: the event. Grey: no datagrams recorded. "
        + ("Axes at rest are left out." if moved else "No axis moved."),
        fontsize=10,
    )
    figure.savefig(file, dpi=120)


def draw_joint_paths(paths: Mapping[Side, _TimedPath], file: Path) -> None:
    """Draw ``paths``, a panel an arm, over the time since the first of all and save the picture as ``file``.

    Raises:
        MissingPrerequisite: matplotlib is not installed.
    """
    figure = _figure(10.0, 4.5)
    panels = figure.subplots(1, len(paths), sharex=True, sharey=True, squeeze=False)[0]
    begin = min(time for path in paths.values() for time, _ in path)
    for panel, (side, path) in zip(panels, paths.items(), strict=True):
        times = [time - begin for time, _ in path]
        for index, axis in enumerate(CHAIN_AXES):
            panel.plot(times, [degrees(position[index]) for _, position in path], label=str(axis))
        panel.grid(alpha=0.3)
        panel.set_xlabel("time [s]")
        panel.set_title(f"{side.word.capitalize()} arm")
    panels[0].set_ylabel("joint position [°]")
    panels[-1].legend(title="ABB axis", loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    figure.savefig(file, dpi=150)


def _figure(width: float, height: float) -> Any:
    """An empty picture of that size [inch]."""
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra; nothing else needs it
    except ImportError as error:
        raise missing_extra(message("pictures_need_matplotlib"), "yumi-ros2", "plot") from error
    return Figure(figsize=(width, height), layout="constrained")
