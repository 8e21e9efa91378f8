"""The table of operations, and how a call finds its line."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import pytest

from abb_protocols.rws.operations.operation import Operation, get, post
from virtual_irc5.controller.irc5 import Irc5
from virtual_irc5.rws.router import Route, Router
from virtual_irc5.rws.rws_call import CallFailure, RwsCall
from virtual_irc5.rws.rws_service import ROUTES


def nothing(controller: Irc5, call: RwsCall) -> None: ...


ROUTER = Router(
    Route(each, nothing)
    for each in (
        get("/rw/thing"),
        get("/rw/thing", resource="part"),
        post("/rw/thing", "start", "mode=slow|fast"),
        post("/rw/thing", "stop"),
        get("/rw/thing/{name}"),
        post("/rw/thing/{name}/parts/first"),
        get("/rw/thing/{name}/parts/{part:.+}"),
        get("/rw/thing/{name}/parts/{part:.+}/size"),
        get("/rw/thing/${variable}/shown"),
    )
)


def found(
    method: str, path: str, action: str | None = None, resource: str | None = None
) -> tuple[Operation, Mapping[str, str]]:
    given = {"action": action, "resource": resource}
    query = tuple((name, value) for name, value in given.items() if value is not None)
    route, names = ROUTER.find(method, [part for part in path.split("/") if part], query)
    return route.operation, names


def test_operations_of_one_path_differ_in_their_action() -> None:
    assert [found("POST", "/rw/thing", action)[0].action for action in ("start", "stop")] == ["start", "stop"]


@pytest.mark.parametrize(
    ("path", "names"),
    [
        ("/rw/thing", {}),
        ("/rw/thing/a b%", {"name": "a b%"}),
        ("/rw/thing/x/parts/y", {"name": "x", "part": "y"}),
        ("/rw/thing/x/parts/y/../S{1},2?#", {"name": "x", "part": "y/../S{1},2?#"}),
        ("/rw/thing/x/parts/y/z/size", {"name": "x", "part": "y/z"}),
        ("/rw/thing/x/parts/size", {"name": "x", "part": "size"}),
        ("/rw/thing/x/parts/first", {"name": "x", "part": "first"}),
        ("/rw/thing/$HOME/shown", {"variable": "HOME"}),
    ],
)
def test_placeholders_have_the_text_of_the_path(path: str, names: dict[str, str]) -> None:
    assert found("GET", path)[1] == names


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
    with pytest.raises(CallFailure, match=sentence) as failure:
        found(method, path, action)
    assert failure.value.status == status


def test_parameter_outside_its_values_is_refused() -> None:
    operation, _ = found("POST", "/rw/thing", "start")
    RwsCall("POST", ("rw", "thing"), form=(("mode", "slow"),)).check(operation)
    with pytest.raises(CallFailure, match="mode is slow or fast, not 'wild'"):
        RwsCall("POST", ("rw", "thing"), form=(("mode", "wild"),)).check(operation)


def test_every_operation_is_in_the_table_once() -> None:
    counts = Counter(
        (each.method, each.path, each.action, each.resource) for each in (route.operation for route in ROUTES)
    )
    assert [key for key, count in counts.items() if count > 1] == []


def test_operations_of_one_path_differ_in_their_resource() -> None:
    assert found("GET", "/rw/thing", resource="part")[0].resource == "part"
    assert found("GET", "/rw/thing")[0].resource is None
    with pytest.raises(CallFailure, match="/rw/thing does not have the resource 'other'"):
        found("GET", "/rw/thing", resource="other")


def test_action_of_a_request_that_changes_nothing_is_ignored() -> None:
    assert found("GET", "/rw/thing", "unknown")[0].action is None


def test_operations_of_a_path_are_those_of_its_forms() -> None:
    actions = ROUTER.actions(("rw", "thing"))
    assert [each.action for each in actions] == ["start", "stop"]
