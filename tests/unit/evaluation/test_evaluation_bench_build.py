"""What the benchmark needs of the machine, and the sentences when it is missing."""

from __future__ import annotations

from pathlib import Path

import pytest

from yumi.errors import MissingPrerequisite
from yumi_evaluation.bench import build as bench_build
from yumi_evaluation.bench.build import Workshop, compile_programs, contenders, find_workshop


@pytest.fixture
def workshop(tmp_path: Path) -> Workshop:
    workshop = Workshop(tmp_path)
    workshop.sources.mkdir(parents=True)
    return workshop


def test_programs_of_all_contenders_exist() -> None:
    workshop = find_workshop()
    assert [each.program for each in contenders() if not (workshop.sources / each.program).is_file()] == []


def test_program_is_compiled_again_when_its_source_is_newer(workshop: Workshop) -> None:
    (workshop.sources / "nothing.c").write_text("int main(void) { return 0; }")
    compile_programs(workshop)
    program = workshop.products / "nothing"
    first = program.stat().st_mtime_ns
    compile_programs(workshop)
    assert program.stat().st_mtime_ns == first
    (workshop.sources / "nothing.c").touch()
    compile_programs(workshop)
    assert program.stat().st_mtime_ns > first


def test_compiler_that_refuses_is_quoted(workshop: Workshop) -> None:
    (workshop.sources / "wrong.c").write_text("int main(void) { return nothing; }")
    with pytest.raises(MissingPrerequisite, match=r"The compiler refused wrong\.c: "):
        compile_programs(workshop)


def test_missing_compiler_is_named(workshop: Workshop, monkeypatch: pytest.MonkeyPatch) -> None:
    (workshop.sources / "nothing.c").write_text("int main(void) { return 0; }")
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(MissingPrerequisite, match="load generator needs a C compiler: install one"):
        compile_programs(workshop)


def test_installed_package_without_its_repository_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_build.yumi, "__file__", str(tmp_path / "lib" / "yumi" / "__init__.py"))
    with pytest.raises(MissingPrerequisite, match="run it in a clone of yumi-ros2"):
        find_workshop()
