"""Recordings: files that cannot be written or read, and what they do not hold."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

_FROM_WHERE = "give a file that `yumi up --record` or the flight recorder wrote"

RECORDINGS: Mapping[str, Text] = {
    "recording_not_writable": Text("cannot record to {file}: {reason}"),
    # ---- a file that is no recording
    "recording_damaged": Text("{file} is not a recording of yumi, or it is damaged: {reason}", _FROM_WHERE),
    "recording_of_another_program": Text(
        "{file} is an MCAP file, but not a recording of yumi: it has messages on {count} topics, such as "
        "{topics:quoted}, and none in JSON on {needed:list}",
        _FROM_WHERE,
    ),
    "recording_closed_empty": Text("{file} has nothing in it: it was closed before anything was recorded", _FROM_WHERE),
    "recording_cut_off_empty": Text(
        "{file} has nothing in it: it was cut off, or is being written, before anything was recorded", _FROM_WHERE
    ),
    # ---- why it is none
    "not_mcap": Text("it does not begin and end as an MCAP file does"),
    "channel_not_declared": Text("a message is on a channel that was not declared"),
    "chunk_not_decompressed": Text("a chunk cannot be decompressed: {reason}"),
    "chunk_compression_unknown": Text("a chunk is compressed with {compression:quoted}; allowed: zstd, lz4"),
    "chunk_too_large": Text("a chunk of {size} bytes has more than {limit} bytes when decompressed"),
    "recorded_message_unreadable": Text("a message on {topic} cannot be read: {reason}"),
    "recorded_message_nested_too_deeply": Text("a message on {topic} is nested too deeply"),
    "recorded_after_2262": Text("it is of a time after the year 2262"),
    "not_in_xcdr1": Text("it is not in XCDR1"),
    "elements_do_not_fit": Text("{count} elements do not fit in it"),
    # ---- what it does not hold
    "recording_without_table": Text("a recording has no table {table:quoted}; it has: {known:list}"),
    "recording_without_rows": Text(
        "{file} has no {table}; `yumi up --record` writes all tables, a flight record has cycles"
    ),
    "table_format_unknown": Text("{file} ends in {ending:quoted}", "give a file that ends in .csv or .parquet"),
    "no_cycle_of_arm": Text("no cycle of the {arm} arm is recorded", "choose the other arm with --arm"),
}
