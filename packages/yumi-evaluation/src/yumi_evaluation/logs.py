"""Logs of robots under EGM, in whatever form: what an arm was sent in each cycle and what it reported.

================================== ==================================================================================
form                               what is in it
================================== ==================================================================================
recording (``.mcap``)              of ``yumi up --record`` or the flight recorder: every motion of each arm
MCAP of ROS 2 (``.mcap``)          sensor_msgs/JointState on a topic with ``joint_states``, and commands (JointState or
                                   std_msgs/Float64MultiArray) on one with ``command`` in its name
table (``.csv``), with commands    ``time_s`` and a column a joint, ``NAME_rad`` or ``NAME_deg``; a second file has the
                                   commands in columns of the same names
folder of records                  ``records.json``, a table a record, ``command_knots.csv``
folder of recordings               files of the first two forms, as ``yumi measure`` writes them
================================== ==================================================================================

A command counts from the cycle that begins after it was sent, as a reply to the datagram before it.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import takewhile
from math import inf, isfinite, radians
from pathlib import Path

import msgspec
import numpy as np
from numpy.typing import NDArray

from abb_protocols.catalogue import message, said_by
from abb_protocols.errors import CommandRefused, ProtocolError
from abb_protocols.robot.joints import CHAIN_AXES, CYCLE, JOINT_COUNT, Side
from yumi.control.flight_recorder import RecordedCycle
from yumi.recording.reader import JointMessage, joint_messages, read_recording

Array = NDArray[np.float64]

_SHORTEST = 40
"""So many rows make a log: shorter than 0.2 s, nothing is seen of a loop that takes as long."""

_BREAK = 0.5
"""Where nothing was recorded for so long, another motion begins [s]."""

_PERIODS = (0.6 * CYCLE, 1.5 * CYCLE)  # of a table that has a row in each cycle [s]
_EARLY = 0.05  # cycles: a row or command that is stamped so much early or late still belongs to its cycle
_AT_REST = 6
"""So many first rows are before any answer to the first command: their mean is where the arm stands."""

_RUN_UP = 100  # cycles of the straight run-up before a curve
_DEGREE = 5  # of the curve between its knots


@dataclass(frozen=True, slots=True, eq=False)
class RobotLog:
    """A motion of one arm.

    Attributes:
        name: in reports.
        robot: whose it is, as the log says; empty where the log does not say.
        joints: their names, k of them.
        cycle: of the robot [s].
        rows: when each row was reported, in cycles since the first command, (n,).
        measured: what was reported in each row [rad], (n, k).
        commands: what was sent after the report of each cycle [rad], (m, k); not a number where nothing was.
        speeds: speeds that were sent with them [rad/s], (m, k); None where none were.
        start: where the arm was at the first command [rad], (k,).
        section_of: the record whose motion it continues; empty for a motion of its own.
        bandwidth: of EGM's low-pass filter [Hz]; 0 is none.
    """

    name: str
    robot: str
    joints: tuple[str, ...]
    cycle: float
    rows: Array
    measured: Array
    commands: Array
    speeds: Array | None
    start: Array
    section_of: str = ""
    bandwidth: float = 0.0

    @property
    def times(self) -> Array:
        """When each row was reported, since the first command [s], (n,)."""
        return self.rows * self.cycle


@dataclass(frozen=True, slots=True)
class Logs:
    """The motions of a log.

    Attributes:
        motions: in their order.
        left_out: a sentence for each part that was not read.
    """

    motions: tuple[RobotLog, ...]
    left_out: tuple[str, ...] = ()


def read_logs(path: Path, commands: Path | None = None) -> Logs:
    """Read a log of any form.

    Args:
        path: file or folder.
        commands: the second file of a table.

    Raises:
        CommandRefused: there is no such file, it has none of the forms, or has no motion that can be compared.
        ProtocolError: it is damaged.
        MissingPrerequisite: mcap is not installed.
    """
    if not path.exists():
        raise CommandRefused(message("log_missing", file=str(path)))
    if commands is not None and path.suffix.lower() != ".csv":
        raise CommandRefused(message("commands_beside_other_log", file=path.name))
    if path.is_dir():
        return _folder(path)
    if path.stat().st_size == 0:
        raise CommandRefused(message("log_empty", file=str(path)))
    if path.suffix.lower() == ".mcap":
        return _mcap(path)
    if path.suffix.lower() == ".csv":
        if commands is None:
            raise CommandRefused(message("table_without_commands", file=str(path)))
        return Logs((_table_with_commands(path, commands),))
    raise CommandRefused(message("no_log", file=str(path)))


# ---- tables


@dataclass(frozen=True, slots=True, eq=False)
class _Table:
    """Times [s] and values in radians by the names of their columns without the unit."""

    names: tuple[str, ...]
    times: Array
    values: Array


_TIMES = {"time_s": 1.0, "time": 1.0, "t": 1.0, "time_ms": 1e-3}
_UNITS = {"_rad": 1.0, "_deg": radians(1.0), "_rad_s": 1.0, "_deg_s": radians(1.0)}
_SPEED = ".speed"


def _read_table(path: Path, first: Sequence[str] = tuple(_TIMES)) -> _Table:
    """A CSV file with a header, whose first column has one of the names ``first``.

    Raises:
        CommandRefused: it cannot be read, or is not such a table.
    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as stream:
            lines = [line for line in csv.reader(stream) if line]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = error.strerror or str(error) if isinstance(error, OSError) else message("not_text")
        raise CommandRefused(message("table_unreadable", file=str(path), reason=reason)) from error
    header = [name.strip() for name in lines[0]] if lines else []
    suffixes = [max((unit for unit in _UNITS if name.endswith(unit)), key=len, default="") for name in header[1:]]
    if not header or header[0] not in first or not suffixes or not all(suffixes) or len({*header}) < len(header):
        raise CommandRefused(message("table_header_wrong", file=str(path), header=",".join(header), first=first[0]))
    names = tuple(
        name.removesuffix(unit) + _SPEED * unit.endswith("_s") for name, unit in zip(header[1:], suffixes, strict=True)
    )
    values = np.empty((len(lines) - 1, len(header)))
    for number, line in enumerate(lines[1:]):
        try:
            values[number] = [float(each) for each in line]
        except ValueError as error:
            raise CommandRefused(
                message("table_line_incomplete", file=str(path), line=number + 2, count=len(header))
            ) from error
    if not np.isfinite(values).all():
        raise CommandRefused(message("table_not_finite", file=str(path)))
    if len(values) > 1 and not (np.diff(values[:, 0]) > 0.0).all():
        place = int(np.argmin(np.diff(values[:, 0]))) + 3
        raise CommandRefused(message("table_times_not_increasing", file=str(path), line=place))
    scale = np.array([_UNITS[unit] for unit in suffixes])
    return _Table(names, values[:, 0] * _TIMES.get(header[0], 1.0), values[:, 1:] * scale)


