"""The Smart Gripper in virtual time."""

from __future__ import annotations

from math import nan

import pytest

from abb_protocols.errors import CommandRefused, RobotNotReady
from abb_protocols.robot.gripper_values import GripperModules, ServoCommand, ServoState
from virtual_irc5.mechanics.virtual_gripper import VirtualGripper, Workpiece

CUBE = Workpiece(0.020)
RING = Workpiece(0.030, is_hollow=True)


@pytest.fixture
def gripper() -> VirtualGripper:
    return VirtualGripper(is_calibrated=True)


def opened(workpiece: Workpiece | None = None) -> VirtualGripper:
    gripper = VirtualGripper(workpiece, is_calibrated=True)
    gripper.move_to(0.025)
    gripper.advance(2.0)
    return gripper


def finish(gripper: VirtualGripper, dt: float = 0.004032, longest: float = 10.0) -> float:
    time = 0.0
    while gripper.is_moving and time < longest:
        gripper.advance(dt)
        time += dt
    assert not gripper.is_moving
    return time


def test_fingers_take_a_second_for_the_whole_way(gripper):
    gripper.move_to(0.025)
    assert gripper.state is ServoState.FREE_MOVE_TO_MAX_POS
    assert finish(gripper) == pytest.approx(1.0, abs=0.005)
    assert gripper.position == 0.025
    assert gripper.state is ServoState.ACTION_COMPLETED


def test_fingers_close_with_the_set_speed():
    gripper = opened()
    gripper.initialize(max_speed=0.010)
    gripper.move_to(0.005)
    assert gripper.state is ServoState.FREE_MOVE_TO_MIN_POS
    gripper.advance(0.5)
    assert gripper.position == pytest.approx(0.020)
    assert gripper.speed == -0.010


def test_grip_on_an_object_holds_it_with_the_set_force():
    gripper = opened(CUBE)
    gripper.grip_in(hold_force=12.0)
    finish(gripper)
    assert gripper.is_holding
    assert gripper.state is ServoState.KEEP_OBJECT
    assert (gripper.position, gripper.force) == (0.010, 12.0)


def test_force_builds_up_before_the_object_counts_as_held():
    gripper = opened(CUBE)
    gripper.grip_in(hold_force=20.0)
    gripper.advance(0.6)  # contact
    gripper.advance(0.1)
    assert gripper.force == pytest.approx(10.0)
    assert gripper.state is ServoState.AGILE_GRIP_INWARD
    gripper.advance(0.11)
    assert gripper.is_holding


def test_grip_on_nothing_closes_and_does_not_hold():
    gripper = opened()
    gripper.grip_in()
    assert finish(gripper) == pytest.approx(1.0, abs=0.005)
    assert not gripper.is_holding
    assert gripper.state is ServoState.ACTION_COMPLETED
    assert (gripper.position, gripper.force) == (0.0, 0.0)


def test_object_that_is_taken_away_lets_the_fingers_close():
    gripper = opened(CUBE)
    gripper.grip_in()
    finish(gripper)
    gripper.workpiece = None
    gripper.advance(0.1)
    assert gripper.state is ServoState.AGILE_GRIP_INWARD
    finish(gripper)
    assert gripper.position == 0.0


def test_outward_grip_holds_a_hollow_object_from_inside():
    gripper = VirtualGripper(RING, is_calibrated=True)
    gripper.grip_out(hold_force=8.0)
    finish(gripper)
    assert gripper.is_holding
    assert (gripper.position, gripper.force) == (0.015, 8.0)


def test_outward_grip_on_nothing_ends_wide_open(gripper):
    gripper.grip_out()
    finish(gripper)
    assert (gripper.position, gripper.is_holding) == (0.025, False)


def test_stop_lets_go():
    gripper = opened(CUBE)
    gripper.grip_in()
    finish(gripper)
    gripper.stop()
    assert (gripper.force, gripper.state) == (0.0, ServoState.READY)


def test_free_move_against_an_object_is_an_error_until_it_is_cleared():
    gripper = opened(CUBE)
    gripper.move_to(0.0)
    finish(gripper)
    assert gripper.state is ServoState.ERROR
    assert gripper.signals()["hand_SysError"] == 1
    gripper.write("hand_CmdClearErr", 1)
    assert gripper.state is ServoState.READY


def test_calibration_closes_the_fingers_and_takes_its_time():
    gripper = VirtualGripper()
    gripper.calibrate()
    assert 1.0 <= finish(gripper) < 1.1
    assert gripper.is_calibrated
    assert (gripper.position, gripper.state) == (0.0, ServoState.READY)


