"""Plan a motion of the right arm around a box, look at it, and execute it; then one of both arms. Without ROS.

Needs `pip install "yumi-ros2[planning]"`. Start `yumi controller` in another terminal, or give a robot's address:
`python examples/plan_around.py [address]`.
"""

import sys
from math import pi

import yumi

CRATE = {"crate": (yumi.pose(0.45, -0.20, 0.08), (0.16, 0.08, 0.16))}  # the pose of its centre, and its edges [m]
GRIPPER = 0.1142  # [m] from tool0 to the fingertips
BESIDE = yumi.pose(0.45, -0.32, 0.10 + GRIPPER, rpy=(pi, 0, 0))  # of tool0, which points down
BEHIND = yumi.pose(0.45, -0.08, 0.10 + GRIPPER, rpy=(pi, 0, 0))


def main(address: str) -> None:
    with yumi.connect(address) as robot:
        robot.move_to(right="ready", left="ready")
        robot.execute(robot.plan_to(right=BESIDE, boxes=CRATE))
        plan = robot.plan_to(right=BEHIND, boxes=CRATE)
        print(f"found in {plan.planning_time:.1f} s: a motion of {plan.duration:.1f} s around the crate")
        robot.execute(plan)
        robot.execute(robot.plan_to(right="home", left="home", boxes=CRATE))
        print("back at home")


if __name__ == "__main__":
    try:
        main(sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1")
    except yumi.errors.YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
