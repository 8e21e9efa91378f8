"""What the driver writes down: a flight record when something stops a motion, and every cycle when that was requested.

The control loop only reports events; this end reads the memory it shares (ten seconds of each arm) and writes the
files, on threads of its own, so that neither a cycle nor a reply waits for a disk.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event as Flag
from threading import Thread

from yumi.control.events import Event, is_fault
from yumi.control.flight_recorder import FlightRecorder
from yumi.errors import SettingsError, YumiError
from yumi.process.supervision import Failures
from yumi.recording.mcap import BEFORE, RecordedEvent, RecordingWriter, recorded_event, write_flight_record
from yumi.robot.joints import Side

PERIOD = 0.02
"""How often a full recording reads the memories [s]: the less there is to write at once, the less others wait."""

_NAME = "flight_"


class Recorder:
    """Writes the files that an event, or a recording of the whole session, asks for.

    Args:
        folder: where flight records go; made when the first one is written.
        keep: how many of them stay; the oldest ones are deleted.
        recorders: the memory of each arm.
        report: called with one sentence for each file; on another thread.
    """

    def __init__(
        self, folder: Path, keep: int, recorders: Mapping[Side, FlightRecorder], report: Callable[[str], None]
    ) -> None:
        self._folder = folder
        self._keep = keep
        self._recorders = recorders
        self._report = report
        self._failures = Failures()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="flight-records")
        self._full: FullRecorder | None = None

    def record_all(self, file: Path, epoch: float) -> None:
        """Write every cycle from now on to ``file``.

        Args:
            file: a new one, or one to be replaced.
            epoch: time of day when the monotonic clock was 0 [s since 1970].

        Raises:
            SettingsError: the file cannot be written.
            MissingPrerequisite: the library is not installed.
        """
        try:
            self._full = FullRecorder(file, epoch, self._recorders, self._report)
        except OSError as error:
            raise SettingsError(f"Cannot record to {file}: {error.strerror}.") from error
        self._full.start()

    def on_event(self, event: Event, now: float, time_of_day: float) -> None:
        """Write down what happened; does not wait for a disk.

        Args:
            event: of the control loop.
            now: monotonic clock [s].
            time_of_day: at the same moment [s since 1970].
        """
        if is_fault(event):
            memory = self._recorders[event.side].copy()
            try:
                self._thread.submit(self._write, recorded_event(event, now), event.side, memory, time_of_day)
            except RuntimeError as error:  # the operating system permits no thread
                self._report(f"The flight record of the {event.side.word} arm could not be begun: {error}.")
        if self._full:
            self._full.on_event(event, now)

    def close(self) -> None:
        """Wait until everything is written."""
        self._thread.shutdown()
        if self._full:
            self._full.close()

    def _write(self, event: RecordedEvent, side: Side, memory: FlightRecorder, time_of_day: float) -> None:
        moment = datetime.fromtimestamp(time_of_day)
        name = f"{_NAME}{moment:%Y-%m-%d_%H-%M-%S}-{moment.microsecond // 1000:03}_{side.word}.mcap"
        file = self._folder / name
        # The cycles that led to the event; not those of an earlier session.
        frames = tuple(frame for frame in memory.frames() if frame.time >= event.time - BEFORE)
        try:
            write_flight_record(file, time_of_day - event.time, event, {side: frames})
            for oldest in sorted(self._folder.glob(f"{_NAME}*.mcap"))[: -self._keep]:
                oldest.unlink()
        except (YumiError, OSError) as error:
            self._report(f"The flight record could not be written to {file}: {error}")
            return
        except Exception as error:  # the thread pool would keep it to itself
            self._failures.note(f"Writing the flight record {file}", error)
            return
        seconds = frames[-1].time - frames[0].time if frames else 0.0
        self._report(f"The last {seconds:.1f} s of the {side.word} arm are in {file}: yumi record show {file}")


class FullRecorder:
    """Writes every cycle of both arms to one file, on a thread of its own, between start and close.

    It follows the memories, which hold ten seconds: a disk that hesitates loses nothing, and what is lost all the same
    is counted.

    Args:
        file: where to.
        epoch: time of day when the monotonic clock was 0 [s since 1970].
        recorders: the memory of each arm.
        report: called with one sentence when it ends.

    Raises:
        MissingPrerequisite: the library is not installed.
        OSError: the file cannot be written.
    """

    def __init__(
        self, file: Path, epoch: float, recorders: Mapping[Side, FlightRecorder], report: Callable[[str], None]
    ) -> None:
        self._file = file
        self._writer = RecordingWriter(file, epoch)
        self._recorders = recorders
        self._report = report
        self._last = {side: recorder.newest for side, recorder in recorders.items()}
        self._written = self._lost = 0
        self._events: SimpleQueue[RecordedEvent] = SimpleQueue()
        self._failures = Failures()
        self._is_over = Flag()
        self._thread = Thread(target=self._run, name="full-recorder", daemon=True)

    def start(self) -> None:
        """Begin; without a call of close the thread ends with the process."""
        self._thread.start()

    def on_event(self, event: Event, now: float) -> None:
        """Record ``event``, which happened at ``now`` on the monotonic clock [s]."""
        self._events.put(recorded_event(event, now))

    def close(self) -> None:
        """Write what is left and close the file."""
        self._is_over.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            while not self._is_over.wait(PERIOD):
                self._follow()
            self._follow()
            self._writer.close()
        except Exception as error:  # not begun again: what the file holds after that is not known
            self._failures.note(f"Recording to {self._file}", error)
            self._report(f"The recording to {self._file} ended early: {type(error).__name__}: {error}.")
            return
        lost = f"; {self._lost} were lost, the disk is too slow" if self._lost else ""
        self._report(f"{self._written} cycles are in {self._file}{lost}.")

    def _follow(self) -> None:
        for side, recorder in self._recorders.items():
            for frame in recorder.since(self._last[side]):
                self._writer.add_frame(side, frame)
                self._lost += frame.number - self._last[side] - 1
                self._written += 1
                self._last[side] = frame.number
        while True:
            try:
                self._writer.add_event(self._events.get_nowait())
            except Empty:
                return
