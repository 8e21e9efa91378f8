"""What the joint position controller does with a stream that is not as it should be, with a virtual arm."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, Joints, Side, home, joints
from yumi.control.controllers.joint_position import JointPositionController
from yumi.control.goals import CONFIGURED_DELAY, MemoryBuffer, SessionGoal, write_goal
from yumi.control.loop_events import ControllerReport
from yumi.control.motion.robot_response import RESPONSE_DELAY
from yumi.control.stream_monitor import StreamReport
from yumi_evaluation.virtual_time import VirtualArmRig

NAME = "joint_position_controller"
RATE = 30.0
START = home(Side.RIGHT)
SHARE = 1.0 + 1e-6  # of limits, by rounding


def turned(way: float) -> Joints:
    """The start with joint 1 turned [rad]."""
    return joints([START[0] + way, *START[1:]])


class Arm:
    """A virtual arm at home that follows streams."""

    def __init__(self) -> None:
        self._goals = MemoryBuffer[SessionGoal]()
        self.rig = VirtualArmRig({NAME: JointPositionController(self._goals)}, side=Side.RIGHT)
        self.rig.start()
        self.rig.run(0.2)
        self.rig.switch_to(NAME)
        self._first = len(self.rig.cycles)

    def send(self, position: Joints, time: float | None = None, delay: float = CONFIGURED_DELAY) -> None:
        """A point, for now where no time is given."""
        rig = self.rig
        now = rig.clock.now()
        write_goal(self._goals, rig.snapshot.session, position, time=now if time is None else time, delay=delay)

    def stream(self, way: Callable[[float], float], seconds: float, rate: float = RATE) -> None:
        """Points of joint 1 for a time: ``way`` [rad] of the time since the first."""
        for number in range(round(seconds * rate)):
            self.send(turned(way(number / rate)))
            self.rig.run(1.0 / rate)

    @property
    def sent(self) -> np.ndarray:
        """Positions of joint 1 that were sent [rad]."""
        return np.array([cycle.sent.position[0] for cycle in self.rig.cycles[self._first :]]) - START[0]

    @property
    def measured(self) -> float:
        """Where joint 1 is [rad]."""
        return self.rig.robot.arm.planned[0] - START[0]

    @property
    def codes(self) -> list[str]:
        """Of what the controller has reported."""
        reports = [event.report for event in self.rig.events if isinstance(event, ControllerReport)]
        return [report.said.code for report in reports if isinstance(report, StreamReport)]

    def assert_bounded(self) -> None:
        """No step in position, speed or acceleration left towards the robot."""
        speed = np.diff(self.sent, prepend=0.0) / CYCLE
        acceleration = np.diff(speed, prepend=0.0) / CYCLE
        jerk = np.diff(acceleration, prepend=0.0) / CYCLE
        assert abs(speed).max() <= SHARE * YUMI_LIMITS.velocity[0]
        assert abs(acceleration).max() <= SHARE * YUMI_LIMITS.acceleration[0]
        assert abs(jerk).max() <= SHARE * YUMI_LIMITS.jerk[0]


@pytest.fixture
def arm() -> Arm:
    return Arm()


def ramp(time: float) -> float:
    """From standstill to 0.3 rad/s within a second."""
    return 0.15 * min(time, 1.0) ** 2 + 0.3 * max(0.0, time - 1.0)


def test_stream_that_falls_silent_in_motion_is_braked_and_held(arm: Arm) -> None:
    arm.stream(ramp, 2.0)
    arm.rig.run(1.5)
    last = ramp(2.0 - 1.0 / RATE)
    assert last < arm.measured < last + 0.3 * 3.0 / RATE + 0.02  # three periods, and what it takes to brake
    assert np.ptp(arm.sent[-100:]) < 1e-9
    assert arm.codes == ["stream_followed", "stream_ended_in_motion"]
    arm.assert_bounded()


def test_stream_that_has_come_to_rest_ends_at_its_last_point(arm: Arm) -> None:
    arm.stream(lambda time: 0.1 * (1.0 - np.cos(np.pi * min(time, 1.0))), 1.2)
    arm.rig.run(1.0)
    assert arm.measured == pytest.approx(0.2, abs=1e-4)
    assert arm.codes == ["stream_followed"]


def test_single_point_is_gone_to(arm: Arm) -> None:
    arm.send(turned(0.5))
    arm.rig.run(2.0)
    assert arm.measured == pytest.approx(0.5, abs=1e-4)
    arm.assert_bounded()


def test_stream_goes_on_after_a_gap_without_a_step(arm: Arm) -> None:
    arm.stream(ramp, 2.0)
    arm.rig.run(0.5)
    arm.stream(lambda time: ramp(2.5) + ramp(time), 1.0)
    arm.assert_bounded()


def test_lost_points_are_bridged(arm: Arm) -> None:
    for number in range(90):
        if number % 10 != 5:
            arm.send(turned(ramp(number / RATE)))
        arm.rig.run(1.0 / RATE)
    assert arm.codes == ["stream_followed"]
    speed = np.diff(arm.sent)[-200:] / CYCLE
    assert speed == pytest.approx(0.3, abs=0.03)


def test_jump_is_gone_to_within_the_limits_and_reported(arm: Arm) -> None:
    arm.stream(lambda time: 0.0 if time < 0.5 else 0.8, 2.0)
    arm.rig.run(0.5)
    assert arm.measured == pytest.approx(0.8, abs=1e-3)
    assert "stream_jumps" in arm.codes
    arm.assert_bounded()


def test_stream_that_is_faster_than_the_joint_is_followed_within_the_limits_and_reported(arm: Arm) -> None:
    arm.stream(lambda time: 0.1 * np.sin(20.0 * time), 3.0, rate=100.0)  # up to 40 rad/s²
    assert "stream_beyond_limits" in arm.codes
    arm.assert_bounded()


@pytest.mark.parametrize(("rate", "is_told"), [(2.0, True), (5.0, True), (10.0, False), (500.0, False)])
def test_rate_out_of_the_range_is_reported(arm: Arm, rate: float, *, is_told: bool) -> None:
    begin = arm.rig.clock.now()
    for number in range(round(4.0 * rate)):
        while arm.rig.clock.now() < begin + number / rate:
            arm.rig.cycle()
        arm.send(START)
    assert ("stream_rate_out_of_range" in arm.codes) is is_told


def test_points_later_than_needed_are_reported_with_a_better_delay(arm: Arm) -> None:
    for number in range(90):
        arm.send(turned(ramp(number / RATE)), arm.rig.clock.now() - 0.04)
        arm.rig.run(1.0 / RATE)
    assert "stream_late" in arm.codes


def test_less_delay_than_a_period_is_no_reason_to_complain(arm: Arm) -> None:
    for number in range(90):
        arm.send(turned(ramp(number / RATE)), delay=0.0)
        arm.rig.run(1.0 / RATE)
    assert arm.codes == ["stream_followed"]


def test_point_that_is_not_newer_is_left_out(arm: Arm) -> None:
    arm.stream(ramp, 1.0)
    arm.send(turned(-0.5), arm.rig.clock.now() - 0.2)
    arm.rig.run(1.0 / RATE)
    arm.stream(lambda time: ramp(1.0 + 1.0 / RATE + time), 1.0)
    assert "stream_jumps" not in arm.codes
    assert np.diff(arm.sent).min() > -1e-4


def test_points_for_the_future_wait_until_they_are_needed(arm: Arm) -> None:
    for number in range(60):
        arm.send(turned(ramp(number / RATE)), arm.rig.clock.now() + 0.5)
        arm.rig.run(1.0 / RATE)
    assert arm.measured == pytest.approx(ramp(2.0 - 0.5 - 1.0 / RATE - RESPONSE_DELAY), abs=0.3 * 0.02)


def test_delay_that_changes_makes_no_step(arm: Arm) -> None:
    for number in range(120):
        arm.send(turned(ramp(number / RATE)), delay=0.06 if number < 60 else 0.15)
        arm.rig.run(1.0 / RATE)
    speed = np.diff(arm.sent)[-500:] / CYCLE
    assert speed.min() > 0.27
    arm.assert_bounded()


def test_gains_and_stream_take_over_from_each_other_without_a_step(arm: Arm) -> None:
    arm.stream(ramp, 1.5)
    arm.send(turned(ramp(1.5)), delay=float("nan"))
    arm.rig.run(1.0)
    arm.stream(lambda time: ramp(1.5) + ramp(time), 1.5)
    arm.assert_bounded()
