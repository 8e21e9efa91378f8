"""Turn the last axis of any ABB robot forth and back at up to 5 degrees per second, with EGM as a velocity loop.

Start it, then run EGMRunJoint with PosCorrGain 0 on the controller: `python examples/egm_velocity.py [port [address]]`.
"""

import sys
from math import pi, radians, sin

from yumi import EgmServer

SPEED = radians(5.0)  # [rad/s]
PERIOD = 4.0  # [s]


def turn(server: EgmServer, duration: float) -> None:
    """Turn for ``duration`` [s] of robot time, then stop: without an answer the robot would go on as it was told."""
    elapsed = 0.0
    for state in server:
        elapsed = 0.0 if state.is_first else elapsed + state.dt
        rest = [0.0] * (len(state.joints) - 1)
        if elapsed >= duration:
            server.send(speed=[*rest, 0.0])
            return
        server.send(speed=[*rest, SPEED * sin(2.0 * pi * elapsed / PERIOD)])


if __name__ == "__main__":
    with EgmServer(int(sys.argv[1]) if len(sys.argv) > 1 else 6510, robot=next(iter(sys.argv[2:]), None)) as server:
        turn(server, duration=4 * PERIOD)
