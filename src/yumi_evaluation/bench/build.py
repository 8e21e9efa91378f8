"""What the benchmark runs: its C programs, compiled when they are older than their source, and the peers' Python.

Who takes part in the reply benchmark, and in which order: shuffled anew in every round.
"""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import yumi
from yumi.errors import MissingPrerequisite

WAKE_MODES = ("blocking", "auto")
"""The settings of ``egm.wake`` that are measured; each adds our contenders once more."""

GAIN = 0.1
"""Every guided contender replies measured + GAIN · (goal - measured), by which its replies are checked."""

GOAL_DEG = (-50.0, -60.0, 15.0, 30.0, 40.0, 50.0, 20.0)
"""The goal of axes 1 to 6 and 7 [deg]; the load generator's robot moves about it."""


class Runtime(Enum):
    """What a contender's program runs in."""

    COMPILED = "compiled"
    OURS = "our Python"
    PEERS = "the peers' Python"


class Mode(Enum):
    """How the load generator sends; the value is its name in the figures."""

    PACED = "paced"
    PING_PONG = "ping_pong"


@dataclass(frozen=True, slots=True)
class Contender:
    """A server of the benchmark.

    Attributes:
        name: in the figures.
        title: in tables and pictures.
        program: its file in ``benchmarks/egm_reply``.
        runtime: what runs it.
        options: further arguments.
        arms: with how many arms it is measured.
        modes: how the load generator sends.
        gain: by which its replies are checked.
        is_peer: whether it is one of those that ours is measured against.
    """

    name: str
    title: str
    program: str
    runtime: Runtime
    options: tuple[str, ...] = ()
    arms: tuple[int, ...] = (1,)
    modes: tuple[Mode, ...] = (Mode.PACED, Mode.PING_PONG)
    gain: float = GAIN
    is_peer: bool = False


@dataclass(frozen=True, slots=True)
class Case:
    """One run of a round: a contender, with one or two arms, paced or as fast as it replies.

    Attributes:
        contender: who answers.
        mode: when the next datagram comes.
        arms: how many.
        lead_in: within this time it must guide the robot rightly [s].
    """

    contender: Contender
    mode: Mode
    arms: int
    lead_in: float = 20.0

    @property
    def name(self) -> str:
        """E.g. ``c_echo/paced/1``, as in the figures."""
        return f"{self.contender.name}/{self.mode.value}/{self.arms}"


ECHO = Contender("c_echo", "C echo", "echo.c", Runtime.COMPILED, arms=(1, 2), gain=0.0)
PEERS = (
    Contender("abb_robot_client", "abb-robot-client", "abb_robot_client_loop.py", Runtime.PEERS, is_peer=True),
    Contender("abb_robot_egm", "ABBRobotEGM", "abb_robot_egm_loop.py", Runtime.PEERS, is_peer=True),
)


def fast_line(wake: str) -> Contender:
    """Our fast line alone, woken as the setting says."""
    options = ("--wake", wake)
    return Contender(
        f"fast_line_{wake}", f"fast line, {wake}", "fast_line_alone.py", Runtime.OURS, options, arms=(1, 2)
    )


def ros_graph(wake: str) -> Contender:
    """Our fast line under the whole ROS 2 graph with a subscriber on each topic."""
    options, name = ("--wake", wake), f"ros_graph_{wake}"
    return Contender(
        name, f"ROS graph, {wake}", "ros_graph.py", Runtime.OURS, options, arms=(1, 2), modes=(Mode.PACED,)
    )


def busy_ros_graph(wake: str) -> Contender:
    """The same with a callback in the ROS process that computes 10 ms in every 33 ms."""
    options, name = ("--wake", wake, "--busy"), f"ros_graph_busy_{wake}"
    return Contender(name, f"busy ROS graph, {wake}", "ros_graph.py", Runtime.OURS, options, modes=(Mode.PACED,))


def contenders(wake_modes: Iterable[str] = WAKE_MODES) -> tuple[Contender, ...]:
    """Everybody, with ours in each of ``wake_modes``."""
    ours = [make(wake) for wake in wake_modes for make in (fast_line, ros_graph, busy_ros_graph)]
    return (ECHO, *PEERS, *ours)


def cases_of(chosen: Iterable[Contender]) -> list[Case]:
    """Every run that one round has."""
    return [Case(each, mode, arms) for each in chosen for mode in each.modes for arms in each.arms]


def schedule(cases: Sequence[Case], rounds: int, seed: int) -> list[tuple[int, Case]]:
    """All runs with the number of their round, from 1; the order within a round is drawn from ``seed``.

    A contender's own runs follow each other: two arms are compared with one, and a machine changes by the minute.
    """
    draw = random.Random(seed)
    return [(number, case) for number in range(1, rounds + 1) for case in _round(cases, draw)]


def _round(cases: Sequence[Case], draw: random.Random) -> Iterator[Case]:
    chosen = list(dict.fromkeys(case.contender for case in cases))
    for contender in draw.sample(chosen, len(chosen)):
        for mode in draw.sample(tuple(Mode), len(Mode)):
            own = [case for case in cases if (case.contender, case.mode) == (contender, mode)]
            yield from draw.sample(own, len(own))


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
