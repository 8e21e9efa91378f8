"""A recording for the page: its motions in samples that a browser can hold, and its events in full."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from yumi.recording.mcap import EVENTS, STATE, recorded_messages
from yumi.robot.joints import Side

MAX_SAMPLES = 6000
"""Of each arm; a longer recording is thinned out."""

_FIRST_PERIOD = 0.02  # [s]


class _Samples:
    """Cycles of one arm at equal intervals, which double when there are too many."""

    def __init__(self) -> None:
        self.kept: list[dict[str, Any]] = []
        self._period, self._last = _FIRST_PERIOD, float("-inf")

    def add(self, message: dict[str, Any]) -> None:
        if message["time"] - self._last < self._period - 1e-4:
            return
        self._last = message["time"]
        self.kept.append(message)
        if len(self.kept) > MAX_SAMPLES:
            self.kept = self.kept[::2]
            self._period *= 2.0


def page_recording(file: Path) -> dict[str, Any]:
    """What the page shows of a recording; times in seconds from its beginning.

    Raises:
        ProtocolError: the file is not a recording, or has nothing to show.
        MissingPrerequisite: the library is not installed.
    """
    cycles = {f"{side.value}/cycle": (side, _Samples()) for side in Side}
    grippers: dict[str, list[dict[str, Any]]] = {f"{side.value}/gripper": [] for side in Side}
    events: list[dict[str, Any]] = []
    states: list[dict[str, Any]] = []
    times: list[float] = []
    epoch, is_complete = 0.0, False
    for topic, log_time, message in recorded_messages(file):
        if topic is None:
            is_complete = True
            continue
        time = float(message["time"])
        epoch = epoch or log_time * 1e-9 - time
        times = [min(times[0], time), max(times[1], time)] if times else [time, time]
        if topic in cycles:
            cycles[topic][1].add(message)
        elif topic in grippers:
            grippers[topic].append(message)
        elif topic == EVENTS:
            events.append(message)
        elif topic == STATE:
            states.append(message)
    start, end = times or (0.0, 0.0)

    def rounded(values: list[float | None] | None) -> list[float | None] | None:
        return None if values is None else [None if value is None else round(value, 5) for value in values]

    return {
        "name": file.name,
        "is_complete": is_complete,
        "start": epoch + start,
        "duration": end - start,
        "arms": {
            side.word: {
                "time": [round(each["time"] - start, 4) for each in samples.kept],
                **{
                    name: [rounded(each[name]) for each in samples.kept]
                    for name in ("position", "velocity", "sent", "reference")
                },
                "is_running": [each["is_running"] for each in samples.kept],
            }
            for side, samples in cycles.values()
        },
        "grippers": {
            side.word: [{**each, "time": each["time"] - start} for each in grippers[f"{side.value}/gripper"]]
            for side in Side
        },
        "states": [{**each, "time": each["time"] - start} for each in states],
        "events": [
            {
                "time": each["time"] - start,
                "side": None if each["side"] is None else Side(each["side"]).word,
                "sentence": each["message"],
                "is_fault": each["is_fault"],
            }
            for each in events
        ],
    }
