"""Turn the last axis of any ABB robot forth and back at up to 5 degrees per second, with EGM as a velocity loop.

Start it, then run EGMRunJoint with PosCorrGain 0 on the controller: `python examples/egm_velocity.py [port [address]]`.
"""

import sys
from math import pi, radians, sin
from signal import SIGINT, signal

from abb_protocols.errors import YumiError
from yumi import EgmServer

SPEED = radians(5.0)  # [rad/s]
PERIOD = 4.0  # [s]


def turn(server: EgmServer, duration: float) -> None:
    """Turn for ``duration`` [s] of robot time, then stop: without an answer the robot would go on at its last speed."""
    elapsed, rest = 0.0, []
    for state in server:
        elapsed = 0.0 if state.is_first else elapsed + state.dt
        rest = [0.0] * len(state.joints)
        if elapsed >= duration:
            break
        server.send(speed=[*rest[:-1], SPEED * sin(2.0 * pi * elapsed / PERIOD)])
    if rest:  # also after Ctrl-C
        server.send(speed=rest)


def main(port: int, robot: str | None) -> None:
    with EgmServer(port, robot=robot) as server:
        signal(SIGINT, lambda *_: server.stop())  # Ctrl-C ends the loop in order
        turn(server, duration=2 * PERIOD)


if __name__ == "__main__":
    try:
        main(int(sys.argv[1]) if len(sys.argv) > 1 else 6510, next(iter(sys.argv[2:]), None))
    except YumiError as error:
        sys.exit(f"Error: {error}")
