"""Teleoperation with the whole driver and a virtual robot in memory: clutches, losses, bursts, one operator."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from math import cos, pi, radians, sin, tau
from pathlib import Path

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from abb_protocols.errors import CommandRefused
from abb_protocols.robot.description import FINGERTIPS
from abb_protocols.robot.gripper_values import FINGER_TRAVEL
from abb_protocols.robot.inverse_kinematics import arm_angle
from abb_protocols.robot.joints import CYCLE, Pose, Side, joints
from abb_protocols.robot.kinematics import (
    compose_poses,
    pose_distance,
    quaternion_of,
    quaternion_product,
    tool0_to_body,
)
from cartesian_bench import shares
from refusals import refused
from system.teleoperation_bench import (
    EXACT,
    RATE,
    RELEASED,
    RIGHT,
    START,
    WITHIN,
    Operator,
    at,
    driver_in_egm,
    operator_of,
)
from system.test_endpoint_in_virtual_time import Driver, poll_until
from yumi.control.loop_commands import Commands
from yumi.driver.command import Caller
from yumi.driver.commands import carry_out
from yumi.driver.controller_names import CARTESIAN_CONTROLLER, GOAL_CONTROLLER
from yumi.driver.device_frame import DeviceFrame, DeviceHand, DeviceSettings, TeleoperatedArmReport, TeleoperationReport
from yumi.driver.motion_commands import Teleoperate
from yumi.driver.teleoperated_arm import BLENDING, DEVICE_LINK_LOST, TeleoperationFollower
from yumi.driver.teleoperation import OPERATOR_HOLDS


@pytest.fixture
def driver(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Driver]:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with driver_in_egm() as driver:
        yield driver


@pytest.fixture
def operator(driver: Driver) -> Iterator[Operator]:
    with operator_of(driver) as operator:
        yield operator


def sway(time: float) -> DeviceHand:
    """A hand that moves some centimetres and back."""
    way = 0.04 * sin(3.0 * time), 0.03 * (1.0 - cos(4.0 * time)), 0.02 * sin(5.0 * time)
    return at(*way, (0.2 * sin(time), 0.0, 0.1 * sin(2.0 * time)))


def tip(driver: Driver, side: Side = RIGHT) -> Pose:
    """Where the fingertips are sent."""
    return compose_poses(tool0_to_body(side, driver.snapshot(side).sent), FINGERTIPS)


def sent(driver: Driver, side: Side = RIGHT) -> NDArray[np.float64]:
    """The positions sent in each cycle [rad], (n, 7)."""
    return np.array(driver.arms[side].admitted)


def is_exact(pose: Pose, other: Pose) -> bool:
    way, turn = pose_distance(pose, other)
    return way <= EXACT[0] and turn <= EXACT[1]


def is_within_limits(driver: Driver, side: Side = RIGHT) -> bool:
    return all(share <= most for share, most in zip(shares(sent(driver, side)), WITHIN, strict=True))


def stands_after(driver: Driver, since: int) -> float:
    """How long after the cycle ``since`` the right arm's command stood [s]."""
    moves = np.max(np.abs(np.diff(sent(driver)[since:], axis=0)), axis=1) / CYCLE
    moving = np.nonzero(moves > 1e-3)[0]
    return 0.0 if not len(moving) else float(moving[-1] + 1) * CYCLE


def arm_stands_after(driver: Driver, since: int) -> float:
    """How long after the cycle ``since`` the right arm itself stood [s]: its command goes back to where the arm is."""
    measured = np.array(driver.arms[RIGHT].measured)[since - len(sent(driver)) :]
    moving = np.nonzero(np.max(np.abs(np.diff(measured, axis=0)), axis=1) / CYCLE > 2e-3)[0]
    return 0.0 if not len(moving) else float(moving[-1] + 1) * CYCLE


