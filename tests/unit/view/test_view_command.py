"""``virtual-irc5 view`` without its extra, where nothing answers, and over HTTPS."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from abb_protocols.catalogue import message, sentence
from abb_protocols.catalogue.actions import FrontEnd
from abb_protocols.errors import missing_extra
from abb_runtime.rws.client import DEFAULT_PASSWORD, DEFAULT_USER
from abb_view import page_server
from free_ports import free_tcp_port
from virtual_irc5.commands.main import main
from virtual_irc5.http_server import HttpServer
from virtual_irc5.rws.rws_service import RwsService
from virtual_irc5.world import World


def test_command_without_its_extra_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "abb_view.controller_reader", None)
    result = CliRunner().invoke(main, ["view"])
    missing = missing_extra(message("command_needs_packages", packages=("abb-view",)), "virtual-irc5", "page")
    assert result.exit_code == 1
    assert sentence(missing.said, FrontEnd.SHELL) in result.output
    assert "virtual-irc5[page]" in result.output


def test_page_over_https_prints_its_certificate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("cryptography", reason="the part robotware7 is not installed")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    urls: list[str] = []
    monkeypatch.setattr(page_server, "serve_pages", lambda server, is_over, show: urls.append(server.url))
    service = RwsService(World().controller, user=DEFAULT_USER, password=DEFAULT_PASSWORD)
    with HttpServer(lambda request: service.handle(request, 0.0), port=0) as http:
        result = CliRunner().invoke(main, ["view", "--robot", http.address, "--https", "--port", "0"])
    assert result.exit_code == 0, result.output
    assert urls == ["https://127.0.0.1:0/"]
    assert re.search(r"SHA-256 ([0-9A-F]{2}:){31}[0-9A-F]{2}\n", result.output)


def test_command_ends_where_no_controller_answers() -> None:
    result = CliRunner().invoke(main, ["view", "--robot", f"127.0.0.1:{free_tcp_port()}", "--port", "0"])
    assert result.exit_code == 1
    assert result.output.startswith("Error: ")
