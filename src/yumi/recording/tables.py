"""Recordings as tables: rows for CSV, Parquet and pandas' DataFrame."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from yumi.errors import CommandRefused, MissingPrerequisite
from yumi.recording.mcap import EVENTS, STAGES, STATE, frame_from_message, recorded_messages
from yumi.robot.joints import CHAIN_AXES, Side

if TYPE_CHECKING:
    import pandas as pd

What = Literal["cycles", "events", "grippers", "state"]

TABLES: tuple[What, ...] = ("cycles", "events", "grippers", "state")
"""The tables of a recording."""

_MISSING = "{} needs pandas and pyarrow; install yumi-ros2[data]. CSV needs neither: yumi record export FILE FILE.csv"
_VECTORS = ("position", "velocity", "planned", "desired", "sent", "sent_velocity", "reference")


def rows(file: Path, what: What = "cycles") -> Iterator[Mapping[str, Any]]:
    """The rows of a table of a recording, oldest first, one after another.

    Every row has ``time`` [s since the recording's first message] and ``timestamp_ns`` [ns since 1970]; all but
    ``state`` have ``arm``: ``right``, ``left``, or empty where it concerns both.

    ============ ====================================================================================================
    table        columns beside them
    ============ ====================================================================================================
    ``cycles``   number, dt [s], session, is_running; position_1 … position_6 [rad], velocity_… [rad/s], planned_…,
                 desired_…, sent_…, sent_velocity_…, reference_… by ABB's axis number in chain order (1, 2, 7, 3, 4, 5,
                 6), not a number where there was none; stage_… [s]
    ``events``   kind, message, is_fault
    ``grippers`` state, error, is_calibrated, position [m], speed [m/s], force [N], cups…
    ``state``    mode, controller_state (motors), execution (RAPID), machines…, egm…, speed_scale, reason, cause, stop…
    ============ ====================================================================================================

    Args:
        file: what ``yumi up --record`` or the flight recorder wrote.
        what: which table.

    Raises:
        CommandRefused: there is no such table.
        ProtocolError: the file is not a recording.
        MissingPrerequisite: mcap is not installed.
    """
    if what not in TABLES:
        raise CommandRefused(f"A recording has no table {what!r}; it has: {', '.join(TABLES)}.")
    topics = {EVENTS, STATE} & {what} or {f"{side.value}/{what.removesuffix('s')}" for side in Side}
    begin: int | None = None
    for topic, nanoseconds, message in recorded_messages(file):
        if topic is None:
            return
        begin = nanoseconds if begin is None else begin
        if topic not in topics:
            continue
        word = message["side"] if what == "events" else topic.partition("/")[0]
        arm = next((side.word for side in Side if side.value == word), "")
        row: dict[str, Any] = {"time": (nanoseconds - begin) / 1e9, "timestamp_ns": nanoseconds}
        if what != "state":
            row["arm"] = arm
        if what == "cycles":
            frame = frame_from_message(message)
            row |= {"number": frame.number, "dt": frame.dt, "session": frame.session, "is_running": frame.is_running}
            for name in _VECTORS:
                vector = getattr(frame, name) or (nan,) * len(CHAIN_AXES)
                row |= {f"{name}_{axis}": value for axis, value in zip(CHAIN_AXES, vector, strict=True)}
            row |= {f"stage_{name}": getattr(frame.stages, name) for name in STAGES}
        elif what == "events":
            row |= {name: message[name] for name in ("kind", "message", "is_fault")}
        else:
            row |= _flat(message)
        yield row


def read_recording(file: Path | str, what: What = "cycles") -> pd.DataFrame:
    """A table of a recording as a DataFrame, indexed by the time of day (UTC).

    ::

        cycles = yumi.read_recording("session.mcap")
        right = cycles[cycles.arm == "right"]
        (right.reference_1 - right.position_1).plot()
        yumi.read_recording("session.mcap", "events")

    Args:
        file: what ``yumi up --record`` or the flight recorder wrote.
        what: ``cycles``, ``events``, ``grippers`` or ``state``; the columns and their units are those of :func:`rows`.

    Raises:
        MissingPrerequisite: pandas or mcap is not installed.
        CommandRefused: there is no such table.
        ProtocolError: the file is not a recording.
        FileNotFoundError: there is no such file.
    """
    try:
        import pandas  # noqa: PLC0415 - an extra; nothing else needs it
    except ImportError as error:
        raise MissingPrerequisite(_MISSING.format("A DataFrame")) from error
    columns: dict[str, list[Any]] = {}
    for count, row in enumerate(rows(Path(file), what)):
        for name, value in row.items():
            values = columns.setdefault(name, [])
            values.extend([None] * (count - len(values)))  # rows before had nothing of that name
            values.append(value)
    longest = max(map(len, columns.values()), default=0)
    for values in columns.values():
        values.extend([None] * (longest - len(values)))
    table = pandas.DataFrame(columns)
    if columns:
        table.index = pandas.DatetimeIndex(pandas.to_datetime(table.pop("timestamp_ns"), utc=True), name="timestamp")
    return table


def export(file: Path, output: Path, what: What = "cycles") -> int:
    """Write a table of a recording as ``output``, whose ending says how: ``.csv`` or ``.parquet``; returns its rows.

    Raises:
        CommandRefused: another ending, or the recording has no row of that table; nothing is written.
        MissingPrerequisite: a library for Parquet or MCAP is not installed.
        ProtocolError: the file is not a recording.
        OSError: the output cannot be written.
    """
    if output.suffix not in {".csv", ".parquet"}:
        raise CommandRefused(f"{output} ends in {output.suffix!r}; give a file that ends in .csv or .parquet.")
    first = next(iter(rows(file, what)), None)
    if first is None:
        raise CommandRefused(f"{file} has no {what}; yumi up --record writes all tables, a flight record has cycles.")
    output.parent.mkdir(parents=True, exist_ok=True)
    if output.suffix == ".parquet":
        table = read_recording(file, what)
        try:
            table.to_parquet(output)
        except ImportError as error:
            raise MissingPrerequisite(_MISSING.format("Parquet")) from error
        return len(table)
    count = 0
    with output.open("w", encoding="utf-8", newline="") as stream:
        # Of a state, later rows may have more to say than the first one: all of them are looked at before.
        names = (
            dict.fromkeys(name for row in rows(file, what) for name in row) if what in {"grippers", "state"} else first
        )
        writer = csv.DictWriter(stream, names)
        writer.writeheader()
        for row in rows(file, what):
            writer.writerow(row)
            count += 1
    return count


def _flat(message: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested objects as columns ``outer.inner``; the monotonic time, which says nothing outside, is left out."""
    found: dict[str, Any] = {}
    for name, value in message.items():
        if isinstance(value, Mapping):
            found |= _flat(value, f"{prefix}{name}.")
        elif prefix or name != "time":
            found[f"{prefix}{name}"] = ", ".join(map(str, value)) if isinstance(value, list) else value
    return found