def test_tool_moves_by_what_the_hand_moves(driver: Driver, operator: Operator) -> None:
    before, angle = tip(driver), arm_angle(RIGHT, driver.snapshot(RIGHT).sent)
    operator.engage(at())
    assert is_exact(before, tip(driver))
    operator.hold(1.2, lambda time: at(0.05, -0.04, 0.03, (0.0, 0.0, 0.2)))
    x, y, z = before.position
    turned = quaternion_product(quaternion_of((0.0, 0.0, 0.2)), before.orientation)
    assert is_exact(tip(driver), Pose((x + 0.05, y - 0.04, z + 0.03), turned))
    assert arm_angle(RIGHT, driver.snapshot(RIGHT).sent) == pytest.approx(angle, abs=radians(0.1))
    assert is_within_limits(driver)


def test_nothing_moves_unless_the_clutch_is_held(driver: Driver, operator: Operator) -> None:
    operator.hold(1.0, lambda time: msgspec.structs.replace(sway(time), clutch=False, gripper=abs(sin(time))))
    assert np.ptp(sent(driver), axis=0).max() == 0.0
    assert operator.fingers[RIGHT].goals == []
    assert driver.mover.commanding(RIGHT) == (GOAL_CONTROLLER,)


def test_pressing_the_clutch_moves_nothing(driver: Driver, operator: Operator) -> None:
    operator.engage(at(0.3, -0.2, 0.4, (1.0, 0.5, 0.0)))
    operator.hold(0.5, lambda time: at(0.3, -0.2, 0.4, (1.0, 0.5, 0.0)))
    assert np.ptp(sent(driver), axis=0).max() < 1e-9
    assert np.ptp(sent(driver, Side.LEFT), axis=0).max() == 0.0


def test_clutch_that_is_pressed_again_goes_on_from_where_the_arm_is(driver: Driver, operator: Operator) -> None:
    operator.engage(at())
    operator.hold(1.0, sway)
    operator.release(0.1)  # and pressed again before the arm stands: the reference is taken where it stands
    operator.engage(at(0.2, 0.3, -0.2, (0.5, 0.0, 0.3)))
    before = tip(driver)
    operator.hold(0.5, lambda time: at(0.2, 0.3, -0.2, (0.5, 0.0, 0.3)))
    assert is_exact(before, tip(driver))
    operator.hold(1.2, lambda time: at(0.23, 0.3, -0.2, (0.5, 0.0, 0.3)))
    x, y, z = before.position
    assert is_exact(tip(driver), Pose((x + 0.03, y, z), before.orientation))
    assert is_within_limits(driver)


def test_releasing_the_clutch_brakes_and_holds(driver: Driver, operator: Operator) -> None:
    operator.engage(at())
    operator.hold(0.5, lambda time: at(0.2 * time))
    cycles = len(sent(driver))
    assert np.abs(np.diff(sent(driver)[-2:], axis=0)).max() / CYCLE > 0.1
    operator.release(1.0)
    assert operator.clutch == "released"
    assert stands_after(driver, cycles) < 0.2
    assert is_within_limits(driver)


@pytest.mark.parametrize("gap", [0.05, 0.15])
def test_burst_after_a_gap_is_followed_within_the_limits(driver: Driver, operator: Operator, gap: float) -> None:
    operator.engage(at())
    begin = driver.now()
    for _ in range(2):
        operator.hold(0.4, lambda _: sway(driver.now() - begin))
        late = [driver.now() + number / RATE for number in range(round(gap * RATE))]
        driver.wait(gap)
        for time in late:
            operator.send(sway(time - begin), time)
    assert operator.clutch == "engaged"
    assert operator.report.dropped == 0
    assert is_within_limits(driver)


def test_frames_older_than_the_newest_are_dropped(driver: Driver, operator: Operator) -> None:
    operator.engage(at())
    before = tip(driver)
    now = driver.now()
    operator.send(at(), now)
    for late in (0.001, 0.05, 0.1):
        operator.send(at(0.04), now - late)
    driver.wait(CYCLE)
    operator.hold(0.3, lambda time: at())
    assert operator.report.dropped == 3
    assert is_exact(before, tip(driver))


