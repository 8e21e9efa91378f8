"""Draw a square with rounded corners on a sheet of paper that is a work object, then a line with both arms.

Start `yumi controller` in another terminal, or give a robot's address: `python examples/draw_a_square.py [address]`.
"""

import sys
from math import pi

import yumi

SIDE = 0.10  # [m]
PEN = yumi.pose(0, 0, 0.12)  # its tip, seen from tool0
PAPER = yumi.pose(0.40, -0.20, 0.10)  # seen from the robot's body
CORNERS = [(0, 0), (SIDE, 0), (SIDE, SIDE), (0, SIDE), (0, 0)]


def on_paper(x: float, y: float, height: float = 0.0):
    """A pose of the pen, seen from the paper."""
    return yumi.pose(x, y, height, rpy=(pi, 0, 0))


def main(address: str) -> None:
    with yumi.connect(address) as robot:
        robot.tools["pen"] = PEN
        robot.work_objects["paper"] = PAPER
        robot.move_to(right="ready", left="ready")

        pen = robot.right
        pen.tool = "pen"
        pen.move_to_pose(on_paper(0, 0, 0.05), work_object="paper")
        pen.move_linear(on_paper(0, 0), work_object="paper")
        pen.move_through([on_paper(x, y) for x, y in CORNERS[1:]], work_object="paper", zone=0.01, speed=0.1)
        pen.move_linear(on_paper(0, 0, 0.05), work_object="paper")
        print("the square is drawn")

        up = yumi.pose(0, 0, 0.05)
        right, left = (lifted(arm.pose, up) for arm in (robot.right, robot.left))
        robot.move_linear(right=right, left=left, speed=0.1)  # both begin and end together
        print("both arms have moved up")


def lifted(pose, by):
    x, y, z = pose.position
    return yumi.pose(x, y, z + by.position[2], pose.orientation)


if __name__ == "__main__":
    try:
        main(sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1")
    except yumi.errors.YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
