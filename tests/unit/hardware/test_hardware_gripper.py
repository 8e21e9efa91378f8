"""The grippers against tasks and signals of plain values."""

from __future__ import annotations

from collections.abc import Callable
from threading import Thread

import pytest

from yumi.clock import ManualClock
from yumi.errors import ControllerRefused, ProtocolError, RobotNotReady
from yumi.hardware.gripper import Gripper, GripperRoutines, calibrate
from yumi.hardware.state_machine import SgCommand
from yumi.robot.gripper import MAX_FORCE, TRAVEL, HandState, Outcome
from yumi.robot.joints import Side
from yumi.rws.replies import Signal
from yumi.rws.states import SignalType


class Robot:
    """The part of a client that grippers use; a task takes its command after ``looks`` looks at it."""

    def __init__(self) -> None:
        self.looks = 0
        self.log: list[str] = []
        self.commands = dict.fromkeys((side.task for side in Side), "0")
        self.signals: dict[str, float] = {}

    def set_symbol(self, task: str, module: str, name: str, literal: str) -> None:
        self.log.append(f"{task} {name}={literal}")
        if name == "command_input":
            self.commands[task] = literal

    def symbol(self, task: str, module: str, name: str) -> str:
        if name == "settings":
            return "[25,10,25]"
        self.looks -= 1
        if self.looks < 0:
            self.commands[task] = "0"
            self.log.append(f"{task} takes it")
        return self.commands[task]

    def pulse_signal(self, name: str) -> None:
        self.log.append(name)

    def signal(self, name: str) -> Signal:
        self.log.append(name)
        if name not in self.signals:
            raise ControllerRefused(f"unknown signal {name}", status=404)
        return Signal(name, SignalType.GROUP_INPUT, self.signals[name])

    def show(self, side: Side, state: float, position: float = 0.0) -> None:
        letter = side.name[0]
        self.signals |= {f"hand_SysState_{letter}": state, f"hand_ActualPosition_{letter}": round(position * 1e4)}
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


def gripper_of(robot: Robot, side: Side, clock: ManualClock) -> Gripper:
    return Gripper(side, robot, GripperRoutines(robot, clock), clock, 10.0)


def test_other_hand_waits_until_the_task_has_taken_the_command(robot: Robot) -> None:
    robot.looks = 1

    def run_the_other() -> None:
        other.start()
        other.join(0.1)  # it cannot go on before we do

    routines = GripperRoutines(robot, TellingClock(run_the_other))
    other = Thread(target=lambda: routines.run(Side.LEFT, SgCommand.MOVE_TO, 10.0, target=0.02))
    routines.run(Side.RIGHT, SgCommand.MOVE_TO, 10.0, target=0.01)
    other.join()
    assert robot.log.index("T_ROB_R takes it") < robot.log.index("T_ROB_L target_position_input=20")


def test_command_that_is_not_taken_fails_after_its_time(robot: Robot, clock: ManualClock) -> None:
    robot.looks = 1000
    with pytest.raises(RobotNotReady, match="The right arm took no gripper command within 10 s; see that the RAPID"):
        GripperRoutines(robot, clock).run(Side.RIGHT, SgCommand.CALIBRATE, 10.0)
    assert clock.now() == pytest.approx(10.0, abs=0.2)


def test_slots_are_emptied_only_while_nobody_knows_what_is_in_them(robot: Robot, clock: ManualClock) -> None:
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


def test_recent_position_is_asked_for_only_when_the_last_one_is_old(robot: Robot, clock: ManualClock) -> None:
    gripper = gripper_of(robot, Side.LEFT, clock)
    robot.show(Side.LEFT, HandState.READY, 0.01)
    for step in (0.0, 0.3, 0.3):
        clock.advance(step)
        assert gripper.recent_position(0.5) == pytest.approx(0.01)
    assert robot.log == ["hand_ActualPosition_L"] * 2


