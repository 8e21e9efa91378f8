"""The Python API as a script uses it, against a virtual controller in another process, over the true wire."""

from __future__ import annotations

import asyncio
import multiprocessing
import signal
from collections.abc import Iterator
from math import inf, nan, pi, radians
from pathlib import Path
from time import monotonic, sleep
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from script_bench import TIMEOUT, VirtualRobot, output_of

import yumi
from abb_protocols.catalogue import message
from abb_protocols.errors import CommandRefused, GoalNotReached, RobotNotReady, SettingsError, StopNotConfirmed
from abb_protocols.robot.gripper_values import GripOutcome
from abb_protocols.robot.joints import Side, home
from abb_runtime.faults import Fault
from refusals import numbers_in, refused
from yumi.api.robot import Robot
from yumi.control.motion.robot_response import RESPONSE_DELAY
from yumi.driver.bringup import BRINGUP_ANNOUNCEMENT
from yumi.driver.reports import ArmMode
from yumi.recording.reader import read_recording

pytestmark = [pytest.mark.real_time, pytest.mark.timeout(180)]
RIGHT, LEFT = home(Side.RIGHT), home(Side.LEFT)
TURNED = (*RIGHT[:6], RIGHT[6] + 0.5)
FAR = (RIGHT[0] + 1.5, *RIGHT[1:])
CLOSE = radians(0.15)


@pytest.fixture(scope="module")
def virtual(tmp_path_factory: pytest.TempPathFactory) -> Iterator[VirtualRobot]:
    """First for tests that connect to it themselves and treat it badly, which it bears; then for one connection.

    How each stop ends is in ``test_recovery_scenarios``, in virtual time; the marked ones run with ``make soak``.
    """
    virtual = VirtualRobot(tmp_path_factory.mktemp("robot"))
    virtual.start()
    yield virtual
    virtual.stop()


def test_ctrl_c_leaves_the_arms_at_rest_and_ends_egm(virtual: VirtualRobot) -> None:
    script = virtual.script(
        "import yumi\n"
        "with yumi.connect(**OPTIONS) as robot:\n"
        "    motion = robot.right.move_to([1.5, *robot.right.position[1:]], speed_scale=0.05, wait=False)\n"
        "    print('moving')\n"
        "    motion.wait()\n"
    )
    assert script.stdout is not None
    assert script.stdout.readline().startswith(BRINGUP_ANNOUNCEMENT)
    assert script.stdout.readline() == "moving\n"
    script.send_signal(signal.SIGINT)
    output = output_of(script)
    assert output.rstrip().endswith("KeyboardInterrupt")
    assert not virtual.is_guided(Side.RIGHT)


def test_script_that_forgets_to_close_leaves_the_arms_at_rest_and_ends_egm(virtual: VirtualRobot) -> None:
    script = virtual.script(
        "import yumi\n"
        "robot = yumi.connect(**OPTIONS).open()\n"
        "robot.right.move_to([1.5, *robot.right.position[1:]], speed_scale=0.05, wait=False)\n"
    )
    output = output_of(script)
    assert (script.returncode, len(output.splitlines())) == (0, 1)
    assert output.startswith(BRINGUP_ANNOUNCEMENT)
    assert not virtual.is_guided(Side.RIGHT)


@pytest.mark.soak
def test_connection_whose_control_process_died_can_be_recovered(virtual: VirtualRobot) -> None:
    with yumi.connect(**virtual.options) as robot:
        motion = robot.right.move_to(FAR, wait=False, speed_scale=0.05)
        for child in multiprocessing.active_children():
            child.kill()
        with refused(GoalNotReached, "control_process_ended", arm="right"):
            motion.wait(TIMEOUT)
        robot.recover()
        robot.right.move_to(TURNED, speed_scale=1.0, timeout=TIMEOUT)
        assert robot.right.position == pytest.approx(TURNED, abs=CLOSE)


