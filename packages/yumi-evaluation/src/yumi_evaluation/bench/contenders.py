"""What the reply benchmark compares, and in which order: shuffled in every round."""

from __future__ import annotations

import random
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

WAKE_MODES = ("blocking", "auto")
"""The settings of ``egm.wake`` that are measured; each adds our contenders once more."""

GAIN = 0.1
"""Every contender but the echo replies measured + GAIN · (goal - measured), by which its replies are checked."""

GOAL_DEG = (-50.0, -60.0, 15.0, 30.0, 40.0, 50.0, 20.0)
"""The goal of axes 1 to 6 and 7 [deg]; the load generator's robot moves about it."""


class Runtime(Enum):
    """What a contender's program runs in."""

    COMPILED = "compiled"
    OURS = "our Python"
    PEERS = "the peers' Python"
    OTHER = "given by the user"


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
        program: its file in ``sources``.
        runtime: what runs it.
        options: further arguments.
        arms: with how many arms it is measured.
        modes: how the load generator sends.
        gain: by which its replies are checked.
        is_peer: whether it is one of the packages that ours is compared with.
        on_busy_machine: whether it is measured on a busy machine, too, one arm, paced.
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
    on_busy_machine: bool = True


@dataclass(frozen=True, slots=True)
class Case:
    """One run of a round: a contender, with one or two arms, paced or as fast as it replies.

    Attributes:
        contender: what answers.
        mode: when the next datagram comes.
        arms: how many.
        is_machine_busy: whether busy loops of other programs run beside.
        lead_in: within this time it must answer as it should [s].
    """

    contender: Contender
    mode: Mode
    arms: int
    is_machine_busy: bool = False
    lead_in: float = 20.0

    @property
    def name(self) -> str:
        """E.g. ``c_echo/paced/1`` or ``c_echo/paced/1/busy``, as in the figures."""
        return f"{self.contender.name}/{self.mode.value}/{self.arms}{'/busy' if self.is_machine_busy else ''}"

    @property
    def is_paced(self) -> bool:
        return self.mode is Mode.PACED


ECHO = Contender("c_echo", "C echo", "echo.c", Runtime.COMPILED, arms=(1, 2), gain=0.0)
PEERS = (
    Contender("abb_robot_client", "abb-robot-client", "abb_robot_client_loop.py", Runtime.PEERS, is_peer=True),
    Contender("abb_robot_egm", "ABBRobotEGM", "abb_robot_egm_loop.py", Runtime.PEERS, is_peer=True),
)


def control_loop(wake: str) -> Contender:
    """Our control loop alone, waiting as the setting says."""
    name, title = f"control_loop_{wake}", f"control loop, {wake}"
    return Contender(name, title, "control_loop.py", Runtime.OURS, ("--wake", wake), arms=(1, 2))


def ros_graph(wake: str) -> Contender:
    """Our control loop under the whole ROS 2 graph with a subscriber on each topic."""
    name, title, options = f"ros_graph_{wake}", f"ROS graph, {wake}", ("--wake", wake)
    return Contender(
        name, title, "ros_graph.py", Runtime.OURS, options, arms=(1, 2), modes=(Mode.PACED,), on_busy_machine=False
    )


def busy_ros_graph(wake: str) -> Contender:
    """The same with a callback in the ROS process that computes 10 ms in every 33 ms."""
    name, title, options = f"ros_graph_busy_{wake}", f"busy ROS graph, {wake}", ("--wake", wake, "--busy")
    return Contender(name, title, "ros_graph.py", Runtime.OURS, options, modes=(Mode.PACED,), on_busy_machine=False)


def other_server(command: str) -> Contender:
    """A program of the user, e.g. one with a build of ABB's own C++ library; it gets port, gain and goal."""
    return Contender("other_server", Path(command).name, command, Runtime.OTHER)


def contenders(wake_modes: Iterable[str] = WAKE_MODES) -> tuple[Contender, ...]:
    """All of them, with ours in each of ``wake_modes``."""
    ours = [make(wake) for wake in wake_modes for make in (control_loop, ros_graph, busy_ros_graph)]
    return (ECHO, *PEERS, *ours)


def cases_of(chosen: Iterable[Contender]) -> list[Case]:
    """Every run of one round."""
    cases = [Case(each, mode, arms) for each in chosen for mode in each.modes for arms in each.arms]
    return cases + [Case(each, Mode.PACED, 1, is_machine_busy=True) for each in chosen if each.on_busy_machine]


def schedule(cases: Sequence[Case], rounds: int, seed: int) -> list[tuple[int, Case]]:
    """All runs with the number of their round, from 1; the order within a round is drawn from ``seed``.

    A contender's own runs follow each other: two arms are compared with one, and a machine changes by the minute.
    """
    draw, plan = random.Random(seed), list[tuple[int, Case]]()
    chosen = list(dict.fromkeys(case.contender for case in cases))
    for number in range(1, rounds + 1):
        for contender in draw.sample(chosen, len(chosen)):
            for mode in draw.sample(tuple(Mode), len(Mode)):
                own = [case for case in cases if (case.contender, case.mode) == (contender, mode)]
                plan += [(number, case) for case in draw.sample(own, len(own))]
    return plan
