"""What the benchmark runs: its C programs, compiled when they are older than their source, and the peers' Python."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import yumi
from yumi.errors import MissingPrerequisite
from yumi.evaluation.bench_contenders import Contender, Runtime

COMPILERS = ("cc", "gcc", "clang", "c++", "g++", "clang++")


@dataclass(frozen=True, slots=True)
class Workshop:
    """Where the benchmark's sources are and where its products go.

    Attributes:
        clone: the repository.
    """

    clone: Path

    @property
    def sources(self) -> Path:
        return self.clone / "benchmarks" / "egm_reply"

    @property
    def products(self) -> Path:
        return self.clone / "build" / "bench"

    @property
    def requirements(self) -> Path:
        return self.clone / "benchmarks" / "requirements.txt"

    @property
    def peers(self) -> Path:
        """The virtual environment of the PyPI peers."""
        return self.clone / "build" / "bench-venv"

    @property
    def load_generator(self) -> Path:
        return self.products / "load_generator"

    def command(self, contender: Contender) -> list[str]:
        """What starts ``contender``, without its arguments."""
        if contender.runtime is Runtime.COMPILED:
            return [str(self.products / Path(contender.program).stem)]
        python = sys.executable if contender.runtime is Runtime.OURS else str(self.peers / "bin" / "python")
        return [python, str(self.sources / contender.program)]


def find_workshop() -> Workshop:
    """The clone that this yumi belongs to.

    Raises:
        MissingPrerequisite: yumi was installed without its repository, or the machine does not run Linux.
    """
    workshop = Workshop(Path(yumi.__file__).resolve().parents[2])
    if not sys.platform.startswith("linux"):
        raise MissingPrerequisite("The benchmark needs Linux: it uses kernel receive time stamps and /proc.")
    if not workshop.sources.is_dir():
        raise MissingPrerequisite("The benchmark is not in the installed package; run it in a clone of yumi-ros2.")
    return workshop


def compile_programs(workshop: Workshop) -> None:
    """Compile what is older than its source.

    Raises:
        MissingPrerequisite: there is no compiler, or it refuses.
    """
    workshop.products.mkdir(parents=True, exist_ok=True)
    newest = max((source.stat().st_mtime for source in workshop.sources.glob("*.[ch]")), default=0.0)
    for source in sorted(workshop.sources.glob("*.c")):
        program = workshop.products / source.stem
        if not program.exists() or program.stat().st_mtime < newest:
            arguments = ["-x", "c", "-O2", "-Wall", "-Wextra", str(source), "-o", str(program), "-lm"]
            _run([_compiler(), *arguments], f"The compiler refused {source.name}")


def install_peers(workshop: Workshop) -> None:
    """Install the PyPI peers into an environment of their own, once per list of requirements.

    Raises:
        MissingPrerequisite: they cannot be fetched.
    """
    wanted = workshop.requirements.read_text(encoding="utf-8")
    done = workshop.peers / "installed.txt"
    if done.exists() and done.read_text(encoding="utf-8") == wanted:
        return
    _run([sys.executable, "-m", "venv", "--clear", str(workshop.peers)], "The peers' environment could not be made")
    pip = [str(workshop.peers / "bin" / "python"), "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    _run([*pip, "-r", str(workshop.requirements)], "The PyPI peers could not be installed (--only leaves them out)")
    done.write_text(wanted, encoding="utf-8")


def _compiler() -> str:
    for name in (os.environ.get("CC", ""), *COMPILERS):
        path = shutil.which(name) if name else None
        if path:
            return path
    raise MissingPrerequisite("The benchmark's load generator needs a C compiler: install one (apt install g++).")


def _run(command: Sequence[str], complaint: str) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    if done.returncode != 0:
        words = done.stderr.strip().splitlines() or ["no reason given"]
        raise MissingPrerequisite(f"{complaint}: {words[-1]}")
