"""Resources in the spelling of ABB's documents and of the clients that read them (reference/rws.md §16-17)."""

from __future__ import annotations

import json
from collections.abc import Iterator
from xml.etree import ElementTree

import httpx
import pytest

from abb_protocols.rws.values import ControllerState, OperatingMode, RwsCode
from contract.rws_bench import PASSWORD, USER, PlainController, serving
from virtual_irc5.controller.file_store import DISK_CAPACITY

FORM = {"Content-Type": "application/x-www-form-urlencoded"}
SYMBOL = "/rw/rapid/symbol/data/RAPID/T_ROB_R"
SIGNALS = "/rw/iosystem/signals"
EXECUTION = "/rw/rapid/execution"


@pytest.fixture
def controller() -> PlainController:
    return PlainController()


@pytest.fixture
def client(controller: PlainController) -> Iterator[httpx.Client]:
    with (
        serving(controller) as address,
        httpx.Client(base_url=f"http://{address}", auth=httpx.DigestAuth(USER, PASSWORD)) as client,
    ):
        yield client


def post(client: httpx.Client, target: str, body: str = "") -> httpx.Response:
    """As ABB's C++ client posts: the body as it is, nothing escaped."""
    return client.post(target, content=body.encode(), headers=FORM)


def texts(response: httpx.Response, name: str) -> list[str]:
    """The texts of class ``name`` that are not empty: how ABB's C++ client searches."""
    assert response.status_code == 200
    assert response.headers["Content-Type"] == "application/xhtml+xml"
    elements = ElementTree.fromstring(response.content).iter()
    return [element.text for element in elements if element.get("class") == name and element.text]


def states(response: httpx.Response) -> list[dict[str, object]]:
    assert response.status_code == 200
    assert response.headers["Content-Type"] == "application/json"
    return json.loads(response.content)["_embedded"]["_state"]  # type: ignore[no-any-return]


def code(response: httpx.Response) -> tuple[int, int]:
    return response.status_code, response.json()["_embedded"]["status"]["code"]


# What abb_librws and abb_egm_rws_managers read before and while they run; an empty text makes them fail.
COLLECTED = {
    "/ctrl": ("ctrl-type",),
    "/rw/system": ("name", "rwversionname", "option"),
    "/rw/panel/ctrlstate": ("ctrlstate",),
    "/rw/panel/opmode": ("opmode",),
    "/rw/panel/speedratio": ("speedratio",),
    EXECUTION: ("ctrlexecstate",),
    "/rw/rapid/tasks": ("name", "motiontask", "active", "excstate"),
    "/rw/rapid/modules?task=T_ROB_L": ("name", "type"),
    "/rw/rapid/symbol/properties/RAPID/T_ROB_R/TRobMain/current_state": ("dattyp",),
    f"{SYMBOL}/TRobMain/current_state": ("value",),
    SIGNALS: ("name", "type", "lvalue", "lstate"),
    f"{SIGNALS}/EGM_START_JOINT": ("lvalue",),
    "/rw/motionsystem/mechunits/ROB_R/jointtarget": (
        *(f"rax_{axis}" for axis in range(1, 7)),
        *(f"eax_{letter}" for letter in "abcdef"),
    ),
    "/rw/cfg/moc/arm/instances": ("value",),
    "/rw/cfg/MOC/JOINT/instances": ("value",),
    "/rw/cfg/moc/robot/instances": ("value",),
    "/rw/cfg/moc/single/instances": ("value",),
    "/rw/cfg/MOC/TRANSMISSION/instances": ("value",),
    "/rw/cfg/moc/mechanical_unit/instances": ("value",),
    "/rw/cfg/sys/mechanical_unit_group/instances": ("value",),
    "/rw/cfg/sys/present_options/instances": ("value",),
    "/rw/elog/0?lang=en": (),
}


@pytest.mark.parametrize("target", COLLECTED)
def test_page_has_all_that_abb_librws_reads(client: httpx.Client, target: str) -> None:
    response = client.get(target)
    assert [name for name in COLLECTED[target] if not texts(response, name)] == []


@pytest.mark.parametrize("unit", ["ROB_R", "ROB_L", "ROB_R_7", "ROB_L_7"])
def test_every_mechanical_unit_has_all_static_and_dynamic_fields(client: httpx.Client, unit: str) -> None:
    static = client.get(f"/rw/motionsystem/mechunits/{unit}?resource=static")
    names = ("task-name", "type", "axes", "axes-total", "is-integrated-unit", "has-integrated-unit")
    assert all(texts(static, name) for name in names)
    dynamic = client.get(f"/rw/motionsystem/mechunits/{unit}?resource=dynamic")
    names = ("tool-name", "wobj-name", "payload-name", "total-payload-name", "status", "mode", "jog-mode")
    assert all(texts(dynamic, name) for name in names)