@pytest.mark.soak
def test_robot_that_fell_silent_can_be_recovered(virtual: VirtualRobot) -> None:
    with yumi.connect(**virtual.options) as robot:
        motion = robot.right.move_to(FAR, wait=False, speed_scale=0.1)
        virtual.kill()
        with refused(GoalNotReached, "feedback_lost", arm="right"):
            motion.wait(TIMEOUT)
        with refused(RobotNotReady, "arm_waits_for_recovery", arm="right"):
            robot.right.move_to(FAR)
        assert robot.right.mode is ArmMode.FAULT
        virtual.start()
        robot.recover()
        robot.right.move_to(TURNED, speed_scale=1.0, timeout=TIMEOUT)
        assert robot.right.position == pytest.approx(TURNED, abs=CLOSE)


def test_emergency_stop_of_one_arm_guided_alone_is_named_by_the_error_and_waits_for_a_person(
    virtual: VirtualRobot,
) -> None:
    with yumi.connect(**virtual.options, arms="right") as robot:
        motion = robot.right.move_to(FAR, wait=False, speed_scale=0.1)
        virtual.inject(Fault.EMERGENCY_STOP)
        with pytest.raises(GoalNotReached) as end:
            motion.wait(TIMEOUT)
        virtual.inject(Fault.EMERGENCY_STOP_RESET)
        with pytest.raises(StopNotConfirmed) as refusal:
            robot.recover()
        with pytest.raises(RobotNotReady) as not_ready:
            robot.right.gripper.close()
        for error in (end, refusal, not_ready):
            assert 10013 in numbers_in(error.value.said)
        assert end.value.said.code == "explained_stop"
        assert end.value.stop == refusal.value.stop == robot.stop_to_confirm
        robot.recover(confirm=robot.stop_to_confirm)
        assert robot.stop_to_confirm == ""
        robot.right.move_to(TURNED, speed_scale=1.0, timeout=TIMEOUT)
        assert robot.right.position == pytest.approx(TURNED, abs=CLOSE)
        assert virtual.is_guided(Side.RIGHT)
        assert not virtual.is_guided(Side.LEFT)
        with refused(RobotNotReady, "arm_not_named_to_connect", arm="left"):
            robot.left.move_to(LEFT)
    assert not virtual.is_guided(Side.RIGHT)
    with refused(RobotNotReady, "script_not_connected"):
        _ = robot.right.position


@pytest.mark.soak
def test_robot_that_has_collided_is_opened_only_with_a_persons_confirmation(virtual: VirtualRobot) -> None:
    with yumi.connect(**virtual.options):
        virtual.inject(Fault.COLLISION)
    robot = yumi.connect(**virtual.options)
    with pytest.raises(StopNotConfirmed) as refusal:
        robot.open()
    assert 50204 in numbers_in(refusal.value.said)
    assert not robot.is_connected
    robot.open(confirm=refusal.value.stop).close()


def test_both_arms_follow_a_stream_of_30_hz_by_its_stamps(virtual: VirtualRobot, tmp_path: Path) -> None:
    """Within 20 ms of what it is in virtual time; the recording says where the arms were when."""
    with yumi.connect(**virtual.options) as robot:
        rate, late = 30.0, 1.0 / 30.0 + RESPONSE_DELAY
        robot.move_to(right=RIGHT, left=LEFT)

        def way(moment: ArrayLike) -> NDArray[np.float64]:
            return np.asarray(0.15 * (1.0 - np.cos(2.0 * np.clip(moment, 0.0, 2.0 * pi))))

        with robot.record(tmp_path / "stream.mcap"):
            begin = monotonic()
            for number in range(round(5.0 * rate)):
                due = begin + number / rate
                sleep(max(0.0, due - monotonic()))  # the stream's own rate
                turn = float(way(number / rate))
                widths = {"right": 0.02 if number < 60 else 0.04, "left": 0.03}
                robot.stream(
                    right=(*RIGHT[:6], RIGHT[6] + turn), left=(*LEFT[:6], LEFT[6] - turn), grippers=widths, time=due
                )
        frames = read_recording(tmp_path / "stream.mcap", before=inf, after=inf).frames
        for side, start, sign in ((Side.RIGHT, RIGHT, 1.0), (Side.LEFT, LEFT, -1.0)):
            times = np.array([frame.time for frame in frames[side]]) - begin
            turned = sign * np.array([frame.position[6] - start[6] for frame in frames[side]])
            chosen = (times > 1.0) & (times < 4.8)
            lags = np.arange(0.0, 0.2, 0.001)
            errors = [float(((turned - way(times - lag))[chosen] ** 2).sum()) for lag in lags]
            assert lags[int(np.argmin(errors))] == pytest.approx(late, abs=0.02)
        deadline = monotonic() + TIMEOUT
        while abs(robot.right.gripper.width - 0.04) > 1e-3 or abs(robot.left.gripper.width - 0.03) > 1e-3:
            assert monotonic() < deadline


