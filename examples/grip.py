"""Open and close both grippers; needs `yumi up` in another terminal."""

import sys

import rclpy
from action_msgs.msg import GoalStatus
from control_msgs.action import GripperCommand
from rclpy.action import ActionClient


def send(node, client: ActionClient, position: float):
    """Send the fingers to `position` [m]; a future of the result."""
    goal = GripperCommand.Goal()
    goal.command.position = position
    sent = client.send_goal_async(goal)
    rclpy.spin_until_future_complete(node, sent)
    if not sent.result().accepted:
        raise RuntimeError("The gripper refused the goal; the topic gripper/state and the driver's log say why.")
    return sent.result().get_result_async()


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("grip")
    clients = {
        "right": ActionClient(node, GripperCommand, "r/gripper/gripper_cmd"),
        "left": ActionClient(node, GripperCommand, "l/gripper/gripper_cmd"),
    }
    for side, client in clients.items():
        if not client.wait_for_server(timeout_sec=10.0):
            raise RuntimeError(f"The {side} gripper has no action gripper_cmd; start the driver with `yumi up`.")

    for word, position in (("open", 0.025), ("closed", 0.0)):  # each finger from the middle [m]
        results = {side: send(node, client, position) for side, client in clients.items()}
        for side, future in results.items():
            rclpy.spin_until_future_complete(node, future)
            result = future.result().result
            if future.result().status != GoalStatus.STATUS_SUCCEEDED:
                raise RuntimeError(f"The {side} gripper did not do it; the driver's log says why.")
            ended = ("holding" if result.effort > 0.0 else "stalled") if result.stalled else word
            print(f"{side} gripper: {ended}, {result.position * 2e3:.1f} mm between the fingers")


if __name__ == "__main__":
    try:
        main()
    except RuntimeError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
