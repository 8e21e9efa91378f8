"""Both grippers through the state machine on the virtual robot: outcomes, vacuum, refusals, and EGM beside them."""

from __future__ import annotations

from collections.abc import Callable
from math import nan, radians
from typing import Any, cast

import pytest

from abb_protocols.catalogue import Message, message
from abb_protocols.catalogue.actions import Action
from abb_protocols.errors import CommandRefused, GoalNotReached, RobotNotReady, StopNotConfirmed
from abb_protocols.robot.gripper_values import (
    ATMOSPHERIC_PRESSURE,
    FINGER_TRAVEL,
    MAX_GRIP_FORCE,
    THINNEST_GRIPPED,
    GripDirection,
    GripOutcome,
    GripperGoal,
    GripperModules,
    ServoState,
    finger_position_goal,
    grip,
)
from abb_protocols.robot.joints import CYCLE, Side, home
from abb_protocols.rws.values import ExecutionState
from abb_runtime.faults import Fault
from refusals import assert_says, numbers_in, refused
from system.recovery_bench import recovered
from system.virtual_time_bench import DriverArm, System
from virtual_irc5.mechanics.virtual_gripper import CupObject, Workpiece
from yumi.api.connection import Connection
from yumi.api.motion_executor import MotionExecutor
from yumi.control.hand_over import Commander, requested_by
from yumi.driver.gripper import RwsGripper
from yumi.driver.gripper_setup import GripperSetup, close_as_test
from yumi.driver.robot_state import RobotMode
from yumi.driver.settings import read_settings

CLOSE = grip(GripDirection.INWARDS, 10.0)
SPREAD = grip(GripDirection.OUTWARDS, 8.0)
OPEN = finger_position_goal(FINGER_TRAVEL)
IN_EGM = message("not_idle", machines=(message("machine", arm="left", machine="RUN_EGM_ROUTINE"),))
REPORTED = 0.1
"""By then the controller has reported a change of a gripper [s]."""


@pytest.fixture
def system() -> System:
    system = System()
    system.bringup.make_ready()
    return system


@pytest.fixture
def calibrated() -> System:
    """With grippers that the controller tells of."""
    system = System(are_calibrated=True)
    system.bringup.make_ready()
    system.signals.keep_open()
    return system


@pytest.fixture
def left(calibrated: System) -> RwsGripper:
    """Something 20 mm wide lies between its fingers."""
    return calibrated.grippers[Side.LEFT]


@pytest.fixture
def right(calibrated: System) -> RwsGripper:
    """Nothing lies between its fingers."""
    return calibrated.grippers[Side.RIGHT]


def test_grippers_that_will_be_calibrated_or_closed_are_announced(system: System) -> None:
    setup = GripperSetup(system.grippers, print, print)
    assert setup.steps() == [f"calibrate the {side.word} gripper (its fingers close)" for side in Side]
    setup.run()
    assert setup.steps() == []
    assert setup.steps(is_tested=True) == [f"close the {side.word} gripper as a test" for side in Side]


def test_grippers_that_are_not_calibrated_unasked_are_not_announced(system: System) -> None:
    assert GripperSetup(system.grippers, print, print, is_allowed=False).steps() == []


def done(gripper: RwsGripper, order: GripperGoal) -> GripOutcome | None:
    gripper.begin(order)
    return gripper.wait(order)


class Preparing:
    """A system whose grippers are set up each time it becomes ready, as the driver has it."""

    def __init__(self, system: System, report: Callable[[str], None] | None = None, **options: Any) -> None:
        self.said: list[str] = []
        self.complaints: list[Message] = []
        setup = GripperSetup(system.grippers, report or self.said.append, self.complaints.append, **options)
        system.manager.when_ready(setup.run)


def are_calibrated(system: System) -> list[bool]:
    return [gripper.is_calibrated() for gripper in system.grippers.values()]


def test_grippers_are_calibrated_only_where_it_is_needed(system: System) -> None:
    gripper, prepared = system.grippers[Side.RIGHT], Preparing(system)
    system.manager.make_ready()
    system.manager.make_ready()
    assert prepared.said == ["calibrate the right and left grippers: the fingers close"]
    gripper.calibrate()
    assert (gripper.is_calibrated(), gripper.position()) == (True, 0.0)


