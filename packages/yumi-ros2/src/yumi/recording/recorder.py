"""The recorder of the driver: a flight record when something stops a motion, and every cycle on request.

The control loop only reports events; this end reads the memory it shares (ten seconds of each arm) and writes the
files, on threads of its own, so that neither a cycle nor a reply waits for a disk.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from heapq import merge
from math import inf
from pathlib import Path
from threading import Event as Flag
from threading import Thread

import msgspec

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import SettingsError, YumiError
from abb_protocols.robot.joints import Pose, Side
from abb_runtime.clock import Clock
from abb_runtime.process.supervision import ThreadFailures
from yumi.control.flight_recorder import FlightRecorder, RecordedCycle
from yumi.control.loop_events import Event, is_fault
from yumi.control.shared_state import JointStates
from yumi.recording.message_types import RecordedEvent, recorded_event
from yumi.recording.reader import FLIGHT_RECORD_AFTER, FLIGHT_RECORD_BEFORE
from yumi.recording.writer import RecordingWriter


def _described(event: RecordedEvent, sentence: Future[Message]) -> RecordedEvent:
    """``event`` with what is said of it, as far as that is known by now."""
    return msgspec.structs.replace(event, sentence=str(sentence.result())) if sentence.done() else event


_CYCLES_PERIOD = 0.02
"""How often a full recording reads the memories [s]: the less there is to write at once, the less others wait."""

_SOURCE_PERIOD = 0.1
"""How often a full recording looks at grippers and the robot's state [s]."""

Source = Callable[[], object | None]
"""What is known now: a value class; None, or a YumiError, while nothing is."""


@dataclass(frozen=True, slots=True)
class Sources:
    """What a full recording looks at beside the cycles, ten times a second.

    Attributes:
        values: by topic: a value class, or None while nothing is known; recorded when it changes.
        joints: an arm as it was read from the controller last, for while EGM does not report it.
        tcp: the tool in use of an arm, in tool0.
    """

    values: Mapping[str, Source] = field(default_factory=dict)
    joints: Callable[[Side], JointStates | None] = lambda side: None
    tcp: Callable[[Side], Pose] | None = None


_Describe = Callable[[Event, Callable[[Message], None]], None]
"""Calls back with what is said of an event: at once, or on another thread when its cause is known."""


def _say_at_once(event: Event, then: Callable[[Message], None]) -> None:
    then(event.said)


_NAME = "flight_"


