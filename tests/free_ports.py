"""TCP ports for servers of a test."""

from __future__ import annotations

import socket

from abb_runtime.udp import free_port


def free_tcp_port() -> int:
    """A TCP port of this machine on which nobody listens."""
    return free_port(socket.SOCK_STREAM)
