"""Move one joint of the right arm by 10 degrees and back; needs `yumi up` in another terminal."""

import sys
from math import radians

import rclpy
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_srvs.srv import Trigger

JOINT = "yumi_joint_6_r"
STEP, TOLERANCE = radians(10.0), radians(0.1)


class MoveOneJoint(Node):
    def __init__(self) -> None:
        super().__init__("move_one_joint")
        self.positions = {}
        self.egm = {}
        self.create_subscription(JointState, "r/joint_states", self.take_state, 10)
        self.create_subscription(DiagnosticStatus, "r/egm_state", self.take_egm_state, 10)
        self.goals = self.create_publisher(JointState, "r/joint_commands", 10)
        self.start_egm = self.create_client(Trigger, "yumi_robot_manager/start_egm")
        self.stop_egm = self.create_client(Trigger, "yumi_robot_manager/stop_egm")

    def take_state(self, message: JointState) -> None:
        self.positions = dict(zip(message.name, message.position, strict=True))

    def take_egm_state(self, message: DiagnosticStatus) -> None:
        self.egm = {pair.key: pair.value for pair in message.values}

    def call(self, client) -> str:
        future = client.call_async(Trigger.Request())
        rclpy.spin_until_future_complete(self, future, timeout_sec=30.0)
        if not future.done():
            raise RuntimeError(f"{client.srv_name} did not answer within 30 s.")
        if not future.result().success:
            raise RuntimeError(future.result().message)
        return future.result().message

    def move_to(self, goal: float) -> float:
        """Move the joint to `goal` [rad]; the error that is left."""
        self.goals.publish(JointState(name=[JOINT], position=[goal]))  # the other joints keep their goals
        end = self.get_clock().now().nanoseconds + 10e9
        while abs(self.positions[JOINT] - goal) > TOLERANCE:
            rclpy.spin_once(self, timeout_sec=0.1)
            if self.egm["commanded"] != "True":
                raise RuntimeError("The arm was stopped; the driver's log says why.")
            if self.get_clock().now().nanoseconds > end:
                raise RuntimeError(f"{JOINT} is not at its goal after 10 s; the driver's log says why.")
        return abs(self.positions[JOINT] - goal)

    def run(self) -> None:
        if not self.start_egm.wait_for_service(timeout_sec=10.0):
            raise RuntimeError("There is no service yumi_robot_manager/start_egm; start the driver with `yumi up`.")
        print(self.call(self.start_egm))
        is_listening = self.goals.get_subscription_count
        while JOINT not in self.positions or self.egm.get("commanded") != "True" or not is_listening():
            rclpy.spin_once(self, timeout_sec=0.1)
        start = self.positions[JOINT]
        for goal in (start + STEP, start):
            print(f"arrived, joint error {self.move_to(goal):.5f} rad")


def main() -> None:
    # Ctrl-C must stay Python's KeyboardInterrupt: ROS has to work until EGM has ended.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = MoveOneJoint()
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
