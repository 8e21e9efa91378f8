"""Gripper commands through the state machine: in any state, one arm or both, with what the fingers find."""

import pytest
from state_machine_bench import ARMS, Bench

from abb_protocols.robot.gripper_values import GripperModules
from abb_protocols.robot.joints import Side
from virtual_irc5.mechanics.virtual_gripper import Workpiece
from virtual_irc5.world import WorldSettings

CALIBRATE, MOVE_TO, GRIP_IN, VACUUM_ON_1 = 2, 3, 4, 10


@pytest.fixture
def bench() -> Bench:
    """Calibrated grippers; something 20 mm wide between the left fingers."""
    bench = Bench(
        WorldSettings(
            workpieces={Side.LEFT: Workpiece(0.020)},
            gripper_modules=dict.fromkeys(Side, GripperModules.TWO_VACUUMS),
            grippers_are_calibrated=True,
        )
    )
    bench.bring_up()
    command(bench, MOVE_TO, position=25)
    bench.run(1.5)
    return bench


def command(bench: Bench, number: int, position: float = 0.0, sides: tuple[Side, ...] = ARMS) -> None:
    for side in sides:
        bench.write(side, "TRobSG", "command_input", str(number))
        bench.write(side, "TRobSG", "target_position_input", str(position))
    bench.pulse("RUN_SG_ROUTINE")


def position(bench: Bench, side: Side) -> float:
    """What a client reads of the fingers [0.1 mm]."""
    return bench.controller.signals.get(f"hand_ActualPosition_{side.name[0]}").value


def test_move_to_opens_both_grippers(bench: Bench) -> None:
    assert [position(bench, side) for side in ARMS] == [250, 250]


def test_command_is_cleared_when_it_is_taken(bench: Bench) -> None:
    command(bench, MOVE_TO, position=10)
    bench.run(0.01)  # the hand goes to READY first
    assert [bench.read(side, "TRobSG", "command_input") for side in ARMS] == ["0", "0"]
    assert "[SmartGripper]: Received command 3 (Move gripper to 10)" in bench.screen(Side.LEFT)


def test_arm_without_command_does_nothing(bench: Bench) -> None:
    command(bench, MOVE_TO, position=10, sides=(Side.LEFT,))
    bench.run(1.0)
    assert [position(bench, side) for side in ARMS] == [250, 100]


def test_left_gripper_holds_its_object_and_the_right_one_closes(bench: Bench) -> None:
    command(bench, GRIP_IN)
    bench.run(2.0)
    assert bench.world.grippers[Side.LEFT].is_holding
    assert not bench.world.grippers[Side.RIGHT].is_holding
    assert [position(bench, side) for side in ARMS] == [0, 100]


def test_gripper_moves_while_egm_guides_the_arm(bench: Bench) -> None:
    bench.pulse("EGM_START_JOINT")
    bench.run(0.2)
    command(bench, MOVE_TO, position=5)
    assert (bench.states, bench.actions) == ((3, 3), (1, 1))
    bench.run(1.2)
    assert position(bench, Side.RIGHT) == 50
    heard = [message.seqno for message in bench.sensors[Side.RIGHT].heard]
    assert heard == list(range(len(heard)))


def test_position_beyond_the_limit_is_brought_into_range_and_written_back(bench: Bench) -> None:
    command(bench, MOVE_TO, position=99, sides=(Side.RIGHT,))
    assert bench.read(Side.RIGHT, "TRobSG", "target_position_input") == "25"


def test_hold_force_comes_from_the_settings(bench: Bench) -> None:
    bench.write(Side.LEFT, "TRobSG", "settings", "[25,99,25]")
    command(bench, GRIP_IN)
    bench.run(2.0)
    assert bench.world.grippers[Side.LEFT].hold_force == 20
    assert bench.read(Side.LEFT, "TRobSG", "settings") == "[25,20,25]"


def test_vacuum_is_switched_by_command(bench: Bench) -> None:
    command(bench, VACUUM_ON_1, sides=(Side.LEFT,))
    bench.run(0.1)
    assert bench.controller.signals.get("hand_StatusVacuum1_L").value == 1


def test_uncalibrated_gripper_refuses_to_move() -> None:
    bench = Bench()
    bench.bring_up()
    command(bench, MOVE_TO, position=10)
    bench.run(1.0)
    assert position(bench, Side.LEFT) == 0
    assert "[SmartGripper]: Gripper is not calibrated" in bench.screen(Side.LEFT)


def test_calibration_takes_seconds_and_holds_back_other_requests() -> None:
    bench = Bench()
    bench.bring_up()
    command(bench, CALIBRATE, sides=(Side.LEFT,))
    bench.run(0.2)
    bench.pulse("EGM_START_JOINT")
    assert bench.states == (3, 0)
    bench.run_until(lambda: bench.states == (3, 3), limit=5.0)
    assert bench.world.grippers[Side.LEFT].is_calibrated


def test_gripper_command_by_signal_reaches_the_gripper(bench: Bench) -> None:
    bench.controller.signals.set("hand_CmdVacuum2_R", 1)
    bench.run(0.1)
    assert bench.controller.signals.get("hand_StatusVacuum2_R").value == 1


def test_what_rapid_asks_of_the_hand_shows_on_its_signals(bench: Bench) -> None:
    bench.write(Side.LEFT, "TRobSG", "settings", "[25,12.5,25]")
    command(bench, GRIP_IN)
    bench.run(0.1)
    signals = bench.controller.signals
    assert (signals.get("hand_CmdGripper_L").value, signals.get("hand_HoldForce_L").value) == (15, 125)
    assert bench.world.grippers[Side.LEFT].hold_force == 12.5


def test_signals_of_a_client_jog_the_fingers_after_what_rapid_did(bench: Bench) -> None:
    signals = bench.controller.signals
    for value in (10, 2):
        signals.set("hand_CmdGripper_R", value)
        bench.run(0.05)
    assert signals.get("hand_SysState_R").value == 12
    bench.run(0.5)
    signals.set("hand_CmdGripper_R", 10)
    bench.run(0.01)
    assert (signals.get("hand_SysState_R").value, 190 <= position(bench, Side.RIGHT) <= 200) == (0, True)
