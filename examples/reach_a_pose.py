"""Bring a tool to a pose: all joints together, on a straight line, and with the elbow somewhere else.

Start `yumi controller` in another terminal, or give a robot's address: `python examples/reach_a_pose.py [address]`.
"""

import sys
from math import degrees, pi

import yumi

ABOVE = yumi.pose(0.40, -0.15, 0.25, rpy=(pi, 0, 0))  # the gripper points down
ON_TABLE = yumi.pose(0.40, -0.15, 0.15, rpy=(pi, 0, 0))


def main(address: str) -> None:
    with yumi.connect(address, arms="right") as robot:
        arm = robot.right
        arm.tool = "fingertips"
        arm.move_to("ready")

        arm.move_to_pose(ABOVE)  # a path that is easy for the joints
        arm.move_linear(ON_TABLE, speed=0.1)  # straight down, 0.1 m/s
        x, y, z = arm.pose.position
        print(f"fingertips at {x:.3f}, {y:.3f}, {z:.3f} m")

        arm.move_linear(ABOVE)
        postures = arm.inverse_kinematics(ABOVE)
        print(f"{len(postures)} postures reach the pose with an arm angle of {degrees(arm.arm_angle):.0f} degrees")
        arm.move_linear(ABOVE, arm_angle=arm.arm_angle - 0.3)  # the tool stays, the elbow turns
        print(f"arm angle {degrees(arm.arm_angle):.0f} degrees")


if __name__ == "__main__":
    try:
        main(sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1")
    except yumi.errors.YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