class Recorder:
    """Writes the files that an event, or a recording of the whole session, asks for.

    Args:
        folder: where flight records go; made when the first one is written.
        keep: how many of them stay; the oldest ones are deleted.
        recorders: the memory of each arm.
        report: called with one sentence for each file; on another thread.
        clock: of the events.
        describe: what is said of an event; where its cause is known only later, that is recorded then.
    """

    def __init__(
        self,
        folder: Path,
        keep: int,
        recorders: Mapping[Side, FlightRecorder],
        report: Callable[[str], None],
        clock: Clock,
        describe: _Describe = _say_at_once,
    ) -> None:
        self._describe = describe
        self._folder = folder
        self._keep = keep
        self._recorders = recorders
        self._report = report
        self._clock = clock
        self._failures = ThreadFailures()
        self._is_over = Flag()
        # What led to a stop is on the disk at once, whatever the records before are still waiting for.
        self._begins = ThreadPoolExecutor(1, thread_name_prefix="flight-records")
        self._follows = ThreadPoolExecutor(1, thread_name_prefix="flight-records-after")
        self._full: FullRecorder | None = None

    def record_all(self, file: Path, epoch: float, sources: Sources | None = None) -> None:
        """Write every cycle from now on to ``file``, and what ``sources`` show.

        Args:
            file: a new one, or one to be replaced.
            epoch: time of day when the monotonic clock was 0 [s since 1970].
            sources: what to look at beside the cycles.

        Raises:
            SettingsError: the file cannot be written.
            MissingPrerequisite: the library is not installed.
        """
        try:
            self._full = FullRecorder(file, epoch, self._recorders, self._report, self._clock, sources)
        except OSError as error:
            raise SettingsError(message("recording_not_writable", file=str(file), reason=error.strerror)) from error
        self._full.start()

    def on_event(self, event: Event, now: float, time_of_day: float) -> None:
        """Write down what happened, and what follows for :data:`FLIGHT_RECORD_AFTER`; does not wait for a disk.

        Args:
            event: of the control loop.
            now: monotonic clock [s].
            time_of_day: at the same moment [s since 1970].
        """
        sentence: Future[Message] = Future()
        if is_fault(event):
            memory = self._recorders[event.side].copy()
            try:
                self._begins.submit(self._write, recorded_event(event, now), sentence, event.side, memory, time_of_day)
            except RuntimeError as error:  # the operating system permits no thread
                self._report(f"The flight record of the {event.side.word} arm could not be begun: {error}.")
        if self._full:
            self._full.on_event(event, now, sentence)
        self._describe(event, sentence.set_result)

    def close(self) -> None:
        """Wait until everything is written; a record that is not at its end yet ends now."""
        self._is_over.set()
        self._begins.shutdown()  # each begun record has asked for its rest by then
        self._follows.shutdown()
        if self._full:
            self._full.close()

    def _write(
        self, event: RecordedEvent, sentence: Future[Message], side: Side, memory: FlightRecorder, time_of_day: float
    ) -> None:
        """Write what led to the event; this process may end meanwhile."""
        moment = datetime.fromtimestamp(time_of_day)
        name = f"{_NAME}{moment:%Y-%m-%d_%H-%M-%S}-{moment.microsecond // 1000:03}_{side.word}.mcap"
        file = self._folder / name

        def write(target: Path, frames: Sequence[RecordedCycle], event: RecordedEvent) -> None:
            with RecordingWriter(target, time_of_day - event.time) as writer:
                for frame in frames:
                    writer.add_frame(side, frame)
                writer.add_event(event)

        try:
            # The cycles that led to the event; not those of an earlier session.
            frames = [frame for frame in memory.frames() if frame.time >= event.time - FLIGHT_RECORD_BEFORE]
            write(file, frames, event)
            self._make_room()
        except (YumiError, OSError) as error:
            self._report(f"The flight record could not be written to {file}: {error}")
            return
        except Exception as error:  # the thread pool would keep it to itself
            self._failures.note(f"Writing the flight record {file}", error)
            return
        try:
            self._follows.submit(self._go_on, event, sentence, side, memory.newest, file, frames, write)
        except RuntimeError as error:  # the operating system permits no thread
            self._report_without_rest(file, error)

    def _go_on(
        self,
        event: RecordedEvent,
        sentence: Future[Message],
        side: Side,
        newest: int,
        file: Path,
        frames: Sequence[RecordedCycle],
        write: Callable[[Path, Sequence[RecordedCycle], RecordedEvent], None],
    ) -> None:
        """Replace a record by one that also has what followed its event, and what has become known of its cause."""
        whole = file.with_suffix(".part")
        after: list[RecordedCycle] = []
        try:
            self._is_over.wait(event.time + FLIGHT_RECORD_AFTER - self._clock.now())
            after += (
                each for each in self._recorders[side].since(newest) if each.time <= event.time + FLIGHT_RECORD_AFTER
            )
            known = _described(event, sentence)
            if after or known != event:
                write(whole, [*frames, *after], known)
                whole.replace(file)
            self._make_room()
        except Exception as error:
            with suppress(OSError):  # its folder may be gone
                whole.unlink(missing_ok=True)
            if not isinstance(error, YumiError | OSError):  # the thread pool would keep it to itself
                self._failures.note(f"Writing the flight record {file}", error)
            self._report_without_rest(file, error)
            return
        seconds = frames[-1].time - frames[0].time if frames else 0.0
        follows = f", and {max(0.0, after[-1].time - event.time):.1f} s after the stop," if after else ""
        self._report(f"The last {seconds:.1f} s of the {side.word} arm{follows} are in {file}: yumi record show {file}")

    def _report_without_rest(self, file: Path, error: Exception) -> None:
        self._report(f"What followed the stop could not be written: {error}. What led to it is in {file}.")

    def _make_room(self) -> None:
        for oldest in sorted(self._folder.glob(f"{_NAME}*.mcap"))[: -self._keep]:
            oldest.unlink(missing_ok=True)


