"""``yumi rws get``, ``set``, ``ls``, ``put``, ``watch``, ``call``: Robot Web Services of any controller, by hand."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Sequence
from functools import wraps
from pathlib import Path
from typing import Any

import click

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused
from abb_protocols.rws.documents import Page, RwsState, decode_form
from abb_protocols.rws.values import Resource
from abb_runtime.options import FILE_TYPE, NEW_FILE_TYPE, JsonOutput, count_option, json_option
from abb_runtime.rws.client import EXECUTION, Change, RwsClient, event_log, signal_state, variable_value
from yumi.cli.driver_options import config_option, robot_options, settings_of

_SYMBOL_PARTS = 3  # task, module, name
_PANEL_RESOURCES = ("ctrlstate", "opmode", "speedratio", "coldetstate")


def of_controller(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options that say which controller; the command gets a connected client first."""

    @robot_options()
    @config_option
    @wraps(command)
    def with_client(config: Path | None, **options: Any) -> Any:
        names = ("robot", "user", "password")
        with settings_of(config, {name: options.pop(name) for name in names}).robot.client() as client:
            return command(client, **options)

    return with_client


@click.group()
def rws() -> None:
    """Use Robot Web Services of a controller by hand.

    A TARGET is a resource (/rw/panel/opmode), a signal (signal:EGM_STOP), a RAPID symbol (T_ROB_R/TRobEGM/settings)
    or a file (HOME:/pick.mod).

    \b
    Examples:
      yumi rws get --robot 192.168.125.1 /rw/panel/opmode
      yumi rws get --robot 192.168.125.1 T_ROB_R/TRobMain/current_state
      yumi rws watch --robot 192.168.125.1 ctrlstate signal:EGM_STOP
    """


@rws.command("get")
@click.argument("target")
@click.argument("file", required=False, type=NEW_FILE_TYPE)
@json_option
@of_controller
def rws_get(client: RwsClient, target: str, file: Path | None, json_output: JsonOutput) -> None:
    """Read a resource, signal, symbol or file.

    A file goes to FILE of this machine, or is printed. A resource is JSON in any case. With --json a signal is a
    number, and a RAPID symbol a number, bool, string, or list for a record or an array.

    \b
    Examples:
      yumi rws get /rw/rapid/tasks
      yumi rws get signal:hand_ActualPosition_R
      yumi rws get --json T_ROB_R/TRobEGM/settings
      yumi rws get HOME:/pick.mod pick.mod
    """
    device, colon, _ = target.partition(":/")
    if target.startswith("/"):
        path, _, query = target.partition("?")
        _print(client.call("GET", path, decode_form(query)), json_output)
    elif target.startswith("signal:"):
        found = client.signal(target.removeprefix("signal:"))
        json_output.write(json.dumps(found.value))
        json_output.say(f"{found.value:g}")
    elif colon and device.isalnum():
        content = client.read_file(target)
        if file is None:
            sys.stdout.buffer.write(content)
        else:
            file.write_bytes(content)
            click.echo(f"{len(content)} bytes written")
    elif symbol := _symbol_of(target):
        json_output.write(json.dumps(client.value(*symbol), ensure_ascii=False))
        json_output.say(client.symbol(*symbol))
    else:
        raise _unknown_target(target)


@rws.command("set")
@click.argument("target")
@click.argument("value")
@of_controller
def rws_set(client: RwsClient, target: str, value: str) -> None:
    """Write a value to a signal or a RAPID symbol.

    \b
    Examples:
      yumi rws set signal:EGM_STOP 1
      yumi rws set T_ROB_R/TRobRAPID/routine_name_input '"runMoveAbsJ"'
    """
    if target.startswith("signal:"):
        try:
            number = float(value)
        except ValueError as error:
            raise CommandRefused(message("signal_value_no_number", value=value)) from error
        client.set_signal(target.removeprefix("signal:"), number)
    elif symbol := _symbol_of(target):
        client.set_symbol(*symbol, value)
    else:
        raise _unknown_target(target)


