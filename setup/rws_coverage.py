"""Writes docs/reference/rws-coverage.md: every operation of the virtual controller's Robot Web Services.

    .venv/bin/python setup/rws_coverage.py

The page is the table that directs the controller's requests, so that it states what the controller does.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from yumi.virtual.rws.operations import Operation, Values
from yumi.virtual.rws.service import RwsService
from yumi.virtual.rws.version_2 import RwsService2
from yumi.virtual.world import World

PAGE = Path(__file__).resolve().parent.parent / "docs" / "reference" / "rws-coverage.md"

_OR = "\\|"  # in a cell of a table

_HEAD = """# Operations of the virtual controller's Robot Web Services

<!-- Written by setup/rws_coverage.py; edit the table in src/yumi/virtual/rws instead. -->

What `yumi controller` answers, as a controller with RobotWare 6.09 and no extra hardware does. Each line is an entry of
the [table that directs its requests](../explanation/decisions/0038-table-of-web-services.md); a
[test](../../tests/unit/virtual/rws/test_virtual_rws_coverage.py) sends each once for XHTML and once for JSON. Every
resource also has `?action=show`, the forms of its actions, and takes `json=1`.

Beside the status of success there are 400 for a value or state that does not fit, 401 without login, 403 for what the
mode, a missing grant, another client's mastership or the state forbids, 404 for what is not there, 405 for another
method, 409 for what is taken, 415 for a body that is no form, 503 while the controller is busy or has 70 sessions, and
507 when its limits are reached. An operation whose status is 400 or 403 is known and always refused, with the reason.
*M* means that the mastership of a domain is needed, *m* that no other client may hold it. `a|b` are the values that a
parameter may have. Without its grant (ABB: User Authorization System) an operation is refused with 403 and code
-1073445867; a reduction of the speed needs its grant only from 100 % in automatic mode; `bstart` needs `UAS_RESTORE`,
and `istart`, `pstart` and `xstart` need `UAS_SYSTEM_ADMINISTRATION`.

*RWS 2.0* is what `yumi controller --robotware 7` calls the operation: *same* where method and path are the same,
nothing where it has none; {second} operations of 2.0 are answered as {first} of these
([what differs](virtual-controller.md#robotware-7)).
"""


def operations() -> tuple[Operation, ...]:
    """The table."""
    return RwsService(World().controller, user="", password="").operations


def _key(operation: Operation) -> tuple[str, ...]:
    return operation.method, operation.path, operation.action or "", operation.resource or ""


def second_names() -> dict[tuple[str, ...], list[str]]:
    """What RWS 2.0 calls each operation that it has."""
    names: dict[tuple[str, ...], list[str]] = {}
    for each in RwsService2(World().controller, user="", password="").translations:
        is_same = _target(each.operation) == _target(each.rws1)
        names.setdefault(_key(each.rws1), []).append("same" if is_same else f"`{_target(each.operation)}`")
    return names


def page() -> str:
    """The page of the table."""
    services: dict[str, list[Operation]] = {}
    for operation in operations():
        services.setdefault(operation.service, []).append(operation)
    second = second_names()
    introduction = _HEAD.format(second=sum(map(len, second.values())), first=len(second))
    lines = [
        introduction,
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
    PAGE.write_text(page(), encoding="utf-8")
