"""What the benchmark needs of the machine, and the sentences when it is missing."""

from __future__ import annotations

from pathlib import Path

import pytest

from abb_protocols.errors import MissingPrerequisite, RobotNotReady
from refusals import refused
from yumi_evaluation.bench.contenders import contenders, other_server
from yumi_evaluation.bench.run import Server, Workshop


@pytest.fixture
def workshop(tmp_path: Path) -> Workshop:
    workshop = Workshop(tmp_path / "products", tmp_path / "sources")
    workshop.sources.mkdir()
    return workshop


def test_programs_of_all_contenders_exist(tmp_path: Path) -> None:
    workshop = Workshop(tmp_path)
    assert [each.program for each in contenders() if not (workshop.sources / each.program).is_file()] == []
    assert (workshop.sources / "requirements.txt").is_file()


def test_server_of_the_user_is_called_as_given(workshop: Workshop) -> None:
    assert workshop.command(other_server("/opt/libegm/loop --quiet")) == ["/opt/libegm/loop", "--quiet"]


def test_server_of_the_user_that_is_not_there_is_refused_in_a_sentence(workshop: Workshop, tmp_path: Path) -> None:
    log = tmp_path / "server.log"
    with refused(RobotNotReady, "contender_did_not_start", log=str(log)):
        Server(workshop, other_server("/opt/nothing/here"), 1, log).__enter__()
    assert "/opt/nothing/here" in log.read_text()


def test_program_is_compiled_again_when_its_source_is_newer(workshop: Workshop) -> None:
    (workshop.sources / "nothing.c").write_text("int main(void) { return 0; }")
    workshop.compile_programs()
    program = workshop.products / "nothing"
    first = program.stat().st_mtime_ns
    workshop.compile_programs()
    assert program.stat().st_mtime_ns == first
    (workshop.sources / "nothing.c").touch()
    workshop.compile_programs()
    assert program.stat().st_mtime_ns > first


def test_compiler_that_refuses_is_quoted(workshop: Workshop) -> None:
    (workshop.sources / "wrong.c").write_text("int main(void) { return nothing; }")
    with refused(MissingPrerequisite, "compiler_refused", file="wrong.c"):
        workshop.compile_programs()


def test_missing_compiler_is_named(workshop: Workshop, monkeypatch: pytest.MonkeyPatch) -> None:
    (workshop.sources / "nothing.c").write_text("int main(void) { return 0; }")
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    with refused(MissingPrerequisite, "benchmark_needs_compiler"):
        workshop.compile_programs()
