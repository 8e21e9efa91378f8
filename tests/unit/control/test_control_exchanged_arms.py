from __future__ import annotations

import pytest

from abb_protocols.catalogue import message
from abb_protocols.robot.joints import CYCLE, YUMI_LIMITS, ZERO_JOINTS, ArmState, Joints, Side
from reported_limiter import ReportedLimiter
from yumi.control.counters import LimiterCounters, WireCounters
from yumi.control.goals import MemoryBuffer
from yumi.control.loop_events import ImplausibleFeedback
from yumi.control.shared_state import ArmProblem, Snapshot, read_snapshot

LEFT: Joints = (0.5, -1.0, 0.5, 0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(("position", "is_other_arm"), [(LEFT, True), ((-1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), False)])
def test_doubted_position_that_is_the_other_arms_is_known_as_such(position: Joints, is_other_arm: bool) -> None:
    limiter, other = ReportedLimiter(YUMI_LIMITS), ReportedLimiter(YUMI_LIMITS)
    there = ArmState(0.0, CYCLE, 1, LEFT, ZERO_JOINTS, LEFT, is_running=True)
    other.limit(there, None)
    other.observe(there)
    limiter.pair(other)
    limiter.limit(ArmState(0.0, CYCLE, 1, ZERO_JOINTS, ZERO_JOINTS, ZERO_JOINTS, is_running=True), None)
    limiter.check(ArmState(CYCLE, CYCLE, 1, position, ZERO_JOINTS, position, is_running=True))
    assert limiter.implausible_position == pytest.approx(position)
    assert limiter.is_other_arm is is_other_arm


@pytest.mark.parametrize("is_other_arm", [True, False])
def test_report_of_a_doubted_position_names_the_ports_where_it_is_the_other_arms(is_other_arm: bool) -> None:
    event = ImplausibleFeedback(Side.RIGHT, "yumi_joint_1_r", 0.5, LEFT, ("a",), True, is_other_arm)
    assert event.said == message(
        "position_not_believed_for_long",
        arm="right",
        joint="yumi_joint_1_r",
        distance=0.5,
        ended=message("controllers_deactivated", controllers=("a",)),
        cause=message("positions_of_other_arm" if is_other_arm else "positions_implausible"),
    )


def test_snapshot_passes_the_problem_on() -> None:
    box = MemoryBuffer()
    told = Snapshot(
        limiter=LimiterCounters(implausible=3),
        problem=ArmProblem.REFERENCES_IGNORED,
        interruptions=2,
        wire=WireCounters(drift_ppm=1.5),
    )
    box.write(told)
    assert read_snapshot(box) == told
