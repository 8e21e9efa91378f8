"""``yumi install`` and ``yumi uninstall``: the installation of this package on a controller, and its removal.

After an installation it can see whether the EGM datagrams of both arms arrive.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from abb_protocols.catalogue import clause, message
from abb_protocols.errors import NoConnection, RobotNotReady, YumiError
from abb_protocols.robot.joints import Side
from abb_runtime.options import (
    JsonOutput,
    dry_run_option,
    egm_port_options,
    json_option,
    stream_option,
    yes_option,
)
from abb_runtime.rws.client import RwsClient
from abb_runtime.udp import network_cards
from yumi.cli.doctor import controller_for_doctor, streams_for_doctor
from yumi.cli.driver_options import config_option, robot_options
from yumi.driver.launch_checks import EgmAddress, LaunchChecks

if TYPE_CHECKING:
    from abb_protocols.rws.operations.system import SystemInfo
    from yumi.driver.commissioning.installation import Installation, InstallationPlan


@click.command()
@robot_options()
@egm_port_options()
@config_option
@yes_option
@dry_run_option
@click.option("--roll-back", is_flag=True, help="Make everything as it was before the first installation.")
@click.option("--replace-main", is_flag=True, help="Unload modules of others that have a main; --roll-back loads them.")
@click.option("--backup/--no-backup", default=True, help="Have the controller make a backup first, and download it.")
@stream_option(default=True)
@json_option
def install(
    config: Path | None,
    yes: bool,
    dry_run: bool,
    roll_back: bool,
    replace_main: bool,
    backup: bool,
    stream: bool,
    json_output: JsonOutput,
    **options: Any,
) -> None:
    """Set up a controller; it restarts, nothing moves.

    It brings RAPID modules, I/O signals, EGM's devices and motion data. It shows what it would change and asks. What
    was there before is kept; --roll-back makes it so again, also after an installation that was interrupted. --json
    writes plan and result. Exit code 0: all is there; 1: it is not.

    \b
    Examples:
      yumi install --robot 192.168.125.1 --dry-run
      yumi install --robot 192.168.125.1
      yumi install --robot 192.168.125.1 --roll-back
      yumi install --robot 127.0.0.1 --yes      with `yumi controller --factory`
    """
    with _session(config, json_output, options, yes=yes, dry_run=dry_run) as session:
        if roll_back:
            plan = session.installation.plan_roll_back()
            if session.is_confirmed(plan, "Make everything as it was before the first installation? It restarts"):
                session.installation.undo(plan)
                session.finish("Everything is as it was before.", plan)
            return
        session.show_route()
        plan = session.installation.plan(
            session.system, session.addresses, replaces_main=replace_main, makes_backup=backup
        )
        if not session.is_confirmed(plan):
            return
        with _rolling_back_is_possible(session.installation):
            session.installation.install(plan, makes_backup=backup)
        if plan.changes:
            outcome = f"{len(plan.changes)} changes made and verified."
        else:
            outcome = "Restarted; everything is there." if plan.needs_restart else "Everything is there already."
        question = "Receive the arms' positions now? The motors go on and the program starts; nothing moves"
        if stream and (yes or click.confirm(question)):
            session.finish(outcome, plan, stream=_check_stream(session))
        else:
            session.finish(outcome, plan)


@click.command()
@robot_options()
@egm_port_options()
@config_option
@yes_option
@dry_run_option
@json_option
def uninstall(config: Path | None, yes: bool, dry_run: bool, json_output: JsonOutput, **options: Any) -> None:
    """Take away what `yumi install` has brought.

    The controller restarts, nothing moves. Where this machine has the record of the installation, everything becomes as
    it was before; else what has the names of this package goes.

    \b
    Examples:
      yumi uninstall --robot 192.168.125.1 --dry-run
      yumi uninstall --robot 192.168.125.1
    """
    with _session(config, json_output, options, yes=yes, dry_run=dry_run) as session:
        plan = session.installation.plan_removal(session.system, session.addresses)
        if not session.is_confirmed(plan):
            return
        session.installation.undo(plan)
        session.finish(
            f"{len(plan.changes)} changes made and verified." if plan.changes else "Nothing of this package is there.",
            plan,
        )


@contextmanager
def _rolling_back_is_possible(installation: Installation) -> Iterator[None]:
    """Say after a failure or Ctrl-C how everything becomes as it was."""
    try:
        yield
    except (YumiError, KeyboardInterrupt, OSError):
        if not installation.can_roll_back:
            raise
        click.echo(
            "It was interrupted: `yumi install` goes on from here, `yumi install --roll-back` makes all as it was.",
            err=True,
        )
        raise


@dataclass(frozen=True, slots=True)
class _Session:
    """What `install` and `uninstall` work with: the client, the installation on it, and how they report.

    Attributes:
        client: connected.
        system: its controller's.
        remote: the controller's IP address.
        addresses: where each arm's datagrams are awaited.
        installation: on it.
        json_output: where the result goes as JSON.
        is_asked: whether a person is asked before a plan is carried out.
        is_dry: whether no plan is carried out.
    """

    client: RwsClient
    system: SystemInfo
    remote: str
    addresses: dict[Side, EgmAddress]
    installation: Installation
    json_output: JsonOutput
    is_asked: bool
    is_dry: bool

    def is_confirmed(self, plan: InstallationPlan, question: str = "") -> bool:
        """Show a plan; whether it is to be carried out. Ends with code 1 where it cannot be carried out now.

        Args:
            plan: what would be done.
            question: for the person; unless given, what the plan changes, if it does.
        """
        self.show(plan)
        if plan.refusals:
            self.finish("Nothing was changed.", plan)
            sys.exit(1)
        if self.is_dry:
            self.finish(f"{len(plan.changes)} changes; nothing was changed.", plan)
            return False
        if self.is_asked and (question or not plan.is_empty):
            restarts = "; it restarts" * plan.needs_restart
            click.confirm(question or f"Make these {len(plan.changes)} changes{restarts}", abort=True)
        return True

    def finish(self, outcome: str, plan: InstallationPlan | None = None, **more: object) -> None:
        """Print the result."""
        value: dict[str, object] = {"robot": self.client.address, "outcome": outcome}
        if plan is not None:
            value |= {
                "changes": [str(change) for change in plan.changes],
                "refusals": [str(refusal) for refusal in plan.refusals],
                "notes": [str(note) for note in plan.notes],
                "needs_restart": plan.needs_restart,
            }
        self.json_output.write(json.dumps(value | more, indent=2))
        self.json_output.say(outcome)

    def show_route(self) -> None:
        """What is wrong with the way to the robot: its datagrams will go to this machine's address there."""
        from yumi.driver.commissioning.findings import Verdict  # noqa: PLC0415 - a quick --help
        from yumi.driver.commissioning.machine_checks import examine_route  # noqa: PLC0415 - a quick --help

        for finding in examine_route(self.remote, self.addresses, network_cards()):
            if finding.verdict is not Verdict.OK:
                self.json_output.say(f"Note: {finding.found}; {finding.remedy}.")

    def show(self, plan: InstallationPlan) -> None:
        """The plan, like a diff."""
        colours = {"+": "green", "-": "red", "~": "yellow"}
        for note in plan.notes:
            self.json_output.say(f"Note: {clause(note)}.")
        for change in plan.changes:
            self.json_output.say(click.style(str(change), colours[change.sign]))
        for refusal in plan.refusals:
            self.json_output.say(click.style(str(message("not_possible_now", reason=refusal)), "red"))


