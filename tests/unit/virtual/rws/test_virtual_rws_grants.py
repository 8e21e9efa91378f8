"""What a user is not granted is refused, and nothing else."""

from __future__ import annotations

import json

import pytest

from abb_protocols.rws.documents import read_page, read_status
from abb_protocols.rws.values import GRANTS, Grant, RwsCode
from rws_examples import EXAMPLES, Example, Session, content_type, operation_of

SPEED = Example("POST", "/rw/panel/speedratio?action=setspeedratio", "speed-ratio=50")


@pytest.fixture(scope="module")
def session() -> Session:
    return Session()


def without(*missing: Grant) -> list[Grant]:
    return [each for each in GRANTS if each not in missing]


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda each: f"{each.method} {each.target}")
def test_operation_needs_its_grant_and_no_other(session: Session, example: Example) -> None:
    operation = operation_of(session, example)
    needed = operation.needs_grant
    if needed is Grant.REMOTE_WARMSTART and "restart-mode=restart" not in example.form:
        needed = None
    if needed is None:
        assert example.send(session, granted=()).status == operation.success
        return
    assert example.send(session, granted=[needed]).status == operation.success
    assert example.send(session, granted=[Grant.FULL_ACCESS]).status == operation.success
    xhtml, data = (example.send(session, form, without(needed)) for form in ("", "json"))
    assert (xhtml.status, data.status) == (403, 403)
    if example.method != "HEAD":
        assert read_status(content_type(xhtml), xhtml.body).code == RwsCode.UAS_REJECT
        status = json.loads(data.body)["_embedded"]["status"]
        assert status["code"] == RwsCode.UAS_REJECT
        assert f"the user lacks the grant {needed.value}" in status["msg"]


@pytest.mark.parametrize(
    ("mode", "needed"),
    [
        ("restart", Grant.REMOTE_WARMSTART),
        ("bstart", Grant.RESTORE),
        ("istart", Grant.SYSTEM_ADMINISTRATION),
        ("pstart", Grant.SYSTEM_ADMINISTRATION),
    ],
)
def test_restart_needs_the_grant_of_its_mode(session: Session, mode: str, needed: Grant) -> None:
    example = Example("POST", "/ctrl", f"restart-mode={mode}")
    assert example.send(session, granted=without(needed)).status == 403
    assert not session.controller.is_restarting
    assert example.send(session, granted=[needed]).status != 403


def test_only_a_decrease_of_full_speed_in_automatic_mode_needs_a_grant(session: Session) -> None:
    session.reset()
    session.controller.speed_ratio = 100
    assert SPEED.send(session, granted=()).status == 403
    assert session.controller.speed_ratio == 100
    session.controller.speed_ratio = 80
    assert SPEED.send(session, granted=()).status == 204
    session.controller.speed_ratio = 100


def test_stop_needs_no_grant(session: Session) -> None:
    stop = Example("POST", "/rw/rapid/execution?action=stop", "stopmode=stop&usetsp=normal", ("running",))
    assert stop.send(session, granted=()).status == 204
    assert not session.controller.is_running


def test_grants_are_shown_as_they_are_enforced(session: Session) -> None:
    reply = Example("GET", "/users/grants").send(session, granted=[Grant.IO_WRITE, Grant.BACKUP])
    page = read_page(content_type(reply), reply.body)
    assert [state.title for state in page.states] == ["UAS_BACKUP", "UAS_IO_WRITE"]


def test_event_log_is_written_to_a_file_by_who_may_write_files(session: Session) -> None:
    example = Example("POST", "/rw/elog?action=saveraw", "path=$TEMP/log.txt")
    assert example.send(session, granted=without(Grant.FTP_WRITE)).status == 403
