from __future__ import annotations

from math import degrees

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import ControllerRefused, ProtocolError
from abb_protocols.rws import documents
from abb_protocols.rws.documents import Form, Page, RwsState, Status
from abb_protocols.rws.operations import event_log, io, motion, panel, rapid, symbols, system
from abb_protocols.rws.operations.event_log import RwsEvent
from abb_protocols.rws.operations.io import RwsSignal
from abb_protocols.rws.operations.rapid import TaskInfo
from abb_protocols.rws.operations.system import SystemInfo
from abb_protocols.rws.values import EventType, OperatingMode, RwsCode, SignalType, TaskExecution
from refusals import assert_says, refused
from virtual_irc5.rws.render import write_status

JOINTS = {f"rax_{axis}": str(10 * axis) for axis in range(1, 7)}
EXTERNAL = {"eax_a": "-135"} | {f"eax_{letter}": "8.999999e+009" for letter in "bcdef"}
TASK = {"name": "T_ROB_R", "excstate": "star", "active": "On", "motiontask": "TRUE"}


def page(kind: str, **fields: str) -> Page:
    return Page("", "", (RwsState(kind, "/rw/elog/0/18", fields),))


def refusal(status: Status) -> ControllerRefused:
    body = write_status(status, Form.XHTML, base="")
    return documents.refusal("yumi", "writing signal x", 403, Form.XHTML.value, body)


def test_system_has_name_version_and_options() -> None:
    options = RwsState("sys-options-li", "options", {}, (), (RwsState("sys-option-li", "0", {"option": "English"}),))
    shown = RwsState("sys-system-li", "system", {"name": "YuMi", "rwversionname": "6.13.00.00"})
    assert system.read_system(Page("", "", (shown, options))) == SystemInfo("YuMi", (6, 13, 0, 0), ("English",))


def test_version_without_numbers_is_refused() -> None:
    with refused(ProtocolError, "version_not_numbers", version="six"):
        system.read_system(page("sys-system-li", name="YuMi", rwversionname="six"))


def test_operating_mode_is_read() -> None:
    assert panel.OPERATING_MODE.answered.of(page("pnl-opmode", opmode="MANR")) is OperatingMode.MANUAL_REDUCED


def test_unknown_word_is_refused_with_the_known_ones() -> None:
    allowed = tuple(mode.value for mode in OperatingMode)
    with refused(ProtocolError, "word_without_meaning", word="FAST", allowed=allowed):
        panel.OPERATING_MODE.answered.of(page("pnl-opmode", opmode="FAST"))


def test_task_is_read() -> None:
    task = TaskInfo(name="T_ROB_R", execution=TaskExecution.STARTED, is_active=True, is_motion_task=True)
    assert rapid.TASKS.answered.of(page("rap-task-li", **TASK)) == task


def test_task_state_is_read_when_spelled_in_full() -> None:
    task = rapid.TASKS.answered.of(page("rap-task-li", **TASK | {"excstate": "stopped"}))
    assert task.execution is TaskExecution.STOPPED


def test_signal_is_read() -> None:
    fields = {"name": "hand_ActualPosition_R", "type": "GI", "lvalue": "250"}
    expected = RwsSignal("hand_ActualPosition_R", SignalType.GROUP_INPUT, 250.0)
    assert io.signal_of(page("ios-signal", **fields).first) == expected


def test_value_that_is_no_number_is_refused() -> None:
    with refused(ProtocolError, "field_no_number", field="lvalue", text="high"):
        io.signal_of(page("ios-signal", name="x", type="DI", lvalue="high").first)


def test_signal_that_makes_no_sense_is_left_out_of_all() -> None:
    states = (
        RwsState("ios-signal-li", "a", {"name": "a", "lvalue": "2"}),
        RwsState("ios-signal-li", "b", {"name": "b"}),
    )
    assert io.read_signals(states) == {"a": 2.0}


