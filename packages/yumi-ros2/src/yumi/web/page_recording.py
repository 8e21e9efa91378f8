"""A recording for a page: cycles thinned out, grippers, states and events, in seconds from its beginning."""

from __future__ import annotations

from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

from abb_protocols.robot.joints import Joints, Side
from yumi.control.flight_recorder import RecordedCycle
from yumi.recording.message_types import EVENTS_TOPIC, STATE_TOPIC, RecordedEvent
from yumi.recording.reader import recorded_messages

MAX_SAMPLES = 6000
"""Of each arm; a longer recording is thinned out."""

_FIRST_PERIOD = 0.02  # [s]


def page_recording(file: Path) -> dict[str, Any]:
    """What the page shows of a recording; times in seconds from its beginning.

    It begins where the driver had connected to the robot: of the time before, there is nothing to show.

    Raises:
        ProtocolError: the file is not a recording, or has nothing to show.
        MissingPrerequisite: the library is not installed.
    """
    cycles = {f"{side.value}/cycle": (side, _Samples()) for side in Side}
    grippers: dict[str, list[dict[str, Any]]] = {f"{side.value}/gripper": [] for side in Side}
    events: list[RecordedEvent] = []
    states: list[dict[str, Any]] = []
    times: list[float] = []  # of all but states
    epoch, is_complete = 0.0, False
    for topic, log_time, value in recorded_messages(file):
        if topic is None:
            is_complete = True
            continue
        time = value["time"] if isinstance(value, Mapping) else value.time
        epoch = epoch or log_time * 1e-9 - time
        if topic == STATE_TOPIC:
            states.append(value)
            continue
        times = [min(times[0], time), max(times[1], time)] if times else [time, time]
        if topic in cycles:
            cycles[topic][1].add(value)
        elif topic in grippers:
            grippers[topic].append(value)
        elif topic == EVENTS_TOPIC:
            events.append(value)
    end = max([*times, *(each["time"] for each in states)])
    connected = (index for index, each in enumerate(states) if each.get("is_connected", True))
    states = states[next(connected, 0) :]
    start = min([*times, *(each["time"] for each in states)])
    for known in (states, *grippers.values()):  # what was known first is shown from the beginning
        if known:
            known[0] = {**known[0], "time": start}

    def rounded(values: Joints | None) -> list[float] | None:
        return None if values is None else [round(value, 5) for value in values]  # what is not a number becomes null

    return {
        "name": file.name,
        "date": datetime.fromtimestamp(epoch + start).strftime("%Y-%m-%d %H:%M"),  # of this machine's clock on the wall
        "is_complete": is_complete,
        "start": epoch + start,
        "duration": end - start,
        "arms": {
            side.word: {
                "time": [round(each.time - start, 4) for each in samples.kept],
                **{
                    name: [rounded(getattr(each, name)) for each in samples.kept]
                    for name in ("position", "velocity", "sent", "reference")
                },
                "is_running": [each.is_running for each in samples.kept],
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
                "time": each.time - start,
                "side": each.side and each.side.word,
                "sentence": each.sentence,
                "is_fault": each.is_fault,
            }
            for each in events
        ],
    }


class _Samples:
    """Cycles of one arm at equal intervals, which double when there are too many."""

    def __init__(self) -> None:
        self.kept: list[RecordedCycle] = []
        self._period, self._last = _FIRST_PERIOD, float("-inf")

    def add(self, frame: RecordedCycle) -> None:
        if frame.time - self._last < self._period - 1e-4:
            return
        self._last = frame.time
        self.kept.append(frame)
        if len(self.kept) > MAX_SAMPLES:
            self.kept = self.kept[::2]
            self._period *= 2.0
