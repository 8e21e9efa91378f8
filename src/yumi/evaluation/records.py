"""Everything the driver writes down: flight records, and the recording of a whole session when it was asked for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from yumi.control.flight_recorder import FlightRecorder
from yumi.control.requests import Event
from yumi.errors import SettingsError
from yumi.evaluation.flight_records import FlightRecords
from yumi.evaluation.full_recorder import FullRecorder
from yumi.robot.joints import Side


class Records:
    """Told of every event, it knows which files to write.

    Args:
        folder: where flight records go.
        keep: how many of them stay; the oldest ones make room.
        recorders: the memory of each arm.
        say: told one sentence for each file; on another thread.
    """

    def __init__(
        self, folder: Path, keep: int, recorders: Mapping[Side, FlightRecorder], say: Callable[[str], None]
    ) -> None:
        self._recorders = recorders
        self._say = say
        self._flights = FlightRecords(folder, keep, recorders, say)
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
            self._full = FullRecorder(file, epoch, self._recorders, self._say)
        except OSError as error:
            raise SettingsError(f"Cannot record to {file}: {error.strerror}.") from error
        self._full.start()

    def note(self, event: Event, now: float, time_of_day: float) -> None:
        """Write down what happened; waits for no disk.

        Args:
            event: what the fast line told.
            now: monotonic clock [s].
            time_of_day: at the same moment [s since 1970].
        """
        self._flights.note(event, now, time_of_day)
        if self._full:
            self._full.note(event, now)

    def close(self) -> None:
        """Wait until everything is written."""
        self._flights.close()
        if self._full:
            self._full.close()
