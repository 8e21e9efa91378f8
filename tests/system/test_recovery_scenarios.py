"""What may happen to a robot in mid-motion, each from noticing it to moving again, without a restart and a jump."""

from __future__ import annotations

from typing import NoReturn

import httpx
import pytest

from abb_protocols.catalogue import Message, message
from abb_protocols.errors import NoConnection, RobotNotReady
from abb_protocols.robot.joints import CYCLE, Side
from abb_protocols.rws.values import ControllerState
from abb_runtime.faults import Fault
from abb_runtime.rws.transport import AnswerTimeout
from refusals import refused
from system.recovery_bench import MovingSystem, recovered
from yumi.driver.state_machine import EgmMotionSettings

NO_JUMP = 1.001
LEFT_BEHIND = "end the EGM motion that runs (the arms come to rest)"
ACTIVATION = [f"activate joint_position_controller on the {side.word} arm" for side in Side]


@pytest.fixture
def system() -> MovingSystem:
    return MovingSystem()


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        (Fault.PROGRAM_STOP, "10125 Program stopped"),
        (Fault.MOTORS_OFF, "10010 Motors OFF"),
        (Fault.DYNAMIC_LOAD, "50375 Dynamic load too high"),
    ],
)
def test_robot_moves_again_after_what_needs_no_one(system: MovingSystem, fault: Fault, why: str) -> None:
    system.faults.inject(fault)
    system.wait(0.2)
    assert not any(arm.snapshot.is_commanded for arm in system.arms.values())
    assert system.recover() == recovered(why)
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


@pytest.mark.parametrize(
    ("fault", "mended", "cause", "error"),
    [
        (
            Fault.MANUAL_MODE,
            Fault.AUTO_MODE,
            message("event_10015", number=10015, title="Manual mode selected"),
            message("cannot_bring_up", reason=message("not_in_auto", mode="MANR")),
        ),
        (
            Fault.WRONG_PROGRAM,
            Fault.RIGHT_PROGRAM,
            message("event_10125", number=10125, title="Program stopped"),
            message("state_machine_missing", task="T_ROB_R", module="TRobMain"),
        ),
    ],
)
def test_recovery_says_what_a_person_has_to_do_first(
    system: MovingSystem, fault: Fault, mended: Fault, cause: Message, error: Message
) -> None:
    system.faults.inject(fault)
    system.wait(0.2)
    with refused(RobotNotReady, "not_brought_back", why=message("was_stopped_by", causes=(cause,)), error=error):
        system.recover()
    system.faults.inject(mended)
    system.recover()
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


@pytest.mark.parametrize("silence", [0.05, 1.0])
def test_arms_go_on_after_a_network_that_was_silent(system: MovingSystem, silence: float) -> None:
    system.be_silent(silence)
    assert system.recover() == recovered()
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def test_short_silence_needs_no_recovery(system: MovingSystem) -> None:
    system.be_silent(0.016)
    assert all(arm.snapshot.is_commanded for arm in system.arms.values())
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def test_network_that_stays_silent_is_reported_with_what_to_check(system: MovingSystem) -> None:
    system.faults.inject(Fault.EGM_SILENCE)
    system.wait(1.0)
    error = message("no_datagram_came", arms=("right", "left"), devices=("ROB_R", "ROB_L"))
    with refused(RobotNotReady, "not_brought_back", error=error):
        system.recover()
    system.faults.inject(Fault.EGM_REPAIR)
    system.recover()
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def test_robot_that_got_no_answer_in_time_is_brought_back() -> None:
    system = MovingSystem(EgmMotionSettings(comm_timeout=1.0))
    system.be_silent(1.5)
    told = system.recover()
    assert "41822 No data from the UdpUc device" in told
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def test_motion_that_ended_by_convergence_begins_again(system: MovingSystem) -> None:
    system.faults.inject(Fault.EGM_CONVERGENCE)
    system.wait(0.2)
    assert not any(arm.snapshot.is_commanded for arm in system.arms.values())
    assert system.recover() == recovered()
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def test_one_arm_that_lost_egm_begins_again_while_the_other_goes_on() -> None:
    system = MovingSystem(EgmMotionSettings(comm_timeout=0.5))
    left = system.arms[Side.LEFT]
    system.be_silent(0.8, Side.RIGHT)
    session, activation = left.snapshot.session, left.snapshot.activation
    system.recover()
    assert (left.snapshot.session, left.snapshot.activation) == (session, activation)
    assert not {"stop EGM", LEFT_BEHIND} & set(system.told)
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def stand_still(system: MovingSystem, seconds: float) -> None:
    """The machine stalls: nothing is answered, then all that has come is there at once."""
    system.stands_still = True
    system.wait(seconds)
    system.stands_still = False
    system.wait(0.05)


