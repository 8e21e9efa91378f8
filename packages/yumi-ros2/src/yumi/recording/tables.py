"""Recordings as tables: for CSV, Parquet and pandas' DataFrame; and for the eye, around an event."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from math import ceil, degrees, nan
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, missing_extra
from abb_protocols.robot.joints import CHAIN_AXES, Joints, Side
from yumi.control.flight_recorder import RecordedCycle
from yumi.recording.message_types import CYCLE_STAGES, CYCLE_VECTORS, EVENTS_TOPIC, STATE_TOPIC
from yumi.recording.reader import Recording, recorded_messages

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import RenderableType
    from rich.table import Table

TableName = Literal["cycles", "events", "grippers", "state"]

_TABLES: tuple[TableName, ...] = get_args(TableName)
"""The tables of a recording."""


def rows(file: Path, what: TableName = "cycles") -> Iterator[Mapping[str, Any]]:
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
    ``state``    mode, controller_state (motors), execution (RAPID), machines…, egm…, speed_scale, reasons, causes…
    ============ ====================================================================================================

    Args:
        file: what ``yumi up --record`` or the flight recorder wrote.
        what: which table.

    Raises:
        CommandRefused: there is no such table.
        ProtocolError: the file is not a recording, or nothing is recorded in it.
        MissingPrerequisite: mcap is not installed.
    """
    if what not in _TABLES:
        raise CommandRefused(message("recording_without_table", table=what, known=_TABLES))
    topics = {EVENTS_TOPIC, STATE_TOPIC} & {what} or {f"{side.value}/{what.removesuffix('s')}" for side in Side}
    begin: int | None = None
    for topic, nanoseconds, value in recorded_messages(file):
        if topic is None:
            return
        begin = nanoseconds if begin is None else begin
        if topic not in topics:
            continue
        side = value.side if what == "events" else next((each for each in Side if topic[0] == each.value), None)
        row: dict[str, Any] = {"time": (nanoseconds - begin) / 1e9, "timestamp_ns": nanoseconds}
        if what != "state":
            row["arm"] = side.word if side else ""
        if what == "cycles":
            row |= {"number": value.number, "dt": value.dt, "session": value.session, "is_running": value.is_running}
            for name in CYCLE_VECTORS:
                vector = getattr(value, name) or (nan,) * len(CHAIN_AXES)
                row |= {f"{name}_{axis}": each for axis, each in zip(CHAIN_AXES, vector, strict=True)}
            row |= {f"stage_{name}": getattr(value.stages, name) for name in CYCLE_STAGES}
        elif what == "events":
            row |= {"kind": value.kind, "message": value.sentence, "is_fault": value.is_fault}
        else:
            row |= _flat(value)
        yield row


