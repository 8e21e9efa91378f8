"""Drive a tool with the sticks of a gamepad: velocities, 50 times a second.

The gamepad is played back here, so that the example runs anywhere; `Sticks` is where yours goes (pygame, evdev, a
phone). Start `yumi controller` in another terminal, or give a robot's address: `python examples/gamepad.py [address]`.
"""

import sys
import time
from math import pi, sin

import yumi

RATE = 50.0  # [Hz]
FASTEST, TURNING = 0.08, 0.4  # [m/s], [rad/s] of a stick that is pushed all the way
START = yumi.pose(0.40, -0.20, 0.20, rpy=(pi, 0, 0))


class Sticks:
    """Left stick: to the sides and away; right stick: up, and about the tool's own axis. Each from -1 to 1."""

    def at(self, elapsed: float) -> tuple[float, float, float, float]:
        return sin(2.0 * elapsed), sin(3.0 * elapsed), 0.3 * sin(elapsed), 0.5 * sin(2.5 * elapsed)


def main(address: str, seconds: float = 3.0) -> None:
    with yumi.connect(address, arms="right") as robot:
        arm, sticks = robot.right, Sticks()
        arm.tool = "fingertips"
        arm.move_to("ready")
        arm.move_to_pose(START)
        begin = time.monotonic()
        while (elapsed := time.monotonic() - begin) < seconds:
            sideways, away, up, turn = sticks.at(elapsed)
            arm.servo_twist((FASTEST * away, FASTEST * sideways, FASTEST * up), (0, 0, TURNING * turn))
            time.sleep(1.0 / RATE)
        time.sleep(0.5)  # without a velocity the tool stops by itself
        x, y, z = arm.pose.position
        print(f"fingertips at {x:.3f}, {y:.3f}, {z:.3f} m, {arm.mode.value}")


if __name__ == "__main__":
    try:
        main(sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1")
    except yumi.errors.YumiError as error:
        sys.exit(f"Error: {error}")
    except KeyboardInterrupt:
        sys.exit("Stopped.")
