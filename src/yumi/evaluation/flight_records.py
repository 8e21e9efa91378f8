"""Flight records: what the flight recorder remembers, written out when something stops a motion.

The fast line only tells what happened; this end reads the memory it shares and writes the file, on a thread of its
own, so that neither a cycle nor an answer waits for a disk.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from pathlib import Path

from yumi.control.flight_recorder import FlightRecorder, Frame
from yumi.control.requests import Event, is_fault
from yumi.errors import YumiError
from yumi.evaluation.recorded_messages import RecordedEvent
from yumi.evaluation.recording import BEFORE, recorded_event, write_flight_record
from yumi.links.supervision import Failures
from yumi.robot.joints import Side

_NAME = "flight_"


class FlightRecords:
    """A folder of flight records.

    Args:
        folder: where they go; made when the first one is written.
        keep: how many stay; the oldest ones make room.
        recorders: the memory of each arm.
        say: told one sentence for each record.
    """

    def __init__(
        self, folder: Path, keep: int, recorders: Mapping[Side, FlightRecorder], say: Callable[[str], None]
    ) -> None:
        self._folder = folder
        self._keep = keep
        self._recorders = recorders
        self._say = say
        self._failures = Failures()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="flight-records")

    def note(self, event: Event, now: float, time_of_day: float) -> None:
        """Write a record when ``event`` stopped a motion.

        Args:
            event: what the fast line told.
            now: monotonic clock [s].
            time_of_day: at the same moment [s since 1970].
        """
        if is_fault(event):
            memory = self._recorders[event.side].copy()
            try:
                self._thread.submit(self._write, recorded_event(event, now), event.side, memory, time_of_day)
            except RuntimeError as error:  # the operating system permits no thread
                self._say(f"The flight record of the {event.side.word} arm could not be begun: {error}.")

    def close(self) -> None:
        """Wait until everything is written."""
        self._thread.shutdown()

    def _write(self, event: RecordedEvent, side: Side, memory: FlightRecorder, time_of_day: float) -> None:
        file, frames = self._folder / _file_name(side, time_of_day), _recent(memory, event.time)
        try:
            write_flight_record(file, time_of_day - event.time, event, {side: frames})
            self._make_room()
        except (YumiError, OSError) as error:
            self._say(f"The flight record could not be written to {file}: {error}")
            return
        except Exception as error:  # the pool would keep it to itself
            self._failures.note(f"Writing the flight record {file}", error)
            return
        seconds = frames[-1].time - frames[0].time if frames else 0.0
        self._say(f"The last {seconds:.1f} s of the {side.word} arm are in {file}: yumi record show {file}")

    def _make_room(self) -> None:
        for file in sorted(self._folder.glob(f"{_NAME}*.mcap"))[: -self._keep]:
            file.unlink()


def _recent(memory: FlightRecorder, now: float) -> tuple[Frame, ...]:
    """The cycles that led to an event; not those of an earlier session."""
    return tuple(frame for frame in memory.frames() if frame.time >= now - BEFORE)


def _file_name(side: Side, time_of_day: float) -> str:
    moment = datetime.fromtimestamp(time_of_day)
    return f"{_NAME}{moment:%Y-%m-%d_%H-%M-%S}-{moment.microsecond // 1000:03}_{side.word}.mcap"
