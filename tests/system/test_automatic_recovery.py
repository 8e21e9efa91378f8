"""Recovery without a person: only where no person was involved in the stop, and only when it is switched on."""

from __future__ import annotations

import pytest

from abb_protocols.catalogue import clause, message
from abb_protocols.rws.values import EventType
from abb_runtime.faults import Fault
from system.recovery_bench import MovingSystem
from yumi.driver import recovery
from yumi.driver.recovery import AutomaticRecovery, RecoverySettings
from yumi.driver.settings import read_settings
from yumi.driver.state_machine import EgmMotionSettings

TIMED_OUT = EgmMotionSettings(comm_timeout=0.5)


class SelfRecovering(MovingSystem):
    """A robot whose recovery makes its steps once a second."""

    def __init__(self, motion: EgmMotionSettings | None = None) -> None:
        super().__init__(motion)
        self.lines: list[str] = []
        self.automatic = AutomaticRecovery(
            self.manager, lambda level, sentence: self.lines.append(sentence), RecoverySettings(automatic=True)
        )

    def live(self, seconds: float) -> None:
        for _ in range(round(seconds)):
            self.automatic.step()
            self.wait(1.0)

    def is_recovered_within(self, seconds: float) -> bool:
        """Whether EGM guides both arms again after a step of its recovery, and still does after the next one."""
        for _ in range(round(seconds)):
            self.live(1.0)
            if self.is_guided:
                self.live(1.0)
                return self.is_guided
        return False

    @property
    def is_guided(self) -> bool:
        return all(arm.snapshot.is_commanded for arm in self.arms.values())


def test_recovery_by_itself_is_off_unless_it_is_set() -> None:
    assert read_settings().recovery.automatic is False
    system = MovingSystem()
    system.manager.automatic_recovery.start()
    assert system.manager.automatic_recovery._thread is None


def test_lost_link_is_recovered_without_a_person() -> None:
    system = SelfRecovering()
    system.be_silent(1.0)
    assert system.is_recovered_within(3.0)
    done = message("recovered", done="EGM runs on both arms, the controllers are active")
    assert system.lines == [f"Recovered automatically (recovery.automatic): {done}"]
    assert system.is_moving_again()


def test_driver_that_stood_still_itself_leaves_it_to_a_person() -> None:
    """What commanded the arms until then, a stream perhaps, must not move them without being asked again."""
    system = SelfRecovering()
    system.stands_still = True
    system.wait(0.3)
    system.stands_still = False
    system.live(3.0)
    assert not system.is_guided
    assert system.lines == []


def test_time_out_of_egm_is_recovered_without_a_person() -> None:
    system = SelfRecovering(TIMED_OUT)
    system.be_silent(0.8)
    assert system.is_recovered_within(3.0)


def test_restart_of_the_controller_is_recovered_without_a_person() -> None:
    system = SelfRecovering()
    system.faults.inject(Fault.WARM_RESTART, duration=3.0)
    system.wait(0.5)
    assert system.is_recovered_within(8.0)


@pytest.mark.parametrize(
    "fault",
    [
        Fault.EMERGENCY_STOP,
        Fault.COLLISION,
        Fault.PROGRAM_STOP,
        Fault.MOTORS_OFF,
        Fault.MANUAL_MODE,
        Fault.DYNAMIC_LOAD,
        Fault.EGM_CONVERGENCE,
    ],
)
def test_stop_that_a_person_may_have_made_is_left_to_a_person(fault: Fault) -> None:
    system = SelfRecovering()
    system.faults.inject(fault)
    system.live(2.0)
    mended = {Fault.EMERGENCY_STOP: Fault.EMERGENCY_STOP_RESET, Fault.MANUAL_MODE: Fault.AUTO_MODE}
    if fault in mended:
        system.faults.inject(mended[fault])
    system.live(3.0)
    assert not system.is_guided
    assert not [line for line in system.lines if "Recovered" in line]


@pytest.mark.parametrize("fault", [Fault.EMERGENCY_STOP, Fault.COLLISION])
def test_lost_link_with_a_persons_stop_in_between_is_left_to_a_person(fault: Fault) -> None:
    system = SelfRecovering()
    system.be_silent(0.5)
    system.faults.inject(fault)
    system.wait(0.1)
    if fault is Fault.EMERGENCY_STOP:
        system.faults.inject(Fault.EMERGENCY_STOP_RESET)
    system.live(3.0)
    assert not system.is_guided


def test_restart_that_follows_a_persons_stop_is_left_to_a_person() -> None:
    system = SelfRecovering()
    system.faults.inject(Fault.COLLISION)
    system.wait(0.1)
    system.faults.inject(Fault.WARM_RESTART, duration=3.0)
    system.live(8.0)
    assert not system.is_guided


@pytest.mark.parametrize(
    "deed",
    [
        (Fault.MANUAL_MODE, 10010, 10012, 10016, Fault.AUTO_MODE),
        (Fault.MOTORS_OFF,),
        (50375, 10010),
        (Fault.MANUAL_MODE, Fault.AUTO_MODE),
        (10017,),
    ],
    ids=["mode switch with guard stop", "motors off", "drives tripped", "mode switch", "AUTO confirmed"],
)
def test_time_out_of_egm_with_a_persons_deed_after_it_is_left_to_a_person(deed: tuple[Fault | int, ...]) -> None:
    system = SelfRecovering(TIMED_OUT)
    system.be_silent(0.8)
    system.wait(0.5)
    for each in deed:
        if isinstance(each, Fault):
            system.faults.inject(each)
        else:
            kind = EventType.ERROR if each == 50375 else EventType.INFORMATION
            system.world.controller.events.append(each, "Deed", "At the robot.", kind)
    system.live(4.0)
    assert not system.is_guided
    system.manager.recover(print)
    assert system.is_guided


def test_event_log_that_was_cleared_meanwhile_is_left_to_a_person() -> None:
    system = SelfRecovering()
    system.live(1.0)
    system.be_silent(0.5)
    system.faults.inject(Fault.COLLISION)
    system.client.clear_events()
    system.world.controller.events.append(41822, "No data from the UdpUc device")
    system.live(3.0)
    assert not system.is_guided


def test_egm_that_was_stopped_on_request_is_not_begun_again() -> None:
    system = SelfRecovering()
    system.manager.stop_egm()
    system.live(3.0)
    assert not system.is_guided


def test_recovery_by_itself_gives_up_after_some_attempts(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recovery, "ATTEMPTS", 3)
    system = SelfRecovering()
    system.faults.inject(Fault.EGM_SILENCE)
    system.wait(0.5)
    system.live(5.0)
    assert not system.is_guided
    assert len(system.lines) == 3
    said = clause(message("no_datagram_came", arms=("right", "left")))
    assert said[1:] in system.lines[0]
