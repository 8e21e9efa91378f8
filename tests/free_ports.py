"""TCP ports for servers of a test: below those that the system gives to clients, so that none is taken by chance."""

from __future__ import annotations

import random
import socket


def free_tcp_port() -> int:
    """A TCP port of this machine on which nobody listens."""
    while True:
        port = random.SystemRandom().randrange(10_000, 32_000)  # Linux gives clients 32768 to 60999
        with socket.socket() as probe:
            try:
                probe.bind(("127.0.0.1", port))
            except OSError:
                continue
            return port
