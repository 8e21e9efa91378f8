"""A recording as a table: what stopped the motion on top, then the cycles around it, then where the time went."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import ceil, degrees

from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from yumi.control.flight_recorder import Frame
from yumi.evaluation.recorded_messages import STATIONS, RecordedEvent
from yumi.evaluation.recording import Recording
from yumi.robot.joints import CHAIN_AXES, Joints, Side


def recording_table(recording: Recording, side: Side, cycles: int) -> RenderableType:
    """The last ``cycles`` of one arm until the event, with everything that is known of them.

    Of the commands it shows the joint that is farthest ahead; the picture shows all.
    """
    frames = recording.frames.get(side, ())
    if not frames:
        return Text(f"No cycle of the {side.word} arm is recorded.")
    zero = recording.stop.time if recording.stop else frames[-1].time
    shown = [frame for frame in frames if frame.time <= zero][-cycles:]
    return Group(
        Text(_headline(recording.stop), style="bold red" if recording.stop else "bold"),
        Text(_summary(side, frames, is_complete=recording.is_complete)),
        _cycles(shown, zero),
        _stations(frames),
    )


def _headline(stop: RecordedEvent | None) -> str:
    return stop.sentence if stop else "Nothing stopped a motion; these are the last cycles."


def _summary(side: Side, frames: Sequence[Frame], *, is_complete: bool) -> str:
    span = frames[-1].time - frames[0].time
    gap = max((new.time - old.time for old, new in pairwise(frames)), default=0.0)
    cut = "" if is_complete else " The file was cut off."
    return (
        f"{side.word.capitalize()} arm: {len(frames)} cycles in {span:.2f} s, sessions {frames[0].session} to "
        f"{frames[-1].session}, longest gap between two datagrams {gap * 1e3:.1f} ms.{cut}"
    )


def _cycles(frames: Sequence[Frame], zero: float) -> Table:
    table = Table(title="Cycles: times from the event in ms, angles in °, replies in µs", title_justify="left")
    measured = f"measured, axes {' '.join(map(str, CHAIN_AXES))}"
    for name in ("cycle", "time", "dt", "follows", measured, "wanted ahead (axis)", "admitted ahead (axis)", "reply"):
        table.add_column(name, justify="right")
    for frame in frames:
        table.add_row(
            str(frame.number),
            f"{(frame.time - zero) * 1e3:.1f}",
            f"{frame.dt * 1e3:.2f}",
            "yes" if frame.is_running else "no",
            " ".join(f"{degrees(value):.1f}" for value in frame.position),
            "hold" if frame.wanted is None else _ahead(frame.wanted, frame.position),
            _ahead(frame.admitted, frame.position),
            f"{frame.stations.reply * 1e6:.0f}",
        )
    return table


def _stations(frames: Sequence[Frame]) -> Table:
    table = Table(title="Stations of a cycle in µs", title_justify="left")
    for name in ("station", "p50", "p99", "max"):
        table.add_column(name, justify="left" if name == "station" else "right")
    for name in (*STATIONS, "reply"):
        times = sorted(getattr(frame.stations, name) * 1e6 for frame in frames)
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