def test_calibration_shows_its_states_in_order():
    gripper = VirtualGripper()
    gripper.write("hand_CmdGripper", ServoCommand.JOG_OPEN)
    gripper.advance(1.0)
    gripper.calibrate()
    states = [gripper.state]
    while gripper.is_moving:
        gripper.advance(0.01)
        states += [gripper.state] if gripper.state is not states[-1] else []
    assert [state.name for state in states] == ["JOG_CLOSE", "READY", "CALIBRATION", "READY"]


def test_calibration_without_jog_takes_the_present_position_for_zero():
    gripper = opened()
    gripper.calibrate(jog=False)
    finish(gripper)
    assert gripper.position == 0.0
    gripper.grip_out()
    finish(gripper)
    assert gripper.position == 0.0  # the fingers are at their mechanical end


@pytest.mark.parametrize("command", [lambda g: g.move_to(0.01), VirtualGripper.grip_in, VirtualGripper.grip_out])
def test_commands_before_calibration_are_refused(command):
    gripper = VirtualGripper()
    with pytest.raises(RobotNotReady, match="not calibrated: calibrate it first"):
        command(gripper)
    assert gripper.state is ServoState.READY


@pytest.mark.parametrize("position", [-0.001, 0.021, nan])
def test_position_outside_the_limit_is_refused_and_nothing_moves(gripper, position):
    gripper.initialize(physical_limit=0.020)
    with pytest.raises(CommandRefused, match=r"Gripper position .* mm: allowed are 0 to 20 mm"):
        gripper.move_to(position)
    assert not gripper.is_moving


def test_limit_beyond_the_travel_is_refused(gripper):
    with pytest.raises(CommandRefused, match="Gripper position 26 mm: allowed are 0 to 25 mm"):
        gripper.initialize(physical_limit=0.026)


@pytest.mark.parametrize(("asked", "used"), [(1.0, 0.025), (0.0, 0.003), (0.01, 0.01)])
def test_speed_is_brought_into_the_range_of_the_drive(gripper, asked, used):
    gripper.set_max_speed(asked)
    assert gripper.max_speed == used


@pytest.mark.parametrize(("asked", "used"), [(50.0, 20.0), (-1.0, 0.0), (7.0, 7.0)])
def test_force_is_brought_into_the_range_of_the_drive(gripper, asked, used):
    gripper.set_hold_force(asked)
    assert gripper.hold_force == used


def test_signals_carry_tenths_of_millimetres(gripper):
    gripper.move_to(0.0123)
    gripper.advance(0.1)
    signals = gripper.signals()
    assert (signals["hand_ActualPosition"], signals["hand_ActualSpeed"]) == (25, 250)
    finish(gripper)
    signals = gripper.signals()
    assert (signals["hand_ActualPosition"], signals["hand_ActualSpeed"]) == (123, 0)
    assert (signals["hand_SysState"], signals["hand_StatusCalibrated"]) == (6, 1)


def test_signals_move_the_fingers_as_the_hand_driver_does(gripper):
    gripper.write("hand_MaxPosition", 200)
    gripper.write("hand_MaxSpeed", 100)
    gripper.write("hand_CmdGripper", ServoCommand.GO_TO_READY)
    gripper.write("hand_CmdGripper", ServoCommand.FREE_MOVE_TO_MAX_POS)
    assert finish(gripper) == pytest.approx(2.0, abs=0.005)
    assert gripper.signals()["hand_ActualPosition"] == 200


def test_signals_grip_with_the_force_they_carry():
    gripper = opened(CUBE)
    gripper.write("hand_HoldForce", 55)
    gripper.write("hand_MinPosition", 0)
    gripper.write("hand_CmdGripper", ServoCommand.GO_TO_READY)
    gripper.write("hand_CmdGripper", ServoCommand.AGILE_GRIP_INWARD)
    finish(gripper)
    assert gripper.force == pytest.approx(5.5)
    assert gripper.signals()["hand_SysState"] == 9


@pytest.mark.parametrize("value", [0, 4, 31])
def test_command_signal_is_ignored_when_not_ready_or_unknown(gripper, value):
    gripper.move_to(0.02)
    gripper.advance(0.1)
    gripper.write("hand_CmdGripper", value)
    assert gripper.state is ServoState.FREE_MOVE_TO_MAX_POS


def test_error_can_be_provoked_by_its_command(gripper):
    gripper.write("hand_CmdGripper", ServoCommand.GO_TO_ERROR)
    assert gripper.signals()["hand_SysState"] == 1


