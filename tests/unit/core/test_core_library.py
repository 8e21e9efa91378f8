"""The core is compiled once, by whichever process comes first, or it is said why it cannot be."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
from pathlib import Path
from shutil import copy, copytree, ignore_patterns
from typing import NamedTuple

import pytest

from yumi.core.library import load

PACKAGES = Path(__file__).resolve().parents[3] / "packages"


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package as it is installed without the library, as far as it is compiled."""
    folder = tmp_path_factory.mktemp("installed") / "site-packages"
    unused = ignore_patterns("__pycache__", "libcore.so")
    copytree(PACKAGES / "abb-protocols" / "src", folder, ignore=unused)
    driver = PACKAGES / "yumi-ros2" / "src" / "yumi"
    for name in ("core", "texts"):
        copytree(driver / name, folder / "yumi" / name, ignore=unused)
    copy(driver / "__init__.py", folder / "yumi")
    return folder


COMPILER = """#!/bin/sh
for output; do :; done
case " $* " in
*" -shared "*)
    # The two processes meet here, each before it has a library.
    if mkdir "$0-met" 2>&-; then read -r _ < "$0-meeting"; else echo > "$0-meeting"; fi
    exec cp {library} "$output" ;;
esac
: > "$output"
"""


@pytest.fixture(scope="module")
def compiler(tmp_path_factory: pytest.TempPathFactory) -> str:
    """In place of a compiler: gives what was compiled of the same sources, to two processes that ask at once."""
    library = load()._name
    program = tmp_path_factory.mktemp("compiler") / "c++"
    program.write_text(COMPILER.format(library=shlex.quote(library)))
    program.chmod(0o755)
    os.mkfifo(f"{program}-meeting")
    return str(program)


class Compiled(NamedTuple):
    """A cache that two processes have filled at once, and what each of them printed and reported."""

    cache: Path
    printed: list[tuple[str, str]]


@pytest.fixture(scope="module")
def compiled(installed: Path, compiler: str, tmp_path_factory: pytest.TempPathFactory) -> Compiled:
    cache = tmp_path_factory.mktemp("cache")
    running = [start(installed, cache, "print(load()._name)", CXX=compiler) for _ in range(2)]
    return Compiled(cache, [process.communicate(timeout=60.0) for process in running])


def start(installed: Path, cache: Path, code: str, **variables: str) -> subprocess.Popen[str]:
    """Another process that loads the library."""
    environment = {**os.environ, "PYTHONPATH": str(installed), "XDG_CACHE_HOME": str(cache), **variables}
    command = [sys.executable, "-c", f"from yumi.core.library import *; {code}"]
    return subprocess.Popen(command, env=environment, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def test_processes_that_compile_at_once_load_the_same_library(
    installed: Path, compiler: str, compiled: Compiled
) -> None:
    cache, printed = compiled
    assert [error for _, error in printed] == ["", ""]
    (library,) = (cache / "yumi-ros2").glob("*.so")
    assert [name.strip() for name, _ in printed] == [str(library), str(library)]
    # Neither of them compiles it again.
    compiled_at = library.stat().st_mtime_ns
    assert start(installed, cache, "load()", PATH="", CXX=compiler).communicate(timeout=60.0) == ("", "")
    assert library.stat().st_mtime_ns == compiled_at


@pytest.mark.parametrize(
    ("variables", "sentence"),
    [
        ({"PATH": "", "CXX": ""}, "no C++ compiler was found; install one (Debian, Ubuntu: apt install g++)"),
        ({"CXX": "no-such-compiler"}, "could not be compiled: [Errno 2] No such file or directory"),
        ({"CXX": "c++ --no-such-option"}, "could not be compiled: c++ --no-such-option"),
    ],
)
def test_library_that_cannot_be_compiled_says_why(
    installed: Path, tmp_path: Path, variables: dict[str, str], sentence: str
) -> None:
    _, error = start(installed, tmp_path / "cache", "load()", **variables).communicate(timeout=60.0)
    assert "MissingPrerequisite: The core, which limits what the arms are sent," in error
    assert sentence in error
    assert not list(tmp_path.glob("cache/yumi-ros2/*"))


def test_damaged_library_says_what_to_do(installed: Path, compiler: str, compiled: Compiled, tmp_path: Path) -> None:
    cache = copytree(compiled.cache, tmp_path / "cache")
    (library,) = (cache / "yumi-ros2").glob("*.so")
    library.write_bytes(b"")
    _, error = start(installed, cache, "load()", CXX=compiler).communicate(timeout=60.0)
    assert f"remove {library}: it is compiled anew then." in error