def test_frames_that_come_too_late_are_no_link(driver: Driver, operator: Operator) -> None:
    operator.engage(at())
    before, lateness = tip(driver), 2.0 * DEVICE_LINK_LOST
    driver.wait(lateness)
    for _ in range(30):  # a queue on the way that never empties
        operator.send(at(0.04), driver.now() - lateness)
        driver.wait(1.0 / RATE)
    assert is_exact(before, tip(driver))
    assert operator.clutch == "inert"


def test_lost_link_brakes_and_the_clutch_is_inert_until_it_is_pressed_again(driver: Driver, operator: Operator) -> None:
    operator.engage(at())
    operator.hold(0.5, lambda time: at(0.2 * time))
    cycles = len(sent(driver))
    driver.wait(DEVICE_LINK_LOST)
    operator.teleoperation.lose(operator)
    driver.wait(0.5)
    assert stands_after(driver, cycles) < DEVICE_LINK_LOST + 0.2
    before = tip(driver)
    operator.hold(1.0, sway)
    assert (operator.clutch, operator.why) == ("inert", "teleoperation_link_lost")
    assert is_exact(before, tip(driver))
    operator.release(0.1)
    operator.engage(at())
    operator.hold(1.5, lambda time: at(0.02))
    assert tip(driver).position[0] == pytest.approx(before.position[0] + 0.02, abs=1e-4)
    assert is_within_limits(driver)


def test_gap_that_no_timer_saw_is_a_lost_link_too(driver: Driver, operator: Operator) -> None:
    operator.engage(at())
    driver.wait(DEVICE_LINK_LOST + 0.01)
    operator.send(at(0.01))
    assert (operator.clutch, operator.why) == ("inert", "teleoperation_link_lost")


def test_old_frame_with_the_clutch_released_ends_no_inert_clutch(driver: Driver, operator: Operator) -> None:
    operator.engage(at())
    old = driver.now()
    driver.wait(1.0 / RATE)
    operator.send(at())
    driver.wait(0.5 * DEVICE_LINK_LOST)
    operator.teleoperation.lose(operator)
    operator.send(RELEASED, old)  # it came late, and says nothing about now
    operator.hold(0.3, sway)
    assert operator.clutch == "inert"


def test_jump_of_the_devices_clock_lets_no_hand_jump(driver: Driver, operator: Operator) -> None:
    operator.engage(at())
    before = tip(driver)
    operator.send(at(1.5), driver.now() + 2.0)
    driver.wait(CYCLE)
    assert (operator.clutch, operator.why) == ("inert", "device_hand_jumped")
    driver.wait(0.5)
    assert is_exact(before, tip(driver))


def test_way_of_the_hand_is_scaled_and_seen_from_where_the_operator_stands(driver: Driver, operator: Operator) -> None:
    operator.settings = DeviceSettings(cutoff=0.0, scale=0.25, yaw=pi)
    operator.engage(at())
    before = tip(driver)
    operator.hold(1.2, lambda time: at(0.08, 0.04, 0.04, (0.2, 0.0, 0.0)))
    x, y, z = before.position
    turned = quaternion_product(quaternion_of((-0.2, 0.0, 0.0)), before.orientation)
    assert is_exact(tip(driver), Pose((x - 0.02, y - 0.01, z + 0.01), turned))


def test_scale_that_is_changed_while_the_clutch_is_held_moves_nothing(driver: Driver, operator: Operator) -> None:
    operator.engage(at())
    operator.hold(1.2, lambda time: at(0.04, 0.02))
    before = tip(driver)
    operator.settings = DeviceSettings(cutoff=0.0, scale=0.2, yaw=1.0)
    operator.hold(0.5, lambda time: at(0.04, 0.02))
    assert is_exact(before, tip(driver))


