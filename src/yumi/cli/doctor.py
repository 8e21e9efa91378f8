"""``yumi doctor``: lists what is missing before a robot can be driven, and changes nothing."""

from __future__ import annotations

import json
import sys
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import click

from yumi.cli.options import password_options
from yumi.driver.settings import MAX_PORT, override, read_settings
from yumi.robot.joints import Side

if TYPE_CHECKING:
    from collections.abc import Sequence

    from yumi.driver.doctor import Finding

_PORT = click.IntRange(1, MAX_PORT)
_TABLE_WIDTH = 110


@click.command()
@click.option("--robot", help="Address of the controller; else as in the settings.")
@click.option("--rws-port", type=_PORT, help="HTTP port of its Robot Web Services.")
@click.option("--left-egm-port", type=_PORT, help="UDP port where the left arm's datagrams must arrive.")
@click.option("--right-egm-port", type=_PORT, help="UDP port where the right arm's datagrams must arrive.")
@click.option("--user", help="User name on the controller.")
@password_options
@click.option("--config", type=click.Path(path_type=Path), help="Settings instead of the delivered yumi.yaml.")
@click.option("--json", "report", type=click.File("w"), help="Also write the findings to this file; - prints them.")
def doctor(
    robot: str | None,
    rws_port: int | None,
    left_egm_port: int | None,
    right_egm_port: int | None,
    user: str | None,
    password: str | None,
    config: Path | None,
    report: TextIO | None,
) -> None:
    """List what is missing before a robot can be driven, with the remedy; it only reads and nothing moves.

    Exit code 0: no problems; 1: there are problems.

    \b
    Examples:
      yumi doctor --robot 192.168.125.1
      yumi doctor --robot 127.0.0.1 --rws-port 8080      with `yumi controller` in another terminal
      yumi doctor --robot 192.168.125.1 --json -
    """
    from yumi.driver.bringup import EgmAddress  # noqa: PLC0415
    from yumi.driver.doctor import Verdict, examine_controller, examine_machine  # noqa: PLC0415 - a quick --help
    from yumi.egm.udp import address_towards, resolve  # noqa: PLC0415
    from yumi.rws.client import RwsClient  # noqa: PLC0415

    given: dict[str, dict[str, Any]] = {
        "robot": {"address": robot, "rws_port": rws_port, "user": user, "password": password},
        "egm": {"left_port": left_egm_port, "right_port": right_egm_port},
    }
    values = {group: {name: text for name, text in own.items() if text is not None} for group, own in given.items()}
    settings = override(read_settings(config), values, "command line")
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

    from yumi.driver.doctor import Verdict  # noqa: PLC0415

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