@contextmanager
def _session(
    config: Path | None, json_output: JsonOutput, options: dict[str, Any], *, yes: bool, dry_run: bool
) -> Iterator[_Session]:
    if json_output.is_printed and not (yes or dry_run):
        raise click.UsageError("--json cannot ask: give --yes or --dry-run with it.")
    from yumi.driver.commissioning.installation import Installation  # noqa: PLC0415 - a quick --help
    from yumi.driver.commissioning.installation_record import InstallationRecord  # noqa: PLC0415 - a quick --help

    client, remote, addresses = controller_for_doctor(config, options)
    try:
        system = client.connect()
        LaunchChecks(client).check_robot(system)
        identity = client.identity()
        record = InstallationRecord.of(f"{identity.serial or identity.name}_{system.name}_{system.id.strip('{}')}")
        installation = Installation(client, record, _Progress(json_output.is_printed))
        session = _Session(client, system, remote, addresses, installation, json_output, not yes, dry_run)
        session.json_output.say(
            f"{identity.name}, system {system.name!r} at {client.address}, RobotWare {system.version}"
        )
        yield session
    finally:
        client.close()


_PROGRESS_PERIOD = 5.0  # [s]


class _Progress:
    """Prints each step; of one that goes on, a line in five seconds."""

    def __init__(self, is_quiet: bool) -> None:
        self._is_quiet = is_quiet
        self._last = ""
        self._next = 0.0

    def __call__(self, text: str) -> None:
        kind, now = text.partition(",")[0], time.monotonic()
        if self._is_quiet or (kind == self._last and now < self._next):
            return
        self._last, self._next = kind, now + _PROGRESS_PERIOD
        click.echo(f"  {text}")


_INSTALLED_TIME = 2.0  # [s] for which datagrams are received after an installation
_WORST_LOSS = 0.01


def _check_stream(session: _Session) -> dict[str, dict[str, float]]:
    """Receive both arms' positions for a moment.

    Raises:
        NoConnection: an arm's datagrams do not arrive.
        RobotNotReady: they are those of the other arm, or many are lost.
    """
    streams, stands = streams_for_doctor(session.client, session.addresses, _INSTALLED_TIME, session.json_output.say)
    for side, stream in streams.items():
        address = session.addresses[side]
        if stream.position is None:
            raise NoConnection(message("no_datagram_at_test", arm=side.word, address=f"{address.host}:{address.port}"))
        if not stream.is_of(stands[side]):
            raise RobotNotReady(message("datagrams_of_other_arm", port=address.port, arm=side.word))
        if stream.loss > _WORST_LOSS:
            raise RobotNotReady(message("datagrams_lost", share=stream.loss, arm=side.word))
        session.json_output.say(
            f"{side.word} arm: {stream.counters.received} datagrams, "
            f"one every {stream.arrivals.cycle_time * 1e3:.2f} ms, {stream.counters.lost} lost"
        )
    return {
        side.word: {
            "received": stream.counters.received,
            "lost": stream.counters.lost,
            "period": stream.arrivals.cycle_time,
        }
        for side, stream in streams.items()
    }
