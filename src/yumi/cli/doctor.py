"""``yumi doctor``: lists what is missing before a robot can be driven, and changes nothing."""

from __future__ import annotations

import json
import sys
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import click

from yumi.cli.options import robot_options, settings_of
from yumi.robot.joints import Side

if TYPE_CHECKING:
    from collections.abc import Sequence

    from yumi.driver.commissioning.findings import Finding

_TABLE_WIDTH = 110


@click.command()
@robot_options("Address of the controller; else as in the settings.")
@click.option("--config", type=click.Path(path_type=Path), help="Settings instead of the delivered yumi.yaml.")
@click.option("--json", "report", type=click.File("w"), help="Also write the findings to this file; - prints them.")
def doctor(config: Path | None, report: TextIO | None, **options: Any) -> None:
    """List what is missing before a robot can be driven, with the remedy; it only reads and nothing moves.

    Exit code 0: no problems; 1: there are problems.

    \b
    Examples:
      yumi doctor --robot 192.168.125.1
      yumi doctor --robot 127.0.0.1 --rws-port 8080      with `yumi controller` in another terminal
      yumi doctor --robot 192.168.125.1 --json -
    """
    from yumi.driver.bringup import EgmAddress  # noqa: PLC0415
    from yumi.driver.commissioning.doctor import examine_controller  # noqa: PLC0415 - a quick --help
    from yumi.driver.commissioning.findings import Verdict  # noqa: PLC0415
    from yumi.driver.commissioning.machine import examine_machine  # noqa: PLC0415
    from yumi.egm.udp import address_towards, resolve  # noqa: PLC0415
    from yumi.rws.client import RwsClient  # noqa: PLC0415

    settings = settings_of(config, options)
    where = settings.robot
    remote = resolve(where.address)
    listen = address_towards(remote) if settings.egm.listen == "auto" else settings.egm.listen
    addresses = {side: EgmAddress(listen, settings.egm.port(side)) for side in Side}
    client = RwsClient(
        f"{where.address}:{where.rws_port}", user=where.user, password=where.password, timeout=where.timeout
    )
    try:
        findings = [*examine_controller(client, addresses), *examine_machine(remote, addresses)]
    finally:
        client.close()
    if report is not None:
        rows = [{**asdict(each), "verdict": each.verdict.value} for each in findings]
        json.dump({"robot": client.address, "findings": rows}, report, indent=2)
        report.write("\n")
    if report is not sys.stdout:
        _show(findings)
    sys.exit(1 if any(each.verdict is Verdict.PROBLEM for each in findings) else 0)


def _show(findings: Sequence[Finding]) -> None:
    from rich.console import Console  # noqa: PLC0415 - a quick --help
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    from yumi.driver.commissioning.findings import Verdict  # noqa: PLC0415

    style = {Verdict.OK: "green", Verdict.NOTE: "yellow", Verdict.PROBLEM: "bold red"}
    table = Table("", "requirement", "found", "what to do", box=None, pad_edge=False)
    for each in findings:
        mark = Text(each.verdict.value, style[each.verdict])
        table.add_row(mark, Text(each.requirement), Text(each.found), Text(each.remedy))
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = max(console.width, _TABLE_WIDTH)
    console.print(table)
    counts = Counter(each.verdict for each in findings)
    problems, notes = counts[Verdict.PROBLEM], counts[Verdict.NOTE]
    said = f"{problems} problem{'s' * (problems != 1)}" if problems else "No problems found"
    console.print(f"{said}, {notes} note{'s' * (notes != 1)}.")