def _table_with_commands(path: Path, commands: Path) -> RobotLog:
    measured, sent = _read_table(path), _read_table(commands)
    names = tuple(name for name in measured.names if not name.endswith(_SPEED))
    missing = [name for name in names if name not in sent.names]
    if missing:
        raise CommandRefused(message("commands_of_other_joints", file=str(commands), missing=tuple(missing)))
    speeds = [f"{name}{_SPEED}" for name in names]
    return _timed(
        path.stem,
        names,
        (measured.times, measured.values[:, [measured.names.index(name) for name in names]]),
        (sent.times, sent.values[:, [sent.names.index(name) for name in names]]),
        sent.values[:, [sent.names.index(name) for name in speeds]] if {*speeds} <= {*sent.names} else None,
    )


def _timed(
    name: str,
    joints: tuple[str, ...],
    measured: tuple[Array, Array],
    sent: tuple[Array, Array],
    speeds: Array | None = None,
) -> RobotLog:
    """A motion of positions and commands that have times on one clock."""
    times, positions = measured
    if len(times) < _SHORTEST:
        raise CommandRefused(message("log_too_short", log=name, rows=len(times), least=_SHORTEST))
    begin = times[0]
    period = float(np.median(np.diff(times)))
    if _PERIODS[0] < period < _PERIODS[1]:  # a row in each cycle: the robot's own cycles count, not when each was noted
        cycles = np.concatenate(([0.0], np.cumsum(np.rint(np.diff(times) / period))))
        cycle = float((times[-1] - begin) / cycles[-1])
        at = np.interp(sent[0], times, cycles, left=-1.0)
        at[sent[0] > times[-1]] = cycles[-1] + 1.0
    else:
        cycle, cycles = CYCLE, (times - begin) / CYCLE
        at = (sent[0] - begin) / CYCLE
    count = int(np.ceil(cycles[-1])) + 1
    # Of several in a cycle the newest counts; what was sent before the log began holds at its begin.
    places = np.floor(at + _EARLY).astype(int)
    commands = np.full((count, len(joints)), np.nan)
    given = None if speeds is None else np.full((count, len(joints)), np.nan)
    for number, place in enumerate(np.maximum(places, 0)):
        if place < count:
            commands[place] = sent[1][number]
            if given is not None and speeds is not None:
                given[place] = speeds[number]
    if not np.isfinite(commands).any():
        raise CommandRefused(message("commands_at_other_times", log=name, begin=float(begin)))
    return RobotLog(name, "", joints, cycle, cycles, positions, commands, given, positions[0])


