"""What several commands share: how a password is given, and which machines see the driver's ROS 2 graph."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any

import click

from yumi.driver.settings import PASSWORD_VARIABLE, password_of_environment
from yumi.errors import SettingsError

_OTHERS_MAY_NOT = 0o077  # read, write or enter
_DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_DISCOVERY_VARIABLES = (_DISCOVERY, "ROS_STATIC_PEERS", "ROS_LOCALHOST_ONLY", "ROS_DISCOVERY_SERVER")
"""ROS's own variables that say who finds whom; the first three are rmw's, the last one is Fast DDS's."""


def password_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options that give ``command`` a ``password``: from a file, a prompt or the environment, else None.

    There is no option for the password itself: every user of the machine can read the arguments of a process.
    """

    @click.option(
        "--password-file",
        type=click.Path(dir_okay=False, path_type=Path),
        help=f"File with the password of the user; or set {PASSWORD_VARIABLE}.",
    )
    @click.option("--ask-password", is_flag=True, help="Ask for the password on the terminal.")
    @wraps(command)
    def with_password(*args: Any, password_file: Path | None, ask_password: bool, **options: Any) -> Any:
        return command(*args, password=_password(password_file, ask_password), **options)

    return with_password


def _password(file: Path | None, is_asked: bool) -> str | None:
    if file and is_asked:
        raise SettingsError("The password is given twice; give --password-file or --ask-password.")
    if is_asked:
        return str(click.prompt("Password", hide_input=True, err=True))
    return _read_password(file) if file else password_of_environment()


def _read_password(file: Path) -> str:
    """The first line of ``file``.

    Raises:
        SettingsError: it cannot be read, has no password in it, or other users can read it.
    """
    try:
        with file.open(encoding="utf-8") as opened:
            mode = os.fstat(opened.fileno()).st_mode
            password = opened.readline().rstrip("\r\n")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise SettingsError(f"Cannot read the password file {file}: {reason}.") from error
    if mode & _OTHERS_MAY_NOT:
        raise SettingsError(f"Other users can read the password file {file}; close it with: chmod 600 {file}")
    if not password:
        raise SettingsError(f"The password file {file} has an empty first line; write the password there.")
    return password


def limit_discovery(*, is_open: bool = False) -> str:
    """Let only this machine see the ROS 2 nodes of this process and its children, unless told otherwise.

    Args:
        is_open: whether the whole subnet shall see them; where ROS's own variables say something, these win.

    Returns:
        Who sees them, as a sentence.
    """
    given = [f"{name}={os.environ[name]}" for name in _DISCOVERY_VARIABLES if os.environ.get(name)]
    if given:
        return f"ROS 2 discovery is as the environment says: {', '.join(given)}."
    if is_open:
        domain = os.environ.get("ROS_DOMAIN_ID", "0")
        return f"ROS 2 is open to the subnet: every machine with ROS_DOMAIN_ID={domain} in it can move the robot."
    os.environ[_DISCOVERY] = "LOCALHOST"
    return "ROS 2 is visible on this machine only; --network opens it to the subnet."
