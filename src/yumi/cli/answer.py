"""``yumi answer``: answers what a RAPID program asks on the FlexPendant, over Robot Web Services."""

from __future__ import annotations

from typing import Any
from urllib.parse import quote

import click

from yumi.cli.options import password_options
from yumi.driver.settings import MAX_PORT, RobotSettings
from yumi.errors import CommandRefused, NoConnection

_TIMEOUT = 4.0  # [s]
_ACTIVE = "/rw/rapid/uiinstr/active"


@click.command()
@click.argument("value", required=False)
@click.option("--robot", default="127.0.0.1", show_default=True, help="Address of the controller.")
@click.option("--rws-port", type=click.IntRange(1, MAX_PORT), default=8080, show_default=True, help="Its HTTP port.")
@click.option("--user", default="Default User", show_default=True, help="User that may log in.")
@password_options
def answer(value: str | None, robot: str, rws_port: int, user: str, password: str | None) -> None:
    """Answer the question that a RAPID program asks the operator; without VALUE, show it.

    VALUE is a button's or an item's text, the value that the program gets for it, a number, or a text.
    """
    import httpx  # noqa: PLC0415 - a quick --help

    address = f"http://{robot}:{rws_port}"
    auth = httpx.DigestAuth(user, password or RobotSettings().password)
    try:
        with httpx.Client(base_url=address, auth=auth, timeout=_TIMEOUT, trust_env=False) as client:
            found = client.get(_ACTIVE, params={"json": "1"})
            if found.status_code == httpx.codes.NOT_FOUND:
                raise CommandRefused("No program asks anything.")
            active = _states(found)[0]
            stack = quote(active["stack"])
            if value is None:
                parameters = _states(client.get(f"{_ACTIVE}/params/{stack}", params={"json": "1"}))
                shown = [f"{each['name']}: {each['value']}" for each in parameters if each["value"]]
                click.echo("\n".join([f"{active['instr']} of {active['stack'].split('/')[1]}", *shown]))
                return
            reply = client.post(f"{_ACTIVE}/param/{stack}/Result", params={"action": "set"}, data={"value": value})
            if not reply.is_success:
                message = reply.text.partition("[1] ")[2].partition(" code:")[0]
                raise CommandRefused(message or f"The controller answered {reply.status_code}.")
    except httpx.HTTPError as error:
        raise NoConnection(f"Nothing answers at {robot}:{rws_port} ({error}).") from error


def _states(reply: Any) -> list[dict[str, str]]:
    """The entries of a document; raises CommandRefused when the reply is none."""
    if not reply.is_success:
        raise CommandRefused(f"The controller answered {reply.status_code}.")
    states: list[dict[str, str]] = reply.json()["_embedded"]["_state"]
    return states
