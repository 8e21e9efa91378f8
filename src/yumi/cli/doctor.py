"""``yumi doctor``: lists what is missing before a robot can be driven; without --stream it only reads."""

from __future__ import annotations

import io
import json
import sys
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from yumi.cli.options import robot_options, settings_of
from yumi.errors import YumiError
from yumi.robot.joints import Side

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from rich.console import Console

    from yumi.driver.bringup import EgmAddress
    from yumi.driver.commissioning.findings import Finding
    from yumi.rws.client import RwsClient

_TABLE_WIDTH = 110
_STREAM_TIME = 5.0


@click.command()
@robot_options("Address of the controller; else as in the settings.")
@click.option("--config", type=click.Path(path_type=Path), help="Settings instead of the delivered yumi.yaml.")
@click.option("--stream", is_flag=True, help="Also receive both arms' positions over EGM for 5 s; it asks first.")
@click.option("--yes", is_flag=True, help="Do not ask before that.")
@click.option(
    "--json",
    "report",
    type=click.Path(dir_okay=False, allow_dash=True),
    help="Also write the findings to this file; - prints them, and nothing else.",
)
@click.option("--html", type=click.Path(dir_okay=False, path_type=Path), help="Also write the page to this file.")
def doctor(config: Path | None, stream: bool, yes: bool, report: str | None, html: Path | None, **options: Any) -> None:
    """List what is missing before a robot can be driven, with the remedy; nothing moves.

    Without --stream it only reads. With --stream it starts the state machine on the robot at main for 5 s, so that
    datagrams of both arms come through this machine's firewall, or do not; the motors go on. Afterwards motors and
    program are on or off as before, but the program pointers stay where the program stopped, and its RAPID variables
    have begun anew. It starts nothing where a task has another program, or its modules are a problem. Other tasks that
    would start, too, are switched off meanwhile: it says which.

    Exit code 0: no problems; 1: there are problems.

    \b
    Examples:
      yumi doctor --robot 192.168.125.1
      yumi doctor --robot 127.0.0.1 --rws-port 8080      with `yumi controller` in another terminal
      yumi doctor --robot 192.168.125.1 --json -
      yumi doctor --robot 192.168.125.1 --stream --html robot.html
    """
    from yumi.driver.bringup import EgmAddress  # noqa: PLC0415
    from yumi.driver.commissioning.doctor import examine_controller, obstacle_to_stream  # noqa: PLC0415 - a quick --help
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
        if stream and (obstacle := obstacle_to_stream(findings)) is not None:
            findings.append(obstacle)
        elif stream:
            if not yes:
                click.confirm(
                    "Receive the arms' positions now? The motors go on, the program starts at main; nothing moves",
                    abort=True,
                )
            findings += _examine_stream(client, addresses)
    finally:
        client.close()
    if report is not None:
        rows = [
            {**asdict(each), "verdict": each.verdict.value, "why": each.why, "where": each.where} for each in findings
        ]
        text = json.dumps({"robot": client.address, "findings": rows}, indent=2)
        if report == "-":
            click.echo(text)
        else:
            Path(report).write_text(f"{text}\n", encoding="utf-8")
    if report != "-":
        from rich.console import Console  # noqa: PLC0415

        console = Console(highlight=False)
        if not console.is_terminal:
            console.width = max(console.width, _TABLE_WIDTH)
        _show(findings, console)
    if html is not None:
        from rich.console import Console  # noqa: PLC0415

        page = Console(highlight=False, record=True, file=io.StringIO(), width=160)
        page.print(f"yumi doctor, robot {client.address}")
        _show(findings, page)
        html.write_text(page.export_html(), encoding="utf-8")
    sys.exit(1 if any(each.verdict is Verdict.PROBLEM for each in findings) else 0)


def _examine_stream(client: RwsClient, addresses: Mapping[Side, EgmAddress]) -> list[Finding]:
    """What comes of both arms' position streams, or why none can be started."""
    from contextlib import ExitStack  # noqa: PLC0415 - a quick --help

    from yumi.clock import SystemClock  # noqa: PLC0415
    from yumi.driver.commissioning.doctor import examine_stream  # noqa: PLC0415
    from yumi.driver.commissioning.machine import problem  # noqa: PLC0415
    from yumi.driver.commissioning.stream import listen, streaming  # noqa: PLC0415
    from yumi.egm.udp import UdpServer  # noqa: PLC0415

    clock = SystemClock()
    try:
        with ExitStack() as stack:
            links = {
                side: stack.enter_context(UdpServer(address.host, address.port)) for side, address in addresses.items()
            }
            with streaming(client, clock, lambda text: click.echo(f"  {text}", err=True)):
                streams = listen(links, clock, _STREAM_TIME)
            stands = {side: client.joint_target(side.unit) for side in Side}
    except YumiError as error:
        return [problem("EGM stream", error)]
    return list(examine_stream(streams, stands, addresses))


def _show(findings: Sequence[Finding], console: Console) -> None:
    """One line a requirement; below, what is behind those that are not met."""
    from rich.table import Table  # noqa: PLC0415 - a quick --help
    from rich.text import Text  # noqa: PLC0415

    from yumi.driver.commissioning.findings import Verdict  # noqa: PLC0415

    style = {Verdict.OK: "green", Verdict.NOTE: "yellow", Verdict.PROBLEM: "bold red"}
    table = Table("", "requirement", "found", "what to do", box=None, pad_edge=False)
    for each in findings:
        mark = Text(each.verdict.value, style[each.verdict])
        remedy = f"{each.remedy} (FlexPendant: {each.where})" if each.remedy and each.where else each.remedy
        found = f"{each.found}; {each.why}" if each.verdict is Verdict.PROBLEM and each.why else each.found
        table.add_row(mark, Text(each.requirement), Text(found), Text(remedy))
    console.print(table)
    counts = Counter(each.verdict for each in findings)
    problems, notes = counts[Verdict.PROBLEM], counts[Verdict.NOTE]
    said = f"{problems} problem{'s' * (problems != 1)}" if problems else "No problems found"
    console.print(f"{said}, {notes} note{'s' * (notes != 1)}.")