def read_recording(file: Path | str, what: TableName = "cycles") -> pd.DataFrame:
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
        ProtocolError: the file is not a recording, or nothing is recorded in it.
        FileNotFoundError: there is no such file.
    """
    try:
        import pandas  # noqa: PLC0415 - an extra; nothing else needs it
    except ImportError as error:
        raise missing_extra(message("data_frame_needs_pandas"), "yumi-ros2", "data") from error
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


def export(file: Path, output: Path, what: TableName = "cycles") -> int:
    """Write a table of a recording as ``output``, whose ending says how: ``.csv`` or ``.parquet``; returns its rows.

    Raises:
        CommandRefused: another ending, or the recording has no row of that table; nothing is written.
        MissingPrerequisite: a library for Parquet or MCAP is not installed.
        ProtocolError: the file is not a recording, or nothing is recorded in it.
        OSError: the output cannot be written.
    """
    if output.suffix not in {".csv", ".parquet"}:
        raise CommandRefused(message("table_format_unknown", file=str(output), ending=output.suffix))
    first = next(iter(rows(file, what)), None)
    if first is None:
        raise CommandRefused(message("recording_without_rows", file=str(file), table=what))
    output.parent.mkdir(parents=True, exist_ok=True)
    if output.suffix == ".parquet":
        table = read_recording(file, what)
        try:
            table.to_parquet(output)
        except ImportError as error:
            raise missing_extra(message("parquet_needs_pandas"), "yumi-ros2", "data") from error
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


_ALL_AXES = 110
"""So many characters wide is a line of the table with the positions of all axes."""

RECORDING_GAP = 0.02
"""Where no cycle was recorded for so long, no line is drawn and the gap is marked [s]."""


def recording_table(recording: Recording, side: Side, cycles: int, width: int = 120) -> RenderableType:
    """The last ``cycles`` of one arm until the event, with everything that is known of them.

    Of the commands it shows the joint that is farthest ahead; the picture shows all. Where ``width`` characters have no
    room for seven measured positions beside them, it shows that of this joint.
    """
    from rich.console import Group  # noqa: PLC0415 - who reads a table has no need of it
    from rich.text import Text  # noqa: PLC0415

    frames = recording.frames.get(side, ())
    if not frames:
        return Text(str(message("no_cycle_of_arm", arm=side.word)))
    stop = recording.stop
    zero = stop.time if stop else frames[-1].time
    headline = stop.sentence if stop else "Nothing stopped a motion; these are the last cycles."
    gap = max((new.time - old.time for old, new in pairwise(frames)), default=0.0)
    summary = (
        f"{side.word.capitalize()} arm: {len(frames)} cycles in {frames[-1].time - frames[0].time:.2f} s, sessions "
        f"{frames[0].session} to {frames[-1].session}, longest gap between two datagrams {gap * 1e3:.1f} ms, "
        f"{len(recording_gaps(frames))} longer than {RECORDING_GAP * 1e3:g} ms."
        + ("" if recording.is_complete else " The file was cut off.")
    )
    shown = [frame for frame in frames if frame.time <= zero][-cycles:]
    style = "bold red" if stop else "bold"
    return Group(Text(headline, style=style), Text(summary), _cycles_table(shown, zero, width), _stages_table(frames))


def recording_document(recording: Recording, side: Side, cycles: int) -> dict[str, Any]:
    """What :func:`recording_table` shows, for programs: SI units, times from the event, joints in chain order."""
    frames, stop = recording.frames.get(side, ()), recording.stop
    zero = stop.time if stop else frames[-1].time if frames else 0.0
    names = ("number", "dt", "session", "is_running", *CYCLE_VECTORS)
    return {
        "arm": side.word,
        "stop": {"kind": stop.kind, "sentence": stop.sentence} if stop else None,
        "is_complete": recording.is_complete,
        "cycles": [
            {"time": frame.time - zero, **{name: getattr(frame, name) for name in names}}
            for frame in [each for each in frames if each.time <= zero][-cycles:]
        ],
    }


def _cycles_table(frames: Sequence[RecordedCycle], zero: float, width: int) -> Table:
    from rich.table import Table  # noqa: PLC0415 - as above

    table = Table(title="Cycles: times from the event in ms, angles in °, replies in µs", title_justify="left")
    has_room = width >= _ALL_AXES
    measured = f"measured, axes {' '.join(map(str, CHAIN_AXES))}" if has_room else "measured (axis)"
    for name in ("cycle", "time", "dt", "follows", measured, "desired ahead (axis)", "sent ahead (axis)", "reply"):
        table.add_column(name, justify="right")
    for frame in frames:
        positions = [f"{degrees(value):.1f}" for value in frame.position]
        index = _farthest(frame.sent, frame.position)
        table.add_row(
            str(frame.number),
            f"{(frame.time - zero) * 1e3:.1f}",
            f"{frame.dt * 1e3:.2f}",
            "yes" if frame.is_running else "no",
            " ".join(positions) if has_room else f"{positions[index]} ({CHAIN_AXES[index]})",
            "hold" if frame.desired is None else _ahead(frame.desired, frame.position),
            _ahead(frame.sent, frame.position),
            f"{frame.stages.reply * 1e6:.0f}",
        )
    return table


def _stages_table(frames: Sequence[RecordedCycle]) -> Table:
    from rich.table import Table  # noqa: PLC0415 - as above

    table = Table(title="Stages of a cycle in µs", title_justify="left")
    for name in ("stage", "p50", "p99", "max"):
        table.add_column(name, justify="left" if name == "stage" else "right")
    for name in (*CYCLE_STAGES, "reply"):
        times = sorted(getattr(frame.stages, name) * 1e6 for frame in frames)
        values = (quantile(times, 0.5), quantile(times, 0.99), times[-1])
        table.add_row(name.replace("_", " "), *(f"{value:.1f}" for value in values))
    return table


def quantile(ascending: Sequence[float], share: float) -> float:
    """The smallest of ``ascending`` values that ``share`` of them do not exceed."""
    return ascending[max(0, ceil(share * len(ascending)) - 1)]


def recording_gaps(frames: Sequence[RecordedCycle]) -> list[tuple[float, float]]:
    """Begin and end of every gap between two cycles that is longer than :data:`RECORDING_GAP` [s]."""
    return [(old.time, new.time) for old, new in pairwise(frames) if new.time - old.time > RECORDING_GAP]


def _ahead(command: Joints, position: Joints) -> str:
    """How far a command is ahead of the measured position, where it is farthest, with ABB's axis number [°]."""
    index = _farthest(command, position)
    return f"{degrees(command[index] - position[index]):+.2f} ({CHAIN_AXES[index]})"


def _farthest(command: Joints, position: Joints) -> int:
    """Index of the joint whose command is farthest from where it is."""
    return max(range(len(position)), key=lambda index: abs(command[index] - position[index]))
