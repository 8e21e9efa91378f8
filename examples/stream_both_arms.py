"""A policy of thirty points a second that moves both arms and a gripper: a stream without ROS.

Start `yumi controller` in another terminal, or give a robot's address: `python examples/stream_both_arms.py [address]`.
"""

import sys
import time
from math import cos

import yumi

RIGHT = yumi.degrees(0, -130, -135, 30, 0, 40, 0)
LEFT = yumi.degrees(0, -130, 135, 30, 0, 40, 0)
RATE = 30.0


def policy(moment: float) -> dict:
    """The next action: joint positions [rad] and widths of grippers [m]."""
    turn = 0.1 * (1.0 - cos(2.0 * moment))
    return {
        "right": (*RIGHT[:6], RIGHT[6] + turn),
        "left": (*LEFT[:6], LEFT[6] - turn),
        "grippers": {"right": 0.02 if moment < 1.5 else 0.04},
    }


def main(address: str) -> None:
    with yumi.connect(address) as robot:
        robot.move_to(right=RIGHT, left=LEFT)
        begin = time.monotonic()
        for number in range(95):  # half a turn of the policy takes 1.57 s
            due = begin + number / RATE
            time.sleep(max(0.0, due - time.monotonic()))
            robot.stream(**policy(due - begin), time=due)
        print(f"right arm: {robot.right.mode.value}, left arm: {robot.left.mode.value}")


if __name__ == "__main__":
    try:
        main(sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1")
    except yumi.errors.YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
