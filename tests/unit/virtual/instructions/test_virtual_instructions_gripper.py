"""Gripper instructions: waiting, not waiting, and what they raise."""

import pytest
from instruction_bench import InstructionBench

from abb_protocols.robot.gripper_values import MAX_GRIP_FORCE, ServoState
from virtual_irc5.mechanics.virtual_gripper import CupObject, Workpiece


@pytest.fixture
def bench() -> InstructionBench:
    return InstructionBench()


@pytest.fixture
def loaded() -> InstructionBench:
    """Something 20 mm wide between open fingers."""
    bench = InstructionBench(workpiece=Workpiece(0.020))
    bench.unit.gripper.move_to(0.025)
    bench.unit.gripper.advance(2.0)
    return bench


def test_move_to_waits_for_the_fingers(bench: InstructionBench) -> None:
    assert bench.run("g_MoveTo 20; number:=g_GetPos();") == pytest.approx(0.8, abs=0.1)
    assert float(bench.read("number")) == pytest.approx(20.0)


def test_move_to_goes_on_at_once_when_told(bench: InstructionBench) -> None:
    assert bench.run("g_MoveTo 20\\NoWait;") < 0.05


def test_move_to_refuses_a_position_beyond_the_limit(bench: InstructionBench) -> None:
    bench.run("g_MoveTo 26;")
    assert "ERR_HAND_AUGOUTOFRANGE" in bench.failure
    assert bench.events.entries()[0].code == 112757


def test_move_to_refuses_an_uncalibrated_gripper(bench: InstructionBench) -> None:
    bench.unit.gripper.is_calibrated = False
    bench.run("g_MoveTo 20;")
    assert "ERR_HAND_NOTCALIBRATED" in bench.failure


def test_grip_in_holds_what_is_there(loaded: InstructionBench) -> None:
    loaded.run("g_GripIn\\holdForce:=8;")
    assert loaded.unit.gripper.is_holding
    assert loaded.unit.gripper.hold_force == 8


@pytest.mark.parametrize(
    ("grip", "end"),
    [("g_GripIn", 0.0), ("g_GripOut", 25.0), ("Hand_GripInward", 0.0), ("Hand_GripOutward", 25.0)],
)
def test_grip_that_finds_nothing_ends_where_the_travel_ends(bench: InstructionBench, grip: str, end: float) -> None:
    bench.unit.gripper.move_to(0.010)
    bench.unit.gripper.advance(2.0)
    duration = bench.run(f"{grip}; number:=g_GetPos(); flag:=TRUE;")
    assert (bench.failure, bench.read("flag"), list(bench.events.entries())) == ("", "TRUE", [])
    assert float(bench.read("number")) == pytest.approx(end)
    assert duration == pytest.approx(abs(end - 10.0) / 25.0, abs=0.1), "and waits until the fingers are there"


def test_grip_checks_the_position_with_an_allowance_only(loaded: InstructionBench) -> None:
    loaded.run("g_GripIn\\targetPos:=3;")
    assert loaded.failure == ""
    loaded.run("g_GripIn\\targetPos:=3\\posAllowance:=2;")
    assert "ERR_HAND_FAILEDGRIPPOS" in loaded.failure
    assert "The fingers stand at 10.0 mm each, not within 2 mm of the target" in loaded.failure


def test_grip_without_a_force_presses_with_the_greatest(loaded: InstructionBench) -> None:
    loaded.run("g_SetForce 5; g_GripIn;")
    assert loaded.unit.gripper.hold_force == MAX_GRIP_FORCE


def test_grip_out_holds_something_hollow() -> None:
    bench = InstructionBench(workpiece=Workpiece(0.020, is_hollow=True))
    bench.run("g_GripOut;")
    assert bench.unit.gripper.is_holding


def test_calibrate_takes_its_time_and_leaves_a_calibrated_gripper(bench: InstructionBench) -> None:
    bench.unit.gripper.is_calibrated = False
    assert bench.run("g_Calibrate\\Jog; flag:=g_IsCalibrated();") > 0.5
    assert bench.read("flag") == "TRUE"


def test_init_sets_speed_and_limit(bench: InstructionBench) -> None:
    bench.run("g_Init\\maxSpd:=10\\holdForce:=5\\phyLimit:=12;")
    gripper = bench.unit.gripper
    assert (gripper.max_speed, gripper.hold_force, gripper.physical_limit) == pytest.approx((0.010, 5, 0.012))


def test_init_calibrates_when_told(bench: InstructionBench) -> None:
    bench.unit.gripper.is_calibrated = False
    bench.run("g_Init\\Calibrate;")
    assert bench.unit.gripper.is_calibrated


@pytest.mark.parametrize("channel", [1, 2])
def test_vacuum_and_blow_exclude_each_other(bench: InstructionBench, channel: int) -> None:
    bench.run(f"g_VacuumOn{channel}; g_BlowOn{channel};")
    signals = bench.unit.gripper.signals()
    assert (signals[f"hand_StatusVacuum{channel}"], signals[f"hand_StatusBlowoff{channel}"]) == (0, 1)


def test_jog_waits_until_the_fingers_stand_and_lets_go(bench: InstructionBench) -> None:
    assert bench.run("g_JogOut; number:=g_GetPos();") == pytest.approx(2.5, abs=0.1)
    assert float(bench.read("number")) == pytest.approx(25.0)
    assert bench.unit.gripper.state is ServoState.READY


def test_vacuum_with_a_threshold_waits_for_the_pressure(bench: InstructionBench) -> None:
    bench.unit.gripper.cups[1].under = CupObject()
    assert 0.1 < bench.run("g_VacuumOn1\\threshold:=40; number:=g_GetPressure1();") < 0.5
    assert float(bench.read("number")) <= 40.0


def test_vacuum_that_is_never_reached_raises(bench: InstructionBench) -> None:
    bench.run("g_VacuumOn2\\threshold:=40;")
    assert "ERR_HAND_FAILEDVACUUM" in bench.failure
    assert bench.events.entries()[0].code == 112756


def test_speed_is_told_while_the_fingers_move(bench: InstructionBench) -> None:
    bench.run("g_MoveTo 20\\NoWait; WaitTime 0.2; number:=g_GetSpd();")
    assert float(bench.read("number")) == pytest.approx(25.0)