class FullRecorder:
    """Writes every cycle of both arms to one file, on a thread of its own, between start and close.

    It follows the memories, which hold ten seconds: a disk that hesitates loses nothing, and what is lost all the same
    is counted.

    Args:
        file: where to.
        epoch: time of day when the monotonic clock was 0 [s since 1970].
        recorders: the memory of each arm.
        report: called with one sentence when it ends.
        clock: gives the monotonic time; needed with sources.
        sources: as in :meth:`Recorder.record_all`.

    Raises:
        MissingPrerequisite: the library is not installed.
        OSError: the file cannot be written.
    """

    def __init__(
        self,
        file: Path,
        epoch: float,
        recorders: Mapping[Side, FlightRecorder],
        report: Callable[[str], None],
        clock: Clock | None = None,
        sources: Sources | None = None,
    ) -> None:
        self._file = file
        self._clock = clock
        self._sources = sources or Sources()
        self._seen: dict[str, object] = {}
        self._arms_seen: dict[Side, float] = {}  # when each arm was measured last, on the monotonic clock [s]
        self._tools: Mapping[Side, Pose] = {}
        self._looked_at = -inf
        self._writer = RecordingWriter(file, epoch)
        self._recorders = recorders
        self._report = report
        self._last = {side: recorder.newest for side, recorder in recorders.items()}
        self._written = self._lost = 0
        self._events: deque[tuple[RecordedEvent, Future[Message]]] = deque()
        self._failures = ThreadFailures()
        self._is_over = Flag()
        self._thread = Thread(target=self._run, name="full-recorder", daemon=True)

    def start(self) -> None:
        """Begin; without a call of close the thread ends with the process."""
        self._thread.start()

    def on_event(self, event: Event, now: float, sentence: Future[Message]) -> None:
        """Record ``event``, which happened at ``now`` on the monotonic clock [s], once its sentence is known."""
        self._events.append((recorded_event(event, now), sentence))

    def close(self) -> None:
        """Write what is left and close the file."""
        self._is_over.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            while not self._is_over.wait(_CYCLES_PERIOD):
                self._follow()
            self._follow()
            self._writer.close()
        except Exception as error:  # not begun again: what the file holds after that is not known
            self._writer.abandon()
            self._failures.note(f"Recording to {self._file}", error)
            self._report(f"The recording to {self._file} ended early: {type(error).__name__}: {error}.")
            return
        lost = f"; {self._lost} were lost, the disk is too slow" if self._lost else ""
        self._report(f"{self._written} cycles are in {self._file}{lost}.")

    def _follow(self) -> None:
        # Both arms in the order of their cycles: the whole robot is recorded as it was at one time.
        for side, frame in merge(*map(self._new_cycles, self._recorders), key=lambda each: each[1].time):
            self._writer.add_frame(side, frame)
            self._arms_seen[side] = frame.time
            self._written += 1
        while self._events and (self._events[0][1].done() or self._is_over.is_set()):  # in the order they happened
            self._writer.add_event(_described(*self._events.popleft()))
        if self._clock is None or self._clock.now() - self._looked_at < _SOURCE_PERIOD:
            return
        self._looked_at = now = self._clock.now()
        for topic, source in self._sources.values.items():
            try:
                value = source()
            except YumiError:
                continue  # nothing is known: the controller does not answer, or has no gripper there
            if value is not None and value != self._seen.get(topic):
                self._writer.add_value(topic, now, value)
                self._seen[topic] = value
        for side in Side:
            state = self._sources.joints(side)
            if state is not None and state.time > self._arms_seen.get(side, -inf):
                self._writer.add_joints(side, state)
                self._arms_seen[side] = state.time
        tools = {side: self._sources.tcp(side) for side in Side} if self._sources.tcp else {}
        if tools != self._tools:
            self._writer.add_tools(now, tools)
            self._tools = tools

    def _new_cycles(self, side: Side) -> Iterator[tuple[Side, RecordedCycle]]:
        for frame in self._recorders[side].since(self._last[side]):
            self._lost += frame.number - self._last[side] - 1
            self._last[side] = frame.number
            yield side, frame