# ---- MCAP


def _mcap(path: Path) -> Logs:
    """The motions of a recording of ours, or of ROS's topics in another MCAP file."""
    try:
        recording = read_recording(path, before=inf, after=inf)
    except ProtocolError as error:
        motions = _of_topics(path, error)
    else:
        motions = tuple(each for side, frames in recording.frames.items() for each in _of_frames(side, frames))
    if not motions:
        raise CommandRefused(message("log_without_motion", file=str(path), least=_SHORTEST))
    return Logs(motions)


def _of_frames(side: Side, frames: Sequence[RecordedCycle]) -> Iterator[RobotLog]:
    """The motions of an arm: its cycles of one session in which the robot followed."""
    parts: list[list[RecordedCycle]] = [[]]
    for frame in frames:
        last = parts[-1][-1] if parts[-1] else None
        # Of cycles that were not recorded, nothing says what was sent.
        goes_on = (
            last is not None
            and (frame.session, frame.number) == (last.session, last.number + 1)
            and 0.0 < frame.dt < _BREAK
        )
        if not frame.is_running or not all(map(isfinite, frame.position)):
            parts.append([])
            continue
        if not goes_on:
            parts.append([])
        parts[-1].append(frame)
    whole = [part for part in parts if len(part) >= _SHORTEST]
    for part in whole:
        periods = np.array([frame.dt for frame in part[1:]])
        passed = np.maximum(1.0, np.rint(periods / np.median(periods)))
        rows = np.concatenate(([0.0], np.cumsum(passed)))
        places = rows.astype(int)
        commands, speeds = np.full((2, places[-1] + 1, JOINT_COUNT), np.nan)
        commands[places] = [frame.sent for frame in part]
        speeds[places] = [frame.sent_velocity for frame in part]
        measured = np.array([frame.position for frame in part])
        name = f"{side.word} arm" + (f", session {part[0].session}" if len(whole) > 1 else "")
        cycle = float(periods.sum() / rows[-1])
        start = measured[:_AT_REST].mean(axis=0)
        names = tuple(f"joint_{axis}" for axis in CHAIN_AXES)
        yield RobotLog(name, "", names, cycle, rows, measured, commands, speeds, start)


def _of_topics(path: Path, otherwise: ProtocolError) -> tuple[RobotLog, ...]:
    """The motions of topics with states and commands, which belong together by the begin of their names."""
    states: dict[str, list[JointMessage]] = {}
    commands: dict[str, list[JointMessage]] = {}
    for each in joint_messages(path):
        if "command" in each.topic:
            commands.setdefault(each.topic, []).append(each)
        elif "joint_state" in each.topic and each.names:
            states.setdefault(each.topic, []).append(each)
    if not states:
        raise otherwise
    found = []
    for topic, messages in states.items():
        names = messages[0].names
        fitting = [
            each
            for each, sent in commands.items()
            if all(len(one.position) == (len(one.names) or len(names)) for one in sent)
            and {*(sent[0].names or names)} == {*names}
        ]
        if not fitting:
            continue
        near = max(fitting, key=partial(_nearness, topic))
        sent = commands[near]
        order = [(sent[0].names or names).index(name) for name in names]
        rows = [one for one in messages if one.names == names and len(one.position) == len(names)]
        found.append(
            _timed(
                topic,
                names,
                (np.array([each.time for each in rows]), np.array([each.position for each in rows])),
                (np.array([each.time for each in sent]), np.array([each.position for each in sent])[:, order]),
            )
        )
    if not found:
        raise CommandRefused(message("topics_without_commands", file=str(path), topics=tuple(states)[:3]))
    return tuple(found)


def _nearness(topic: str, other: str) -> int:
    """In how many of their first names two topics are alike."""
    names = zip(topic.strip("/").split("/"), other.strip("/").split("/"), strict=False)
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], names))


# ---- folders of records


class _Record(msgspec.Struct):
    """A record as ``records.json`` describes it."""

    record: str
    points_sent: int
    cycle_s: float
    robot: str = ""
    run_up: bool = False
    first_row: int | None = None
    section_of: str | None = None
    lp_filter_hz: float = 100.0  # where it is not said: the highest, which is as good as none