def test_services_are_found_from_the_root(client: httpx.Client) -> None:
    assert [state["_title"] for state in states(client.get("/?json=1"))] == [
        "ctrl",
        "rw",
        "progress",
        "fileservice",
        "users",
        "subscription",
    ]
    services = [state["_title"] for state in states(client.get("/rw?json=1"))]
    assert all(client.get(f"/rw/{service}").status_code == 200 for service in services)


def test_tasks_are_listed_right_arm_first(client: httpx.Client) -> None:
    assert texts(client.get("/rw/rapid/tasks"), "name") == ["T_ROB_R", "T_ROB_L"]


def test_present_options_have_exactly_number_and_description(client: httpx.Client) -> None:
    values = texts(client.get("/rw/cfg/SYS/PRESENT_OPTIONS/instances"), "value")
    pairs = dict(zip(values[::2], values[1::2], strict=True))
    assert pairs["689-1"] == "Externally Guided Motion (EGM)"
    assert pairs["RobotWare Base"] == "RobotWare Base"


def test_configuration_instance_lists_its_attributes(client: httpx.Client) -> None:
    arm = states(client.get("/rw/cfg/moc/arm/instances/rob_R_1?json=1"))[0]
    attributes = {item["_title"]: item["value"] for item in arm["attrib"]}  # type: ignore[attr-defined]
    assert attributes["upper_joint_bound"] == "2.94088"


@pytest.mark.parametrize("suffix", ["", ";ctrlexecstate", "/", "?json=0", "?continue-on-err=1"])
def test_resource_is_found_by_all_its_spellings(client: httpx.Client, suffix: str) -> None:
    assert texts(client.get(EXECUTION + suffix), "ctrlexecstate") == ["stopped"]


def test_json_links_and_base_lead_back_to_the_server(client: httpx.Client) -> None:
    document = client.get("/rw/rapid/tasks?json=1&json=1").json()
    assert document["_links"]["base"]["href"] == f"{client.base_url}/rw/rapid/".replace("//rw", "/rw")
    first = document["_embedded"]["_state"][0]
    assert first["_links"]["self"]["href"] == "tasks/T_ROB_R?json=1"


def test_signal_is_a_number_in_json(client: httpx.Client) -> None:
    signal = states(client.get(f"{SIGNALS}/hand_ActualPosition_R?json=1"))[0]
    assert (signal["_title"], signal["lvalue"]) == ("EtherNetIP/Hand_R/hand_ActualPosition_R", 250)


def test_signal_is_found_under_any_device(client: httpx.Client) -> None:
    assert texts(client.get(f"{SIGNALS}/Local/DRV_1/EGM_START_JOINT"), "name") == ["EGM_START_JOINT"]


def test_signals_come_in_pages_where_asked_for(client: httpx.Client) -> None:
    first = client.get(f"{SIGNALS}?start=0&limit=3&json=1")
    assert len(states(first)) == 3
    assert first.json()["_links"]["next"]["href"] == "signals?start=3&limit=3&json=1"
    last = client.get("/rw/iosystem/signals?start=3&limit=3&json=1")
    assert len(states(last)) == 1
    assert "next" not in last.json()["_links"]


def test_signal_edge_is_seen_before_the_answer(client: httpx.Client, controller: PlainController) -> None:
    response = post(client, f"{SIGNALS}/EGM_START_JOINT?action=set", "lvalue=1")
    assert (response.status_code, response.content) == (204, b"")
    assert "Content-Type" not in response.headers
    assert controller.edges == [("EGM_START_JOINT", 0.0, 1.0)]
    assert controller.settled == 1


def test_analog_style_write_is_accepted(client: httpx.Client, controller: PlainController) -> None:
    assert post(client, f"{SIGNALS}/hand_MaxSpeed_R?action=set", "mode=value&lvalue=120.0").status_code == 204
    assert controller.signals.get("hand_MaxSpeed_R").value == 120.0


@pytest.mark.parametrize(
    ("body", "literal"),
    [
        ('value="runMoveAbsJ"', '"runMoveAbsJ"'),
        ("value=%22run%20me%22", '"run me"'),
        ("value=[[0,-130,30],[9E+09,1e+06]]", "[[0,-130,30],[9E+09,1e+06]]"),
    ],
)
def test_symbol_is_written_raw_or_escaped(client: httpx.Client, body: str, literal: str) -> None:
    assert post(client, f"{SYMBOL}/TRobSystem/routine_name_input?action=set", body).status_code == 204
    assert texts(client.get(f"{SYMBOL}/TRobSystem/routine_name_input"), "value") == [literal]


