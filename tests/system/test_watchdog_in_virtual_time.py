"""The watchdog on the robot: a driver that falls silent, a stop request, and a task that is held by a trap."""

from __future__ import annotations

from collections import Counter
from threading import Event
from types import SimpleNamespace
from typing import cast

import pytest

from abb_protocols.errors import ControllerRefused
from abb_protocols.robot.joints import Side
from abb_protocols.rws import rapid_values
from abb_protocols.rws.values import ControllerState, ExecutionState
from abb_runtime.faults import Fault
from abb_runtime.process import supervision
from abb_runtime.rws.client import RwsClient
from system.recovery_bench import MovingSystem, recovered
from system.virtual_time_bench import System
from virtual_irc5.mechanics.arm_motion import ArmModel
from yumi.driver.state_machine import RUN_SG_SIGNAL, SG_MODULE, START_JOINT_SIGNAL, WATCHDOG_MODULE, SgCommand
from yumi.driver.watchdog import Watchdog, WatchdogSettings

TIMEOUT = 1.0
RAMP = 2.5  # a stopped program ends EGM within the ramp_time of MOC.cfg, 0.2 s
SETTINGS = WatchdogSettings(timeout=TIMEOUT)


def watchdog(system: System) -> Watchdog:
    return Watchdog(system.client, lambda: None, SETTINGS)


@pytest.fixture
def system() -> MovingSystem:
    system = MovingSystem()
    watchdog(system).arm_robot()
    return system


def execution(system: System) -> ExecutionState:
    return system.client.execution()


def logged(system: System, code: int) -> list[str]:
    return [event.description for event in system.world.controller.events.entries() if event.code == code]


def hardest_braking(system: System, seconds: float) -> float:
    """Largest change of a joint's planned speed from cycle to cycle within the next ``seconds`` [rad/s²]."""
    hardest, arm = 0.0, system.world.arms[Side.RIGHT]
    end = system.now() + seconds
    while system.now() < end:
        before, begin = arm.velocity, system.now()
        system.wait(0.004)
        changes = [abs(new - old) for new, old in zip(arm.velocity, before, strict=True)]
        hardest = max(hardest, *(change / (system.now() - begin) for change in changes))
    return hardest


def test_robot_stops_gently_and_says_so_when_its_driver_dies(system: MovingSystem) -> None:
    system.arms = {}
    braking = hardest_braking(system, TIMEOUT + RAMP)
    assert execution(system) is ExecutionState.STOPPED
    assert system.client.controller_state() is ControllerState.MOTORS_ON
    assert f"No sign of life for {TIMEOUT} s: T_ROB_R" in logged(system, 80001)
    assert all(arm.is_stationary for arm in system.world.arms.values())
    assert braking < ArmModel().brake_deceleration


def test_robot_that_stopped_itself_is_brought_back_by_the_next_driver(system: MovingSystem) -> None:
    system.arms = {}
    system.wait(TIMEOUT + 0.5)
    system.start_driver()
    assert system.recover() == recovered("80001 Stopped by the watchdog", done="The robot is ready")
    system.manager.start_egm()
    assert system.is_moving_again()


def test_driver_that_follows_at_once_ends_what_its_predecessor_has_left_behind(system: MovingSystem) -> None:
    system.start_driver()
    system.wait(0.1)
    assert all(arm.snapshot.is_running for arm in system.arms.values())
    system.steps.clear()
    system.manager.make_ready()
    assert system.steps == ["end the EGM motion that runs (the arms come to rest)"]
    system.wait(TIMEOUT + 0.5)
    assert execution(system) is ExecutionState.RUNNING


def test_egm_that_another_program_has_begun_is_begun_anew_and_watched(monkeypatch: pytest.MonkeyPatch) -> None:
    system = System()
    monkeypatch.setattr(system.manager.watchdog, "beat", lambda: None)  # its thread would let time pass beside the test
    system.manager.watchdog.start()
    try:
        system.manager.make_ready()
        system.client.pulse_signal(START_JOINT_SIGNAL)
        system.wait(0.5)
        system.manager.start_egm()
        assert system.steps[-4:-2] == ["stop EGM", "start EGM on both arms"]
        assert system.manager.panel.read_variable("T_ROB_L", WATCHDOG_MODULE, "active") == "TRUE"
    finally:
        system.manager.watchdog.stop()


def test_sign_that_met_a_stopped_program_keeps_no_other_from_being_seen(system: MovingSystem) -> None:
    driver = watchdog(system)
    system.faults.inject(Fault.PROGRAM_STOP)
    system.wait(0.2)
    driver.beat()  # which is not taken back
    system.recover()
    driver.arm_robot()
    for _ in range(4):
        driver.beat()
        system.wait(TIMEOUT / 2)
    assert execution(system) is ExecutionState.RUNNING


def test_robot_goes_on_as_long_as_its_driver_lives(system: MovingSystem) -> None:
    driver = watchdog(system)
    for _ in range(4):
        driver.beat()
        system.wait(TIMEOUT / 2)
    assert execution(system) is ExecutionState.RUNNING
    assert all(arm.snapshot.is_commanded for arm in system.arms.values())


