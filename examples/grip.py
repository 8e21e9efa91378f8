"""Open and close both grippers; needs `yumi up` in another terminal."""

import rclpy

from yumi.robot.joints import Side
from yumi.ros.clients import GripperClient, Spinner


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("grip")
    spinner = Spinner(node)
    grippers = {side: GripperClient(spinner, side) for side in Side}

    for position in (0.025, 0.0):
        results = {side: gripper.begin(position) for side, gripper in grippers.items()}
        for side, wait in results.items():
            grip = wait()
            print(f"{side.word} gripper: {grip.word} at {grip.position * 1e3:.1f} mm")

    spinner.close()
    node.destroy_node()
    rclpy.shutdown()


if __name__ == "__main__":
    main()
