"""Messages between clients of Robot Web Services and RAPID tasks."""

from __future__ import annotations

from abb_protocols.rws.documents import read_page
from rws_examples import Session
from virtual_irc5.rapid.devices import RapidMessage
from virtual_irc5.rws.http import HttpReply

CREATE = "dipc-queue-name=mine&dipc-queue-size=1&dipc-max-msg-size=444"
PROGRAM = """MODULE Sends
    VAR rmqslot slot;
    PROC main()
        RMQFindSlot slot, "mine";
        RMQSendMessage slot, "hello";
    ENDPROC
ENDMODULE
"""
SEND = "dipc-src-queue-name=mine&dipc-cmd=111&dipc-userdef=3&dipc-msgtype=1&dipc-data="


def fields(reply: HttpReply) -> dict[str, str]:
    (state,) = read_page("application/xhtml+xml", reply.body).states
    return dict(state.fields)


def test_client_sends_to_a_task() -> None:
    session = Session()
    session.ask("POST", "/rw/dipc?action=dipc-create", CREATE)
    assert session.ask("POST", "/rw/dipc/RMQ_T_ROB_L?action=dipc-send", SEND + 'string;"hello"').status == 200
    message = session.controller.devices.queues.take("RMQ_T_ROB_L")
    assert message == RapidMessage("string", (), '"hello"', "mine", 3.0)


def test_array_has_its_sizes() -> None:
    session = Session()
    session.ask("POST", "/rw/dipc/RMQ_T_ROB_R?action=dipc-send", SEND + "num{2,3};[[1,2,3],[4,5,6]]")
    message = session.controller.devices.queues.take("RMQ_T_ROB_R")
    assert message is not None
    assert (message.type_name, message.sizes) == ("num", (2, 3))


def test_sixth_message_to_a_task_is_refused() -> None:
    session = Session()
    target = "/rw/dipc/RMQ_T_ROB_L?action=dipc-send"
    assert [session.ask("POST", target, f"{SEND}num;1").status for _ in range(6)] == [200] * 5 + [400]


def test_message_to_a_task_without_a_type_is_refused() -> None:
    assert Session().ask("POST", "/rw/dipc/RMQ_T_ROB_L?action=dipc-send", f"{SEND}hello").status == 400


def test_task_sends_to_a_client() -> None:
    session = Session()
    session.ask("POST", "/rw/dipc?action=dipc-create", CREATE)
    session.controller.devices.queues.send("mine", RapidMessage("num", (2,), "[1,2]", "RMQ_T_ROB_L", 7.0))
    read = fields(session.ask("GET", "/rw/dipc/mine?action=dipc-read&timeout=0"))
    assert (read["dipc-data"], read["dipc-userdef"]) == ("num{2};[1,2]", "7")


def test_queue_ends_with_its_session() -> None:
    session = Session()
    session.ask("POST", "/rw/dipc?action=dipc-create", CREATE)
    assert session.controller.devices.queues.names == ("mine",)
    session.reset()
    assert session.controller.devices.queues.names == ()


def test_program_sends_to_a_client() -> None:
    session = Session()
    session.ask("POST", "/rw/dipc?action=dipc-create", CREATE)
    session.controller.replace_program({"HOME:/sends.mod": PROGRAM})
    session.controller.set_motors(True)
    session.controller.start_rapid("once")
    for _ in range(3):
        session.world.cycle({})
    read = fields(session.ask("GET", "/rw/dipc/mine?action=dipc-read&timeout=0"))
    assert read["dipc-data"] == 'string;"hello"'
