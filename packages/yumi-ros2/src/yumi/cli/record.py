"""``yumi record show``, ``export`` and ``list``: the recordings and flight records that a driver writes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from abb_protocols.catalogue import message
from abb_protocols.errors import ProtocolError
from abb_protocols.robot.joints import Side
from abb_runtime.options import FILE_TYPE, FOLDER_TYPE, JsonOutput, arm_option, json_option, picture_option
from yumi.driver.settings import read_settings
from yumi.recording.reader import read_recording

if TYPE_CHECKING:
    from yumi.recording.tables import TableName


@click.group()
def record() -> None:
    """Look at flight records and recordings.

    They can be exported, too.

    \b
    Examples:
      yumi record list
      yumi record show FILE
      yumi up --record session.mcap     records every cycle of both arms
      yumi record export session.mcap session.csv
    """


@record.command("show")
@click.argument("file", type=FILE_TYPE)
@click.option("--cycles", type=click.IntRange(1), default=20, show_default=True, help="Number of cycles.")
@arm_option("the one that stopped")
@picture_option("none is drawn")
@json_option
def show_record(file: Path, cycles: int, arm: str | None, picture: Path | None, json_output: JsonOutput) -> None:
    """Show what led to the event that stopped the motion.

    --cycles is how many the table has.

    \b
    Examples:
      yumi record show FILE --cycles 50
      yumi record show FILE --arm left --picture stop.png
    """
    from rich.console import Console  # noqa: PLC0415 - a quick --help

    from yumi.recording.pictures import draw_recording  # noqa: PLC0415
    from yumi.recording.tables import recording_document, recording_table  # noqa: PLC0415

    recording = read_recording(file)
    side = next((side for side in Side if side.word == arm), recording.arm)
    json_output.write(json.dumps(recording_document(recording, side, cycles)))
    if not json_output.is_printed:
        console = Console(soft_wrap=False)
        console.print(recording_table(recording, side, cycles, console.width))
    if picture:
        draw_recording(recording, side, picture)
        click.echo(f"Picture: {picture}", err=json_output.is_printed)


@record.command("export")
@click.argument("file", type=FILE_TYPE)
@click.argument("output", type=click.Path(dir_okay=False, path_type=Path))
@click.option(
    "--table",
    type=click.Choice(["cycles", "events", "grippers", "state"]),
    default="cycles",
    show_default=True,
    help="Which table of the recording.",
)
def export_record(file: Path, output: Path, table: TableName) -> None:
    """Write a table of a recording as CSV or Parquet.

    The ending of OUTPUT says which.

    \b
    Examples:
      yumi record export FILE session.csv
      yumi record export FILE events.csv --table events
      yumi record export FILE session.parquet     with yumi-ros2[data]
    """
    from yumi.recording.tables import export  # noqa: PLC0415 - a quick --help

    click.echo(f"{export(file, output, table)} rows: {output}")


@record.command("list")
@click.option("--folder", type=FOLDER_TYPE, show_default="as in the settings", help="Where they are.")
@json_option
def list_records(folder: Path | None, json_output: JsonOutput) -> None:
    """List flight records with what stopped the motion.

    \b
    Example:
      yumi record list --folder build/flight_records
    """
    folder = folder or Path(read_settings().recorder.folder)
    files = sorted(folder.glob("*.mcap"))
    if not files:
        json_output.say(f"There are no records in {folder}.")
    damaged = 0
    stops: list[dict[str, str | None]] = []
    for file in files:
        try:
            stop = read_recording(file, before=0.0).stop
        except ProtocolError as error:  # one that was cut off must not hide the others
            damaged += 1
            click.echo(f"{error}", err=True)
            continue
        stops.append({"file": str(file), "stop": stop.sentence if stop else None})
        json_output.say(f"{file}  {stop.sentence if stop else 'nothing stopped a motion'}")
    json_output.write(json.dumps(stops))
    if damaged:
        raise ProtocolError(message("records_unreadable", damaged=damaged, count=len(files), folder=str(folder)))