def test_tool_is_no_faster_than_the_settings_allow(driver: Driver, operator: Operator) -> None:
    operator.settings = DeviceSettings(cutoff=0.0, speed=0.05, turning=0.1)
    operator.engage(at())
    operator.hold(1.0, lambda time: at(0.04 * min(1.0, 4.0 * time), turn=(0.0, 0.3 * min(1.0, 4.0 * time), 0.0)))
    tips = [compose_poses(tool0_to_body(RIGHT, joints(row)), FINGERTIPS) for row in sent(driver).tolist()]
    steps = [pose_distance(first, then) for first, then in zip(tips[:-10], tips[10:], strict=True)]
    assert max(way for way, _ in steps) / (10.0 * CYCLE) < 0.05 * 1.1
    assert max(turn for _, turn in steps) / (10.0 * CYCLE) < 0.1 * 1.1
    assert max(way for way, _ in steps) > 0.0


def test_trembling_of_a_hand_is_filtered(driver: Driver, operator: Operator) -> None:
    generator = np.random.default_rng(5)

    def trembling(time: float) -> DeviceHand:
        x, y, z = (generator.normal(size=3) * 0.5e-3).tolist()
        return at(x, y, z)

    spread = []
    for cutoff in (0.0, 1.0):
        operator.settings = DeviceSettings(cutoff=cutoff, beta=5.0)
        operator.engage(at())
        count = len(sent(driver))
        operator.hold(2.0, trembling)
        spread.append(float(np.std(sent(driver)[count:], axis=0).max()))
        operator.release()
    assert spread[1] < 0.4 * spread[0]


def test_tool_is_sent_a_moment_after_the_hand(driver: Driver, operator: Operator) -> None:
    def swing(time: float) -> float:
        return 0.04 * (1.0 - cos(tau * 0.7 * time))

    operator.settings = DeviceSettings(speed=1.0)
    operator.engage(at())
    start, count = tip(driver).position[0], len(sent(driver))
    operator.hold(3.0, lambda time: at(swing(time)))
    tips = [
        compose_poses(tool0_to_body(RIGHT, joints(row)), FINGERTIPS).position[0]
        for row in sent(driver)[count:].tolist()
    ]
    times = CYCLE * np.arange(1, 1 + len(tips))
    settled = times > 1.5
    lags = np.arange(0.0, 0.2, 0.002)
    errors = [np.std((np.array(tips) - start)[settled] - np.vectorize(swing)(times[settled] - lag)) for lag in lags]
    assert lags[int(np.argmin(errors))] < 0.03
    assert min(errors) < 0.003


def test_device_that_lost_a_hand_for_a_moment_moves_nothing(driver: Driver, operator: Operator) -> None:
    operator.engage(at())
    before = tip(driver)
    operator.hold(0.2, lambda time: at(0.5))
    assert (operator.clutch, operator.why) == ("inert", "device_hand_jumped")
    assert is_exact(before, tip(driver))


def test_clutch_that_is_held_while_the_device_connects_is_inert(driver: Driver, operator: Operator) -> None:
    operator.hold(0.5, sway)
    assert (operator.clutch, operator.why) == ("inert", "teleoperation_begins")
    assert np.ptp(sent(driver), axis=0).max() == 0.0


def test_one_operator_at_a_time(driver: Driver, operator: Operator) -> None:
    operator.engage(at())
    other = object()
    with refused(CommandRefused, "teleoperated_by_another"):
        operator.send(at(), who=other)
    operator.hold(0.1, lambda time: at())
    assert operator.clutch == "engaged"
    driver.wait(OPERATOR_HOLDS)
    operator.send(at(), who=other)
    assert operator.clutch == "inert"  # what the first one has left
    operator.teleoperation.lose(operator)  # its end is not the other one's
    driver.wait(CYCLE)
    operator.send(DeviceHand(), who=other)
    assert operator.clutch == "released"


