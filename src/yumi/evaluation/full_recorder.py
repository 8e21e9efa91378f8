"""The full recorder: every cycle of both arms, from start to end, into one file.

It follows the memory of the flight recorders, which holds ten seconds: a disk that hesitates loses nothing, and what is
lost all the same is counted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import Event as Flag
from threading import Thread

from yumi.control.flight_recorder import FlightRecorder
from yumi.control.requests import Event
from yumi.evaluation.recorded_messages import RecordedEvent
from yumi.evaluation.recording import RecordingWriter, recorded_event
from yumi.links.supervision import Failures
from yumi.robot.joints import Side

PERIOD = 0.02
"""How often the memories are read [s]: the less there is to write at once, the less others wait."""


class FullRecorder:
    """Writes one recording on a thread of its own, between start and close.

    Args:
        file: where to.
        epoch: time of day when the monotonic clock was 0 [s since 1970].
        recorders: the memory of each arm.
        say: told one sentence when it ends.

    Raises:
        MissingPrerequisite: the library is not installed.
        OSError: the file cannot be written.
    """

    def __init__(
        self, file: Path, epoch: float, recorders: Mapping[Side, FlightRecorder], say: Callable[[str], None]
    ) -> None:
        self._file = file
        self._writer = RecordingWriter(file, epoch)
        self._recorders = recorders
        self._say = say
        self._last = {side: recorder.newest for side, recorder in recorders.items()}
        self._written = self._lost = 0
        self._events: SimpleQueue[RecordedEvent] = SimpleQueue()
        self._failures = Failures()
        self._is_over = Flag()
        self._thread = Thread(target=self._run, name="full-recorder", daemon=True)

    def start(self) -> None:
        """Begin; the thread ends with the process if nobody closes it."""
        self._thread.start()

    def note(self, event: Event, now: float) -> None:
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
            self._say(f"The recording to {self._file} ended early: {type(error).__name__}: {error}.")
            return
        lost = f"; {self._lost} were lost, the disk is too slow" if self._lost else ""
        self._say(f"{self._written} cycles are in {self._file}{lost}.")

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