@pytest.mark.parametrize(
    ("fault", "code", "number"),
    [(Fault.COLLISION, "stopped_by", 50204), (Fault.EMERGENCY_STOP, "stopped_by_and_active", 10013)],
)
def test_manager_calibrates_nothing_while_a_stop_is_open_that_was_not_seen_yet(
    system: System, fault: Fault, code: str, number: int
) -> None:
    system.faults.inject(fault)
    with refused(StopNotConfirmed, code) as refusal:
        system.manager.calibrate(system.grippers[Side.RIGHT])
    assert numbers_in(refusal.value.said) == {number}
    assert not system.grippers[Side.RIGHT].is_calibrated()


def test_egm_does_not_start_while_a_gripper_is_being_calibrated(system: System) -> None:
    taken: list[bool] = []
    original = system.client.pulse_signal

    def pulse(name: str) -> None:
        taken.append(system.manager._turn.locked())
        original(name)

    system.client.pulse_signal = pulse  # type: ignore[method-assign]
    system.manager.calibrate(*system.grippers.values())
    assert taken == [True]
    assert are_calibrated(system) == [True, True]


@pytest.mark.parametrize(
    ("happen", "code", "numbers"),
    [
        (lambda system: system.manager.interrupt(), "stop_requested_meanwhile", set()),
        (lambda system: (system.faults.inject(Fault.COLLISION), system.manager.monitor.read()), "stopped_by", {50204}),
    ],
    ids=["stop", "collision"],
)
def test_calibration_waits_no_longer_when_a_stop_comes(
    system: System, happen: Callable[[System], object], code: str, numbers: set[int]
) -> None:
    original = system.client.pulse_signal

    def pulse(name: str) -> None:
        original(name)
        happen(system)

    system.client.pulse_signal = pulse  # type: ignore[method-assign]
    with refused(RobotNotReady, code) as refusal:
        system.manager.calibrate(system.grippers[Side.RIGHT])
    assert numbers_in(refusal.value.said) == numbers


def test_stop_that_is_asked_for_while_the_program_starts_closes_no_fingers() -> None:
    system = System()
    Preparing(system, system.manager.step)

    def report(step: str) -> None:
        if step == "start the RAPID program":
            system.manager.interrupt()

    with refused(RobotNotReady, "stop_requested_meanwhile"):
        system.manager.go_to(RobotMode.READY, report)
    assert are_calibrated(system) == [False, False]


def test_steps_of_a_mode_have_the_calibration_of_grippers() -> None:
    system, steps = System(), []
    Preparing(system, system.manager.step)
    system.manager.go_to(RobotMode.READY, steps.append)
    assert steps[-1] == "calibrate the right and left grippers: the fingers close"


class NothingMoves:
    """An executor of arms that stand."""

    def bring_to_rest(self, arms: tuple[Side, ...]) -> None:
        """They do already."""


@pytest.fixture
def script(system: System) -> Connection:
    """A script's connection to the virtual robot, with EGM on both arms."""
    connection = Connection(read_settings(), {}, tuple(Side))
    connection.manager, connection.grippers = system.manager, system.grippers
    connection.executor = cast("MotionExecutor", NothingMoves())
    system.manager.start_egm()
    return connection


def test_calibration_by_a_script_pauses_egm(system: System, script: Connection) -> None:
    script.calibrate(Side.LEFT)
    assert are_calibrated(system) == [False, True]
    assert system.manager.egm_arms == tuple(Side)
    assert system.manager.check_ready() == "ready, EGM runs"


def test_calibration_by_a_script_leaves_the_other_arm_to_the_person_who_commands_it(
    system: System, script: Connection
) -> None:
    with requested_by(Commander.HEADSET, "person"):
        system.control.hand_over.take(Side.RIGHT, Commander.HEADSET)
    with refused(CommandRefused, "gripper_reserved_for_person", gripper="right"):
        script.calibrate(Side.LEFT)
    assert are_calibrated(system) == [False, False]
    assert system.manager.check_ready() == "ready, EGM runs"


def test_calibration_by_a_script_that_fails_starts_nothing(system: System, script: Connection) -> None:
    system.client.stop_rapid()
    with refused(RobotNotReady, "cannot_calibrate", reason=IN_EGM):
        script.calibrate(Side.LEFT)
    assert system.client.execution() is ExecutionState.STOPPED
    assert system.manager.egm_arms == ()


def test_both_grippers_are_calibrated_in_the_time_of_one(system: System) -> None:
    begin = system.now()
    system.grippers[Side.RIGHT].calibrate()
    one = system.now() - begin
    for side in Side:
        system.faults.inject(Fault.GRIPPER_NOT_CALIBRATED, side)
    begin = system.now()
    system.grippers[Side.RIGHT].calibrate(system.grippers[Side.LEFT])
    assert system.now() - begin < 1.2 * one
    assert are_calibrated(system) == [True, True]


