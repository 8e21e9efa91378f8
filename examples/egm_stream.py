"""Show where any ABB robot is, twice a second, from EGM's position stream; nothing is sent.

Start it, then run EGMStreamStart on the controller: `python examples/egm_stream.py [port [address]]`.
"""

import sys
from collections.abc import Callable
from math import degrees

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


if __name__ == "__main__":
    with EgmServer(int(sys.argv[1]) if len(sys.argv) > 1 else 6510, robot=next(iter(sys.argv[2:]), None)) as server:
        watch(server, print)
