"""A perfect arm in memory: it is wherever it was told to be one cycle ago. For controllers under test."""

from __future__ import annotations

from yumi.control.port import WireCounters
from yumi.robot.cycle import CYCLE
from yumi.robot.joints import Joints, joints
from yumi.robot.values import ZERO, ArmCommand, ArmState


class PerfectArm:
    """An arm without dynamics; every ``read`` is one cycle later.

    Attributes:
        is_running: whether it follows commands; set it to stop the robot.

    Args:
        position: where it begins, chain order [rad].
    """

    def __init__(self, position: Joints) -> None:
        self.is_running = True
        self._position = position
        self._velocity = ZERO
        self._dt = 0.0

    def read(self, now: float) -> ArmState | None:
        state = ArmState(now, self._dt, 1, self._position, self._velocity, self._position, self.is_running)
        self._dt = CYCLE
        return state

    def write(self, command: ArmCommand) -> None:
        if not self.is_running:
            return
        way = zip(self._position, command.position, strict=True)
        self._velocity = joints([(new - old) / CYCLE for old, new in way])
        self._position = command.position

    def silence(self, now: float) -> float:
        return 0.0

    def lost_after(self, now: float) -> float | None:
        return None

    def wire_counters(self) -> WireCounters:
        return WireCounters(session=1)
