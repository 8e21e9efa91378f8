"""A recording as a picture: a panel a joint with measured, wanted and admitted positions, one for the stations."""

from __future__ import annotations

from collections.abc import Sequence
from math import degrees, nan
from pathlib import Path
from textwrap import fill
from typing import Any

from yumi.control.flight_recorder import Frame
from yumi.errors import CommandRefused, MissingPrerequisite
from yumi.evaluation.recorded_messages import STATIONS
from yumi.evaluation.recording import Recording
from yumi.robot.joints import CHAIN_AXES, Side

_GAP = 0.1
"""Where no cycle was recorded for so long, no line is drawn [s]."""

_LINES = (("reference", ":", "0.6"), ("admitted", "-", "C1"), ("wanted", "--", "C2"), ("position", "-", "C0"))


def draw_recording(recording: Recording, side: Side, file: Path) -> None:
    """Draw one arm's cycles over the time from the event and save the picture as ``file``.

    Raises:
        CommandRefused: no cycle of that arm is recorded.
        MissingPrerequisite: matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure  # noqa: PLC0415 - an extra; nothing else needs it
    except ImportError as error:
        raise MissingPrerequisite("Pictures need matplotlib; install yumi-ros2[plot].") from error
    frames = _with_gaps(recording.frames.get(side, ()))
    if not frames:
        raise CommandRefused(f"No cycle of the {side.word} arm is recorded; choose the other arm with --arm.")
    zero = recording.stop.time if recording.stop else recording.frames[side][-1].time
    times = [frame.time - zero for frame in frames]
    figure = Figure(figsize=(14.0, 8.0), layout="constrained")
    panels = figure.subplots(2, 4, sharex=True).flat
    for index, axis in enumerate(CHAIN_AXES):
        _draw_joint(panels[index], times, frames, index)
        panels[index].set_title(f"axis {axis} [°]")
    _draw_stations(panels[-1], times, frames)
    for panel in panels:
        panel.axvline(0.0, color="red", linewidth=0.8)
        panel.grid(alpha=0.3)
        panel.set_xlabel("time from the event [s]")
    figure.suptitle(fill(recording.stop.sentence if recording.stop else f"{side.word.capitalize()} arm", 140))
    panels[0].legend(loc="best", fontsize="small")
    figure.savefig(file, dpi=120)


def _with_gaps(frames: Sequence[Frame]) -> list[Frame | _Gap]:
    """The frames, with a gap after each one that nothing followed in time."""
    following: list[Frame | _Gap] = []
    for frame in frames:
        if following and frame.time - following[-1].time > _GAP:
            following.append(_Gap(following[-1].time))
        following.append(frame)
    return following


class _Gap:
    """Nothing was recorded from here on: every line breaks."""

    def __init__(self, time: float) -> None:
        self.time = time


def _draw_joint(panel: Any, times: Sequence[float], frames: Sequence[Frame | _Gap], index: int) -> None:
    for name, style, color in _LINES:
        values = [_angle(getattr(frame, name, None), index) for frame in frames]
        panel.plot(times, values, style, color=color, linewidth=1.0, label="measured" if name == "position" else name)


def _angle(positions: Sequence[float] | None, index: int) -> float:
    return nan if positions is None else degrees(positions[index])


def _draw_stations(panel: Any, times: Sequence[float], frames: Sequence[Frame | _Gap]) -> None:
    """Stacked, so that the upper edge is the whole cycle."""
    layers = [
        [0.0 if isinstance(frame, _Gap) else getattr(frame.stations, name) * 1e6 for frame in frames]
        for name in STATIONS
    ]
    panel.stackplot(times, *layers, labels=[name.replace("_", " ") for name in STATIONS], linewidth=0.0)
    panel.set_title("stations of a cycle [µs]")
    panel.legend(loc="upper left", fontsize="x-small", ncols=2)