def test_sign_that_came_while_the_program_stood_hides_no_later_one(system: MovingSystem) -> None:
    """A signal that is up already has no edge."""
    driver = watchdog(system)
    system.faults.inject(Fault.PROGRAM_STOP)
    driver.beat()
    system.recover()
    driver.arm_robot()
    for _ in range(4):
        system.wait(TIMEOUT / 2)
        driver.beat()
    assert execution(system) is ExecutionState.RUNNING


def test_stop_request_stops_the_robot_at_once(system: MovingSystem) -> None:
    system.manager.write_signal("WD_STOP_REQUEST", 1)
    system.wait(0.1)
    assert execution(system) is ExecutionState.STOPPED
    assert "Stop requested by WD_STOP_REQUEST: T_ROB_L" in logged(system, 80001)


def test_watchdog_that_is_not_active_stops_nothing() -> None:
    system = System()
    system.manager.make_ready()
    system.manager.write_signal("WD_STOP_REQUEST", 1)
    system.wait(6.0)
    assert execution(system) is ExecutionState.RUNNING
    assert logged(system, 80001) == []


def test_watchdog_that_was_disarmed_stops_nothing(system: MovingSystem) -> None:
    driver = watchdog(system)
    driver.arm_robot()
    driver.disarm()
    system.wait(TIMEOUT + 0.5)
    assert execution(system) is ExecutionState.RUNNING


def test_task_that_was_held_by_a_gripper_does_not_take_it_for_silence(system: MovingSystem) -> None:
    """We refuse to calibrate then; another client may ask the task itself."""
    system.gives_signs = True
    system.client.set_symbol("T_ROB_L", SG_MODULE, "command_input", rapid_values.encode(float(SgCommand.CALIBRATE)))
    system.client.pulse_signal(RUN_SG_SIGNAL)
    system.until(lambda: system.world.grippers[Side.LEFT].is_calibrated, 8.0)
    system.wait(1.2 * TIMEOUT)
    assert system.grippers[Side.LEFT].is_calibrated()
    assert execution(system) is ExecutionState.RUNNING


def test_driver_whose_control_process_died_gives_no_sign(system: MovingSystem) -> None:
    def check() -> None:
        raise ControllerRefused("The control process has ended.", status=0)

    Watchdog(system.client, check, SETTINGS).beat()
    assert system.client.signal("WD_EXTERNAL_STATUS").value == 0


@pytest.mark.parametrize("fails", ["check", "set_signal"])
def test_watchdog_sends_the_next_heartbeat_after_an_unexpected_exception(
    fails: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Else the robot would stop a driver that lives. The thread itself, which waits by the machine's clock."""
    monkeypatch.setattr(supervision, "FIRST_RESTART_PAUSE", 0.001)
    calls, has_beaten = Counter[str](), Event()

    def call(name: str) -> None:
        calls[name] += 1
        if name == fails and calls[name] == 1:
            raise RecursionError("nobody expected it")

    def set_signal(*_: object) -> None:
        call("set_signal")
        has_beaten.set()

    driver = Watchdog(
        cast("RwsClient", SimpleNamespace(set_signal=set_signal)), lambda: call("check"), WatchdogSettings(timeout=0.01)
    )
    driver.is_armed = True
    driver.start()
    try:
        assert has_beaten.wait(10.0)
    finally:
        driver.stop()
    assert [record.getMessage() for record in caplog.records] == [
        "Thread watchdog failed with RecursionError: nobody expected it"
    ]


def test_robot_without_a_watchdog_is_in_egm_all_the_same(system: MovingSystem) -> None:
    for task in system.world.controller.tasks.values():
        del task.program.modules[WATCHDOG_MODULE.lower()]
    remark = watchdog(system)
    remark.start()
    try:
        assert remark.arm().startswith("no watchdog, the robot will not notice when this program dies")
    finally:
        remark.stop()


def test_driver_that_goes_disarms_the_watchdog_also_when_egm_has_ended_by_itself() -> None:
    system = System()
    system.manager.watchdog.start()
    try:
        system.manager.start_egm()
        system.faults.inject(Fault.EGM_CONVERGENCE)
        system.wait(0.5)
        system.manager.end_motion()
        assert system.manager.panel.read_variable("T_ROB_L", WATCHDOG_MODULE, "active") == "FALSE"
    finally:
        system.manager.watchdog.stop()


def test_egm_arms_the_watchdog_and_its_end_disarms_it() -> None:
    system = System()
    system.manager.watchdog.start()
    try:
        system.manager.start_egm()
        assert system.manager.panel.read_variable("T_ROB_L", WATCHDOG_MODULE, "active") == "TRUE"
        system.manager.stop_egm()
        assert system.manager.panel.read_variable("T_ROB_L", WATCHDOG_MODULE, "active") == "FALSE"
    finally:
        system.manager.watchdog.stop()
