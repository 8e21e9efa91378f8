"""The tests of the core that are written in C++, each file compiled and run."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from soak import long, short
from yumi.core.library import FLAGS, FOLDER, STANDARD, _compiler, _ruckig

FILES = sorted(Path(__file__).parent.glob("*.cpp"))
SANITIZED = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
THREADS = ("-g", "-fsanitize=thread")


@pytest.mark.parametrize("flags", [short(()), long(SANITIZED, 300.0), long(THREADS, 300.0)])
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_core(file: Path, flags: tuple[str, ...], tmp_path: Path) -> None:
    headers, archive, _ = _ruckig()
    program = str(tmp_path / file.stem)
    warnings = ("-Wall", "-Wextra", "-Werror")
    includes = ("-I", str(FOLDER), "-I", str(file.parent), "-isystem", str(headers))
    command = [
        *_compiler(),
        *FLAGS,
        "-O1",
        *warnings,
        *flags,
        *includes,
        str(file),
        *STANDARD,
        str(archive),
        "-o",
        program,
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("passed ") >= 1
