"""Refusals of options that several command lines share: passwords, and where JSON goes."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

OPTIONS: Mapping[str, Text] = {
    "json_not_writable": Text("--json: {file} cannot be written: {reason}"),
    "password_given_twice": Text("the password is given twice", "give --password-file or --ask-password"),
    "not_utf8_text": Text("it is not UTF-8 text"),
    "password_file_unreadable": Text("cannot read the password file {file}: {reason}"),
    "password_file_open_to_others": Text(
        "other users can read the password file {file}", "close it with `chmod 600 {file}`"
    ),
    "password_file_empty": Text("the password file {file} has an empty first line", "write the password there"),
}