def test_asyncio_moves_both_arms_and_a_cancelled_task_stops_its_arm(virtual: VirtualRobot) -> None:
    async def script() -> None:
        async with yumi.connect_async(**virtual.options) as robot:
            await robot.move_to(right=TURNED, left=LEFT, speed_scale=1.0, timeout=TIMEOUT)
            assert robot.right.position == pytest.approx(TURNED, abs=CLOSE)
            task = asyncio.create_task(robot.right.move_to(FAR, speed_scale=0.05))
            await robot.left.gripper.close()
            task.cancel()
            with pytest.raises(asyncio.CancelledError):
                await task
            assert robot.right.mode is ArmMode.HOLDING

    asyncio.run(script())
    assert not virtual.is_guided(Side.RIGHT)


@pytest.fixture(scope="module")
def connected(virtual: VirtualRobot) -> Iterator[Robot]:
    """One connection for all tests that leave it as they found it."""
    with yumi.connect(**virtual.options) as robot:
        yield robot


@pytest.fixture
def robot(connected: Robot) -> Robot:
    if ArmMode.FAULT in (connected.right.mode, connected.left.mode):
        connected.recover()  # the machine stood still during the test before
    connected.move_to(right=RIGHT, left=LEFT, speed_scale=1.0, acceleration=1.0)
    return connected


def test_recording_has_every_cycle_between_its_begin_and_its_end(robot: Robot, tmp_path: Path) -> None:
    with robot.record(tmp_path / "new" / "motion.mcap"):
        robot.right.move_to(TURNED)
    frames = read_recording(tmp_path / "new" / "motion.mcap", before=inf, after=inf).frames
    for side in Side:
        numbers = [frame.number for frame in frames[side]]
        assert numbers == list(range(numbers[0], numbers[0] + len(numbers)))
    assert abs(frames[Side.RIGHT][0].position[6] - RIGHT[6]) < CLOSE
    assert abs(frames[Side.RIGHT][-1].position[6] - TURNED[6]) < CLOSE
    (tmp_path / "file").touch()
    with refused(SettingsError, "recording_not_writable", file=str(tmp_path / "file" / "motion.mcap")):
        robot.record(tmp_path / "file" / "motion.mcap")


def test_arm_moves_to_a_position_and_holds_it(robot: Robot) -> None:
    before = robot.right.pose
    robot.right.move_to(TURNED, speed_scale=1.0, timeout=TIMEOUT)
    assert robot.right.position == pytest.approx(TURNED, abs=CLOSE)
    assert robot.right.mode is ArmMode.HOLDING
    assert robot.right.pose.position == pytest.approx(before.position, abs=1e-3)
    assert robot.right.pose.orientation != pytest.approx(before.orientation, abs=0.1)


def test_both_arms_move_at_once(robot: Robot) -> None:
    robot.move_to(right=TURNED, left=(*LEFT[:6], 0.3), speed_scale=1.0, timeout=TIMEOUT)
    assert robot.right.position == pytest.approx(TURNED, abs=CLOSE)
    assert robot.left.position[6] == pytest.approx(0.3, abs=CLOSE)


