"""What a RAPID program asks the operator, shown and answered over Robot Web Services and with `yumi answer`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from click.testing import CliRunner

from abb_protocols.catalogue import message
from abb_runtime.rws.client import DEFAULT_PASSWORD, DEFAULT_USER
from virtual_irc5.http_server import HttpServer
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.world import World
from yumi.cli.main import main

PROGRAM = r"""MODULE Ask
PERS num key:=0;
PROC main()
    TPReadFK key,"Which part?","Round","Square","","","";
    TPWrite "part "\Num:=key;
    WaitTime 100;
ENDPROC
ENDMODULE
"""


@pytest.fixture
def asking() -> World:
    world = World()
    controller = world.controller
    controller.execution.replace_program({"Ask.mod": PROGRAM})
    controller.set_motors(True)
    controller.start_rapid()
    world.cycle({})
    return world


@contextmanager
def serving(world: World) -> Iterator[str]:
    """The address of the robot's controller, whose time stands."""
    service = RwsService(world.controller, user=DEFAULT_USER, password=DEFAULT_PASSWORD)
    with HttpServer(lambda request: service.handle(request, 0.0), port=0) as server:
        yield server.address


def answered(address: str, *arguments: str) -> tuple[int, str]:
    host, _, port = address.rpartition(":")
    outcome = CliRunner().invoke(main, ["answer", *arguments, "--robot", f"{host}:{port}"])
    return outcome.exit_code, outcome.output


def test_question_is_shown_and_answered_by_the_command_line(asking: World) -> None:
    with serving(asking) as address:
        shown = answered(address)
        refused = answered(address, "Triangle")
        accepted = answered(address, "square")
        again = answered(address, "round")
    asking.cycle({})
    assert shown[0] == 0
    assert "TPReadFK of T_ROB_L" in shown[1]
    assert "MsgLine1: Which part?\nChoice1: Round\nChoice2: Square\n" in shown[1]
    assert refused[0] == 1
    asked = ("MsgLine1: Which part?", "Choice1: Round", "Choice2: Square")
    said = message("answer_refused", value="Triangle", instruction="TPReadFK", asked=asked)
    assert refused[1] == f"Error: {said}\n"
    assert accepted == (0, "")
    assert again[0] == 0  # the other arm's program has asked, too
    assert asking.controller.screens == {"T_ROB_R": ("part 1",), "T_ROB_L": ("part 2",)}


def test_nothing_can_be_answered_where_nothing_is_asked() -> None:
    world = World()
    with serving(world) as address:
        assert answered(address, "1") == (1, f"Error: {message('program_asks_nothing')}\n")
