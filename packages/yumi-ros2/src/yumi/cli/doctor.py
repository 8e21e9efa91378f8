"""``yumi doctor``: what is missing before a robot can be driven, and whether EGM's datagrams arrive."""

from __future__ import annotations

import io
import json
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from abb_protocols.errors import YumiError
from abb_protocols.robot.joints import Joints, Side
from abb_runtime.clock import SystemClock
from abb_runtime.faults import takes_faults
from abb_runtime.options import (
    NEW_FILE_TYPE,
    JsonOutput,
    egm_port_options,
    json_option,
    stream_option,
    yes_option,
)
from abb_runtime.rws.client import RwsClient
from abb_runtime.udp import UdpServer, address_of_host, is_loopback
from yumi.cli.driver_options import config_option, robot_options, settings_of
from yumi.driver.launch_checks import EgmAddress

if TYPE_CHECKING:
    from rich.console import Console

    from yumi.driver.commissioning.findings import Finding
    from yumi.driver.commissioning.stream_checks import ArmStream


_EXAMINED_TIME = 5.0  # [s] for which `yumi doctor --stream` receives datagrams
_TABLE_WIDTH = 110


@click.command()
@robot_options()
@egm_port_options()
@config_option
@stream_option(default=False)
@yes_option
@json_option
@click.option("--html", type=NEW_FILE_TYPE, help="Also write the page to this file.")
def doctor(
    config: Path | None, stream: bool, yes: bool, json_output: JsonOutput, html: Path | None, **options: Any
) -> None:
    """List what is missing before a robot can be driven.

    Each line has the remedy; nothing moves. Without --stream it only reads. With --stream it starts the state machine
    on the robot at main for 5 s, so that datagrams of both arms come through this machine's firewall, or do not; the
    motors go on. Afterwards motors and program are on or off as before, but the program pointers stay where the program
    stopped, and its RAPID variables have begun anew. It starts nothing where a task has another program, or its modules
    are a problem. Other tasks that would start, too, are switched off meanwhile: it names them.

    Exit code 0: no problems; 1: there are problems.

    \b
    Examples:
      yumi doctor --robot 192.168.125.1
      yumi doctor --robot 127.0.0.1    with `yumi controller` in another terminal
      yumi doctor --robot 192.168.125.1 --json
      yumi doctor --robot 192.168.125.1 --stream --html robot.html
    """
    from rich.console import Console  # noqa: PLC0415 - a quick --help

    from yumi.driver.commissioning.controller_checks import examine_controller  # noqa: PLC0415
    from yumi.driver.commissioning.findings import Verdict  # noqa: PLC0415
    from yumi.driver.commissioning.machine_checks import examine_machine  # noqa: PLC0415
    from yumi.driver.commissioning.stream_checks import obstacle_to_stream  # noqa: PLC0415

    client, remote, addresses = controller_for_doctor(config, options)
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
    rows = [
        {
            "requirement": each.requirement,
            "verdict": each.verdict.value,
            "code": each.said.code,
            "found": each.found,
            "remedy": each.remedy,
            "why": each.why,
            "where": each.where,
        }
        for each in findings
    ]
    json_output.write(json.dumps({"robot": client.address, "findings": rows}, indent=2))
    if not json_output.is_printed:
        console = Console(highlight=False)
        if not console.is_terminal:
            console.width = max(console.width, _TABLE_WIDTH)
        _show(findings, console)
    if html is not None:
        page = Console(highlight=False, record=True, file=io.StringIO(), width=160)
        page.print(f"yumi doctor, robot {client.address}")
        _show(findings, page)
        html.write_text(page.export_html(), encoding="utf-8")
    sys.exit(1 if any(each.verdict is Verdict.PROBLEM for each in findings) else 0)


def _examine_stream(client: RwsClient, addresses: Mapping[Side, EgmAddress]) -> list[Finding]:
    """What comes of both arms' position streams, or why none can be started."""
    from yumi.driver.commissioning.findings import problem  # noqa: PLC0415 - a quick --help
    from yumi.driver.commissioning.stream_checks import examine_stream  # noqa: PLC0415 - a quick --help

    try:
        streams, stands = streams_for_doctor(client, addresses, _EXAMINED_TIME, lambda text: click.echo(text, err=True))
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
    summary = f"{problems} problem{'s' * (problems != 1)}" if problems else "No problems found"
    console.print(f"{summary}, {notes} note{'s' * (notes != 1)}.")


def controller_for_doctor(
    config: Path | None, options: Mapping[str, Any]
) -> tuple[RwsClient, str, dict[Side, EgmAddress]]:
    """A client, not connected yet; the controller's IP address; and where each arm's datagrams are awaited."""
    settings = settings_of(config, options)
    remote, client = address_of_host(settings.robot.address), settings.robot.client()
    if is_loopback(remote) and takes_faults(client.address):
        client.lift_rate_limit()
    return client, remote, settings.egm.addresses(remote)


def streams_for_doctor(
    client: RwsClient, addresses: Mapping[Side, EgmAddress], seconds: float, report: Callable[[str], None]
) -> tuple[Mapping[Side, ArmStream], Mapping[Side, Joints]]:
    """What comes of both arms' position streams, and where the controller says that the arms stand."""
    from yumi.driver.commissioning.stream_checks import listen, streaming  # noqa: PLC0415 - a quick --help

    clock = SystemClock()
    with ExitStack() as stack:
        links = {
            side: stack.enter_context(UdpServer(address.host, address.port)) for side, address in addresses.items()
        }
        with streaming(client, clock, lambda text: report(f"  {text}")):
            streams = listen(links, clock, seconds)
        return streams, {side: client.joint_target(side.unit) for side in Side}