def test_program_takes_no_arm_from_a_person_but_may_stop_one(driver: Driver, operator: Operator) -> None:
    operator.engage(at())
    operator.hold(0.3, sway)
    with refused(CommandRefused, "arm_commanded_by_another", who="device"):
        driver.call(Commands.switch_controllers, RIGHT, (GOAL_CONTROLLER,), (CARTESIAN_CONTROLLER,))
    driver.mover.stop([RIGHT])  # a stop is open to all
    operator.hold(0.3, sway)
    assert (operator.clutch, operator.why) == ("inert", "teleoperation_interrupted")
    assert driver.mover.commanding(RIGHT) == (GOAL_CONTROLLER,)


def test_clutch_is_inert_whose_arm_was_lost_before_it_followed(
    driver: Driver, operator: Operator, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin_following = driver.mover.begin_following

    def begin_and_stop(side: Side, follower: TeleoperationFollower) -> None:
        begin_following(side, follower)
        driver.mover.stop([side])

    operator.release(0.1)
    with monkeypatch.context() as patch:
        patch.setattr(driver.mover, "begin_following", begin_and_stop)
        for _ in range(1000):
            operator.hold(1.0 / RATE, lambda time: at())
            if operator.clutch != "engaging":
                break
    assert (operator.clutch, operator.why) == ("inert", "teleoperation_interrupted")
    operator.engage(at())


def test_arm_that_does_not_follow_is_not_taken_over(driver: Driver, operator: Operator) -> None:
    driver.manager.stop_egm()
    driver.wait(1.0)
    operator.release(0.1)
    for _ in range(1000):
        operator.hold(1.0 / RATE, lambda time: at())
        if operator.clutch == "inert":
            break
    assert operator.why == "goal_refused"


def test_gripper_takes_what_has_changed_enough_since_the_clutch_was_pressed(driver: Driver, operator: Operator) -> None:
    def trigger(value: float) -> DeviceHand:
        return msgspec.structs.replace(at(), gripper=value)

    goals = operator.fingers[RIGHT].goals
    operator.engage(trigger(0.02))  # triggers do not rest quite at 0
    operator.hold(0.2, lambda time: trigger(0.02))
    operator.hold(0.2, lambda time: trigger(0.04 * sin(40.0 * time) ** 2))
    assert goals == []  # what is held is not let go by pressing the clutch
    operator.hold(1.0, lambda time: trigger(min(1.0, 2.0 * time)))
    assert goals[-1] == 1.0
    assert len(goals) <= 21
    operator.release(0.2)
    operator.engage(trigger(0.0))
    assert goals[-1] == 1.0


def test_velocity_of_a_stick_moves_the_tool_and_the_elbow(driver: Driver, operator: Operator) -> None:
    def stick(x: float, elbow: float = 0.0) -> DeviceHand:
        return DeviceHand(clutch=True, twist=(x, 0.0, 0.0, 0.0, 0.0, 0.0), elbow=elbow)

    before, angle = tip(driver), arm_angle(RIGHT, driver.snapshot(RIGHT).sent)
    operator.engage(stick(0.0))
    operator.hold(1.0, lambda time: stick(0.05, 0.2))
    operator.hold(0.5, lambda time: stick(0.0))
    after = tip(driver)
    assert after.position[0] - before.position[0] == pytest.approx(0.05, abs=0.005)
    assert after.position[1:] == pytest.approx(before.position[1:], abs=1e-3)
    assert arm_angle(RIGHT, driver.snapshot(RIGHT).sent) - angle == pytest.approx(0.2, abs=0.03)
    operator.hold(0.1, lambda time: at())
    assert operator.why == "device_motion_changed"
    assert is_within_limits(driver)


def test_elbow_that_is_not_reported_for_a_while_stays_and_one_that_jumps_is_not_followed(
    driver: Driver, operator: Operator
) -> None:
    def bent(elbow: float | None) -> DeviceHand:
        return msgspec.structs.replace(at(), elbow=elbow)

    def angle() -> float:
        return arm_angle(RIGHT, driver.snapshot(RIGHT).sent)

    begin = angle()
    operator.engage(bent(5.0))  # what counts is its change
    operator.hold(1.0, lambda time: bent(5.0 + min(0.2, 0.4 * time)))
    assert angle() - begin == pytest.approx(0.2, abs=0.02)
    operator.hold(0.5, lambda time: bent(None))
    operator.hold(0.5, lambda time: bent(-3.0))
    assert angle() - begin == pytest.approx(0.2, abs=0.02)
    operator.hold(1.0, lambda time: bent(-3.0 - min(0.1, 0.4 * time)))
    assert angle() - begin == pytest.approx(0.1, abs=0.02)
    operator.hold(0.2, lambda time: bent(0.0))
    assert (operator.clutch, operator.why) == ("inert", "device_hand_jumped")
    operator.hold(0.5, lambda time: bent(0.0))
    assert angle() - begin == pytest.approx(0.1, abs=0.02)
    assert is_within_limits(driver)


def leader(*change: float) -> DeviceHand:
    """A leader arm, by so much away from where the follower stands at first."""
    return DeviceHand(clutch=True, joints=joints([a + b for a, b in zip(START, change, strict=True)]))


def test_follower_of_a_leader_arm_keeps_the_offset(driver: Driver, operator: Operator) -> None:
    far = (0.4, 0.3, -0.5, 0.2, 0.1, -0.3, 0.6)
    operator.engage(leader(*far))
    operator.hold(0.5, lambda time: leader(*far))
    assert sent(driver)[-1] == pytest.approx(START, abs=1e-4)
    operator.hold(2.0, lambda time: leader(0.4 + 0.1 * min(1.0, time), *far[1:]))
    assert sent(driver)[-1] == pytest.approx((START[0] + 0.1, *START[1:]), abs=2e-3)
    cycles = len(sent(driver))
    operator.hold(0.5, lambda time: leader(0.5 - 0.5 * time, *far[1:]))
    operator.release(1.0)
    assert 0.05 < arm_stands_after(driver, cycles + round(0.5 / CYCLE)) < 0.2
    assert is_within_limits(driver)


def test_follower_goes_to_its_leader_where_it_is_near(driver: Driver, operator: Operator) -> None:
    operator.settings = DeviceSettings(cutoff=0.0, is_absolute=True)
    near = (0.1, -0.1, 0.05, 0.15, 0.0, 0.1, -0.15)
    operator.engage(leader(*near))
    operator.hold(BLENDING + 1.0, lambda time: leader(*near))
    assert sent(driver)[-1] == pytest.approx(np.add(START, near), abs=2e-3)
    operator.release()
    operator.hold(0.5, lambda time: leader(0.9, *near[1:]))
    assert (operator.clutch, operator.why) == ("inert", "leader_too_far")
    assert is_within_limits(driver)


def test_gripper_grips_while_the_arm_is_teleoperated(driver: Driver) -> None:
    robot, gripper = driver.server._robot, driver.grippers[Side.LEFT]
    with ThreadPoolExecutor(2) as elsewhere:
        caller = Caller(client=object(), elsewhere=elsewhere.submit)

        def send(closed: float, *, clutch: bool = True) -> TeleoperationReport:
            hand = msgspec.structs.replace(at(), clutch=clutch, gripper=closed)
            report = carry_out(Teleoperate(frame=DeviceFrame(time=driver.now(), left=hand)), robot, caller)
            driver.wait(1.0 / RATE)
            return report

        send(1.0, clutch=False)
        poll_until(lambda: send(1.0).left.clutch == "engaged")
        poll_until(lambda: send(0.0).left.clutch == "engaged" and gripper.position() > 0.9 * FINGER_TRAVEL)
        poll_until(lambda: send(1.0).left.clutch == "engaged" and gripper.is_holding())
        assert send(1.0) == TeleoperationReport(left=TeleoperatedArmReport("engaged"))
