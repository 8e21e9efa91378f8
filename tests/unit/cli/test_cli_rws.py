"""``yumi rws`` against a controller of plain values on loopback."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from abb_protocols.catalogue import Message, message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from contract.rws_bench import PlainController, serving
from yumi.cli.main import main


@pytest.fixture
def controller() -> PlainController:
    return PlainController()


@pytest.fixture
def where(controller: PlainController) -> Iterator[list[str]]:
    with serving(controller) as address:
        host, _, port = address.partition(":")
        yield ["--robot", f"{host}:{port}"]


def rws(where: list[str], command: str, *arguments: str) -> Result:
    return CliRunner().invoke(main, ["rws", command, *where, *arguments])


def test_resource_is_read(where: list[str]) -> None:
    (state,) = json.loads(rws(where, "get", "/rw/panel/opmode").stdout)
    assert state["opmode"] == "AUTO"


@pytest.mark.parametrize(
    ("target", "text"),
    [
        ("signal:hand_MaxSpeed_R", "200\n"),
        ("T_ROB_R/TRobMain/current_state", "0\n"),
        ("HOME:/user.sys", "MODULE user(SYSMODULE)\nENDMODULE\n"),
    ],
)
def test_signals_symbols_and_files_are_read(where: list[str], target: str, text: str) -> None:
    assert rws(where, "get", target).stdout == text


def test_signal_and_symbol_are_written(where: list[str], controller: PlainController) -> None:
    assert rws(where, "set", "signal:EGM_START_JOINT", "1").exit_code == 0
    assert controller.signals.get("EGM_START_JOINT").value == 1
    assert rws(where, "set", "T_ROB_R/TRobSystem/routine_name_input", '"a"').exit_code == 0
    assert controller.tasks["T_ROB_R"].read("TRobSystem", "routine_name_input") == '"a"'


def test_file_is_uploaded_and_listed(where: list[str], controller: PlainController, tmp_path: Path) -> None:
    (tmp_path / "pick.mod").write_bytes(b"MODULE pick\nENDMODULE\n")
    assert rws(where, "put", str(tmp_path / "pick.mod"), "HOME:/").stdout == "22 bytes written\n"
    assert controller.files["HOME:/pick.mod"] == "MODULE pick\nENDMODULE\n"
    assert "pick.mod" in rws(where, "ls", "HOME:/").stdout


def test_json_has_values_instead_of_text(where: list[str]) -> None:
    assert json.loads(rws(where, "get", "signal:hand_MaxSpeed_R", "--json").stdout) == 200.0
    assert json.loads(rws(where, "get", "T_ROB_R/TRobMain/points", "--json").stdout) == [[0.0] * 3] * 3
    assert {"name": "user.sys", "size": 33} in json.loads(rws(where, "ls", "--json").stdout)
    assert len(json.loads(rws(where, "ls", "/rw/iosystem/signals?start=0&limit=3", "--json").stdout)) == 4
    line = rws(where, "watch", "opmode", "--count", "1", "--json").stdout
    assert json.loads(line) == {"path": "/rw/panel/opmode", "opmode": "AUTO"}


def test_file_is_written_where_it_is_wanted(where: list[str], tmp_path: Path) -> None:
    rws(where, "get", "HOME:/user.sys", str(tmp_path / "user.sys"))
    assert (tmp_path / "user.sys").read_text() == "MODULE user(SYSMODULE)\nENDMODULE\n"


def test_watch_prints_the_values_and_ends_after_its_count(where: list[str]) -> None:
    result = rws(where, "watch", "opmode", "signal:EGM_START_JOINT", "--count", "2")
    assert result.stdout.splitlines() == [
        "/rw/panel/opmode opmode=AUTO",
        "/rw/iosystem/signals/EGM_START_JOINT;state lvalue=0 lstate=not simulated",
    ]


def test_any_request_is_sent(where: list[str], controller: PlainController) -> None:
    assert rws(where, "call", "POST", "/rw/panel/speedratio?action=setspeedratio", "speed-ratio=40").exit_code == 0
    assert controller.speed_ratio == 40


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("get", "nonsense"), message("no_target", target="nonsense")),
        (("set", "signal:EGM_STOP", "high"), message("signal_value_no_number", value="high")),
        (("call", "POST", "/rw/panel", "x"), message("field_without_value", field="x")),
    ],
)
def test_what_makes_no_sense_is_one_sentence(where: list[str], arguments: tuple[str, ...], said: Message) -> None:
    result = rws(where, *arguments)
    assert result.exit_code == 1
    assert sentence(said, FrontEnd.SHELL) in result.output
    assert "Traceback" not in result.output


def test_what_the_controller_does_not_have_is_one_sentence(where: list[str]) -> None:
    result = rws(where, "get", "signal:none")
    said = message(
        "rws_refused",
        address=where[1],
        what="reading signal none",
        reason=message("rws_unresolved_url"),
        status=404,
        name="UNRESOLVED_URL -1073445866",
    )
    assert (result.exit_code, result.output) == (1, f"Error: {sentence(said, FrontEnd.SHELL)}\n")
