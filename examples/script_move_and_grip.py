"""Move the right arm, then grip with the left gripper: a script without ROS.

Start `yumi controller --left-object 0.02` in another terminal, or give a robot's address:
`python examples/script_move_and_grip.py [address]`.
"""

import sys

import yumi

HOME = yumi.degrees(0, -130, -135, 30, 0, 40, 0)
LIFTED = yumi.degrees(20, -110, -135, 30, 0, 40, 0)


def main(address: str) -> None:
    with yumi.connect(address) as robot:
        for goal in (HOME, LIFTED, HOME):
            robot.right.move_to(goal)
            x, y, z = robot.right.pose.position
            print(f"right tool at {x:.3f}, {y:.3f}, {z:.3f} m")

        robot.left.gripper.open()
        grip = robot.left.gripper.grasp(force=10.0, width=0.02)
        print(f"left gripper: {grip.outcome.value} at {grip.width * 1e3:.0f} mm")


if __name__ == "__main__":
    try:
        main(sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1")
    except yumi.errors.YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
