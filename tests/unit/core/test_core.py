"""The tests of the core that are written in C++, each file compiled and run."""

from __future__ import annotations

import subprocess
from hashlib import sha256
from pathlib import Path

import pytest

from soak import long, short
from yumi.core.library import COMPILER_FLAGS, CORE_FOLDER, STANDARD_LIBRARY, _compiler, _folder, _ruckig, _run

FILES = sorted(Path(__file__).parent.glob("*.cpp"))
SANITIZED = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
THREADS = ("-g", "-fsanitize=thread")


@pytest.mark.parametrize("flags", [short(()), long(SANITIZED, 300.0), long(THREADS, 300.0)])
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_core(file: Path, flags: tuple[str, ...]) -> None:
    done = subprocess.run([compiled(file, flags)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("passed ") >= 1


def compiled(file: Path, flags: tuple[str, ...]) -> Path:
    """The program of a test, compiled without a warning once for each edition of its sources, as the core itself is."""
    headers, archive, ruckig = _ruckig()
    warnings = ("-Wall", "-Wextra", "-Werror")
    includes = ("-I", str(CORE_FOLDER), "-I", str(file.parent), "-isystem", str(headers))
    command = [
        *_compiler(),
        *COMPILER_FLAGS,
        "-O1",
        *warnings,
        *flags,
        *includes,
        str(file),
        *STANDARD_LIBRARY,
        str(archive),
    ]
    sources = (*sorted(CORE_FOLDER.glob("*.[ch]pp")), *sorted(file.parent.glob("*.hpp")), file)
    edition = sha256(b"".join(each.read_bytes() for each in sources) + f"{command} {ruckig}".encode())
    program = _folder() / f"{file.stem}-{edition.hexdigest()[:16]}"
    if not program.exists():
        _run([command], [program])
    return program
