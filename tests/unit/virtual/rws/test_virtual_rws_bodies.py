"""Bodies field by field: names, spelling and order are those that ABB's manual and captures of live controllers have.

The list was taken over by hand from the collected facts on Robot Web Services 1.0; a field that a controller has
beyond it stands in ``MORE``.
"""

from __future__ import annotations

import json

import pytest

from abb_protocols.rws.documents import read_page
from rws_examples import EXAMPLES, Example, Session

FRAME = "x y z q1 q2 q3 q4"
EXTERNAL = "eax_a eax_b eax_c eax_d eax_e eax_f"
SIGNAL = "name type category lvalue lstate"
STATIC = "task-name type axes axes-total is-integrated-unit has-integrated-unit"
DYNAMIC = "tool-name wobj-name payload-name total-payload-name status mode jog-mode coord-system"
TASK = "name type taskstate excstate active motiontask"
MESSAGE = "msgtype code src-name tstamp argc title desc conseqs causes actions"

FIELDS = """
GET / | srvlst-service-li |
GET /rw | rwservice-li |
GET /ctrl | ctrl-identity-info-li | ctrl-name ctrl-id ctrl-type
GET /ctrl/identity | ctrl-identity-info | ctrl-name ctrl-id ctrl-type ctrl-mac ctrl-level
GET /ctrl/clock | ctrl-clock-info | datetime
GET /ctrl/network | ctrl-netw | addr mask name
GET /progress/{job} | progress | code state
GET /rw/system | sys-system-li | major minor build revision sub-revision buildtag robapi-compatibility-revision title \
type description date mctimestamp name rwversion sysid starttm rwversionname
GET /rw/system/options | sys-options-li/sys-option-li | option
GET /rw/system/robottype | sys-robottype | robot-type
GET /rw/retcode | err-desc-li | name code severity description
GET /rw/panel | pnl-ctrlstate-li |
GET /rw/panel | pnl-opmode-li |
GET /rw/panel | pnl-speedratio-li |
GET /rw/panel | pnl-coldetstate-li |
GET /rw/panel/ctrlstate | pnl-ctrlstate | ctrlstate
GET /rw/panel/opmode | pnl-opmode | opmode
GET /rw/panel/speedratio | pnl-speedratio | speedratio
GET /rw/panel/coldetstate | pnl-coldetstate | coldetstate_
GET /rw/rapid/execution | rap-execution | ctrlexecstate cycle
GET /rw/rapid/tasks | rap-task-li | {TASK}
GET /rw/rapid/tasks/T_ROB_L | rap-task | {TASK} tasktype trust taskID execlevel execmode exectype prodentrypt \
bind_ref task_in_forgnd
GET /rw/rapid/tasks/T_ROB_L/program | rap-program | name entrypoint
GET /rw/rapid/tasks/T_ROB_L/pcp | pcp-info | beginposition endposition modulemame routinename changecount executiontype
GET /rw/rapid/tasks/T_ROB_L/serviceroutine | rap-task-routine | routine-name url-to-routine
GET /rw/rapid/modules?task=T_ROB_L | rap-module-info-li | name type
GET /rw/rapid/modules/TRobMain?task=T_ROB_L | rap-module | modname filename attribute
GET /rw/rapid/modules/TRobMain?resource=module-text | rap-module-text | change-count module-text module-length
GET /rw/rapid/symbol/data/RAPID/T_ROB_L/TRobMain/current_state | rap-data | value
GET /rw/rapid/symbol/properties/RAPID/T_ROB_L/TRobMain/current_state | rap-sympropvar | symburl name symtyp named \
dattyp ndim dim heap linked local rdonly taskvar storage typurl
POST /rw/rapid/symbols?action=search-symbols | rap-symproppers-li | name symburl symtyp named dattyp ndim dim local \
rdonly taskpers typurl
GET /rw/rapid/uiinstr/active | rap-uiactive-li | instr event stack execlv msg
GET /rw/iosystem | ios-networks-li |
GET /rw/iosystem | ios-devices-li |
GET /rw/iosystem | ios-signals-li |
GET /rw/iosystem/networks | ios-network-li | name pstate lstate
GET /rw/iosystem/devices | ios-device-li | name lstate pstate address
GET /rw/iosystem/signals | ios-signal-li | {SIGNAL}
GET /rw/iosystem/signals/DeviceNet/D652_10/custom_DO_0 | ios-signal | {SIGNAL} unitnm phstate pvalue ltime-sec \
ltime-microsec ptime-sec ptime-microsec quality
GET /rw/motionsystem | ms | change-count mechunit-name poll-rate modal-payload-mode absacc-active
GET /rw/motionsystem | ms-change-count-li |
GET /rw/motionsystem | ms-mechunit-li |
GET /rw/motionsystem | ms-errorstate-li |
GET /rw/motionsystem | ms-motionsupervision-li |
GET /rw/motionsystem | ms-pathsupervision-li |
GET /rw/motionsystem | ms-nonmotion-execution-mode-li |
GET /rw/motionsystem/mechunits | ms-mechunit-li | mode activation-allowed drive-module
GET /rw/motionsystem/mechunits/ROB_L | ms-mechunit | {STATIC} {DYNAMIC}
GET /rw/motionsystem/mechunits/ROB_L?resource=lead-through | ms-mechunit-complianceleadthrough | status
GET /rw/motionsystem/mechunits/ROB_L/jointtarget | ms-jointtarget | rax_1 rax_2 rax_3 rax_4 rax_5 rax_6 {EXTERNAL}
GET /rw/motionsystem/mechunits/ROB_L/robtarget | ms-robtargets | {FRAME} cf1 cf4 cf6 cfx {EXTERNAL}
GET /rw/motionsystem/mechunits/ROB_L/cartesian | ms-mechunit-cartesian | {FRAME} j1 j4 j6 jx
GET /rw/motionsystem/mechunits/ROB_L/baseframe | ms-mechunit-baseframe | {FRAME}
GET /rw/motionsystem/mechunits/ROB_L/axes | ms-mechunit-axes | axes
GET /rw/motionsystem/errorstate | ms-errorstate | err-state err-count
GET /rw/cfg | cfg-domain-li |
GET /rw/cfg/eio | cfg-dt-li |
GET /rw/cfg/SIO/COM_TRP/attributes | cfg-dt-attribute-li | name type numbers mini max init mandatory
GET /rw/cfg/SIO/COM_TRP/instances | cfg-dt-instance-li | rdonly instanceid
GET /rw/cfg/SIO/COM_TRP/instances | cfg-dt-instance-li/cfg-ia-t-li | value
GET /rw/mastership | msh-resource-li |
GET /rw/mastership/rapid | msh-resource | uid location alias application mastership mastershipheldbyme
GET /users/rmmp | user-rmmp | userid alias location application privilege rmmpheldbyme
GET /users/rmmp/poll | user-rmmp-poll | code status
GET /fileservice/$home | fs-dir | fs-cdate fs-mdate
GET /fileservice/$home | fs-file | fs-cdate fs-mdate fs-size fs-readonly
GET /rw/elog | elog-domain-li | domain-name numevts buffsize
GET /rw/elog/0 | elog-message-li | {MESSAGE}
GET /rw/elog/0/{event} | elog-message | {MESSAGE}
GET /rw/dipc | dipc-info-li | max-body-size max-pkg-size
GET /rw/dipc | dipc-queue-li |
GET /rw/dipc/q/?action=dipc-read | dipc-read-li | dipc-data dipc-userdef dipc-msgtype dipc-cmd queue-name
"""

