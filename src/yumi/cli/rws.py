"""``yumi rws``: Robot Web Services of a controller by hand."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from yumi.cli.options import robot_options, settings_of
from yumi.errors import CommandRefused

if TYPE_CHECKING:
    from yumi.rws.client import RwsClient
    from yumi.rws.documents import Page, State
    from yumi.rws.events import Resource

_SYMBOL_PARTS = 3  # task, module, name
_NAMED = ("ctrlstate", "opmode", "speedratio", "coldetstate")


@click.group()
def rws() -> None:
    """Robot Web Services of a controller by hand: read, write, list, upload, watch, call.

    A TARGET is a resource (/rw/panel/opmode), a signal (signal:EGM_STOP), a RAPID symbol (T_ROB_R/TRobEGM/settings)
    or a file (HOME:/pick.mod).

    \b
    Examples:
      yumi rws get --robot 192.168.125.1 /rw/panel/opmode
      yumi rws get --robot 192.168.125.1 T_ROB_R/TRobMain/current_state
      yumi rws watch --robot 192.168.125.1 ctrlstate signal:EGM_STOP
    """


@contextmanager
def _client(config: Path | None, options: dict[str, Any]) -> Iterator[RwsClient]:
    from yumi.rws.client import RwsClient  # noqa: PLC0415 - a quick --help

    where = settings_of(config, options).robot
    address = f"{where.address}:{where.rws_port}"
    with RwsClient(address, user=where.user, password=where.password, timeout=where.timeout) as client:
        yield client


_as_json = click.option("--json", "is_json", is_flag=True, help="Print JSON, for programs.")


def of_controller(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options that say which controller; the command gets a connected client first."""

    @robot_options("Address of the controller; else as in the settings.")
    @click.option("--config", type=click.Path(path_type=Path), help="Settings instead of the delivered yumi.yaml.")
    @wraps(command)
    def with_client(config: Path | None, **options: Any) -> Any:
        names = ("robot", "rws_port", "left_egm_port", "right_egm_port", "user", "password")
        given = {name: options.pop(name) for name in names}
        with _client(config, given) as client:
            return command(client, **options)

    return with_client


def _symbol_of(target: str) -> tuple[str, str, str] | None:
    parts = target.split("/")
    return (parts[0], parts[1], parts[2]) if len(parts) == _SYMBOL_PARTS and all(parts) else None


@rws.command("get")
@click.argument("target")
@click.option("--output", "-o", type=click.Path(dir_okay=False, path_type=Path), help="Write a file there.")
@_as_json
@of_controller
def get_(client: RwsClient, target: str, output: Path | None, is_json: bool) -> None:
    """Read TARGET.

    A resource is printed as JSON in any case. With --json a signal is a number, and a RAPID symbol a number, bool,
    string, or list for a record or an array.

    \b
    Examples:
      yumi rws get /rw/rapid/tasks
      yumi rws get signal:hand_ActualPosition_R
      yumi rws get --json T_ROB_R/TRobEGM/settings
      yumi rws get HOME:/pick.mod -o pick.mod
    """
    device, colon, _ = target.partition(":/")
    if target.startswith("/"):
        path, _, query = target.partition("?")
        from yumi.rws.documents import decode_form  # noqa: PLC0415 - a quick --help

        _print(client.call("GET", path, decode_form(query)))
    elif target.startswith("signal:"):
        found = client.signal(target.removeprefix("signal:"))
        click.echo(json.dumps(found.value) if is_json else f"{found.value:g}")
    elif colon and device.isalnum():
        content = client.read_file(target)
        if output is None:
            sys.stdout.buffer.write(content)
        else:
            output.write_bytes(content)
            click.echo(f"{len(content)} bytes written")
    elif symbol := _symbol_of(target):
        click.echo(json.dumps(client.value(*symbol), ensure_ascii=False) if is_json else client.symbol(*symbol))
    else:
        raise _unknown(target)


@rws.command("set")
@click.argument("target")
@click.argument("value")
@of_controller
def set_(client: RwsClient, target: str, value: str) -> None:
    """Write VALUE to TARGET, a signal or a RAPID symbol.

    \b
    Examples:
      yumi rws set signal:EGM_STOP 1
      yumi rws set T_ROB_R/TRobRAPID/routine_name_input '"runMoveAbsJ"'
    """
    if target.startswith("signal:"):
        try:
            number = float(value)
        except ValueError as error:
            raise CommandRefused(f"A signal takes a number, not {value!r}.") from error
        client.set_signal(target.removeprefix("signal:"), number)
    elif symbol := _symbol_of(target):
        client.set_symbol(*symbol, value)
    else:
        raise _unknown(target)


