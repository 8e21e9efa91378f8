"""``yumi record``: looking at flight records and recordings, and exporting them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from yumi.robot.joints import Side

if TYPE_CHECKING:
    from yumi.recording.tables import What

_FILE = click.Path(exists=True, dir_okay=False, path_type=Path)


@click.group()
def record() -> None:
    """Look at flight records and recordings, and export them.

    \b
    Examples:
      yumi record list
      yumi record show build/flight_records/flight_2026-01-31_12-00-00-000_right.mcap
      yumi up --record session.mcap               records every cycle of both arms, grippers, state and events
      yumi record export session.mcap session.csv
    """


@record.command()
@click.argument("file", type=_FILE)
@click.option("--cycles", type=click.IntRange(1), default=20, show_default=True, help="Cycles in the table.")
@click.option("--arm", type=click.Choice([side.word for side in Side]), help="Which arm; else the one that stopped.")
@click.option("--picture", type=click.Path(dir_okay=False, path_type=Path), help="Also draw it and save it here.")
def show(file: Path, cycles: int, arm: str | None, picture: Path | None) -> None:
    """Show what led to the event that stopped the motion.

    \b
    Examples:
      yumi record show FILE --cycles 50
      yumi record show FILE --arm left --picture stop.png
    """
    from rich.console import Console  # noqa: PLC0415 - a quick --help

    from yumi.recording.mcap import read_recording  # noqa: PLC0415
    from yumi.recording.pictures import (  # noqa: PLC0415
        draw_recording,
        recording_table,
    )

    recording = read_recording(file)
    side = next((side for side in Side if side.word == arm), recording.arm)
    console = Console(soft_wrap=False)
    console.print(recording_table(recording, side, cycles, console.width))
    if picture:
        draw_recording(recording, side, picture)
        click.echo(f"Picture: {picture}")


@record.command()
@click.argument("file", type=_FILE)
@click.argument("output", type=click.Path(dir_okay=False, path_type=Path))
@click.option(
    "--table",
    type=click.Choice(["cycles", "events", "grippers", "state"]),
    default="cycles",
    show_default=True,
    help="Which table of the recording.",
)
def export(file: Path, output: Path, table: What) -> None:
    """Write a table of a recording as CSV or Parquet; OUTPUT's ending says which.

    \b
    Examples:
      yumi record export FILE session.csv
      yumi record export FILE events.csv --table events
      yumi record export FILE session.parquet     with yumi-ros2[data]
    """
    from yumi.recording.tables import export  # noqa: PLC0415 - a quick --help

    click.echo(f"{export(file, output, table)} rows: {output}")


@record.command("list")
@click.option("--folder", type=click.Path(path_type=Path), help="Where they are; else as the delivered settings say.")
def list_records(folder: Path | None) -> None:
    """List flight records with what stopped the motion.

    \b
    Example:
      yumi record list --folder build/flight_records
    """
    from yumi.driver.settings import read_settings  # noqa: PLC0415
    from yumi.recording.mcap import read_recording  # noqa: PLC0415 - a quick --help

    folder = folder or Path(read_settings().recorder.folder)
    files = sorted(folder.glob("*.mcap"))
    if not files:
        click.echo(f"There are no records in {folder}.")
    for file in files:
        stop = read_recording(file, before=0.0).stop
        click.echo(f"{file}  {stop.sentence if stop else 'nothing stopped a motion'}")