def test_motion_that_nobody_waits_for_can_be_stopped(robot: Robot) -> None:
    motion = robot.right.move_to(FAR, wait=False, speed_scale=0.1)
    assert not motion.is_done
    robot.stop()
    assert robot.right.mode is ArmMode.HOLDING
    with refused(GoalNotReached, "goal_not_reached", arm="right", reason=message("motion_stopped")):
        motion.wait()


def test_motion_that_takes_too_long_is_stopped(robot: Robot) -> None:
    with refused(GoalNotReached, "goal_not_reached_in_time", arms=("right",), timeout=0.5):
        robot.right.move_to(FAR, speed_scale=0.05, timeout=0.5)
    assert robot.right.mode is ArmMode.HOLDING


def test_both_arms_follow_trajectories_that_begin_together(robot: Robot) -> None:
    right = [(0.5, TURNED), (1.0, TURNED), (1.5, RIGHT)]
    left = [(0.5, (*LEFT[:6], 0.2)), (1.0, LEFT)]
    robot.follow(right=right, left=left, timeout=TIMEOUT)
    assert robot.right.position == pytest.approx(RIGHT, abs=CLOSE)
    assert robot.left.position == pytest.approx(LEFT, abs=CLOSE)
    robot.right.follow([(0.7, TURNED)], timeout=TIMEOUT)
    assert robot.right.position == pytest.approx(TURNED, abs=CLOSE)


def test_arm_follows_a_stream_until_it_gets_a_goal(robot: Robot) -> None:
    for step in range(20):
        robot.right.stream((*RIGHT[:6], RIGHT[6] + 0.005 * step))
    robot.right.move_to(RIGHT, timeout=TIMEOUT)
    assert robot.right.position == pytest.approx(RIGHT, abs=CLOSE)


@pytest.mark.parametrize(
    ("goal", "code", "values"),
    [
        ((nan, *RIGHT[1:]), "goal_joint_not_finite", {"joint": "yumi_joint_1_r"}),
        ((*RIGHT[:6], 9.0), "goal_joint_in_degrees", {"joint": "yumi_joint_6_r", "position": 9.0}),
        (RIGHT[:6], "goal_joint_count_of_arm", {"count": 6, "joints": 7}),
    ],
)
def test_impossible_goal_moves_neither_arm(
    robot: Robot, goal: tuple[float, ...], code: str, values: dict[str, Any]
) -> None:
    with refused(CommandRefused, code, **values):
        robot.move_to(left=(*LEFT[:6], 1.0), right=goal)
    assert robot.left.mode is robot.right.mode is ArmMode.HOLDING


def test_gripper_grasps_what_lies_between_its_fingers(robot: Robot) -> None:
    gripper = robot.left.gripper
    assert gripper.open().outcome is GripOutcome.OPEN
    assert not gripper.is_holding
    assert gripper.grasp(force=8.0, width=0.02).width == pytest.approx(0.02, abs=1e-3)
    assert gripper.is_holding
    with refused(GoalNotReached, "gripper_holds_other_width", wanted=0.01):
        gripper.grasp(width=0.01)


def test_gripper_is_calibrated_again_on_demand_and_the_arms_move_on(robot: Robot) -> None:
    robot.right.gripper.calibrate()
    assert robot.right.gripper.position == 0.0
    robot.right.move_to(TURNED, speed_scale=1.0, timeout=TIMEOUT)
    assert robot.right.position == pytest.approx(TURNED, abs=CLOSE)


def test_gripper_that_grasps_nothing_says_so(robot: Robot) -> None:
    with refused(GoalNotReached, "gripper_holds_nothing", gripper="right", outcome="closed"):
        robot.right.gripper.grasp()


def test_second_connection_to_a_robot_is_refused(robot: Robot, virtual: VirtualRobot) -> None:
    with (
        refused(RobotNotReady, "robot_driven_by_another", address=virtual.address) as refusal,
        yumi.connect(**virtual.options),
    ):
        pass
    assert refusal.value.said.values["owner"].code == "owner_process"
    assert robot.right.mode is ArmMode.HOLDING