def test_joint_target_comes_out_in_chain_order() -> None:
    target = motion.POSITION_AS_JOINTTARGET.answered.of(page("ms-jointtarget", **JOINTS, **EXTERNAL))
    assert [round(degrees(angle)) for angle in target.chain()] == [10, 20, -135, 30, 40, 50, 60]
    assert target.extax_deg == (-135.0, None, None, None, None, None)


def test_joint_target_of_a_six_axis_robot_is_no_arm() -> None:
    six_axes = EXTERNAL | {"eax_a": "9E+09"}
    with refused(ProtocolError, "unit_without_seventh_axis"):
        motion.POSITION_AS_JOINTTARGET.answered.of(page("ms-jointtarget", **JOINTS, **six_axes)).chain()


@pytest.mark.parametrize("kind", ["elog-message-li", "elog-message"])
def test_event_is_read(kind: str) -> None:
    fields = {"msgtype": "2", "code": "10012", "tstamp": "2026-07-09 T 08:15:30", "title": "Stop", "desc": "It."}
    expected = RwsEvent(18, EventType.WARNING, 10012, "2026-07-09 T 08:15:30", "Stop", "It.")
    assert event_log.read_event(page(kind, **fields).first) == expected


@pytest.mark.parametrize(
    ("weight", "code", "values"),
    [
        ("7", "word_without_meaning", {"word": 7, "allowed": (1, 2, 3)}),
        ("inf", "field_no_whole_number", {"field": "msgtype", "text": "inf"}),
    ],
)
def test_event_of_an_unknown_weight_is_refused(weight: str, code: str, values: dict[str, object]) -> None:
    fields = {"msgtype": weight, "code": "10012", "tstamp": "", "title": "Stop", "desc": "It."}
    with refused(ProtocolError, code, **values):
        event_log.read_event(page("elog-message", **fields).first)


def test_properties_give_the_type_of_any_kind_of_symbol() -> None:
    assert symbols.read_symbol_type(page("rap-symproppers", dattyp="EGMSettings")) == "EGMSettings"


def test_properties_of_nothing_are_refused() -> None:
    with refused(ProtocolError, "answer_without_properties"):
        symbols.read_symbol_type(Page("", ""))


def test_refusal_says_what_a_known_code_means() -> None:
    status = Status(RwsCode.MODE_REJECT, "rws.cpp[1] Mode reject code:-1073445860 icode:-1")
    error = refusal(status)
    assert (error.status, error.code) == (403, RwsCode.MODE_REJECT)
    assert error.said == message(
        "rws_refused",
        address="yumi",
        what="writing signal x",
        reason=message("rws_mode_reject"),
        status=403,
        name="MODE_REJECT -1073445860",
    )


def test_refusal_repeats_the_controllers_words_for_an_unknown_code() -> None:
    said = refusal(Status(-42, "never seen")).said
    assert_says(said, "rws_refused", reason=message("text", text="never seen"), status=403, name="-42")


def test_refusal_without_words_of_the_controller_says_so() -> None:
    assert_says(refusal(Status(-42, "")).said, "rws_refused", reason=message("rws_no_reason"))


@pytest.mark.parametrize("code", RwsCode)
def test_refusal_is_one_sentence_with_what_was_asked_and_abbs_name(code: RwsCode) -> None:
    error = refusal(Status(code, "in the controller's words"))
    assert_says(
        error.said,
        "rws_refused",
        address="yumi",
        what="writing signal x",
        status=403,
        name=f"{code.name} {int(code)}",
    )
    assert str(error) == str(error.said)


def test_refusal_without_a_document_gives_the_status() -> None:
    error = documents.refusal("yumi", "starting RAPID", 500, "text/plain", b"RAPI Unidentified Error")
    assert error.said == message("rws_refused_without_code", address="yumi", what="starting RAPID", status=500)
    assert (error.status, error.code) == (500, None)
