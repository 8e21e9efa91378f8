"""What the fixtures of pytest refuse."""

from __future__ import annotations

from collections.abc import Mapping

from abb_protocols.catalogue.text import Text

TESTING: Mapping[str, Text] = {
    "memory_gave_no_answer": Text("memory closed the connection without an HTTP answer"),
    "memory_opened_no_websocket": Text("memory does not open a WebSocket"),
}