def test_grippers_that_lost_their_calibration_in_a_restart_are_calibrated_by_recovery(calibrated: System) -> None:
    prepared = Preparing(calibrated)
    calibrated.manager.start_egm()
    assert prepared.said == []
    calibrated.faults.inject(Fault.WARM_RESTART)
    for side in Side:
        calibrated.faults.inject(Fault.GRIPPER_NOT_CALIBRATED, side)
    calibrated.wait(0.5)
    assert calibrated.manager.recover(lambda step: None) == recovered("10045 System restarted")
    assert are_calibrated(calibrated) == [True, True]
    assert prepared.complaints == []


def test_grippers_of_a_robot_that_becomes_ready_late_are_calibrated_before_egm_starts() -> None:
    system = System()
    prepared = Preparing(system)
    system.faults.inject(Fault.MANUAL_MODE)
    with pytest.raises(RobotNotReady, match="MANR"):
        system.manager.make_ready()
    system.faults.inject(Fault.AUTO_MODE)
    system.manager.start_egm()
    assert are_calibrated(system) == [True, True]
    assert prepared.complaints == []


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"is_allowed": False}, message("calibration_not_allowed_by_settings")),
        ({"is_confirmed": lambda: False}, message("gripper_may_hold_something_after_stop")),
    ],
)
def test_gripper_that_may_not_be_calibrated_is_reported_once_with_the_command(
    system: System, options: dict[str, Any], reason: Message
) -> None:
    prepared = Preparing(system, **options)
    system.manager.start_egm()
    system.manager.stop_egm()
    system.manager.start_egm()
    assert are_calibrated(system) == [False, False]
    right, _ = prepared.complaints
    assert_says(right, "gripper_left_uncalibrated", gripper="right", reason=reason)
    assert right.actions == (Action.CALIBRATE,)


def test_gripper_that_holds_something_without_calibration_keeps_it(calibrated: System, left: RwsGripper) -> None:
    prepared = Preparing(calibrated)
    done(left, OPEN)
    done(left, CLOSE)
    calibrated.world.grippers[Side.LEFT].is_calibrated = False
    calibrated.wait(REPORTED)
    calibrated.manager.make_ready()
    (complaint,) = prepared.complaints
    reason = message("gripper_presses_on_something")
    assert_says(complaint, "gripper_left_uncalibrated", gripper="left", reason=reason)
    assert calibrated.world.grippers[Side.LEFT].is_holding


def test_gripper_that_a_person_jogs_is_not_calibrated_under_his_grippers(system: System) -> None:
    prepared = Preparing(system)
    system.grippers[Side.RIGHT].jog(opens=True)
    system.wait(REPORTED)
    system.manager.make_ready()
    (complaint,) = prepared.complaints
    assert_says(complaint, "gripper_left_uncalibrated", gripper="right", reason=message("gripper_fingers_move"))
    assert are_calibrated(system) == [False, True]


def test_gripper_is_as_good_where_it_must_be_asked(calibrated: System, left: RwsGripper) -> None:
    calibrated.signals.close()
    assert (done(left, OPEN), done(left, CLOSE)) == (GripOutcome.OPEN, GripOutcome.HOLDING)
    assert done(left, OPEN) is GripOutcome.OPEN
    assert done(left, CLOSE) is GripOutcome.HOLDING
    assert left.last_position == pytest.approx(0.010, abs=2e-4)


def test_fingers_are_reported_twenty_times_a_second_without_a_request_while_egm_runs(
    calibrated: System, right: RwsGripper, monkeypatch: pytest.MonkeyPatch
) -> None:
    calibrated.start_egm()
    right.begin(finger_position_goal(FINGER_TRAVEL, speed=0.0125))
    calibrated.wait(0.1)
    monkeypatch.setattr(calibrated.http, "handle_request", lambda *_: pytest.fail("something was asked"))
    positions = set()
    for _ in range(60):
        calibrated.wait(6 * CYCLE)
        positions.add(right.state().position)
    assert len(positions) >= int(20 * 60 * 6 * CYCLE)


