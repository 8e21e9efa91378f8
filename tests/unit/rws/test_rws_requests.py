from __future__ import annotations

import pytest

from yumi.rws import requests
from yumi.rws.requests import Request
from yumi.rws.types import ControllerState


@pytest.mark.parametrize(
    ("request_", "line", "body"),
    [
        (requests.get_controller_state(), "GET /rw/panel/ctrlstate", b""),
        (
            requests.set_controller_state(ControllerState.MOTORS_ON),
            "POST /rw/panel/ctrlstate?action=setctrlstate",
            b"ctrl-state=motoron",
        ),
        (requests.get_modules("T_ROB_R"), "GET /rw/rapid/modules?task=T_ROB_R", b""),
        (requests.move_pp_to_main(), "POST /rw/rapid/execution?action=resetpp", b""),
        (
            requests.start_rapid(),
            "POST /rw/rapid/execution?action=start",
            b"regain=continue&execmode=continue&cycle=forever&condition=none&stopatbp=disabled&alltaskbytsp=false",
        ),
        (
            requests.set_symbol("T_ROB_L", "TRobRAPID", "routine_name_input", '"run me"'),
            "POST /rw/rapid/symbol/data/RAPID/T_ROB_L/TRobRAPID/routine_name_input?action=set",
            b"value=%22run%20me%22",
        ),
        (requests.set_signal("EGM_STOP", 1), "POST /rw/iosystem/signals/EGM_STOP?action=set", b"lvalue=1"),
        (requests.set_signal("AO_1", 2.5), "POST /rw/iosystem/signals/AO_1?action=set", b"lvalue=2.5"),
        (requests.get_symbol("T", "M", "a{1}"), "GET /rw/rapid/symbol/data/RAPID/T/M/a%7B1%7D", b""),
        (requests.get("/fileservice/$home/ä b"), "GET /fileservice/$home/%C3%A4%20b", b""),
        (
            requests.get_events(0, 20),
            "GET /rw/elog/0?lang=en&order=lifo&start=1&limit=20",
            b"",
        ),
    ],
)
def test_request_is_what_the_controller_expects(request_: Request, line: str, body: bytes) -> None:
    assert f"{request_.method} {request_.target}" == line
    assert request_.body == body


def test_only_reading_is_repeatable() -> None:
    assert requests.get_tasks().is_repeatable
    assert not requests.start_rapid().is_repeatable