def test_force_that_is_already_set_is_not_written(robot: Robot, clock: ManualClock) -> None:
    routines = GripperRoutines(robot, clock)
    routines.run(Side.RIGHT, SgCommand.GRIP_IN, 1.0, force=10.0)
    assert not any("settings" in line for line in robot.log)
    routines.run(Side.RIGHT, SgCommand.GRIP_IN, 1.0, force=12.0)
    assert "T_ROB_R settings=[25,12,25]" in robot.log


def test_wait_looks_at_the_state_five_times_a_second_and_at_the_position_half_as_often(robot: Robot) -> None:
    def stop_after_one_second() -> None:
        if clock.now() > 0.99:
            robot.show(Side.LEFT, HandState.ACTION_COMPLETED, TRAVEL)

    clock = TellingClock(stop_after_one_second)
    robot.show(Side.LEFT, HandState.FREE_MOVE_TO_MAX_POS, 0.01)
    told: list[float] = []
    assert gripper_of(robot, Side.LEFT, clock).wait(TRAVEL, told.append) is Outcome.OPEN
    assert told == pytest.approx([0.01, 0.01])
    assert len(robot.log) == 6 + 3


def test_wait_gives_up_a_gripper_that_does_not_come_to_rest(robot: Robot, clock: ManualClock) -> None:
    robot.show(Side.LEFT, HandState.AGILE_GRIP_INWARD, 0.01)
    with pytest.raises(RobotNotReady, match="The left gripper still moves after 10 s; look at it"):
        gripper_of(robot, Side.LEFT, clock).wait(0.0, lambda _: None)


@pytest.mark.parametrize(
    ("state", "position", "goal", "outcome"),
    [
        (HandState.AGILE_GRIP_INWARD, 0.01, 0.0, None),
        (HandState.KEEP_OBJECT, 0.0006, 0.0, Outcome.HOLDING),
        (HandState.KEEP_OBJECT, 0.0005, 0.0, Outcome.CLOSED),
        (HandState.ACTION_COMPLETED, 0.0011, 0.0, Outcome.STALLED),
        (HandState.ACTION_COMPLETED, 0.012, 0.0125, Outcome.IN_PLACE),
        (HandState.ACTION_COMPLETED, 0.0242, TRAVEL, Outcome.OPEN),
    ],
)
def test_outcome_is_what_the_hand_measures(
    robot: Robot, clock: ManualClock, state: HandState, position: float, goal: float, outcome: Outcome | None
) -> None:
    gripper = gripper_of(robot, Side.LEFT, clock)
    robot.show(Side.LEFT, HandState.READY)
    gripper.begin(goal, MAX_FORCE)
    robot.show(Side.LEFT, state, position)
    assert gripper.outcome(goal) is outcome


@pytest.mark.parametrize("code", [13, 14, 18, 31])
def test_state_no_gripper_has_is_refused(robot: Robot, clock: ManualClock, code: int) -> None:
    robot.show(Side.LEFT, code)
    with pytest.raises(ProtocolError, match=f"The left gripper reports state {code}, which no Smart Gripper has"):
        gripper_of(robot, Side.LEFT, clock).outcome(0.0)


def test_error_of_the_gripper_is_told(robot: Robot, clock: ManualClock) -> None:
    robot.show(Side.LEFT, HandState.ERROR)
    with pytest.raises(RobotNotReady, match="The left gripper reports an error; look at the event log"):
        gripper_of(robot, Side.LEFT, clock).begin(TRAVEL, MAX_FORCE)


def test_robot_without_grippers_is_told_and_left(robot: Robot, clock: ManualClock) -> None:
    robot.show(Side.RIGHT, HandState.READY)
    complaints: list[str] = []
    calibrate({side: gripper_of(robot, side, clock) for side in Side}, complaints.append, complaints.append)
    (sentence,) = complaints
    assert sentence == (
        "The left gripper cannot be used: The controller has no signal hand_StatusCalibrated_L; "
        "it has no left Smart Gripper."
    )
