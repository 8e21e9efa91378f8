"""A motion that something stops: the rig of the recovery scenarios, in virtual time."""

from __future__ import annotations

from math import inf, radians

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import StopNotConfirmed
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, home, joints
from abb_runtime.faults import Fault
from abb_runtime.rws.transport import EXCHANGE_INTERVAL
from system.virtual_time_bench import System
from yumi.control.flight_recorder import RecordedCycle
from yumi.driver.state_machine import EgmMotionSettings

GOALS: dict[Side, Joints] = {
    Side.RIGHT: joints([radians(value) for value in (20.0, -118.4, -110.0, 40.0, -30.0, 42.5, 20.0)]),
    Side.LEFT: joints([radians(value) for value in (-20.0, -104.1, 110.0, 18.0, 31.0, 63.0, 20.0)]),
}
NEAR = radians(0.5)


class MovingSystem(System):
    """Both arms on their way to :data:`GOALS`, guided by the robot manager, which asks no faster than a robot bears.

    Attributes:
        told: what recovery has told, step by step.

    Args:
        motion: what EGM starts with.
    """

    def __init__(self, motion: EgmMotionSettings | None = None) -> None:
        super().__init__(motion=motion, request_interval=EXCHANGE_INTERVAL)
        self.told: list[str] = []
        self.client.lift_rate_limit()  # a start that has to wait for its turns takes 2 s more
        self.manager.start_egm()
        session = self.client._session
        session._rate_limit = session._own_limit
        self.go(GOALS)
        self.wait(0.3)

    def go(self, goals: dict[Side, Joints]) -> None:
        for side, goal in goals.items():
            self.arms[side].go(goal)

    def be_silent(self, seconds: float, *sides: Side) -> None:
        """The network loses the datagrams of some arms, or both, both ways; the controller goes on."""
        for side in sides or Side:
            self.faults.inject(Fault.EGM_SILENCE, side, seconds)
        self.wait(seconds + 0.05)

    def recover(self, confirmed: str = "") -> str:
        return self.manager.recover(self.told.append, confirmed=confirmed)

    def stop_id(self) -> str:
        """Id of the stop that waits for a person's confirmation, as recovery tells it."""
        with pytest.raises(StopNotConfirmed) as refusal:
            self.recover()
        return refusal.value.stop

    def recover_by_person(self) -> str:
        """A person looks at the robot and confirms the stop that recovery tells."""
        return self.recover(self.stop_id())

    def is_moving_again(self) -> bool:
        """Whether both arms reach new goals; what the next seconds of a demo would need."""
        goals = {side: home(side) for side in Side}
        self.go(goals)
        self.until(lambda: all(self.is_near(side, goals[side]) for side in Side), 4.0)
        return True

    def is_near(self, side: Side, goal: Joints) -> bool:
        position = self.arms[side].snapshot.position
        return max(abs(now - wanted) for now, wanted in zip(position, goal, strict=True)) < NEAR

    @property
    def largest_jump(self) -> float:
        """Of either arm, see :func:`largest_jump`."""
        return max(largest_jump(arm.recorder.frames()) for arm in self.arms.values())


def recovered(*events: str, done: str = "EGM runs on both arms, the controllers are active") -> str:
    """What recovery returns after a stop by ``events`` of the controller."""
    return str(message("recovered_after", events=events, done=done) if events else message("recovered", done=done))


def largest_jump(frames: tuple[RecordedCycle, ...], begin: float = -inf, end: float = inf) -> float:
    """Largest step of a command that the robot follows, from the one before it, or, when the robot begins to follow,
    from the arm; in shares of a joint's speed times a cycle. 0 where it follows none between ``begin`` and ``end`` [s].
    """
    steps = (
        abs(new - old) / (speed * CYCLE)
        for before, frame in zip((None, *frames), frames, strict=False)
        if frame.is_running and begin <= frame.time <= end
        for old, new, speed in zip(_origin(before, frame), frame.sent, YUMI_LIMITS.velocity, strict=True)
    )
    return max(steps, default=0.0)


def _origin(before: RecordedCycle | None, frame: RecordedCycle) -> Joints:
    is_followed = before is not None and before.is_running and before.session == frame.session
    return before.sent if before is not None and is_followed else frame.position