def test_grippers_are_reported_again_beside_a_monitor_however_often_the_web_socket_breaks(calibrated: System) -> None:
    """The controller allows two groups of subscriptions; what is lost must not count as one."""
    calibrated.manager.monitor.read()
    for _ in range(3):
        calibrated.faults.inject(Fault.WEB_SOCKET_DROP)
        calibrated.wait(0.1)
        assert calibrated.signals.state(Side.RIGHT) is None
        calibrated.signals.keep_open()
        assert calibrated.signals.state(Side.RIGHT) is not None


def test_gripper_is_known_again_after_the_web_socket_broke(calibrated: System, right: RwsGripper) -> None:
    calibrated.faults.inject(Fault.WEB_SOCKET_DROP)
    calibrated.wait(0.1)
    assert calibrated.signals.state(Side.RIGHT) is None
    assert done(right, OPEN) is GripOutcome.OPEN
    calibrated.signals.keep_open()
    assert calibrated.signals.state(Side.RIGHT).position == FINGER_TRAVEL


def test_gripper_holds_an_object_and_knows_its_width(left: RwsGripper) -> None:
    assert (done(left, OPEN), done(left, CLOSE)) == (GripOutcome.OPEN, GripOutcome.HOLDING)
    assert left.last_position == pytest.approx(0.010, abs=2e-4)
    assert left.state().force == 10.0


def test_gripper_closes_on_nothing(right: RwsGripper) -> None:
    assert (done(right, OPEN), done(right, CLOSE)) == (GripOutcome.OPEN, GripOutcome.CLOSED)


def test_gripper_holds_a_hollow_object_from_inside(calibrated: System, right: RwsGripper) -> None:
    calibrated.world.grippers[Side.RIGHT].workpiece = Workpiece(0.030, is_hollow=True)
    assert done(right, SPREAD) is GripOutcome.HOLDING
    assert (right.last_position, right.state().force) == (pytest.approx(0.015), 8.0)


def test_grip_outwards_on_nothing_ends_open(right: RwsGripper) -> None:
    assert done(right, SPREAD) is GripOutcome.OPEN
    assert not right.is_holding()


def test_gripper_goes_to_a_place_between_with_the_speed_it_is_reported(calibrated: System, right: RwsGripper) -> None:
    begin = calibrated.now()
    assert done(right, finger_position_goal(0.012, speed=0.005)) is GripOutcome.IN_PLACE
    assert right.last_position == pytest.approx(0.012, abs=5e-4)
    assert calibrated.now() - begin == pytest.approx(2.6, abs=0.4)


def test_gripper_can_be_used_again_and_again(left: RwsGripper) -> None:
    for _ in range(3):
        assert (done(left, OPEN), done(left, CLOSE)) == (GripOutcome.OPEN, GripOutcome.HOLDING)


def test_object_too_heavy_for_the_force_is_lost_and_the_fingers_close(calibrated: System, left: RwsGripper) -> None:
    calibrated.world.grippers[Side.LEFT].workpiece = Workpiece(0.02, mass=0.4)
    done(left, OPEN)
    assert done(left, grip(GripDirection.INWARDS, 2.0)) in {GripOutcome.HOLDING, GripOutcome.CLOSED}
    calibrated.wait(1.0)
    assert (left.is_holding(), left.position()) == (False, 0.0)


def test_something_in_the_way_of_a_move_is_reported_as_stalled_and_the_next_order_works(left: RwsGripper) -> None:
    done(left, OPEN)
    assert done(left, finger_position_goal(0.005)) is GripOutcome.STALLED
    assert left.last_position == pytest.approx(0.010)
    assert done(left, OPEN) is GripOutcome.OPEN


def test_move_that_is_cancelled_stops_where_it_is(calibrated: System, right: RwsGripper) -> None:
    right.begin(OPEN)
    begin = calibrated.now()
    assert right.wait(OPEN, is_cancelled=lambda: calibrated.now() - begin > 0.5) is None
    assert 0.008 < right.position() < 0.022
    assert right.state().state is ServoState.READY


def test_move_that_is_stopped_by_a_person_says_so(right: RwsGripper) -> None:
    right.begin(OPEN)
    right.stop()
    with refused(GoalNotReached, "gripper_stopped", gripper="right"):
        right.wait(OPEN)


def test_jog_needs_no_calibration_and_goes_on_until_stop(system: System) -> None:
    gripper = system.grippers[Side.RIGHT]
    gripper.jog(opens=True)
    system.wait(1.0)
    assert gripper.state().state is ServoState.JOG_OPEN
    gripper.stop()
    position = gripper.position()
    system.wait(0.5)
    assert gripper.position() == position > 0.008


