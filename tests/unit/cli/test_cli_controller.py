"""``yumi fault`` against a virtual controller that runs, and the options of ``yumi controller``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from click.testing import CliRunner

from abb_protocols.robot.joints import Side
from abb_runtime.clock import ManualClock
from abb_runtime.faults import Fault, FaultDirection
from memory_http import MemoryHttp
from virtual_irc5.fault_injection import FaultInjection
from virtual_irc5.http_server import HttpServer
from virtual_irc5.rws.http import HttpReply
from virtual_irc5.world import World, WorldSettings
from yumi.cli.main import main


@pytest.fixture(scope="module")
def world() -> World:
    return World()


@pytest.fixture(scope="module")
def port(world: World) -> Iterator[int]:
    """Where the world takes faults."""
    desk = FaultInjection(world, MemoryHttp(world.controller, ManualClock()).adapter)
    with HttpServer(desk.answer, port=0) as server:
        yield server.port


def run(*arguments: object) -> tuple[int, str]:
    """Exit code and output of ``yumi fault``."""
    result = CliRunner().invoke(main, ["fault", *map(str, arguments)])
    return result.exit_code, result.output


def test_fault_command_injects_a_fault(world: World, port: int) -> None:
    assert run("egm-silence", "--arm", "left", "--duration", 3, "--robot", f"127.0.0.1:{port}") == (
        0,
        "egm-silence: done\n",
    )
    assert [world.network.amount(Fault.EGM_LOSS, side) for side in (Side.LEFT, Side.RIGHT)] == [100.0, None]


def test_fault_command_passes_strength_and_direction_on(world: World, port: int) -> None:
    chosen = ("--by", 20, "--way", "to-robot", "--arm", "right", "--robot", f"127.0.0.1:{port}")
    assert run("egm-delay", *chosen) == (0, "egm-delay: done\n")
    assert world.network.amount(Fault.EGM_DELAY, Side.RIGHT, FaultDirection.TO_ROBOT) == 20.0
    assert run("egm-loss", "--by", 200, "--robot", f"127.0.0.1:{port}") == (
        1,
        "Error: The strength ('by') of egm-loss is 0 to 100 %, not 200.\n",
    )


@pytest.mark.parametrize("arguments", [(), ("--help",)])
def test_fault_command_lists_the_faults(arguments: tuple[str, ...]) -> None:
    code, output = run(*arguments)
    assert code == 0
    assert all(f"{fault.value.name} " in output for fault in Fault)


def test_fault_command_passes_a_refusal_on(port: int) -> None:
    sentence = "Error: An arm whose motors are off does not collide; switch the motors on first.\n"
    assert run("collision", "--robot", f"127.0.0.1:{port}") == (1, sentence)


def test_fault_command_refuses_a_name_it_does_not_know() -> None:
    code, output = run("earthquake")
    assert (code, "'earthquake' is not one of 'egm-silence'" in output) == (2, True)


def test_fault_command_says_that_nothing_listens(port: int) -> None:
    with HttpServer(lambda _: HttpReply(404), port=0) as server:
        free = server.port
        code, output = run("collision", "--robot", f"127.0.0.1:{free}")
        assert output == f"Error: What answers at 127.0.0.1:{free} is not a virtual controller of this package.\n"
    code, output = run("collision", "--robot", f"127.0.0.1:{free}")
    assert (code, output.endswith("`virtual-irc5 run` or `yumi controller` starts a virtual one.\n")) == (1, True)


@pytest.mark.parametrize(
    ("program", "status", "sentence"),
    [
        ("main.mod", 2, "TASK=FILE[,FILE…] is needed, such as left=main.mod,tools.sys"),
        ("left=none.mod", 2, "none.mod cannot be read: No such file or directory"),
        ("T_ROB9=none.mod", 2, "there is no task T_ROB9; there are T_ROB_L, T_ROB_R"),
    ],
)
def test_program_that_the_controller_cannot_take_is_one_sentence(program: str, status: int, sentence: str) -> None:
    result = CliRunner().invoke(main, ["controller", "--program", program])
    assert (result.exit_code, sentence in result.output) == (status, True), result.output


class NoController:
    """Takes what ``yumi controller`` makes of its options, and ends at once.

    Attributes:
        options: of the last one.
    """

    options: dict[str, Any]

    def __init__(self, settings: WorldSettings, **options: Any) -> None:
        NoController.options = options

    def run(self, is_over: object, on_ready: Callable[[int], None]) -> None:
        if NoController.options["show"] is not None:
            NoController.options["show"]("T_ROB_L", "Hello 1")


@pytest.mark.parametrize(
    ("options", "output", "runs_once"),
    [(["--start", "--once", "--show"], "[T_ROB_L] Hello 1\n", True), (["--start"], "", False)],
)
def test_controller_shows_what_programs_write_and_runs_them_once(
    monkeypatch: pytest.MonkeyPatch, options: list[str], output: str, runs_once: bool
) -> None:
    monkeypatch.setattr("virtual_irc5.server.VirtualController", NoController)
    result = CliRunner().invoke(main, ["controller", *options])
    assert (result.exit_code, result.output, NoController.options["runs_once"]) == (0, output, runs_once)


def test_once_is_refused_where_nothing_is_started() -> None:
    result = CliRunner().invoke(main, ["controller", "--once"])
    assert (result.exit_code, "--once is for --start: give both." in result.output) == (2, True)
