"""Move one joint of the right arm by 10 degrees and back; needs `yumi up` in another terminal."""

from math import radians

import rclpy

from yumi.robot.joints import Side, joints
from yumi.ros.clients import ArmClient, RobotManagerClient, Spinner


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("move_one_joint")
    spinner = Spinner(node)
    manager = RobotManagerClient(spinner)
    arm = ArmClient(spinner, Side.RIGHT, on_state=lambda time, position: None)

    print(manager.start_egm())
    start = arm.wait_for_state(5.0)
    for goal in (joints([*start[:6], start[6] + radians(10.0)]), start):
        arm.move(goal)
        spinner.until(lambda goal=goal: arm.error(goal) < radians(0.1), 10.0, "Arrival")
        print(f"arrived, largest joint error {arm.error(goal):.5f} rad")
    print(manager.stop_egm())

    spinner.close()
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
