"""Hand a rod from the right gripper to the left one: both tools come together on lines that begin and end together.

Start `yumi controller --right-object 0.02 --left-object 0.02` in another terminal, or give a robot's address:
`python examples/hand_over.py [address]`. It opens the right gripper, then asks for a rod, 10 cm long and 2 cm thick.
"""

import sys
import termios
from math import pi

import yumi

ROD = 0.02  # [m] thick
FREE = 0.08  # [m] of the rod stick out beyond the right fingertips: more than the fingertips are apart at last
APART, NEAR = 0.11, 0.03  # [m] of the fingertips from where the arms meet
X, Z = 0.40, 0.25  # of that place, between the arms


def poses(away: float) -> dict:
    """Poses of both fingertips at so much from the place, looking at each other."""
    return {
        "right": yumi.pose(X, -away, Z, rpy=(-pi / 2, pi, 0)),
        "left": yumi.pose(X, away, Z, rpy=(pi / 2, pi, 0)),
    }


def ask(sentence: str) -> None:
    """Wait until a person has pressed Enter; go on where no terminal asks one."""
    if sys.stdin.isatty():
        termios.tcflush(sys.stdin, termios.TCIFLUSH)  # what was typed before the question does not count
        input(f"{sentence}, then press Enter. ")


def main(address: str) -> None:
    with yumi.connect(address) as robot:
        giver, taker = robot.right, robot.left
        giver.tool = taker.tool = "fingertips"
        robot.move_to(right="ready", left="ready")
        giver.gripper.open()
        taker.gripper.open()
        ask(f"Hold the rod between the right fingers so that {1e3 * FREE:.0f} mm of it stick out beyond them")
        giver.gripper.grasp(width=ROD)
        ask("Let go of the rod and step back: the arms move next")

        giver.move_to_pose(poses(APART)["right"])
        taker.move_to_pose(poses(APART)["left"])
        robot.move_linear(**poses(NEAR), speed=0.05)
        taker.gripper.grasp(width=ROD)
        giver.gripper.open()
        robot.move_linear(**poses(APART), speed=0.1)
        print(f"the left gripper holds it: {taker.gripper.is_holding}, the right one: {giver.gripper.is_holding}")


if __name__ == "__main__":
    try:
        main(sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1")
    except yumi.errors.YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
