"""Our control loop with the whole ROS 2 graph of the driver, and a subscriber process on each of its topics.

The load generator is the robot, so there is no controller to talk to: the robot manager and the grippers behind the
services, actions and topics are stand-ins that say so. All else is the driver's own.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from threading import Event as Flag
from threading import Thread
from typing import NoReturn

import rclpy
from driven_loop import DrivenLoop, read_arguments, read_plan
from parent import end_with_parent
from rclpy.executors import SingleThreadedExecutor

from abb_protocols.catalogue import message
from abb_protocols.errors import RobotNotReady
from abb_protocols.robot.joints import Pose, Side
from abb_protocols.robot.kinematics import IDENTITY_QUATERNION
from abb_runtime.clock import SystemClock
from yumi.driver.robot_state import RobotState
from yumi.driver.speed_setting import SpeedSetting
from yumi.ros.gripper_actions import GripperParts
from yumi.ros.ros_driver import RosDriver, close_ros, open_ros

BURST = 0.010
"""How long the busy callback computes [s]."""

BURST_PERIOD = BURST / 0.3
"""It keeps its process busy for 30 % of the time [s]."""


class AbsentRobot:
    """In the place of a robot manager, its monitor, or the grippers and their signals."""

    speed = SpeedSetting()
    egm_arms = tuple(Side)

    def __getattr__(self, name: str) -> Callable[..., NoReturn]:
        return self.refuse

    def refuse(self, *_: object) -> NoReturn:
        raise RobotNotReady(message("benchmark_without_controller"))

    @property
    def monitor(self) -> AbsentRobot:
        return self

    def joints(self, side: Side) -> None:
        """No joints are read from it."""

    def read_joints(self) -> None:
        """There are none to read."""

    def tcp(self, side: Side) -> Pose:
        """Without a tool."""
        return Pose((0.0, 0.0, 0.0), IDENTITY_QUATERNION)

    def when_ready(self, prepare: Callable[[], None]) -> None:
        """It never is."""

    def state(self, side: Side | None = None) -> RobotState | None:
        """Nothing is known of it, nor of the gripper of a side."""
        return RobotState() if side is None else None

    def close(self) -> None:
        """Nothing to close."""


class BusyCallback:
    """A timer of a user's node in the driver's process that holds the interpreter for 10 ms at a time."""

    def __init__(self) -> None:
        self._node = rclpy.create_node("busy")
        self._node.create_timer(BURST_PERIOD, self._compute)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._is_over = Flag()
        self._thread = Thread(target=self._spin, name="busy")
        self._thread.start()

    def stop(self) -> None:
        self._is_over.set()
        self._thread.join()
        self._executor.shutdown()
        self._node.destroy_node()

    def _spin(self) -> None:
        while not self._is_over.is_set():
            self._executor.spin_once(timeout_sec=0.1)

    def _compute(self) -> None:
        end, number = time.monotonic() + BURST, 0
        while time.monotonic() < end:
            number = (number * 1103515245 + 12345) % 2147483648


class Subscriber:
    """The subscriber process."""

    def __init__(self) -> None:
        script = Path(__file__).with_name("subscriber.py")
        self._process = subprocess.Popen(
            [sys.executable, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert self._process.stdout is not None
        self._process.stdout.readline()  # it listens

    def stop(self) -> str:
        """End it; returns what it heard."""
        heard, _ = self._process.communicate()
        return heard.strip()


def main() -> None:
    arguments = read_arguments()
    settings, plan = read_plan(arguments)
    line = DrivenLoop(settings, plan, arguments.goal)
    open_ros()
    absent = AbsentRobot()
    grippers = GripperParts(dict.fromkeys(Side, absent), absent, settings.gripper)
    driver = RosDriver(line.control, plan.controllers, absent, grippers, settings, SystemClock(), plan.limits)
    line.start()
    driver.start()
    busy = BusyCallback() if arguments.busy else None
    subscriber = Subscriber()
    line.run()
    print(f"heard {subscriber.stop()}", flush=True)
    if busy:
        busy.stop()
    driver.stop()
    close_ros()


if __name__ == "__main__":  # the control process imports this module again
    end_with_parent()
    main()
