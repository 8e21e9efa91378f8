"""The table of operations, and how a call finds its line."""

from __future__ import annotations

from collections import Counter

import pytest

from yumi.virtual.controller.irc5 import Irc5
from yumi.virtual.rws.operations import Call, Failure, Operation, Router
from yumi.virtual.rws.service import OPERATIONS


def nothing(controller: Irc5, call: Call) -> None: ...


ROUTER = Router(
    [
        Operation("GET", "/rw/thing", nothing),
        Operation("GET", "/rw/thing", nothing, resource="part"),
        Operation("POST", "/rw/thing", nothing, "start", {"mode": ("slow", "fast")}),
        Operation("POST", "/rw/thing", nothing, "stop"),
        Operation("GET", "/rw/thing/{name}", nothing),
        Operation("GET", "/rw/thing/{name}/parts/{part:.+}", nothing),
    ]
)


def found(method: str, path: str, action: str | None = None, resource: str | None = None) -> tuple[Operation, Call]:
    given = {"action": action, "resource": resource}
    query = tuple((name, value) for name, value in given.items() if value is not None)
    return ROUTER.find(Call(method, tuple(part for part in path.split("/") if part), query))


def test_operations_of_one_path_differ_in_their_action() -> None:
    assert [found("POST", "/rw/thing", action)[0].action for action in ("start", "stop")] == ["start", "stop"]


@pytest.mark.parametrize(
    ("path", "names"),
    [
        ("/rw/thing", {}),
        ("/rw/thing/a b%", {"name": "a b%"}),
        ("/rw/thing/x/parts/y", {"name": "x", "part": "y"}),
        ("/rw/thing/x/parts/y/../S{1},2?#", {"name": "x", "part": "y/../S{1},2?#"}),
    ],
)
def test_placeholders_have_the_text_of_the_path(path: str, names: dict[str, str]) -> None:
    assert dict(found("GET", path)[1].names) == names


@pytest.mark.parametrize(
    ("method", "path", "action", "status", "sentence"),
    [
        ("GET", "/rw/other", None, 404, "there is no resource /rw/other"),
        ("GET", "/rw/thing/x/parts", None, 404, "there is no resource /rw/thing/x/parts"),
        ("PUT", "/rw/thing", None, 405, "PUT is not possible on /rw/thing"),
        ("HEAD", "/rw/thing", None, 405, "HEAD is not possible on /rw/thing"),
        ("POST", "/rw/thing", None, 400, "/rw/thing needs an action"),
        ("POST", "/rw/thing", "jump", 400, "/rw/thing does not have the action 'jump'"),
    ],
)
def test_call_without_an_operation_is_refused(
    method: str, path: str, action: str | None, status: int, sentence: str
) -> None:
    with pytest.raises(Failure, match=sentence) as failure:
        found(method, path, action)
    assert failure.value.status == status


def test_parameter_outside_its_values_is_refused() -> None:
    operation, call = found("POST", "/rw/thing", "start")
    operation.check_values(call)
    with pytest.raises(Failure, match="mode is slow or fast, not 'wild'"):
        operation.check_values(Call("POST", call.path, form=(("mode", "wild"),)))


def test_every_operation_is_in_the_table_once() -> None:
    counts = Counter((each.method, each.path, each.action, each.resource) for each in OPERATIONS)
    assert [key for key, count in counts.items() if count > 1] == []


def test_operations_of_one_path_differ_in_their_resource() -> None:
    assert found("GET", "/rw/thing", resource="part")[0].resource == "part"
    assert found("GET", "/rw/thing")[0].resource is None
    with pytest.raises(Failure, match="/rw/thing does not have the resource 'other'"):
        found("GET", "/rw/thing", resource="other")


def test_action_of_a_request_that_changes_nothing_is_ignored() -> None:
    assert found("GET", "/rw/thing", "unknown")[0].action is None


def test_operations_of_a_path_are_those_of_its_forms() -> None:
    actions = ROUTER.actions(Call("GET", ("rw", "thing")))
    assert [each.action for each in actions] == ["start", "stop"]
