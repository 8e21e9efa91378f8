"""Swing the last axis of any ABB robot by 5 degrees, with EGM in joint mode.

Start it, then run EGMRunJoint on the controller: `python examples/egm_joint.py [port [address]]`.
"""

import sys
from math import cos, pi, radians
from signal import SIGINT, signal

from abb_protocols.errors import YumiError
from yumi import EgmServer

AMPLITUDE = radians(5.0)
PERIOD = 4.0  # [s]


def swing(server: EgmServer, duration: float) -> None:
    """Swing for ``duration`` [s] of robot time."""
    for state in server:
        if state.is_first:
            start, elapsed = state.joints, 0.0
        elapsed += state.dt
        swung = AMPLITUDE * (1.0 - cos(2.0 * pi * elapsed / PERIOD)) / 2.0
        server.send(joints=[*start[:-1], start[-1] + swung])
        if elapsed >= duration:
            return


def main(port: int, robot: str | None) -> None:
    with EgmServer(port, robot=robot) as server:
        signal(SIGINT, lambda *_: server.stop())  # Ctrl-C ends the loop in order
        swing(server, duration=2 * PERIOD)


if __name__ == "__main__":
    try:
        main(int(sys.argv[1]) if len(sys.argv) > 1 else 6510, next(iter(sys.argv[2:]), None))
    except YumiError as error:
        sys.exit(f"Error: {error}")