def test_symbol_is_found_without_its_module(client: httpx.Client) -> None:
    assert states(client.get(f"{SYMBOL}/routine_name_input?json=1"))[0]["value"] == '""'


@pytest.mark.parametrize(
    ("symbol", "kind"),
    [
        ("TRobMain/current_state", "rap-sympropvar"),
        ("TRobMain/STATE_IDLE", "rap-sympropconstant"),
        ("TRobSystem/routine_name_input", "rap-symproppers"),
    ],
)
def test_properties_have_the_class_of_the_symbols_kind(client: httpx.Client, symbol: str, kind: str) -> None:
    target = f"/rw/rapid/symbol/properties/RAPID/T_ROB_R/{symbol}?json=1"
    assert states(client.get(target))[0]["_type"] == kind


def test_properties_have_the_sizes_of_an_array(client: httpx.Client) -> None:
    target = "/rw/rapid/symbol/properties/RAPID/T_ROB_R/TRobMain/points?json=1"
    symbol = states(client.get(target))[0]
    assert (symbol["dattyp"], symbol["ndim"], symbol["dim"]) == ("pos", "1", "3")


def test_modules_are_listed_with_their_kind(client: httpx.Client) -> None:
    modules = states(client.get("/rw/rapid/modules?task=T_ROB_R&json=1"))
    assert [(module["name"], module["type"]) for module in modules] == [
        ("TRobMain", "ProgMod"),
        ("TRobSystem", "SysMod"),
    ]


def test_motors_and_rapid_go_on_and_off(client: httpx.Client, controller: PlainController) -> None:
    post(client, "/rw/panel/ctrlstate?action=setctrlstate", "ctrl-state=motoron")
    start = "regain=continue&execmode=continue&cycle=forever&condition=none&stopatbp=disabled&alltaskbytsp=false"
    assert post(client, f"{EXECUTION}?action=start", start).status_code == 204
    assert texts(client.get(EXECUTION), "ctrlexecstate") == ["running"]
    assert post(client, f"{EXECUTION}?action=stop", "stopmode=stop").status_code == 204
    assert post(client, f"{EXECUTION}?action=resetpp").status_code == 204
    assert controller.pp_at_main == 1


def test_post_without_a_body_needs_no_content_type(client: httpx.Client) -> None:
    assert client.post(f"{EXECUTION}?action=resetpp").status_code == 204


def test_speed_ratio_accepts_decimals(client: httpx.Client, controller: PlainController) -> None:
    post(client, "/rw/panel/speedratio?action=setspeedratio", "speed-ratio=50.0")
    assert controller.speed_ratio == 50


def test_event_log_shows_the_newest_event_first(client: httpx.Client, controller: PlainController) -> None:
    controller.events.append(10011, "Motors ON state", "The system is in the Motors ON state.")
    controller.events.append(10010, "Motors OFF state")
    newest, older = states(client.get("/rw/elog/0/?lang=en&json=1"))
    assert (newest["_title"], newest["_type"]) == ("/rw/elog/0/2", "elog-message")
    assert (older["code"], older["argc"], older["msgtype"]) == ("10011", "0", "1")
    assert older["tstamp"] == "2026-07-09 T 00:00:00"
    assert older["desc"] == "The system is in the Motors ON state."


def test_event_log_is_paged_by_page_number(client: httpx.Client, controller: PlainController) -> None:
    for number in range(1, 6):
        controller.events.append(10000 + number, f"event {number}")
    page = client.get("/rw/elog/0?lang=en&start=2&limit=2&json=1")
    assert [state["title"] for state in states(page)] == ["event 3", "event 2"]
    assert page.json()["_links"]["next"]["href"] == "0?lang=en&start=3&limit=2&json=1"


def test_single_event_and_cleared_log(client: httpx.Client, controller: PlainController) -> None:
    controller.events.append(10011, "Motors ON state")
    assert texts(client.get("/rw/elog/1/1?lang=en"), "title") == ["Motors ON state"]
    assert post(client, "/rw/elog/0?action=clear").status_code == 204
    assert controller.events.entries() == ()


