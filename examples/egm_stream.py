"""Show where any ABB robot is, twice a second, from EGM's position stream; nothing is sent.

Start it, then run EGMStreamStart on the controller: `python examples/egm_stream.py [port [address]]`.
"""

import sys
from collections.abc import Callable
from math import degrees
from signal import SIGINT, signal

from abb_protocols.errors import YumiError
from yumi import EgmServer

INTERVAL = 0.5  # [s]


def watch(server: EgmServer, show: Callable[[str], object]) -> None:
    """Until the server is stopped."""
    elapsed = INTERVAL
    for state in server:
        elapsed += state.dt
        if elapsed >= INTERVAL:
            elapsed = 0.0
            joints = "  ".join(f"{degrees(value):8.2f}" for value in state.joints)
            show(f"{state.message.measured_time:10.3f} s  {joints}")


def main(port: int, robot: str | None) -> None:
    with EgmServer(port, robot=robot) as server:
        signal(SIGINT, lambda *_: server.stop())  # Ctrl-C ends the loop in order
        watch(server, print)


if __name__ == "__main__":
    try:
        main(int(sys.argv[1]) if len(sys.argv) > 1 else 6510, next(iter(sys.argv[2:]), None))
    except YumiError as error:
        sys.exit(f"Error: {error}")
