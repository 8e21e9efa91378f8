"""Every call of the client before an answer without meaning: it is a YumiError, and never an error of Python's."""

from __future__ import annotations

import ast
import inspect
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

import httpx
import pytest

import abb_protocols.rws
import abb_runtime.rws
from abb_protocols.errors import ProtocolError, YumiError
from abb_protocols.robot.joints import ZERO_JOINTS, Pose
from abb_protocols.rws.documents import Page, RwsState
from abb_protocols.rws.operations import service
from abb_protocols.rws.operations.modules import TextRange
from abb_protocols.rws.operations.motion import RobTarget, Supervision
from abb_protocols.rws.values import Increment, OperatingMode, Privilege, Resource, RunCycle, SignalChange
from abb_runtime.clock import ManualClock
from abb_runtime.rws import client as client_module
from abb_runtime.rws.client import RwsClient
from abb_runtime.rws.session import OpenWebSocket
from abb_runtime.rws.web_socket import Listener

SOURCES = sorted(
    file
    for package in (abb_protocols.rws, abb_runtime.rws)
    for file in Path(str(package.__file__)).parent.rglob("*.py")
)
NAME = re.compile(r"[a-zA-Z]+([-_][a-zA-Z0-9]+)*")
NOT_CALLS = {"close", "abandon", "subscribe", "holding", "call", "perform", "wait_for_restart"}
"""They end the client, wait, take any request, or are no single request."""

SAMPLES: dict[str, Any] = {
    "str": "x",
    "int": 1,
    "bool": True,
    "float": 0.5,
    "bytes": b"x",
    "Pose": Pose((0.4, 0.0, 0.3), (1.0, 0.0, 0.0, 0.0)),
    "Joints": ZERO_JOINTS,
    "RobTarget": RobTarget(Pose((0.4, 0.0, 0.3), (1.0, 0.0, 0.0, 0.0)), (0, 0, 0, 0), (None,) * 6),
    "TextRange": TextRange(1, 1, 1, 2),
    "RapidValue": 1.0,
    "Supervision": Supervision(True, 100),
    "Sequence[Resource]": (Resource("/rw/panel/opmode"),),
    "OperatingMode": OperatingMode.AUTO,
    "Sequence[str]": ("x",),
    "SignalChange": SignalChange.INVERT,
    "Privilege | None": Privilege.MODIFY,
    "Sequence[int]": (1,),
    "Increment": Increment.SMALL,
    "Mapping[str, str]": {"x": "x"},
    "datetime": datetime(2026, 1, 1, tzinfo=timezone.utc),
    "RunCycle": RunCycle.ONCE,
}
CALLS = sorted(
    name
    for name, _ in inspect.getmembers(RwsClient, inspect.isfunction)
    if not name.startswith("_") and name not in NOT_CALLS
)


def spelled_in_the_client() -> Iterator[str]:
    """The names in the client's sources: those of all types of states and of their fields are among them."""
    for source in SOURCES:
        for node in ast.walk(ast.parse(source.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                yield from (part for part in node.value.split("|") if NAME.fullmatch(part))


TYPES = sorted({name for name in spelled_in_the_client() if "-" in name})


class Garbage(dict[str, str]):
    """The fields of a state, whatever they are called."""

    def __missing__(self, name: str) -> str:
        return "garbage"

    def __contains__(self, name: object) -> bool:
        return True

    def get(self, name: str, default: Any = None) -> Any:
        return self[name]


def states(fields: Mapping[str, str]) -> tuple[RwsState, ...]:
    return tuple(RwsState(each, "garbage", fields) for each in TYPES)


PAGES = {
    "no state": (),
    "states without fields": states({}),
    "states whose fields are garbage": states(Garbage()),
}


class GarbledController:
    """A transport to a controller that answers everything."""

    address = "192.0.2.1"
    request_interval = 0.0

    def handle_request(self, request: httpx.Request) -> httpx.Response:
        return httpx.Response(200, headers={"Content-Type": "application/xhtml+xml"}, content=EMPTY)

    def open_socket(self, target: str, cookies: str, listener: Listener, timeout: float) -> OpenWebSocket:
        raise NotImplementedError

    def close(self) -> None:
        """No connection is open."""


EMPTY = b"<html><body><div class='state'/></body></html>"


@pytest.fixture
def client() -> RwsClient:
    return RwsClient(GarbledController(), clock=ManualClock())


def answer(monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    """Have all answers show the same states."""
    for reader in (service, client_module):
        monkeypatch.setattr(reader, "read_page", lambda content_type, body: Page("", "/", PAGES[kind]))


def called(client: RwsClient, name: str) -> object:
    """The result of a call with arguments of the types that it needs."""
    call = getattr(client, name)
    needed = [each for each in inspect.signature(call).parameters.values() if each.default is each.empty]
    positional = [SAMPLES[each.annotation] for each in needed if each.kind is each.POSITIONAL_OR_KEYWORD]
    return call(
        *positional, **{each.name: SAMPLES[each.annotation] for each in needed if each.kind is each.KEYWORD_ONLY}
    )


@pytest.mark.parametrize("kind", PAGES)
@pytest.mark.parametrize("name", CALLS)
def test_garbled_answer_is_read_or_refused_in_our_words(
    client: RwsClient, monkeypatch: pytest.MonkeyPatch, name: str, kind: str
) -> None:
    answer(monkeypatch, kind)
    with suppress(YumiError):
        called(client, name)


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("symbol_properties", "no state"),
        ("symbol_type", "states without fields"),
        ("build_errors", "states without fields"),
        ("read_message", "states without fields"),
        ("identity", "states without fields"),
        ("event", "no state"),
        ("event", "states whose fields are garbage"),
        ("event_domains", "states whose fields are garbage"),
        ("find_symbols", "states whose fields are garbage"),
    ],
)
def test_answer_without_meaning_is_an_error_of_the_protocol(
    client: RwsClient, monkeypatch: pytest.MonkeyPatch, name: str, kind: str
) -> None:
    answer(monkeypatch, kind)
    with pytest.raises(ProtocolError):
        called(client, name)
