"""PyPI's ABBRobotEGM in the loop its documentation shows: receive with a timeout, compute, send.

python abb_robot_egm_loop.py <port> <gain> <goal of axes 1-6 and 7 [deg], separated by commas>
"""

from __future__ import annotations

import os
import sys

import numpy as np
from ABBRobotEGM import EGM
from parent import end_with_parent, say_ready

RECEIVE_TIMEOUT = 0.1


def main(port: int, gain: float, goal: list[float]) -> None:
    goal_robax, goal_external = np.array(goal[:6]), np.array(goal[6:])
    with EGM(port) as egm:
        say_ready(os.getpid())
        while True:
            success, state = egm.receive_from_robot(timeout=RECEIVE_TIMEOUT)
            if success:
                robax = state.joint_angles + gain * (goal_robax - state.joint_angles)
                external = state.external_axes + gain * (goal_external - state.external_axes)
                egm.send_to_robot(robax, external_joints=external)


end_with_parent()
main(int(sys.argv[1]), float(sys.argv[2]), [float(value) for value in sys.argv[3].split(",")])