def test_driver_that_stood_still_for_a_few_cycles_goes_on(system: MovingSystem) -> None:
    stand_still(system, 3 * CYCLE)
    assert all(arm.snapshot.is_commanded for arm in system.arms.values())
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def test_driver_that_stood_still_for_longer_takes_its_arms_again(system: MovingSystem) -> None:
    stand_still(system, 0.2)
    assert not any(arm.snapshot.is_commanded for arm in system.arms.values())
    system.recover()
    assert system.told == [str(message("no_stop_cause")), *ACTIVATION]
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def test_machine_that_stood_still_with_its_robot_takes_its_arms_again(system: MovingSystem) -> None:
    """Robot and driver stall together: for the driver the robot was silent, for the robot nothing was."""
    system.advance(0.2)
    for side, arm in system.arms.items():
        arm.line.watch_silence(system.now())
        assert not system.arms[side].line.manager.is_commanding
    system.wait(0.05)
    system.recover()
    assert system.told == [str(message("no_stop_cause")), *ACTIVATION]
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def test_egm_that_goes_on_without_its_program_is_not_started_again(
    system: MovingSystem, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(type(system.bringup.panel), "is_running", property(lambda _: False))
    begin = system.now()
    with refused(RobotNotReady, "egm_does_not_end"):
        system.manager.start_egm()
    assert system.now() - begin == pytest.approx(1.0, abs=0.2)


def test_controllers_that_were_active_are_active_again(system: MovingSystem) -> None:
    system.faults.inject(Fault.PROGRAM_STOP)
    system.wait(0.2)
    system.recover()
    assert "activate joint_position_controller on the right arm" in system.told
    assert all(arm.snapshot.is_commanded for arm in system.arms.values())
    assert system.largest_jump < NO_JUMP


def test_controller_that_restarts_is_waited_for(system: MovingSystem) -> None:
    system.faults.inject(Fault.WARM_RESTART, duration=6.0)
    system.wait(0.5)
    begin = system.now()
    assert system.recover() == recovered("10045 System restarted")
    assert system.told[0] == "wait for the controller, which does not answer"
    assert 5.0 < system.now() - begin < 11.0
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def test_stop_ends_the_waiting_for_a_controller_at_once(system: MovingSystem) -> None:
    system.faults.inject(Fault.WARM_RESTART)
    system.wait(0.5)

    def stop(_: str) -> None:
        with pytest.raises(NoConnection):
            system.manager.stop_rapid()

    begin = system.now()
    with refused(RobotNotReady, "stop_requested_meanwhile"):
        system.manager.recover(stop)
    assert system.now() - begin < 0.1


def test_waiting_for_a_controller_ends_when_it_is_no_use_any_more(system: MovingSystem) -> None:
    class Enough(Exception):
        pass

    def check() -> None:
        if system.now() > begin + 0.5:
            raise Enough

    system.faults.inject(Fault.WARM_RESTART)
    system.wait(0.5)
    begin = system.now()
    with pytest.raises(Enough):
        system.manager.recover(system.told.append, check)
    assert system.now() - begin < 0.6


def test_controller_that_never_answers_again_is_reported(system: MovingSystem) -> None:
    system.is_powered, system.http.is_there, system.arms = False, False, {}
    with refused(RobotNotReady, "controller_is_gone", address="memory", duration=120.0):
        system.recover()


@pytest.mark.parametrize("fault", [Fault.RWS_RESET, Fault.RWS_BUSY, Fault.RWS_SESSIONS_EXPIRED, Fault.WEB_SOCKET_DROP])
def test_trouble_of_web_services_ends_neither_a_motion_nor_a_recovery(system: MovingSystem, fault: Fault) -> None:
    system.manager.monitor.step()  # it subscribes
    system.faults.inject(fault)
    system.wait(0.3)
    assert all(arm.snapshot.is_commanded for arm in system.arms.values())
    system.faults.inject(Fault.PROGRAM_STOP)
    assert system.recover() == recovered("10125 Program stopped")
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def test_connection_that_is_reset_in_the_middle_of_a_request_does_not_stop_recovery(system: MovingSystem) -> None:
    system.faults.inject(Fault.PROGRAM_STOP)
    system.http.resets = 1
    system.recover()
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def test_driver_that_was_killed_is_followed_by_one_that_brings_the_arms_to_rest_first(system: MovingSystem) -> None:
    system.arms = {}
    system.wait(1.0)
    system.start_driver()
    system.steps.clear()
    system.manager.start_egm()
    assert system.steps == [LEFT_BEHIND, "start EGM on both arms", *ACTIVATION]
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def test_controller_that_is_busy_is_waited_for(system: MovingSystem) -> None:
    system.faults.inject(Fault.PROGRAM_STOP)
    system.faults.inject(Fault.RWS_BUSY, duration=3.0)
    system.recover()
    assert system.told[0] == "wait for the controller, which does not answer"
    assert system.is_moving_again()
    assert system.largest_jump < NO_JUMP


def test_recovery_says_within_ten_seconds_that_the_web_service_hangs(
    system: MovingSystem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that starts takes no connection; one that takes it and never answers is not worth two minutes."""
    timeout = 2.0
    silence = message("no_answer_to_request", address="memory", timeout=timeout)

    def hang(*_: object) -> NoReturn:
        system.wait(timeout)
        raise AnswerTimeout(silence)

    with monkeypatch.context() as patch:
        patch.setattr(system.http, "handle_request", hang)
        begin = system.now()
        with refused(RobotNotReady, "web_service_hangs", error=silence):
            system.recover()
        assert system.now() - begin < 10.0
    assert system.recover() == recovered()
    assert system.is_moving_again()


def test_one_slow_answer_does_not_end_the_waiting_for_a_controller(
    system: MovingSystem, monkeypatch: pytest.MonkeyPatch
) -> None:
    exchange, slow = system.http.handle_request, [1]

    def hang_once(request: httpx.Request) -> httpx.Response:
        if slow:
            slow.pop()
            raise AnswerTimeout("memory accepted the connection but did not answer within 2.0 s.")
        return exchange(request)

    monkeypatch.setattr(system.http, "handle_request", hang_once)
    assert system.recover() == recovered()


def test_driver_that_is_to_end_does_not_finish_what_it_was_doing(system: MovingSystem) -> None:
    """Ctrl-C in the middle of a bring-up: no motors on, no program after it."""
    system.faults.inject(Fault.MOTORS_OFF)
    system.wait(0.2)

    def interrupt(step: str) -> None:
        if step == "switch the motors on":
            system.manager.interrupt()

    system.steps.clear()
    with system.bringup.reporting(interrupt), refused(RobotNotReady, "stop_requested_meanwhile"):
        system.manager.make_ready()
    assert system.steps == ["switch the motors on"]
    assert system.client.controller_state() is ControllerState.MOTORS_OFF