@pytest.mark.parametrize("begin", [lambda hand: hand.begin(OPEN), lambda hand: hand.jog(opens=True)])
def test_gripper_that_must_hold_stops_its_fingers(
    calibrated: System, right: RwsGripper, begin: Callable[[RwsGripper], None]
) -> None:
    begin(right)
    calibrated.wait(0.3)
    right.hold()
    position = right.position()
    calibrated.wait(0.5)
    assert (right.state().state, right.position()) == (ServoState.READY, position)
    assert 0.0 < position < FINGER_TRAVEL


def test_gripper_that_must_hold_keeps_what_it_holds(calibrated: System, left: RwsGripper) -> None:
    done(left, OPEN)
    assert done(left, CLOSE) is GripOutcome.HOLDING
    left.hold()
    calibrated.wait(0.5)
    assert left.is_holding()


def test_error_of_the_gripper_is_reported_until_it_is_cleared(calibrated: System, right: RwsGripper) -> None:
    calibrated.faults.inject(Fault.GRIPPER_ERROR, Side.RIGHT)
    calibrated.wait(REPORTED)
    with refused(RobotNotReady, "gripper_reports_error", gripper="right", error=7.0):
        right.begin(OPEN)
    right.clear_error()
    assert done(right, OPEN) is GripOutcome.OPEN


def test_error_in_the_middle_of_a_move_is_no_stall(calibrated: System, right: RwsGripper) -> None:
    right.begin(OPEN)
    calibrated.wait(0.3)
    calibrated.faults.inject(Fault.GRIPPER_ERROR, Side.RIGHT)
    with refused(RobotNotReady, "gripper_reports_error", gripper="right", error=7.0):
        right.wait(OPEN)


def test_gripper_that_lost_its_power_must_be_calibrated_again(calibrated: System, right: RwsGripper) -> None:
    calibrated.faults.inject(Fault.GRIPPER_NOT_CALIBRATED, Side.RIGHT)
    calibrated.wait(REPORTED)
    with refused(RobotNotReady, "gripper_not_calibrated", gripper="right") as refusal:
        right.begin(OPEN)
    assert refusal.value.said.actions == (Action.CALIBRATE,)
    right.calibrate()
    assert done(right, OPEN) is GripOutcome.OPEN


@pytest.mark.parametrize(
    ("order", "quantity", "values"),
    [
        (lambda: finger_position_goal(FINGER_TRAVEL + 0.001), "position", {"position": 0.026, "most": 0.025}),
        (lambda: finger_position_goal(nan), "position", {"position": nan, "most": 0.025}),
        (lambda: finger_position_goal(0.01, speed=0.03), "speed", {"speed": 0.03, "lowest": 0.003, "highest": 0.025}),
        (lambda: finger_position_goal(0.01, speed=nan), "speed", {"speed": nan, "lowest": 0.003, "highest": 0.025}),
        (lambda: grip(GripDirection.INWARDS, MAX_GRIP_FORCE + 1.0), "force", {"force": 21.0, "most": 20.0}),
        (lambda: grip(GripDirection.OUTWARDS, 0.0), "force", {"force": 0.0, "most": 20.0}),
    ],
)
def test_order_that_no_gripper_can_carry_out_is_refused(
    order: Callable[[], GripperGoal], quantity: str, values: dict[str, float]
) -> None:
    with refused(CommandRefused, f"gripper_{quantity}_out_of_range", **values):
        order()


@pytest.mark.parametrize("channel", [1, 2])
def test_vacuum_picks_what_lies_under_the_cup_and_blows_it_off(calibrated: System, channel: int) -> None:
    gripper, cup = calibrated.grippers[Side.LEFT], calibrated.world.grippers[Side.LEFT].cups[channel]
    cup.under = CupObject()
    gripper.switch_vacuum(channel, is_on=True)
    assert gripper.wait_until_picked(channel, 70_000.0, 1.0)
    gripper.drop(channel)
    reading = gripper.vacuum(channel)
    assert (reading.sucks, reading.blows) == (False, False)
    assert reading.pressure == pytest.approx(ATMOSPHERIC_PRESSURE, rel=0.05)


def test_object_that_leaks_is_not_picked(calibrated: System, left: RwsGripper) -> None:
    calibrated.world.grippers[Side.LEFT].cups[1].under = CupObject(leak=0.9)
    left.switch_vacuum(1, is_on=True)
    assert not left.wait_until_picked(1, 70_000.0, 1.0)


