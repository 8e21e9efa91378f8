"""``yumi answer``: the questions of RAPID programs to the operator."""

from __future__ import annotations

import json

import click

from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, ControllerRefused
from abb_runtime.options import JsonOutput, json_option, password_options, robot_option, user_option
from yumi.cli.driver_options import settings_of


@click.command()
@click.argument("value", required=False)
@robot_option(default="127.0.0.1")
@user_option("Default User")
@password_options
@json_option
def answer(value: str | None, robot: str, user: str, password: str | None, json_output: JsonOutput) -> None:
    """Show or answer what a RAPID program asks.

    Without VALUE it shows the question to the operator. VALUE is a button's or an item's text, the value that the
    program gets for it, a number, or a text.

    \b
    Examples:
      yumi answer
      yumi answer Yes
    """
    own = settings_of(None, {"robot": robot, "user": user, "password": password or None}).robot
    with own.client() as client:
        dialog = client.dialog()
        if dialog is None:
            raise CommandRefused(message("program_asks_nothing"))
        asked = [f"{name}: {text}" for name, text in client.dialog_parameters(dialog.stack).items() if text]
        if value is None:
            task = dialog.stack.split("/")[1]
            json_output.write(json.dumps({"instruction": dialog.instruction, "task": task, "asked": asked}))
            json_output.say("\n".join([f"{dialog.instruction} of {task}", *asked]))
            return
        try:
            client.answer_dialog(dialog.stack, value)
        except ControllerRefused as error:
            raise CommandRefused(
                message("answer_refused", value=value, instruction=dialog.instruction, asked=tuple(asked))
            ) from error