@rws.command("ls")
@click.argument("path", default="HOME:/")
@json_option
@of_controller
def rws_ls(client: RwsClient, path: str, json_output: JsonOutput) -> None:
    """List a directory or the entries of a resource.

    PATH is a directory of the controller or a resource, of which all pages are read.

    \b
    Examples:
      yumi rws ls HOME:/yumi
      yumi rws ls /rw/iosystem/signals
      yumi rws ls --json /rw/iosystem/signals
    """
    if path.startswith("/"):
        states = client.entries(path)
        json_output.write(_states_text(states))
        for state in states:
            json_output.say(state.title)
        return
    entries = client.files(path)
    json_output.write(json.dumps([{"name": each.name, "size": each.size} for each in entries], indent=2))
    for entry in entries:
        json_output.say(f"{entry.name}/" if entry.size is None else f"{entry.name:<40}{entry.size:>12}")


@rws.command("put")
@click.argument("file", type=FILE_TYPE)
@click.argument("path")
@of_controller
def rws_put(client: RwsClient, file: Path, path: str) -> None:
    """Write a file of this machine to the controller.

    \b
    Examples:
      yumi rws put pick.mod HOME:/pick.mod
    """
    content = file.read_bytes()
    client.write_file(f"{path}{file.name}" if path.endswith("/") else path, content)
    click.echo(f"{len(content)} bytes written")


@rws.command("watch")
@click.argument("targets", nargs=-1, required=True)
@count_option()
@json_option
@of_controller
def rws_watch(client: RwsClient, targets: tuple[str, ...], count: int | None, json_output: JsonOutput) -> None:
    """Print values and each of their changes.

    It subscribes again after a break, and prints that. With --json each line is an object.

    \b
    TARGETS: ctrlstate, opmode, speedratio, coldetstate, execution, elog,
      signal:NAME, TASK/MODULE/NAME (PERS)

    \b
    Examples:
      yumi rws watch ctrlstate opmode execution
      yumi rws watch --json signal:EGM_STOP
    """
    for number, item in enumerate(client.watch([_resource_of(target) for target in targets]), 1):
        line = {"interrupted": item.reason} if not isinstance(item, Change) else {"path": item.path, **item.fields}
        json_output.write(json.dumps(line, ensure_ascii=False))
        if json_output.is_printed:
            pass
        elif isinstance(item, Change):
            click.echo(f"{item.path} {' '.join(f'{name}={text}' for name, text in item.fields.items())}".rstrip())
        else:
            click.echo(f"interrupted: {item.reason}; subscribing again", err=True)
        if number == count:
            return


@rws.command("call")
@click.argument("method", type=click.Choice(["GET", "POST", "PUT", "DELETE", "HEAD"], case_sensitive=False))
@click.argument("path")
@click.argument("fields", nargs=-1)
@json_option
@of_controller
def rws_call(client: RwsClient, method: str, path: str, fields: tuple[str, ...], json_output: JsonOutput) -> None:
    """Send any request; the answer is JSON.

    FIELDS are NAME=VALUE in its body.

    \b
    Examples:
      yumi rws call POST '/rw/panel/speedratio?action=setspeedratio' speed-ratio=50
      yumi rws call POST '/rw/rapid/symbols?action=search-symbols' view=block blockurl=RAPID/T_ROB_R symtyp=per
    """
    wrong = [field for field in fields if "=" not in field]
    if wrong:
        raise CommandRefused(message("field_without_value", field=wrong[0]))
    where, _, query = path.partition("?")
    form = tuple((name, value) for name, _, value in (field.partition("=") for field in fields))
    _print(client.call(method, where, decode_form(query), form or None), json_output)


def _resource_of(target: str) -> Resource:
    if target in _PANEL_RESOURCES:
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
    raise _unknown_target(target)


def _symbol_of(target: str) -> tuple[str, str, str] | None:
    parts = target.split("/")
    return (parts[0], parts[1], parts[2]) if len(parts) == _SYMBOL_PARTS and all(parts) else None


def _unknown_target(target: str) -> CommandRefused:
    return CommandRefused(message("no_target", target=target))


def _print(page: Page | None, json_output: JsonOutput) -> None:
    """Print a resource as JSON, whether that is asked for or not."""
    if page is None:
        return
    text = _states_text(page.states)
    json_output.write(text)
    json_output.say(text)


def _states_text(states: Sequence[RwsState]) -> str:
    return json.dumps([_as_object(state) for state in states], indent=2, ensure_ascii=False)


def _as_object(state: RwsState) -> dict[str, object]:
    value: dict[str, object] = {"type": state.type, "title": state.title, **state.fields}
    if state.children:
        value["items"] = [_as_object(child) for child in state.children]
    return value
