from __future__ import annotations

import pytest

from virtual_irc5.rws.http import IDLE_SESSION_LIFE, MAX_SESSIONS, SessionTable, TooManySessions


@pytest.fixture
def table() -> SessionTable:
    return SessionTable(make_id=lambda: "5ed62c3908feb133b8a771f64e631c5a")


def sent_back(lines: tuple[str, ...]) -> dict[str, str]:
    return dict(line.partition(";")[0].split("=", 1) for line in lines)


def test_new_session_sets_session_cookie_then_connection_cookie(table: SessionTable) -> None:
    assert table.touch(table.open(0.0), "peer", 0.0) == (
        "-http-session-=1::http.session::5ed62c3908feb133b8a771f64e631c5a; path=/; httponly",
        "ABBCX=1507337; path=/; httponly",
    )


def test_session_is_found_by_its_cookie(table: SessionTable) -> None:
    session = table.open(0.0)
    assert table.find(sent_back(table.touch(session, "peer", 0.0)), now=1.0) is session


def test_session_is_not_found_without_its_cookie(table: SessionTable) -> None:
    table.open(0.0)
    assert table.find({}, now=1.0) is None


def test_known_connection_gets_no_cookie_again(table: SessionTable) -> None:
    session = table.open(0.0)
    table.touch(session, "peer", 0.0)
    assert table.touch(session, "peer", 1.0) == ()


def test_other_connection_gets_a_new_connection_cookie_only(table: SessionTable) -> None:
    session = table.open(0.0)
    table.touch(session, "peer", 0.0)
    assert table.touch(session, "other peer", 1.0) == ("ABBCX=1507338; path=/; httponly",)


def test_session_is_found_by_connection_cookie(table: SessionTable) -> None:
    session = table.open(0.0)
    table.touch(session, "peer", 0.0)
    assert table.find_by_connection({"ABBCX": "1507337"}) is session
    assert table.find_by_connection({}) is None


def test_session_lives_while_it_is_used(table: SessionTable) -> None:
    session = table.open(0.0)
    cookie = sent_back(table.touch(session, "peer", 0.0))
    for time in (IDLE_SESSION_LIFE, 2 * IDLE_SESSION_LIFE):
        assert table.find(cookie, time) is session
        table.touch(session, "peer", time)


def test_session_is_forgotten_when_idle_for_five_minutes(table: SessionTable) -> None:
    cookie = sent_back(table.touch(table.open(0.0), "peer", 0.0))
    assert table.find(cookie, now=IDLE_SESSION_LIFE + 0.1) is None
    assert len(table) == 0


def test_closed_session_is_forgotten(table: SessionTable) -> None:
    session = table.open(0.0)
    cookie = sent_back(table.touch(session, "peer", 0.0))
    table.close(session)
    assert table.find(cookie, now=0.0) is None


def test_seventy_first_session_is_refused(table: SessionTable) -> None:
    for _ in range(MAX_SESSIONS):
        table.open(0.0)
    with pytest.raises(TooManySessions, match="Too many sessions 70/70"):
        table.open(1.0)


def test_idle_session_makes_room_for_another(table: SessionTable) -> None:
    for _ in range(MAX_SESSIONS):
        table.open(0.0)
    assert table.open(IDLE_SESSION_LIFE + 0.1).id.startswith("71::")


def test_connections_of_a_session_do_not_pile_up(table: SessionTable) -> None:
    session = table.open(0.0)
    for number in range(100):
        table.touch(session, f"peer {number}", 0.0)
    assert len(session.connections) == 16
