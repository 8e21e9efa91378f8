"""Commands of the command line made from the driver's table of commands: name, help, arguments, options and result."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from inspect import getdoc
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, cast, get_args, get_origin

import click
import msgspec

from abb_protocols.errors import CommandRefused, SettingsError
from abb_runtime.options import ARM_TYPE, ARMS_TYPE, JsonOutput, OptionNumber, json_option, robot_option
from yumi.api.attach import RunningDriver, attach
from yumi.driver.command import ArmName, ArmNames, Command


def of_driver(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command the driver that runs, and print what it returns: a sentence, or JSON with ``--json``."""

    @robot_option()
    @json_option
    @wraps(command)
    def with_driver(*args: Any, robot: str | None, json_output: JsonOutput, **options: Any) -> None:
        def report(step: str) -> None:
            click.echo(step, err=True)

        with attach(robot or "", on_step=report) as driver:
            result = command(driver, *args, **options)
        json_output.write(msgspec.json.encode(result).decode())
        json_output.say(str(result))

    return with_driver


def command_from(kind: type[Command[Any]]) -> click.Command:
    """The command for ``kind``: its docstring is the help; an argument with a default is an option, but arms."""
    name = kind.shell_name or kind.method().replace("_", "-")

    @of_driver
    def run(driver: RunningDriver, **values: Any) -> object:
        if "arms" in kind.__struct_fields__:
            values["arms"] = arms_of(values.pop("arm"))
        asked = kind(**values)
        try:
            asked.check()
        except CommandRefused as error:
            raise SettingsError(error.said) from error
        return driver.call(asked)

    examples = "\n".join(f"  {each}" for each in kind.examples or (f"yumi {name}",))
    text = f"{(getdoc(kind) or '').replace('``', '')}\n\n\b\nExamples:\n{examples}"
    fields = [each for each in msgspec.structs.fields(kind) if each.name != "id"]
    return click.command(name, help=text, params=list(map(_parameter, fields)))(run)


def arms_of(word: str | None) -> ArmNames:
    """The arms that an argument names; none where it is left out."""
    return () if word is None else ("right", "left") if word == "both" else (cast("ArmName", word),)


def _parameter(field: msgspec.structs.FieldInfo) -> click.Parameter:
    """An argument or option for an argument of a command."""
    if field.type == ArmNames:
        return click.Argument(["arm"], type=ARMS_TYPE, required=False, default="both" if field.default else None)
    kind, meta = field.type, msgspec.Meta()
    if get_origin(kind) in (Union, UnionType):
        (kind,) = (each for each in get_args(kind) if each is not NoneType)
    if get_origin(kind) is Annotated:
        kind, meta = get_args(kind)
    shown: Any = kind
    if kind == ArmName:
        shown = ARM_TYPE
    elif get_origin(kind) is Literal:
        shown = click.Choice(get_args(kind))
    elif meta.extra is not None:
        shown = OptionNumber(field.name, 0.0, meta.extra["to"], is_open=True)
    if field.required:
        return click.Argument([field.name], type=shown)
    option = f"--{field.name.replace('_', '-')}"
    return click.Option([option], type=shown, default=field.default, is_flag=kind is bool, help=meta.description)
