"""A leader arm for `yumi teleop`: seven angles and a clutch, sixty times a second; an arm of the robot follows them.

The leader is played back here, so that the example runs anywhere; `Played.read` is where yours is read, such as the
servos of a GELLO. With a driver that runs:

    yumi teleop leader --leader examples/leader_arm.py:Played --arm right
"""

import time
from math import cos

from yumi.api.teleoperation_devices import LeaderReading


class Played:
    """Its clutch is pressed after a second; two of its joints go to and back."""

    def __init__(self) -> None:
        self.begin = time.monotonic()

    def read(self) -> LeaderReading:
        elapsed = time.monotonic() - self.begin
        is_pressed = elapsed > 1.0
        angle = 0.1 * (1.0 - cos(elapsed - 1.0)) if is_pressed else 0.0
        return LeaderReading(joints=(angle, 0.0, 0.0, 0.0, 0.0, 0.0, -angle), clutch=is_pressed)
