"""Move the tool of any six-axis ABB robot round a circle of 40 mm, with EGM in pose mode.

Start it, then run EGMRunPose on the controller: `python examples/egm_pose.py [port [address]]`.
"""

import sys
from dataclasses import replace
from math import cos, pi, sin
from signal import SIGINT, signal

from abb_protocols.errors import RobotNotReady, YumiError
from yumi import EgmServer

RADIUS = 0.02  # [m]
PERIOD = 4.0  # [s]


def circle(server: EgmServer, rounds: int) -> None:
    """Go round in the y-z plane, beginning and ending where the tool is."""
    for state in server:
        if state.is_first:
            start, elapsed = state.pose, 0.0
        if start is None:
            raise RobotNotReady("The robot sends no pose; run EGMSetupUC with \\Pose.")
        elapsed += state.dt
        x, y, z = start.position
        angle = 2.0 * pi * min(elapsed / PERIOD, float(rounds))
        server.send(pose=replace(start, position=(x, y + RADIUS * sin(angle), z + RADIUS * (1.0 - cos(angle)))))
        if elapsed >= rounds * PERIOD:
            return


def main(port: int, robot: str | None) -> None:
    with EgmServer(port, robot=robot) as server:
        signal(SIGINT, lambda *_: server.stop())  # Ctrl-C ends the loop in order
        circle(server, rounds=4)


if __name__ == "__main__":
    try:
        main(int(sys.argv[1]) if len(sys.argv) > 1 else 6510, next(iter(sys.argv[2:]), None))
    except YumiError as error:
        sys.exit(f"Error: {error}")