def test_vacuum_of_an_uncalibrated_gripper_is_refused_and_stays_off(system: System) -> None:
    gripper = system.grippers[Side.LEFT]
    with refused(RobotNotReady, "gripper_not_calibrated", gripper="left"):
        gripper.switch_vacuum(1, is_on=True)
    assert not gripper.vacuum(1).sucks


@pytest.mark.parametrize("modules", list(GripperModules))
def test_gripper_shows_and_offers_the_modules_it_is_configured_with(modules: GripperModules) -> None:
    system = System(modules=modules, are_calibrated=True)
    system.bringup.make_ready()
    gripper = system.grippers[Side.LEFT]
    reading = gripper.state()
    assert (reading.is_camera_linked, tuple(reading.cups)) == (modules.has_camera, modules.vacuum_channels)
    for channel in modules.vacuum_channels:
        gripper.switch_vacuum(channel, is_on=True)
    for channel in {1, 2} - set(modules.vacuum_channels):
        code = "gripper_has_other_vacuum" if modules.vacuum_channels else "gripper_has_no_vacuum"
        with refused(CommandRefused, code, gripper="left", modules=modules.value, channel=channel):
            gripper.switch_vacuum(channel, is_on=True)


@pytest.mark.parametrize("channel", [0, 3])
def test_vacuum_that_no_gripper_has_is_refused(left: RwsGripper, channel: int) -> None:
    with refused(CommandRefused, "vacuum_channel_unknown", channel=channel):
        left.switch_vacuum(channel, is_on=True)


def egm_motion(commands: Callable[[System], None]) -> DriverArm:
    """The left arm on its way for four seconds, with ``commands`` beside it."""
    system = System(are_calibrated=True)
    system.start_egm()
    system.signals.keep_open()
    arm, begin = system.arms[Side.LEFT], system.now()
    arm.go((*home(Side.LEFT)[:6], home(Side.LEFT)[6] + radians(60.0)))
    commands(system)
    left_over = 4.0 - (system.now() - begin)
    assert left_over > 0.0
    system.wait(left_over)
    return arm


def use_both_hands(system: System) -> None:
    for gripper in system.grippers.values():
        done(gripper, grip(GripDirection.OUTWARDS, 5.0))
        done(gripper, OPEN)
    left = system.grippers[Side.LEFT]
    left.begin(CLOSE)
    left.switch_vacuum(1, is_on=True)


def test_gripper_is_not_calibrated_while_its_arm_is_in_egm(calibrated: System, left: RwsGripper) -> None:
    calibrated.start_egm()
    with refused(RobotNotReady, "cannot_calibrate", reason=IN_EGM):
        left.calibrate()


def test_gripper_commands_during_a_motion_change_no_cycle_of_it() -> None:
    alone = egm_motion(lambda system: None)
    beside = egm_motion(use_both_hands)
    assert (beside.snapshot.wire.missed, beside.snapshot.wire.late, beside.snapshot.wire.lost) == (0, 0, 0)
    count = min(len(alone.measured), len(beside.measured))
    assert count > 900
    assert beside.admitted[:count] == alone.admitted[:count]
    assert beside.measured[:count] == alone.measured[:count]


def test_grippers_are_closed_as_a_test_where_that_is_allowed(calibrated: System) -> None:
    said: list[Message] = []
    close_as_test(calibrated.grippers, said.append, said.append)
    assert said == [message("gripper_tested", gripper=side.word) for side in calibrated.grippers]
    assert all(gripper.position() <= THINNEST_GRIPPED for gripper in calibrated.grippers.values())


def test_gripper_that_does_not_close_is_reported_and_the_other_is_tested(calibrated: System, left: RwsGripper) -> None:
    said: list[Message] = []
    done(left, OPEN)
    close_as_test(calibrated.grippers, said.append, said.append)
    assert said[0] == message("gripper_tested", gripper="right")
    assert_says(said[1], "gripper_unusable", gripper="left")
    assert_says(said[1].values["reason"], "gripper_test_failed", position=left.last_position)


def test_gripper_that_holds_something_is_not_tested(calibrated: System, left: RwsGripper) -> None:
    said: list[Message] = []
    done(left, OPEN)
    done(left, CLOSE)
    close_as_test({Side.LEFT: left}, said.append, said.append)
    assert said == [message("gripper_holds_and_was_not_tested", gripper="left")]
    assert left.is_holding()