@rws.command("ls")
@click.argument("path", default="HOME:/")
@_as_json
@of_controller
def ls(client: RwsClient, path: str, is_json: bool) -> None:
    """List the directory PATH of the controller, or the entries of a resource, on all its pages.

    \b
    Examples:
      yumi rws ls HOME:/yumi
      yumi rws ls /rw/iosystem/signals
      yumi rws ls --json /rw/iosystem/signals
    """
    if path.startswith("/"):
        states = client.entries(path)
        if is_json:
            _print_states(states)
        else:
            for state in states:
                click.echo(state.title)
        return
    entries = client.files(path)
    if is_json:
        click.echo(json.dumps([{"name": each.name, "size": each.size} for each in entries], indent=2))
        return
    for entry in entries:
        click.echo(f"{entry.name}/" if entry.size is None else f"{entry.name:<40}{entry.size:>12}")


@rws.command("put")
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.argument("path")
@of_controller
def put(client: RwsClient, file: Path, path: str) -> None:
    """Write FILE of this machine to PATH on the controller.

    \b
    Examples:
      yumi rws put pick.mod HOME:/pick.mod
    """
    content = file.read_bytes()
    client.write_file(f"{path}{file.name}" if path.endswith("/") else path, content)
    click.echo(f"{len(content)} bytes written")


@rws.command("watch")
@click.argument("targets", nargs=-1, required=True)
@click.option("--count", type=click.IntRange(1), help="End after so many lines.")
@_as_json
@of_controller
def watch(client: RwsClient, targets: tuple[str, ...], count: int | None, is_json: bool) -> None:
    """Print the values of TARGETS and each change; it subscribes again after a break, and says so.

    With --json each line is an object.

    \b
    TARGETS: ctrlstate, opmode, speedratio, coldetstate, execution, signal:NAME, TASK/MODULE/NAME (PERS), elog
    Examples:
      yumi rws watch ctrlstate opmode execution
      yumi rws watch --json signal:EGM_STOP
    """
    from yumi.rws.events import Change  # noqa: PLC0415 - a quick --help

    for number, item in enumerate(client.watch([_resource(target) for target in targets]), 1):
        if is_json:
            line = {"interrupted": item.reason} if not isinstance(item, Change) else {"path": item.path, **item.fields}
            click.echo(json.dumps(line, ensure_ascii=False))
        elif isinstance(item, Change):
            click.echo(f"{item.path} {' '.join(f'{name}={text}' for name, text in item.fields.items())}".rstrip())
        else:
            click.echo(f"interrupted: {item.reason}; subscribing again", err=True)
        if number == count:
            return


def _resource(target: str) -> Resource:
    from yumi.rws.events import EXECUTION, Resource, event_log, signal_state, variable_value  # noqa: PLC0415

    if target in _NAMED:
        return Resource(f"/rw/panel/{target}")
    if target == "execution":
        return EXECUTION
    if target == "elog":
        return event_log()
    if target.startswith("signal:"):
        return signal_state(target.removeprefix("signal:"))
    if target.startswith("/"):
        return Resource(target)
    if symbol := _symbol_of(target):
        return variable_value(*symbol)
    raise _unknown(target)


@rws.command("call")
@click.argument("method", type=click.Choice(["GET", "POST", "PUT", "DELETE", "HEAD"], case_sensitive=False))
@click.argument("path")
@click.argument("fields", nargs=-1)
@of_controller
def call(client: RwsClient, method: str, path: str, fields: tuple[str, ...]) -> None:
    """Send any request; FIELDS are NAME=VALUE in its body.

    \b
    Examples:
      yumi rws call POST '/rw/panel/speedratio?action=setspeedratio' speed-ratio=50
      yumi rws call POST '/rw/rapid/symbols?action=search-symbols' view=block blockurl=RAPID/T_ROB_R symtyp=per
    """
    from yumi.rws.documents import decode_form  # noqa: PLC0415 - a quick --help

    wrong = [field for field in fields if "=" not in field]
    if wrong:
        raise CommandRefused(f"{wrong[0]!r} is not NAME=VALUE.")
    where, _, query = path.partition("?")
    form = tuple((name, value) for name, _, value in (field.partition("=") for field in fields))
    _print(client.call(method, where, decode_form(query), form or None))


def _print(page: Page | None) -> None:
    if page is not None:
        _print_states(page.states)


def _print_states(states: Sequence[State]) -> None:
    click.echo(json.dumps([_as_value(state) for state in states], indent=2, ensure_ascii=False))


def _as_value(state: State) -> dict[str, object]:
    value: dict[str, object] = {"type": state.type, "title": state.title, **state.fields}
    if state.children:
        value["items"] = [_as_value(child) for child in state.children]
    return value


def _unknown(target: str) -> CommandRefused:
    return CommandRefused(
        f"{target!r} is not a target: give a resource (/rw/panel/opmode), signal:NAME, TASK/MODULE/NAME or a file "
        "(HOME:/pick.mod)."
    )
