"""The tables of docs/reference/rws-coverage.md: every operation of the virtual controller's Robot Web Services.

    .venv/bin/python setup/rws_coverage.py

prints them; docs_site.py puts them into the page when the site is built. They are the table that directs the
controller's requests, so that they state what the controller does.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence

from abb_protocols.rws.operations.operation import Operation, Values
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.rws.version_2 import RwsService2
from virtual_irc5.world import World

_OR = "\\|"  # in a cell of a table


def operations() -> tuple[Operation, ...]:
    """The table."""
    return RwsService(World().controller, user="", password="").operations


def _key(operation: Operation) -> tuple[str, ...]:
    return operation.method, operation.path, operation.action or "", operation.resource or ""


def second_names() -> dict[tuple[str, ...], list[str]]:
    """What RWS 2.0 calls each operation that it has."""
    names: dict[tuple[str, ...], list[str]] = {}
    for each in RwsService2(World().controller, user="", password="").translations:
        is_same = _target(each.operation) == _target(each.rws1.operation)
        names.setdefault(_key(each.rws1.operation), []).append("same" if is_same else f"`{_target(each.operation)}`")
    return names


def tables() -> str:
    """The sections with the tables, in Markdown."""
    services: dict[str, list[Operation]] = {}
    for operation in operations():
        services.setdefault(operation.service, []).append(operation)
    second = second_names()
    lines = [
        f"{sum(map(len, second.values()))} operations of RWS 2.0 are answered as {len(second)} of these.",
        "",
        "| Service | Operations | Answered | Refused | Not there | In RWS 2.0 |",
        "|---|--:|--:|--:|--:|--:|",
    ]
    ordered = sorted(services.items())
    lines += [f"| [{name}](#{name}) | {_counts(each, second)} |" for name, each in ordered]
    every = [operation for _, each in ordered for operation in each]
    lines.append(f"| All | {_counts(every, second)} |")
    for name, each in ordered:
        lines += [
            "",
            f"## {name}",
            "",
            "| Operation | In the URL | In the body | Status | Mastership | Grant | RWS 2.0 |",
        ]
        lines.append("|---|---|---|--:|---|---|---|")
        lines += [_line(operation, second.get(_key(operation), [])) for operation in each]
    return "\n".join(lines) + "\n"


def _counts(each: Sequence[Operation], second: Mapping[tuple[str, ...], list[str]]) -> str:
    absent = sum(bool(operation.lacks) for operation in each)
    refused = sum(operation.success >= 400 for operation in each) - absent
    named = sum(_key(operation) in second for operation in each)
    return f"{len(each)} | {len(each) - absent - refused} | {refused} | {absent} | {named}"


def _target(operation: Operation) -> str:
    path = re.sub(r":[^{}]*(\{[^{}]*\})?[^{}]*\}", "}", operation.path)
    marks = [f"{name}={text}" for name in ("action", "resource") if (text := getattr(operation, name))]
    return f"{operation.method} {path}{'?' if marks else ''}{'&'.join(marks)}"


def _line(operation: Operation, second: Sequence[str]) -> str:
    mastership = ""
    if operation.needs_mastership or operation.respects_mastership:
        letter = "M" if operation.needs_mastership else "m"
        mastership = f"{letter} {operation.needs_mastership or operation.respects_mastership}"
    status = f"{operation.success}: {operation.lacks}" if operation.lacks else str(operation.success)
    grant = "" if operation.needs_grant is None else f"`{operation.needs_grant.value}`"
    parameters = (_parameters(operation.query), _parameters(operation.values))
    cells = (f"`{_target(operation)}`", *parameters, status, mastership, grant, ", ".join(second))
    return f"| {' | '.join(cells)} |".replace("|  |", "| |").replace("|  |", "| |")


def _parameters(values: Values) -> str:
    texts = (f"{name}={_OR.join(allowed)}" if allowed else name for name, allowed in values.items())
    return ", ".join(f"`{text}`" for text in texts)


if __name__ == "__main__":
    sys.stdout.write(tables())