_RECORDS, _KNOTS = "records.json", "command_knots.csv"


def _folder(path: Path) -> Logs:
    """The records or recordings of a folder; sections go on with the motion of another record.

    Each record begins with an optional straight run-up from where the arm stands to the first point of a curve, in 100
    cycles; the curve's points follow, one a cycle, as many as were sent, evenly chosen of all its points.
    """
    recordings = sorted(path.glob("*.mcap"))
    if recordings and not (path / _RECORDS).exists():
        motions_of = {file.stem: _mcap(file).motions for file in recordings}
        return Logs(tuple(replace(log, name=f"{stem}, {log.name}") for stem, own in motions_of.items() for log in own))
    try:
        described = msgspec.json.decode((path / _RECORDS).read_bytes(), type=list[_Record])
    except OSError as error:
        raise CommandRefused(
            message("no_folder_of_records", folder=str(path), file=_RECORDS, reason=error.strerror)
        ) from error
    except msgspec.DecodeError as error:
        raise CommandRefused(
            message("records_not_described", file=str(path / _RECORDS), error=said_by(error))
        ) from error
    knots = _read_table(path / _KNOTS, ("curve_index",))
    by_name = {each.record: each for each in described}
    tables: dict[str, _Table] = {}
    for name in by_name:
        file = path / f"{name}.csv"
        if file.exists():
            tables[name] = _read_table(file)
    motions, left_out = [], []
    for name, record in by_name.items():
        whole = by_name.get(record.section_of or name)
        absent = [each for each in (name, record.section_of or name) if each not in tables]
        if whole is None or absent:
            left_out.append(f"{name} is left out: {absent[0] if absent else record.section_of}.csv is not there.")
            continue
        motions.append(_of_record(path, record, tables, whole, knots))
    if not motions:
        raise CommandRefused(message("no_record_there", folder=str(path), file=_RECORDS))
    return Logs(tuple(motions), tuple(left_out))


def _of_record(path: Path, record: _Record, tables: dict[str, _Table], whole: _Record, knots: _Table) -> RobotLog:
    table, begin = tables[record.record], tables[whole.record]
    for each in (table, begin):
        if each.names != knots.names or len(each.times) < _AT_REST:
            file = f"{path / record.record}.csv"
            raise CommandRefused(message("record_too_short", file=file, least=_AT_REST, joints=knots.names))
    if not (1 < record.points_sent <= knots.times[-1] and len(knots.times) > _DEGREE and record.cycle_s > 0.0):
        raise CommandRefused(
            message(
                "record_out_of_range",
                record=record.record,
                file=str(path / _RECORDS),
                points=record.points_sent,
                most=float(knots.times[-1]),
                knots=_DEGREE + 1,
                cycle=record.cycle_s,
            )
        )
    first = record.first_row
    if first is None:
        first = round((table.times[0] - begin.times[0]) / record.cycle_s)
    if first < 0:
        file = str(path / _RECORDS)
        raise CommandRefused(message("record_row_negative", record=record.record, file=file, row=first))
    rows = first + np.arange(len(table.times), dtype=float)
    start = begin.values[:_AT_REST].mean(axis=0)
    points = _curve(knots, np.linspace(0.0, knots.times[-1] - 1.0, record.points_sent).astype(int))
    if record.run_up:
        ways = np.arange(_RUN_UP)[:, None] / _RUN_UP
        points = np.vstack((start + ways * (points[0] - start), points))
    commands = np.full((int(rows[-1]) + 1, points.shape[1]), np.nan)
    sent = points[: len(commands)]
    commands[: len(sent)] = sent
    return RobotLog(
        record.record,
        record.robot,
        tuple(knots.names),
        record.cycle_s,
        rows,
        table.values,
        commands,
        None,
        start,
        record.section_of or "",
        record.lp_filter_hz,
    )


def _curve(knots: _Table, points: NDArray[np.int_]) -> Array:
    """The curve at points of it: a polynomial of degree 5 through the six nearest knots."""
    places = np.interp(points, knots.times, np.arange(len(knots.times)))
    first = np.clip(np.floor(places).astype(int) - 2, 0, len(knots.times) - _DEGREE - 1)
    near = first[:, None] + np.arange(_DEGREE + 1)
    at = knots.times[near]
    weights = np.ones_like(at)
    for one in range(_DEGREE + 1):
        for other in range(_DEGREE + 1):
            if one != other:
                weights[:, one] *= (points - at[:, other]) / (at[:, one] - at[:, other])
    return np.asarray(np.einsum("ps,psj->pj", weights, knots.values[near]))
