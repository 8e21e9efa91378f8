"""Send a goal that the right arm cannot reach, and show the driver's refusal; needs `yumi up` in another terminal."""

import sys

import rclpy
from rcl_interfaces.msg import Log
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

JOINT, BAD_GOAL = "yumi_joint_2_r", 4.0  # it goes from -2.5 to 0.76 rad


class BadGoal(Node):
    def __init__(self) -> None:
        super().__init__("bad_goal")
        self.positions = None
        self.refusals = []
        self.create_subscription(JointState, "r/joint_states", self.take_state, 10)
        self.create_subscription(Log, "/rosout", self.take_log, 100)
        self.goals = self.create_publisher(JointState, "r/joint_commands", 10)
        self.start_egm = self.create_client(Trigger, "yumi_robot_manager/start_egm")
        self.stop_egm = self.create_client(Trigger, "yumi_robot_manager/stop_egm")

    def take_state(self, message: JointState) -> None:
        self.positions = message.position

    def take_log(self, line: Log) -> None:
        if line.msg.startswith("Goal refused"):
            self.refusals.append(line.msg)

    def call(self, client) -> str:
        future = client.call_async(Trigger.Request())
        rclpy.spin_until_future_complete(self, future, timeout_sec=30.0)
        if not future.done() or not future.result().success:
            raise RuntimeError(future.result().message if future.done() else f"{client.srv_name} did not answer.")
        return future.result().message

    def run(self) -> None:
        if not self.start_egm.wait_for_service(timeout_sec=10.0):
            raise RuntimeError("There is no service yumi_robot_manager/start_egm; start the driver with `yumi up`.")
        print(self.call(self.start_egm))
        while self.positions is None:
            rclpy.spin_once(self, timeout_sec=0.1)
        start, end = self.positions, self.get_clock().now().nanoseconds + 10e9
        while not self.refusals:
            self.goals.publish(JointState(name=[JOINT], position=[BAD_GOAL]))
            rclpy.spin_once(self, timeout_sec=0.1)
            if self.get_clock().now().nanoseconds > end:
                raise RuntimeError("The driver did not refuse the goal within 10 s.")
        print(self.refusals[0])
        moved = max(abs(now - before) for now, before in zip(self.positions, start, strict=True))
        print(f"the arm moved by {moved:.4f} rad")


def main() -> None:
    # Ctrl-C must stay Python's KeyboardInterrupt: ROS has to work until EGM has ended.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = BadGoal()
    try:
        node.run()
    finally:
        if node.stop_egm.service_is_ready():
            print(node.call(node.stop_egm))


if __name__ == "__main__":
    try:
        main()
    except RuntimeError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
