"""The grippers against tasks and signals of plain values."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from threading import Thread

import pytest

from abb_protocols.catalogue import message
from abb_protocols.errors import ControllerRefused, GoalNotReached, RobotNotReady
from abb_protocols.robot.gripper_values import (
    FINGER_TRAVEL,
    GripDirection,
    GripOutcome,
    GripperGoal,
    GripperModules,
    ServoState,
    finger_position_goal,
    grip,
)
from abb_protocols.robot.joints import Side
from abb_protocols.rws.operations.io import RwsSignal
from abb_protocols.rws.rapid_values import RapidValue, decode, encode
from abb_protocols.rws.values import SignalType
from abb_runtime.clock import ManualClock
from refusals import refused
from yumi.driver.gripper import GripperRoutines, RwsGripper
from yumi.driver.gripper_setup import GripperSetup
from yumi.driver.gripper_signals import GripperSignals
from yumi.driver.state_machine import SgCommand


class Robot:
    """The part of a client that grippers use; a task takes its command after ``looks`` looks at it."""

    def __init__(self) -> None:
        self.looks = 0
        self.log: list[str] = []
        self.commands = dict.fromkeys((side.task for side in Side), "0")
        self.signals: dict[str, float] = {}

    def set_value(self, task: str, module: str, name: str, value: RapidValue) -> None:
        literal = encode(value)
        self.log.append(f"{task} {name}={literal}")
        if name == "command_input":
            self.commands[task] = literal

    def value(self, task: str, module: str, name: str) -> RapidValue:
        if name == "settings":
            return decode("[25,10,25]")
        self.looks -= 1
        if self.looks < 0:
            self.commands[task] = "0"
            self.log.append(f"{task} takes it")
        return decode(self.commands[task])

    def pulse_signal(self, name: str) -> None:
        self.log.append(name)

    def signal(self, name: str) -> RwsSignal:
        self.log.append(name)
        if name not in self.signals:
            raise ControllerRefused(f"unknown signal {name}", status=404)
        return RwsSignal(name, SignalType.GROUP_INPUT, self.signals[name])

    def set_signal(self, name: str, value: float) -> None:
        self.log.append(f"{name}={value:g}")

    def show(self, side: Side, state: float, position: float = 0.0) -> None:
        letter = side.name[0]
        self.signals |= {f"hand_SysState_{letter}": state, f"hand_ActualPosition_{letter}": round(position * 1e4)}
        self.signals |= {f"hand_{name}_{letter}": 0.0 for name in ("SysError", "ActualSpeed")}
        self.signals[f"hand_StatusCalibrated_{letter}"] = 1


class TellingClock(ManualClock):
    """Calls a function whenever somebody waits."""

    def __init__(self, tell: Callable[[], None]) -> None:
        super().__init__()
        self._tell = tell

    def wait(self, seconds: float) -> None:
        super().wait(seconds)
        self._tell()


@pytest.fixture
def robot() -> Robot:
    return Robot()


def gripper_of(robot: Robot, side: Side, clock: ManualClock) -> RwsGripper:
    return RwsGripper(side, robot, GripperRoutines(robot, clock), clock, 10.0)


CLOSE = grip(GripDirection.INWARDS, 20.0)
SPREAD = grip(GripDirection.OUTWARDS, 20.0)


class Told(GripperSignals):
    """Signals as they were told some time ago."""

    def __init__(self, state: ServoState, position: float) -> None:
        super().__init__(Robot(), dict.fromkeys(Side, GripperModules.SERVO))
        self.show(state, position)

    def show(self, state: ServoState, position: float) -> None:
        self._values = {
            (Side.LEFT, "hand_SysState"): float(state),
            (Side.LEFT, "hand_ActualPosition"): position * 1e4,
            (Side.LEFT, "hand_StatusCalibrated"): 1.0,
        }


def test_fingers_that_are_reported_of_late_are_not_stalled(robot: Robot) -> None:
    def move_on() -> None:
        robot.show(Side.LEFT, ServoState.FREE_MOVE_TO_MAX_POS, min(FINGER_TRAVEL, clock.now() * 0.01))
        if clock.now() > 2.0:
            robot.show(Side.LEFT, ServoState.ACTION_COMPLETED, FINGER_TRAVEL)
            told.show(ServoState.ACTION_COMPLETED, FINGER_TRAVEL)

    clock = TellingClock(move_on)
    told = Told(ServoState.FREE_MOVE_TO_MAX_POS, 0.005)
    gripper = RwsGripper(Side.LEFT, robot, GripperRoutines(robot, clock), clock, 10.0, signals=told)
    assert gripper.wait(finger_position_goal(FINGER_TRAVEL)) is GripOutcome.OPEN


def test_other_gripper_waits_until_the_task_has_taken_the_command(robot: Robot) -> None:
    robot.looks = 1

    def run_the_other() -> None:
        other.start()
        other.join(0.1)  # it cannot go on before we do

    routines = GripperRoutines(robot, TellingClock(run_the_other))
    other = Thread(target=lambda: routines.run(Side.LEFT, SgCommand.MOVE_TO, 10.0, target=0.02))
    routines.run(Side.RIGHT, SgCommand.MOVE_TO, 10.0, target=0.01)
    other.join()
    assert robot.log.index("T_ROB_R takes it") < robot.log.index("T_ROB_L target_position_input=20")


@pytest.mark.parametrize("goal", [finger_position_goal(0.01), CLOSE])
@pytest.mark.parametrize("is_persons", [False, True])
def test_goal_that_waits_for_the_other_gripper_moves_no_fingers_after_a_stop(
    robot: Robot, clock: ManualClock, goal: GripperGoal, is_persons: bool
) -> None:
    """A stop of the robot, or of the gripper, that comes while the other one is calibrated."""
    gripper, checks = gripper_of(robot, Side.LEFT, clock), count()
    robot.show(Side.LEFT, ServoState.READY)

    def check() -> None:
        if not next(checks):
            return
        if not is_persons:
            raise RobotNotReady(message("stopped_by", causes=(), stop=""))
        gripper.stop()

    with pytest.raises(GoalNotReached if is_persons else RobotNotReady) as refusal:
        gripper.begin(goal, check)
    assert refusal.value.said.code == ("gripper_stopped_before_it_moved" if is_persons else "stopped_by")
    assert "RUN_SG_ROUTINE" not in robot.log


def test_command_that_is_not_taken_fails_after_its_time(robot: Robot, clock: ManualClock) -> None:
    robot.looks = 1000
    with refused(RobotNotReady, "gripper_command_not_taken", arm="right", timeout=10.0):
        GripperRoutines(robot, clock).run(Side.RIGHT, SgCommand.CALIBRATE, 10.0)
    assert clock.now() == pytest.approx(10.0, abs=0.2)


def test_slots_are_emptied_only_while_no_one_knows_what_is_in_them(robot: Robot, clock: ManualClock) -> None:
    routines = GripperRoutines(robot, clock)
    for _ in range(2):
        routines.run(Side.RIGHT, SgCommand.GRIP_IN, 1.0)
    assert robot.log.count("T_ROB_L command_input=0") == 1
    robot.looks = 1000
    with pytest.raises(RobotNotReady):
        routines.run(Side.RIGHT, SgCommand.GRIP_IN, 1.0)
    robot.looks = 0
    routines.run(Side.LEFT, SgCommand.GRIP_IN, 1.0)
    assert robot.log.count("T_ROB_R command_input=0") == 2


def test_force_that_is_already_set_is_not_written(robot: Robot, clock: ManualClock) -> None:
    routines = GripperRoutines(robot, clock)
    routines.run(Side.RIGHT, SgCommand.GRIP_IN, 1.0, force=10.0)
    assert not any("settings" in line for line in robot.log)
    routines.run(Side.RIGHT, SgCommand.GRIP_IN, 1.0, force=12.0)
    assert "T_ROB_R settings=[25,12,25]" in robot.log


def test_wait_needs_few_requests_while_nothing_is_reported(robot: Robot) -> None:
    def stop_after_two_seconds() -> None:
        robot.show(Side.LEFT, ServoState.FREE_MOVE_TO_MAX_POS, clock.now() * 0.01)
        if clock.now() > 1.99:
            robot.show(Side.LEFT, ServoState.ACTION_COMPLETED, FINGER_TRAVEL)

    clock = TellingClock(stop_after_two_seconds)
    robot.show(Side.LEFT, ServoState.FREE_MOVE_TO_MAX_POS, 0.0)
    told: list[float] = []
    assert (
        gripper_of(robot, Side.LEFT, clock).wait(finger_position_goal(FINGER_TRAVEL), told.append) is GripOutcome.OPEN
    )
    assert told == pytest.approx([0.0, 0.002, 0.004, 0.006, 0.008, 0.010, 0.012, 0.014, 0.016, 0.018])
    assert len(robot.log) == 11 * 2 + 1


def test_wait_asks_nothing_of_the_robot_while_it_reports_by_itself(robot: Robot) -> None:
    def stop_after_one_second() -> None:
        if clock.now() > 0.99:
            robot.show(Side.LEFT, ServoState.ACTION_COMPLETED, FINGER_TRAVEL)
            told.show(ServoState.ACTION_COMPLETED, FINGER_TRAVEL)

    clock = TellingClock(stop_after_one_second)
    told = Told(ServoState.FREE_MOVE_TO_MAX_POS, 0.01)
    gripper = RwsGripper(Side.LEFT, robot, GripperRoutines(robot, clock), clock, 10.0, signals=told)
    positions: list[float] = []
    assert gripper.wait(finger_position_goal(FINGER_TRAVEL), positions.append) is GripOutcome.OPEN
    assert len(positions) == pytest.approx(20, abs=1)
    assert robot.log == ["hand_SysState_L", "hand_ActualPosition_L"]


def test_end_that_was_reported_before_the_order_began_does_not_count(robot: Robot, clock: ManualClock) -> None:
    told = Told(ServoState.ACTION_COMPLETED, FINGER_TRAVEL)
    robot.show(Side.LEFT, ServoState.AGILE_GRIP_INWARD, 0.02)
    gripper = RwsGripper(Side.LEFT, robot, GripperRoutines(robot, clock), clock, 10.0, signals=told)
    gripper.begin(CLOSE)
    assert gripper.outcome(CLOSE) is None


def test_error_that_has_been_cleared_since_it_was_reported_does_not_count(robot: Robot, clock: ManualClock) -> None:
    robot.show(Side.LEFT, ServoState.READY)
    told = Told(ServoState.ERROR, 0.01)
    gripper = RwsGripper(Side.LEFT, robot, GripperRoutines(robot, clock), clock, 10.0, signals=told)
    gripper.begin(CLOSE)
    assert "RUN_SG_ROUTINE" in robot.log


def test_fingers_that_stand_still_on_their_way_are_stalled_and_let_go(robot: Robot) -> None:
    def obey() -> None:
        if "hand_CmdGripper_L=10" in robot.log:
            robot.show(Side.LEFT, ServoState.READY, 0.01)

    clock = TellingClock(obey)
    robot.show(Side.LEFT, ServoState.FREE_MOVE_TO_MAX_POS, 0.01)
    gripper = gripper_of(robot, Side.LEFT, clock)
    gripper.begin(finger_position_goal(FINGER_TRAVEL))
    assert gripper.wait(finger_position_goal(FINGER_TRAVEL)) is GripOutcome.STALLED
    assert 1.0 <= clock.now() < 2.0


def test_gripper_that_does_not_stop_is_reported(robot: Robot, clock: ManualClock) -> None:
    robot.show(Side.LEFT, ServoState.JOG_OPEN)
    with refused(RobotNotReady, "gripper_does_not_stop", gripper="left"):
        gripper_of(robot, Side.LEFT, clock).stop()


def test_error_that_does_not_go_is_reported(robot: Robot, clock: ManualClock) -> None:
    robot.show(Side.LEFT, ServoState.ERROR)
    with refused(RobotNotReady, "gripper_error_stays", gripper="left"):
        gripper_of(robot, Side.LEFT, clock).clear_error()
    assert robot.log[:2] == ["hand_CmdClearErr_L=1", "hand_CmdClearErr_L=0"]


def may_not() -> None:
    raise RobotNotReady(message("gripper_fingers_move"))


def test_gripper_that_may_not_move_any_more_is_reported_nothing(robot: Robot, clock: ManualClock) -> None:
    gripper = gripper_of(robot, Side.RIGHT, clock)
    robot.show(Side.RIGHT, ServoState.READY)
    for move in (
        lambda: gripper.begin(finger_position_goal(0.01), may_not),
        lambda: gripper.jog(opens=True, check=may_not),
    ):
        robot.log.clear()
        with refused(RobotNotReady, "gripper_fingers_move"):
            move()
        assert not [line for line in robot.log if "command_input" in line or line.endswith("=1")]


def test_speed_is_that_of_the_order_or_the_usual_one(robot: Robot, clock: ManualClock) -> None:
    robot.show(Side.LEFT, ServoState.READY)
    gripper = gripper_of(robot, Side.LEFT, clock)
    for speed in (None, 0.01, None):
        gripper.begin(finger_position_goal(0.01, speed))
    written = [line for line in robot.log if line.startswith("hand_MaxSpeed")]
    assert written == ["hand_MaxSpeed_L=250", "hand_MaxSpeed_L=100", "hand_MaxSpeed_L=250"]


def test_wait_gives_up_a_gripper_that_does_not_come_to_rest(robot: Robot, clock: ManualClock) -> None:
    robot.show(Side.LEFT, ServoState.AGILE_GRIP_INWARD, 0.01)
    with refused(RobotNotReady, "gripper_still_moves", gripper="left", timeout=10.0):
        gripper_of(robot, Side.LEFT, clock).wait(CLOSE)


@pytest.mark.parametrize(
    ("state", "position", "goal", "outcome"),
    [
        (ServoState.AGILE_GRIP_INWARD, 0.01, CLOSE, None),
        (ServoState.KEEP_OBJECT, 0.0006, CLOSE, GripOutcome.HOLDING),
        (ServoState.KEEP_OBJECT, 0.0248, CLOSE, GripOutcome.HOLDING),
        (ServoState.KEEP_OBJECT, 0.0005, CLOSE, GripOutcome.CLOSED),
        (ServoState.ACTION_COMPLETED, 0.0011, CLOSE, GripOutcome.STALLED),
        (ServoState.ACTION_COMPLETED, 0.012, finger_position_goal(0.0125), GripOutcome.IN_PLACE),
        (ServoState.ACTION_COMPLETED, 0.0242, finger_position_goal(FINGER_TRAVEL), GripOutcome.OPEN),
        (ServoState.AGILE_GRIP_OUTWARD, 0.01, SPREAD, None),
        (ServoState.KEEP_OBJECT, 0.0244, SPREAD, GripOutcome.HOLDING),
        (ServoState.KEEP_OBJECT, 0.0245, SPREAD, GripOutcome.OPEN),
    ],
)
def test_outcome_is_what_the_gripper_measures(
    robot: Robot, clock: ManualClock, state: ServoState, position: float, goal: GripperGoal, outcome: GripOutcome | None
) -> None:
    gripper = gripper_of(robot, Side.LEFT, clock)
    robot.show(Side.LEFT, ServoState.READY)
    gripper.begin(goal)
    robot.show(Side.LEFT, state, position)
    assert gripper.outcome(goal) is outcome


def test_error_of_the_gripper_is_reported(robot: Robot, clock: ManualClock) -> None:
    robot.show(Side.LEFT, ServoState.ERROR)
    with refused(RobotNotReady, "gripper_reports_error", gripper="left", error=0.0):
        gripper_of(robot, Side.LEFT, clock).begin(CLOSE)


def test_robot_without_grippers_is_reported_and_left(robot: Robot, clock: ManualClock) -> None:
    robot.show(Side.RIGHT, ServoState.READY)
    complaints: list[object] = []
    setup = GripperSetup({side: gripper_of(robot, side, clock) for side in Side}, complaints.append, complaints.append)
    for _ in range(3):  # it is reported once
        setup.run()
    missing = message("no_smart_gripper", gripper="left", signal="hand_StatusCalibrated_L")
    assert complaints == [message("gripper_unusable", gripper="left", reason=missing)]