def test_calibration_by_command_ends_completed():
    gripper = VirtualGripper()
    gripper.write("hand_CmdGripper", ServoCommand.GO_TO_CALIBRATION)
    finish(gripper)
    assert (gripper.is_calibrated, gripper.state) == (True, ServoState.ACTION_COMPLETED)


@pytest.mark.parametrize("channel", [1, 2])
def test_channel_does_not_suck_and_blow_at_once(channel):
    gripper = VirtualGripper(modules=GripperModules.TWO_VACUUMS)
    gripper.write(f"hand_CmdVacuum{channel}", 1)
    assert gripper.signals()[f"hand_StatusVacuum{channel}"] == 1
    gripper.write(f"hand_CmdBlowoff{channel}", 1)
    signals = gripper.signals()
    assert (signals[f"hand_StatusVacuum{channel}"], signals[f"hand_StatusBlowoff{channel}"]) == (0, 1)
    gripper.write(f"hand_CmdBlowoff{channel}", 0)
    assert gripper.signals()[f"hand_StatusBlowoff{channel}"] == 0


@pytest.mark.parametrize("dt", [0.001, 0.05, 5.0])
def test_outcome_does_not_depend_on_how_time_is_divided(dt):
    gripper = opened(CUBE)
    gripper.grip_in(hold_force=10.0)
    for _ in range(round(5.0 / dt)):
        gripper.advance(dt)
    assert (gripper.position, gripper.force, gripper.is_holding) == (0.010, 10.0, True)


@pytest.mark.parametrize("width", [0.0, -0.01, 0.06])
def test_workpiece_that_does_not_fit_is_refused(width):
    with pytest.raises(ValueError, match=r"widths above 0 and up to 0.05 m are allowed"):
        Workpiece(width)


def test_object_too_heavy_for_the_force_slips_out_and_the_fingers_close():
    gripper = opened(Workpiece(0.020, mass=0.4))  # 0.4 kg and friction 0.5 need 3.9 N
    gripper.grip_in(hold_force=3.0)
    gripper.advance(0.65)
    assert gripper.is_holding
    for _ in range(200):
        gripper.advance(0.004)
    assert (gripper.position, gripper.state, gripper.workpiece) == (0.0, ServoState.ACTION_COMPLETED, None)


def test_same_object_is_held_with_enough_force():
    gripper = opened(Workpiece(0.020, mass=0.4))
    gripper.grip_in(hold_force=4.0)
    gripper.advance(5.0)
    assert gripper.is_holding


@pytest.mark.parametrize(("mass", "friction"), [(-0.1, 0.5), (0.1, 0.0)])
def test_workpiece_without_mass_or_friction_is_refused(mass, friction):
    with pytest.raises(ValueError, match="both are positive"):
        Workpiece(0.02, mass=mass, friction=friction)


def test_error_of_the_hand_is_shown_until_it_is_cleared(gripper):
    gripper.fail(7)
    gripper.advance(0.1)
    assert (gripper.signals()["hand_SysState"], gripper.signals()["hand_SysError"]) == (1, 7)
    gripper.write("hand_CmdClearErr", 1)
    gripper.advance(0.1)
    assert (gripper.signals()["hand_SysState"], gripper.signals()["hand_SysError"]) == (0, 0)


def test_power_cut_lets_go_and_forgets_where_the_fingers_are():
    gripper = opened(CUBE)
    gripper.grip_in()
    finish(gripper)
    gripper.cut_power()
    assert (gripper.force, gripper.is_calibrated, gripper.signals()["hand_StatusCalibrated"]) == (0.0, False, 0)


def test_jog_goes_on_until_it_is_told_to_stop():
    gripper = VirtualGripper()
    gripper.jog(opens=True)
    gripper.advance(1.0)
    assert (gripper.state, gripper.speed) == (ServoState.JOG_OPEN, 0.010)
    gripper.stop()
    assert (gripper.state, gripper.speed) == (ServoState.READY, 0.0)


@pytest.mark.parametrize(
    ("modules", "camera", "channels"),
    [
        (GripperModules.SERVO, 0, 0),
        (GripperModules.VISION, 1, 0),
        (GripperModules.VACUUM, 0, 1),
        (GripperModules.VISION_VACUUM, 1, 1),
        (GripperModules.TWO_VACUUMS, 0, 2),
    ],
)
def test_hand_shows_the_modules_it_has(modules, camera, channels):
    signals = VirtualGripper(modules=modules).signals()
    assert signals["hand_StatusCamLinked"] == camera
    assert sum(name.startswith("hand_ActualPressure") for name in signals) == channels
