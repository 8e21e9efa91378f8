"""Recordings for the eye: a table of the cycles around an event, a picture of them, and a picture of joint paths."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import ceil, degrees, nan
from pathlib import Path
from textwrap import fill
from typing import Any

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from yumi.control.flight_recorder import Frame
from yumi.errors import CommandRefused, MissingPrerequisite
from yumi.recording.mcap import STAGES, Recording
from yumi.robot.joints import CHAIN_AXES, Joints, Side


def recording_table(recording: Recording, side: Side, cycles: int) -> RenderableType:
    """The last ``cycles`` of one arm until the event, with everything that is known of them.

    Of the commands it shows the joint that is farthest ahead; the picture shows all.
    """
    frames = recording.frames.get(side, ())
    if not frames:
        return Text(f"No cycle of the {side.word} arm is recorded.")
    stop = recording.stop
    zero = stop.time if stop else frames[-1].time
    headline = stop.sentence if stop else "Nothing stopped a motion; these are the last cycles."
    gap = max((new.time - old.time for old, new in pairwise(frames)), default=0.0)
    summary = (
        f"{side.word.capitalize()} arm: {len(frames)} cycles in {frames[-1].time - frames[0].time:.2f} s, sessions "
        f"{frames[0].session} to {frames[-1].session}, longest gap between two datagrams {gap * 1e3:.1f} ms."
        + ("" if recording.is_complete else " The file was cut off.")
    )
    shown = [frame for frame in frames if frame.time <= zero][-cycles:]
    style = "bold red" if stop else "bold"
    return Group(Text(headline, style=style), Text(summary), _cycles(shown, zero), _stages(frames))


def _cycles(frames: Sequence[Frame], zero: float) -> Table:
    table = Table(title="Cycles: times from the event in ms, angles in °, replies in µs", title_justify="left")
    measured = f"measured, axes {' '.join(map(str, CHAIN_AXES))}"
    for name in ("cycle", "time", "dt", "follows", measured, "desired ahead (axis)", "sent ahead (axis)", "reply"):
        table.add_column(name, justify="right")
    for frame in frames:
        table.add_row(
            str(frame.number),
            f"{(frame.time - zero) * 1e3:.1f}",
            f"{frame.dt * 1e3:.2f}",
            "yes" if frame.is_running else "no",
            " ".join(f"{degrees(value):.1f}" for value in frame.position),
            "hold" if frame.desired is None else _ahead(frame.desired, frame.position),
            _ahead(frame.sent, frame.position),
            f"{frame.stages.reply * 1e6:.0f}",
        )
    return table


def _stages(frames: Sequence[Frame]) -> Table:
    table = Table(title="Stations of a cycle in µs", title_justify="left")
    for name in ("stage", "p50", "p99", "max"):
        table.add_column(name, justify="left" if name == "stage" else "right")
    for name in (*STAGES, "reply"):
        times = sorted(getattr(frame.stages, name) * 1e6 for frame in frames)
        values = (quantile(times, 0.5), quantile(times, 0.99), times[-1])
        table.add_row(name.replace("_", " "), *(f"{value:.1f}" for value in values))
    return table


def quantile(ascending: Sequence[float], share: float) -> float:
    """The smallest of ``ascending`` values that ``share`` of them do not exceed."""
    return ascending[max(0, ceil(share * len(ascending)) - 1)]


def _ahead(command: Joints, position: Joints) -> str:
    """How far a command is ahead of the measured position, where it is farthest, with ABB's axis number [°]."""
    distances = {axis: value - now for axis, value, now in zip(CHAIN_AXES, command, position, strict=True)}
    axis = max(distances, key=lambda each: abs(distances[each]))
    return f"{degrees(distances[axis]):+.2f} ({axis})"


_GAP = 0.1
"""Where no cycle was recorded for so long, no line is drawn [s]."""

_LINES = (("reference", ":", "0.6"), ("sent", "-", "C1"), ("desired", "--", "C2"), ("position", "-", "C0"))

JointPath = Sequence[tuple[float, Joints]]
"""Times [s] and positions [rad] of one arm."""


def draw_recording(recording: Recording, side: Side, file: Path) -> None:
    """Draw one arm's cycles over the time from the event and save the picture as ``file``.

    Raises:
        CommandRefused: no cycle of that arm is recorded.
        MissingPrerequisite: matplotlib is not installed.
    """
    frames = recording.frames.get(side, ())
    if not frames:
        raise CommandRefused(f"No cycle of the {side.word} arm is recorded; choose the other arm with --arm.")
    figure = _figure(14.0, 8.0)
    panels = figure.subplots(2, 4, sharex=True).flat
    # None stands where lines break: after a cycle that no other followed in time.
    rows: list[Frame | None] = [frames[0]]
    times = [frames[0].time]
    for before, frame in pairwise(frames):
        if frame.time - before.time > _GAP:
            rows.append(None)
            times.append(before.time)
        rows.append(frame)
        times.append(frame.time)
    zero = recording.stop.time if recording.stop else frames[-1].time
    times = [time - zero for time in times]
    for index, axis in enumerate(CHAIN_AXES):
        for name, style, color in _LINES:
            vectors = [getattr(frame, name, None) for frame in rows]
            values = [nan if vector is None else degrees(vector[index]) for vector in vectors]
            label = "measured" if name == "position" else name
            panels[index].plot(times, values, style, color=color, linewidth=1.0, label=label)
        panels[index].set_title(f"axis {axis} [°]")

    # Stacked, so that the upper edge is the whole cycle.
    layers = [[0.0 if frame is None else getattr(frame.stages, name) * 1e6 for frame in rows] for name in STAGES]
    panels[-1].stackplot(times, *layers, labels=[name.replace("_", " ") for name in STAGES], linewidth=0.0)
    panels[-1].set_title("stages of a cycle [µs]")
    panels[-1].legend(loc="upper left", fontsize="x-small", ncols=2)
    for panel in panels:
        panel.axvline(0.0, color="red", linewidth=0.8)
        panel.grid(alpha=0.3)
        panel.set_xlabel("time from the event [s]")
    figure.suptitle(fill(recording.stop.sentence if recording.stop else f"{side.word.capitalize()} arm", 140))
    panels[0].legend(loc="best", fontsize="small")
    figure.savefig(file, dpi=120)


def draw_joint_paths(paths: Mapping[Side, JointPath], file: Path) -> None:
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
        raise MissingPrerequisite("Pictures need matplotlib; install yumi-ros2[plot].") from error
    return Figure(figsize=(width, height), layout="constrained")