MORE = {
    "rap-task-routine": {"service-routine"},
    "ctrl-netw": {"dhcp", "gateway"},
    "dipc-read-li": {"queue-size", "queue-sid", "queue-did"},
}

JSON_NAMES = {
    **{f"eax_{letter}": f"eax{letter}" for letter in "abcdef"},
    "task-name": "task",
    "is-integrated-unit": "is-integrated-unitname",
    "has-integrated-unit": "has-integrated-unitname",
}
"""Where JSON deviates, in these two types only."""

EVENTS = """
/rw/iosystem/signals/custom_DO_0;state | ios-signalstate-ev | lvalue lstate
/rw/rapid/symbol/data/RAPID/T_ROB_L/TRobEGM/egm_tool;value | rap-value-ev |
/rw/panel/ctrlstate | pnl-ctrlstate-ev | ctrlstate
/rw/panel/opmode | pnl-opmode-ev | opmode
/rw/panel/speedratio | pnl-speedratio-ev | speedratio
/rw/panel/coldetstate | pnl-coldetstate-ev | coldetstate
/rw/rapid/execution;ctrlexecstate | rap-ctrlexecstate-ev | ctrlexecstate
/rw/rapid/execution;rapidexeccycle | rap-execcycle-ev | rapidexeccycle
/rw/rapid/execution;hdtrun | rap-hdtr-ev | hdtr-State
/rw/rapid/tasks/T_ROB_L;excstate | rap-execstate-ev | pgmtaskexec-state
/rw/rapid/tasks/T_ROB_L/pcp;programpointerchange | rap-pp-ev | module-name routine-name BegPosLine BegPosCol \
EndPosLine EndPosCol
/rw/elog/0 | elog-message-ev | seqnum
/rw/cfg | cfg-prop-ev | cc
"""