REFUSALS = [
    ("GET", "/rw/nothing", "", 404, -1073414146),
    ("GET", f"{SIGNALS}/nothing", "", 404, -1073445866),
    ("GET", f"{SYMBOL}/TRobMain/nothing", "", 400, -1073414146),
    ("GET", "/rw/rapid/modules?task=T_ROB1", "", 404, -1073414146),
    ("GET", "/rw/motionsystem/mechunits/ROB_1", "", 404, -1073436668),
    ("GET", "/rw/cfg/XYZ/arm/instances", "", 400, -1073437696),
    ("GET", "/rw/cfg/moc/nothing/instances", "", 400, -1073437695),
    ("GET", "/rw/cfg/moc/arm/instances/nothing", "", 400, -1073437691),
    ("GET", "/rw/elog/99", "", 404, -1073414146),
    ("GET", "/rw/elog/0/7", "", 404, -1073414146),
    ("GET", f"{SIGNALS}?start=x", "", 400, -1073445879),
    ("DELETE", EXECUTION, "", 405, -1073445886),
    ("POST", f"{EXECUTION}?action=fly", "", 400, -1073445879),
    ("POST", f"{EXECUTION}?action=start", "cycle=twice", 400, -1073445879),
    ("POST", f"{EXECUTION}?action=start", "cycle=forever", 400, -1073442809),
    ("POST", f"{SYMBOL}/TRobMain/nothing?action=set", "value=1", 404, -1073442816),
    ("POST", f"{SYMBOL}/TRobMain/current_state?action=set", 'value="one"', 400, -1073442803),
    ("POST", f"{SYMBOL}/TRobMain/current_state?action=set", "", 400, -1073445879),
    ("POST", f"{SIGNALS}/OUTPUT_STATIONARY_ROB_R?action=set", "lvalue=0", 403, -1073445881),
    ("POST", f"{SIGNALS}/hand_ActualPosition_R?action=set", "lvalue=0", 403, -1073438206),
    ("POST", f"{SIGNALS}/EGM_START_JOINT?action=set", "lvalue=2", 400, -1073445879),
    ("POST", f"{SIGNALS}/EGM_START_JOINT?action=set", "lvalue=nan", 400, -1073445879),
    ("POST", f"{SIGNALS}/EGM_START_JOINT?action=set", "lvalue=high", 400, -1073445879),
    ("POST", f"{SIGNALS}/EGM_START_JOINT?action=set", "mode=blink&lvalue=1", 400, -1073445879),
    ("POST", "/rw/panel/ctrlstate?action=setctrlstate", "ctrl-state=init", 400, -1073445879),
    ("POST", "/rw/panel/speedratio?action=setspeedratio", "speed-ratio=101", 400, -1073445879),
    ("POST", "/rw/panel/speedratio?action=setspeedratio", "speed-ratio=inf", 400, -1073445879),
    ("POST", "/rw/panel/speedratio?action=setspeedratio", "speed-ratio=fast", 400, -1073445879),
]


@pytest.mark.parametrize(("method", "target", "body", "status", "abb_code"), REFUSALS)
def test_request_is_refused_with_abbs_code(
    client: httpx.Client, method: str, target: str, body: str, status: int, abb_code: int
) -> None:
    target += "&json=1" if "?" in target else "?json=1"
    response = client.request(method, target, content=body.encode(), headers=FORM)
    assert code(response) == (status, abb_code)


@pytest.mark.parametrize(
    ("target", "body", "abb_code"),
    [
        ("/rw/panel/ctrlstate?action=setctrlstate", "ctrl-state=motoron", -1073445860),
        (f"{SIGNALS}/EGM_START_JOINT?action=set", "lvalue=1", -1073445881),
        (f"{SYMBOL}/TRobMain/current_state?action=set", "value=1", -1073445859),
    ],
)
def test_write_is_forbidden_in_manual_mode(
    client: httpx.Client, controller: PlainController, target: str, body: str, abb_code: int
) -> None:
    controller.mode = OperatingMode.MANUAL_REDUCED
    assert code(post(client, f"{target}&json=1", body)) == (403, abb_code)
    assert controller.edges == []


def test_motors_stay_off_in_emergency_stop(client: httpx.Client, controller: PlainController) -> None:
    controller.controller_state = ControllerState.EMERGENCY_STOP
    response = post(client, "/rw/panel/ctrlstate?action=setctrlstate&json=1", "ctrl-state=motoron")
    assert code(response) == (403, -1073435887)


def test_upload_to_a_full_disk_is_refused(client: httpx.Client, controller: PlainController) -> None:
    controller.files.write("TEMP:/big", bytes(DISK_CAPACITY - 100))
    response = client.put("/fileservice/$home/more.mod?json=1", content=b"x" * 101)
    assert code(response) == (507, RwsCode.MAX_LIMIT_REACHED)


def test_body_that_is_no_form_is_refused(client: httpx.Client) -> None:
    response = client.post(f"{EXECUTION}?action=stop", json={"stopmode": "stop"})
    assert response.status_code == 415


def test_xhtml_refusal_has_code_and_message(client: httpx.Client) -> None:
    document = ElementTree.fromstring(client.get(f"{SIGNALS}/nothing").content)
    found = {span.get("class"): span.text for span in document.iter("{http://www.w3.org/1999/xhtml}span")}
    assert found["code"] == "-1073445866"
    assert found["msg"] == ("rws_resource_iosystem.cpp[1] there is no signal nothing code:-1073445866 icode:-1")
