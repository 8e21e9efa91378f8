"""Bring the robot back to ready after a stop, then start EGM on the left arm; needs `yumi up` in another terminal."""

import sys
import termios

import rclpy
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import Trigger
from yumi_interfaces.action import Recover, SetMode
from yumi_interfaces.msg import RobotState

RUNNING = "running", "RUN_EGM_ROUTINE"  # of EGM and of the state machine, which is read a moment later
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class RecoverRobot(Node):
    def __init__(self) -> None:
        super().__init__("recover")
        self.state = None
        self.create_subscription(RobotState, "yumi_robot_manager/state", self.take_state, LATCHED)
        self.recover = ActionClient(self, Recover, "yumi_robot_manager/recover")
        self.set_mode = ActionClient(self, SetMode, "yumi_robot_manager/set_mode")
        self.stop_egm = self.create_client(Trigger, "yumi_robot_manager/stop_egm")

    def take_state(self, message: RobotState) -> None:
        self.state = message

    def send(self, client: ActionClient, goal):
        """Send a goal and print its steps; the result, whose `success` and `message` say what was done."""
        if not client.wait_for_server(timeout_sec=10.0):
            raise RuntimeError("There is no action of yumi_robot_manager; start the driver with `yumi up`.")
        sent = client.send_goal_async(goal, feedback_callback=lambda message: print(f"  {message.feedback.step}"))
        rclpy.spin_until_future_complete(self, sent)
        ended = sent.result().get_result_async()
        try:
            rclpy.spin_until_future_complete(self, ended)
        except KeyboardInterrupt:
            rclpy.spin_until_future_complete(self, sent.result().cancel_goal_async(), timeout_sec=5.0)
            raise
        return ended.result().result

    def run(self) -> None:
        result = self.send(self.recover, Recover.Goal())
        stop = result.state.stop
        if not result.success and stop and stop in result.message:
            # An emergency stop, a guard stop or a collision: a person decides, not this program.
            print(result.message)
            if sys.stdin.isatty():
                termios.tcflush(sys.stdin, termios.TCIFLUSH)  # what was typed before the question does not count
            if input("Look at the robot. Type yes when it may move again: ") == "yes":
                result = self.send(self.recover, Recover.Goal(confirm_stop=stop))
        if not result.success:
            raise RuntimeError(result.message)
        print(result.message)

        result = self.send(self.set_mode, SetMode.Goal(mode="egm_left"))
        if not result.success:
            raise RuntimeError(result.message)
        end = self.get_clock().now().nanoseconds + 5e9
        while self.state is None or (self.state.left_egm, self.state.left_state_machine) != RUNNING:
            rclpy.spin_once(self, timeout_sec=0.1)
            if self.get_clock().now().nanoseconds > end:
                raise RuntimeError("EGM did not run on the left arm within 5 s.")
        print(f"left arm {self.state.left_state_machine}, right arm {self.state.right_state_machine}")

        future = self.stop_egm.call_async(Trigger.Request())
        rclpy.spin_until_future_complete(self, future, timeout_sec=30.0)
        print(future.result().message if future.done() else "stop_egm did not answer")


if __name__ == "__main__":
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)  # Ctrl-C stays Python's KeyboardInterrupt
    try:
        RecoverRobot().run()
    except RuntimeError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