def lines(text: str) -> list[tuple[str, str, tuple[str, ...]]]:
    words = {"TASK": TASK, "SIGNAL": SIGNAL, "STATIC": STATIC, "DYNAMIC": DYNAMIC, "EXTERNAL": EXTERNAL}
    words |= {"FRAME": FRAME, "MESSAGE": MESSAGE}
    for name, value in words.items():
        text = text.replace(f"{{{name}}}", value)
    found = []
    for line in text.strip().splitlines():
        where, kind, fields = (part.strip() for part in line.split("|"))
        names = tuple(name.replace("coldetstate_", "coldetstate ") for name in fields.split())
        found.append((where, kind, names))
    return found


def example(where: str) -> Example:
    method, _, target = where.partition(" ")
    path, _, query = target.partition("?")
    fitting = [
        each
        for each in EXAMPLES
        if each.method == method
        and each.target.partition("?")[0].rstrip("/") == path.rstrip("/")
        and all(part in each.target for part in query.split("&"))
    ]
    return next((each for each in fitting if each.target == target), fitting[0])


@pytest.fixture(scope="module")
def session() -> Session:
    return Session()


@pytest.mark.parametrize(("where", "kind", "fields"), lines(FIELDS), ids=lambda each: str(each) if each else "")
def test_body_has_each_field_in_its_spelling_and_order(
    session: Session, where: str, kind: str, fields: tuple[str, ...]
) -> None:
    outer, _, inner = kind.partition("/")
    if inner.startswith("dipc") or outer == "dipc-read-li":
        session.reset()
        session.ask("POST", "/rw/dipc?action=dipc-create", "dipc-queue-name=q&dipc-queue-size=5&dipc-max-msg-size=444")
        form = "dipc-src-queue-name=q&dipc-cmd=1&dipc-userdef=1&dipc-msgtype=1&dipc-data=num;1"
        session.ask("POST", "/rw/dipc/q?action=dipc-send", form)
        xhtml = session.ask("GET", "/rw/dipc/q/?action=dipc-read&timeout=0")
        session.ask("POST", "/rw/dipc/q?action=dipc-send", form)
        data = session.ask("GET", "/rw/dipc/q/?action=dipc-read&timeout=0&json=1")
    else:
        xhtml, data = example(where).send(session), example(where).send(session, "json")
    page = read_page(xhtml.header("Content-Type") or "", xhtml.body)
    states = [state for state in page.states if state.type == outer]
    if inner:
        states = [child for state in states for child in state.children if child.type == inner]
    assert states
    for state in states:
        assert tuple(state.fields)[: len(fields)] == fields
        assert set(state.fields) - set(fields) <= MORE.get(kind, set())
    if inner:
        return
    names = fields
    if kind in ("ms-robtargets", "ms-mechunit"):
        names = tuple(JSON_NAMES.get(name, name) for name in fields)
    known = kind.replace("elog-message-li", "elog-message")
    for entry in json.loads(data.body)["_embedded"]["_state"]:
        if entry["_type"] == known:
            shown = tuple(name for name, value in entry.items() if name[0] != "_" and not isinstance(value, list))
            assert shown[: len(names)] == names


@pytest.mark.parametrize(("path", "kind", "fields"), lines(EVENTS), ids=lambda each: str(each) if each else "")
def test_event_has_each_field_in_its_spelling_and_order(
    session: Session, path: str, kind: str, fields: tuple[str, ...]
) -> None:
    session.controller.replace_program({})
    session.reset()
    session.controller.events.append(10010, "Motors OFF")
    reply = session.ask("POST", "/subscription", f"resources=1&1={path}&1-p=1")
    assert reply.status == 201, reply.body
    states = read_page("application/xhtml+xml", reply.body).states
    first = states[0]
    assert (first.type, tuple(first.fields)) == (kind, fields)
    assert [link.rel for link in first.links] == ["self"]
