"""``virtual-irc5 view`` without its extra, and where nothing answers."""

from __future__ import annotations

import sys

import pytest
from click.testing import CliRunner

from abb_protocols.catalogue import message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import missing_extra
from free_ports import free_tcp_port
from virtual_irc5.commands.main import main


def test_command_without_its_extra_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "abb_view.controller_reader", None)
    result = CliRunner().invoke(main, ["view"])
    missing = missing_extra(message("command_needs_packages", packages=("abb-view",)), "virtual-irc5", "page")
    assert result.exit_code == 1
    assert sentence(missing.said, FrontEnd.SHELL) in result.output
    assert "virtual-irc5[page]" in result.output


def test_command_ends_where_no_controller_answers() -> None:
    result = CliRunner().invoke(main, ["view", "--robot", f"127.0.0.1:{free_tcp_port()}", "--port", "0"])
    assert result.exit_code == 1
    assert result.output.startswith("Error: ")
